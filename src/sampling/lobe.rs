//! A lobe about an axis with a power tail, from a needle to the whole sphere.
//!
//! With v = tan^2(theta/2), theta the angle to the axis,
//!   p(v) = s^2 / (s^2 + v)^2   on [0, infinity),   distribution function v / (s^2 + v),
//! which inverts to v = s^2 u / (1 - u). The solid angle is d omega = 2 pi sin(theta) dtheta
//! = 4 pi dv / (1 + v)^2, so that the density per solid angle is p(v) (1 + v)^2 / (4 pi): 1 / (4 pi s^2)
//! on the axis, s^2 / (4 pi) opposite to it, and uniform for s = 1. For a narrow lobe 2 s is the angle
//! that holds half of it, and outside it falls off as theta^-4.

use std::f64::consts::PI;

use crate::math::{DVec3, Frame, sin_cos_turns};

/// Power-cosine lobe about an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLobe {
    frame: Frame,
    width2: f64,
}

impl PowerLobe {
    /// About the unit vector `axis`; `width` is s > 0, the tangent of half the angle that holds half of
    /// it.
    pub fn new(axis: DVec3, width: f64) -> PowerLobe {
        PowerLobe { frame: Frame::about(axis), width2: width * width }
    }

    /// A direction. With v = b / a, a = 1 - u and b = s^2 u, cos(theta) = (a - b) / (a + b) and
    /// sin(theta) = 2 sqrt(a b) / (a + b): v itself, infinite at u = 1, is never formed.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        let (a, b) = (1.0 - u[0], self.width2 * u[0]);
        let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
        let r = 2.0 * (a * b).sqrt() / (a + b);
        self.frame.to_world(DVec3::new(r * cos_phi, r * sin_phi, (a - b) / (a + b)))
    }

    /// Density of [`Self::sample`] per solid angle. v = |dir - axis|^2 / |dir + axis|^2 keeps its digits
    /// at both poles; with it as a fraction nothing overflows.
    #[inline]
    pub fn pdf(&self, dir: DVec3) -> f64 {
        let (apart, along) =
            ((dir - self.frame.n).length_squared(), (dir + self.frame.n).length_squared());
        let ratio = (apart + along) / (self.width2 * along + apart);
        self.width2 * ratio * ratio / (4.0 * PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{integrate, ln, sin};

    const WIDTHS: [f64; 5] = [1e-4, 0.03, 0.4, 1.0, 3.0];

    fn axis() -> DVec3 {
        DVec3::new(0.48, -0.6, 0.64)
    }

    /// D1: the distribution function v / (s^2 + v) undoes the sampler, ends included.
    #[test]
    fn inverse_distribution_function() {
        let end = 1.0 / f64::from(1 << 24);
        for width in WIDTHS {
            for u in (0..4096).map(|i| (f64::from(i) + 0.5) / 4096.0).chain([end, 1.0 - end]) {
                let dir = PowerLobe::new(axis(), width).sample([u, 0.3]);
                let [apart, along] = [dir - axis(), dir + axis()].map(|w| w.length_squared());
                let back = apart / (width * width * along + apart);
                // An angle of 1e-7 is known to 1e-16: its square to 2e-9 of itself.
                assert!((back - u).abs() < 1e-11 + 4e-9 * u.min(1.0 - u), "{width} {u} {back}");
                assert!((dir.length() - 1.0).abs() < 1e-15);
            }
        }
    }

    /// D2: the density is the inverse Jacobian of the map.
    #[test]
    fn density_is_the_inverse_jacobian() {
        for width in WIDTHS {
            let lobe = PowerLobe::new(axis(), width);
            for i in 1..40 {
                for j in 0..7 {
                    let u = [f64::from(i) / 40.0, f64::from(j) / 7.0];
                    let at = |a: f64, b: f64| lobe.sample([u[0] + a, u[1] + b]);
                    let e = 1e-5;
                    let du = (at(e, 0.0) - at(-e, 0.0)) / (2.0 * e);
                    let dv = (at(0.0, e) - at(0.0, -e)) / (2.0 * e);
                    let product = du.cross(dv).length() * lobe.pdf(at(0.0, 0.0));
                    assert!((product - 1.0).abs() < 1e-6, "{width} {u:?}: {product}");
                }
            }
        }
    }

    /// D7: the density adds up to 1, is s^2 / (4 pi) straight back, and 1 / (4 pi) everywhere for s = 1.
    #[test]
    fn normalised() {
        for width in WIDTHS {
            let lobe = PowerLobe::new(axis(), width);
            let side = Frame::about(axis()).s;
            let dir = |theta: f64| axis() * crate::math::cos(theta) + side * sin(theta);
            // theta = e^x resolves the needle.
            let ring = |x: f64| {
                let theta = crate::math::exp(x);
                lobe.pdf(dir(theta)) * 2.0 * PI * sin(theta) * theta
            };
            let mass = integrate(ring, ln(1e-3 * width.min(1.0)), ln(PI), 1e-11).value;
            // The part left out near the axis is 1/4 of 1e-6 and less.
            assert!((mass - 1.0).abs() < 1e-6, "{width}: {mass}");
            assert!((lobe.pdf(-axis()) * 4.0 * PI / (width * width) - 1.0).abs() < 1e-12);
        }
        let even = PowerLobe::new(axis(), 1.0);
        assert!((even.pdf(DVec3::X) * 4.0 * PI - 1.0).abs() < 1e-14);
        assert!((even.sample([1.0, 0.2]) + axis()).length() < 1e-15);
    }
}
