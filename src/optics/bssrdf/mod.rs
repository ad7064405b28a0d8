//! Models of the light that diffuses from one point of a surface to another, one band.
//!
//! A BSSRDF S(xi, wi, xo, wo), 1/(mm^2 sr), makes radiance out of light that enters elsewhere,
//!   L(xo, wo) = int_A int_Omega S(xi, wi, xo, wo) L(xi, wi) |n_i . wi| dwi dA,
//! and all models here have the Fresnel transmittances of a smooth boundary as factors,
//!   S = T12(wi) K T21(wo).
//! Code that refracts at both ends has the transmittances in its hands (a path that is refracted with probability
//! T21 must not multiply by it again), so what is evaluated here is K, the *kernel*.
//!
//! | model | reciprocal | can be negative | energy | leaves out |
//! |---|---|---|---|---|
//! | classical dipole | yes | no | loses 1 - (1 - 2 C1(1/eta)) on the way out unless normalised | single scattering is counted as diffusion |

mod classical;
mod moments;

pub use classical::Classical;
pub use moments::{MomentKind, Moments};

use crate::math::DVec3;
use crate::optics::medium::Medium;
use crate::sampling::radial::Radial;

/// Where light enters the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// The point, mm.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
    /// Unit direction of travel inside, after refraction.
    pub dir: DVec3,
}

/// Where light leaves the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exit {
    /// The point, mm.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
}

/// What a model does with the flux that arrives under the boundary on its way out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outgoing {
    /// As published: radiance R / pi times T21(wo), which loses the part 2 C1(1/eta) of the exitance R.
    #[default]
    Plain,
    /// Divided by what T21 leaves of a diffuse exitance, 1 - 2 C1(1/eta), so that the exitance is R.
    Normalised,
}

/// Which model, with what its source leaves open.
#[derive(Clone, Debug, PartialEq)]
pub enum Model {
    /// Jensen, Marschner, Levoy & Hanrahan 2001.
    Classical {
        /// Whose Fresnel moments.
        moments: MomentKind,
        /// The way out.
        outgoing: Outgoing,
    },
}

/// A model with the numbers of one band.
#[derive(Clone, Debug, PartialEq)]
pub struct Bssrdf {
    kernel: Kernel,
    /// Effective transport coefficient, 1/mm: how fast the far field falls.
    pub sigma_tr: f64,
    /// Extinction of what goes straight through, 1/mm.
    pub straight_sigma_t: f64,
    /// Whether single scattering is left to an estimator of its own.
    pub leaves_out_single: bool,
}

#[derive(Clone, Debug, PartialEq)]
enum Kernel {
    /// `scale` times R(|xo - xi|).
    Radial { profile: Profile, scale: f64 },
}

/// R(r), the exitance at distance r from a beam of power 1 that has entered a half-space; 1/mm^2.
#[derive(Clone, Debug, PartialEq)]
pub enum Profile {
    /// Classical dipole.
    Classical(Classical),
}

impl Model {
    /// The model for a band's medium and index (inside over outside; 1 where the boundary is matched).
    ///
    /// # Errors
    /// What the medium lacks (scattering, absorption), in words.
    pub fn of(&self, medium: &Medium, eta: f64) -> Result<Bssrdf, String> {
        if medium.albedo <= 0.0 {
            return Err("the medium does not scatter".into());
        }
        match self {
            Model::Classical { moments, outgoing } => {
                let moments = Moments::new(*moments, eta);
                let classical = Classical::new(medium, &moments);
                Ok(Bssrdf {
                    sigma_tr: classical.sigma_tr(),
                    straight_sigma_t: medium.sigma_t,
                    leaves_out_single: true,
                    kernel: Kernel::radial(Profile::Classical(classical), *outgoing, &moments),
                })
            }
        }
    }
}

impl std::fmt::Display for Model {
    /// Its name, with what its source leaves open.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Model::Classical { moments, outgoing } => {
                write!(f, "the classical dipole ({moments:?} moments, {outgoing:?} outgoing)")
            }
        }
    }
}

impl Kernel {
    fn radial(profile: Profile, outgoing: Outgoing, moments: &Moments) -> Kernel {
        let passed = match outgoing {
            Outgoing::Plain => 1.0,
            Outgoing::Normalised => 1.0 - moments.c1_external,
        };
        Kernel::Radial { profile, scale: 1.0 / (std::f64::consts::PI * passed) }
    }
}

impl Bssrdf {
    /// K: the BSSRDF without the Fresnel transmittances at its two ends, 1/(mm^2 sr).
    #[inline]
    pub fn kernel(&self, entry: &Entry, exit: &Exit) -> f64 {
        match &self.kernel {
            Kernel::Radial { profile, scale } => {
                scale * profile.exitance((exit.point - entry.point).length())
            }
        }
    }

    /// Whether the kernel depends on the directions at the entry, beside distance.
    pub fn needs_directions(&self) -> bool {
        match &self.kernel {
            Kernel::Radial { .. } => false,
        }
    }

    /// Ways to draw the distance between entry and exit on a plane, with their shares (which sum to 1), that together
    /// follow the kernel.
    pub fn techniques(&self) -> Vec<(f64, Radial)> {
        match &self.kernel {
            Kernel::Radial { profile, .. } => profile.techniques(),
        }
    }

    /// A non-increasing function of distance that the kernel follows, relative to its own largest value or not: what an
    /// acceptance in proportion to the kernel uses; 1/mm^2.
    pub fn falloff(&self, r: f64) -> f64 {
        match &self.kernel {
            Kernel::Radial { profile, .. } => profile.exitance(r),
        }
    }
}

impl Profile {
    /// R(r), 1/mm^2.
    #[inline]
    pub fn exitance(&self, r: f64) -> f64 {
        match self {
            Profile::Classical(classical) => classical.exitance(r),
        }
    }

    /// R integrated over the plane.
    pub fn total(&self) -> f64 {
        match self {
            Profile::Classical(classical) => classical.total(),
        }
    }

    fn techniques(&self) -> Vec<(f64, Radial)> {
        match self {
            Profile::Classical(classical) => vec![(1.0, Radial::Dipole(classical.shape()))],
        }
    }
}
