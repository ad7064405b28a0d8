//! Guided walks.
//!
//! At every medium vertex, direction and distance are drawn either from phase function and transmittance or, with
//! probability q, towards growing importance ([`crate::optics::guided`]). Both are weighted by the balance heuristic over
//! direction and distance together, so that no event has a weight above albedo / (1 - q). Importance comes from a diffusion
//! solution in the body ([`importance`]), or grows along the normal at which the walk entered (Dwivedi sampling as in
//! production renderers: Krivanek & d'Eon 2014), or is learned from earlier walks ([`learned`]). Results are unbiased
//! whatever the importance; only their variance changes.
//!
//! ```text
//! lights, boundary, medium, body -> Importance -> Guidance (one per band) -> GuidedBand (state of a walk)
//! walks of a warm-up -> LearnedPulls ----^
//! ```

mod diffusion;
mod exit;
mod importance;
mod incidence;
mod learned;
mod rule;
mod slice;
mod steered;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::geometry::Side;
use crate::math::DVec3;
use crate::math::lanes::{LANES, Lanes, VectorLanes, vector};
use crate::optics::boundary::{Boundary, FEW_FACETS};
use crate::optics::guided::{GuideLanes, GuidedTurns, Pull, StepGuide, diffuse_growth};
use crate::optics::medium::Medium;
use crate::scene::Scene;

use importance::{FoundLanes, Importance};

pub(super) use learned::{FoundLight, LearnedPulls, LearningCells, Lessons};
pub(super) use rule::{Finder, GuideRule, pays_beside_light_samples};
pub use slice::GuideSlice;
pub(super) use steered::{GuidedBand, GuidedLanes};

/// How walks are sampled inside the body; all choices are unbiased.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WalkDraw {
    /// Directions by the phase function, distances by the transmittance.
    Plain {},
    /// Guided along the normal of the boundary point at which the walk last entered (Dwivedi sampling as in production
    /// renderers; Krivanek & d'Eon 2014).
    Dwivedi {
        /// Share of turns and flights that are guided.
        #[serde(default = "half")]
        #[schemars(range(min = 0.0, max = 0.99))]
        share: f64,
    },
    /// Guided by importance: a diffusion solution in the body, whose source is the light that enters it.
    Guided {
        /// Share of turns and flights that are guided.
        #[serde(default = "most")]
        #[schemars(range(min = 0.0, max = 0.99))]
        share: f64,
        /// Nodes of the solution along the longest side of a finite body.
        #[serde(default = "nodes")]
        #[schemars(range(min = 4, max = 256))]
        nodes: u32,
        /// Walks stay plain in a finite body or a slab that is nowhere as deep as this: light leaves such a body too soon for a
        /// guide to pay. By default 3, or 0 where guiding pays at any depth.
        ///
        /// In units of (2 + 1 / (1 - albedo g)) / (3 sigma_t), two thirds of a mean free path and one third of that after
        /// similarity. The default is 0 for a finite body behind a rough boundary if its reduced albedo, a (1 - g) / (1 - a g), is
        /// 0.75 or more and even lights have a quarter of the strength of all. Without this key walks also stay plain in matched
        /// bodies of reduced albedo below 0.45.
        #[serde(default)]
        #[schemars(range(min = 0.0))]
        least_depth: Option<f64>,
        /// Whether walks are guided even where other techniques find the light whatever the walk, so that a plain step costs
        /// less: in `snee` where subdivision connects to every light and the lights illuminate the points at which walks
        /// enter; in `path` where small lights do and little is absorbed or the body is a slab, and in matched bodies under small
        /// lights.
        #[serde(default)]
        near_lights: bool,
    },
    /// Guided to where earlier walks found light, per cell of the body (path guiding, with products and distances as in Herholz
    /// et al. 2019). The guide is learned before the first pass, and timed with the passes.
    Learned {
        /// Share of turns and flights that are guided.
        #[serde(default = "half")]
        #[schemars(range(min = 0.0, max = 0.99))]
        share: f64,
        /// Cells along the longest side of a finite body.
        #[serde(default = "cells")]
        #[schemars(range(min = 1, max = 64))]
        cells: u32,
        /// Number of training paths per band.
        #[serde(default = "paths")]
        #[schemars(range(min = 16, max = 16777216))]
        paths: u64,
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

    /// Whether walks are guided even where connections find all light near the points at which walks enter.
    pub(super) fn is_near_lights(&self) -> bool {
        matches!(self, WalkDraw::Guided { near_lights: true, .. })
    }
}

fn half() -> f64 {
    0.5
}

fn most() -> f64 {
    0.95
}

fn nodes() -> u32 {
    24
}

fn cells() -> u32 {
    8
}

fn paths() -> u64 {
    32768
}

/// Number of sensor rays that sample the points at which walks enter.
const RAYS: usize = 64;

/// Importance at the points at which walks enter, over its largest in the body, from which on the lights illuminate these points
/// ([`Guidance::is_lit_at_entry`]).
const NEAR: f64 = 0.1;

/// How the growth of importance is determined.
#[derive(Clone, Debug)]
enum Aim {
    /// Along the normal at the last boundary point, by so much per mean free path.
    Normal(f64),
    /// By a solution in the body.
    Solution(Importance),
    /// As walks have learned.
    Learned(LearnedPulls),
}

/// What guides the walks of one band.
#[derive(Clone, Debug)]
pub(super) struct Guidance {
    /// Of guided steps.
    pub share: f64,
    pub turns: GuidedTurns,
    /// Out of which a direction at the boundary is chosen.
    facets: usize,
    aim: Aim,
}

impl Guidance {
    /// Per band; `None` where walks are plain: nothing scatters, no light enters, or nothing has been learned yet.
    pub(super) fn of_bands(scene: &Scene, draw: WalkDraw, finder: Finder) -> Vec<Option<Guidance>> {
        let (share, aims) = match draw {
            WalkDraw::Plain {} | WalkDraw::Learned { .. } => return vec![None; scene.bands()],
            WalkDraw::Dwivedi { share } => {
                let aim = |Medium { sigma_t, albedo, phase, .. }: &Medium| {
                    let scatters = *sigma_t > 0.0 && *albedo > 0.0;
                    scatters.then(|| Aim::Normal(diffuse_growth(*albedo, phase.g)))
                };
                (share, scene.medium.iter().map(aim).collect::<Vec<_>>())
            }
            WalkDraw::Guided { share, nodes, least_depth, .. } => {
                let solutions = Importance::of_bands(scene, nodes, GuideRule { least_depth, finder });
                (share, solutions.into_iter().map(|solved| solved.map(Aim::Solution)).collect())
            }
        };
        let of_band = |(band, aim): (usize, Option<Aim>)| {
            let facets = match aim {
                Some(Aim::Solution(_)) => scene.boundary[band].facets_that_pay(),
                _ => FEW_FACETS,
            };
            let Medium { phase, albedo, .. } = scene.medium[band];
            let depth = match &aim {
                Some(Aim::Solution(importance)) => importance.depth(),
                _ => f64::INFINITY,
            };
            let turns = GuidedTurns::new(phase, albedo).in_body(depth);
            let mut guidance = Guidance { share, turns, facets, aim: aim? };
            // Walks towards a light behind the body spend few steps where importance has no clear direction; in matched bodies
            // walks are traced one by one, where a bend costs more.
            let is_straight =
                scene.boundary[band] == Boundary::Matched || !guidance.is_lit_at_entry(scene);
            if let Aim::Solution(importance) = &mut guidance.aim
                && is_straight
            {
                importance.straighten();
            }
            Some(guidance)
        };
        aims.into_iter().enumerate().map(of_band).collect()
    }

    /// Whether flights take into account that importance grows to all sides.
    pub(super) fn is_bent(&self) -> bool {
        matches!(&self.aim, Aim::Solution(importance) if importance.is_bent())
    }

    /// By what walks have learned.
    pub(super) fn learned(share: f64, medium: &Medium, learned: LearnedPulls) -> Guidance {
        let turns = GuidedTurns::new(medium.phase, medium.albedo);
        Guidance { share, turns, facets: FEW_FACETS, aim: Aim::Learned(learned) }
    }

    /// The guide of a step from a point, and phi (0 where it is unknown), for a walk that last entered at a boundary point with
    /// this normal. Written in place, since a walk calls this at every step.
    #[inline(always)]
    pub(super) fn at(&self, x: DVec3, normal: DVec3, guide: &mut StepGuide) -> f64 {
        match &self.aim {
            Aim::Normal(growth) => {
                *guide = StepGuide::inner(Pull::new(normal * *growth));
                0.0
            }
            Aim::Solution(importance) => importance.at(x, guide),
            Aim::Learned(learned) => {
                *guide = StepGuide::inner(learned.at(x));
                0.0
            }
        }
    }

    /// Looks up what guides a walk's step from a point, where that is stored.
    #[inline(always)]
    fn find(&self, x: DVec3, lane: usize, found: &mut FoundLanes) {
        if let Aim::Solution(Importance::Grid(grid)) = &self.aim {
            grid.find(x, lane, found);
        }
    }

    /// The same for several walks.
    #[inline(always)]
    fn find_all(&self, points: &VectorLanes, found: &mut FoundLanes) {
        if let Aim::Solution(Importance::Grid(grid)) = &self.aim {
            grid.find_all(points, found);
        }
    }

    /// [`Self::at`] for several walks, of which this has been found.
    #[inline(always)]
    fn guide_all(
        &self,
        points: &VectorLanes,
        normals: &[DVec3; LANES],
        found: &FoundLanes,
        guides: &mut GuideLanes,
    ) -> Lanes {
        if let Aim::Solution(Importance::Grid(grid)) = &self.aim {
            return grid.guide_all(points, found, guides);
        }
        let mut phi = [0.0; LANES];
        for lane in 0..LANES {
            let mut guide = StepGuide::NONE;
            phi[lane] = self.at(vector(points, lane), normals[lane], &mut guide);
            guides.set(lane, &guide);
        }
        phi
    }

    /// What light finds that leaves the body at a boundary point, over what it finds that is reflected back inside; 1 where
    /// that is unknown.
    #[inline]
    pub(super) fn gain_of_leaving(&self, at: DVec3) -> f64 {
        match &self.aim {
            Aim::Solution(importance) => importance.gain_of_leaving(at),
            Aim::Normal(_) | Aim::Learned(_) => 1.0,
        }
    }

    /// Whether the lights illuminate the points at which walks enter.
    pub(super) fn is_lit_at_entry(&self, scene: &Scene) -> bool {
        self.at_first_hits(scene) > NEAR
    }

    /// Importance at the first hits of sensor rays, over its largest value in the body; 1 where it is unknown.
    fn at_first_hits(&self, scene: &Scene) -> f64 {
        let Aim::Solution(importance) = &self.aim else { return 1.0 };
        let rays = scene.sensor.rays_per_pass();
        let at_hit = |i: usize| {
            let start = scene.sensor.ray(i * rays / RAYS.min(rays), [0.5; 4]);
            let hit = scene.shape.intersect(&start.ray, Side::Outside, None, f64::INFINITY)?;
            Some(importance.at(hit.point, &mut StepGuide::NONE.clone()))
        };
        let found: Vec<f64> = (0..RAYS.min(rays)).filter_map(at_hit).collect();
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        if found.is_empty() { 1.0 } else { mean / importance.largest() }
    }

    /// Memory on the heap, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        let aim = match &self.aim {
            Aim::Normal(_) => 0,
            Aim::Solution(importance) => importance.heap_bytes(),
            Aim::Learned(learned) => learned.heap_bytes(),
        };
        self.turns.heap_bytes() + aim
    }
}

#[cfg(test)]
mod tests;
