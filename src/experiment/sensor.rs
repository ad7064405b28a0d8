//! The sensor in an experiment file, and how it is built.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::direction::{Direction, unit};
use crate::error::{Error, Result};
use crate::geometry::{Ray, Shape};
use crate::math::{DVec3, Frame, tan};
use crate::scene::Sensor;
use crate::scene::sensor::{
    Accepting, Ball, BodyFlux, FaceFlux, FluxFace, Orthographic, PathLength, Perspective, Probe, Rings,
    Screen, Vertex,
};

/// What is measured. Light that reaches the sensor without meeting the body is not scored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SensorEntry {
    /// Parallel rays: radiance per pixel, box filter.
    Orthographic {
        /// Columns and rows.
        #[schemars(inner(range(min = 1, max = 16384)))]
        resolution: [usize; 2],
        /// A point in the middle of the image, mm; its place along the view matters only with
        /// `acceptance_sr`, which makes the image sharp there.
        center_mm: [f64; 3],
        /// Direction of the rays.
        toward: Direction,
        /// Points up in the image.
        up: [f64; 3],
        /// Width of the image plane, mm; the height follows from square pixels.
        #[schemars(extend("exclusiveMinimum" = 0))]
        width_mm: f64,
        /// Solid angle of the cap of directions about the view from which a pixel accepts light, sr: its
        /// value is the mean radiance over pixel and cap, weighted by the cosine to the view. By default a
        /// single direction. For bodies of finite size.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = std::f64::consts::TAU))]
        acceptance_sr: Option<f64>,
        /// Whether the means of 4 by 4 tiles are observables too, for claims on parts of the image.
        #[serde(default = "yes", skip_serializing_if = "is_true")]
        tiles: bool,
    },
    /// A pinhole: radiance per pixel, box filter.
    Perspective {
        /// Columns and rows.
        #[schemars(inner(range(min = 1, max = 16384)))]
        resolution: [usize; 2],
        /// The pinhole, mm; outside the body.
        position_mm: [f64; 3],
        /// The point at the middle of the image, mm.
        look_at_mm: [f64; 3],
        /// Points up in the image.
        up: [f64; 3],
        /// Vertical opening angle, degrees.
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 180))]
        fov_deg: f64,
        /// Whether the means of 4 by 4 tiles are observables too, for claims on parts of the image.
        #[serde(default = "yes", skip_serializing_if = "is_true")]
        tiles: bool,
    },
    /// Radiance along one ray.
    Probe {
        /// Its origin, mm; outside the body.
        point_mm: [f64; 3],
        /// Direction of the ray.
        toward: Direction,
        /// Independent paths whose mean is one pass.
        #[serde(default = "default_paths_per_pass")]
        #[schemars(range(min = 1, max = 1048576))]
        paths_per_pass: usize,
    },
    /// Radiance that arrives at a medium vertex: for estimators of a path's last segments.
    Vertex {
        /// The vertex, mm; inside the body.
        point_mm: [f64; 3],
        /// Direction of travel of the path that arrives there.
        toward: Direction,
        /// Independent paths whose mean is one pass.
        #[serde(default = "default_paths_per_pass")]
        #[schemars(range(min = 1, max = 1048576))]
        paths_per_pass: usize,
    },
    /// Flux that leaves the body, by bins of the cosine between exit direction and axis.
    /// `half_space` and `slab`: radiant exitance per face, observables `top_i`, `bottom_i` (W/mm^2).
    /// Other shapes: flux of the whole body, observables `flux_i` (W).
    Flux {
        /// Number of bins: of equal width in the cosine, over 0..1 on each face, over -1..1 else.
        #[schemars(range(min = 1, max = 1024))]
        bins: usize,
        /// Axis of the cosine; +z on `half_space` and `slab` (the outward normal of each face).
        axis: [f64; 3],
        /// Independent paths per bin whose mean is one pass.
        #[serde(default = "default_paths_per_pass")]
        #[schemars(range(min = 1, max = 1048576))]
        paths_per_pass: usize,
    },
    /// Radiant exitance of a `half_space` or `slab` by the distance between entry and exit of the light.
    ///
    /// Of the top face, W/mm^2; the distance is measured along the face. Observables `ring_i`, and `all` for
    /// all distances, those beyond the last ring included.
    Rings {
        /// Edges of the rings, mm, increasing from 0 or more.
        #[schemars(length(min = 2, max = 1025))]
        edges_mm: Vec<f64>,
        /// Independent paths whose mean is one pass.
        #[serde(default = "default_paths_per_pass")]
        #[schemars(range(min = 1, max = 1048576))]
        paths_per_pass: usize,
    },
    /// Path length in a finite body.
    ///
    /// Observables: `incident`, the radiance that falls onto the surface from outside, light from other
    /// parts of the body included, as a mean over surface and cosine; `path_length`, the same times the
    /// length of the light's path in the medium, mm W/(mm^2 sr), all of it light that leaves the body.
    PathLength {
        /// A ball in the body: only lengths within it count. By default all lengths count.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ball: Option<BallEntry>,
        /// Independent paths whose mean is one pass.
        #[serde(default = "default_paths_per_pass")]
        #[schemars(range(min = 1, max = 1048576))]
        paths_per_pass: usize,
    },
}

/// A ball.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BallEntry {
    /// Centre, mm.
    pub center_mm: [f64; 3],
    /// Radius, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius_mm: f64,
}

fn yes() -> bool {
    true
}

fn is_true(value: &bool) -> bool {
    *value
}

fn default_paths_per_pass() -> usize {
    1024
}

impl SensorEntry {
    /// Whether it has an image.
    pub fn has_pixels(&self) -> bool {
        matches!(self, SensorEntry::Orthographic { .. } | SensorEntry::Perspective { .. })
    }

    /// The dotted key of the point at which its rays start, where they start at one point.
    pub(crate) fn key_of_position(&self) -> Option<&'static str> {
        match self {
            SensorEntry::Perspective { .. } => Some("sensor.perspective.position_mm"),
            SensorEntry::Probe { .. } => Some("sensor.probe.point_mm"),
            SensorEntry::Vertex { .. } => Some("sensor.vertex.point_mm"),
            _ => None,
        }
    }

    /// The sensor, for a body of this shape.
    ///
    /// # Errors
    /// A shape that the sensor does not support.
    pub fn build(&self, shape: &Shape) -> Result<Sensor> {
        Ok(match self {
            SensorEntry::Orthographic {
                resolution,
                center_mm,
                toward,
                up,
                width_mm,
                acceptance_sr,
                tiles,
            } => {
                let pixel = width_mm / resolution[0] as f64;
                let screen = screen(*resolution, toward.unit(), *up, pixel, *tiles);
                let center = DVec3::from(*center_mm);
                match (acceptance_sr, shape.bounds()) {
                    (None, _) => {
                        let center = before(shape, &screen, center);
                        Sensor::Orthographic(Orthographic { screen, center })
                    }
                    (Some(solid_angle), Some(bounds)) => {
                        let height = solid_angle / (2.0 * PI);
                        Sensor::Accepting(Accepting::new(screen, center, height, bounds))
                    }
                    (Some(_), None) => {
                        return Err(Error::input_help(
                            "`acceptance_sr` needs a body of finite size",
                            "leave it out, or measure the `flux` of a half_space or slab",
                        ));
                    }
                }
            }
            SensorEntry::Perspective { resolution, position_mm, look_at_mm, up, fov_deg, tiles } => {
                let pinhole = DVec3::from(*position_mm);
                let view = (DVec3::from(*look_at_mm) - pinhole).normalize();
                let half = tan(0.5 * fov_deg.to_radians());
                let pixel = 2.0 * half / resolution[1] as f64;
                let screen = screen(*resolution, view, *up, pixel, *tiles);
                Sensor::Perspective(Perspective { screen, pinhole })
            }
            SensorEntry::Vertex { point_mm, toward, paths_per_pass } => {
                Sensor::Vertex(Vertex { ray: ray(*point_mm, toward), paths: *paths_per_pass })
            }
            SensorEntry::Probe { point_mm, toward, paths_per_pass } => {
                Sensor::Probe(Probe { ray: ray(*point_mm, toward), paths: *paths_per_pass })
            }
            SensorEntry::Flux { bins, axis, paths_per_pass } => {
                let (bins, paths) = (*bins, *paths_per_pass);
                match shape.bounds() {
                    Some(bounds) => {
                        let frame = Frame::about(unit(*axis));
                        Sensor::BodyFlux(BodyFlux { bounds, frame, bins, paths })
                    }
                    None => Sensor::FaceFlux(FaceFlux { faces: faces(shape), bins, paths }),
                }
            }
            SensorEntry::Rings { edges_mm, paths_per_pass } => {
                if shape.bounds().is_some() {
                    return Err(Error::input_help(
                        "the sensor `rings` looks at a plane without end",
                        "use it with a half_space or a slab",
                    ));
                }
                let (reach, edges) = (outside(shape), edges_mm.clone());
                Sensor::Rings(Rings { reach, edges, paths: *paths_per_pass })
            }
            SensorEntry::PathLength { ball, paths_per_pass } => {
                let (Some(bounds), Some(area)) = (shape.bounds(), shape.area()) else {
                    return Err(Error::input_help(
                        "the sensor `path_length` needs a body of finite size",
                        "use it with a body other than a half-space or a slab",
                    ));
                };
                let flux =
                    BodyFlux { bounds, frame: Frame::about(DVec3::Z), bins: 1, paths: *paths_per_pass };
                let ball = ball.as_ref().map(|words| within(shape, words)).transpose()?;
                Sensor::PathLength(PathLength { flux, area, ball })
            }
        })
    }
}

/// A ball that is wholly inside the body.
fn within(shape: &Shape, words: &BallEntry) -> Result<Ball> {
    let ball = Ball { center: DVec3::from(words.center_mm), radius: words.radius_mm };
    if shape.contains(ball.center) && shape.clearance(ball.center) >= ball.radius {
        return Ok(ball);
    }
    Err(Error::input_help(
        format!("the ball of `path_length` at {} mm is not known to be inside the body", ball.center),
        "move it or make it smaller; on a mesh it needs a margin of a fifteenth of the longest side",
    ))
}

fn ray(point_mm: [f64; 3], toward: &Direction) -> Ray {
    Ray { origin: DVec3::from(point_mm), dir: toward.unit() }
}

/// Square pixels of side `pixel`.
fn screen(
    [width, height]: [usize; 2],
    view: DVec3,
    up: [f64; 3],
    pixel: f64,
    has_tiles: bool,
) -> Screen {
    let right = view.cross(DVec3::from(up)).normalize();
    let down = view.cross(right);
    Screen { width, height, right: pixel * right, down: pixel * down, view, has_tiles }
}

/// The middle of a plane before the body on which the parallel rays of `screen` start: where they start
/// does not change what they see, as long as none starts behind a part of the body. The plane is moved
/// back along the view until the whole of it is beyond the bounding sphere, or on the viewer's side of a
/// half-space or slab.
fn before(shape: &Shape, screen: &Screen, center: DVec3) -> DVec3 {
    let half_width = 0.5 * screen.width as f64 * screen.right;
    let half_height = 0.5 * screen.height as f64 * screen.down;
    let corners = [half_width + half_height, half_width - half_height];
    let corners = corners.iter().flat_map(|c| [center + *c, center - *c]);
    let back = match shape.bounds() {
        // The plane is perpendicular to the view: one distance holds for all of it.
        Some(bounds) => (center - bounds.center).dot(screen.view) + 2.0 * bounds.radius,
        None => {
            let thickness = if let Shape::Slab { thickness } = shape { *thickness } else { 0.0 };
            let reach = half_width.length();
            // Distance along the view to a height `reach` outside the face that is seen.
            let needed = |corner: DVec3| match screen.view.z {
                z if z < 0.0 => (reach - corner.z) / -z,
                z if z > 0.0 => (reach + corner.z + thickness) / z,
                _ => 0.0,
            };
            corners.map(needed).fold(0.0, f64::max)
        }
    };
    center - back.max(0.0) * screen.view
}

/// How far outside a half-space or slab rays start, mm: of the body's own size, so that scaled scenes
/// are the same.
fn outside(shape: &Shape) -> f64 {
    if let Shape::Slab { thickness } = shape { *thickness } else { 1.0 }
}

fn faces(shape: &Shape) -> Vec<FluxFace> {
    let thickness = if let Shape::Slab { thickness } = shape { *thickness } else { 0.0 };
    let reach = outside(shape);
    let top = FluxFace { name: "top", point: DVec3::ZERO, reach, frame: Frame::about(DVec3::Z) };
    let point = DVec3::new(0.0, 0.0, -thickness);
    let bottom = FluxFace { name: "bottom", point, reach, frame: Frame::about(-DVec3::Z) };
    if thickness > 0.0 { vec![top, bottom] } else { vec![top] }
}
