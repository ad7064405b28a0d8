//! The better dipole: d'Eon 2012, "A better dipole" (with the diffusion constant of Grosjean 1956).
//!
//! Two changes to the classical dipole. The fluence phi and the vector flux E of a point source both
//! leave through the boundary, each with its own Fresnel moment (d'Eon & Irving 2011): exitance = C_phi
//! phi + C_E (-D dphi/dz). And the diffusion constant is D = (2 sigma_a + sigma_s') / (3 sigma_t'^2),
//! for which phi is exact in its far field at alpha' -> 0 too. With s = sqrt(sigma_a / D), NOT sqrt(3
//! sigma_a sigma_t'), z_r = 1/sigma_t', z_v = z_r + 4 A D, A = (1 - C_E)/(2 C_phi):
//!   R(r) = alpha'^2/(4 pi) { [C_E z_r (1 + s d_r)/d_r^2 + C_phi/D] e^(-s d_r)/d_r
//!                          - [-C_E z_v (1 + s d_v)/d_v^2 + C_phi/D] e^(-s d_v)/d_v }.
//! The factor is alpha' squared: once for the first scattering, which makes the source, once for the
//! second, since the source's own once-scattered light is left out. Over the plane
//!   (alpha'^2/2) { C_E (e^(-s z_r) + e^(-s z_v)) + C_phi/(D s) (e^(-s z_r) - e^(-s z_v)) },
//! whose last term is C_phi (z_v - z_r)/D where s = 0.
//!
//! Reciprocal, never negative (below, every term is positive); multiple scattering only.

use std::f64::consts::PI;

use super::moments::FresnelMoments;
use super::reduced::Reduced;
use crate::math::{cbrt, exp, exp_m1};
use crate::sampling::radial::{Dipole, Radial};

/// The better dipole's profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Better {
    shape: Dipole,
    /// alpha'^2 C_E / (4 pi).
    flux: f64,
    /// alpha'^2 C_phi / (4 pi D).
    fluence: f64,
    /// z_v^2 - z_r^2, mm^2.
    gap: f64,
    total: f64,
}

impl Better {
    /// For a medium that scatters.
    pub fn new(reduced: &Reduced, moments: &FresnelMoments) -> Better {
        let Reduced { sigma_a, sigma_s, sigma_t, albedo } = *reduced;
        let diffusion = (2.0 * sigma_a + sigma_s) / (3.0 * sigma_t * sigma_t);
        let s = (sigma_a / diffusion).sqrt();
        let z_real = 1.0 / sigma_t;
        let z_virtual = z_real + 4.0 * moments.mismatch_of_flux() * diffusion;
        let strength = albedo * albedo / (4.0 * PI);
        let [flux, fluence] = [strength * moments.c_e(), strength * moments.c_phi() / diffusion];
        let apart = z_virtual - z_real;
        // (1 - e^(-s apart)) / s.
        let between = if s > 0.0 { -exp_m1(-s * apart) / s } else { apart };
        let [real, both] = [exp(-s * z_real), 1.0 + exp(-s * apart)];
        let total = 2.0 * PI * real * (flux * both + fluence * between);
        let gap = apart * (z_virtual + z_real);
        Better { shape: Dipole { sigma_tr: s, z_real, z_virtual }, flux, fluence, gap, total }
    }

    /// R(r), 1/mm^2.
    ///
    /// The fluences of the two sources nearly cancel far away. With delta = d_v - d_r = (z_v^2 -
    /// z_r^2)/(d_v + d_r),
    ///   e^(-s d_r)/d_r - e^(-s d_v)/d_v = e^(-s d_r) [delta/d_r + (1 - e^(-s delta))] / d_v,
    /// a sum of positive terms.
    #[inline]
    pub fn exitance(&self, r: f64) -> f64 {
        let Dipole { sigma_tr: s, z_real, z_virtual } = self.shape;
        let [square_r, square_v] = [r * r + z_real * z_real, r * r + z_virtual * z_virtual];
        let [d_r, d_v] = [square_r.sqrt(), square_v.sqrt()];
        let delta = self.gap / (d_r + d_v);
        let lost = -exp_m1(-s * delta);
        let from_real = z_real * (1.0 + s * d_r) / (square_r * d_r);
        let from_virtual = z_virtual * (1.0 + s * d_v) * (1.0 - lost) / (square_v * d_v);
        let fluence = (delta / d_r + lost) / d_v;
        exp(-s * d_r) * (self.flux * (from_real + from_virtual) + self.fluence * fluence)
    }

    /// Ways to draw distances, with their shares: R almost exactly.
    ///
    /// Since -d/dz (e^(-s d)/d) = z (1 + s d) e^(-s d)/d^3 =: q(z), the fluences' difference is
    /// int_z_r^z_v q dz, and R is
    ///   flux (q(z_r) + q(z_v)) + fluence int_z_r^z_v q(z) dz:
    /// sources of the classical kind at the two ends and all depths between. Two sources of one strength
    /// are a [`Dipole`]; the integral becomes three of them, by Gauss's rule of two nodes (which weights
    /// them alike) on three parts of the range that widen by one factor. A source at z has the integral
    /// 2 pi e^(-s z) over the plane.
    pub fn techniques(&self) -> Vec<(f64, Radial)> {
        let Dipole { sigma_tr, z_real, z_virtual } = self.shape;
        let factor = cbrt(z_virtual / z_real);
        let mut parts = vec![(self.flux, self.shape)];
        let mut low = z_real;
        for _ in 0..3 {
            let (middle, half) = (0.5 * low * (factor + 1.0), 0.5 * low * (factor - 1.0));
            let node = half / 3f64.sqrt();
            let pair = Dipole { sigma_tr, z_real: middle - node, z_virtual: middle + node };
            parts.push((self.fluence * half, pair));
            low *= factor;
        }
        let mass = |(weight, pair): &(f64, Dipole)| {
            weight
                * (exp(-sigma_tr * (pair.z_real - z_real)) + exp(-sigma_tr * (pair.z_virtual - z_real)))
        };
        let all: f64 = parts.iter().map(mass).sum();
        parts.iter().map(|part| (mass(part) / all, Radial::Dipole(part.1))).collect()
    }

    /// R over the plane.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// s = sqrt(sigma_a / D), 1/mm.
    pub fn sigma_tr(&self) -> f64 {
        self.shape.sigma_tr
    }
}
