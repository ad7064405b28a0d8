//! Normalized diffusion: Christensen & Burley 2015, "Approximate reflectance profiles for efficient
//! subsurface scattering" (Pixar technical memo 15-04); a fit to Monte Carlo results of all light that
//! emerges.
//!
//!   R(r) = A s (e^(-s r/l) + e^(-s r/(3l))) / (8 pi l r),
//! whose integral over the plane is A, the surface's albedo, for any shape s:
//!   s = 1.85 - A + 7 |A - 0.8|^3    searchlight along the normal, l = mean free path 1/sigma_t' (eq. 6)
//!   s = 1.9 - A + 3.5 (A - 0.8)^2   diffuse light, the same l (eq. 7)
//!   s = 3.5 + 100 (A - 0.33)^4      l = diffuse mean free path 1/sigma_tr (eq. 8)
//!
//! Reciprocal, never negative, infinite at r = 0.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::{Lanewise, NEAR, exp, exp_near};

/// Published fit that scales the profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scaling {
    /// A beam along the normal; lengths in mean free paths.
    #[default]
    Searchlight,
    /// Diffuse light; lengths in mean free paths.
    Diffuse,
    /// Lengths in diffuse mean free paths, for media that absorb.
    DiffuseMeanFreePath,
}

impl std::fmt::Display for Scaling {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Scaling::Searchlight => "searchlight",
            Scaling::Diffuse => "diffuse light",
            Scaling::DiffuseMeanFreePath => "diffuse mean free path",
        })
    }
}

impl Scaling {
    /// s for the surface's albedo.
    pub fn shape(self, albedo: f64) -> f64 {
        let x = albedo - 0.8;
        match self {
            Scaling::Searchlight => 1.85 - albedo + 7.0 * x.abs() * x * x,
            Scaling::Diffuse => 1.9 - albedo + 3.5 * x * x,
            Scaling::DiffuseMeanFreePath => {
                let square = (albedo - 0.33) * (albedo - 0.33);
                3.5 + 100.0 * square * square
            }
        }
    }
}

/// The profile of normalized diffusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalized {
    d: f64,
    /// A / (8 pi d).
    strength: f64,
    total: f64,
}

impl Normalized {
    /// With albedo A and the length l that belongs to the scaling, mm.
    pub fn new(scaling: Scaling, albedo: f64, length: f64) -> Normalized {
        let d = length / scaling.shape(albedo);
        Normalized { d, strength: albedo / (8.0 * PI * d), total: albedo }
    }

    /// Exitance R(r) per unit flux, 1/mm^2.
    #[inline]
    pub fn exitance(&self, r: f64) -> f64 {
        self.exitance_by(exp, r)
    }

    #[inline(always)]
    fn exitance_by(&self, exp: impl Fn(f64) -> f64, r: f64) -> f64 {
        let slow = exp(-r / (3.0 * self.d));
        self.strength * (slow * slow * slow + slow) / r
    }

    /// R over the plane: A.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// l / s, mm: the shorter of its two exponential lengths.
    pub fn d(&self) -> f64 {
        self.d
    }
}

impl Lanewise for Normalized {
    fn at(&self, r: f64) -> f64 {
        self.exitance(r)
    }

    #[inline(always)]
    fn near(&self, r: f64) -> f64 {
        self.exitance_by(exp_near, r)
    }

    fn reach(&self) -> f64 {
        3.0 * self.d * NEAR
    }
}
