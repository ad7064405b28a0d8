//! The directional dipole: Frisvad, Hachisuka & Kjeldsen 2014, "Directional dipole model for subsurface
//! scattering", ACM TOG 34(1).
//!
//! A ray that enters along w makes in an infinite medium the fluence (their eq. 8, from Menon et al.
//! 2005)
//!   phi(x, w) = Phi e^(-s r)/(4 pi D r) (1 + 3 D (1 + s r)/r^2 x.w),
//!   D = 1/(3 sigma_t'),  s = sqrt(sigma_a/D),
//! whose exitance, C_phi phi - C_E D n_o.grad phi (d'Eon & Irving 2011; the minus sign matters), over pi
//! and over what T21 leaves of a diffuse exitance, 4 C_phi(1/eta) = 1 - 2 C1(1/eta), is (eq. 17)
//!   S'(x, w, r) = 1/(4 C_phi(1/eta)) 1/(4 pi^2) e^(-s r)/r^3 { C_phi [ r^2/D + 3 (1 + s r) x.w ]
//!       - C_E [ 3 D (1 + s r) w.n_o - ((1 + s r) + 3 D (3 (1 + s r) + (s r)^2)/r^2 x.w) x.n_o ] }.
//! The boundary is met by a mirrored ray over an extrapolated plane:
//!   S_d = S'(x, w12, d_r) - S'(x_v, w_v, d_v),   x = xo - xi,
//!   n_i* = what of n_i is orthogonal to x, normalised (n_i itself on a plane): the modified tangent
//!   plane
//!   x_v = x - 2 A d_e n_i*,   w_v = w12 - 2 (w12.n_i*) n_i*,   d_v = |x_v|,
//!   A = (1 - C_E)/(2 C_phi),   d_e = 2.131 D / sqrt(alpha')
//! (the journal's d_e; the earlier technical report has 2.121 D/alpha'). The distance to the real source
//! is corrected near it (eqs. 20-22): with mu0 = -n_o.w12 and cos b = -sqrt((r^2 - (x.w12)^2)/(r^2 +
//! d_e^2)),
//!   d_r^2 = r^2 + D mu0 (D mu0 - 2 d_e cos b)   for mu0 > 0: light from below the exit's tangent plane,
//!   d_r^2 = r^2 + 1/(3 sigma_t)^2               else,
//! where sigma_t is the medium's own, unreduced, here and nowhere else; d_r jumps at mu0 = 0. The real
//! source's kernel takes d_r for r and the uncorrected x in x.w and x.n_o, the virtual one's takes x_v
//! and d_v throughout.
//!
//! Not reciprocal: exchanging the ends changes it by some ten percent even on a plane, and by more
//! elsewhere. S_d is negative where the mirrored ray outshines the real one or the exit faces away; what
//! is used is max(0, S_d), per band. Not bounded in energy: along the normal, alpha' 0.999, eta 1.3, the
//! exitance is 1.10 of the power that enters (exact: 0.87), and it does not vanish with alpha'. It has
//! single scattering in it by construction. Light that goes straight through is counted apart with the
//! delta-Eddington extinction sigma_a + sigma_s (1 - g^2).
//!
//! Degenerate ends, which the source leaves open. xo = xi: n_i* = n_i. xo straight below or above xi, so
//! that nothing of n_i is orthogonal to x: n_i* turns against what of w12 is orthogonal to x, as the
//! normal does that a ray enters by; failing that too (x, n_i and w12 in one line), it is orthogonal to
//! x and n_o, and failing that the choice does not matter. Rotating the scene rotates the choice.

use std::f64::consts::PI;

use super::classical::Classical;
use super::ends::{Entry, Exit};
use super::moments::FresnelMoments;
use super::reduced::Reduced;
use crate::math::{DVec3, Frame, exp};

/// d_e over D / sqrt(alpha'): the extrapolation distance, journal version.
const EXTRAPOLATION: f64 = 2.131;

/// Parts of n_i or w12 orthogonal to x shorter than this are rounding errors of unit vectors.
const PARALLEL: f64 = 1e-12;

/// The directional dipole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalDipole {
    /// D, mm.
    diffusion: f64,
    /// Effective transport coefficient s, 1/mm.
    sigma_tr: f64,
    /// Extrapolation distance d_e, mm.
    extrapolation: f64,
    /// 2 A d_e, mm.
    mirror: f64,
    /// Near-source correction 1/(3 sigma_t)^2, mm^2.
    correction: f64,
    /// C_phi / (4 C_phi(1/eta) 4 pi^2).
    fluence: f64,
    /// C_E / (4 C_phi(1/eta) 4 pi^2).
    flux: f64,
    /// The profile that distances are drawn from and accepted by.
    classical: Classical,
}

/// The directional dipole between two ends, before it is clamped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalTerms {
    /// The real source's kernel, 1/(mm^2 sr).
    pub real: f64,
    /// The virtual source's kernel, 1/(mm^2 sr); S_d = real - mirrored.
    pub mirrored: f64,
    /// Distance d_r to the real source, mm.
    pub d_r: f64,
    /// Distance d_v to the virtual source, mm.
    pub d_v: f64,
    /// Cosine mu0 = -n_o.w12 of the refracted direction at the exit.
    pub mu0: f64,
}

impl DirectionalDipole {
    /// For a medium that scatters: its reduced coefficients and its own, unreduced sigma_t, 1/mm.
    pub fn new(reduced: &Reduced, sigma_t: f64, moments: &FresnelMoments) -> DirectionalDipole {
        let diffusion = 1.0 / (3.0 * reduced.sigma_t);
        let extrapolation = EXTRAPOLATION * diffusion / reduced.albedo.sqrt();
        let scale = 1.0 / (moments.passed() * 4.0 * PI * PI);
        DirectionalDipole {
            diffusion,
            sigma_tr: reduced.sigma_tr(),
            extrapolation,
            mirror: 2.0 * moments.mismatch_of_flux() * extrapolation,
            correction: 1.0 / (9.0 * sigma_t * sigma_t),
            fluence: scale * moments.c_phi(),
            flux: scale * moments.c_e(),
            classical: Classical::new(reduced, moments),
        }
    }

    /// max(0, S_d), 1/(mm^2 sr).
    #[inline]
    pub fn kernel(&self, entry: &Entry, exit: &Exit) -> f64 {
        let parts = self.parts(entry, exit);
        (parts.real - parts.mirrored).max(0.0)
    }

    /// Terms of S_d's real and virtual source.
    #[inline]
    pub fn parts(&self, entry: &Entry, exit: &Exit) -> DirectionalTerms {
        let x = exit.point - entry.point;
        let square = x.length_squared();
        let along = x.dot(entry.dir);
        let mu0 = -exit.normal.dot(entry.dir);
        let d_r = if mu0 > 0.0 {
            let sideways = (square - along * along).max(0.0);
            let minus_cos = (sideways / (square + self.extrapolation * self.extrapolation)).sqrt();
            let shift = self.diffusion * mu0;
            square + shift * (shift + 2.0 * self.extrapolation * minus_cos)
        } else {
            square + self.correction
        }
        .sqrt();
        let normal = tangent_plane(x, square, entry, exit);
        let x_v = x - self.mirror * normal;
        let w_v = entry.dir - 2.0 * entry.dir.dot(normal) * normal;
        let d_v = x_v.length();
        DirectionalTerms {
            real: self.source(along, x.dot(exit.normal), -mu0, d_r),
            mirrored: self.source(x_v.dot(w_v), x_v.dot(exit.normal), w_v.dot(exit.normal), d_v),
            d_r,
            d_v,
            mu0,
        }
    }

    /// S' from x.w, x.n_o, w.n_o and r.
    #[inline]
    fn source(&self, xw: f64, xn: f64, wn: f64, r: f64) -> f64 {
        let sr = self.sigma_tr * r;
        let first = 1.0 + sr;
        let square = r * r;
        let d3 = 3.0 * self.diffusion;
        let fluence = square / self.diffusion + 3.0 * first * xw;
        let flux = d3 * first * wn - (first + d3 * (3.0 * first + sr * sr) / square * xw) * xn;
        exp(-sr) / (square * r) * (self.fluence * fluence - self.flux * flux)
    }

    /// Effective transport coefficient s, 1/mm.
    pub fn sigma_tr(&self) -> f64 {
        self.sigma_tr
    }

    /// The classical dipole of the same medium, whose shape in distance this one has roughly.
    pub fn classical(&self) -> &Classical {
        &self.classical
    }
}

/// Normal n_i* of the modified tangent plane at the entry.
#[inline]
fn tangent_plane(x: DVec3, square: f64, entry: &Entry, exit: &Exit) -> DVec3 {
    if square == 0.0 {
        return entry.normal;
    }
    let orthogonal = |v: DVec3| v - v.dot(x) / square * x;
    let normal = orthogonal(entry.normal);
    let length = normal.length();
    if length > PARALLEL {
        normal / length
    } else {
        tangent_plane_below(x, orthogonal(-entry.dir), exit)
    }
}

/// n_i* where x is parallel to n_i; `against` is what of -w12 is orthogonal to x.
#[cold]
fn tangent_plane_below(x: DVec3, against: DVec3, exit: &Exit) -> DVec3 {
    let axis = x.normalize();
    for candidate in [against, axis.cross(exit.normal)] {
        let length = candidate.length();
        if length > PARALLEL {
            return candidate / length;
        }
    }
    Frame::about(axis).to_world(DVec3::X)
}
