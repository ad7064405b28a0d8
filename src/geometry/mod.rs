//! Shapes: exact half-space, slab, box and sphere, and closed triangle meshes, behind one interface.
//! All lengths are in mm, and all arithmetic that a result depends on is in f64. Scaling a scene by a power
//! of two scales every result exactly (there is no absolute epsilon).

mod analytic;
#[cfg(test)]
mod audit;
mod balls;
mod body_surface;
mod clearance;
mod cone;
mod facing;
mod imported;
mod lines;
mod measure;
mod mesh;
mod mesh_file;
mod near_surface;
mod node;
mod normals;
mod obj;
mod ply;
pub mod procedural;
mod several;
mod surface;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod throughput;
mod topology;
mod tree;
mod triangle;
mod voxels;

pub use body_surface::{BodyPoint, BodySampler, FaceChoice};
pub use cone::Cone;
pub use lines::{Line, Lines, Met};
pub use mesh::Mesh;
pub use mesh_file::{Placement, load_mesh};
pub use normals::Normals;
pub use several::Flights;
pub use surface::{SurfacePoint, SurfaceSampler, Triangle};

use crate::math::{DVec3, Frame};
use crate::sampling::warp::square_to_disc;

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
    /// On the side of the medium.
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
    /// The primitive that was hit.
    pub face: FaceId,
}

/// A sphere that holds a whole body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// Centre, mm.
    pub center: DVec3,
    /// Radius, mm.
    pub radius: f64,
}

impl BoundingSphere {
    /// A ray along -`out` that starts a diameter off on the disc across it, uniform per area (pi R^2):
    /// all light that goes this way and meets the body comes through that disc.
    pub fn beam(&self, out: DVec3, u: [f64; 2]) -> Ray {
        let across = Frame::about(out);
        let [x, y] = square_to_disc(u);
        let origin = self.center + self.radius * (2.0 * out + x * across.s + y * across.t);
        Ray { origin, dir: -out }
    }
}

/// Least and greatest coordinates of points.
pub(crate) fn extent(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points.fold(empty, |(min, max), point| (min.min(point), max.max(point)))
}

/// The body. Its faces, as [`Hit::face`] numbers them:
///
/// | shape | faces |
/// |---|---|
/// | half-space | 0 |
/// | slab | 0 top (z = 0), 1 bottom |
/// | box | 0 -x, 1 +x, 2 -y, 3 +y, 4 -z, 5 +z |
/// | sphere | 0 |
/// | mesh | the triangle's index |
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one body in a scene")]
pub enum Shape {
    /// The half-space z < 0.
    HalfSpace,
    /// -thickness < z < 0.
    Slab {
        /// Thickness, mm; positive.
        thickness: f64,
    },
    /// An axis-aligned box about the origin.
    Box {
        /// Half its edge lengths, mm; positive.
        half: DVec3,
    },
    /// A sphere about the origin.
    Sphere {
        /// Radius, mm; positive.
        radius: f64,
    },
    /// A closed triangle mesh.
    Mesh(Mesh),
}

impl Shape {
    /// The closest crossing with `t` in (0, `t_max`] at which a ray that travels on `side` leaves
    /// it: `dir . normal > 0` for a ray inside, `< 0` outside. Crossings of the other orientation
    /// are not seen, so a ray that starts on the surface meets no rounding ghost of a neighbour. On
    /// a mesh the orientation is exact; where a ray grazes, the dot product with the rounded normal
    /// may come out as zero or with the other sign.
    ///
    /// `from` is the face that the ray starts on. A planar face is never met again; the sphere
    /// reports its other root. The ray must start on `side`, or on the surface and go to `side`;
    /// where rounding has put the origin a last digit beyond a half-space, slab, box or sphere, a
    /// ray inside leaves at once (`t` is the smallest positive number).
    pub fn intersect(&self, ray: &Ray, side: Side, from: Option<FaceId>, t_max: f64) -> Option<Hit> {
        let range = analytic::Range { side, from, t_max };
        match *self {
            Shape::HalfSpace => analytic::half_space(ray, range),
            Shape::Slab { thickness } => analytic::slab(thickness, ray, range),
            Shape::Box { half } => analytic::cuboid(half, ray, range),
            Shape::Sphere { radius } => analytic::sphere(radius, ray, range),
            Shape::Mesh(ref mesh) => mesh.intersect(ray, side, from, t_max),
        }
    }

    /// What [`Self::intersect`] finds for a ray from a point inside, however far the boundary is. A sphere is inlined: of several
    /// rays from one point, the distance of that point to the boundary is computed once.
    #[inline]
    pub fn leave(&self, ray: &Ray) -> Option<Hit> {
        let range = analytic::Range { side: Side::Inside, from: None, t_max: f64::INFINITY };
        match *self {
            Shape::Sphere { radius } => analytic::sphere(radius, ray, range),
            _ => self.intersect(ray, range.side, range.from, range.t_max),
        }
    }

    /// What [`Self::intersect`] finds for a flight of length `t` inside the body.
    #[inline]
    pub fn end_of_flight(&self, ray: &Ray, from: Option<FaceId>, t: f64) -> Option<Hit> {
        if self.is_clear(ray, ray.at(t), t) { None } else { self.end_of_unclear(ray, from, t) }
    }

    /// The same of a flight that is not clear.
    #[inline]
    pub(crate) fn end_of_unclear(&self, ray: &Ray, from: Option<FaceId>, t: f64) -> Option<Hit> {
        match self {
            Shape::Mesh(mesh) => mesh.end_of_unclear(ray, from, t),
            _ => self.intersect(ray, Side::Inside, from, t),
        }
    }

    /// Whether a flight of length `t` from a point of the body (on or in it, but for rounding) to `end` surely has met nothing:
    /// most flights of a walk end in the medium. In a mesh both ends show that, in a convex shape the end alone. That end must be
    /// farther inside than the rounding of what [`Self::intersect`] computes: a crossing of a plane is known to some 2^-53 of
    /// the shape's size (of the half-space: of the depth of the start). On a sphere of radius 1 a chord that reaches a depth of
    /// 5e-10 is at least 6e-5 long, so that the square root that its ends are found by has lost no more than 1e-11.
    #[inline]
    pub(crate) fn is_clear(&self, ray: &Ray, end: DVec3, t: f64) -> bool {
        match *self {
            Shape::HalfSpace => analytic::ends_in_half_space(ray.origin, end, t),
            Shape::Slab { thickness } => analytic::ends_in_slab(thickness, end),
            Shape::Box { half } => analytic::ends_in_cuboid(half, end),
            Shape::Sphere { radius } => analytic::ends_in_sphere(radius, end),
            Shape::Mesh(ref mesh) => mesh.is_clear(ray.origin, end),
        }
    }

    /// Whether a ray outside meets the body at all: the shadow ray of a light at infinity. The same
    /// answer as `intersect(ray, Side::Outside, from, INFINITY).is_some()`, sooner.
    pub fn occluded(&self, ray: &Ray, from: Option<FaceId>) -> bool {
        match self {
            Shape::Mesh(mesh) => mesh.occluded(ray, from),
            _ => self.intersect(ray, Side::Outside, from, f64::INFINITY).is_some(),
        }
    }

    /// A sphere around the body; none for the unbounded half-space and slab.
    pub fn bounds(&self) -> Option<BoundingSphere> {
        match *self {
            Shape::HalfSpace | Shape::Slab { .. } => None,
            Shape::Box { half } => Some(BoundingSphere { center: DVec3::ZERO, radius: half.length() }),
            Shape::Sphere { radius } => Some(BoundingSphere { center: DVec3::ZERO, radius }),
            Shape::Mesh(ref mesh) => Some(mesh.bounds()),
        }
    }

    /// Whether the point is inside the body. A point on the surface is not inside an analytic
    /// shape; on a mesh, rounding decides.
    pub fn contains(&self, point: DVec3) -> bool {
        match *self {
            Shape::HalfSpace => point.z < 0.0,
            Shape::Slab { thickness } => -thickness < point.z && point.z < 0.0,
            Shape::Box { half } => point.abs().cmplt(half).all(),
            Shape::Sphere { radius } => point.length() < radius,
            Shape::Mesh(ref mesh) => mesh.contains(point),
        }
    }

    /// Whether the point is inside the body or on its surface (on a mesh, rounding decides).
    pub fn covers(&self, point: DVec3) -> bool {
        match *self {
            Shape::HalfSpace => point.z <= 0.0,
            Shape::Slab { thickness } => -thickness <= point.z && point.z <= 0.0,
            Shape::Box { half } => point.abs().cmple(half).all(),
            Shape::Sphere { radius } => point.length() <= radius,
            Shape::Mesh(ref mesh) => mesh.contains(point),
        }
    }

    /// A lower bound of the distance from a point of the body to its surface, mm; exact for analytic
    /// shapes, and cheap.
    pub fn clearance(&self, point: DVec3) -> f64 {
        match *self {
            Shape::HalfSpace => -point.z,
            Shape::Slab { thickness } => (-point.z).min(thickness + point.z),
            Shape::Box { half } => (half - point.abs()).min_element(),
            Shape::Sphere { radius } => radius - point.length(),
            Shape::Mesh(ref mesh) => mesh.clearance(point),
        }
    }

    /// A lower bound of the distance from a point of the body to its surface along any direction of a cone, mm, and cheap;
    /// infinite where no direction of the cone leads out. For analytic shapes it is the least distance, but for a part of 1e-9
    /// that covers rounding; of a mesh the larger one of [`Self::clearance`] and of the distance to the surface of a ball that has
    /// no triangles inside.
    #[inline]
    pub fn clearance_within(&self, point: DVec3, cone: &Cone) -> f64 {
        match *self {
            Shape::HalfSpace => cone.through_half_space(point),
            Shape::Slab { thickness } => cone.through_slab(thickness, point),
            Shape::Box { half } => cone.through_cuboid(half, point),
            Shape::Sphere { radius } => cone.through_sphere(radius, point),
            Shape::Mesh(ref mesh) => mesh.clearance_within(point, cone),
        }
    }

    /// Whether the body is known to be convex: then all its points see each other.
    pub fn is_convex(&self) -> bool {
        !matches!(self, Shape::Mesh(_))
    }

    /// Estimate of the memory that making the shape needs for a moment beside what it holds, bytes.
    ///
    /// For a mesh 200 a triangle: the file's numbers, its sides in the order of edges, and what the
    /// hierarchy is made from. Measured by the peak of the process less its 21 MiB: 129 and 151 with
    /// 327,680 and 1,310,720 triangles of a bumpy sphere, 197 with 869,178 from a file. And a grid of normals, of 13 MB at most.
    pub fn building_bytes(&self) -> usize {
        match self {
            Shape::Mesh(mesh) => mesh.building_bytes(),
            _ => 0,
        }
    }

    /// Estimate of the memory that the shape holds, bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Shape>()
            + match self {
                Shape::Mesh(mesh) => mesh.heap_bytes(),
                _ => 0,
            }
    }
}
