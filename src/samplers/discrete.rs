//! Discrete choices: bands, and a flight by a hero band.

use super::distance::{Unbounded, line, unit};
use super::{Contrast, Discrete, Draw, Piece, Sampler};
use crate::math::exp;
use crate::sampling::discrete::Cumulative;
use crate::sampling::distance::{pdf_distance_exponential, sample_exponential};
use crate::sampling::stream::Stream;

/// One band of many, and whether its table says the probability that was asked for.
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

/// An exponential flight by a band that is chosen first, with what is left of the same number: the density
/// is the mixture over all bands. Charted by t = l x / (1 - x), l the mean of the mean free paths.
pub struct HeroFlightSampler {
    table: Cumulative,
    sigma_t: Vec<f64>,
    chart: Unbounded,
}

impl HeroFlightSampler {
    /// Extinctions (1/mm) and the weights of their bands, as many; `None` if these are no distribution.
    pub fn new(sigma_t: Vec<f64>, weights: &[f64]) -> Option<HeroFlightSampler> {
        let table = Cumulative::new(weights)?;
        if sigma_t.len() != weights.len() {
            return None;
        }
        let mean = sigma_t.iter().map(|s| 1.0 / s).sum::<f64>() / sigma_t.len() as f64;
        Some(HeroFlightSampler { table, sigma_t, chart: Unbounded(mean) })
    }
}

impl Sampler for HeroFlightSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let (hero, u) = self.table.sample(stream.draw());
        let x = self.chart.coordinate(sample_exponential(self.sigma_t[hero], u));
        line(x, self.density(0, [x, 0.5]))
    }

    fn pieces(&self) -> Vec<Piece> {
        unit("distance")
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        let pdfs = |t| self.sigma_t.iter().map(move |&s| pdf_distance_exponential(s, t));
        self.chart.at(x).map_or(0.0, |(t, dt)| self.table.mixture_pdf(pdfs(t)) * dt)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        // int s e^(-s t) e^(-c t) dt = s / (s + c) in every band.
        let rate = 1.0 / self.chart.0;
        let mean = |(k, s): (usize, &f64)| self.table.probability(k) * s / (s + rate);
        let expected = self.sigma_t.iter().enumerate().map(mean).sum();
        let chart = self.chart;
        let decay = move |[x, _]: [f64; 2]| chart.at(x).map_or(0.0, |(t, _)| exp(-rate * t));
        vec![Contrast::of("mean decay", Some(expected), decay)]
    }
}
