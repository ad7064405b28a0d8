//! Plain walks of one band side by side.

use super::bands::OneBand;
use super::lanes::{LaneVertex, WalkLanes};
use super::steps::{StepRule, Weights, half_size};
use crate::geometry::{BoundingSphere, Flights, Ray, Shape};
use crate::math::lanes::{LANES, Lanes, VectorLanes, set_vector, vector};
use crate::math::{DVec3, Vectorized, vectorized};
use crate::sampling::distance::sample_exponential_in_lanes;
use crate::sampling::stream::Stream;

/// Walks inside a body of positive extinction, each of which has begun a flight. An empty lane takes part in what is computed
/// together, with numbers of no meaning, and draws none.
///
/// Roulette at the end of a flight and the numbers of the step behind it do not depend on where the flight ends. They are drawn
/// as soon as the flight has begun, while a processor still waits for what is computed together; where the boundary ends the
/// flight, they are dropped, to be drawn again.
pub(super) struct PlainLanes<'a> {
    rule: StepRule<'a>,
    is_empty: [bool; LANES],
    weights: [Weights; LANES],
    steps: PlainSteps,
    /// Behind the numbers of the flights.
    streams: [Stream; LANES],
    /// How many flights each has begun.
    flights: [u64; LANES],
    ahead: Ahead,
}

/// What has been drawn of the steps behind the flights.
struct Ahead {
    survives: [bool; LANES],
    weights: [Weights; LANES],
    /// Of turns and flights.
    numbers: [Lanes; 3],
    streams: [Stream; LANES],
}

/// Flights, component by component.
struct PlainSteps {
    origins: VectorLanes,
    dirs: VectorLanes,
    /// Lengths, if no boundary ends the flights, and where they end then.
    lengths: Lanes,
    ends: VectorLanes,
}

/// Mean free paths in half a body's size from which walks are faster side by side.
const LEAST_SIZE: f64 = 4.0;

impl<'a> PlainLanes<'a> {
    /// Whether walks in this body are faster side by side than one by one. Those in a mesh are not: each finds the parts of the
    /// mesh around it in the cache, and rays take most of its time.
    pub(super) fn pay(shape: &Shape, bounds: Option<BoundingSphere>, sigma_t: f64) -> bool {
        !matches!(shape, Shape::Mesh(_)) && half_size(shape, bounds) * sigma_t > LEAST_SIZE
    }

    /// Without walks.
    pub(super) fn new(rule: StepRule<'a>) -> PlainLanes<'a> {
        const NONE: VectorLanes = [[0.0; LANES]; 3];
        let streams = || std::array::from_fn(|_| Stream::zero());
        PlainLanes {
            rule,
            is_empty: [true; LANES],
            weights: [[0.0; 2]; LANES],
            steps: PlainSteps { origins: NONE, dirs: NONE, lengths: [0.0; LANES], ends: NONE },
            streams: streams(),
            flights: [0; LANES],
            ahead: Ahead {
                survives: [false; LANES],
                weights: [[0.0; 2]; LANES],
                numbers: NONE,
                streams: streams(),
            },
        }
    }

    /// Draws what comes behind the flight of a lane.
    #[inline(always)]
    fn draw_ahead(&mut self, lane: usize) {
        let StepRule { roulette, survival, .. } = self.rule;
        let Ahead { survives, weights, numbers, streams } = &mut self.ahead;
        let mut stream = self.streams[lane].clone();
        let [mut throughput, mut seen] = self.weights[lane];
        survives[lane] =
            roulette.survive([&mut throughput, &mut seen], survival, || 1.0, &mut stream).is_some();
        if survives[lane] {
            weights[lane] = [throughput, seen];
            let [turn, azimuth, flight] = numbers;
            (turn[lane], azimuth[lane]) = (stream.draw(), stream.draw());
            flight[lane] = stream.draw();
        }
        streams[lane] = stream;
    }
}

impl WalkLanes for PlainLanes<'_> {
    type Bands = OneBand;

    fn put(&mut self, lane: usize, _: &OneBand, ray: &Ray, weights: Weights, stream: &Stream) {
        self.is_empty[lane] = false;
        self.streams[lane] = stream.clone();
        let length = sample_exponential_in_lanes(self.rule.medium.sigma_t, self.streams[lane].draw());
        let steps = &mut self.steps;
        set_vector(&mut steps.origins, lane, ray.origin);
        set_vector(&mut steps.dirs, lane, ray.dir);
        steps.lengths[lane] = length;
        set_vector(&mut steps.ends, lane, ray.at(length));
        self.weights[lane] = weights;
        self.flights[lane] = 1;
        self.draw_ahead(lane);
    }

    fn take(&mut self, lane: usize) -> Stream {
        self.is_empty[lane] = true;
        self.streams[lane].clone()
    }

    fn state(&self, lane: usize, _: &mut OneBand) -> Weights {
        self.weights[lane]
    }

    #[inline(always)]
    fn flights(&self) -> Flights<'_, LANES> {
        let PlainSteps { origins, ends, lengths, .. } = &self.steps;
        Flights { origins, ends, lengths }
    }

    #[inline(always)]
    fn flight(&self, lane: usize) -> (Ray, f64, DVec3) {
        let PlainSteps { origins, dirs, lengths, ends } = &self.steps;
        let ray = Ray { origin: vector(origins, lane), dir: vector(dirs, lane) };
        (ray, lengths[lane], vector(ends, lane))
    }

    #[inline]
    fn begun(&self, lane: usize) -> u64 {
        self.flights[lane]
    }

    #[inline(always)]
    fn scatter(&mut self, mut arrive: impl FnMut(usize, LaneVertex<'_>)) -> [bool; LANES] {
        let PlainSteps { dirs, ends, .. } = &self.steps;
        let mut goes_on = [false; LANES];
        for (lane, goes_on) in goes_on.iter_mut().enumerate() {
            if self.is_empty[lane] {
                continue;
            }
            self.streams[lane] = self.ahead.streams[lane].clone();
            *goes_on = self.ahead.survives[lane];
            if *goes_on {
                self.weights[lane] = self.ahead.weights[lane];
                let weights = &self.weights[lane];
                arrive(lane, LaneVertex { points: ends, arrivals: dirs, weights, ratio: 1.0, lane });
            }
        }
        vectorized(Departures(self));
        for (lane, goes_on) in goes_on.into_iter().enumerate() {
            if goes_on {
                self.draw_ahead(lane);
            }
        }
        self.flights.iter_mut().for_each(|flights| *flights += 1);
        goes_on
    }
}

/// Ends all flights in the medium, and begins the next ones.
struct Departures<'l, 'a>(&'l mut PlainLanes<'a>);

impl Vectorized for Departures<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let PlainLanes { rule, steps, ahead: Ahead { numbers: [turn, azimuth, flight], .. }, .. } =
            self.0;
        // Copies: what references lead to might be among the results, which would keep the loop below from vectors. The lanes are
        // parts of one structure, which do not overlap.
        let (sigma_t, phase) = (rule.medium.sigma_t, rule.medium.phase);
        let PlainSteps { origins, dirs, lengths, ends } = steps;
        for lane in 0..LANES {
            let dir = phase.turned(vector(dirs, lane), phase.sample_local([turn[lane], azimuth[lane]]));
            let length = sample_exponential_in_lanes(sigma_t, flight[lane]);
            let origin = vector(ends, lane);
            set_vector(origins, lane, origin);
            set_vector(dirs, lane, dir);
            lengths[lane] = length;
            set_vector(ends, lane, origin + dir * length);
        }
    }
}
