//! Directions of a single bounce towards a point.

use std::f64::consts::PI;

use super::towards::Axial;
use super::{Axis, Contrast, Draw, Piece, Sampler, turns};
use crate::math::{DVec3, Frame, cos, sin, sin_cos_turns};
use crate::optics::joint::{JointDirections, JointTable};
use crate::sampling::stream::Stream;

/// The directions for one arrival and one point.
///
/// Chart: theta / pi, the angle to the point, and the azimuth from the plane of arrival in turns, d omega =
/// 2 pi^2 sin(theta) per unit of both. The table's texels are boxes of it.
pub struct BounceSampler {
    code: JointDirections,
    w_in: DVec3,
    axial: Axial,
}

impl BounceSampler {
    /// For an arrival at this angle to the point, degrees.
    pub fn new(code: JointDirections, angle_deg: f64) -> BounceSampler {
        let axis = DVec3::new(0.48, -0.6, 0.64);
        let about = Frame::about(axis);
        let (s, c) = sin_cos_turns(0.137);
        let frame = Frame { s: about.s * c + about.t * s, t: about.t * c - about.s * s, n: axis };
        let angle = PI * angle_deg / 180.0;
        let axial = Axial { frame };
        BounceSampler { code, w_in: axial.dir(angle, 0.0), axial }
    }
}

impl Sampler for BounceSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let lobe = self.code.towards(self.w_in, self.axial.frame.n);
        let dir = lobe.sample(stream.draw2());
        let theta = self.axial.theta(dir);
        let local = self.axial.frame.to_local(dir);
        let density = lobe.pdf(dir) * Axial::solid_angle(theta);
        Draw::Point { piece: 0, at: [theta / PI, turns(local.x, local.y)], density }
    }

    fn pieces(&self) -> Vec<Piece> {
        let (mut theta, mut azimuth) = (Axis::over(0.0, 1.0), Axis::turns());
        if matches!(self.code, JointDirections::Table(_)) {
            let [rows, columns] = JointTable::TEXELS;
            theta.kinks.extend((1..rows).map(|k| k as f64 / rows as f64));
            azimuth.kinks.extend((0..2 * columns).map(|k| k as f64 / (2 * columns) as f64));
        }
        vec![Piece::plane("directions", [theta, azimuth])]
    }

    fn density(&self, _piece: usize, [x, turns]: [f64; 2]) -> f64 {
        let dir = self.axial.dir(PI * x, turns);
        self.code.towards(self.w_in, self.axial.frame.n).pdf(dir) * Axial::solid_angle(PI * x)
    }

    /// All is even about the plane of arrival; how far it leans is the density's own.
    fn contrasts(&self) -> Vec<Contrast> {
        let (w_in, axial) = (self.w_in, self.axial);
        vec![
            Contrast::of("cosine to the arrival", None, move |[x, turns]| {
                axial.dir(PI * x, turns).dot(w_in)
            }),
            Contrast::of("cosine to the point", None, |[x, _]| cos(PI * x)),
            Contrast::of("across the plane", Some(0.0), |[x, turns]| {
                sin(PI * x) * sin_cos_turns(turns).0
            }),
        ]
    }
}
