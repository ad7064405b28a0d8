//! Data that all walks of an estimator share, and the kind of its walks.

use std::sync::Arc;

use super::choice::{light_shares, shares_of_uneven};
use super::guidance::{Finder, Guidance, WalkDraw};
use super::roulette::Roulette;
use crate::geometry::BoundingSphere;
use crate::optics::boundary::Boundary;
use crate::optics::bssrdf::Reduced;
use crate::sampling::stream::PassKey;
use crate::scene::Scene;

/// Reduced albedo from which on plain walks at a rough boundary find an even light better without light samples. A dark body
/// needs them: most of its light is reflected at the surface, and a plain walk rarely follows that lobe. Measured under a sky
/// in bodies up to the depth from which on walks are guided: 1.08 to 3.8 times the efficiency from here on, 0.63 to 1.4 below
/// (experiments/compare/walks-even.toml).
const FINDS_EVEN: f64 = 0.75;

/// Data that all walks of an estimator share.
#[derive(Debug)]
pub(super) struct Field {
    /// Scene that paths are traced in.
    pub scene: Arc<Scene>,
    /// Per band: probability of choosing each light.
    pub choice: Vec<Vec<f64>>,
    pub roulette: Roulette,
    /// Ball around the body, where it is finite.
    pub bounds: Option<BoundingSphere>,
    /// Per band what guides walks; empty where all are plain.
    guidance: Vec<Option<Guidance>>,
}

impl Field {
    /// Prepares a scene for tracing with this roulette.
    pub(super) fn new(scene: Arc<Scene>, roulette: Roulette) -> Field {
        let choice = light_shares(&scene);
        Field { bounds: scene.shape.bounds(), roulette, choice, scene, guidance: Vec::new() }
    }

    /// The same with walks that are drawn in this way.
    pub(super) fn with_walks(
        scene: Arc<Scene>,
        roulette: Roulette,
        draw: WalkDraw,
        finder: Finder,
    ) -> Field {
        Field { guidance: Guidance::of_bands(&scene, draw, finder), ..Field::new(scene, roulette) }
    }

    /// The same without light sampling of lights that are even.
    pub(super) fn finding_even_lights(self) -> Field {
        Field { choice: shares_of_uneven(&self.scene), ..self }
    }

    /// The same in bands where it pays: where walks are guided, and at matched boundaries, where light samples at every vertex
    /// are most of the noise, and rough ones where the reduced albedo is [`FINDS_EVEN`] or more.
    pub(super) fn finding_even_lights_where_it_pays(self) -> Field {
        let uneven = shares_of_uneven(&self.scene);
        let finds = |band: usize| {
            self.guidance(band).is_some()
                || match self.scene.boundary[band] {
                    Boundary::Matched | Boundary::Rough { .. } => {
                        let medium = &self.scene.medium[band];
                        medium.sigma_t > 0.0 && Reduced::of(medium).albedo >= FINDS_EVEN
                    }
                    Boundary::Smooth { .. } => false,
                }
        };
        let choose = |(band, uneven)| if finds(band) { uneven } else { self.choice[band].clone() };
        let choice = uneven.into_iter().enumerate().map(choose).collect();
        Field { choice, ..self }
    }

    /// What guides the walks of a band; `None` where they are plain.
    pub(super) fn guidance(&self, band: usize) -> Option<&Guidance> {
        self.guidance.get(band)?.as_ref()
    }

    /// The same with walks that are guided like this, band by band.
    pub(super) fn with_guidance(&self, guidance: Vec<Option<Guidance>>) -> Field {
        let Field { scene, choice, roulette, bounds, .. } = self;
        let (scene, choice) = (scene.clone(), choice.clone());
        Field { scene, choice, roulette: *roulette, bounds: *bounds, guidance }
    }

    /// The same with plain walks in some bands.
    pub(super) fn plain_in(mut self, is_plain: impl Fn(usize, &Guidance) -> bool) -> Field {
        for (band, guidance) in self.guidance.iter_mut().enumerate() {
            guidance.take_if(|guidance| is_plain(band, guidance));
        }
        self
    }

    /// With walks of every band guided like this.
    #[cfg(test)]
    pub(super) fn guided_by(self, guidance: &Guidance) -> Field {
        self.with_guidance(vec![Some(guidance.clone()); self.scene.bands()])
    }

    /// Memory on the heap, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        self.guidance.iter().flatten().map(Guidance::heap_bytes).sum()
    }
}

/// Path `index` of a pass, in one band.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path<'a> {
    pub field: &'a Field,
    pub band: usize,
    pub index: usize,
    pub key: &'a PassKey,
}
