//! Directions in proportion to their cosine to an axis.

use std::f64::consts::PI;

use super::chart::{AXIS, Charted, Directions, Technique};
use super::kind::{SamplerKind, sampler_kind};
use super::sampler::Contrast;
use crate::math::{DVec3, Frame, cos};
use crate::sampling::stream::Stream;
use crate::sampling::warp::square_to_cosine_hemisphere;

/// `cosine` in experiment files. The density has a kink at the horizon, x = 1/2.
pub const KIND: SamplerKind = sampler_kind!(
    "cosine",
    "directions in proportion to their cosine to an axis",
    Cosine => |o| Ok(Charted::new(o, Directions { kinks: [vec![0.5], vec![]], ..Directions::even() }))
);

/// It has no options.
#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Cosine {}

impl Technique<Directions> for Cosine {
    fn sample(&self, stream: &mut Stream) -> (DVec3, Option<f64>) {
        let dir = Frame::about(AXIS).to_world(square_to_cosine_hemisphere(stream.draw2()));
        (dir, Some(self.pdf(dir)))
    }

    fn pdf(&self, dir: DVec3) -> f64 {
        dir.dot(AXIS).max(0.0) / PI
    }

    fn contrasts(&self, _chart: &Directions) -> Vec<Contrast> {
        vec![Contrast::of("mean cosine", Some(2.0 / 3.0), |[x, _]| cos(PI * x)), Contrast::azimuth()]
    }
}
