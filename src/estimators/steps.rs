//! Steps of a walk inside a body: a flight, roulette at its end, and a turn.
//!
//! A plain walk draws its steps by the medium alone, wherever it is. So they can be drawn before it is known where they begin:
//! numbers and roulette one after the other, then the logarithms, sines and roots of all steps together, by vector
//! instructions. Where the body ends first, the rest is dropped, and the stream goes back to behind the flight that met the
//! boundary: a walk has the same numbers, to the last bit, as if it had drawn its steps as they came.

use super::bands::WalkBands;
use super::roulette::Roulette;
use crate::geometry::{BoundingSphere, Ray, Shape};
use crate::math::{DVec3, Vectorized, vectorized};
use crate::optics::medium::Medium;
use crate::sampling::distance::sample_exponential_in_lanes;
use crate::sampling::stream::Stream;

/// Throughput, and what roulette sees of it.
pub(super) type Weights = [f64; 2];

/// How the steps of a walk are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepRule<'a> {
    pub medium: &'a Medium,
    pub roulette: Roulette,
    /// By which the weights change at a vertex.
    pub survival: f64,
}

/// A source of steps, which hold the stream while the walk flies.
pub(super) trait Steps<B> {
    /// The length of the next flight, if no boundary ends it.
    fn flight(&mut self, bands: &mut B, weights: &Weights) -> f64;

    /// Where the flight ends in the medium: the weights behind roulette, and the direction of the next flight; `None` where
    /// the path ends.
    fn vertex(&mut self, bands: &mut B, weights: &mut Weights, arrival: &Ray) -> Option<DVec3>;

    /// The stream, behind all numbers that the walk has used.
    fn stream(self) -> Stream;
}

/// Steps that are drawn as they come.
pub(super) struct StepByStep<'a> {
    rule: StepRule<'a>,
    stream: Stream,
}

impl<'a> StepByStep<'a> {
    #[inline(always)]
    pub(super) fn new(rule: StepRule<'a>, stream: Stream) -> StepByStep<'a> {
        StepByStep { rule, stream }
    }
}

impl<B: WalkBands> Steps<B> for StepByStep<'_> {
    #[inline(always)]
    fn flight(&mut self, bands: &mut B, _: &Weights) -> f64 {
        bands.draw_flight(self.rule.medium, self.stream.draw())
    }

    #[inline(always)]
    fn vertex(&mut self, bands: &mut B, weights: &mut Weights, arrival: &Ray) -> Option<DVec3> {
        let StepRule { medium, roulette, survival } = self.rule;
        let importance = || bands.importance(arrival.origin);
        let [throughput, seen] = weights;
        roulette.survive([throughput, seen], survival, importance, &mut self.stream)?;
        Some(bands.draw_turn(medium, arrival, &mut self.stream))
    }

    #[inline(always)]
    fn stream(self) -> Stream {
        self.stream
    }
}

/// The most steps that are drawn at once.
const MOST: usize = 8;

/// As many are drawn at first: a walk often leaves after a few flights, and what was drawn beyond is lost.
const FIRST: usize = 4;

/// Mean free paths in half a body's size from which it pays to draw steps ahead.
const LEAST_SIZE: f64 = 2.0;

/// Half the size of a body, mm.
#[inline]
pub(super) fn half_size(shape: &Shape, bounds: Option<BoundingSphere>) -> f64 {
    match *shape {
        Shape::Slab { thickness } => 0.5 * thickness,
        _ => bounds.map_or(f64::INFINITY, |bounds| bounds.radius),
    }
}

/// Steps of a plain walk that are drawn ahead.
pub(super) struct StepsAhead<'a> {
    rule: StepRule<'a>,
    /// Behind the numbers of all steps that have been drawn.
    stream: Stream,
    /// The next step, and how many there are.
    next: usize,
    count: usize,
    /// The step at whose end the path ends; `count` where there is none.
    last: usize,
    flights: [f64; MOST],
    weights: [Weights; MOST],
    /// In the frame of the direction of arrival.
    turns: [[f64; MOST]; 3],
    /// Before the numbers of these steps.
    before: Stream,
    /// How many of them had been drawn, with that of the flight.
    draws: [u64; MOST],
}

impl<'a> StepsAhead<'a> {
    /// Whether a walk in this body makes enough flights between two meetings with the boundary.
    #[inline]
    pub(super) fn pay(shape: &Shape, bounds: Option<BoundingSphere>, sigma_t: f64) -> bool {
        sigma_t > 0.0 && half_size(shape, bounds) * sigma_t > LEAST_SIZE
    }

    #[inline(always)]
    pub(super) fn new(rule: StepRule<'a>, stream: Stream) -> StepsAhead<'a> {
        let (before, draws) = (stream.clone(), [0; MOST]);
        let (flights, weights, turns) = ([0.0; MOST], [[0.0; 2]; MOST], [[0.0; MOST]; 3]);
        StepsAhead { rule, stream, next: 0, count: 0, last: 0, flights, weights, turns, before, draws }
    }
}

/// Draws the next `N` steps of a walk with these weights.
struct NextSteps<'s, 'a, const N: usize> {
    steps: &'s mut StepsAhead<'a>,
    weights: Weights,
}

impl<const N: usize> Vectorized for NextSteps<'_, '_, N> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let NextSteps { steps, mut weights } = self;
        let StepRule { medium, roulette, survival } = steps.rule;
        // A copy: what a reference leads to might be among the results, which would keep the loop below from vectors.
        let Medium { sigma_t, phase, .. } = *medium;
        let mut stream = steps.stream.clone();
        steps.before = stream.clone();
        let [mut flight, mut turn, mut azimuth] = [[0.0; N]; 3];
        (steps.next, steps.count, steps.last) = (0, N, N);
        for step in 0..N {
            flight[step] = stream.draw();
            steps.draws[step] = stream.draws();
            let [throughput, seen] = &mut weights;
            if roulette.survive([throughput, seen], survival, || 1.0, &mut stream).is_none() {
                steps.last = step;
                break;
            }
            steps.weights[step] = weights;
            turn[step] = stream.draw();
            azimuth[step] = stream.draw();
        }
        steps.stream = stream;
        let [x, y, z] = &mut steps.turns;
        for step in 0..N {
            steps.flights[step] = sample_exponential_in_lanes(sigma_t, flight[step]);
            let local = phase.sample_local([turn[step], azimuth[step]]);
            (x[step], y[step], z[step]) = (local.x, local.y, local.z);
        }
    }
}

impl<B: WalkBands> Steps<B> for StepsAhead<'_> {
    #[inline(always)]
    fn flight(&mut self, _: &mut B, weights: &Weights) -> f64 {
        if self.next == self.count {
            let weights = *weights;
            if self.count == 0 {
                vectorized(NextSteps::<FIRST> { steps: self, weights });
            } else {
                vectorized(NextSteps::<MOST> { steps: self, weights });
            }
        }
        self.flights[self.next]
    }

    #[inline(always)]
    fn vertex(&mut self, _: &mut B, weights: &mut Weights, arrival: &Ray) -> Option<DVec3> {
        let step = self.next;
        if step == self.last {
            self.next = self.count;
            return None;
        }
        self.next += 1;
        *weights = self.weights[step];
        // Written out: `array::map` is not inlined here.
        let [x, y, z] = &self.turns;
        let local = DVec3::new(x[step], y[step], z[step]);
        Some(self.rule.medium.phase.turned(arrival.dir, local))
    }

    #[inline(always)]
    fn stream(self) -> Stream {
        let StepsAhead { next, count, stream, mut before, draws, .. } = self;
        if next == count {
            return stream;
        }
        before.skip(draws[next] - before.draws());
        before
    }
}
