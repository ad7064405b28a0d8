//! Flights inside a body that are certain not to reach the boundary, traced together.

use super::{Cost, Scores};
use crate::geometry::{Ray, Shape};
use crate::optics::medium::Medium;
use crate::sampling::distance::sample_exponential;
use crate::sampling::stream::Stream;

/// How flights ended.
pub(super) struct Flights {
    /// The medium vertices between them.
    pub vertices: u64,
    /// The length of the first flight that may meet the boundary; none where the path ended at a vertex.
    pub next: Option<f64>,
}

/// Flights of a plain walk with no more to do at a vertex than `survives` decides, from `ray`, which ends as the first flight
/// that may meet the boundary. All that changes stays in registers; the numbers are those of flights one by one, and so are
/// the counts.
#[inline(always)]
pub(super) fn clear_flights(
    shape: &Shape,
    medium: &Medium,
    ray: &mut Ray,
    stream: &mut Stream,
    scores: &mut Scores,
    mut survives: impl FnMut(&mut Stream) -> bool,
) -> Flights {
    let (mut at, mut numbers) = (*ray, stream.clone());
    let mut vertices = 0;
    let next = loop {
        let t = sample_exponential(medium.sigma_t, numbers.draw());
        let end = at.at(t);
        if !shape.is_clear(&at, end, t) {
            break Some(t);
        }
        vertices += 1;
        at.origin = end;
        if !survives(&mut numbers) {
            break None;
        }
        at.dir = medium.phase.sample(at.dir, numbers.draw2());
    };
    (*ray, *stream) = (at, numbers);
    scores.count_many(Cost::Rays, vertices + u64::from(next.is_some()));
    scores.count_many(Cost::MediumEvents, vertices);
    Flights { vertices, next }
}
