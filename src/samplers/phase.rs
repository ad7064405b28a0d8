//! Phase functions.

use std::f64::consts::TAU;

use super::chart::AXIS;
use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler, turns};
use crate::math::{DVec3, Frame, exp_m1, ln_1p};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::Stream;

/// `henyey_greenstein` in experiment files.
pub const KIND: SamplerKind = sampler_kind!(
    "henyey_greenstein",
    "directions of the Henyey-Greenstein phase function",
    HenyeyGreenstein => |phase| Ok(HenyeyGreensteinSampler::new(phase.g))
);

/// Henyey-Greenstein about a direction of travel that is aligned with nothing.
///
/// Chart: x = ln(1 + (1 - mu)/s) / L with s = (1 - |g|)^2 and L = ln(1 + 2/s), so that the peak and the
/// rest are both of size 1; the azimuth in turns. 1 - mu = s (e^(L x) - 1), d(1 - mu)/dx = L (s + 1 -
/// mu), hence density = pdf * 2 pi * L (s + 1 - mu). For g < 0 the chart is mirrored: 1 + mu for 1 - mu.
pub struct HenyeyGreensteinSampler {
    phase: HenyeyGreenstein,
    about: Frame,
    dir: DVec3,
    scale: f64,
    length: f64,
}

impl HenyeyGreensteinSampler {
    /// For this mean cosine.
    pub fn new(g: f64) -> HenyeyGreensteinSampler {
        let scale = (1.0 - g.abs()) * (1.0 - g.abs());
        let dir = AXIS;
        let phase = HenyeyGreenstein { g };
        let length = ln_1p(2.0 / scale);
        HenyeyGreensteinSampler { phase, about: Frame::about(dir), dir, scale, length }
    }

    /// Where the peak is.
    fn pole(&self) -> DVec3 {
        if self.phase.g < 0.0 { -self.dir } else { self.dir }
    }

    /// 1 - |cosine to the peak| at a chart coordinate.
    fn below_pole(&self, x: f64) -> f64 {
        (self.scale * exp_m1(self.length * x)).min(2.0)
    }

    fn mu(&self, x: f64) -> f64 {
        let mu = 1.0 - self.below_pole(x);
        if self.phase.g < 0.0 { -mu } else { mu }
    }
}

impl Sampler for HenyeyGreensteinSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let next = self.phase.sample(self.dir, stream.draw2());
        // |next - pole|^2 / 2 = 1 - cosine, with all its digits near the pole.
        let from_pole = 0.5 * (next - self.pole()).length_squared();
        let x = (ln_1p(from_pole / self.scale) / self.length).clamp(0.0, 1.0);
        let local = self.about.to_local(next);
        let pdf = self.phase.pdf(next.dot(self.dir));
        let density = pdf * TAU * self.length * (self.scale + from_pole);
        Draw::Point { piece: 0, at: [x, turns(local.x, local.y)], density }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Coordinate::over(0.0, 1.0), Coordinate::turns()])]
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        self.phase.pdf(self.mu(x)) * TAU * self.length * (self.scale + self.below_pole(x))
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let g = self.phase.g;
        let poles = HenyeyGreensteinSampler::new(g);
        let mean_cosine = Contrast::of("mean cosine", Some(g), move |[x, _]| poles.mu(x));
        let poles = HenyeyGreensteinSampler::new(g);
        let is_forward = move |[x, _]: [f64; 2]| if poles.mu(x) > 0.0 { 1.0 } else { 0.0 };
        let forward = Contrast::of("forward share", Some(forward_share(g)), is_forward);
        vec![mean_cosine, forward, Contrast::azimuth()]
    }
}

/// The probability of mu > 0: int_0^1 (1 - g^2) / (2 (1 + g^2 - 2 g mu)^(3/2)) dmu
/// = (1 - g^2) / (2g) (1 / (1 - g) - 1 / sqrt(1 + g^2)), and 1/2 + 3g/4 + O(g^3) near 0.
fn forward_share(g: f64) -> f64 {
    if g.abs() < 1e-4 {
        return 0.5 + 0.75 * g;
    }
    (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 - g) - 1.0 / (1.0 + g * g).sqrt())
}
