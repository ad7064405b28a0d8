//! Lobes of directions for connections through a boundary: with a power tail, and towards a plane.

use std::f64::consts::PI;

use super::{Axis, Contrast, Draw, Piece, Sampler, turns};
use crate::math::{DVec3, Frame, atan2, cos, ln, sin, sin_cos_turns};
use crate::sampling::lobe::PowerLobe;
use crate::sampling::plane::PlaneLobe;
use crate::sampling::stream::Stream;

/// An axis that is aligned with nothing.
const AXIS: DVec3 = DVec3::new(0.48, -0.6, 0.64);

/// A power lobe about an axis.
///
/// Chart: tan(theta/2) = s T, T = tan(pi x / 2), and the azimuth in turns. With S, C the sine and cosine of
/// pi x / 2, v = tan^2(theta/2) = s^2 S^2 / C^2 and d omega = 4 pi dv / (1 + v)^2 per turn,
///   d omega = 4 pi^2 s^2 S C / (C^2 + s^2 S^2)^2   per unit of the chart,
/// smooth to both ends.
pub struct PowerSampler {
    code: PowerLobe,
    width: f64,
}

impl PowerSampler {
    /// Of this width.
    pub fn new(width: f64) -> PowerSampler {
        PowerSampler { code: PowerLobe::new(AXIS, width), width }
    }

    fn solid_angle(&self, x: f64) -> f64 {
        let (s, c) = (sin(0.5 * PI * x), cos(0.5 * PI * x));
        let w2 = self.width * self.width;
        let sum = c * c + w2 * s * s;
        4.0 * PI * PI * w2 * s * c / (sum * sum)
    }

    /// sin and cos of theta at a coordinate.
    fn theta(&self, x: f64) -> (f64, f64) {
        let (s, c) = (self.width * sin(0.5 * PI * x), cos(0.5 * PI * x));
        let sum = c * c + s * s;
        (2.0 * s * c / sum, (c * c - s * s) / sum)
    }
}

impl Sampler for PowerSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let dir = self.code.sample(stream.draw2());
        // Lengths keep the digits of theta at both poles.
        let (apart, along) = ((dir - AXIS).length(), (dir + AXIS).length());
        let x = 2.0 / PI * atan2(apart, self.width * along);
        let local = Frame::about(AXIS).to_local(dir);
        let density = self.code.pdf(dir) * self.solid_angle(x);
        Draw::Point { piece: 0, at: [x, turns(local.x, local.y)], density }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Axis::over(0.0, 1.0), Axis::turns()])]
    }

    fn density(&self, _piece: usize, [x, turns]: [f64; 2]) -> f64 {
        let ((sin_theta, cos_theta), (s, c)) = (self.theta(x), sin_cos_turns(turns));
        let dir = Frame::about(AXIS).to_world(DVec3::new(sin_theta * c, sin_theta * s, cos_theta));
        self.code.pdf(dir) * self.solid_angle(x)
    }

    /// With a = s^2 the mean of cos(theta) = 2 / (1 + v) - 1 is 2 I - 1,
    ///   I = int_0^inf a / ((a + v)^2 (1 + v)) dv = (1 - a + a ln a) / (1 - a)^2   (1/2 for a = 1);
    /// and half of all lies within v = a. The cosine of a narrow lobe is 1 but for few draws far out, whose
    /// mean says little of the rest: there it is not asked.
    fn contrasts(&self) -> Vec<Contrast> {
        let a = self.width * self.width;
        let mean = if a == 1.0 { 0.5 } else { (1.0 - a + a * ln(a)) / ((1.0 - a) * (1.0 - a)) };
        let lobe = PowerSampler::new(self.width);
        let share = |[x, _]: [f64; 2]| cos(0.5 * PI * x) * cos(0.5 * PI * x);
        let cosine = Contrast::of("mean cosine", Some(2.0 * mean - 1.0), move |[x, _]| lobe.theta(x).1);
        let share = Contrast::of("share of the rest", Some(0.5), share);
        let cosine = (self.width >= 0.1).then_some(cosine);
        cosine.into_iter().chain([share, Contrast::azimuth()]).collect()
    }
}

/// Directions to the points of a plane.
///
/// Chart: distance from the foot r = s T, T = tan(pi x / 2), s^2 = h^2 + l^2, and the azimuth in turns. With
/// S, C as above the area is 2 pi r dr and the solid angle h / d^3 of it, d^2 = r^2 + h^2:
///   d omega = pi^2 s^2 h S / (s^2 S^2 + h^2 C^2)^(3/2)   per unit of the chart.
pub struct PlaneSampler {
    code: PlaneLobe,
    height: f64,
    scale: f64,
}

impl PlaneSampler {
    /// At this height below the plane, with this mean free path, mm.
    pub fn new(height: f64, mfp: f64) -> PlaneSampler {
        let scale = (height * height + mfp * mfp).sqrt();
        PlaneSampler { code: PlaneLobe::new(AXIS, height, mfp), height, scale }
    }

    /// r and h, both times C.
    fn legs(&self, x: f64) -> (f64, f64) {
        (self.scale * sin(0.5 * PI * x), self.height * cos(0.5 * PI * x))
    }

    fn solid_angle(&self, x: f64) -> f64 {
        let (r, h) = self.legs(x);
        let d2 = r * r + h * h;
        PI * PI * self.scale * self.height * r / (d2 * d2.sqrt())
    }
}

impl Sampler for PlaneSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let dir = self.code.sample(stream.draw2());
        let local = Frame::about(AXIS).to_local(dir);
        let along = (local.x * local.x + local.y * local.y).sqrt();
        let x = 2.0 / PI * atan2(self.height * along, self.scale * local.z);
        let density = self.code.pdf(dir) * self.solid_angle(x);
        Draw::Point { piece: 0, at: [x, turns(local.x, local.y)], density }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Axis::over(0.0, 1.0), Axis::turns()])]
    }

    fn density(&self, _piece: usize, [x, turns]: [f64; 2]) -> f64 {
        let ((r, h), (s, c)) = (self.legs(x), sin_cos_turns(turns));
        let dir = Frame::about(AXIS).to_world(DVec3::new(r * c, r * s, h).normalize());
        self.code.pdf(dir) * self.solid_angle(x)
    }

    /// s^2 / (r^2 + s^2) = C^2 is uniform.
    fn contrasts(&self) -> Vec<Contrast> {
        let share = |[x, _]: [f64; 2]| cos(0.5 * PI * x) * cos(0.5 * PI * x);
        vec![Contrast::of("share of the rest", Some(0.5), share), Contrast::azimuth()]
    }
}
