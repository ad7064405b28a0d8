//! Flights inside a body that are certain not to reach the boundary, traced together.

use super::bands::WalkBands;
use super::roulette::Roulette;
use super::{Cost, Scores};
use crate::geometry::Ray;
use crate::optics::medium::Medium;
use crate::sampling::stream::Stream;
use crate::scene::Scene;

/// What flights change that take roulette and a turn alone at a medium vertex.
pub(super) struct Flying<'a, B> {
    pub ray: &'a mut Ray,
    pub stream: &'a mut Stream,
    /// Throughput, and what roulette sees of it.
    pub weights: [&'a mut f64; 2],
    pub bands: &'a mut B,
}

/// How flights ended.
pub(super) struct Flights {
    /// The medium vertices between them.
    pub vertices: u64,
    /// The length of the first flight that may meet the boundary; none where the path ended at a vertex.
    pub next: Option<f64>,
}

impl<B: WalkBands> Flying<'_, B> {
    /// Flights up to the first that may meet the boundary, in the medium of one band of a scene. Ray, stream and weights are
    /// local here, so that they stay in registers; numbers and counts are those of flights one by one.
    #[inline(always)]
    pub(super) fn fly(
        self,
        scene: &Scene,
        medium: &Medium,
        roulette: Roulette,
        scores: &mut Scores,
    ) -> Flights {
        let Flying { weights, bands, .. } = self;
        let (mut ray, mut stream) = (*self.ray, self.stream.clone());
        let (mut throughput, mut survival) = (*weights[0], *weights[1]);
        let factor = bands.survival(medium);
        let mut vertices = 0;
        let next = loop {
            let t = bands.draw_flight(medium, stream.draw());
            let end = ray.at(t);
            if !scene.shape.is_clear(&ray, end, t) {
                break Some(t);
            }
            vertices += 1;
            ray.origin = end;
            bands.flight(&scene.medium, t, true);
            let local = [&mut throughput, &mut survival];
            if roulette.survive(local, factor, || bands.importance(end), &mut stream).is_none() {
                break None;
            }
            let dir = bands.draw_turn(medium, &ray, &mut stream);
            bands.turn(&scene.medium, end, ray.dir, dir);
            ray.dir = dir;
        };
        (*self.ray, *self.stream) = (ray, stream);
        (*weights[0], *weights[1]) = (throughput, survival);
        scores.count_many(Cost::Rays, vertices + u64::from(next.is_some()));
        scores.count_many(Cost::MediumEvents, vertices);
        Flights { vertices, next }
    }
}
