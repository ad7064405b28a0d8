//! Directions of a single bounce towards a point.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::Deserialize;

use super::chart::{AXIS, Charted, Directions, EvenAngle, Technique};
use super::kind::{SamplerKind, sampler_kind};
use super::sampler::Contrast;
use crate::math::{DVec3, Frame, cos, sin, sin_cos_turns};
use crate::optics::joint::{JointDirections, JointTable};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::Stream;

/// `bounce_table` in experiment files.
pub const TABLE: SamplerKind = sampler_kind!(
    "bounce_table",
    "directions of a single bounce towards a point by the table of the joint density",
    BounceOptions => |o| Ok(o.sampler(|phase| JointDirections::Table(JointTable::new(phase))))
);

/// `bounce_mixture` in experiment files.
pub const MIXTURE: SamplerKind = sampler_kind!(
    "bounce_mixture",
    "directions of a single bounce towards a point, phase function and geometry mixed",
    BounceOptions => |o| Ok(o.sampler(JointDirections::Mixture))
);

/// Options of `bounce_table` and `bounce_mixture`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BounceOptions {
    /// Mean cosine of the Henyey-Greenstein phase function.
    #[schemars(range(min = -0.9999, max = 0.9999))]
    g: f64,
    /// Angle between the direction of travel on arrival and the point, degrees; at both ends there is no
    /// plane of arrival to chart the azimuth from.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 180))]
    angle_deg: f64,
}

impl BounceOptions {
    /// Charted by the angle to the point and the azimuth from the plane of arrival; the table's texels
    /// are boxes of it.
    fn sampler(
        &self,
        code: impl Fn(HenyeyGreenstein) -> JointDirections,
    ) -> Charted<Bounce, Directions> {
        let code = code(HenyeyGreenstein { g: self.g });
        let about = Frame::about(AXIS);
        let (s, c) = sin_cos_turns(0.137);
        let frame = Frame { s: about.s * c + about.t * s, t: about.t * c - about.s * s, n: AXIS };
        let mut chart = Directions { frame, ..Directions::even() };
        if matches!(code, JointDirections::Table(_)) {
            let [rows, columns] = JointTable::TEXELS;
            let theta = (1..rows).map(|k| k as f64 / rows as f64).collect();
            let azimuth = (0..2 * columns).map(|k| k as f64 / (2 * columns) as f64).collect();
            chart.kinks = [theta, azimuth];
        }
        let arrival = EvenAngle::dir(PI * self.angle_deg / 180.0, sin_cos_turns(0.0));
        Charted::new(Bounce { code, w_in: frame.to_world(arrival) }, chart)
    }
}

/// The directions for one arrival and one point.
struct Bounce {
    code: JointDirections,
    w_in: DVec3,
}

impl Technique<Directions> for Bounce {
    fn sample(&self, stream: &mut Stream) -> (DVec3, Option<f64>) {
        let lobe = self.code.towards(self.w_in, AXIS);
        let dir = lobe.sample(stream.draw2());
        (dir, Some(lobe.pdf(dir)))
    }

    fn pdf(&self, dir: DVec3) -> f64 {
        self.code.towards(self.w_in, AXIS).pdf(dir)
    }

    /// All is even about the plane of arrival; how far it leans is the density's own.
    fn contrasts(&self, chart: &Directions) -> Vec<Contrast> {
        let (w_in, frame) = (self.w_in, chart.frame);
        vec![
            Contrast::of("cosine to the arrival", None, move |[x, turns]| {
                frame.to_world(EvenAngle::dir(PI * x, sin_cos_turns(turns))).dot(w_in)
            }),
            Contrast::of("cosine to the point", None, |[x, _]| cos(PI * x)),
            Contrast::of("across the plane", Some(0.0), |[x, turns]| {
                sin(PI * x) * sin_cos_turns(turns).0
            }),
        ]
    }
}
