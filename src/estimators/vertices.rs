//! Vertices and exits of a camera walk, as additional techniques see them.

use crate::geometry::Hit;
use crate::math::{DVec3, Frame};

/// A medium vertex of a walk, from which techniques start.
#[derive(Clone, Copy, Debug)]
pub(super) struct WalkVertex {
    pub point: DVec3,
    /// Direction of travel on arrival.
    pub arrival: DVec3,
    /// Density of the walk up to here under any hero, over that under its own.
    pub walks: f64,
}

/// How a walk has gone on since it last met a smooth boundary from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unscattered {
    /// The boundary has reflected it.
    Reflected,
    /// It has been refracted into the body, and nothing has happened since.
    Inside,
    /// It has gone straight through the body and out.
    Through,
    /// Otherwise.
    No,
}

/// Where a walk meets the boundary from inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct WalkExit {
    pub hit: Hit,
    /// About the shading normal.
    pub frame: Frame,
    /// Back along the walk, in that frame.
    pub wo: DVec3,
}
