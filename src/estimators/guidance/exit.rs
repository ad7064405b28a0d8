//! Escapes near the boundary.
//!
//! Diffusion describes the boundary only on average: phi there is the light that a photon finds that may leave, be reflected,
//! or scatter again. A photon that meets the boundary inside the escape cone of refraction finds s, the light itself, which is
//! more; one outside the cone is reflected and finds less. For a walk this difference decides between an end and a detour, and
//! causes most of the variance that remains with a guide. So near the boundary some guided steps are escapes ([`Escape`]). With
//!   x = s / phi - 1   at the boundary,   P = (1 - cos_c) / 2   (the cone's share of all directions),
//! the importance of an escape exceeds the part of it that phi contains by P x e^{-tau / mu}, where tau is the depth in mean
//! free paths and mu is near 0.85. 0.6 of this gives the share y / (1 + y) of escapes, y = 0.6 P x, since the guide also
//! samples directions in the cone. Under forward scattering, where most escapes turn too far, y has the factor 1 - g. The 0.6
//! is an empirical choice: results are unbiased for any probability of escapes, and with larger ones weights grow from step to
//! step. e^{-tau / mu} is approximated by the square of a square, which has a finite range.
//!
//! A walk that meets the boundary from inside chooses between refraction and reflection with the same numbers: the lobe of
//! refraction counts as much more as refracted light finds ([`BoundaryMoments::gain_of_leaving`]).

use super::diffusion::{BoundaryMoments, Diffusion};
use crate::math::{DVec3, Vec3, renormalized};
use crate::optics::boundary::Boundary;
use crate::optics::guided::Escape;
use crate::scene::Scene;

/// Depth from which on there are no escapes, mean free paths.
pub(super) const REACH: f64 = 4.0;

/// The largest gain of leaving. In a half-space it is below 13 for indices up to 2; but a cell that barely touches the body may
/// have next to no phi, and a reflected path would take the gain as a weight.
const MOST_GAIN: f64 = 16.0;

/// The boundary near a point, as a plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExitPlane {
    /// Unit, outwards, in single precision: [`unit`].
    pub normal: Vec3,
    /// Of the plane, along the normal.
    pub offset: f32,
    /// Chance of an escape at the plane.
    pub chance: f32,
}

/// A unit vector out of single precision, to 1e-14.
#[inline]
pub(super) fn unit(vector: Vec3) -> DVec3 {
    renormalized(vector.as_dvec3())
}

/// The chance of an escape at a depth (mm), over that at the plane: e^{-tau / mu} with a finite range.
#[inline(always)]
pub(super) fn fading(depth: f64, sigma_t: f64) -> f64 {
    let tau = depth.max(0.0) * sigma_t;
    let part = (1.0 - tau * (1.0 / REACH)).max(0.0);
    (part * part) * (part * part)
}

/// What exits of one band have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExitRule {
    pub least_cosine: f64,
    pub sigma_t: f64,
    /// y / x.
    per_gain: f64,
    moments: BoundaryMoments,
}

impl ExitRule {
    pub(super) fn of(scene: &Scene, band: usize, diffusion: &Diffusion) -> ExitRule {
        let eta = match scene.boundary[band] {
            Boundary::Matched => 1.0,
            boundary => boundary.eta(),
        };
        let least_cosine = (1.0 - 1.0 / (eta * eta)).max(0.0).sqrt();
        let medium = &scene.medium[band];
        let per_gain = 0.3 * (1.0 - least_cosine) * (1.0 - medium.phase.g.abs());
        ExitRule { least_cosine, sigma_t: medium.sigma_t, per_gain, moments: diffusion.boundary }
    }

    /// At a plane through `at`, where phi is `phi` and light that leaves finds `found`; `None` where that is no gain.
    pub(super) fn exit(&self, at: DVec3, normal: DVec3, found: f64, phi: f64) -> Option<ExitPlane> {
        let y = self.per_gain * (found / phi - 1.0);
        (y > 0.0 && y.is_finite()).then(|| ExitPlane {
            normal: normal.as_vec3(),
            offset: normal.dot(at) as f32,
            chance: (y / (1.0 + y)) as f32,
        })
    }

    /// What light that leaves at an exit finds over what reflected light finds, at most [`MOST_GAIN`].
    #[inline]
    pub(super) fn gain(&self, exit: &ExitPlane) -> f64 {
        let chance = f64::from(exit.chance);
        let found = 1.0 + chance / (1.0 - chance) / self.per_gain;
        self.moments.gain_of_leaving(found).min(MOST_GAIN)
    }

    /// From a point inside.
    #[inline]
    pub(super) fn escape(&self, exit: &ExitPlane, x: DVec3) -> Escape {
        let chance = f64::from(exit.chance) * fading(exit.depth(x), self.sigma_t);
        Escape { normal: unit(exit.normal), least_cosine: self.least_cosine, chance }
    }
}

impl ExitPlane {
    /// Below the plane, mm.
    #[inline]
    pub(super) fn depth(&self, x: DVec3) -> f64 {
        f64::from(self.offset) - unit(self.normal).dot(x)
    }
}

#[cfg(test)]
impl ExitPlane {
    /// Unit normal and the chance at the plane.
    pub(super) fn parts(&self) -> (DVec3, f64) {
        (unit(self.normal), f64::from(self.chance))
    }
}
