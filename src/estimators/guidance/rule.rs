//! Where it pays to guide walks.

use crate::estimators::choice::share_of_even;
use crate::geometry::Shape;
use crate::optics::boundary::Boundary;
use crate::optics::bssrdf::Reduced;
use crate::optics::medium::Medium;
use crate::scene::Scene;

/// Share of even lights, by strength, from which on walks are guided whatever the other lights: boundaries and phase functions
/// find an even light in any direction, so that what is left of the variance is that of the walk. Under parallel light and a
/// sky that has a share of 0.27, guided walks are level with plain ones or better (experiments/compare/walks-small-lights.toml).
const EVEN_ENOUGH: f64 = 0.25;

/// Default of `least_depth`: in these units guided walks gain in spheres, slabs and flat boxes of 3 or more under a sky, whatever
/// the albedo and g, and in thinner ones they may lose (experiments/compare/walks-depth.toml).
const LEAST_DEPTH: f64 = 3.0;

/// Reduced albedo from which on guided walks gain in finite bodies of any depth behind a rough boundary under an even light
/// (the same file).
const BRIGHT: f64 = 0.75;

/// Reduced albedo below which guided walks lose in matched bodies: light samples at every vertex find what little light there is
/// (the same file).
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

    /// Per band, whether walks are guided in a body of which the deepest point is so far below the surface, mm.
    pub(super) fn guides(&self, scene: &Scene, depth: f64) -> Vec<bool> {
        (0..scene.bands()).map(|band| self.guides_band(scene, depth, band)).collect()
    }

    fn guides_band(&self, scene: &Scene, depth: f64, band: usize) -> bool {
        let medium = &scene.medium[band];
        if medium.sigma_t <= 0.0 || medium.albedo <= 0.0 {
            return false;
        }
        let depth = depth / unit_of_depth(medium);
        self.least_depth.map_or_else(|| pays_at(depth, scene, band), |least| depth >= least)
    }
}

/// The default in a band that scatters; depth in units of [`unit_of_depth`].
fn pays_at(depth: f64, scene: &Scene, band: usize) -> bool {
    let albedo = Reduced::of(&scene.medium[band]).albedo;
    let is_slab = matches!(*scene.shape, Shape::Slab { .. });
    match scene.boundary[band] {
        Boundary::Matched if albedo < DARK => false,
        Boundary::Rough { .. }
            if !is_slab && albedo >= BRIGHT && share_of_even(scene, band) >= EVEN_ENOUGH =>
        {
            true
        }
        _ => depth >= LEAST_DEPTH,
    }
}

/// Whether guided walks of `path` pay in a band; the lights illuminate the points at which walks enter, or do not.
///
/// Light samples find small lights from any vertex at the boundary (in a matched body, from any vertex), and the choice among them
/// causes most of the variance; guiding shortens walks, which pays where they absorb enough for that. Measured under parallel
/// light and discs (experiments/compare/walks-small-lights.toml): at rough boundaries guiding gains up to a reduced albedo of
/// 0.9, and loses at 0.95 (parallel light) and above; at smooth ones it gains at 0.95 and loses at 0.99. Matched bodies lose
/// from the lit side; from behind they lose at an albedo of 0.9 and gain from 0.95 on. On the lit side of
/// slabs guiding gains at an albedo of 0.5 and loses from 0.8 on, whatever the boundary; half-spaces gain.
pub(in crate::estimators) fn pays_beside_light_samples(
    scene: &Scene,
    band: usize,
    is_lit: bool,
) -> bool {
    let medium = &scene.medium[band];
    if share_of_even(scene, band) >= EVEN_ENOUGH {
        return true;
    }
    if is_lit && matches!(*scene.shape, Shape::Slab { .. }) {
        return false;
    }
    match scene.boundary[band] {
        Boundary::Matched => !is_lit && medium.albedo >= 0.94,
        Boundary::Rough { .. } => !is_lit || Reduced::of(medium).albedo <= 0.88,
        Boundary::Smooth { .. } => !is_lit || Reduced::of(medium).albedo <= 0.96,
    }
}

/// What the depth of a body is measured in, mm: two thirds of a mean free path and one third of that after similarity. How
/// often a walk scatters before it leaves grows with the latter; what its first and last flight cost does not.
fn unit_of_depth(medium: &Medium) -> f64 {
    let after_similarity = 1.0 / (1.0 - medium.albedo * medium.phase.g);
    (2.0 + after_similarity) / (3.0 * medium.sigma_t)
}
