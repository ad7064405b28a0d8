//! The state of a guided walk.
//!
//! The walk carries the density with which it has been drawn, over that of a plain walk: `ratio`. Its throughput stays
//! that of the plain walk, so that a contribution is throughput * value / ratio, and techniques beside the walk, whose
//! densities are written relative to the plain walk, add them to ratio times the density of the walk's end; that is what
//! [`WalkBands::density`] says of walks that bands share, too.
//!
//! Turn and flight multiply it together ([`crate::optics::guided`]). After a boundary the direction is given, and the
//! flight is guided with the share of the whole.
//!
//! Roulette looks at weight times importance over what it was where the walk came in: of a walk of zero variance it is 1
//! all the way.

use super::Guidance;
use crate::estimators::bands::WalkBands;
use crate::geometry::Ray;
use crate::math::DVec3;
use crate::optics::guided::{Heading, Pull};
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
    /// Whether that step is guided; `None` where its direction was given.
    is_guided: Option<bool>,
    /// Where the walk last met the boundary, the normal.
    normal: DVec3,
    /// 1 / phi where the walk first came in; 0 where nothing is known there.
    per_entry: f64,
    /// The last point that was asked for, its pull and phi.
    last: (DVec3, Pull, f64),
}

impl<'a> GuidedBand<'a> {
    /// At the sensor.
    pub(in crate::estimators) fn new(guidance: &'a Guidance, medium: &Medium) -> GuidedBand<'a> {
        GuidedBand {
            guidance,
            sigma_t: medium.sigma_t,
            ratio: 1.0,
            heading: Heading::NONE,
            is_guided: None,
            normal: DVec3::Z,
            per_entry: 0.0,
            last: (DVec3::NAN, Pull::NONE, 0.0),
        }
    }

    #[inline]
    fn at(&mut self, x: DVec3) -> Pull {
        if self.last.0 != x {
            let (pull, phi) = self.guidance.at(x, self.normal);
            self.last = (x, pull, phi);
        }
        self.last.1
    }
}

impl WalkBands for GuidedBand<'_> {
    fn enter(&mut self, at: DVec3, normal: DVec3, dir: DVec3) {
        self.normal = normal;
        self.last.0 = DVec3::NAN;
        self.heading = Heading::given(self.guidance.share, self.at(at).along(dir));
        self.is_guided = None;
        if self.per_entry == 0.0 && self.last.2 > 0.0 {
            self.per_entry = 1.0 / self.last.2;
        }
    }

    #[inline]
    fn draw_turn(&mut self, _: &Medium, arrival: &Ray, stream: &mut Stream) -> DVec3 {
        let pull = self.at(arrival.origin);
        let Guidance { turns, share, .. } = self.guidance;
        let (dir, is_guided) = turns.sample_mixed(*share, &pull, arrival.dir, || stream.draw());
        self.is_guided = Some(is_guided);
        dir
    }

    #[inline]
    fn draw_flight(&mut self, medium: &Medium, u: f64) -> f64 {
        let (is_guided, u) = match self.is_guided {
            Some(is_guided) => (is_guided, u),
            None => self.heading.choose(u),
        };
        self.heading.sample_distance(medium.sigma_t, is_guided, u)
    }

    #[inline]
    fn turn(&mut self, _: &[Medium], at: DVec3, from: DVec3, to: DVec3) {
        let pull = self.at(at);
        self.heading = self.guidance.turns.heading(self.guidance.share, &pull, from, to);
    }

    #[inline]
    fn flight(&mut self, _: &[Medium], t: f64, scatters: bool) {
        let over_plain = if scatters { Heading::flight_ratio } else { Heading::passage_ratio };
        let flown = over_plain(&self.heading, self.sigma_t, t);
        // Finite, also where the plain walk's probability is 0 in double precision.
        self.ratio = (self.ratio * flown).min(f64::MAX);
        self.heading = Heading::NONE;
    }

    #[inline]
    fn splits_at_entry(&self) -> bool {
        true
    }

    /// A passage is not drawn.
    fn passage(&mut self, _: &[Medium], _: f64) {}

    #[inline]
    fn importance(&mut self, at: DVec3) -> f64 {
        self.at(at);
        let importance = self.last.2 * self.per_entry;
        (if importance > 0.0 { importance } else { 1.0 }) / self.ratio
    }

    #[inline]
    fn density(&self) -> f64 {
        self.ratio * self.heading.turned()
    }
}
