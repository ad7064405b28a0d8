//! Discrete choices: bands, and a flight by a hero band.

use schemars::JsonSchema;
use serde::Deserialize;

use super::chart::{Charted, Technique, Unbounded};
use super::kind::{SamplerKind, sampler_kind, some};
use super::sampler::{Contrast, Discrete, Draw, Piece, Sampler};
use crate::math::exp;
use crate::sampling::discrete::Cumulative;
use crate::sampling::distance::{pdf_distance_exponential, sample_exponential};
use crate::sampling::stream::Stream;

/// `band_selection` in experiment files.
pub const BAND: SamplerKind = sampler_kind!(
    "band_selection",
    "one band of many, by its probability",
    BandOptions => |o| some(BandSampler::new(&o.weights))
);

/// Options of `band_selection`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BandOptions {
    /// Weights of the bands, in any unit.
    #[schemars(length(min = 1), inner(range(min = 0.0)))]
    weights: Vec<f64>,
}

/// One band of many, and whether its table has the probability that was asked for.
pub struct BandSampler {
    table: Cumulative,
    probabilities: Vec<f64>,
}

impl BandSampler {
    /// Bands in proportion to `weights`; `None` if they are no distribution.
    pub fn new(weights: &[f64]) -> Option<BandSampler> {
        let table = Cumulative::new(weights)?;
        let total: f64 = weights.iter().sum();
        Some(BandSampler { table, probabilities: weights.iter().map(|w| w / total).collect() })
    }
}

impl Sampler for BandSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let (index, rest) = self.table.sample(stream.draw());
        let is_stated = (self.table.probability(index) - self.probabilities[index]).abs() < 1e-12;
        Draw::Delta { index, exact: is_stated && (0.0..1.0).contains(&rest) }
    }

    fn pieces(&self) -> Vec<Piece> {
        Vec::new()
    }

    fn density(&self, _piece: usize, _at: [f64; 2]) -> f64 {
        0.0
    }

    fn deltas(&self) -> Vec<Discrete> {
        let band = |(k, &mass): (usize, &f64)| Discrete { name: format!("band {k}"), mass };
        self.probabilities.iter().enumerate().map(band).collect()
    }
}

/// `hero_flight` in experiment files, charted by t = l x / (1 - x), l the mean of the mean free paths.
pub const HERO_FLIGHT: SamplerKind = sampler_kind!(
    "hero_flight",
    "free flights by a hero band, with the density of all bands together",
    HeroOptions => |o| {
        let sigma_t = o.sigma_t_per_mm;
        let table = Cumulative::new(&o.weights).filter(|_| sigma_t.len() == o.weights.len());
        let mean = sigma_t.iter().map(|s| 1.0 / s).sum::<f64>() / sigma_t.len() as f64;
        Ok(Charted::new(HeroFlight { table: some(table)?, sigma_t }, Unbounded(mean)))
    }
);

/// Options of `hero_flight`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct HeroOptions {
    /// Extinctions of the bands, 1/mm.
    #[schemars(length(min = 1), inner(range(min = 1e-6)))]
    sigma_t_per_mm: Vec<f64>,
    /// Weights of the bands, as many, in any unit.
    #[schemars(length(min = 1), inner(range(min = 0.0)))]
    weights: Vec<f64>,
}

/// An exponential flight by a band that is chosen first, with what is left of the same number: the
/// density is the mixture over all bands.
struct HeroFlight {
    table: Cumulative,
    sigma_t: Vec<f64>,
}

impl Technique<Unbounded> for HeroFlight {
    fn sample(&self, stream: &mut Stream) -> (f64, Option<f64>) {
        let (hero, u) = self.table.sample(stream.draw());
        (sample_exponential(self.sigma_t[hero], u), None)
    }

    fn pdf(&self, t: f64) -> f64 {
        self.table.mixture_pdf(self.sigma_t.iter().map(|&s| pdf_distance_exponential(s, t)))
    }

    fn contrasts(&self, chart: &Unbounded) -> Vec<Contrast> {
        // int s e^(-s t) e^(-c t) dt = s / (s + c) in every band.
        let rate = 1.0 / chart.0;
        let mean = |(k, s): (usize, &f64)| self.table.probability(k) * s / (s + rate);
        let expected = self.sigma_t.iter().enumerate().map(mean).sum();
        vec![chart.contrast("mean decay", expected, move |t| exp(-rate * t))]
    }
}
