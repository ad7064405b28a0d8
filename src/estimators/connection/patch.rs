//! The boundary about one of its points: normals, and the derivative of the shading normal.

use crate::geometry::{FaceId, Mesh, Shape};
use crate::math::DVec3;

/// A point of the boundary with its first-order surroundings.
#[derive(Clone, Copy, Debug)]
pub(in crate::estimators) struct SurfacePatch {
    pub point: DVec3,
    pub face: FaceId,
    /// Geometric outward unit normal.
    pub normal: DVec3,
    /// Shading normal, unit.
    pub shading: DVec3,
    turning: Turning,
}

/// How the shading normal changes along the surface.
#[derive(Clone, Copy, Debug)]
enum Turning {
    /// Planes and flat facets.
    None,
    /// A sphere about the origin, by its curvature, 1/mm.
    Sphere(f64),
    /// Interpolated: N = unit(n_0 + u m_0 + v m_1), u and v linear in the point.
    Interpolated {
        /// Gradients of u and v, 1/mm.
        gradients: [DVec3; 2],
        /// m_0 and m_1 over the length of the sum.
        slopes: [DVec3; 2],
    },
}

impl SurfacePatch {
    /// About a point of a plane.
    pub(super) fn plane(point: DVec3, face: FaceId, normal: DVec3) -> SurfacePatch {
        SurfacePatch { point, face, normal, shading: normal, turning: Turning::None }
    }

    /// About a point of a sphere around the origin, given by the outward normal.
    pub(super) fn sphere(radius: f64, normal: DVec3) -> SurfacePatch {
        let turning = Turning::Sphere(1.0 / radius);
        SurfacePatch { point: normal * radius, face: FaceId(0), normal, shading: normal, turning }
    }

    /// About a point of a body, as intersection reports it.
    pub(in crate::estimators) fn at(
        shape: &Shape,
        face: FaceId,
        point: DVec3,
        normal: DVec3,
    ) -> SurfacePatch {
        match shape {
            Shape::Sphere { radius } => SurfacePatch::sphere(*radius, normal),
            Shape::Mesh(mesh) => {
                let facet = Facet::new(mesh, face.0);
                facet.patch(facet.place(point))
            }
            _ => SurfacePatch::plane(point, face, normal),
        }
    }

    /// The same in all directions, 1/mm, where the shading normal is the geometric one; `None` on triangles
    /// with interpolated normals.
    pub(super) fn curvature(&self) -> Option<f64> {
        match self.turning {
            Turning::None => Some(0.0),
            Turning::Sphere(curvature) => Some(curvature),
            Turning::Interpolated { .. } => None,
        }
    }

    /// Change of the shading normal, to first order, along a step in the tangent plane.
    #[inline]
    pub(super) fn turn(&self, step: DVec3) -> DVec3 {
        match self.turning {
            Turning::None => DVec3::ZERO,
            Turning::Sphere(curvature) => step * curvature,
            Turning::Interpolated { gradients: [u, v], slopes: [p, q] } => {
                let change = p * step.dot(u) + q * step.dot(v);
                change - self.shading * change.dot(self.shading)
            }
        }
    }
}

/// A triangle of a mesh: p = a + u e_0 + v e_1, N = unit(n + u m_0 + v m_1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    pub index: u32,
    /// Indices of its corners, which order its edges.
    pub vertices: [u32; 3],
    pub corner: DVec3,
    pub edges: [DVec3; 2],
    /// Geometric outward unit normal.
    pub normal: DVec3,
    /// The shading normal at the corner and its change along u and v; none with flat shading.
    pub shading: Option<(DVec3, [DVec3; 2])>,
}

impl Facet {
    pub(super) fn new(mesh: &Mesh, index: u32) -> Facet {
        let vertices = mesh.triangles()[index as usize];
        let [a, b, c] = vertices.map(|i| mesh.vertices()[i as usize]);
        let edges = [b - a, c - a];
        let normal = edges[0].cross(edges[1]).normalize();
        let shading = mesh.normals().map(|normals| {
            let [n, p, q] = normals.corners[index as usize].map(|i| normals.vectors[i as usize]);
            (n, [p - n, q - n])
        });
        Facet { index, vertices, corner: a, edges, normal, shading }
    }

    /// The point at barycentric coordinates u, v.
    pub(super) fn at(&self, [u, v]: [f64; 2]) -> DVec3 {
        self.corner + self.edges[0] * u + self.edges[1] * v
    }

    /// Gradients of u and v along its plane, 1/mm.
    fn gradients(&self) -> [DVec3; 2] {
        let [p, q] = self.edges;
        let across = p.cross(q);
        let scale = 1.0 / across.length_squared();
        [q.cross(across) * scale, across.cross(p) * scale]
    }

    /// Barycentric coordinates of a point of its plane.
    pub(super) fn place(&self, point: DVec3) -> [f64; 2] {
        self.gradients().map(|gradient| gradient.dot(point - self.corner))
    }

    /// Its surroundings at barycentric coordinates. Where interpolated normals vanish the shading normal
    /// is the geometric one, as intersection has it.
    pub(super) fn patch(&self, place: [f64; 2]) -> SurfacePatch {
        let flat = SurfacePatch::plane(self.at(place), FaceId(self.index), self.normal);
        let Some((n, m)) = self.shading else { return flat };
        let sum = n + m[0] * place[0] + m[1] * place[1];
        let length = sum.length();
        if length.is_nan() || length <= f64::MIN_POSITIVE {
            return flat;
        }
        let slopes = m.map(|m| m / length);
        let turning = Turning::Interpolated { gradients: self.gradients(), slopes };
        SurfacePatch { shading: sum / length, turning, ..flat }
    }

    /// Whether a point belongs to it. Of an edge between two facets the one owns it that runs along it
    /// from the lower to the higher index, so that no point of an edge is lost or counted twice. Corners
    /// belong to any number of facets.
    pub(super) fn owns(&self, [u, v]: [f64; 2]) -> bool {
        let [a, b, c] = self.vertices;
        let on = |weight: f64, from: u32, to: u32| if from < to { weight >= 0.0 } else { weight > 0.0 };
        on(u, c, a) && on(v, a, b) && on(1.0 - u - v, b, c)
    }
}
