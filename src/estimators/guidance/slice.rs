//! The guide of walks in a plane through the body, for pictures.

use super::{Aim, Guidance};
use crate::estimators::guidance::importance::extent;
use crate::geometry::Shape;
use crate::math::DVec3;
use crate::optics::guided::StepGuide;
use crate::scene::Scene;

/// Nodes along the longer side of a slice.
const NODES: f64 = 40.0;

/// What guides walks, at nodes of the plane of x and z through the middle of a body: a row after the other from the top
/// (largest z), from the least x on.
#[derive(Clone, Debug, PartialEq)]
pub struct GuideSlice {
    /// The x that it reaches from and to, mm.
    pub x_mm: [f64; 2],
    /// The z that it reaches from and to, mm.
    pub z_mm: [f64; 2],
    /// Nodes in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Importance over its largest on the slice, 0 where nothing is known and outside; its growth per mean free path along x
    /// and along z.
    pub nodes: Vec<[f64; 3]>,
}

impl Guidance {
    /// On the slice of a scene's body; `None` where no importance guides. A half-space is shown down to ten mean free paths of
    /// the thinnest band.
    pub(in crate::estimators) fn slice(&self, scene: &Scene) -> Option<GuideSlice> {
        let Aim::Solution(importance) = &self.aim else { return None };
        let extinctions = scene.medium.iter().map(|medium| medium.sigma_t).filter(|s| *s > 0.0);
        let deep = 10.0 / extinctions.fold(f64::INFINITY, f64::min);
        let layer =
            |depth: f64| [DVec3::new(-0.5 * depth, 0.0, -depth), DVec3::new(0.5 * depth, 0.0, 0.0)];
        let [low, high] = match *scene.shape {
            Shape::HalfSpace => layer(deep),
            Shape::Slab { thickness } => layer(thickness),
            _ => extent(&scene.shape)?,
        };
        let (width, height) = (high.x - low.x, high.z - low.z);
        let step = width.max(height) / NODES;
        let [columns, rows] = [width, height].map(|side| (side / step).round().max(1.0) as usize);
        let node = |index: usize| {
            let (row, column) = ((index / columns) as f64, (index % columns) as f64);
            let x = low.x + width * (column + 0.5) / columns as f64;
            let z = high.z - height * (row + 0.5) / rows as f64;
            let at = DVec3::new(x, 0.5 * (low.y + high.y), z);
            let mut guide = StepGuide::NONE;
            if !scene.shape.contains(at) {
                return [0.0; 3];
            }
            let phi = importance.at(at, &mut guide);
            if phi <= 0.0 {
                return [0.0; 3];
            }
            let growth = guide.pull.axis * guide.pull.strength();
            [phi, growth.x, growth.z]
        };
        let mut nodes: Vec<[f64; 3]> = (0..rows * columns).map(node).collect();
        let largest = nodes.iter().map(|node| node[0]).fold(0.0, f64::max);
        if largest <= 0.0 {
            return None;
        }
        nodes.iter_mut().for_each(|node| node[0] /= largest);
        Some(GuideSlice { x_mm: [low.x, high.x], z_mm: [low.z, high.z], columns, rows, nodes })
    }
}
