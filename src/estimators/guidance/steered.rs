//! The state of a guided walk.
//!
//! The walk carries the density with which it has been drawn, over that of a plain walk: `ratio`. Its throughput stays
//! that of the plain walk, so that a contribution is throughput * value / ratio, and techniques beside the walk, whose
//! densities are written relative to the plain walk, add them to ratio times the density of the walk's end; that is what
//! [`WalkBands::density`] says of walks that bands share, too.
//!
//! Turn and flight multiply it together ([`crate::optics::guided`]). After a boundary the direction is given, and the
//! flight alone is guided, with the same share.
//!
//! Roulette compares weight times importance with its value where the walk entered; along a walk of zero variance this
//! ratio is always 1.
//!
//! All that a step calls is inlined: it is a chain of short dependent operations, of which calls would cost a tenth.

mod lanes;

pub(in crate::estimators) use lanes::GuidedLanes;

use super::Guidance;
use crate::estimators::bands::WalkBands;
use crate::geometry::Ray;
use crate::math::DVec3;
use crate::optics::guided::{Heading, StepDraw, StepGuide};
use crate::optics::medium::Medium;
use crate::sampling::stream::Stream;

/// A walk that one band has for itself, guided.
#[derive(Clone, Copy, Debug)]
pub(in crate::estimators) struct GuidedBand<'a> {
    guidance: &'a Guidance,
    sigma_t: f64,
    /// Of the walk up to its last vertex.
    ratio: f64,
    /// Of the step that leads on.
    heading: Heading,
    /// How that step is drawn; `None` where its direction was given.
    drawn: Option<StepDraw>,
    /// Where the walk last met the boundary, the normal.
    normal: DVec3,
    /// 1 / phi where the walk first came in; 0 where nothing is known there.
    per_entry: f64,
    /// The last point that was asked for, its guide and phi.
    last: (DVec3, StepGuide, f64),
}

impl<'a> GuidedBand<'a> {
    /// At the sensor.
    pub(in crate::estimators) fn new(guidance: &'a Guidance, medium: &Medium) -> GuidedBand<'a> {
        GuidedBand {
            guidance,
            sigma_t: medium.sigma_t,
            ratio: 1.0,
            heading: Heading::NONE,
            drawn: None,
            normal: DVec3::Z,
            per_entry: 0.0,
            last: (DVec3::NAN, StepGuide::NONE, 0.0),
        }
    }

    #[inline(always)]
    fn at(&mut self, x: DVec3) -> &StepGuide {
        let (last, guide, phi) = &mut self.last;
        if *last != x {
            *last = x;
            *phi = self.guidance.at(x, self.normal, guide);
        }
        guide
    }
}

impl WalkBands for GuidedBand<'_> {
    const IS_PLAIN: bool = false;

    fn enter(&mut self, at: DVec3, normal: DVec3, dir: DVec3) {
        self.normal = normal;
        self.last.0 = DVec3::NAN;
        let Guidance { turns, share, .. } = self.guidance;
        self.heading = Heading::given(*share, turns.growth(self.at(at), dir));
        self.drawn = None;
        if self.per_entry == 0.0 && self.last.2 > 0.0 {
            self.per_entry = 1.0 / self.last.2;
        }
    }

    #[inline(always)]
    fn draw_turn(&mut self, _: &Medium, arrival: &Ray, stream: &mut Stream) -> DVec3 {
        let Guidance { turns, share, .. } = self.guidance;
        let guide = self.at(arrival.origin);
        let (dir, drawn) = turns.sample_mixed(*share, guide, arrival.dir, || stream.draw());
        self.drawn = Some(drawn);
        dir
    }

    #[inline(always)]
    fn draw_flight(&mut self, medium: &Medium, u: f64) -> f64 {
        let (drawn, u) = match self.drawn {
            Some(drawn) => (drawn, u),
            None => self.heading.choose(u),
        };
        self.heading.sample_distance(medium.sigma_t, drawn, u)
    }

    #[inline(always)]
    fn turn(&mut self, _: &[Medium], at: DVec3, from: DVec3, to: DVec3) {
        let Guidance { turns, share, .. } = self.guidance;
        self.heading = turns.heading(*share, self.at(at), from, to);
    }

    #[inline(always)]
    fn flight(&mut self, _: &[Medium], t: f64, scatters: bool) {
        let over_plain = if scatters { Heading::flight_ratio } else { Heading::passage_ratio };
        let flown = over_plain(&self.heading, self.sigma_t, t);
        // Finite, also where the plain walk's probability is 0 in double precision.
        self.ratio = (self.ratio * flown).min(f64::MAX);
        self.heading = Heading::NONE;
    }

    #[inline]
    fn arrive(&mut self, ratio: f64) {
        (self.ratio, self.heading) = (ratio, Heading::NONE);
    }

    #[inline]
    fn facets(&self) -> Option<usize> {
        Some(self.guidance.facets)
    }

    #[inline]
    fn gain_of_leaving(&mut self, at: DVec3) -> f64 {
        self.guidance.gain_of_leaving(at)
    }

    /// A passage is not drawn.
    fn passage(&mut self, _: &[Medium], _: f64) {}

    #[inline(always)]
    fn importance(&mut self, at: DVec3) -> f64 {
        self.at(at);
        importance(self.last.2, self.per_entry, self.ratio)
    }

    #[inline]
    fn density(&self) -> f64 {
        self.ratio * self.heading.turned()
    }
}

/// phi over its value where the walk came in, 1 if that is unknown, over the density of the walk.
#[inline(always)]
fn importance(phi: f64, per_entry: f64, ratio: f64) -> f64 {
    let importance = phi * per_entry;
    (if importance > 0.0 { importance } else { 1.0 }) / ratio
}
