//! Direction and distance towards a point.

use std::f64::consts::{PI, TAU};

use super::distance::AngleChart;
use super::{Axis, Contrast, Draw, Piece, Sampler, turns};
use crate::math::{DVec3, Frame, atan2, cos, sin, sin_cos_turns};
use crate::sampling::stream::Stream;
use crate::sampling::towards::TowardsPoint;

/// What charts about the axis to a point share: theta = pi x from the axis.
#[derive(Clone, Copy)]
pub(super) struct Axial {
    /// The axis is its normal.
    pub frame: Frame,
}

impl Axial {
    /// Per unit of theta / pi and of the azimuth in turns.
    pub fn solid_angle(theta: f64) -> f64 {
        TAU * PI * sin(theta)
    }

    pub fn theta(&self, dir: DVec3) -> f64 {
        let axis = self.frame.n;
        2.0 * atan2((dir - axis).length(), (dir + axis).length())
    }

    pub fn dir(&self, theta: f64, turns: f64) -> DVec3 {
        let (s, c) = sin_cos_turns(turns);
        self.frame.to_world(DVec3::new(sin(theta) * c, sin(theta) * s, cos(theta)))
    }
}

/// Towards a point along an axis that is aligned with nothing.
struct Aimed {
    code: TowardsPoint,
    offset: DVec3,
    axial: Axial,
}

impl Aimed {
    fn new(distance: f64) -> Option<Aimed> {
        let axis = DVec3::new(0.48, -0.6, 0.64);
        let code = TowardsPoint::new(axis * distance)?;
        Some(Aimed { code, offset: axis * distance, axial: Axial { frame: Frame::about(axis) } })
    }
}

/// The direction alone: theta / pi and the azimuth, d omega = 2 pi^2 sin(theta) per unit of both.
pub struct TowardsSampler(Aimed);

impl TowardsSampler {
    /// Towards a point at this distance, mm.
    pub fn new(distance: f64) -> Option<TowardsSampler> {
        Aimed::new(distance).map(TowardsSampler)
    }
}

impl Sampler for TowardsSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let TowardsSampler(Aimed { code, axial, .. }) = self;
        let dir = code.sample(stream.draw2());
        let theta = axial.theta(dir);
        let local = axial.frame.to_local(dir);
        let at = [theta / PI, turns(local.x, local.y)];
        Draw::Point { piece: 0, at, density: code.pdf(dir) * Axial::solid_angle(theta) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Axis::over(0.0, 1.0), Axis::turns()])]
    }

    fn density(&self, _piece: usize, [x, turns]: [f64; 2]) -> f64 {
        let TowardsSampler(Aimed { code, axial, .. }) = self;
        code.pdf(axial.dir(PI * x, turns)) * Axial::solid_angle(PI * x)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        vec![mean_cosine(), Contrast::azimuth()]
    }
}

/// int 2 (pi - theta) / pi^2 cos(theta) dtheta = 4 / pi^2.
fn mean_cosine() -> Contrast {
    Contrast::of("mean cosine", Some(4.0 / (PI * PI)), |[x, _]| cos(PI * x))
}

/// Direction and distance: theta / pi, and the angle at the point as in [`super::distance`] with foot
/// R cos(theta) and height R sin(theta). All azimuths of a theta together, 2 pi^2 sin(theta) per unit of the
/// first coordinate; the azimuth alone is [`TowardsSampler`]'s.
pub struct JointSampler {
    aimed: Aimed,
    t_max: f64,
}

impl JointSampler {
    /// Towards a point at this distance, along rays of this length (mm; may be infinite).
    pub fn new(distance: f64, t_max: f64) -> Option<JointSampler> {
        Aimed::new(distance).map(|aimed| JointSampler { aimed, t_max })
    }

    fn chart(&self, theta: f64) -> AngleChart {
        let distance = self.aimed.offset.length();
        AngleChart::new(distance * cos(theta), distance * sin(theta), self.t_max)
    }

    fn joint(&self, dir: DVec3, theta: f64, t: f64, slope: f64) -> f64 {
        let pdf_distance = self.aimed.code.distances(dir, self.t_max).map_or(0.0, |d| d.pdf_distance(t));
        self.aimed.code.pdf(dir) * pdf_distance * Axial::solid_angle(theta) * slope
    }
}

impl Sampler for JointSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let dir = self.aimed.code.sample(stream.draw2());
        let Some(distances) = self.aimed.code.distances(dir, self.t_max) else { return Draw::Null };
        let t = distances.sample(stream.draw());
        let theta = self.aimed.axial.theta(dir);
        let chart = self.chart(theta);
        let at = [theta / PI, chart.coordinate(t)];
        Draw::Point { piece: 0, at, density: self.joint(dir, theta, t, chart.slope(t)) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("theta and distance", [Axis::over(0.0, 1.0), Axis::over(0.0, 1.0)])]
    }

    fn density(&self, _piece: usize, [x, y]: [f64; 2]) -> f64 {
        let theta = PI * x;
        let dir = self.aimed.axial.dir(theta, 0.3);
        self.chart(theta).at(y).map_or(0.0, |(t, slope)| self.joint(dir, theta, t, slope))
    }

    fn contrasts(&self) -> Vec<Contrast> {
        vec![mean_cosine()]
    }
}
