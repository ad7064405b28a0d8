//! Points on triangles and meshes.
//!
//! Chart of a triangle (a, b, c): s in [0, 1] from a to the side bc, v in [0, 1] along the parallel to
//! bc, the point a + s ((b - a) (1 - v) + (c - a) v); |d/ds x d/dv| = s |(b - a) x (c - a)| = 2 area s.

use schemars::JsonSchema;
use serde::Deserialize;

use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler};
use crate::error::Result;
use crate::geometry::{FaceChoice, FaceId, Mesh, SurfaceSampler, Triangle, procedural};
use crate::math::DVec3;
use crate::sampling::stream::Stream;

/// `triangle` in experiment files.
pub const TRIANGLE: SamplerKind = sampler_kind!(
    "triangle",
    "points of a triangle, uniform per area",
    TriangleOptions => |o| Ok(TriangleSampler::new(o.corners_mm))
);

/// Options of `triangle`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TriangleOptions {
    /// Its corners, mm.
    corners_mm: [[f64; 3]; 3],
}

/// `mesh_surface` in experiment files.
pub const MESH: SamplerKind = sampler_kind!(
    "mesh_surface",
    "points on a mesh, its triangles by area or by index",
    MeshOptions => |o| Ok(MeshSampler::new(&o.shape.mesh()?, o.triangles == FaceChoice::Area))
);

/// Options of `mesh_surface`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MeshOptions {
    /// Shape of the mesh.
    shape: UnevenShape,
    /// How a triangle is chosen.
    triangles: FaceChoice,
}

/// Meshes of triangles of very different sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum UnevenShape {
    /// A thin plate with a small hole: 64 triangles, areas 1 to 750.
    DrilledBox,
    /// A torus whose inner rim is nearly closed: 192 triangles, areas 1 to 13.
    Torus,
}

impl UnevenShape {
    fn mesh(self) -> Result<Mesh> {
        match self {
            UnevenShape::DrilledBox => procedural::drilled_box(DVec3::new(1.5, 1.0, 0.05), [1, 1], 0.02),
            UnevenShape::Torus => procedural::torus(1.0, 0.9, [12, 8], false),
        }
    }
}

/// s and v of a point, and how far it is off the triangle's plane in units of its longest side.
fn coordinates(Triangle([a, b, c]): &Triangle, point: DVec3) -> ([f64; 2], f64) {
    let cross = (*b - *a).cross(*c - *a);
    let to = point - *a;
    // Weights of b and c as ratios of areas.
    let weight_b = to.cross(*c - *a).dot(cross) / cross.length_squared();
    let weight_c = (*b - *a).cross(to).dot(cross) / cross.length_squared();
    let s = weight_b + weight_c;
    let size = (*b - *a).length().max((*c - *a).length());
    let v = if s > 0.0 { weight_c / s } else { 0.5 };
    ([within(s), within(v)], (to.dot(cross) / cross.length() / size).abs())
}

/// Rounding beyond an end is put back, more is left outside.
fn within(x: f64) -> f64 {
    if (-1e-11..=1.0 + 1e-11).contains(&x) { x.clamp(0.0, 1.0) } else { x }
}

fn pieces(name: String) -> Piece {
    Piece::plane(name, [Coordinate::over(0.0, 1.0), Coordinate::over(0.0, 1.0)])
}

/// The centroid: weight 1/3 of a, of b and of c.
fn weights() -> Vec<Contrast> {
    vec![
        Contrast::of("mean weight of b", Some(1.0 / 3.0), |[s, v]| s * (1.0 - v)),
        Contrast::of("mean weight of c", Some(1.0 / 3.0), |[s, v]| s * v),
    ]
}

/// The area of a triangle by the lengths of its sides (Heron, in Kahan's stable order).
fn area(Triangle([a, b, c]): &Triangle) -> f64 {
    let mut sides = [(*a - *b).length(), (*b - *c).length(), (*c - *a).length()];
    sides.sort_by(|x, y| y.total_cmp(x));
    let [a, b, c] = sides;
    0.25 * ((a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))).sqrt()
}

/// Sampler of uniform points on one triangle.
pub struct TriangleSampler {
    triangle: Triangle,
}

impl TriangleSampler {
    /// With these corners, mm.
    pub fn new(corners: [[f64; 3]; 3]) -> TriangleSampler {
        TriangleSampler { triangle: Triangle(corners.map(DVec3::from_array)) }
    }
}

impl Sampler for TriangleSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let (at, off) = coordinates(&self.triangle, self.triangle.sample(stream.draw2()));
        if off > 1e-12 {
            return Draw::Null; // off its plane: an error, because it never returns nothing
        }
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![pieces("triangle".into())]
    }

    fn density(&self, _piece: usize, [s, _]: [f64; 2]) -> f64 {
        self.triangle.pdf_area() * 2.0 * area(&self.triangle) * s
    }

    fn contrasts(&self) -> Vec<Contrast> {
        weights()
    }
}

/// The surface of a mesh, a piece for every triangle.
pub struct MeshSampler {
    code: SurfaceSampler,
    triangles: Vec<Triangle>,
}

impl MeshSampler {
    /// Triangles by area, or else each as likely as any other.
    pub fn new(mesh: &Mesh, by_area: bool) -> MeshSampler {
        let code =
            if by_area { SurfaceSampler::by_area(mesh) } else { SurfaceSampler::uniform_index(mesh) };
        let corner = |i: u32| mesh.vertices()[i as usize];
        let triangles = mesh.triangles().iter().map(|t| Triangle(t.map(corner))).collect();
        MeshSampler { code, triangles }
    }
}

impl Sampler for MeshSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let drawn = self.code.sample(stream.draw3());
        let piece = drawn.triangle.0 as usize;
        let triangle = &self.triangles[piece];
        let (at, off) = coordinates(triangle, drawn.point);
        let Triangle([a, b, c]) = *triangle;
        let turned = drawn.normal.dot((b - a).cross(c - a).normalize());
        if off > 1e-12 || turned < 1.0 - 1e-12 {
            return Draw::Null; // off its plane, or another's normal: an error
        }
        Draw::Point { piece, at, density: drawn.pdf_area * 2.0 * area(triangle) * at[0] }
    }

    fn pieces(&self) -> Vec<Piece> {
        (0..self.triangles.len()).map(|k| pieces(format!("triangle {k}"))).collect()
    }

    fn density(&self, piece: usize, [s, _]: [f64; 2]) -> f64 {
        self.code.pdf_area(FaceId(piece as u32)) * 2.0 * area(&self.triangles[piece]) * s
    }

    fn contrasts(&self) -> Vec<Contrast> {
        weights()
    }
}
