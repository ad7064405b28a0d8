//! What the walks of an estimator share, and which of them one is.

use std::sync::Arc;

use super::choice::light_shares;
use super::roulette::Roulette;
use crate::geometry::BoundingSphere;
use crate::sampling::stream::PassKey;
use crate::scene::Scene;

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
}

impl Field {
    /// Prepares a scene for tracing with this roulette.
    pub(super) fn new(scene: Arc<Scene>, roulette: Roulette) -> Field {
        let choice = light_shares(&scene);
        Field { bounds: scene.shape.bounds(), roulette, choice, scene }
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
