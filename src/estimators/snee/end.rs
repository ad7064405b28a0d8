//! The end of a path as connections see it.

use schemars::JsonSchema;
use serde::Deserialize;

use super::guess::Guess;
use super::guide::Guide;
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::WalkExit;
use crate::estimators::walk::{CameraWalk, Rivals};
use crate::geometry::Hit;
use crate::math::{DVec3, exp, ln};
use crate::optics::boundary::Boundary;

/// With which probability a technique is called at a vertex: `most` e^(-decay sigma d), d being the
/// distance to the boundary along the specular guess. It depends on the vertex alone, so that every
/// density can name it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Call {
    /// Probability at the boundary.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub most: f64,
    /// How fast it falls per mean free path that light has to go.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub decay: f64,
}

impl Call {
    /// The probability, from the distance of the guess.
    pub(super) fn probability(&self, sigma: f64, guess: Option<&Guess>) -> f64 {
        match guess {
            _ if self.decay == 0.0 => self.most,
            Some(guess) => self.within(sigma, guess.distance),
            None => 0.0,
        }
    }

    /// The probability at this distance, mm.
    pub(super) fn within(&self, sigma: f64, distance: f64) -> f64 {
        if self.decay == 0.0 { self.most } else { self.most * exp(-self.decay * sigma * distance) }
    }

    /// The distance up to which the call is made, mm, for one uniform number; `None` if that is no more than `least`, a lower
    /// bound of the distance d, which may decide before d is known. P(reach > d) is [`Self::probability`]. The bound is asked
    /// for only where it matters.
    #[inline]
    pub(super) fn reach(&self, sigma: f64, u: f64, least: impl FnOnce() -> f64) -> Option<f64> {
        if u >= self.most {
            return None;
        }
        if self.decay == 0.0 {
            return Some(f64::INFINITY);
        }
        let least = least();
        if self.fails_by_far(sigma, u, least) {
            return None;
        }
        let reach = -ln(u / self.most) / (self.decay * sigma);
        (least < reach).then_some(reach)
    }

    /// Whether [`Self::reach`] is surely no more than `least`. Most calls fail by far, which needs no logarithm: e^x is above
    /// its series. The margin covers rounding, so that the logarithm decides what is close.
    #[inline(always)]
    pub(super) fn fails_by_far(&self, sigma: f64, u: f64, least: f64) -> bool {
        let x = self.decay * sigma * least;
        let below = 1.0 + x * (1.0 + x * (1.0 / 2.0 + x * (1.0 / 6.0 + x * (1.0 / 24.0))));
        x > 0.0 && u * below > self.most * (1.0 + 1e-9)
    }
}

/// A boundary point and a direction to a light, as all techniques see them.
#[derive(Clone, Copy, Debug)]
pub(super) struct End<'a> {
    pub guide: &'a Guide,
    /// Unit direction towards the light.
    pub w_l: DVec3,
    /// f |cos| times radiance (irradiance for parallel light).
    pub value: f64,
    /// Density by BSDF and light sampling.
    pub unidirectional: f64,
    /// Density of w_L given w_kj, refraction forced.
    pub forward: f64,
    /// Density of w_kj given w_L.
    pub reverse: f64,
    /// Density of w_L by the guide, its choice included; 0 where no guide takes part.
    pub by_guide: f64,
}

impl<'a> End<'a> {
    /// At an exit, towards `w_l`, which lies outside; for a smooth boundary `w_l` is the refracted
    /// direction. `keep` states which of BSDF and light sampling take part.
    pub(super) fn new<R: Rivals, B: WalkBands>(
        walk: &CameraWalk<'_, R, B>,
        guide: &'a Guide,
        exit: &WalkExit,
        w_l: DVec3,
        keep: [f64; 2],
        radiance: Option<f64>,
    ) -> End<'a> {
        let light = &walk.scene.lights[guide.light];
        let local = exit.frame.to_local(w_l);
        let parallel = light.is_directional();
        let (radiance, pdf_light) = match radiance {
            Some(radiance) if parallel => (radiance, 1.0),
            _ if parallel => (0.0, 1.0),
            _ => light.eval(walk.band, w_l),
        };
        let by_guide = guide.density(light, walk.band, w_l);
        let choice = walk.choice(guide.light);
        match walk.boundary {
            Boundary::Rough { .. } => {
                let (f_cos, pdf) = walk.boundary.eval(exit.wo, local);
                let reverse = walk.boundary.pdf_refraction(local, exit.wo);
                let (forward, bsdf) = if parallel {
                    (0.0, 0.0)
                } else {
                    (walk.boundary.pdf_refraction(exit.wo, local), pdf)
                };
                let unidirectional = keep[0] * bsdf + keep[1] * (choice * pdf_light);
                End { guide, w_l, value: f_cos * radiance, unidirectional, forward, reverse, by_guide }
            }
            Boundary::Smooth { eta } => {
                let through = walk.boundary.transmittance_smooth(exit.wo);
                let reverse = eta * eta * (exit.wo.z / local.z).abs();
                let (forward, bsdf) = if parallel { (0.0, 0.0) } else { (1.0, through) };
                let value = through * eta * eta * radiance;
                End { guide, w_l, value, unidirectional: keep[0] * bsdf, forward, reverse, by_guide }
            }
            Boundary::Matched => {
                let (value, unidirectional) = (0.0, 1.0);
                End { guide, w_l, value, unidirectional, forward: 0.0, reverse: 0.0, by_guide: 0.0 }
            }
        }
    }

    /// Whether a sample with this end scores anything, and a guided technique might have drawn it.
    pub(super) fn counts(&self) -> bool {
        !(self.value == 0.0 || self.by_guide == 0.0)
    }
}

/// From one vertex to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub dir: DVec3,
    pub length: f64,
}

/// x_i -> x_j -> x_k, seen from x_j.
#[derive(Clone, Copy, Debug)]
pub(super) struct Middle {
    pub to_j: Leg,
    pub to_k: Leg,
    /// Cosine at x_k between the walk and the geometric normal.
    pub cos_k: f64,
}

impl Middle {
    /// With x_k at `hit`; `None` where points fall together or x_k is met from behind.
    pub(super) fn new(x_i: DVec3, x_j: DVec3, hit: &Hit) -> Option<Middle> {
        let (ij, jk) = (x_j - x_i, hit.point - x_j);
        let (d_ij, d_jk) = (ij.length(), jk.length());
        let to_j = Leg { dir: ij / d_ij, length: d_ij };
        let to_k = Leg { dir: jk / d_jk, length: d_jk };
        let cos_k = to_k.dir.dot(hit.normal);
        (d_ij > 0.0 && d_jk > 0.0 && cos_k > 0.0).then_some(Middle { to_j, to_k, cos_k })
    }
}
