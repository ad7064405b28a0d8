//! Where it pays to guide walks.

use crate::estimators::choice::shares_of_even;
use crate::geometry::Shape;
use crate::optics::boundary::Boundary;
use crate::optics::bssrdf::Reduced;
use crate::optics::medium::Medium;
use crate::scene::Scene;

/// Share of even lights, by strength, from which on walks are guided whatever the other lights: boundaries and phase functions
/// find an even light in any direction, so that what is left of the variance is that of the walk. Under parallel light and a
/// sky that has a share of 0.27, guided walks are level with plain ones or better (experiments/compare/walks-small-lights.toml).
pub(in crate::estimators) const EVEN_ENOUGH: f64 = 0.25;

/// Default of `least_depth`: in these units guided walks gain in spheres, slabs and flat boxes of 3 or more under a sky, whatever
/// the albedo and g, and in thinner ones they may lose (experiments/compare/walks-depth.toml).
const LEAST_DEPTH: f64 = 3.0;

/// Reduced albedo from which on guided walks gain in finite bodies of any depth behind a rough boundary under an even light: 1.1 to
/// 5.3 times the efficiency.
const BRIGHT: f64 = 0.75;

/// Reduced albedo up to which guided walks lose in matched bodies: light samples at every vertex find what little light there is.
const DARK: f64 = 0.45;

/// What finds the light that walks are guided to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::estimators) enum Finder {
    /// Walks that leave the body, and light samples at their vertices: no parallel light behind a smooth boundary.
    Walks,
    /// Connections through the boundary: every light.
    Connections,
}

/// Where walks are guided.
#[derive(Clone, Copy, Debug)]
pub(in crate::estimators) struct GuideRule {
    /// In bodies this deep, in units of [`unit_of_depth`]; by default where it pays.
    pub least_depth: Option<f64>,
    pub finder: Finder,
}

impl GuideRule {
    /// In bodies of any depth, towards all lights.
    #[cfg(test)]
    pub(in crate::estimators) const EVERYWHERE: GuideRule =
        GuideRule { least_depth: Some(0.0), finder: Finder::Connections };

    /// Whether walks are guided in a body that is so deep, mm; per band.
    pub(super) fn guides(&self, scene: &Scene, depth: f64) -> Vec<bool> {
        let even = shares_of_even(scene);
        let of_band = |(band, even): (usize, f64)| {
            let medium = &scene.medium[band];
            if medium.sigma_t <= 0.0 || medium.albedo <= 0.0 {
                return false;
            }
            let albedo = Reduced::of(medium).albedo;
            if self.least_depth.is_none() && scene.boundary[band] == Boundary::Matched && albedo < DARK {
                return false;
            }
            let gains_if_thin = even >= EVEN_ENOUGH
                && albedo >= BRIGHT
                && matches!(scene.boundary[band], Boundary::Rough { .. })
                && !matches!(*scene.shape, Shape::Slab { .. });
            let least = self.least_depth.unwrap_or(if gains_if_thin { 0.0 } else { LEAST_DEPTH });
            depth >= least * unit_of_depth(medium)
        };
        even.into_iter().enumerate().map(of_band).collect()
    }
}

/// What the depth of a body is measured in, mm: two thirds of a mean free path and one third of that after similarity. How
/// often a walk scatters before it leaves grows with the latter; what its first and last flight cost does not.
fn unit_of_depth(medium: &Medium) -> f64 {
    let after_similarity = 1.0 / (1.0 - medium.albedo * medium.phase.g);
    (2.0 + after_similarity) / (3.0 * medium.sigma_t)
}
