//! Distances along a ray.

use schemars::JsonSchema;
use serde::Deserialize;

use super::chart::{Chart, Charted, Measure, Technique, Unbounded};
use super::kind::{SamplerKind, sampler_kind, some};
use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler};
use crate::math::{atan2, cos, exp, exp_m1, ln_1p, sin};
use crate::sampling::distance::{
    DistanceMixture, Equiangular, pdf_distance_exponential, pdf_distance_truncated_exponential,
    sample_exponential, sample_truncated_exponential,
};
use crate::sampling::stream::Stream;

/// `exponential_distance` in experiment files.
pub const EXPONENTIAL: SamplerKind = sampler_kind!(
    "exponential_distance",
    "free flights",
    ExponentialFlight => |flight| Ok(Charted::new(flight, Unbounded(1.0 / flight.sigma_t)))
);

/// Exponential flight, charted by sigma_t t = x / (1 - x).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExponentialFlight {
    /// Extinction, 1/mm.
    #[serde(rename = "sigma_t_per_mm")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    sigma_t: f64,
}

impl Technique<Unbounded> for ExponentialFlight {
    fn sample(&self, stream: &mut Stream) -> (f64, Option<f64>) {
        (sample_exponential(self.sigma_t, stream.draw()), None)
    }

    fn pdf(&self, t: f64) -> f64 {
        pdf_distance_exponential(self.sigma_t, t)
    }

    /// e^(-sigma t) is uniform, and sigma t e^(-sigma t) has the mean int s e^(-2s) ds = 1/4.
    fn contrasts(&self, chart: &Unbounded) -> Vec<Contrast> {
        let sigma_t = self.sigma_t;
        vec![
            chart.contrast("transmittance", 0.5, move |t| exp(-sigma_t * t)),
            chart.contrast("optical depth times transmittance", 0.25, move |t| {
                sigma_t * t * exp(-sigma_t * t)
            }),
        ]
    }
}

/// `truncated_exponential_distance` in experiment files.
pub const TRUNCATED_EXPONENTIAL: SamplerKind = sampler_kind!(
    "truncated_exponential_distance",
    "free flights that end inside a segment",
    TruncatedExponentialSampler => Ok
);

/// Exponential flight inside a segment of optical depth tau, charted by sigma_t t = e^(l x) - 1 with
/// l = ln(1 + tau): linear in a thin medium, and the first mean free path of a thick one as wide as the
/// rest. dt/dx = l (1 + sigma_t t) / sigma_t.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TruncatedExponentialSampler {
    /// Extinction, 1/mm.
    #[serde(rename = "sigma_t_per_mm")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    sigma_t: f64,
    /// Length of the segment, mm.
    #[serde(rename = "t_max_mm")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    t_max: f64,
}

impl TruncatedExponentialSampler {
    fn length(&self) -> f64 {
        ln_1p(self.sigma_t * self.t_max)
    }

    fn t(&self, x: f64) -> f64 {
        (exp_m1(self.length() * x) / self.sigma_t).min(self.t_max)
    }
}

impl Sampler for TruncatedExponentialSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let t = sample_truncated_exponential(self.sigma_t, self.t_max, stream.draw());
        let x = ln_1p(self.sigma_t * t) / self.length();
        Draw::Point { piece: 0, at: [x, 0.5], density: self.density(0, [x, 0.5]) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::line("distance", Coordinate::over(0.0, 1.0))]
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        let t = self.t(x);
        pdf_distance_truncated_exponential(self.sigma_t, self.t_max, t)
            * self.length()
            * (1.0 / self.sigma_t + t)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let TruncatedExponentialSampler { sigma_t, t_max } = *self;
        let tau = sigma_t * t_max;
        // int s e^(-s) ds over [0, tau] / (tau (1 - e^(-tau))) = 1/tau - 1/(e^tau - 1); for small tau
        // 1/2 - tau/12 + O(tau^3).
        let mean = if tau < 1e-4 { 0.5 - tau / 12.0 } else { 1.0 / tau - 1.0 / exp_m1(tau) };
        let sampler = TruncatedExponentialSampler { sigma_t, t_max };
        vec![Contrast::of("mean share of the length", Some(mean), move |[x, _]| sampler.t(x) / t_max)]
    }
}

/// Equiangular distances, charted by the angle at the point, from the ray's origin to the sample.
///
/// With f the point's foot and h its distance from the ray's line (at least the sampler's stated clamp):
/// the angle of t is phi(t) = atan2(h t, f^2 + h^2 - f t), from the cross and dot products of the two
/// sides of the triangle; x = phi(t) / phi(t_max), dt/dx = phi(t_max) (h^2 + (t - f)^2) / h.
#[derive(Clone, Copy)]
pub struct AngleChart {
    foot: f64,
    height: f64,
    t_max: f64,
    span: f64,
}

impl AngleChart {
    /// For a point by its foot on the ray and its distance from it, and the ray's length.
    pub fn new(foot: f64, height: f64, t_max: f64) -> AngleChart {
        let height = height.max(Equiangular::CLAMP * (foot * foot + height * height).sqrt());
        let mut chart = AngleChart { foot, height, t_max, span: 1.0 };
        chart.span = if t_max.is_finite() { chart.angle(t_max) } else { atan2(height, -foot) };
        chart
    }

    fn angle(&self, t: f64) -> f64 {
        let far2 = self.foot * self.foot + self.height * self.height;
        atan2(self.height * t, far2 - self.foot * t)
    }

    /// The coordinate of a distance.
    pub fn coordinate(&self, t: f64) -> f64 {
        self.angle(t) / self.span
    }

    /// t and dt/dx; an infinite end has no density.
    pub fn at(&self, x: f64) -> Option<(f64, f64)> {
        // Seen from the point, the foot is at the angle beta = atan2(f, h): t = f + h tan(phi - beta),
        // as one fraction sin(phi) sqrt(f^2 + h^2) / cos(phi - beta).
        let beta = atan2(self.foot, self.height);
        let phi = self.span * x;
        let far = (self.foot * self.foot + self.height * self.height).sqrt();
        let t = far * sin(phi) / cos(phi - beta);
        let t = if t < 0.0 { f64::INFINITY } else { t.min(self.t_max) };
        let slope = self.slope(t);
        slope.is_finite().then_some((t, slope))
    }

    /// dt/dx at a distance.
    pub fn slope(&self, t: f64) -> f64 {
        let along = t - self.foot;
        self.span * (self.height * self.height + along * along) / self.height
    }
}

impl Chart for AngleChart {
    type Point = f64;

    fn piece(&self) -> Piece {
        Piece::line("distance", Coordinate::over(0.0, 1.0))
    }

    fn place(&self, t: f64) -> ([f64; 2], Measure) {
        ([self.coordinate(t), 0.5], Measure::of(self.slope(t)))
    }

    fn point(&self, [x, _]: [f64; 2]) -> Option<(f64, Measure)> {
        self.at(x).map(|(t, slope)| (t, Measure::of(slope)))
    }
}

/// `equiangular_distance` in experiment files.
pub const EQUIANGULAR: SamplerKind = sampler_kind!(
    "equiangular_distance",
    "distances along a ray by the angle at a point",
    EquiangularOptions => |o| {
        let chart = AngleChart::new(o.foot_mm, o.distance_mm, end(o.t_max_mm));
        let code = some(Equiangular::new(o.foot_mm, o.distance_mm, end(o.t_max_mm)))?;
        Ok(Charted::new(code, chart))
    }
);

/// An end of a ray that may be left out.
pub(super) fn end(t_max: Option<f64>) -> f64 {
    t_max.unwrap_or(f64::INFINITY)
}

/// Options of `equiangular_distance`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct EquiangularOptions {
    /// Where the point's foot is along the ray, mm; negative behind its origin.
    foot_mm: f64,
    /// The point's distance from the ray's line, mm.
    #[schemars(range(min = 0.0))]
    distance_mm: f64,
    /// Length of the ray, mm; left out, it has no end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    t_max_mm: Option<f64>,
}

impl Technique<AngleChart> for Equiangular {
    fn sample(&self, stream: &mut Stream) -> (f64, Option<f64>) {
        let t = self.sample(stream.draw());
        (t, Some(self.pdf(t)))
    }

    fn pdf(&self, t: f64) -> f64 {
        self.pdf_distance(t)
    }

    fn contrasts(&self, chart: &AngleChart) -> Vec<Contrast> {
        let AngleChart { foot, height, span, .. } = *chart;
        // The angle from the foot, alpha = phi - beta, is uniform: the mean of its sine is
        // (cos(beta) - cos(span - beta)) / span.
        let beta = atan2(foot, height);
        let mean = 2.0 * sin(0.5 * span) * sin(0.5 * span - beta) / span;
        vec![Contrast::of("sine of the angle from the foot", Some(mean), move |[x, _]| {
            sin(span * x - beta)
        })]
    }
}

/// `distance_mixture` in experiment files.
pub const MIXTURE: SamplerKind = sampler_kind!(
    "distance_mixture",
    "truncated exponential and equiangular distances, one-sample MIS",
    MixtureOptions => |o| {
        let t_max = end(o.t_max_mm);
        let equiangular = some(Equiangular::new(o.foot_mm, o.distance_mm, t_max))?;
        let (sigma_t, share_exponential) = (o.sigma_t_per_mm, o.share_exponential);
        let code = DistanceMixture { sigma_t, t_max, equiangular, share_exponential };
        Ok(Charted::new(code, AngleChart::new(o.foot_mm, o.distance_mm, t_max)))
    }
);

/// Options of `distance_mixture`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MixtureOptions {
    /// Extinction, 1/mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    sigma_t_per_mm: f64,
    /// Where the point's foot is along the ray, mm; negative behind its origin.
    foot_mm: f64,
    /// The point's distance from the ray's line, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    distance_mm: f64,
    /// Length of the ray, mm; left out, it has no end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    t_max_mm: Option<f64>,
    /// Probability of the exponential.
    #[schemars(range(min = 0.0, max = 1.0))]
    share_exponential: f64,
}

/// Truncated exponential and equiangular distances, by one number, charted by the angle at the point.
impl Technique<AngleChart> for DistanceMixture {
    fn sample(&self, stream: &mut Stream) -> (f64, Option<f64>) {
        let t = self.sample(stream.draw());
        (t, Some(self.pdf(t)))
    }

    fn pdf(&self, t: f64) -> f64 {
        self.pdf_distance(t)
    }

    fn contrasts(&self, chart: &AngleChart) -> Vec<Contrast> {
        let (chart, sigma_t) = (*chart, self.sigma_t);
        let transmitted = move |[x, _]: [f64; 2]| chart.at(x).map_or(0.0, |(t, _)| exp(-sigma_t * t));
        vec![Contrast::of("transmittance", None, transmitted)]
    }
}
