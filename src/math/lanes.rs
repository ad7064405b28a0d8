//! Numbers and vectors of several walks side by side, as vector instructions take them.

use super::DVec3;

/// How many walks.
pub const LANES: usize = 8;

/// A number of each walk.
pub type Lanes = [f64; LANES];

/// A vector of each walk, component by component.
pub type VectorLanes = [Lanes; 3];

/// The vector of one walk.
#[inline(always)]
pub fn vector([x, y, z]: &VectorLanes, lane: usize) -> DVec3 {
    DVec3::new(x[lane], y[lane], z[lane])
}

/// Sets the vector of one walk.
#[inline(always)]
pub fn set_vector([x, y, z]: &mut VectorLanes, lane: usize, to: DVec3) {
    (x[lane], y[lane], z[lane]) = (to.x, to.y, to.z);
}
