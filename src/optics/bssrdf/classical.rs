//! The dipole of Jensen, Marschner, Levoy & Hanrahan 2001 (eq. 4).
//!
//!   R(r) = alpha'/(4 pi) [ z_r (1 + s d_r) e^(-s d_r)/d_r^3 + z_v (1 + s d_v) e^(-s d_v)/d_v^3 ],
//! s = sqrt(3 sigma_a sigma_t'), z_r = 1/sigma_t', z_v = z_r (1 + 4A/3), d = sqrt(r^2 + z^2), A = (1 + 2C1)/(1 - 2C1).
//! Over the plane it is (alpha'/2) (1 + e^(-(4/3) A q)) e^(-q), q = sqrt(3 (1 - alpha')).
//!
//! Reciprocal, never negative. The source's figures count all light, single scattering too, in the measured alpha', so
//! that adding the single-scattering term counts it twice in part (see the module's table).

use super::moments::Moments;
use crate::math::exp;
use crate::optics::medium::Medium;
use crate::sampling::radial::Dipole;

/// The classical dipole's profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classical {
    shape: Dipole,
    total: f64,
}

impl Classical {
    /// For a medium that scatters.
    pub fn new(medium: &Medium, moments: &Moments) -> Classical {
        let reduced = Reduced::of(medium);
        let a = (1.0 + moments.c1) / (1.0 - moments.c1);
        let sigma_tr = (3.0 * reduced.sigma_a * reduced.sigma_t).sqrt();
        let z_real = 1.0 / reduced.sigma_t;
        let z_virtual = z_real * (1.0 + 4.0 / 3.0 * a);
        let total = 0.5 * reduced.albedo * (exp(-sigma_tr * z_virtual) + exp(-sigma_tr * z_real));
        Classical { shape: Dipole { sigma_tr, z_real, z_virtual }, total }
    }

    /// R(r), 1/mm^2.
    #[inline]
    pub fn exitance(&self, r: f64) -> f64 {
        self.total * self.shape.pdf_area(r)
    }

    /// R over the plane.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Its two sources.
    pub fn shape(&self) -> Dipole {
        self.shape
    }

    /// s, 1/mm.
    pub fn sigma_tr(&self) -> f64 {
        self.shape.sigma_tr
    }
}

/// Coefficients after similarity: scattering as if it were isotropic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reduced {
    /// Absorption, 1/mm.
    pub sigma_a: f64,
    /// sigma_s (1 - g), 1/mm.
    pub sigma_s: f64,
    /// Their sum, 1/mm.
    pub sigma_t: f64,
    /// sigma_s' / sigma_t'.
    pub albedo: f64,
}

impl Reduced {
    /// Of a medium.
    pub fn of(medium: &Medium) -> Reduced {
        let sigma_a = medium.sigma_t * (1.0 - medium.albedo);
        let sigma_s = medium.sigma_t * medium.albedo * (1.0 - medium.phase.g);
        let sigma_t = sigma_a + sigma_s;
        Reduced { sigma_a, sigma_s, sigma_t, albedo: sigma_s / sigma_t }
    }
}
