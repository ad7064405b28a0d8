//! Distances along a ray.

use super::{Axis, Contrast, Draw, Piece, Sampler};
use crate::math::{atan2, exp, exp_m1, ln_1p, sin};
use crate::sampling::distance::{
    DistanceMixture, Equiangular, pdf_distance_exponential, pdf_distance_truncated_exponential,
    sample_exponential, sample_truncated_exponential,
};
use crate::sampling::stream::Stream;

/// A sample of one dimension.
pub(super) fn line(x: f64, density: f64) -> Draw {
    Draw::Point { piece: 0, at: [x, 0.5], density }
}

/// The only piece of one dimension, over [0, 1].
pub(super) fn unit(name: &str) -> Vec<Piece> {
    vec![Piece::line(name, Axis::over(0.0, 1.0))]
}

/// Lengths from 0 to infinity over [0, 1): t = l x / (1 - x), dt/dx = l / (1 - x)^2.
#[derive(Clone, Copy)]
pub(super) struct Unbounded(pub f64);

impl Unbounded {
    pub fn coordinate(self, t: f64) -> f64 {
        t / (t + self.0)
    }

    /// t and dt/dx; the end itself is infinitely far and has no density.
    pub fn at(self, x: f64) -> Option<(f64, f64)> {
        let left = 1.0 - x;
        (left > 0.0).then(|| (self.0 * x / left, self.0 / (left * left)))
    }
}

/// Exponential flight, charted by sigma_t t = x / (1 - x).
pub struct ExponentialSampler {
    sigma_t: f64,
}

impl ExponentialSampler {
    /// For this extinction, 1/mm.
    pub fn new(sigma_t: f64) -> ExponentialSampler {
        ExponentialSampler { sigma_t }
    }

    fn chart(&self) -> Unbounded {
        Unbounded(1.0 / self.sigma_t)
    }
}

impl Sampler for ExponentialSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let t = sample_exponential(self.sigma_t, stream.draw());
        let x = self.chart().coordinate(t);
        line(x, self.density(0, [x, 0.5]))
    }

    fn pieces(&self) -> Vec<Piece> {
        unit("distance")
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        self.chart().at(x).map_or(0.0, |(t, dt)| pdf_distance_exponential(self.sigma_t, t) * dt)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let (chart, sigma_t) = (self.chart(), self.sigma_t);
        let transmitted = move |x: f64| chart.at(x).map_or(0.0, |(t, _)| exp(-sigma_t * t));
        // e^(-sigma t) is uniform, and sigma t e^(-sigma t) has the mean int s e^(-2s) ds = 1/4.
        vec![
            Contrast::of("transmittance", Some(0.5), move |[x, _]| transmitted(x)),
            Contrast::of("optical depth times transmittance", Some(0.25), move |[x, _]| {
                chart.at(x).map_or(0.0, |(t, _)| sigma_t * t * exp(-sigma_t * t))
            }),
        ]
    }
}

/// Exponential flight inside a segment of optical depth tau, charted by sigma_t t = e^(l x) - 1 with
/// l = ln(1 + tau): linear in a thin medium, and the first mean free path of a thick one as wide as the
/// rest. dt/dx = l (1 + sigma_t t) / sigma_t.
pub struct TruncatedExponentialSampler {
    sigma_t: f64,
    t_max: f64,
}

impl TruncatedExponentialSampler {
    /// For this extinction (1/mm) and length (mm).
    pub fn new(sigma_t: f64, t_max: f64) -> TruncatedExponentialSampler {
        TruncatedExponentialSampler { sigma_t, t_max }
    }

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
        line(x, self.density(0, [x, 0.5]))
    }

    fn pieces(&self) -> Vec<Piece> {
        unit("distance")
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
pub(super) struct AngleChart {
    foot: f64,
    height: f64,
    t_max: f64,
    span: f64,
}

impl AngleChart {
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

    pub fn coordinate(&self, t: f64) -> f64 {
        self.angle(t) / self.span
    }

    /// t and dt/dx; an infinite end has no density.
    pub fn at(&self, x: f64) -> Option<(f64, f64)> {
        // Seen from the point, the foot is at the angle beta = atan2(f, h): t = f + h tan(phi - beta), as
        // one fraction sin(phi) sqrt(f^2 + h^2) / cos(phi - beta).
        let beta = atan2(self.foot, self.height);
        let phi = self.span * x;
        let far = (self.foot * self.foot + self.height * self.height).sqrt();
        let t = far * sin(phi) / crate::math::cos(phi - beta);
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

/// Equiangular distances.
pub struct EquiangularSampler {
    code: Equiangular,
    chart: AngleChart,
}

impl EquiangularSampler {
    /// The point's foot on the ray, its distance from the line, the ray's length; `None` where the code
    /// under test sees nothing to sample.
    pub fn new(foot: f64, distance: f64, t_max: f64) -> Option<EquiangularSampler> {
        let code = Equiangular::new(foot, distance, t_max)?;
        Some(EquiangularSampler { code, chart: AngleChart::new(foot, distance, t_max) })
    }
}

impl Sampler for EquiangularSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let t = self.code.sample(stream.draw());
        line(self.chart.coordinate(t), self.code.pdf_distance(t) * self.chart.slope(t))
    }

    fn pieces(&self) -> Vec<Piece> {
        unit("distance")
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        self.chart.at(x).map_or(0.0, |(t, slope)| self.code.pdf_distance(t) * slope)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let AngleChart { foot, height, span, .. } = self.chart;
        // The angle from the foot, alpha = phi - beta, is uniform: the mean of its sine is
        // (cos(beta) - cos(span - beta)) / span.
        let beta = atan2(foot, height);
        let mean = 2.0 * sin(0.5 * span) * sin(0.5 * span - beta) / span;
        vec![Contrast::of("sine of the angle from the foot", Some(mean), move |[x, _]| {
            sin(span * x - beta)
        })]
    }
}

/// Truncated exponential and equiangular distances, by one number, charted by the angle at the point.
pub struct MixtureSampler {
    code: DistanceMixture,
    chart: AngleChart,
}

impl MixtureSampler {
    /// Extinction, the point's foot and distance, the ray's length, the exponential's share.
    pub fn new(
        sigma_t: f64,
        foot: f64,
        distance: f64,
        t_max: f64,
        share: f64,
    ) -> Option<MixtureSampler> {
        let equiangular = Equiangular::new(foot, distance, t_max)?;
        let code = DistanceMixture { sigma_t, t_max, equiangular, share_exponential: share };
        Some(MixtureSampler { code, chart: AngleChart::new(foot, distance, t_max) })
    }
}

impl Sampler for MixtureSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let t = self.code.sample(stream.draw());
        line(self.chart.coordinate(t), self.code.pdf_distance(t) * self.chart.slope(t))
    }

    fn pieces(&self) -> Vec<Piece> {
        unit("distance")
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        self.chart.at(x).map_or(0.0, |(t, slope)| self.code.pdf_distance(t) * slope)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let (chart, sigma_t) = (self.chart, self.code.sigma_t);
        let transmitted = move |[x, _]: [f64; 2]| chart.at(x).map_or(0.0, |(t, _)| exp(-sigma_t * t));
        vec![Contrast::of("transmittance", None, transmitted)]
    }
}
