//! Lobes of directions for connections through a boundary: with a power tail, and towards a plane.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::Deserialize;

use super::chart::{AXIS, Charted, Directions, Grade, Measure, Technique};
use super::kind::{SamplerKind, sampler_kind};
use super::sampler::Contrast;
use crate::math::{DVec3, Frame, atan2, cos, ln, sin};
use crate::sampling::lobe::PowerLobe;
use crate::sampling::plane::PlaneLobe;
use crate::sampling::stream::Stream;

/// `power_lobe` in experiment files.
pub const POWER: SamplerKind = sampler_kind!(
    "power_lobe",
    "directions of a lobe with a power tail about an axis",
    PowerGrade => |grade| {
        Ok(Charted::new(PowerLobe::new(AXIS, grade.width), Directions::graded(grade)))
    }
);

/// Options of `power_lobe`, and the grade that they give: tan(theta/2) = s T, T = tan(pi x / 2).
///
/// With S, C the sine and cosine of pi x / 2, v = tan^2(theta/2) = s^2 S^2 / C^2 and
/// d omega = 4 pi dv / (1 + v)^2 per turn,
///   d omega = 4 pi^2 s^2 S C / (C^2 + s^2 S^2)^2   per unit of the chart,
/// smooth to both ends.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerGrade {
    /// Tangent of half the angle that holds half of it; 1 is uniform.
    #[schemars(extend("exclusiveMinimum" = 0))]
    width: f64,
}

impl PowerGrade {
    fn solid_angle(&self, x: f64) -> Measure {
        let (s, c) = (sin(0.5 * PI * x), cos(0.5 * PI * x));
        let w2 = self.width * self.width;
        let sum = c * c + w2 * s * s;
        Measure::of(4.0 * PI * PI * w2 * s * c / (sum * sum))
    }

    /// sin and cos of theta at a coordinate.
    fn theta(&self, x: f64) -> (f64, f64) {
        let (s, c) = (self.width * sin(0.5 * PI * x), cos(0.5 * PI * x));
        let sum = c * c + s * s;
        (2.0 * s * c / sum, (c * c - s * s) / sum)
    }
}

impl Grade for PowerGrade {
    fn coordinate(&self, frame: &Frame, dir: DVec3) -> (f64, Measure) {
        // Lengths keep the digits of theta at both poles.
        let (apart, along) = ((dir - frame.n).length(), (dir + frame.n).length());
        let x = 2.0 / PI * atan2(apart, self.width * along);
        (x, self.solid_angle(x))
    }

    fn local(&self, x: f64, (s, c): (f64, f64)) -> (DVec3, Measure) {
        let (sin_theta, cos_theta) = self.theta(x);
        (DVec3::new(sin_theta * c, sin_theta * s, cos_theta), self.solid_angle(x))
    }
}

impl Technique<Directions<PowerGrade>> for PowerLobe {
    fn sample(&self, stream: &mut Stream) -> (DVec3, Option<f64>) {
        let dir = self.sample(stream.draw2());
        (dir, Some(self.pdf(dir)))
    }

    fn pdf(&self, dir: DVec3) -> f64 {
        self.pdf(dir)
    }

    /// With a = s^2 the mean of cos(theta) = 2 / (1 + v) - 1 is 2 I - 1,
    ///   I = int_0^inf a / ((a + v)^2 (1 + v)) dv = (1 - a + a ln a) / (1 - a)^2   (1/2 for a = 1);
    /// and half of all lies within v = a. The cosine of a narrow lobe is 1 except for few draws far out,
    /// whose mean tells little about the rest: there it is not tested.
    fn contrasts(&self, chart: &Directions<PowerGrade>) -> Vec<Contrast> {
        let grade = chart.grade;
        let a = grade.width * grade.width;
        let mean = if a == 1.0 { 0.5 } else { (1.0 - a + a * ln(a)) / ((1.0 - a) * (1.0 - a)) };
        let cosine = Contrast::of("mean cosine", Some(2.0 * mean - 1.0), move |[x, _]| grade.theta(x).1);
        let cosine = (grade.width >= 0.1).then_some(cosine);
        cosine.into_iter().chain([share_of_the_rest(), Contrast::azimuth()]).collect()
    }
}

/// The mean of C^2, which is uniform in both charts.
fn share_of_the_rest() -> Contrast {
    let share = |[x, _]: [f64; 2]| cos(0.5 * PI * x) * cos(0.5 * PI * x);
    Contrast::of("share of the rest", Some(0.5), share)
}

/// `plane_lobe` in experiment files.
pub const PLANE: SamplerKind = sampler_kind!(
    "plane_lobe",
    "directions from a vertex to the points of a plane above it",
    PlaneOptions => |PlaneOptions { height_mm: height, mfp_mm: mfp }| {
        let grade = PlaneGrade { height, scale: (height * height + mfp * mfp).sqrt() };
        Ok(Charted::new(PlaneLobe::new(AXIS, height, mfp), Directions::graded(grade)))
    }
);

/// Options of `plane_lobe`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PlaneOptions {
    /// Distance of the vertex from the plane, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    height_mm: f64,
    /// Mean free path, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    mfp_mm: f64,
}

/// The distance from the foot on the plane, r = s T, T = tan(pi x / 2), s^2 = h^2 + l^2.
///
/// With S, C as above the area is 2 pi r dr and the solid angle h / d^3 of it, d^2 = r^2 + h^2:
///   d omega = pi^2 s^2 h S / (s^2 S^2 + h^2 C^2)^(3/2)   per unit of the chart.
#[derive(Clone, Copy, Debug)]
pub struct PlaneGrade {
    height: f64,
    scale: f64,
}

impl PlaneGrade {
    /// r and h, both times C.
    fn legs(&self, x: f64) -> (f64, f64) {
        (self.scale * sin(0.5 * PI * x), self.height * cos(0.5 * PI * x))
    }

    fn solid_angle(&self, x: f64) -> Measure {
        let (r, h) = self.legs(x);
        let d2 = r * r + h * h;
        Measure::of(PI * PI * self.scale * self.height * r / (d2 * d2.sqrt()))
    }
}

impl Grade for PlaneGrade {
    fn coordinate(&self, frame: &Frame, dir: DVec3) -> (f64, Measure) {
        let local = frame.to_local(dir);
        let along = (local.x * local.x + local.y * local.y).sqrt();
        let x = 2.0 / PI * atan2(self.height * along, self.scale * local.z);
        (x, self.solid_angle(x))
    }

    fn local(&self, x: f64, (s, c): (f64, f64)) -> (DVec3, Measure) {
        let (r, h) = self.legs(x);
        (DVec3::new(r * c, r * s, h).normalize(), self.solid_angle(x))
    }
}

impl Technique<Directions<PlaneGrade>> for PlaneLobe {
    fn sample(&self, stream: &mut Stream) -> (DVec3, Option<f64>) {
        let dir = self.sample(stream.draw2());
        (dir, Some(self.pdf(dir)))
    }

    fn pdf(&self, dir: DVec3) -> f64 {
        self.pdf(dir)
    }

    /// s^2 / (r^2 + s^2) = C^2 is uniform.
    fn contrasts(&self, _chart: &Directions<PlaneGrade>) -> Vec<Contrast> {
        vec![share_of_the_rest(), Contrast::azimuth()]
    }
}
