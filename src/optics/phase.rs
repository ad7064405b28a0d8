//! Phase functions, by the cosine `mu` between the directions of travel before and after.

use std::f64::consts::{FRAC_1_PI, PI};

use schemars::JsonSchema;
use serde::Deserialize;

use crate::math::{DVec3, Frame, renormalized, sin_cos_turns};

/// Henyey & Greenstein 1941, for every |g| < 1; g = 0 is isotropic.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HenyeyGreenstein {
    /// Mean cosine; positive is forward.
    #[schemars(range(min = -0.9999, max = 0.9999))]
    pub g: f64,
}

impl HenyeyGreenstein {
    /// Density per solid angle, which is also the phase function's value (1/sr):
    /// (1 - g^2) / (4 pi (1 + g^2 - 2 g mu)^(3/2)). The base is written (1 - g)^2 + 2 g (1 - mu) (or
    /// its mirror for g < 0), which keeps its digits in the sharp peak.
    #[inline]
    pub fn pdf(&self, mu: f64) -> f64 {
        let g = self.g;
        if g == 0.0 {
            return 0.25 * FRAC_1_PI;
        }
        let (g, mu) = if g > 0.0 { (g, mu) } else { (-g, -mu) };
        // A cosine of rounded vectors may exceed 1 by a last digit.
        let base = (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - mu).max(0.0);
        (1.0 - g) * (1.0 + g) / (4.0 * PI * base * base.sqrt())
    }

    /// 1 - mu and 1 + mu of the direction that `u` selects.
    ///
    /// The distribution function of mu inverts to mu = (1 + g^2 - q^2) / (2g), q = (1 - g^2) / d,
    /// d = 1 + g (2u - 1). Both distances to the poles factor without a difference of near numbers and
    /// without a division by g:
    ///   1 - mu = (q^2 - (1-g)^2) / (2g) = (1-g) (1-u) (q + 1-g) / d
    ///   1 + mu = ((1+g)^2 - q^2) / (2g) = (1+g)  u    (q + 1+g) / d
    /// with d = (1-g) + 2gu for g > 0 and (1+g) + 2|g| (1-u) for g < 0.
    #[inline(always)]
    pub fn sample_poles(&self, u: f64) -> (f64, f64) {
        let g = self.g;
        if g == 0.0 {
            return (2.0 * (1.0 - u), 2.0 * u); // the same bits, without three divisions by 1
        }
        let d = if g >= 0.0 { (1.0 - g) + 2.0 * g * u } else { (1.0 + g) - 2.0 * g * (1.0 - u) };
        let q = (1.0 - g) * (1.0 + g) / d;
        ((1.0 - g) * (1.0 - u) * (q + (1.0 - g)) / d, (1.0 + g) * u * (q + (1.0 + g)) / d)
    }

    /// A direction of travel after scattering, for light that travelled along the unit vector `dir`;
    /// density [`Self::pdf`].
    #[inline]
    pub fn sample(&self, dir: DVec3, u: [f64; 2]) -> DVec3 {
        self.turned(dir, self.sample_local(u))
    }

    /// The direction after scattering, for light that travelled along `dir`, whose frame has `local`, drawn by
    /// [`Self::sample_local`].
    #[inline]
    pub(crate) fn turned(&self, dir: DVec3, local: DVec3) -> DVec3 {
        if self.g == 0.0 {
            return local;
        }
        // So that rounding does not add up along a walk.
        renormalized(Frame::about(dir).to_world(local))
    }

    /// The same in a frame about the direction of travel, which is its z axis.
    #[inline(always)]
    pub fn sample_local(&self, u: [f64; 2]) -> DVec3 {
        let (below, above) = self.sample_poles(u[0]);
        let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
        let r = (below * above).sqrt();
        // The smaller distance carries the digits of mu.
        let mu = if below < above { 1.0 - below } else { above - 1.0 };
        DVec3::new(r * cos_phi, r * sin_phi, mu)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::integrate;

    const GS: [f64; 11] = [-0.99999, -0.99, -0.8, -0.3, -1e-9, 0.0, 1e-9, 0.3, 0.8, 0.99, 0.99999];

    /// Distribution function of mu for g >= 0, in terms of the distance x = 1 - mu to the forward pole.
    fn above(g: f64, x: f64) -> f64 {
        // int_{-1}^{mu} 2 pi pdf = (1 - g^2)/(2g) (1/sqrt(1 + g^2 - 2 g mu) - 1/(1 + g)).
        let root = ((1.0 - g) * (1.0 - g) + 2.0 * g * x).sqrt();
        // (1/root - 1/(1+g)) = (1 + g - root) / (root (1+g)); 1 + g - root = 2g(2 - x)/(1 + g + root).
        (1.0 - g) * (2.0 - x) / (root * (1.0 + g + root))
    }

    /// D1: the distribution function undoes the sampler, ends included.
    #[test]
    fn inverse_distribution_function() {
        for g in GS {
            for i in 0..=4097u32 {
                let u = match i {
                    0 => 1.0 / f64::from(1 << 24),
                    4097 => 1.0 - 1.0 / f64::from(1 << 24),
                    i => (f64::from(i) - 0.5) / 4096.0,
                };
                let (below, above_pole) = HenyeyGreenstein { g }.sample_poles(u);
                let back = if g >= 0.0 { above(g, below) } else { 1.0 - above(-g, above_pole) };
                assert!((back - u).abs() < 1e-12, "g {g} u {u} back {back}");
                assert!((below + above_pole - 2.0).abs() < 1e-12);
            }
        }
    }

    /// D7 and the definition of g: normalised, mean cosine g. (The chi-square of a sampler against its
    /// own density cannot see a flipped sign; this can.)
    #[test]
    fn normalised_with_mean_cosine_g() {
        for g in GS {
            let phase = HenyeyGreenstein { g };
            // x = 1 - |mu towards the peak|, on a logarithmic scale to resolve the peak.
            let moment = |f: &dyn Fn(f64) -> f64| {
                let side = if g >= 0.0 { 1.0 } else { -1.0 };
                let scale = (1.0 - g.abs()) * (1.0 - g.abs());
                let top = crate::math::ln_1p(2.0 / scale);
                integrate(
                    |y| {
                        let x = scale * crate::math::exp_m1(y);
                        let mu = side * (1.0 - x);
                        2.0 * PI * phase.pdf(mu) * f(mu) * (x + scale)
                    },
                    0.0,
                    top,
                    1e-11,
                )
                .value
            };
            assert!((moment(&|_| 1.0) - 1.0).abs() < 1e-8, "norm at g {g}");
            assert!((moment(&|mu| mu) - g).abs() < 1e-8, "mean cosine at g {g}");
        }
    }

    /// Vectors whose product exceeds 1 by rounding have a density, and walks keep their length.
    #[test]
    fn rounding_beyond_the_poles() {
        let mut dir = DVec3::new(0.48, -0.6, 0.64);
        for g in [1.0 - 1e-9, -1.0 + 1e-9, 0.5] {
            let phase = HenyeyGreenstein { g };
            for mu in [1.0 + 4e-16, -1.0 - 4e-16] {
                assert!(phase.pdf(mu).is_finite() && phase.pdf(mu) > 0.0);
            }
            for i in 0..100_000u32 {
                let u = [f64::from(i % 997) / 997.0, f64::from(i % 101) / 101.0];
                dir = phase.sample(dir, u);
                assert!((dir.length() - 1.0).abs() < 1e-15);
            }
        }
    }

    /// D2 and D5: density times the Jacobian of the map is 1, and the sampled vector has the cosine
    /// whose density is reported.
    #[test]
    fn density_is_the_inverse_jacobian() {
        let dir = DVec3::new(0.48, -0.6, 0.64);
        for g in [-0.99, -0.8, 1e-9, 0.3, 0.8, 0.99] {
            let phase = HenyeyGreenstein { g };
            for i in 1..200 {
                let u = f64::from(i) / 200.0;
                let h = 1e-6;
                let mu = |u: f64| phase.sample(dir, [u, 0.3]).dot(dir);
                // dOmega = 2 pi dmu for du du1.
                let jacobian = 2.0 * PI * (mu(u + h) - mu(u - h)) / (2.0 * h);
                assert!((phase.pdf(mu(u)) * jacobian - 1.0).abs() < 1e-5, "g {g} u {u}");
                assert!((phase.sample(dir, [u, 0.7]).length() - 1.0).abs() < 1e-14);
            }
        }
    }
}
