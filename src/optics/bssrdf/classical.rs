//! The dipole of Jensen, Marschner, Levoy & Hanrahan 2001, "A practical model for subsurface light
//! transport", eq. 4.
//!
//!   R(r) = alpha'/(4 pi) [ z_r (1 + s d_r) e^(-s d_r)/d_r^3 + z_v (1 + s d_v) e^(-s d_v)/d_v^3 ],
//! s = sqrt(3 sigma_a sigma_t'), z_r = 1/sigma_t', z_v = z_r (1 + 4A/3), d = sqrt(r^2 + z^2), A = (1 +
//! 2C1)/(1 - 2C1). Both signs are plus with z_v > 0: the virtual source is negative, and so is its
//! depth. Over the plane it is (alpha'/2) (1 + e^(-(4/3) A q)) e^(-q), q = sqrt(3 (1 - alpha')) = s z_r.
//!
//! Reciprocal, never negative. The paper's measured alpha' includes all light, single scattering too, so that
//! adding the single-scattering term counts it twice in part (see the head of the module).

use std::f64::consts::PI;

use super::moments::FresnelMoments;
use super::reduced::Reduced;
use crate::math::{Lanewise, NEAR, exp, exp_near};
use crate::sampling::radial::Dipole;

/// The classical dipole's profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classical {
    shape: Dipole,
    /// alpha' / (4 pi).
    strength: f64,
    total: f64,
}

impl Classical {
    /// For a medium that scatters.
    pub fn new(reduced: &Reduced, moments: &FresnelMoments) -> Classical {
        let sigma_tr = reduced.sigma_tr();
        let z_real = 1.0 / reduced.sigma_t;
        let z_virtual = z_real * (1.0 + 4.0 / 3.0 * moments.mismatch());
        let total = 0.5 * reduced.albedo * (exp(-sigma_tr * z_virtual) + exp(-sigma_tr * z_real));
        let shape = Dipole { sigma_tr, z_real, z_virtual };
        Classical { shape, strength: reduced.albedo / (4.0 * PI), total }
    }

    /// Exitance R(r) per unit flux, 1/mm^2.
    #[inline]
    pub fn exitance(&self, r: f64) -> f64 {
        self.exitance_by(exp, r)
    }

    #[inline(always)]
    fn exitance_by(&self, exp: impl Fn(f64) -> f64, r: f64) -> f64 {
        let s = self.shape.sigma_tr;
        let source = |z: f64| {
            let square = r * r + z * z;
            let d = square.sqrt();
            z * (1.0 + s * d) * exp(-s * d) / (square * d)
        };
        self.strength * (source(self.shape.z_real) + source(self.shape.z_virtual))
    }

    /// R over the plane.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// The dipole of the real and the virtual source.
    pub fn shape(&self) -> Dipole {
        self.shape
    }
}

impl Lanewise for Classical {
    fn at(&self, r: f64) -> f64 {
        self.exitance(r)
    }

    #[inline(always)]
    fn near(&self, r: f64) -> f64 {
        self.exitance_by(exp_near, r)
    }

    /// d is at most r + z.
    fn reach(&self) -> f64 {
        let Dipole { sigma_tr, z_real, z_virtual } = self.shape;
        NEAR / sigma_tr - z_real.max(z_virtual)
    }
}
