//! Factors of calls that a warm-up may choose from, and which calls may be left out: see [`super::learned_calls`].

use super::Snee;
use super::learned_calls::{CalledTechnique, PerTechnique};
use crate::geometry::Shape;
use crate::optics::boundary::Boundary;
use crate::scene::Light;

/// Factors of the warm-up's probabilities to choose from; the last only for a technique that may be left out.
const LADDER: [f64; 7] = [1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.0];

/// The same for photons: where others find what they do, and where nothing else may.
const PHOTON_LADDER: [f64; 4] = [1.0, 0.25, 0.0625, 0.0];
const SHARP_PHOTON_LADDER: [f64; 3] = [1.0, 0.5, 0.25];

/// That of what is left out.
const NEVER: [f64; 1] = [0.0];

/// The least roughness of a mesh whose walks may go without subdivision.
const LEAST_ROUGHNESS: f64 = 0.1;

impl Snee {
    fn roughness(&self, index: usize) -> f64 {
        match self.walks.scene().boundary[index] {
            Boundary::Rough { ref facets, .. } => facets.alpha,
            Boundary::Smooth { .. } | Boundary::Matched => 0.0,
        }
    }

    /// Whether BSDF and light sampling of this setup draw all paths.
    fn draws_all_without_calls(&self, index: usize) -> bool {
        let (strategies, scene) = (&self.options.strategies, self.walks.scene());
        let mut lights = self.setups[index].guides.iter().map(|guide| &scene.lights[guide.light]);
        let is_found = self.roughness(index) > 0.0 || !lights.any(Light::is_directional);
        strategies.bsdf && strategies.light && is_found
    }

    /// Whether the last vertex and subdivision find nearly all light. In a mesh they guess the normal where it comes in. With a sharp
    /// boundary, paths by another normal are left to photons, or to rare scores of light sampling, as large as the density of
    /// facets: a warm-up does not see them.
    fn guesses_well(&self, index: usize) -> bool {
        !matches!(*self.walks.scene().shape, Shape::Mesh(_)) || self.roughness(index) >= LEAST_ROUGHNESS
    }

    /// Whether subdivision of this setup may be left out where the last vertex is called: BSDF and light sampling draw all its
    /// paths, and the last vertex draws most of them.
    pub(super) fn may_go_without_subdivision(&self, index: usize) -> bool {
        self.draws_all_without_calls(index) && self.guesses_well(index)
    }

    /// Whether guesses are left out whatever a warm-up sees: beside photons those at facets gain nothing, and the rest is noise.
    pub(super) fn leaves_out_guesses(
        &self,
        index: usize,
        is_used: [bool; CalledTechnique::COUNT],
    ) -> bool {
        is_used[CalledTechnique::Photons as usize]
            && !self.guesses_well(index)
            && self.draws_all_without_calls(index)
    }

    /// The factors of the techniques to choose from.
    pub(super) fn ladders(
        &self,
        index: usize,
        is_used: [bool; CalledTechnique::COUNT],
    ) -> [&[f64]; CalledTechnique::COUNT] {
        let mut ladders =
            is_used.map(|is_used| if is_used { &LADDER[..LADDER.len() - 1] } else { &LADDER[..1] });
        let [subdivision, last_vertex, _, photons] = is_used;
        if photons {
            let photons = &mut ladders[CalledTechnique::Photons as usize];
            *photons = if self.guesses_well(index) { &PHOTON_LADDER } else { &SHARP_PHOTON_LADDER };
        }
        if subdivision && (last_vertex || photons) {
            ladders[CalledTechnique::Subdivision as usize] = &LADDER;
        }
        if last_vertex && photons {
            ladders[CalledTechnique::LastVertex as usize] = &LADDER;
        }
        if self.leaves_out_guesses(index, is_used) {
            for technique in [CalledTechnique::Subdivision, CalledTechnique::LastVertex] {
                if is_used[technique as usize] {
                    ladders[technique as usize] = &NEVER;
                }
            }
        }
        ladders
    }

    /// Whether others draw what the techniques with factor 0 would.
    pub(super) fn may_be_left_out(
        &self,
        index: usize,
        is_used: [bool; CalledTechnique::COUNT],
        factors: &PerTechnique,
    ) -> bool {
        let is_called = |technique: CalledTechnique| {
            is_used[technique as usize] && factors[technique as usize] > 0.0
        };
        let is_left_out = |technique: CalledTechnique| {
            is_used[technique as usize] && factors[technique as usize] == 0.0
        };
        let [last_vertex, photons] =
            [CalledTechnique::LastVertex, CalledTechnique::Photons].map(is_called);
        let without_subdivision = photons && self.draws_all_without_calls(index)
            || last_vertex && self.may_go_without_subdivision(index);
        let without_last_vertex = photons && self.draws_all_without_calls(index);
        (without_subdivision || !is_left_out(CalledTechnique::Subdivision))
            && (without_last_vertex || !is_left_out(CalledTechnique::LastVertex))
    }
}
