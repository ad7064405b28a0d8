//! Points on a surface of triangles, with their density per area.
//!
//! A triangle is chosen, then a point uniformly inside it. Chosen by area, the density is the same
//! everywhere, 1 / A. Chosen by index, triangle i of K has 1 / (K A_i): cheap to set up, but one large
//! triangle among small ones multiplies the second moment of an even integrand by K sum A_i^2 / A^2.

use super::triangle;
use super::{FaceId, Mesh};
use crate::math::DVec3;
use crate::sampling::discrete::AliasTable;
use crate::sampling::warp::square_to_triangle;

/// Three corners, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle(pub [DVec3; 3]);

impl Triangle {
    /// Area, mm^2.
    pub fn area(&self) -> f64 {
        let [a, b, c] = self.0;
        0.5 * (b - a).cross(c - a).length()
    }

    /// The point with these barycentric coordinates.
    #[inline]
    pub fn at(&self, weights: [f64; 3]) -> DVec3 {
        let [a, b, c] = self.0;
        a * weights[0] + b * weights[1] + c * weights[2]
    }

    /// A point, uniform per area.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        self.at(square_to_triangle(u))
    }

    /// Density of [`Self::sample`], 1/mm^2, on the triangle.
    #[inline]
    pub fn pdf_area(&self) -> f64 {
        1.0 / self.area()
    }
}

/// A point drawn from a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point, mm.
    pub point: DVec3,
    /// Geometric outward unit normal.
    pub normal: DVec3,
    /// The triangle's index in the mesh.
    pub triangle: FaceId,
    /// Barycentric coordinates in it, for what is interpolated.
    pub weights: [f64; 3],
    /// Density of the point, 1/mm^2.
    pub pdf_area: f64,
}

/// Draws points from the surface of a mesh.
#[derive(Clone, Debug)]
pub struct SurfaceSampler {
    faces: Vec<Face>,
    /// By area through this table; by index without.
    by_area: Option<AliasTable>,
    area: f64,
}

#[derive(Clone, Debug)]
struct Face {
    corners: Triangle,
    normal: DVec3,
    pdf_area: f64,
}

impl SurfaceSampler {
    /// Every triangle equally likely: density 1 / (K A_i).
    pub fn uniform_index(mesh: &Mesh) -> SurfaceSampler {
        let count = mesh.triangles().len() as f64;
        SurfaceSampler::new(mesh, None, |area, _| 1.0 / (count * area))
    }

    /// Every triangle in proportion to its area: density 1 / A.
    pub fn by_area(mesh: &Mesh) -> SurfaceSampler {
        let areas: Vec<f64> = triangles(mesh).map(|triangle| triangle.area()).collect();
        SurfaceSampler::new(mesh, Some(AliasTable::new(&areas)), |_, total| 1.0 / total)
    }

    fn new(mesh: &Mesh, by_area: Option<AliasTable>, pdf: impl Fn(f64, f64) -> f64) -> SurfaceSampler {
        let area = triangles(mesh).map(|triangle| triangle.area()).sum();
        let face = |corners: Triangle| Face {
            corners,
            normal: triangle::normal(&corners.0),
            pdf_area: pdf(corners.area(), area),
        };
        SurfaceSampler { faces: triangles(mesh).map(face).collect(), by_area, area }
    }

    /// A point: `u[0]` chooses the triangle, the others the place in it.
    #[inline]
    pub fn sample(&self, u: [f64; 3]) -> SurfacePoint {
        let index = match &self.by_area {
            Some(table) => table.sample(u[0]).0,
            None => ((u[0] * self.faces.len() as f64) as usize).min(self.faces.len() - 1),
        };
        let Face { corners, normal, pdf_area } = self.faces[index];
        let weights = square_to_triangle([u[1], u[2]]);
        let triangle = FaceId(index as u32);
        SurfacePoint { point: corners.at(weights), normal, triangle, weights, pdf_area }
    }

    /// Density of [`Self::sample`] on a triangle, 1/mm^2.
    #[inline]
    pub fn pdf_area(&self, triangle: FaceId) -> f64 {
        self.faces[triangle.0 as usize].pdf_area
    }

    /// The whole surface, mm^2.
    pub fn area(&self) -> f64 {
        self.area
    }
}

pub(super) fn triangles(mesh: &Mesh) -> impl Iterator<Item = Triangle> {
    mesh.triangles().iter().map(|t| Triangle(t.map(|i| mesh.vertices()[i as usize])))
}

#[cfg(test)]
mod tests {
    use super::super::procedural;
    use super::*;

    /// A thin plate with a small hole.
    fn uneven() -> Mesh {
        procedural::drilled_box(DVec3::new(1.5, 1.0, 0.05), [1, 1], 0.02).expect("closed")
    }

    fn both(mesh: &Mesh) -> [SurfaceSampler; 2] {
        [SurfaceSampler::uniform_index(mesh), SurfaceSampler::by_area(mesh)]
    }

    /// D7: the densities over all triangles add up to 1, for samplers of both kinds.
    #[test]
    fn densities_add_up_to_one() {
        let mesh = uneven();
        let areas: Vec<f64> = triangles(&mesh).map(|triangle| triangle.area()).collect();
        let [least, most] = [f64::min, f64::max].map(|f| areas.iter().copied().reduce(f).unwrap_or(0.0));
        assert!(most / least > 300.0, "{least} to {most}");
        // Top, bottom, walls, the hole's walls.
        let expected = 2.0 * (1.5 - 0.02f64 * 0.02) + 2.0 * 2.5 * 0.05 + 4.0 * 0.02 * 0.05;
        for sampler in both(&mesh) {
            let density = |(i, area): (usize, &f64)| sampler.pdf_area(FaceId(i as u32)) * area;
            let mass: f64 = areas.iter().enumerate().map(density).sum();
            assert!((mass - 1.0).abs() < 1e-12);
            assert!((sampler.area() / expected - 1.0).abs() < 1e-12, "{} {expected}", sampler.area());
        }
    }

    /// D3: every triangle gets the share of u that its density promises.
    #[test]
    fn triangles_by_enumeration() {
        let mesh = uneven();
        let n = 1u32 << 18;
        for sampler in both(&mesh) {
            let mut counts = vec![0u32; mesh.triangles().len()];
            for k in 0..n {
                let u = (f64::from(k) + 0.5) / f64::from(n);
                counts[sampler.sample([u, 0.3, 0.4]).triangle.0 as usize] += 1;
            }
            for (face, count) in sampler.faces.iter().zip(counts) {
                let share = face.pdf_area * face.corners.area();
                // At most one interval of u a slot of the table, each counted to one step.
                let bound = (mesh.triangles().len() + 1) as f64 / f64::from(n);
                assert!((f64::from(count) / f64::from(n) - share).abs() < bound);
            }
        }
    }

    /// D5: a point lies on its triangle, has its normal, and the density asked again is the one
    /// reported.
    #[test]
    fn points_lie_on_their_triangle() {
        let mesh = uneven();
        for sampler in both(&mesh) {
            for k in 0..2000u32 {
                let u = [0.618_034, 0.754_878, 0.569_840]
                    .map(|step: f64| ((f64::from(k) + 0.5) * step).fract());
                let drawn = sampler.sample(u);
                let Triangle([a, b, c]) = sampler.faces[drawn.triangle.0 as usize].corners;
                assert_eq!(drawn.pdf_area, sampler.pdf_area(drawn.triangle));
                assert!((drawn.point - a).dot(drawn.normal).abs() < 1e-15);
                let parts = [[b, c], [c, a], [a, b]]
                    .map(|[p, q]| 0.5 * (p - drawn.point).cross(q - drawn.point).dot(drawn.normal));
                let area = Triangle([a, b, c]).area();
                for (part, weight) in parts.into_iter().zip(drawn.weights) {
                    assert!(part > 0.0 && (part / area - weight).abs() < 1e-12);
                }
            }
        }
    }

    /// One triangle: inside, uniform (a half cut off by a median holds half the points), 1 / area.
    #[test]
    fn one_triangle() {
        let corners =
            [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 2.0), DVec3::new(0.0, 4.0, -1.0)];
        let triangle = Triangle(corners);
        let n = 512u32;
        let mut nearer = 0u32;
        for i in 0..n {
            for j in 0..n {
                let u = [i, j].map(|k| (f64::from(k) + 0.5) / f64::from(n));
                let [_, b, c] = square_to_triangle(u);
                nearer += u32::from(b > c);
                assert_eq!(triangle.sample(u), triangle.at(square_to_triangle(u)));
            }
        }
        assert_eq!(nearer, n * n / 2);
        assert!((triangle.pdf_area() * triangle.area() - 1.0).abs() < 1e-15);
    }
}
