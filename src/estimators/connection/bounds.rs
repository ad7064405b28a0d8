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
const SLACK: f64 = 1e-9;

/// cos(a + b) of angles in [0, pi] from their cosines; -1 where the sum is pi or more.
fn cos_sum(a: f64, b: f64) -> f64 {
    if a + b <= 0.0 { -1.0 } else { a * b - ((1.0 - a * a).max(0.0) * (1.0 - b * b).max(0.0)).sqrt() }
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
        let Query { x, w_l, eta, slopes } = *query;
        let radius = self.radius + reach;
        // Microfacets are tilted against the normals.
        let tilt = 1.0 / (1.0 + slopes.length_squared()).sqrt();
        let cos = match cos_sum(self.cos, tilt) {
            _ if tilt == 1.0 => self.cos,
            tilted if self.cos > 0.0 && tilted > 0.0 => tilted - SLACK,
            _ => -1.0,
        };
        let is_narrow = cos > -1.0;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        if is_narrow && self.axis.dot(w_l) < -sin - SLACK {
            return false;
        }
        let to = self.center - x;
        let distance = to.length();
        if distance <= radius * (1.0 + SLACK) {
            return true;
        }
        let w = to / distance;
        let sin_theta = radius / distance;
        let cos_theta = (1.0 - sin_theta * sin_theta).max(0.0).sqrt();
        if w.dot(w_l) < cos_sum(eta.min(1.0 / eta), cos_theta) - SLACK {
            return false;
        }
        if !is_narrow {
            return true;
        }
        // The angle between the axis and w has to be below pi / 2 + alpha + theta.
        let both = cos_sum(cos, cos_theta);
        if both > 0.0 && self.axis.dot(w) < -(1.0 - both * both).max(0.0).sqrt() - SLACK {
            return false;
        }
        let h = (w * eta - w_l) * (eta - 1.0).signum();
        let length = h.length();
        // 2 sin(theta / 2) = sqrt(2 (1 - cos theta)), without the difference.
        let change = eta * sin_theta * (2.0 / (1.0 + cos_theta)).sqrt();
        if change >= length {
            return true;
        }
        let part = change / length;
        let cos_change = (1.0 - part * part).max(0.0).sqrt();
        h.dot(self.axis) >= length * (cos_sum(cos, cos_change) - SLACK)
    }
}
