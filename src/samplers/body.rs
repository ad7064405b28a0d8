//! Points on the surface of a sphere or a box.
//!
//! Charts: the sphere by (1 + z/R)/2 and azimuth in turns, each of density 1 by area (Archimedes); a
//! side of a box by its two coordinates over their range.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::Deserialize;

use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler, turns};
use crate::geometry::{BodySampler, FaceChoice, FaceId, Shape};
use crate::math::DVec3;
use crate::sampling::stream::Stream;

/// `body_surface` in experiment files.
pub const KIND: SamplerKind = sampler_kind!(
    "body_surface",
    "points on a sphere or a box",
    BodyOptions => |o| Ok(match o.shape {
        BodyShape::Sphere(radius) => BodySurfaceSampler::sphere(radius),
        BodyShape::Box(edges) => BodySurfaceSampler::cuboid(edges, o.faces),
    })
);

/// Options of `body_surface`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BodyOptions {
    /// Shape of the body.
    shape: BodyShape,
    /// How a side of a box is chosen.
    #[serde(default)]
    faces: FaceChoice,
}

/// Bodies with exact surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum BodyShape {
    /// A sphere of this radius, mm.
    Sphere(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// A box with these edges, mm.
    Box([f64; 3]),
}

/// The surface of a sphere or box.
pub struct BodySurfaceSampler {
    shape: Shape,
    code: BodySampler,
    choice: FaceChoice,
}

impl BodySurfaceSampler {
    /// Of a sphere of this radius, mm.
    pub fn sphere(radius: f64) -> BodySurfaceSampler {
        let code = BodySampler::Sphere { radius };
        BodySurfaceSampler { shape: Shape::Sphere { radius }, code, choice: FaceChoice::Area }
    }

    /// Of a box with these edges, mm.
    pub fn cuboid(edges: [f64; 3], choice: FaceChoice) -> BodySurfaceSampler {
        let half = 0.5 * DVec3::from_array(edges);
        BodySurfaceSampler {
            shape: Shape::Box { half },
            code: BodySampler::Box { half, choice },
            choice,
        }
    }

    /// Area per unit of the chart.
    fn per_chart(&self, piece: usize) -> f64 {
        match self.shape {
            Shape::Box { half } => side(half, piece / 2),
            Shape::Sphere { radius } => 4.0 * PI * radius * radius,
            _ => 0.0,
        }
    }
}

/// Area of a box's side across an axis.
fn side(half: DVec3, axis: usize) -> f64 {
    4.0 * half[(axis + 1) % 3] * half[(axis + 2) % 3]
}

impl Sampler for BodySurfaceSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let drawn = self.code.sample(&self.shape, stream.draw3());
        let FaceId(face) = drawn.face;
        let (piece, at, off) = match self.shape {
            Shape::Box { half } => {
                let axis = face as usize / 2;
                let mut normal = DVec3::ZERO;
                normal[axis] = if face % 2 == 1 { 1.0 } else { -1.0 };
                let within = |along: usize| 0.5 * (1.0 + drawn.point[along] / half[along]);
                let off = (drawn.normal - normal).length()
                    + (drawn.point[axis] - normal[axis] * half[axis]).abs();
                (face as usize, [within((axis + 1) % 3), within((axis + 2) % 3)], off)
            }
            Shape::Sphere { radius } => {
                let out = drawn.point / radius;
                (0, [0.5 * (1.0 + out.z), turns(out.x, out.y)], (out - drawn.normal).length())
            }
            _ => (0, [0.5, 0.5], f64::NAN),
        };
        if off < 1e-12 {
            Draw::Point { piece, at, density: drawn.pdf_area * self.per_chart(piece) }
        } else {
            Draw::Null // off its face, or another's normal: an error
        }
    }

    fn pieces(&self) -> Vec<Piece> {
        let square = || [Coordinate::over(0.0, 1.0), Coordinate::over(0.0, 1.0)];
        match self.shape {
            Shape::Box { .. } => (0..6).map(|k| Piece::plane(format!("side {k}"), square())).collect(),
            _ => vec![Piece::plane("sphere", [Coordinate::over(0.0, 1.0), Coordinate::turns()])],
        }
    }

    fn density(&self, piece: usize, _: [f64; 2]) -> f64 {
        match (&self.shape, self.choice) {
            (Shape::Box { .. }, FaceChoice::Index) => 1.0 / 6.0,
            (Shape::Box { half }, FaceChoice::Area) => {
                side(*half, piece / 2) / (2.0 * (0..3).map(|axis| side(*half, axis)).sum::<f64>())
            }
            _ => 1.0,
        }
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let of = |k: usize| Box::new(move |_: usize, at: [f64; 2]| at[k]);
        let mean = |name, k| Contrast { name, of: of(k), expected: Some(0.5) };
        vec![mean("mean first coordinate", 0), mean("mean second coordinate", 1)]
    }
}
