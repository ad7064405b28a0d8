//! Shapes: exact half-space, slab, box and sphere, and closed triangle meshes, behind one interface.
//! All lengths in mm, all arithmetic that a result sees in f64; scaling a scene by a power of two
//! scales every result exactly (no absolute epsilon anywhere).

use crate::math::DVec3;

/// A ray: `origin + t dir`, `dir` a unit vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, mm.
    pub origin: DVec3,
    /// Unit direction of travel.
    pub dir: DVec3,
}

impl Ray {
    /// The point at distance `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.dir * t
    }
}

/// Which side of the body's boundary a ray travels on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// In the vacuum around the body.
    Outside,
    /// In the medium.
    Inside,
}

/// A surface primitive (a plane, a box face, a triangle), so that a ray that starts on it does not
/// meet it again. On curved primitives (the sphere) the shape itself excludes the starting root.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaceId(pub u32);

/// A crossing of the boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, mm.
    pub t: f64,
    /// The point, put back onto the surface as exactly as the shape allows.
    pub point: DVec3,
    /// Geometric outward unit normal.
    pub normal: DVec3,
    /// Shading normal: interpolated on smooth meshes, else equal to `normal`.
    pub shading_normal: DVec3,
    /// The primitive.
    pub face: FaceId,
}
