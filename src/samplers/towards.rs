//! Direction and distance towards a point.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::Deserialize;

use super::chart::{AXIS, Charted, Directions, EvenAngle, Technique};
use super::distance::{AngleChart, end};
use super::kind::{SamplerKind, sampler_kind, some};
use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler};
use crate::math::{DVec3, Frame, cos, sin, sin_cos_turns};
use crate::sampling::stream::Stream;
use crate::sampling::towards::TowardsPoint;

/// `towards_point` in experiment files.
pub const DIRECTION: SamplerKind = sampler_kind!(
    "towards_point",
    "directions of joint direction-distance sampling towards a point",
    DirectionOptions => |o| {
        Ok(Charted::new(some(TowardsPoint::new(AXIS * o.distance_mm))?, Directions::even()))
    }
);

/// Options of `towards_point`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct DirectionOptions {
    /// Distance of the point, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    distance_mm: f64,
}

impl Technique<Directions> for TowardsPoint {
    fn sample(&self, stream: &mut Stream) -> (DVec3, Option<f64>) {
        let dir = self.sample(stream.draw2());
        (dir, Some(self.pdf(dir)))
    }

    fn pdf(&self, dir: DVec3) -> f64 {
        self.pdf(dir)
    }

    fn contrasts(&self, _chart: &Directions) -> Vec<Contrast> {
        vec![mean_cosine(), Contrast::azimuth()]
    }
}

/// int 2 (pi - theta) / pi^2 cos(theta) dtheta = 4 / pi^2.
fn mean_cosine() -> Contrast {
    Contrast::of("mean cosine", Some(4.0 / (PI * PI)), |[x, _]| cos(PI * x))
}

/// `direction_distance` in experiment files.
pub const DIRECTION_AND_DISTANCE: SamplerKind = sampler_kind!(
    "direction_distance",
    "joint direction-distance sampling towards a point",
    JointOptions => |o| {
        let code = some(TowardsPoint::new(AXIS * o.distance_mm))?;
        Ok(JointSampler { code, offset: AXIS * o.distance_mm, t_max: end(o.t_max_mm) })
    }
);

/// Options of `direction_distance`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct JointOptions {
    /// Distance of the point, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    distance_mm: f64,
    /// Length of the rays, mm; left out, they have no end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    t_max_mm: Option<f64>,
}

/// Direction and distance: theta / pi, and the angle at the point as in [`AngleChart`] with foot R
/// cos(theta) and height R sin(theta). All azimuths of a theta together, 2 pi^2 sin(theta) per unit of
/// the first coordinate; the azimuth alone is [`DIRECTION`]'s.
struct JointSampler {
    code: TowardsPoint,
    /// Position relative to the point.
    offset: DVec3,
    t_max: f64,
}

impl JointSampler {
    fn chart(&self, theta: f64) -> AngleChart {
        let distance = self.offset.length();
        AngleChart::new(distance * cos(theta), distance * sin(theta), self.t_max)
    }

    fn joint(&self, dir: DVec3, theta: f64, t: f64, slope: f64) -> f64 {
        let pdf_distance = self.code.distances(dir, self.t_max).map_or(0.0, |d| d.pdf_distance(t));
        self.code.pdf(dir) * pdf_distance * EvenAngle::solid_angle(theta) * slope
    }
}

impl Sampler for JointSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let dir = self.code.sample(stream.draw2());
        let Some(distances) = self.code.distances(dir, self.t_max) else { return Draw::Null };
        let t = distances.sample(stream.draw());
        let theta = EvenAngle::theta(AXIS, dir);
        let chart = self.chart(theta);
        let at = [theta / PI, chart.coordinate(t)];
        Draw::Point { piece: 0, at, density: self.joint(dir, theta, t, chart.slope(t)) }
    }

    fn pieces(&self) -> Vec<Piece> {
        let axes = [Coordinate::over(0.0, 1.0), Coordinate::over(0.0, 1.0)];
        vec![Piece::plane("theta and distance", axes)]
    }

    fn density(&self, _piece: usize, [x, y]: [f64; 2]) -> f64 {
        let theta = PI * x;
        let dir = Frame::about(AXIS).to_world(EvenAngle::dir(theta, sin_cos_turns(0.3)));
        self.chart(theta).at(y).map_or(0.0, |(t, slope)| self.joint(dir, theta, t, slope))
    }

    /// Near the axis the density of a distance is that of a narrow peak, D / (D^2 + s^2), where D = R sin(theta) is the point's
    /// distance from the ray and s that of the draw from the foot. Its logarithm changes by at most 1 / D per length in both, and
    /// the slope of the chart by twice that. s and D have errors of about five roundings of R.
    fn rounding(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        16.0 * f64::EPSILON / sin(PI * x)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        vec![mean_cosine()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;

    /// Relative difference of densities that counts, beside rounding.
    const OWN_DENSITY: f64 = 1e-9;

    /// Near the axis a draw's own density is the density function's to the stated rounding; and not to less.
    #[test]
    fn densities_near_the_axis_agree_to_their_rounding() {
        let sampler = JointSampler {
            code: TowardsPoint::new(AXIS * 1.3).expect("away"),
            offset: AXIS * 1.3,
            t_max: 2.0,
        };
        let mut beyond = 0;
        for i in 0..2000 {
            let i = f64::from(i);
            let numbers = [exp(-12.0 - 0.004 * i), (0.1 + 0.618 * i) % 1.0, (0.3 + 0.414 * i) % 1.0];
            let Draw::Point { piece, at, density } = sampler.draw(&mut Stream::scripted(&numbers))
            else {
                unreachable!("the point is seen")
            };
            let difference = (density / sampler.density(piece, at) - 1.0).abs();
            let limit = OWN_DENSITY + sampler.rounding(piece, at);
            assert!(difference <= limit, "{numbers:?}: {difference:e}, {limit:e}");
            beyond += u32::from(difference > OWN_DENSITY);
        }
        assert!(beyond > 10, "{beyond}");
        assert!(sampler.rounding(0, [0.1, 0.5]) < 0.1 * OWN_DENSITY);
    }
}
