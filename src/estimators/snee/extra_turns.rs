//! Directions that photons teach, as a walk draws and weighs them: see [`super::photons`].

use super::learned_calls::CalledTechnique;
use super::photons::PhotonKind;
use super::state::{Connections, ExtraTurns, PathTurn};
use crate::estimators::Cost;
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::WalkVertex;
use crate::estimators::walk::CameraWalk;
use crate::sampling::distance::transmittance;

/// Draws directions at the walk's latest vertex, and follows them to lights.
pub(super) fn follow<B: WalkBands>(walk: &mut CameraWalk<'_, Connections<'_>, B>) {
    let setup = walk.rivals.setup;
    let (Some(photons), Some(turns)) = (&setup.photons, &mut walk.rivals.extra_turns) else { return };
    let drawn = photons.sample(walk.ray.origin, &mut turns.streams[0]);
    if drawn.iter().all(Option::is_none) {
        return;
    }
    let latest = turns.latest;
    let mut streams = turns.streams.clone();
    for (kind, dir) in PhotonKind::ALL.into_iter().zip(drawn) {
        let Some(dir) = dir else { continue };
        walk.rivals.begin(Some(CalledTechnique::Photons));
        let count = walk.rivals.count;
        let events = walk.scores.cost[Cost::BoundaryEvents as usize];
        walk.follow_extra(dir, kind.until(), &mut streams);
        walk.rivals.count = count;
        if let Some(notes) = walk.rivals.notes {
            notes.borrow_mut().meet(walk.scores.cost[Cost::BoundaryEvents as usize] - events);
        }
    }
    walk.rivals.begin(None);
    if let Some(turns) = &mut walk.rivals.extra_turns {
        **turns = ExtraTurns { streams, latest };
    }
}

/// The least transmittance that is told from none: below it, densities over it might overflow.
const LEAST: f64 = 1e-200;

/// The density with which photons make the walk turn and reach the boundary, q p(w | x), over U as in [`super::connections`], times
/// the density of the walk up to the turn; 0 where no photons guide.
pub(super) fn density<B: WalkBands>(walk: &CameraWalk<'_, Connections<'_>, B>, turn: &PathTurn) -> f64 {
    let &PathTurn { vertex: WalkVertex { point, arrival, walks }, dir, met } = turn;
    let (Some(photons), Some((length, meeting))) = (&walk.rivals.setup.photons, met) else { return 0.0 };
    let density = photons.density(meeting, point, dir);
    if density == 0.0 {
        return 0.0;
    }
    let through = transmittance(walk.medium.sigma_t, length).max(LEAST);
    density * walks / (walk.medium.phase.pdf(arrival.dot(dir)) * through)
}
