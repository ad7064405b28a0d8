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
    /// Slopes of the microfacet normal that refracts; 0 at a smooth boundary.
    pub slopes: DVec2,
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
    /// J = |d w_L / d w|; at a rough boundary |d slopes / d w|.
    pub ratio: f64,
    /// Fresnel transmittance at the facet.
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
    /// At a smooth boundary.
    pub(in crate::estimators) fn new(x: DVec3, w_l: DVec3, eta: f64) -> Query {
        Query { x, w_l, eta, slopes: DVec2::ZERO }
    }

    fn is_smooth(&self) -> bool {
        self.slopes == DVec2::ZERO
    }

    /// The axis about which tangents of a rough boundary are laid.
    fn axis(&self) -> DVec3 {
        Frame::about(self.w_l).s
    }

    /// Tangents and shading normal; at a rough boundary they depend smoothly on the normal.
    fn frame(&self, n: DVec3) -> Frame {
        if self.is_smooth() { Frame::about(n) } else { frame_of_slopes(self.axis(), n) }
    }

    /// The unit facet normal that refracts at a point with this shading normal.
    pub(super) fn facet_normal(&self, n: DVec3) -> DVec3 {
        if self.is_smooth() {
            return n;
        }
        let Frame { s, t, .. } = self.frame(n);
        (n + s * self.slopes.x + t * self.slopes.y).normalize()
    }

    /// The query whose slopes refract its light at a boundary point, whose shading normal is `n`, to x.
    pub(super) fn through(x: DVec3, w_l: DVec3, eta: f64, point: DVec3, n: DVec3) -> Query {
        let query = Query::new(x, w_l, eta);
        let v = frame_of_slopes(query.axis(), n).to_local((point - x).normalize() * eta - w_l);
        Query { slopes: DVec2::new(v.x / v.z, v.y / v.z), ..query }
    }

    pub(super) fn constraint(&self, patch: &SurfacePatch) -> Constraint {
        let leg = patch.point - self.x;
        let distance = leg.length();
        let dir = leg / distance;
        let frame = self.frame(patch.shading);
        let local = frame.to_local(dir * self.eta - self.w_l);
        let residual = DVec2::new(local.x, local.y) - self.slopes * local.z;
        Constraint { frame, dir, distance, residual, along: local.z }
    }

    /// Change of the residual along a step in the tangent plane: eta w - w_L changes by eta (1 - w w^T)
    /// dp / d, the tangents s, t by -(s . dN) N, and by turning about N, which matters where the residual
    /// is not all of eta w - w_L across N.
    fn derivative(&self, patch: &SurfacePatch, at: &Constraint, dp: DVec3) -> DVec2 {
        let across = dp - at.dir * at.dir.dot(dp);
        let (dv, dn) = (across * (self.eta / at.distance), patch.turn(dp));
        let Frame { s, t, n } = at.frame;
        let change = dv - dn * at.along;
        let smooth = DVec2::new(s.dot(change), t.dot(change));
        if self.is_smooth() {
            return smooth;
        }
        let across = at.residual + self.slopes * at.along;
        let height = n.dot(self.axis());
        let turn = -height * t.dot(dn) / (1.0 - height * height).sqrt();
        let along = n.dot(dv) + s.dot(dn) * across.x + t.dot(dn) * across.y;
        smooth + DVec2::new(across.y, -across.x) * turn - self.slopes * along
    }

    /// Columns of the derivative, along the tangents of the surface.
    fn columns(&self, patch: &SurfacePatch, at: &Constraint) -> ([DVec3; 2], [DVec2; 2]) {
        let Frame { s, t, .. } = Frame::about(patch.normal);
        ([s, t], [s, t].map(|dp| self.derivative(patch, at, dp)))
    }

    /// The Newton step in the tangent plane; `None` where the derivative is singular.
    pub(super) fn step(&self, patch: &SurfacePatch, at: &Constraint) -> Option<DVec3> {
        let ([s, t], [a, b]) = self.columns(patch, at);
        let det = a.perp_dot(b);
        let [p, q] = [at.residual.perp_dot(b) / det, a.perp_dot(at.residual) / det];
        let step = s * -p - t * q;
        step.is_finite().then_some(step)
    }

    /// Solid angle of w_L, or area of slopes, per solid angle of w.
    pub(super) fn ratio(&self, patch: &SurfacePatch, at: &Constraint) -> f64 {
        if self.is_smooth() {
            return solid_angle_ratio(patch, at.dir, at.distance, self.w_l, self.eta);
        }
        let (_, [a, b]) = self.columns(patch, at);
        let per_area = a.perp_dot(b).abs() / (at.along * at.along);
        per_area * at.distance * at.distance / at.dir.dot(patch.normal)
    }

    /// Bound of the residual's rounding. That of the coordinates of x and of the point turns the direction
    /// between them, the more the closer they are.
    fn rounding(&self, patch: &SurfacePatch, at: &Constraint) -> f64 {
        let largest = patch.point.abs().max(self.x.abs()).max_element();
        8.0 * f64::EPSILON * self.eta * (1.0 + self.slopes.length()) * largest / at.distance
    }

    /// Whether a point is a root, `tolerance` being the residual that counts as 0 beyond its rounding.
    pub(super) fn judge(&self, patch: &SurfacePatch, tolerance: f64) -> Judgement {
        let at = self.constraint(patch);
        let tolerance = tolerance + self.rounding(patch, &at);
        let facet = self.facet_normal(patch.shading);
        let cl = self.w_l.dot(facet);
        let is_transmitted = |n: DVec3| at.dir.dot(n) > 0.0 && self.w_l.dot(n) > 0.0;
        let is_refracted = at.residual.length() <= tolerance && is_transmitted(facet);
        if !is_refracted || !is_transmitted(patch.shading) {
            return Judgement::None;
        }
        if !is_transmitted(patch.normal) {
            return Judgement::WrongSide;
        }
        Judgement::Root(Root {
            point: patch.point,
            face: patch.face,
            normal: patch.normal,
            shading: patch.shading,
            dir: at.dir,
            distance: at.distance,
            ratio: self.ratio(patch, &at),
            transmittance: 1.0 - fresnel(cl, self.eta).reflectance,
        })
    }
}

/// A frame about a shading normal in which slopes are measured: s is across it in the plane of `axis`.
fn frame_of_slopes(axis: DVec3, n: DVec3) -> Frame {
    let s = (axis - n * n.dot(axis)).normalize();
    Frame { s, t: n.cross(s), n }
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
    let n = patch.shading;
    let (cl, ct) = (w_l.dot(n), dir.dot(n));
    let mu = cl - eta * ct;
    if let Some(curvature) = patch.curvature() {
        // Across the plane of incidence dw_L = (eta + mu curvature d) u; in it u also turns by Snell's law.
        let focus = -mu * curvature * distance / eta;
        return eta * eta * (ct / cl) * ((1.0 - focus) * (1.0 - focus / (ct * ct))).abs();
    }
    let across = Frame::about(dir);
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
