//! Guided walks of one band side by side.

use super::{GuidedBand, importance};
use crate::estimators::guidance::{FoundLanes, Guidance};
use crate::estimators::lanes::{LaneVertex, WalkLanes};
use crate::estimators::steps::{StepRule, Weights};
use crate::geometry::{Flights, Ray};
use crate::math::DVec3;
use crate::math::lanes::{LANES, Lanes, vector};
use crate::optics::guided::{DrawLanes, GuideLanes, StepLanes};
use crate::sampling::stream::Stream;

/// Walks inside the body, each of which has begun a flight. An empty lane takes part in what is computed together, with numbers
/// of no meaning, and draws none.
pub(in crate::estimators) struct GuidedLanes<'a> {
    guidance: &'a Guidance,
    rule: StepRule<'a>,
    is_empty: [bool; LANES],
    weights: [Weights; LANES],
    steps: StepLanes,
    guides: GuideLanes,
    /// Where their flights end.
    found: FoundLanes,
    draws: DrawLanes,
    /// As in [`GuidedBand`].
    normals: [DVec3; LANES],
    per_entry: Lanes,
    streams: [Stream; LANES],
    /// How many flights each has begun.
    flights: [u64; LANES],
}

impl<'a> GuidedLanes<'a> {
    /// Without walks.
    pub(in crate::estimators) fn new(guidance: &'a Guidance, rule: StepRule<'a>) -> GuidedLanes<'a> {
        GuidedLanes {
            guidance,
            rule,
            is_empty: [true; LANES],
            weights: [[0.0; 2]; LANES],
            steps: StepLanes::new(
                rule.medium.sigma_t,
                guidance.share,
                &guidance.turns,
                guidance.is_bent(),
            ),
            guides: GuideLanes::none(),
            found: FoundLanes::none(),
            draws: DrawLanes::plain(),
            normals: [DVec3::Z; LANES],
            per_entry: [0.0; LANES],
            streams: std::array::from_fn(|_| Stream::zero()),
            flights: [0; LANES],
        }
    }
}

impl<'a> WalkLanes for GuidedLanes<'a> {
    type Bands = GuidedBand<'a>;

    fn put(&mut self, lane: usize, band: &GuidedBand<'a>, ray: &Ray, weights: Weights, stream: &Stream) {
        self.is_empty[lane] = false;
        self.streams[lane] = stream.clone();
        let u = self.streams[lane].draw();
        self.steps.put(lane, [ray.origin, ray.dir], &band.heading, band.ratio, u);
        self.weights[lane] = weights;
        self.normals[lane] = band.normal;
        self.per_entry[lane] = band.per_entry;
        self.flights[lane] = 1;
        self.guidance.find(vector(self.steps.ends(), lane), lane, &mut self.found);
    }

    fn take(&mut self, lane: usize) -> Stream {
        self.is_empty[lane] = true;
        self.streams[lane].clone()
    }

    fn state(&self, lane: usize, band: &mut GuidedBand<'a>) -> Weights {
        (band.ratio, band.heading) = self.steps.state(lane);
        self.weights[lane]
    }

    #[inline(always)]
    fn flight(&self, lane: usize) -> (Ray, f64, DVec3) {
        let [origin, dir] = self.steps.flight(lane);
        (Ray { origin, dir }, self.steps.lengths()[lane], vector(self.steps.ends(), lane))
    }

    #[inline(always)]
    fn flights(&self) -> Flights<'_, LANES> {
        let (origins, ends) = (self.steps.origins(), self.steps.ends());
        Flights { origins, ends, lengths: self.steps.lengths() }
    }

    #[inline]
    fn begun(&self, lane: usize) -> u64 {
        self.flights[lane]
    }

    #[inline(always)]
    fn scatter(&mut self, mut arrive: impl FnMut(usize, LaneVertex<'_>)) -> [bool; LANES] {
        let Guidance { turns, share, .. } = self.guidance;
        let StepRule { roulette, survival, .. } = self.rule;
        let ends = self.steps.ends();
        let phi = self.guidance.guide_all(ends, &self.normals, &self.found, &mut self.guides);
        let ratios = *self.steps.arrive();
        let mut importances = [0.0; LANES];
        for lane in 0..LANES {
            importances[lane] = importance(phi[lane], self.per_entry[lane], ratios[lane]);
        }
        let mut goes_on = [false; LANES];
        for lane in 0..LANES {
            let stream = &mut self.streams[lane];
            let [throughput, seen] = &mut self.weights[lane];
            let importance = || importances[lane];
            goes_on[lane] = !self.is_empty[lane]
                && roulette.survive([throughput, seen], survival, importance, stream).is_some();
            if goes_on[lane] {
                let (weights, ratio) = (&self.weights[lane], ratios[lane]);
                let (points, arrivals) = (self.steps.origins(), self.steps.dirs());
                arrive(lane, LaneVertex { points, arrivals, weights, ratio, lane });
                self.draws.draw(lane, turns, *share, &self.guides, || stream.draw());
            } else {
                self.draws.end(lane);
            }
        }
        let streams = &mut self.streams;
        self.steps.depart(turns, &mut self.guides, &mut self.draws, |lane| streams[lane].draw());
        self.guidance.find_all(self.steps.ends(), &mut self.found);
        self.flights.iter_mut().for_each(|flights| *flights += 1);
        goes_on
    }
}
