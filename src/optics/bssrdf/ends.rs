//! The two ends of a BSSRDF: where light enters and where it leaves.

use crate::math::DVec3;

/// Where light enters the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// The point, mm.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
    /// Unit direction of travel inside, after refraction.
    pub dir: DVec3,
}

/// Where light leaves the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exit {
    /// The point, mm.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
}
