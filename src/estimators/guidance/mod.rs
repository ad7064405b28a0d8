//! Walks that know where the light is.
//!
//! At every medium vertex a walk turns and flies either as the medium does, or drawn towards where importance grows
//! ([`crate::optics::guided`]): the second with the share q, and both weighted by the balance heuristic over direction and
//! distance together, so that no event has a weight above albedo / (1 - q). Importance comes from a diffusion solution in
//! the body ([`importance`]), or grows along the normal where the walk came in (Dwivedi's sampling as production has it:
//! Krivanek & d'Eon 2014). Whatever it is, results are unbiased; only their variance changes.
//!
//! ```text
//! lights, boundary, medium, body -> Importance -> Guidance (one per band) -> GuidedBand (state of a walk)
//! ```

mod exit;
mod importance;
mod incidence;
mod steered;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::math::DVec3;
use crate::optics::guided::{GuidedTurns, Pull, StepGuide, diffuse_growth};
use crate::optics::medium::Medium;
use crate::scene::Scene;

use importance::Importance;

pub(super) use steered::GuidedBand;

/// How a walk is drawn inside the body; all ways are unbiased.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WalkDraw {
    /// As the medium scatters.
    Plain {},
    /// Towards the boundary point where the walk last came in, along its normal (Dwivedi's sampling as production renderers
    /// have it; Krivanek & d'Eon 2014).
    Dwivedi {
        /// Share of turns and flights that are guided.
        #[serde(default = "half")]
        #[schemars(range(min = 0.0, max = 0.99))]
        share: f64,
    },
    /// Towards where importance grows, by a diffusion solution in the body with what the lights let in as its source.
    Guided {
        /// Share of turns and flights that are guided.
        #[serde(default = "most")]
        #[schemars(range(min = 0.0, max = 0.99))]
        share: f64,
        /// Nodes of the solution along the longest side of a finite body.
        #[serde(default = "nodes")]
        #[schemars(range(min = 4, max = 256))]
        nodes: u32,
        /// Walks stay plain in a finite body that is nowhere as deep as this many mean free paths after similarity,
        /// 1 / (sigma_t (1 - albedo g)): light leaves it before a guide pays.
        #[serde(default = "least_depth")]
        #[schemars(range(min = 0.0))]
        least_depth: f64,
    },
}

impl Default for WalkDraw {
    fn default() -> WalkDraw {
        WalkDraw::Plain {}
    }
}

impl WalkDraw {
    /// By a solution in the body.
    pub(super) fn is_guided(&self) -> bool {
        matches!(self, WalkDraw::Guided { .. })
    }
}

fn half() -> f64 {
    0.5
}

fn most() -> f64 {
    0.95
}

fn least_depth() -> f64 {
    5.0
}

fn nodes() -> u32 {
    24
}

/// Where importance grows.
#[derive(Clone, Debug)]
enum Aim {
    /// Along the normal at the last boundary point, by so much per mean free path.
    Normal(f64),
    /// By a solution in the body.
    Solution(Importance),
}

/// What guides the walks of one band.
#[derive(Clone, Debug)]
pub(super) struct Guidance {
    /// Of guided steps.
    pub share: f64,
    pub turns: GuidedTurns,
    aim: Aim,
}

impl Guidance {
    /// Per band; `None` where walks are plain: nothing scatters, or no light comes in.
    pub(super) fn of_bands(scene: &Scene, draw: WalkDraw) -> Vec<Option<Guidance>> {
        let (share, aims) = match draw {
            WalkDraw::Plain {} => return vec![None; scene.bands()],
            WalkDraw::Dwivedi { share } => {
                let aim = |Medium { sigma_t, albedo, phase, .. }: &Medium| {
                    let scatters = *sigma_t > 0.0 && *albedo > 0.0;
                    scatters.then(|| Aim::Normal(diffuse_growth(*albedo, phase.g)))
                };
                (share, scene.medium.iter().map(aim).collect::<Vec<_>>())
            }
            WalkDraw::Guided { share, nodes, least_depth } => {
                let solutions = Importance::of_bands(scene, nodes, least_depth);
                (share, solutions.into_iter().map(|solved| solved.map(Aim::Solution)).collect())
            }
        };
        let of_band = |(aim, medium): (Option<Aim>, &Medium)| {
            Some(Guidance { share, turns: GuidedTurns::new(medium.phase, medium.albedo), aim: aim? })
        };
        aims.into_iter().zip(&scene.medium).map(of_band).collect()
    }

    /// What guides a step from a point, and phi (0 where nothing is known), of a walk that last came in at a boundary point with
    /// this normal. In place, since a walk asks at every step.
    #[inline]
    pub(super) fn at(&self, x: DVec3, normal: DVec3, guide: &mut StepGuide) -> f64 {
        match &self.aim {
            Aim::Normal(growth) => {
                *guide = StepGuide::inner(Pull::new(normal * *growth));
                0.0
            }
            Aim::Solution(importance) => importance.at(x, guide),
        }
    }

    /// Memory on the heap, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        let aim = match &self.aim {
            Aim::Normal(_) => 0,
            Aim::Solution(importance) => importance.heap_bytes(),
        };
        self.turns.heap_bytes() + aim
    }
}

#[cfg(test)]
mod tests;
