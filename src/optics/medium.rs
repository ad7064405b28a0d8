//! Homogeneous media, one band.

use super::phase::HenyeyGreenstein;

/// A homogeneous medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Extinction, 1/mm.
    pub sigma_t: f64,
    /// Scattered fraction of extinction.
    pub albedo: f64,
    /// Phase function.
    pub phase: HenyeyGreenstein,
}

impl Medium {
    /// From absorption and scattering coefficients, 1/mm. Without extinction the albedo is 0.
    pub fn new(sigma_a: f64, sigma_s: f64, g: f64) -> Medium {
        let sigma_t = sigma_a + sigma_s;
        let albedo = if sigma_t > 0.0 { sigma_s / sigma_t } else { 0.0 };
        Medium { sigma_t, albedo, phase: HenyeyGreenstein { g } }
    }
}
