//! Light that reaches a point x inside through one point p of a smooth boundary: the constraint, its
//! derivative, and the focusing.
//!
//! w is the unit direction from x to p, w_L from p to the light, N the shading normal at p, d = |p - x|.
//! Snell's law in one vector equation: eta w - w_L is along N,
//!   r = (1 - N N^T)(eta w - w_L) = 0,   w . N > 0,   w_L . N > 0.
//! It is the projected half vector of Jakob & Marschner 2012 ("Manifold exploration") without its
//! normalisation, so that it is regular at eta = 1, too.
//!
//! Focusing. A camera ray from x along w leaves towards w_L(w) = eta w + mu N, mu = cl - eta ct, cl =
//! w_L . N, ct = w . N. Parallel light of irradiance E from w_L is radiance E delta(w_L(w) - w_L) eta^2
//! T in the direction w, hence the irradiance
//!   E T eta^2 / J,   J = |d w_L / d w|,
//! across the ray at x. (Walter, Zhao, Holzschuch & Bala 2009, "Single scattering in refractive media
//! with triangle mesh boundaries", have the same for a point light.) The derivative: for u across w
//!   dp = d (u - (u . Ng) / (w . Ng) w),    dN = change of N along dp,
//!   dmu = -eta (mu / cl) (N . u + w . dN),  from  dcl = eta^2 ct dct / cl,
//!   dw_L = eta u + dmu N + mu dN.
//! This is the camera's side, which defines what an estimator of this crate measures. The light's side,
//! by which rays spread behind the boundary, gives M = eta^2 / J times (clg ct) / (ctg cl), clg and ctg
//! being cosines to the geometric normal Ng: 1 for true normals, else the factor by which shading
//! normals break symmetry (Veach 1997, 5.3).

use super::patch::SurfacePatch;
use crate::geometry::FaceId;
use crate::math::{DVec2, DVec3, Frame};
use crate::optics::fresnel::fresnel;

/// What is asked for: the light from one direction that reaches a point.
#[derive(Clone, Copy, Debug)]
pub(in crate::estimators) struct Query {
    /// Point inside, mm.
    pub x: DVec3,
    /// Unit direction towards the light.
    pub w_l: DVec3,
    /// Index inside over outside.
    pub eta: f64,
}

/// A point of the boundary that refracts the light of a query to its point.
#[derive(Clone, Copy, Debug)]
pub(in crate::estimators) struct Root {
    pub point: DVec3,
    pub face: FaceId,
    /// Geometric outward unit normal there.
    pub normal: DVec3,
    /// Shading normal there, unit.
    pub shading: DVec3,
    /// Unit direction from x.
    pub dir: DVec3,
    /// Distance from x, mm.
    pub distance: f64,
    /// J = |d w_L / d w|.
    pub ratio: f64,
    /// Fresnel transmittance.
    pub transmittance: f64,
}

/// What a point of the boundary is to a query.
#[derive(Clone, Copy, Debug)]
pub(super) enum Judgement {
    Root(Root),
    /// Snell's law holds for the shading normal, but the geometric one has the light, or x, on its other
    /// side.
    WrongSide,
    /// Snell's law does not hold.
    None,
}

/// The constraint at a point: residual and w.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constraint {
    frame: Frame,
    dir: DVec3,
    distance: f64,
    /// Tangential components of eta w - w_L.
    pub residual: DVec2,
    /// Its component along N.
    along: f64,
}

impl Query {
    pub(super) fn constraint(&self, patch: &SurfacePatch) -> Constraint {
        let leg = patch.point - self.x;
        let distance = leg.length();
        let dir = leg / distance;
        let local = Frame::about(patch.shading).to_local(dir * self.eta - self.w_l);
        let frame = Frame::about(patch.shading);
        Constraint { frame, dir, distance, residual: DVec2::new(local.x, local.y), along: local.z }
    }

    /// The Newton step in the tangent plane; `None` where the derivative is singular.
    ///
    /// Along dp the vector eta w - w_L changes by eta (1 - w w^T) dp / d, and the tangents s, t of N by
    /// -(s . dN) N.
    pub(super) fn step(&self, patch: &SurfacePatch, at: &Constraint) -> Option<DVec3> {
        let Frame { s, t, .. } = Frame::about(patch.normal);
        let [a, b] = [s, t].map(|dp| {
            let across = dp - at.dir * at.dir.dot(dp);
            let change = across * (self.eta / at.distance) - patch.turn(dp) * at.along;
            DVec2::new(at.frame.s.dot(change), at.frame.t.dot(change))
        });
        let det = a.perp_dot(b);
        let [p, q] = [at.residual.perp_dot(b) / det, a.perp_dot(at.residual) / det];
        let step = s * -p - t * q;
        step.is_finite().then_some(step)
    }

    /// Whether a point is a root, `tolerance` being the residual that counts as 0.
    pub(super) fn judge(&self, patch: &SurfacePatch, tolerance: f64) -> Judgement {
        let at = self.constraint(patch);
        let (ct, cl) = (at.dir.dot(patch.shading), self.w_l.dot(patch.shading));
        let is_refracted = at.residual.length() <= tolerance && ct > 0.0 && cl > 0.0;
        if !is_refracted {
            return Judgement::None;
        }
        if at.dir.dot(patch.normal) <= 0.0 || self.w_l.dot(patch.normal) <= 0.0 {
            return Judgement::WrongSide;
        }
        Judgement::Root(Root {
            point: patch.point,
            face: patch.face,
            normal: patch.normal,
            shading: patch.shading,
            dir: at.dir,
            distance: at.distance,
            ratio: solid_angle_ratio(patch, at.dir, at.distance, self.w_l, self.eta),
            transmittance: 1.0 - fresnel(cl, self.eta).reflectance,
        })
    }
}

/// J = |d w_L / d w| at the point from which a ray runs to `patch` along `dir`; see the head of the
/// file.
pub(in crate::estimators) fn solid_angle_ratio(
    patch: &SurfacePatch,
    dir: DVec3,
    distance: f64,
    w_l: DVec3,
    eta: f64,
) -> f64 {
    let (n, across) = (patch.shading, Frame::about(dir));
    let (cl, ct) = (w_l.dot(n), dir.dot(n));
    let mu = cl - eta * ct;
    let [a, b] = [across.s, across.t].map(|u| {
        let dp = (u - dir * (u.dot(patch.normal) / dir.dot(patch.normal))) * distance;
        let dn = patch.turn(dp);
        let dmu = -eta * (mu / cl) * (n.dot(u) + dir.dot(dn));
        u * eta + n * dmu + dn * mu
    });
    a.cross(b).length()
}

#[cfg(test)]
#[path = "throughput_tests.rs"]
mod tests;
