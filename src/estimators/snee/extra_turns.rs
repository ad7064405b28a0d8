//! Directions that photons teach, as a walk draws and weighs them: see [`super::photons`].

use super::state::{Connections, ExtraTurns, PathTurn};
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::WalkVertex;
use crate::estimators::walk::{CameraWalk, Meeting};
use crate::sampling::distance::transmittance;

/// Draws directions at the walk's latest vertex, and follows them to lights.
pub(super) fn follow<B: WalkBands>(walk: &mut CameraWalk<'_, Connections<'_>, B>) {
    let setup = walk.rivals.setup;
    let (Some(map), Some(turns)) = (&setup.photons, &mut walk.rivals.extra_turns) else { return };
    let latest = turns.latest;
    let mut streams = turns.streams.clone();
    for meeting in [Meeting::First, Meeting::Later] {
        let Some(dir) = map.sample(meeting, walk.ray.origin, &mut streams[0]) else { continue };
        let count = walk.rivals.count;
        walk.follow_extra(dir, meeting, &mut streams);
        walk.rivals.count = count;
    }
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
    let (Some(map), Some((length, meeting))) = (&walk.rivals.setup.photons, met) else { return 0.0 };
    let density = map.density(meeting, point, dir);
    if density == 0.0 {
        return 0.0;
    }
    let through = transmittance(walk.medium.sigma_t, length).max(LEAST);
    density * walks / (walk.medium.phase.pdf(arrival.dot(dir)) * through)
}
