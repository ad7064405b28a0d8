//! The light-guided last vertex: from any medium vertex x_j, towards where light probably enters.
//!
//! Rough boundary: draw w_L from the light, refract it at a microfacet about the normal n* of the
//! specular guess, and trace against it to the boundary, with x_k the first hit. Two widths of microfacets are
//! mixed, the boundary's own and a wider one for bodies whose true normal at x_k may be far from n*. Per
//! area of x_k and solid angle of w_L the density is
//!   q(x_j) p_G(w_L) p(w_kj | w_L, n*) cos_k / d_jk^2,   over U:   q p_G p / (phase(x_j) T(d_jk)).
//! n* is a function of x_j and the light's axis, so nothing is left to integrate over.
//!
//! Smooth boundary and a light of finite size: w_L follows from the direction, so the direction is drawn
//! about the refracted axis, by a lobe as wide as the light and a wide one; density q P(guide)
//! p_lobe(w_jk) with the same Dirac factor as BSDF sampling. It also covers what subdivision cannot:
//! single scattering, and paths whose last vertex follows an internal reflection.

use schemars::JsonSchema;
use serde::Deserialize;

use super::end::{Call, End, Leg};
use super::guess::Guess;
use super::guide::Guide;
use super::state::{Connections, Slot};
use crate::estimators::Cost;
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::WalkExit;
use crate::estimators::walk::CameraWalk;
use crate::geometry::Ray;
use crate::math::{DVec3, Frame, tan};
use crate::optics::boundary::Boundary;
use crate::optics::microfacet::Microfacets;
use crate::sampling::discrete::choose;
use crate::sampling::distance::transmittance;
use crate::sampling::lobe::PowerLobe;

/// Options of the technique.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LastVertex {
    /// Probability of a call at the boundary; 0 switches it off.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub most: f64,
    /// How fast it falls per mean free path along the specular guess.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub decay: f64,
    /// Share of the wider lobe.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub wide_share: f64,
    /// Least roughness of the wider lobe (at least twice the boundary's own); its width at a smooth
    /// boundary.
    #[serde(default = "wide")]
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub wide: f64,
}

fn wide() -> f64 {
    0.2
}

/// The lobe of directions w_jk about one guess.
enum Lobe {
    /// Refraction of a light sample at the guessed normal: narrow, wide.
    Refraction { frame: Frame, narrow: Boundary, wide: Boundary },
    /// About the refracted axis.
    About { narrow: PowerLobe, wide: PowerLobe },
}

/// The least ratio of the wider lobe's roughness to the boundary's own.
const WIDER: f64 = 2.0;

/// The narrowest lobe about the refracted axis of a light, tan(theta / 2).
const NARROWEST: f64 = 1e-4;

impl LastVertex {
    /// How often it is called.
    pub(super) fn call(&self) -> Call {
        Call { most: self.most, decay: self.decay }
    }

    fn lobe(&self, boundary: &Boundary, guide: &Guide, guess: &Guess) -> Option<Lobe> {
        match *boundary {
            Boundary::Rough { eta, facets } => {
                let alpha = (WIDER * facets.alpha).max(self.wide).min(1.0);
                let wide = Boundary::Rough { eta, facets: Microfacets { alpha, ..facets } };
                Some(Lobe::Refraction { frame: Frame::about(guess.normal), narrow: *boundary, wide })
            }
            Boundary::Smooth { eta } if guide.half_angle > 0.0 => {
                // Refraction narrows a light by about eta.
                let width = tan(0.25 * (guide.half_angle / eta).min(3.0)).max(NARROWEST);
                let axis = guess.refracted(boundary, guide.axis);
                let wide = PowerLobe::new(axis, width.max(self.wide));
                Some(Lobe::About { narrow: PowerLobe::new(axis, width), wide })
            }
            _ => None,
        }
    }
}

impl Lobe {
    /// A direction from x_j, given a light sample.
    fn sample(&self, wide_share: f64, w_l: DVec3, [u, v]: [f64; 2]) -> Option<DVec3> {
        let (is_wide, u) = choose(u, wide_share);
        match self {
            Lobe::Refraction { frame, narrow, wide } => {
                let from = frame.to_local(w_l);
                if from.z <= 0.0 {
                    return None;
                }
                let boundary = if is_wide { wide } else { narrow };
                boundary.sample_refraction(from, [u, v]).map(|to| -frame.to_world(to))
            }
            Lobe::About { narrow, wide } => Some(if is_wide { wide } else { narrow }.sample([u, v])),
        }
    }

    /// Its density per solid angle of w_jk, given w_L.
    fn pdf(&self, wide_share: f64, w_l: DVec3, to_k: DVec3) -> f64 {
        let mix = |narrow: f64, wide: f64| (1.0 - wide_share) * narrow + wide_share * wide;
        match self {
            Lobe::Refraction { frame, narrow, wide } => {
                let (from, to) = (frame.to_local(w_l), frame.to_local(-to_k));
                if from.z <= 0.0 || to.z >= 0.0 {
                    return 0.0;
                }
                mix(narrow.pdf_refraction(from, to), wide.pdf_refraction(from, to))
            }
            Lobe::About { narrow, wide } => mix(narrow.pdf(to_k), wide.pdf(to_k)),
        }
    }
}

/// The technique's density of an end whose last vertex is x_j, over U, times the density of the walk up
/// to x_j.
pub(super) fn density<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    x_j: Slot,
    to_k: &Leg,
    end: &End<'_>,
) -> f64 {
    let setup = walk.rivals.setup;
    let Some(technique) = &setup.options.last_vertex else { return 0.0 };
    if end.by_guide == 0.0 {
        return 0.0;
    }
    let Some(guess) = walk.guess(x_j, end.guide) else { return 0.0 };
    let Some(lobe) = technique.lobe(&walk.boundary, end.guide, &guess) else { return 0.0 };
    let of_light = match lobe {
        Lobe::Refraction { .. } => end.by_guide,
        Lobe::About { .. } => end.guide.choice,
    };
    let q = technique.call().probability(setup.sigma, Some(&guess));
    let pdf = q * of_light * lobe.pdf(technique.wide_share, end.w_l, to_k.dir);
    if pdf == 0.0 {
        return 0.0;
    }
    let x_j = walk.rivals.vertex(x_j);
    let phase = walk.medium.phase.pdf(x_j.arrival.dot(to_k.dir));
    pdf * x_j.walks / (phase * transmittance(walk.medium.sigma_t, to_k.length))
}

/// An end that the technique has drawn.
pub(super) struct GuidedEnd<'a> {
    pub guide: &'a Guide,
    pub exit: WalkExit,
    /// From x_j to x_k.
    pub leg: Leg,
    /// Unit direction towards the light.
    pub w_l: DVec3,
    /// Of the light, where it is known from the draw.
    pub radiance: Option<f64>,
}

/// Draws the technique at the walk's latest vertex.
#[inline]
pub(super) fn draw<'a, B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'a>, B>,
    technique: &LastVertex,
) -> Option<GuidedEnd<'a>> {
    let setup = walk.rivals.setup;
    let u = walk.rivals.stream.draw();
    let reach = technique.call().reach(setup.sigma, u, || match &setup.guides[..] {
        [only] => walk.least_distance(only),
        _ => walk.scene.shape.clearance(walk.rivals.vertex(Slot::Latest).point),
    })?;
    draw_within(walk, technique, reach)
}

/// The same for a call that is made up to this distance of the guess, mm. Most calls at the vertices of a walk do not come here.
#[inline(never)]
fn draw_within<'a, B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'a>, B>,
    technique: &LastVertex,
    reach: f64,
) -> Option<GuidedEnd<'a>> {
    let x_j = walk.rivals.vertex(Slot::Latest);
    let guide = walk.rivals.choose_guide()?;
    if reach < f64::INFINITY && walk.least_distance(guide) >= reach {
        return None; // one guide of several: now it is known which
    }
    let guess = walk.guess(Slot::Latest, guide).filter(|guess| guess.distance < reach)?;
    let lobe = technique.lobe(&walk.boundary, guide, &guess)?;

    let light = &walk.scene.lights[guide.light];
    let (w_l, radiance) = match lobe {
        Lobe::Refraction { .. } => {
            let sample = guide.sample(light, walk.band, walk.rivals.stream.draw2());
            (sample.wi, Some(sample.radiance))
        }
        Lobe::About { .. } => (guide.axis, None),
    };
    let dir = lobe.sample(technique.wide_share, w_l, walk.rivals.stream.draw2())?;
    walk.scores.count(Cost::Rays);
    let ray = Ray { origin: x_j.point, dir };
    let hit = walk.scene.shape.leave(&ray)?;
    let exit = walk.exit_at(hit, dir)?;
    let w_l = match lobe {
        Lobe::Refraction { .. } => w_l,
        Lobe::About { .. } => exit.frame.to_world(walk.boundary.refract(exit.wo)?),
    };
    let leg = Leg { dir, length: hit.t };
    walk.leads_outside(&exit, w_l).then_some(GuidedEnd { guide, exit, leg, w_l, radiance })
}
