//! Which parts of the boundary may refract the light of a query: bounds of their points and normals.
//!
//! A part has a sphere that holds its points, of radius r at the distance D from x, and a cone that
//! holds their normals, of half angle alpha about an axis. Directions w from x to its points deviate by
//! theta = asin(r / D) at most. It holds no root
//!   where all its normals face away from the light, or from w;
//!   where w and w_L differ by more than refraction ever turns light, acos(min(eta, 1 / eta)) (the
//!   spindle of Walter et al. 2009);
//!   where eta w - w_L, which has to be along +-N, is outside the cone: it changes by
//!   2 eta sin(theta / 2) at most.

use super::throughput::Query;
use crate::math::DVec3;

/// Bounds of points and normals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub center: DVec3,
    pub radius: f64,
    pub axis: DVec3,
    /// Cosine of the cone's half angle; -1 where the normals fill more than a hemisphere.
    pub cos: f64,
}

/// Slack of comparisons between cosines, against rounding.
pub(super) const SLACK: f64 = 1e-9;

/// cos(a + b) of angles in [0, pi] from their cosines; -1 where the sum is pi or more. Without a branch.
#[inline(always)]
pub(super) fn cos_sum(a: f64, b: f64) -> f64 {
    let cos = a * b - (at_least_0(1.0 - a * a) * at_least_0(1.0 - b * b)).sqrt();
    if a + b <= 0.0 { -1.0 } else { cos }
}

/// The number, or 0 where it is below. One instruction, which `f64::max` is not.
#[inline(always)]
pub(super) fn at_least_0(x: f64) -> f64 {
    if x > 0.0 { x } else { 0.0 }
}

impl Bounds {
    pub(super) fn new(
        points: impl Iterator<Item = DVec3> + Clone,
        normals: impl Iterator<Item = DVec3> + Clone,
    ) -> Bounds {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (min, max) = points.clone().fold(empty, |(min, max), p| (min.min(p), max.max(p)));
        let center = 0.5 * (min + max);
        let radius = points.map(|p| p.distance(center)).fold(0.0, f64::max) * (1.0 + SLACK);
        let axis = normals.clone().sum::<DVec3>().normalize_or_zero();
        let cos = normals.map(|n| n.dot(axis)).fold(1.0, f64::min);
        // Interpolation stays in a cone that is convex.
        let cos = if cos > 0.0 { cos - SLACK } else { -1.0 };
        Bounds { center, radius, axis, cos }
    }

    /// Whether a root may be there.
    pub(super) fn may_hold(&self, query: &Query) -> bool {
        self.may_hold_near(query, 0.0)
    }

    /// Whether a root may be there for the query's point or any other within `reach` of it: seen from the
    /// one, the part is as much wider.
    pub(super) fn may_hold_near(&self, query: &Query, reach: f64) -> bool {
        let Bounds { center, radius, axis, cos } = *self;
        PreparedQuery::new(query).may_hold(center.to_array(), radius + reach, axis.to_array(), cos)
    }
}

/// What the test of bounds needs of a query.
#[derive(Clone, Copy, Debug)]
pub(super) struct PreparedQuery {
    x: [f64; 3],
    w_l: [f64; 3],
    eta: f64,
    /// Cosine of the largest angle by which refraction turns light.
    turn: f64,
    /// The sign of eta - 1.
    sign: f64,
    /// Cosine of the angle by which microfacets are tilted; 1 at a smooth boundary.
    tilt: f64,
}

impl PreparedQuery {
    #[inline(always)]
    pub(super) fn new(query: &Query) -> PreparedQuery {
        let Query { x, w_l, eta, slopes } = *query;
        PreparedQuery {
            x: x.to_array(),
            w_l: w_l.to_array(),
            eta,
            turn: eta.min(1.0 / eta),
            sign: (eta - 1.0).signum(),
            tilt: 1.0 / (1.0 + slopes.length_squared()).sqrt(),
        }
    }

    /// Whether a part with these bounds may hold a root. Without a branch, so that many are tested at once: whatever is
    /// computed for a part that an earlier reason rules out is not looked at.
    #[inline(always)]
    pub(super) fn may_hold(&self, center: [f64; 3], radius: f64, axis: [f64; 3], cos: f64) -> bool {
        let PreparedQuery { x, w_l, eta, turn, sign, tilt } = *self;
        let tilted = cos_sum(cos, tilt);
        let is_tilted = tilt < 1.0;
        let narrowed = if (cos > 0.0) & (tilted > 0.0) { tilted - SLACK } else { -1.0 };
        let cos = if is_tilted { narrowed } else { cos };
        let is_narrow = cos > -1.0;
        let sin = at_least_0(1.0 - cos * cos).sqrt();
        let faces_away = is_narrow & (dot(axis, w_l) < -sin - SLACK);

        let to = [center[0] - x[0], center[1] - x[1], center[2] - x[2]];
        let distance = dot(to, to).sqrt();
        let is_inside = distance <= radius * (1.0 + SLACK);
        let inverse = 1.0 / distance;
        let w = [to[0] * inverse, to[1] * inverse, to[2] * inverse];
        let sin_theta = radius * inverse;
        let cos_theta = at_least_0(1.0 - sin_theta * sin_theta).sqrt();
        let is_turned = dot(w, w_l) < cos_sum(turn, cos_theta) - SLACK;

        // The angle between the axis and w has to be below pi / 2 + alpha + theta.
        let both = cos_sum(cos, cos_theta);
        let is_behind = (both > 0.0) & (dot(axis, w) < -at_least_0(1.0 - both * both).sqrt() - SLACK);

        let h =
            [(w[0] * eta - w_l[0]) * sign, (w[1] * eta - w_l[1]) * sign, (w[2] * eta - w_l[2]) * sign];
        let length = dot(h, h).sqrt();
        // 2 sin(theta / 2) = sqrt(2 (1 - cos theta)), without the difference.
        let change = eta * sin_theta * (2.0 / (1.0 + cos_theta)).sqrt();
        let part = change / length;
        let cos_change = at_least_0(1.0 - part * part).sqrt();
        let is_near = dot(h, axis) >= length * (cos_sum(cos, cos_change) - SLACK);
        let is_beside = !((change >= length) | is_near);

        !faces_away & (is_inside | !(is_turned | (is_narrow & (is_behind | is_beside))))
    }
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
