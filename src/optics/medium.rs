//! Homogeneous media, one band.

use super::phase::HenyeyGreenstein;
use crate::math::exp_m1;

/// A homogeneous medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Extinction, 1/mm.
    pub sigma_t: f64,
    /// Scattered fraction of extinction.
    pub albedo: f64,
    /// Phase function.
    pub phase: HenyeyGreenstein,
    /// Radiance that a ray gains per length, the same in every direction, W/(mm^2 sr) per mm.
    pub emission: f64,
}

impl Medium {
    /// From absorption and scattering coefficients, 1/mm. Without extinction the albedo is 0. It emits
    /// nothing.
    pub fn new(sigma_a: f64, sigma_s: f64, g: f64) -> Medium {
        let sigma_t = sigma_a + sigma_s;
        let albedo = if sigma_t > 0.0 { sigma_s / sigma_t } else { 0.0 };
        Medium { sigma_t, albedo, phase: HenyeyGreenstein { g }, emission: 0.0 }
    }

    /// Emission that reaches the end of a ray of length `t` without being scattered, W/(mm^2 sr):
    ///   int_0^t emission e^(-sigma_t s) ds = emission (1 - e^(-sigma_t t)) / sigma_t.
    #[inline]
    pub fn emitted(&self, t: f64) -> f64 {
        if self.sigma_t == 0.0 {
            self.emission * t
        } else {
            self.emission * (-exp_m1(-self.sigma_t * t) / self.sigma_t)
        }
    }
}
