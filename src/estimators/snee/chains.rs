//! Directions that photons teach, as a walk draws and weighs them: see [`super::photons`].

use super::photons::{ChainStart, Chains};
use super::state::Connections;
use crate::estimators::bands::WalkBands;
use crate::estimators::walk::CameraWalk;

/// Follows a direction from the walk's latest vertex, perhaps.
pub(super) fn follow<B: WalkBands>(walk: &mut CameraWalk<'_, Connections<'_>, B>) {
    let (Some(map), Some(chains)) = (&walk.rivals.setup.photons, &mut walk.rivals.chains) else {
        return;
    };
    let [stream, _] = &mut chains.streams;
    if stream.draw() >= map.most {
        return;
    }
    let Some(dir) = map.sample(walk.ray.origin, stream) else { return };
    let (count, start, mut streams) = (walk.rivals.count, chains.start, chains.streams.clone());
    chains.is_muted = true;
    walk.follow_chain(dir, &mut streams);
    walk.rivals.count = count;
    if let Some(chains) = &mut walk.rivals.chains {
        **chains = Chains { streams, start, is_muted: false };
    }
}

/// q p(w | x) / p_w(w) of the chain that the path is on; 0 where it is on none.
pub(super) fn density<B: WalkBands>(walk: &CameraWalk<'_, Connections<'_>, B>) -> f64 {
    let Connections { setup, chains, .. } = &walk.rivals;
    let (Some(map), Some(chains)) = (&setup.photons, chains) else { return 0.0 };
    let Some(ChainStart { x, arrival, dir, turn, .. }) = chains.start.filter(|start| start.is_chain)
    else {
        return 0.0;
    };
    let density = map.density(x, dir);
    if density == 0.0 { 0.0 } else { density / (walk.medium.phase.pdf(arrival.dot(dir)) * turn) }
}
