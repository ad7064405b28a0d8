//! Unidirectional path tracing with MIS between BSDF sampling and light sampling at every exit.
//!
//! A path starts at the sensor and runs against the light. Flights in the medium have the density
//! sigma_t exp(-sigma_t t), so the weight of a scattering event is the albedo; directions follow the
//! phase function; at the boundary the interface draws reflection or refraction. Wherever the path could
//! go straight to a light, a light is also sampled, and both samples of the same direction are weighted
//! by the balance heuristic:
//!   rough boundary    at every surface vertex: interface pdf against light pdf
//!   matched boundary  at every medium vertex: phase pdf times the transmittance to the outside (the
//!                     probability of flying there) against light pdf
//!   smooth boundary   nothing to sample: only the interface can find the refracted direction, so light
//!                     from a single direction is out of its reach (stated in a note)
//! One light is chosen per vertex, with probability proportional to its strength; that probability is
//! part of the light pdf, so every pair of (lobe, light) is a MIS class of its own.
//!
//! Unbiased: no cut-off in depth. Roulette, at medium vertices only, divides by its own survival
//! probability, which depends on the albedo and roughness losses alone (never on the eta^2 of radiance,
//! which cancels on the way out).

use std::slice::{from_mut, from_ref};
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::guidance::{Finder, WalkDraw, pays_beside_light_samples};
use super::illumination::unscattered_notes;
use super::walk::{Unrivalled, passes_at_once, trace_passes};
use super::warm_up::TaughtField;
use super::{Estimator, EstimatorKind, GuideSlice, Scores, Serves, read_options};
use crate::error::Result;
use crate::optics::boundary::Boundary;
use crate::sampling::stream::PassKey;
use crate::scene::Scene;

pub use super::Roulette;

/// Options of `path`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PathOptions {
    /// Russian roulette; all choices are unbiased.
    #[serde(default)]
    pub roulette: Roulette,
    /// How walks are sampled inside the body; all choices are unbiased.
    #[serde(default)]
    pub walk: WalkDraw,
    /// Whether even lights, with 4 pi int L^2 / (int L)^2 < 2, are also light-sampled, beside BSDF sampling at the boundary. By
    /// default they are; with `walk = { guided = {} }` only where walks stay plain at the rough boundary of a dark body.
    pub sample_even_lights: Option<bool>,
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct PathTracer {
    walks: TaughtField,
}

impl PathTracer {
    /// `path` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "path",
        doc: "unidirectional path tracing with MIS between BSDF and light sampling; unbiased",
        serves: Serves { emission: true, ..Serves::WALKS },
        options_schema: || schemars::schema_for!(PathOptions),
        build: |options, scene| Ok(Box::new(PathTracer::with_options(scene, &read_options(options)?)?)),
    };

    /// With plain walks, for a scene.
    ///
    /// # Errors
    /// A scene that it does not serve.
    pub fn new(scene: Arc<Scene>, roulette: Roulette) -> Result<PathTracer> {
        PathTracer::with_options(scene, &PathOptions { roulette, ..PathOptions::default() })
    }

    /// For a scene.
    ///
    /// # Errors
    /// A scene that it does not serve.
    pub fn with_options(scene: Arc<Scene>, options: &PathOptions) -> Result<PathTracer> {
        PathTracer::KIND.check(&scene)?;
        let mut walks = TaughtField::new(scene.clone(), options.roulette, options.walk, Finder::Walks);
        if options.walk.is_guided() && !options.walk.is_near_lights() {
            walks = walks.plain_in(|band, guidance| {
                !pays_beside_light_samples(&scene, band, guidance.is_lit_at_entry(&scene))
            });
        }
        let walks = match options.sample_even_lights {
            Some(true) => walks,
            Some(false) => walks.finding_even_lights(),
            None if options.walk.is_guided() => walks.finding_even_lights_where_it_pays(),
            None => walks,
        };
        Ok(PathTracer { walks })
    }
}

impl Estimator for PathTracer {
    fn prepare(&self) {
        self.walks.field();
    }

    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        self.passes(bands, from_ref(key), from_mut(scores));
    }

    fn passes(&self, bands: &[usize], keys: &[PassKey], scores: &mut [Scores]) {
        let field = self.walks.field();
        for &band in bands {
            trace_passes(field, band, keys, scores, |_| Unrivalled);
        }
    }

    fn passes_at_once(&self, bands: &[usize]) -> u64 {
        passes_at_once(self.walks.field(), bands)
    }

    fn guides(&self) -> Vec<Option<GuideSlice>> {
        self.walks.guides()
    }

    fn held_bytes(&self) -> usize {
        self.walks.heap_bytes()
    }

    fn notes(&self) -> Vec<String> {
        let scene = self.walks.scene();
        let smooth = scene.boundary.iter().any(|b| matches!(b, Boundary::Smooth { .. }));
        let parallel = scene.lights.iter().filter(|light| light.is_directional());
        let missing = parallel.filter(|_| smooth).map(|light| {
            format!(
                "path cannot sample directional light `{}` through a smooth boundary: its share is excluded \
                 from this estimator's result (exactly 0)",
                light.name
            )
        });
        missing.chain(unscattered_notes(scene)).collect()
    }
}

#[cfg(test)]
#[path = "path_tests.rs"]
mod tests;
