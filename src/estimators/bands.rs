//! How a walk is drawn, and the state that this needs. A plain walk that traces one band needs none; a walk that is
//! shared by all bands keeps the value and density of each band; a guided walk (`guidance`) keeps its density.
//!
//! Shared walks (hero wavelengths, Wilkie et al. 2014). The hero h is drawn with probability 1/n; flights are drawn
//! from its extinction, and directions from its phase function. With f_b and p_b the integrand
//! and the density of the walk in band b, the walk carries
//!   value_b = f_b / (p_h w),   rho_b = p_b / p_h,
//! w being the hero's throughput without its albedos. Step by step, relative to the hero,
//!   a flight of length d that ends in the medium   rho_b *= (sigma_t,b / sigma_t,h)
//!                                                           e^{-(sigma_t,b - sigma_t,h) d},
//!                                                  value_b *= the same * albedo_b / survival
//!   one that ends at the boundary                  both *= e^{-(sigma_t,b - sigma_t,h) d}
//!   a turn                                         both *= phase_b / phase_h
//! where survival is the factor that roulette sees, one for all bands (the largest albedo). By the
//! balance heuristic over heroes a walk scores value_b w / (sum over m of rho_m / n) in band b. Equal
//! coefficients make every factor exactly 1, and every band the same to the last bit.

use super::{Scores, TransportClass};
use crate::geometry::Ray;
use crate::math::{DVec3, exp};
use crate::optics::medium::Medium;
use crate::sampling::distance::sample_exponential;
use crate::sampling::stream::Stream;

/// How a walk is drawn, and the state that it keeps for it.
pub(super) trait WalkBands: Clone {
    /// Flights, turns and roulette are those of the medium, wherever the walk is: by [`Self::draw_flight`],
    /// [`Self::draw_turn`] and [`Self::importance`] as they are here.
    const IS_PLAIN: bool;

    /// The walk goes on inside from a boundary point with this outward normal, along `dir`.
    #[inline]
    fn enter(&mut self, _at: DVec3, _normal: DVec3, _dir: DVec3) {}

    /// Draws a direction for light that has arrived at a medium vertex along a ray, which ends there.
    #[inline(always)]
    fn draw_turn(&mut self, medium: &Medium, arrival: &Ray, stream: &mut Stream) -> DVec3 {
        medium.phase.sample(arrival.dir, stream.draw2())
    }

    /// Draws the length of the next flight, if no boundary ends it.
    #[inline(always)]
    fn draw_flight(&mut self, medium: &Medium, u: f64) -> f64 {
        sample_exponential(medium.sigma_t, u)
    }

    /// A flight of length `t` in the medium, which ends in a scattering event or at the boundary.
    fn flight(&mut self, media: &[Medium], t: f64, scatters: bool);

    /// A passage of length `t` that is scored by its expectation: no flight is drawn.
    fn passage(&mut self, media: &[Medium], t: f64) {
        self.flight(media, t, false);
    }

    /// A change of direction at a medium vertex.
    fn turn(&mut self, media: &[Medium], at: DVec3, from: DVec3, to: DVec3);

    /// The number of facets out of which a direction at the boundary is chosen, where it is worth more than one sample; both
    /// what it reflects and what it refracts are then followed where the path first meets it.
    #[inline]
    fn facets(&self) -> Option<usize> {
        None
    }

    /// What light finds that leaves the body at a boundary point, over what it finds that is reflected back inside; 1 where a
    /// walk knows nothing of it.
    #[inline]
    fn gain_of_leaving(&mut self, _at: DVec3) -> f64 {
        1.0
    }

    /// The walk has arrived at a medium vertex by flights that it made in a lane, with this density up to there, over that of a
    /// plain walk.
    #[inline]
    fn arrive(&mut self, _ratio: f64) {}

    /// The factor that roulette sees at a scattering event, for the medium of the walk's own band.
    #[inline]
    fn survival(&self, medium: &Medium) -> f64 {
        medium.albedo
    }

    /// What roulette multiplies the weight by at a medium vertex: importance there over that where the walk came in, and
    /// over [`Self::density`]; 1 where a walk knows nothing of it.
    #[inline]
    fn importance(&mut self, _at: DVec3) -> f64 {
        1.0
    }

    /// Density of the walk as it is drawn, over that of a plain walk in its own band; of a walk that bands share, that
    /// under any hero: sum of rho_m / n.
    fn density(&self) -> f64;

    /// Adds a contribution of the walk's own band, and to every other that the walk scores what it is
    /// there.
    #[inline]
    fn score(&self, scores: &mut Scores, own: ScorePlace, value: f64) {
        scores.add(own.slot, own.band, own.class, own.light, value);
    }

    /// Whether the medium emits in a band that a walk of band `own` scores.
    #[inline]
    fn emits(&self, media: &[Medium], own: usize) -> bool {
        media[own].emission > 0.0
    }

    /// Adds, for every band that the walk scores, `factor` times the emission that reaches the walk's
    /// vertex along the next `t` mm of its direction.
    fn score_emission(
        &self,
        scores: &mut Scores,
        own: ScorePlace,
        media: &[Medium],
        t: f64,
        factor: f64,
    ) {
        self.score(scores, own, factor * media[own.band].emitted(t));
    }
}

/// Where a contribution counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScorePlace {
    pub slot: usize,
    pub band: usize,
    pub class: TransportClass,
    /// Index of the light; the number of lights stands for the medium's emission.
    pub light: usize,
}

/// A plain walk that one band has for itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct OneBand;

impl WalkBands for OneBand {
    const IS_PLAIN: bool = true;

    #[inline]
    fn flight(&mut self, _: &[Medium], _: f64, _: bool) {}

    #[inline]
    fn turn(&mut self, _: &[Medium], _: DVec3, _: DVec3, _: DVec3) {}

    #[inline]
    fn density(&self) -> f64 {
        1.0
    }
}

/// The most bands that can share a walk.
pub(super) const MAX_SHARED: usize = 32;

/// A walk that all bands share.
#[derive(Clone, Copy, Debug)]
pub(super) struct SharedBands {
    hero: usize,
    count: usize,
    survival: f64,
    value: [f64; MAX_SHARED],
    rho: [f64; MAX_SHARED],
}

impl SharedBands {
    /// At the sensor; at most [`MAX_SHARED`] media.
    pub(super) fn new(media: &[Medium], hero: usize) -> SharedBands {
        SharedBands {
            hero,
            count: media.len(),
            survival: media.iter().map(|m| m.albedo).fold(0.0, f64::max),
            value: [1.0; MAX_SHARED],
            rho: [1.0; MAX_SHARED],
        }
    }
}

impl WalkBands for SharedBands {
    const IS_PLAIN: bool = true;

    fn flight(&mut self, media: &[Medium], t: f64, scatters: bool) {
        let hero = media[self.hero].sigma_t;
        for (band, medium) in media.iter().enumerate() {
            let reach = exp(-(medium.sigma_t - hero) * t);
            if scatters {
                let step = reach * (medium.sigma_t / hero);
                self.rho[band] *= step;
                self.value[band] *= step * (medium.albedo / self.survival);
            } else {
                self.rho[band] *= reach;
                self.value[band] *= reach;
            }
        }
    }

    fn turn(&mut self, media: &[Medium], _: DVec3, from: DVec3, to: DVec3) {
        let mu = from.dot(to);
        let hero = media[self.hero].phase.pdf(mu);
        for (band, medium) in media.iter().enumerate() {
            let step = medium.phase.pdf(mu) / hero;
            self.rho[band] *= step;
            self.value[band] *= step;
        }
    }

    fn survival(&self, _: &Medium) -> f64 {
        self.survival
    }

    fn density(&self) -> f64 {
        self.rho[..self.count].iter().sum::<f64>() / self.count as f64
    }

    fn score(&self, scores: &mut Scores, own: ScorePlace, value: f64) {
        for band in 0..self.count {
            scores.add(own.slot, band, own.class, own.light, self.value[band] * value);
        }
    }

    fn emits(&self, media: &[Medium], _: usize) -> bool {
        media.iter().any(|medium| medium.emission > 0.0)
    }

    /// The technique has drawn the walk up to the direction of the ray; along the ray it integrates, in
    /// every band with the extinction of that band. So value and density are those at the ray's vertex.
    fn score_emission(
        &self,
        scores: &mut Scores,
        own: ScorePlace,
        media: &[Medium],
        t: f64,
        factor: f64,
    ) {
        for (band, medium) in media.iter().enumerate() {
            let value = self.value[band] * factor * medium.emitted(t);
            scores.add(own.slot, band, own.class, own.light, value);
        }
    }
}
