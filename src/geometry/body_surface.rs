//! Points on the surface of a finite body, with their density per area and the normals there.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{FaceId, Mesh, Shape, SurfaceSampler};
use crate::math::DVec3;
use crate::sampling::warp::square_to_cap;

/// How a face (triangle of a mesh, side of a box) is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum FaceChoice {
    /// In proportion to its area: density 1/A.
    #[default]
    #[serde(rename = "by_area")]
    Area,
    /// Each as likely as any other of K: density 1/(K A_i).
    #[serde(rename = "by_index")]
    Index,
}

/// A point drawn from the surface of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPoint {
    /// The point, mm.
    pub point: DVec3,
    /// Geometric outward unit normal.
    pub normal: DVec3,
    /// Interpolated on smooth meshes, else equal to `normal`.
    pub shading_normal: DVec3,
    /// The primitive, as [`super::Hit::face`] numbers it.
    pub face: FaceId,
    /// Density of the point, 1/mm^2.
    pub pdf_area: f64,
}

/// Draws points from the surface of a body.
#[derive(Clone, Debug)]
pub enum BodySampler {
    /// Of a sphere about the origin.
    Sphere {
        /// Radius, mm.
        radius: f64,
    },
    /// Of a box about the origin.
    Box {
        /// Half its edges, mm.
        half: DVec3,
        /// How faces are chosen.
        choice: FaceChoice,
    },
    /// Triangles of a mesh, by area.
    Triangles(SurfaceSampler),
}

impl BodySampler {
    /// For a finite body; none for the half-space and the slab.
    pub fn new(shape: &Shape, choice: FaceChoice) -> Option<BodySampler> {
        match shape {
            Shape::HalfSpace | Shape::Slab { .. } => None,
            Shape::Sphere { radius } => Some(BodySampler::Sphere { radius: *radius }),
            Shape::Box { half } => Some(BodySampler::Box { half: *half, choice }),
            Shape::Mesh(mesh) => Some(BodySampler::Triangles(match choice {
                FaceChoice::Area => SurfaceSampler::by_area(mesh),
                FaceChoice::Index => SurfaceSampler::uniform_index(mesh),
            })),
        }
    }

    /// A point of the body that the sampler was made for.
    #[inline]
    pub fn sample(&self, shape: &Shape, u: [f64; 3]) -> BodyPoint {
        match self {
            BodySampler::Sphere { radius } => {
                let normal = square_to_cap(2.0, [u[1], u[2]]).normalize();
                let pdf_area = 1.0 / self.area();
                BodyPoint {
                    point: *radius * normal,
                    normal,
                    shading_normal: normal,
                    face: FaceId(0),
                    pdf_area,
                }
            }
            BodySampler::Box { half, choice } => side_of_box(*half, *choice, u),
            BodySampler::Triangles(sampler) => {
                let drawn = sampler.sample(u);
                let smooth = match shape {
                    Shape::Mesh(mesh) => interpolated(mesh, drawn.triangle, drawn.weights),
                    _ => None,
                };
                BodyPoint {
                    point: drawn.point,
                    normal: drawn.normal,
                    shading_normal: smooth.unwrap_or(drawn.normal),
                    face: drawn.triangle,
                    pdf_area: drawn.pdf_area,
                }
            }
        }
    }

    /// The whole surface, mm^2.
    pub fn area(&self) -> f64 {
        match self {
            BodySampler::Sphere { radius } => 4.0 * std::f64::consts::PI * radius * radius,
            BodySampler::Box { half, .. } => 2.0 * side_areas(*half).iter().sum::<f64>(),
            BodySampler::Triangles(sampler) => sampler.area(),
        }
    }
}

fn interpolated(mesh: &Mesh, triangle: FaceId, weights: [f64; 3]) -> Option<DVec3> {
    mesh.normals().and_then(|normals| normals.at(triangle.0 as usize, weights))
}

/// Areas of one side across each axis.
fn side_areas(half: DVec3) -> [f64; 3] {
    [4.0 * half.y * half.z, 4.0 * half.z * half.x, 4.0 * half.x * half.y]
}

fn side_of_box(half: DVec3, choice: FaceChoice, u: [f64; 3]) -> BodyPoint {
    let areas = side_areas(half);
    let whole = 2.0 * areas.iter().sum::<f64>();
    let share = |axis: usize| match choice {
        FaceChoice::Area => 2.0 * areas[axis] / whole,
        FaceChoice::Index => 1.0 / 3.0,
    };
    let mut rest = u[0];
    let mut axis = 0;
    while axis < 2 && rest >= share(axis) {
        rest -= share(axis);
        axis += 1;
    }
    let is_upper = rest >= 0.5 * share(axis);
    let mut normal = DVec3::ZERO;
    normal[axis] = if is_upper { 1.0 } else { -1.0 };
    let mut point = normal * half;
    let across = [(axis + 1) % 3, (axis + 2) % 3];
    for (along, u) in across.into_iter().zip([u[1], u[2]]) {
        point[along] = half[along] * (2.0 * u - 1.0);
    }
    let face = FaceId(2 * axis as u32 + u32::from(is_upper));
    let pdf_area = 0.5 * share(axis) / areas[axis];
    BodyPoint { point, normal, shading_normal: normal, face, pdf_area }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Ray, Side};

    fn bodies() -> Vec<Shape> {
        vec![Shape::Sphere { radius: 2.0 }, Shape::Box { half: DVec3::new(0.5, 1.0, 3.0) }]
    }

    /// A ray onto the point from outside meets that face there, with that normal.
    #[test]
    fn points_lie_on_their_faces() {
        for shape in bodies() {
            for choice in [FaceChoice::Area, FaceChoice::Index] {
                let sampler = BodySampler::new(&shape, choice).expect("finite");
                for k in 0..3000u32 {
                    let step = [0.819_172_513, 0.671_043_607, 0.549_700_478];
                    let u = step.map(|step: f64| ((f64::from(k) + 0.5) * step).fract());
                    let drawn = sampler.sample(&shape, u);
                    let ray = Ray { origin: drawn.point + drawn.normal, dir: -drawn.normal };
                    let hit = shape.intersect(&ray, Side::Outside, None, 10.0).expect("meets the body");
                    assert!((hit.point - drawn.point).length() < 1e-12);
                    assert_eq!((hit.face, drawn.shading_normal), (drawn.face, drawn.normal));
                    assert!((hit.normal - drawn.normal).length() < 1e-12);
                }
            }
        }
    }

    /// The mean of 1/pdf is the area, face by face of the box too.
    #[test]
    fn densities_are_those_of_the_points() {
        for shape in bodies() {
            for choice in [FaceChoice::Area, FaceChoice::Index] {
                let sampler = BodySampler::new(&shape, choice).expect("finite");
                let mut areas = [0.0; 6];
                let n = 60_000;
                for k in 0..n {
                    let drawn = sampler.sample(&shape, [(f64::from(k) + 0.5) / f64::from(n), 0.3, 0.7]);
                    areas[drawn.face.0 as usize] += 1.0 / drawn.pdf_area / f64::from(n);
                }
                let whole: f64 = areas.iter().sum();
                assert!((whole / sampler.area() - 1.0).abs() < 1e-3, "{whole}");
                if let Shape::Box { half } = shape {
                    for (face, area) in areas.iter().enumerate() {
                        assert!(
                            (area / side_areas(half)[face / 2] - 1.0).abs() < 1e-3,
                            "{face}: {area}"
                        );
                    }
                }
            }
        }
        assert!(BodySampler::new(&Shape::HalfSpace, FaceChoice::Area).is_none());
    }
}
