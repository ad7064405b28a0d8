//! Rules of `sensor`.

use super::{At, nonzero};
use crate::experiment::direction::{Direction, unit};
use crate::experiment::schema::{SensorEntry, ShapeEntry};
use crate::math::DVec3;

/// Sines of the angle between view and `up` below this leave the image's turn undefined.
const PARALLEL: f64 = 1e-9;

/// Directions are directions, `up` is not along the view, fluxes of planes are about +z, and
/// caps of directions look at finite bodies, rings lie on planes and widen.
pub(crate) fn sensor(at: At, sensor: &SensorEntry, shape: Option<&ShapeEntry>) {
    let is_planar = matches!(shape, Some(ShapeEntry::HalfSpace {} | ShapeEntry::Slab { .. }));
    match sensor {
        SensorEntry::Orthographic { toward, up, acceptance_sr, .. } => {
            let at = at.to("orthographic");
            if acceptance_sr.is_some() && is_planar {
                at.to("acceptance_sr").report(
                    "a half_space or slab has no end: pixels accept a cap of directions from bodies of \
                     finite size only (a planar body's light in all directions is what `flux` measures)",
                );
            }
            if direction(at.to("toward"), toward) {
                upright(at.to("up"), *up, toward.unit());
            }
        }
        SensorEntry::Perspective { position_mm, look_at_mm, up, .. } => {
            let at = at.to("perspective");
            let view = DVec3::from_array(*look_at_mm) - DVec3::from_array(*position_mm);
            if view == DVec3::ZERO {
                at.to("look_at_mm").report("`look_at_mm` must differ from `position_mm`");
            } else {
                upright(at.to("up"), *up, unit(view.to_array()));
            }
        }
        SensorEntry::Probe { toward, .. } => {
            direction(at.to("probe").to("toward"), toward);
        }
        SensorEntry::Vertex { toward, .. } => {
            direction(at.to("vertex").to("toward"), toward);
        }
        SensorEntry::Flux { axis, .. } => {
            let at = at.to("flux").to("axis");
            if nonzero(at, *axis) && is_planar && !(axis[..2] == [0.0, 0.0] && axis[2] > 0.0) {
                at.report("the axis must be +z on a half_space and on a slab");
            }
        }
        SensorEntry::PathLength { .. } => {
            if is_planar {
                at.to("path_length").report_help(
                    "path lengths are measured in bodies of finite size, and a half_space or slab has no end",
                    "take another shape, or another sensor",
                );
            }
        }
        SensorEntry::Rings { edges_mm, .. } => {
            if shape.is_some() && !is_planar {
                at.to("rings").report_help(
                    "rings lie on the top face of a half_space or slab",
                    "take one of these, or another sensor",
                );
            }
            edges(at.to("rings").to("edges_mm"), edges_mm);
        }
    }
}

/// A vector that is a direction has a length.
pub(super) fn direction(at: At, direction: &Direction) -> bool {
    match direction {
        Direction::Vector(vector) => nonzero(at, *vector),
        Direction::Polar(_) => true,
    }
}

fn edges(at: At, edges: &[f64]) {
    if let Some(first) = edges.first().filter(|first| **first < 0.0) {
        at.item(0).report(format!("a radius must be at least 0, is {first}"));
    }
    for (i, pair) in edges.windows(2).enumerate().filter(|(_, pair)| pair[0] >= pair[1]) {
        at.item(i + 1).report(format!("edges must increase, {} follows {}", pair[1], pair[0]));
    }
}

fn upright(at: At, up: [f64; 3], view: DVec3) {
    if nonzero(at, up) && unit(up).cross(view).abs().max_element() <= PARALLEL {
        at.report_help(
            "`up` must not be parallel to the view",
            "take another direction, as [0, 1, 0] for a view along z",
        );
    }
}
