//! Coefficients of a medium after similarity.

use crate::optics::medium::Medium;

/// Coefficients after similarity: scattering as if it were isotropic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reduced {
    /// Absorption, 1/mm.
    pub sigma_a: f64,
    /// sigma_s (1 - g), 1/mm.
    pub sigma_s: f64,
    /// Reduced extinction, 1/mm.
    pub sigma_t: f64,
    /// Reduced albedo sigma_s' / sigma_t'.
    pub albedo: f64,
}

impl Reduced {
    /// From absorption and reduced scattering, 1/mm, the latter positive.
    pub fn new(sigma_a: f64, sigma_s: f64) -> Reduced {
        let sigma_t = sigma_a + sigma_s;
        Reduced { sigma_a, sigma_s, sigma_t, albedo: sigma_s / sigma_t }
    }

    /// Of a medium that scatters.
    pub fn of(medium: &Medium) -> Reduced {
        let sigma_a = medium.sigma_t * (1.0 - medium.albedo);
        Reduced::new(sigma_a, medium.sigma_t * medium.albedo * (1.0 - medium.phase.g))
    }

    /// s = sqrt(3 sigma_a sigma_t') of classical diffusion (D = 1/(3 sigma_t')), 1/mm.
    pub fn sigma_tr(&self) -> f64 {
        (3.0 * self.sigma_a * self.sigma_t).sqrt()
    }
}
