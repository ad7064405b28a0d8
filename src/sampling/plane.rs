//! Directions from a vertex to the points of a plane above it, spread about the vertex's foot.
//!
//! At height h below the plane, with mean free path l, light that leaves through the plane does so
//! within a few of sqrt(h^2 + l^2) of the foot. So let the point's distance from the foot be r = s
//! sqrt(u / (1 - u)), s^2 = h^2 + l^2: density s^2 / (pi (r^2 + s^2)^2) per area. Seen from the vertex
//! at distance d under the cosine c = h / d, an area element is c / d^2 of it in solid angle, and r^2 +
//! s^2 = h^2 / c^2 + l^2, hence
//!   pdf = s^2 d^2 / (pi c (r^2 + s^2)^2) = s^2 h^2 c / (pi (h^2 + l^2 c^2)^2)   per solid angle.
//! For l = 0 that is the cosine lobe. The plane only defines the lobe; its directions may be used with any
//! surface.

use std::f64::consts::PI;

use crate::math::{DVec3, Frame, sin_cos_turns};

/// The directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneLobe {
    frame: Frame,
    /// h / s and l / s.
    height: f64,
    mfp: f64,
}

impl PlaneLobe {
    /// A vertex that is lower than this many mean free paths has the lobe of this height: below it the
    /// lobe grazes the plane, where a unit vector no longer holds the digits of its cosine.
    pub const LOWEST: f64 = 1e-6;

    /// `normal` is the plane's unit normal, away from the vertex; `height` > 0 the vertex's distance
    /// from the plane, `mfp` > 0 the mean free path, both in mm.
    pub fn new(normal: DVec3, height: f64, mfp: f64) -> PlaneLobe {
        let height = height.max(PlaneLobe::LOWEST * mfp);
        let s = (height * height + mfp * mfp).sqrt();
        PlaneLobe { frame: Frame::about(normal), height: height / s, mfp: mfp / s }
    }

    /// A unit vector from the vertex towards the plane.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
        // (r, h) in units of s, both times sqrt(1 - u), which is 0 at u = 1 instead of an infinite r.
        let r = u[0].sqrt();
        let up = self.height * (1.0 - u[0]).sqrt();
        self.frame.to_world(DVec3::new(r * cos_phi, r * sin_phi, up).normalize())
    }

    /// Density of [`Self::sample`] per solid angle, to a relative 2e-16 / cos, which is what a unit
    /// vector holds of its cosine; 0 for what does not go towards the plane.
    #[inline]
    pub fn pdf(&self, dir: DVec3) -> f64 {
        let cos = dir.dot(self.frame.n);
        if cos <= 0.0 {
            return 0.0;
        }
        let h2 = self.height * self.height;
        let along = self.mfp * cos;
        let sum = h2 + along * along;
        h2 * cos / (PI * sum * sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::integrate;

    fn normal() -> DVec3 {
        DVec3::new(0.48, -0.6, 0.64)
    }

    const LOBES: [(f64, f64); 5] = [(1.0, 1e-3), (1.0, 1.0), (0.1, 1.0), (0.01, 2.0), (1e-4, 1.0)];

    /// The sampled ray meets the plane at distance s sqrt(u / (1 - u)) from the foot: D1 in the words of
    /// the head, in mm.
    #[test]
    fn distance_from_the_foot() {
        for (h, l) in LOBES {
            let lobe = PlaneLobe::new(normal(), h, l);
            for i in 1..200 {
                let u = f64::from(i) / 200.0;
                let dir = lobe.sample([u, 0.3]);
                let cos = dir.dot(normal());
                let r2 = (dir * (h / cos) - normal() * h).length_squared();
                let back = r2 / (r2 + h * h + l * l);
                assert!((back - u).abs() < 1e-10, "{h} {l} {u}: {back}");
                assert!((dir.length() - 1.0).abs() < 1e-14);
            }
        }
    }

    /// D2: the density is the inverse Jacobian of the map, and that of the area carried over by hand.
    #[test]
    fn density_is_the_inverse_jacobian() {
        for (h, l) in LOBES {
            let lobe = PlaneLobe::new(normal(), h, l);
            for i in 1..40 {
                for j in 0..7 {
                    let u = [f64::from(i) / 40.0, f64::from(j) / 7.0];
                    let at = |a: f64, b: f64| lobe.sample([u[0] + a, u[1] + b]);
                    let e = 1e-5;
                    let du = (at(e, 0.0) - at(-e, 0.0)) / (2.0 * e);
                    let dv = (at(0.0, e) - at(0.0, -e)) / (2.0 * e);
                    let dir = at(0.0, 0.0);
                    let product = du.cross(dv).length() * lobe.pdf(dir);
                    assert!((product - 1.0).abs() < 1e-5, "{h} {l} {u:?}: {product}");

                    let cos = dir.dot(normal());
                    let (d, s2) = (h / cos, h * h + l * l);
                    let r2 = d * d - h * h;
                    let by_area = s2 / (PI * (r2 + s2) * (r2 + s2)) * d * d / cos;
                    assert!((lobe.pdf(dir) / by_area - 1.0).abs() < 1e-9, "{h} {l} {u:?}");
                }
            }
        }
    }

    /// D7: over the hemisphere it adds up to 1; below the plane's horizon there is nothing; and a vertex
    /// in the plane itself still has a lobe.
    #[test]
    fn normalised() {
        for (h, l) in LOBES {
            let lobe = PlaneLobe::new(normal(), h, l);
            let side = Frame::about(normal()).s;
            // cos = w tan(a) resolves the grazing peak at cos ~ h / l.
            let w = h / l;
            let ring = |a: f64| {
                let tan = crate::math::tan(a);
                let cos = w * tan;
                let dir = normal() * cos + side * ((1.0 - cos) * (1.0 + cos)).sqrt();
                lobe.pdf(dir) * 2.0 * PI * w * (1.0 + tan * tan)
            };
            let mass = integrate(ring, 0.0, crate::math::atan(1.0 / w), 1e-10).value;
            assert!((mass - 1.0).abs() < 1e-8, "{h} {l}: {mass}");
            assert_eq!(lobe.pdf(-normal()), 0.0);
        }
        let flat = PlaneLobe::new(normal(), 0.0, 1.0);
        let dir = flat.sample([0.5, 0.1]);
        assert!(dir.dot(normal()) > 0.0 && flat.pdf(dir).is_finite());
    }
}
