//! Direction and distance together, so that both squared distances of a connection cancel.
//!
//! Light that scatters at a vertex a, then at x, and continues to a given point b carries the geometry
//! 1 / (|x - a|^2 |x - b|^2). For an isotropic phase function that is all of the integrand that varies
//! fast, and it can be sampled exactly (Kulla & Fajardo 2012; Georgiev et al. 2013, joint importance
//! sampling): with theta the angle at a between x and b, R = |b - a|,
//!   integral over an infinite ray of dt / |x - b|^2 = (pi - theta) / (R sin theta),
//! so the direction has density (pi - theta) / (pi^3 sin theta) per solid angle, theta itself
//! p(theta) = 2 (pi - theta) / pi^2 with the inverse theta = pi (1 - sqrt(1 - u)), and the distance is
//! equiangular. Their product over t^2 is R / (pi^3 |x - a|^2 |x - b|^2) per volume: constant over the
//! integrand. On a ray that ends at t_max the distance is equiangular on the ray up to t_max, and the product
//! keeps a factor (pi - theta) / span.

use std::f64::consts::PI;

use super::distance::Equiangular;
use crate::math::{DVec3, Frame, atan2, sin, sin_cos_turns};

/// Sampling towards a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TowardsPoint {
    offset: DVec3,
    frame: Frame,
}

impl TowardsPoint {
    /// Angles to the axis below this count as this, in samples (a part 6e-10 of them) and densities,
    /// which grow without bound towards the axis.
    pub const CLAMP: f64 = 1e-9;

    /// Towards a point at `offset` (mm) from the vertex; `None` if it is the vertex itself.
    pub fn new(offset: DVec3) -> Option<TowardsPoint> {
        let is_away = offset.length_squared() > 0.0 && offset.is_finite();
        is_away.then(|| TowardsPoint { offset, frame: Frame::about(offset.normalize()) })
    }

    /// A direction from the vertex.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        self.frame.to_world(TowardsPoint::sample_local(u))
    }

    /// Density of [`Self::sample`] per solid angle.
    #[inline]
    pub fn pdf(&self, dir: DVec3) -> f64 {
        TowardsPoint::pdf_about(self.frame.n, dir).1
    }

    /// [`Self::sample`] in a frame whose third axis points to the point: theta by `u[0]`, azimuth 2 pi
    /// `u[1]` from the first axis.
    #[inline]
    pub fn sample_local(u: [f64; 2]) -> DVec3 {
        // 1 - sqrt(1 - u) without the difference.
        let theta = (PI * u[0] / (1.0 + (1.0 - u[0]).sqrt())).max(TowardsPoint::CLAMP);
        let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
        let r = sin(theta);
        let half = sin(0.5 * theta);
        DVec3::new(r * cos_phi, r * sin_phi, 1.0 - 2.0 * half * half)
    }

    /// theta, and [`Self::pdf`], of the unit vector `dir` for a point straight along the unit vector
    /// `axis`.
    #[inline]
    pub fn pdf_about(axis: DVec3, dir: DVec3) -> (f64, f64) {
        // Half angles by lengths keep their digits at both poles (Kahan).
        let (apart, along) = ((dir - axis).length(), (dir + axis).length());
        let theta = (2.0 * atan2(apart, along)).max(TowardsPoint::CLAMP);
        let back = 2.0 * atan2(along, apart);
        let sin_theta = sin(theta.min(back));
        // Straight back, back / sin(back) goes to 1.
        let ratio = if back > 0.0 { back / sin_theta } else { 1.0 };
        (theta, ratio / (PI * PI * PI))
    }

    /// The distances along a direction; see [`Equiangular::towards`].
    #[inline]
    pub fn distances(&self, dir: DVec3, t_max: f64) -> Option<Equiangular> {
        Equiangular::towards(self.offset, dir, t_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::integrate;

    fn towards() -> TowardsPoint {
        TowardsPoint::new(DVec3::new(0.3, -1.2, 0.4)).expect("away")
    }

    /// 4096 numbers and both ends.
    fn grid() -> impl Iterator<Item = f64> {
        let end = 1.0 / f64::from(1 << 24);
        (0..4096).map(|i| (f64::from(i) + 0.5) / 4096.0).chain([end, 1.0 - end])
    }

    fn theta(towards: &TowardsPoint, dir: DVec3) -> f64 {
        let axis = towards.frame.n;
        atan2(axis.cross(dir).length(), axis.dot(dir))
    }

    /// D1: F(theta) = 1 - (1 - theta/pi)^2; and the vectors are of length 1.
    #[test]
    fn inverse_distribution_function() {
        for u in grid() {
            let dir = towards().sample([u, 0.3]);
            let left = 1.0 - theta(&towards(), dir) / PI;
            assert!((1.0 - left * left - u).abs() < 1e-12, "{u}");
            assert!((dir.length() - 1.0).abs() < 1e-15);
        }
    }

    /// D2, D5: the density is the inverse Jacobian, from the sampled vector.
    #[test]
    fn density_is_the_inverse_jacobian() {
        let towards = towards();
        for i in 1..60 {
            for j in 0..20 {
                let u = [f64::from(i) / 60.0, f64::from(j) / 20.0];
                let at = |a: f64, b: f64| towards.sample([u[0] + a, u[1] + b]);
                let e = 1e-6;
                let du = (at(e, 0.0) - at(-e, 0.0)) / (2.0 * e);
                let dv = (at(0.0, e) - at(0.0, -e)) / (2.0 * e);
                let product = du.cross(dv).length() * towards.pdf(at(0.0, 0.0));
                assert!((product - 1.0).abs() < 1e-7, "{u:?}: {product}");
            }
        }
    }

    /// D7: over theta the density adds up to 1; at the poles it is finite, straight back 1/pi^3.
    #[test]
    fn normalised() {
        let towards = towards();
        let (axis, side) = (towards.frame.n, towards.frame.s);
        let dir = |theta: f64| axis * crate::math::cos(theta) + side * sin(theta);
        let mass = integrate(|theta| towards.pdf(dir(theta)) * 2.0 * PI * sin(theta), 0.0, PI, 1e-12);
        assert!((mass.value - 1.0).abs() < 1e-9, "{mass:?}");
        assert!((towards.pdf(-axis) * PI * PI * PI - 1.0).abs() < 1e-9);
        let ahead = towards.pdf(axis);
        assert!((ahead * PI * PI * TowardsPoint::CLAMP - 1.0).abs() < 1e-6, "{ahead}");
        assert_eq!(TowardsPoint::new(DVec3::ZERO), None);
    }

    /// The joint density per volume is R / (pi^3 |x - a|^2 |x - b|^2): all that it was built for.
    #[test]
    fn the_geometry_cancels() {
        let towards = towards();
        for u in grid() {
            for v in [1e-6, 0.2, 0.5, 0.8, 1.0 - 1e-6] {
                let dir = towards.sample([u, 7.3 * v % 1.0]);
                let distances = towards.distances(dir, f64::INFINITY).expect("seen");
                let t = distances.sample(v);
                let pdf = towards.pdf(dir) * distances.pdf_distance(t) / (t * t);
                let to_point = (dir * t - towards.offset).length_squared();
                let expected = towards.offset.length() / (PI * PI * PI * t * t * to_point);
                // At u = 2^-24 the angle itself carries 1e-16 / 1e-7 of rounding.
                assert!((pdf / expected - 1.0).abs() < 1e-8, "{u} {v}: {pdf} {expected}");
            }
        }
    }
}
