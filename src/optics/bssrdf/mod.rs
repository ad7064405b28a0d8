//! Models of the light that diffuses from one point of a surface to another, for one band.
//!
//! A BSSRDF S(xi, wi, xo, wo), 1/(mm^2 sr), relates outgoing radiance to light that enters elsewhere,
//!   L(xo, wo) = int_A int_Omega S(xi, wi, xo, wo) L(xi, wi) |n_i . wi| dwi dA,
//! and all models here have the Fresnel transmittances of a smooth boundary as factors,
//!   S = T12(wi) K T21(wo).
//! The code that refracts at both ends applies the transmittances (a path that is refracted with probability
//! T21 must not be multiplied by T21 again), so this module evaluates K, the *kernel*.
//!
//! Every model except the directional dipole is reciprocal and never negative.
//!
//! - *Classical dipole.* Loses the part 2 C1(1/eta) of the exitance on the way out unless it is
//!   normalized. By the measure of its publication it leaves nothing out (its albedo counts all light), yet
//!   single scattering is added to it: see below.
//! - *Better dipole.* Normalized; leaves out single scattering. With single scattering added, it is up to a
//!   tenth above the truth.
//! - *Directional dipole.* Not reciprocal; can be negative and is clamped at 0. Its energy is not bounded: up
//!   to 1.1 of the incident energy at a high albedo, 0.1 at albedo 0. Leaves nothing out; light that passes
//!   straight through has a separate extinction coefficient.
//! - *Normalized diffusion.* Normalized: returns exactly the albedo that it is given. Leaves nothing
//!   out.
//! - *Gaussians of skin.* Normalized: returns exactly the reflectance that it is given. Leaves nothing
//!   out.
//! - *Fitted Gaussians.* Normalized: return exactly the total of their dipole, and leave out what the dipole
//!   leaves out.
//!
//! "Reciprocal" means that K is symmetric in its ends, where the coefficients are the same everywhere. The
//! normalized models have K = R / (pi (1 - 2 C1(1/eta))), so that their hemispherical exitance under T21
//! is R. The total of the classical dipole is within 0.03 of the whole diffuse reflectance of exact
//! transport, so that adding single scattering counts it twice in part. Its publication adds it nonetheless,
//! and `leaves_out_single` states this.

mod better;
mod classical;
mod directional;
mod ends;
mod fit;
mod gaussians;
mod moments;
mod normalized;
mod reduced;
#[cfg(test)]
mod tests;

pub use better::Better;
pub use classical::Classical;
pub use directional::{DirectionalDipole, DirectionalTerms};
pub use ends::{Entry, Exit};
pub use fit::{FitError, GaussianFit, MOST_TERMS, fit};
pub use gaussians::{Gaussians, SKIN, Term};
pub use moments::{FresnelMoments, MomentKind};
pub use normalized::{Normalized, Scaling};
pub use reduced::Reduced;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::of_each;
use crate::optics::medium::Medium;
use crate::sampling::radial::Radial;

/// Treatment of the flux that arrives under the boundary on its way out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outgoing {
    /// As published: radiance R / pi times T21(wo), which loses the part 2 C1(1/eta) of the exitance R.
    #[default]
    Plain,
    /// Divided by what T21 leaves of a diffuse exitance, 1 - 2 C1(1/eta), so that the exitance is R.
    Normalized,
}

/// A BSSRDF model; its coefficients are those of the object's medium and boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Model {
    /// The dipole of Jensen, Marschner, Levoy & Hanrahan 2001.
    Classical {
        /// Where the Fresnel moments come from.
        #[serde(default)]
        moments: MomentKind,
        /// Treatment of the exitance on its way out.
        #[serde(default)]
        outgoing: Outgoing,
    },
    /// The better dipole of d'Eon 2012: multiple scattering only.
    Better {
        /// Where the Fresnel moments come from.
        #[serde(default)]
        moments: MomentKind,
    },
    /// The directional dipole of Frisvad, Hachisuka & Kjeldsen 2014: not reciprocal, clamped at 0.
    Directional {
        /// Where the Fresnel moments come from.
        #[serde(default)]
        moments: MomentKind,
    },
    /// Normalized diffusion of Christensen & Burley 2015: a fit of all light.
    Normalized {
        /// Which of the published fits gives the shape.
        #[serde(default)]
        scaling: Scaling,
        /// Diffuse reflectance of light that has entered: one number, or one per band.
        ///
        /// Above 0 and at most 1. Without it that of the classical dipole with exact moments.
        #[schemars(length(min = 1))]
        albedo: Option<Vec<f64>>,
    },
    /// Six Gaussians of skin, d'Eon & Luebke 2007, for bands red, green, blue; the medium is not used.
    Skin {
        /// Diffuse reflectance of red, green and blue light that has entered, above 0 and at most 1.
        reflectance: [f64; 3],
    },
    /// A dipole's profile as a sum of Gaussians.
    Gaussians {
        /// Whose profile is fitted.
        dipole: FittedDipole,
        /// Where its Fresnel moments come from.
        #[serde(default)]
        moments: MomentKind,
        /// Number of Gaussians.
        #[serde(default = "six")]
        #[schemars(range(min = 1, max = 12))]
        terms: usize,
    },
}

fn six() -> usize {
    6
}

/// Profiles that are fitted by Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FittedDipole {
    /// Profile of the classical dipole.
    Classical,
    /// Profile of the better dipole.
    Better,
}

/// A model with the numbers of one band.
#[derive(Clone, Debug, PartialEq)]
pub struct Bssrdf {
    kernel: Kernel,
    /// Effective transport coefficient, 1/mm: how fast the far field falls. Normalized diffusion and
    /// Gaussians have none of their own: theirs is the classical dipole's, sqrt(3 sigma_a sigma_t') of
    /// the medium.
    pub sigma_tr: f64,
    /// Extinction of what goes straight through, 1/mm.
    pub straight_sigma_t: f64,
    /// Whether single scattering is left to an estimator of its own.
    pub leaves_out_single: bool,
    /// How far a fit by Gaussians is off.
    pub fit_error: Option<FitError>,
}

#[derive(Clone, Debug, PartialEq)]
enum Kernel {
    /// `scale` times R(|xo - xi|).
    Radial { profile: RadialProfile, scale: f64 },
    /// Of more than the distance.
    Directional(DirectionalDipole),
}

/// R(r), the exitance at distance r from a beam of power 1 that has entered a half-space; 1/mm^2.
#[derive(Clone, Debug, PartialEq)]
pub enum RadialProfile {
    /// Classical dipole.
    Classical(Classical),
    /// Better dipole.
    Better(Better),
    /// Normalized diffusion.
    Normalized(Normalized),
    /// A sum of Gaussians.
    Gaussians(Gaussians),
}

impl Model {
    /// The model for band `band` of `bands`, with that band's medium and index (inside over outside; 1
    /// where the boundary is matched).
    ///
    /// # Errors
    /// Why the medium does not fit the model or the bands (no scattering, no absorption), as text.
    pub fn of(&self, band: usize, bands: usize, medium: &Medium, eta: f64) -> Result<Bssrdf, String> {
        let reduced = Reduced::of(medium);
        let scatters = medium.albedo > 0.0 && reduced.albedo > 0.0;
        if !scatters && !matches!(self, Model::Skin { .. }) {
            return Err("the medium does not scatter, and a BSSRDF is of scattered light".into());
        }
        let bssrdf = |kernel: Kernel| Bssrdf {
            kernel,
            sigma_tr: reduced.sigma_tr(),
            straight_sigma_t: medium.sigma_t,
            leaves_out_single: false,
            fit_error: None,
        };
        let normalised =
            |profile, moments: &FresnelMoments| Kernel::radial(profile, Outgoing::Normalized, moments);
        match *self {
            Model::Classical { moments, outgoing } => {
                let moments = moments.of_classical(eta);
                let profile = RadialProfile::Classical(Classical::new(&reduced, &moments));
                let kernel = Kernel::radial(profile, outgoing, &moments);
                Ok(Bssrdf { leaves_out_single: true, ..bssrdf(kernel) })
            }
            Model::Better { moments } => {
                let moments = moments.of_flux(eta);
                let better = Better::new(&reduced, &moments);
                let sigma_tr = better.sigma_tr();
                let kernel = normalised(RadialProfile::Better(better), &moments);
                Ok(Bssrdf { sigma_tr, leaves_out_single: true, ..bssrdf(kernel) })
            }
            Model::Directional { moments } => {
                let directional =
                    DirectionalDipole::new(&reduced, medium.sigma_t, &moments.of_flux(eta));
                let sigma_s = medium.sigma_t * medium.albedo;
                let straight_sigma_t =
                    reduced.sigma_a + sigma_s * (1.0 - medium.phase.g * medium.phase.g);
                Ok(Bssrdf { straight_sigma_t, ..bssrdf(Kernel::Directional(directional)) })
            }
            Model::Normalized { scaling, ref albedo } => {
                let moments = FresnelMoments::exact(eta);
                let albedo = match albedo {
                    Some(given) => one_of("albedo", given, band, bands)?,
                    None => Classical::new(&reduced, &moments).total(),
                };
                let length = match scaling {
                    Scaling::Searchlight | Scaling::Diffuse => 1.0 / reduced.sigma_t,
                    Scaling::DiffuseMeanFreePath if reduced.sigma_a > 0.0 => 1.0 / reduced.sigma_tr(),
                    Scaling::DiffuseMeanFreePath => {
                        return Err(
                            "the medium does not absorb, so that it has no diffuse mean free path; use \
                                    the scaling `searchlight` or `diffuse`"
                                .into(),
                        );
                    }
                };
                let profile = RadialProfile::Normalized(Normalized::new(scaling, albedo, length));
                Ok(bssrdf(normalised(profile, &moments)))
            }
            Model::Skin { reflectance } => {
                if bands != 3 {
                    return Err(format!(
                        "the published Gaussians of skin are of three bands (red, green, blue), here are {bands}"
                    ));
                }
                let reflectance = one_of("reflectance", &reflectance, band, bands)?;
                let profile = RadialProfile::Gaussians(Gaussians::skin(band, reflectance));
                Ok(bssrdf(normalised(profile, &FresnelMoments::exact(eta))))
            }
            Model::Gaussians { dipole, moments, terms } => {
                if !(1..=MOST_TERMS).contains(&terms) {
                    return Err(format!("a fit has 1 to {MOST_TERMS} Gaussians, not {terms}"));
                }
                let length = 1.0 / reduced.sigma_t;
                let (fitted, moments) = match dipole {
                    FittedDipole::Classical => {
                        let moments = moments.of_classical(eta);
                        let classical = Classical::new(&reduced, &moments);
                        (fit(|r| classical.exitance(r), classical.total(), length, terms), moments)
                    }
                    FittedDipole::Better => {
                        let moments = moments.of_flux(eta);
                        let better = Better::new(&reduced, &moments);
                        (fit(|r| better.exitance(r), better.total(), length, terms), moments)
                    }
                };
                let kernel = normalised(RadialProfile::Gaussians(fitted.gaussians), &moments);
                Ok(Bssrdf { leaves_out_single: true, fit_error: Some(fitted.error), ..bssrdf(kernel) })
            }
        }
    }
}

/// The number of a band among one for all or one for each, which lies in (0, 1].
fn one_of(name: &str, numbers: &[f64], band: usize, bands: usize) -> Result<f64, String> {
    let number = match *numbers {
        [all] => all,
        _ if numbers.len() == bands && band < bands => numbers[band],
        _ => {
            let n = numbers.len();
            return Err(format!(
                "`{name}` has {n} numbers; give one, or one for each of the {bands} bands"
            ));
        }
    };
    if number > 0.0 && number <= 1.0 {
        Ok(number)
    } else {
        Err(format!("`{name}` is {number}; it lies above 0 and is at most 1"))
    }
}

impl MomentKind {
    /// For the classical dipole.
    fn of_classical(self, eta: f64) -> FresnelMoments {
        match self {
            MomentKind::Exact => FresnelMoments::exact(eta),
            MomentKind::Polynomial => FresnelMoments::egan_hilgeman(eta),
        }
    }

    /// For the better and the directional dipole.
    fn of_flux(self, eta: f64) -> FresnelMoments {
        match self {
            MomentKind::Exact => FresnelMoments::exact(eta),
            MomentKind::Polynomial => FresnelMoments::deon_irving(eta),
        }
    }
}

impl std::fmt::Display for Model {
    /// Name, with the choices that its source leaves open.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Model::Classical { moments, outgoing } => {
                let outgoing = match outgoing {
                    Outgoing::Plain => "as published on the way out",
                    Outgoing::Normalized => "normalized on the way out",
                };
                write!(f, "the classical dipole ({moments}, {outgoing})")
            }
            Model::Better { moments } => write!(f, "the better dipole ({moments})"),
            Model::Directional { moments } => write!(f, "the directional dipole ({moments})"),
            Model::Normalized { scaling, albedo } => {
                let albedo =
                    if albedo.is_some() { "a stated albedo" } else { "the classical dipole's albedo" };
                write!(f, "normalized diffusion ({scaling}, {albedo})")
            }
            Model::Skin { .. } => write!(f, "six Gaussians of skin"),
            Model::Gaussians { dipole, moments, terms } => {
                let dipole = match dipole {
                    FittedDipole::Classical => "classical",
                    FittedDipole::Better => "better",
                };
                write!(f, "{terms} Gaussians fitted to the {dipole} dipole ({moments})")
            }
        }
    }
}

impl Kernel {
    fn radial(profile: RadialProfile, outgoing: Outgoing, moments: &FresnelMoments) -> Kernel {
        let passed = match outgoing {
            Outgoing::Plain => 1.0,
            Outgoing::Normalized => moments.passed(),
        };
        Kernel::Radial { profile, scale: 1.0 / (std::f64::consts::PI * passed) }
    }
}

impl Bssrdf {
    /// K: the BSSRDF without the Fresnel transmittances at its two ends, 1/(mm^2 sr). Normalized
    /// diffusion's is infinite where the ends coincide.
    #[inline]
    pub fn kernel(&self, entry: &Entry, exit: &Exit) -> f64 {
        match &self.kernel {
            Kernel::Radial { profile, scale } => {
                scale * profile.exitance((exit.point - entry.point).length())
            }
            Kernel::Directional(directional) => directional.kernel(entry, exit),
        }
    }

    /// The kernels of many distances between the ends, if they depend on nothing else: the bits of [`Self::kernel`].
    pub fn kernels(&self, distances: &[f64], values: &mut [f64]) {
        let Kernel::Radial { profile, scale } = &self.kernel else {
            unreachable!("a kernel that needs directions")
        };
        profile.exitances(distances, values);
        values.iter_mut().for_each(|value| *value *= scale);
    }

    /// Whether the kernel depends on the directions at the entry, beside distance.
    pub fn needs_directions(&self) -> bool {
        match &self.kernel {
            Kernel::Radial { .. } => false,
            Kernel::Directional(_) => true,
        }
    }

    /// Ways to draw the distance between entry and exit on a plane, with their shares (which sum to 1),
    /// that together follow the kernel: exactly those of the classical dipole, of normalized diffusion
    /// and of Gaussians, nearly those of the better dipole; those of the directional dipole are of the
    /// classical shape.
    pub fn techniques(&self) -> Vec<(f64, Radial)> {
        match &self.kernel {
            Kernel::Radial { profile, .. } => profile.techniques(),
            Kernel::Directional(directional) => {
                vec![(1.0, Radial::Dipole(directional.classical().shape()))]
            }
        }
    }

    /// A non-increasing function of distance that the kernel follows, relative to its own largest value
    /// or not: what an acceptance in proportion to the kernel uses; 1/mm^2. The directional dipole's is
    /// the classical one of its medium; normalized diffusion's is infinite at 0.
    pub fn falloff(&self, r: f64) -> f64 {
        match &self.kernel {
            Kernel::Radial { profile, .. } => profile.exitance(r),
            Kernel::Directional(directional) => directional.classical().exitance(r),
        }
    }
}

impl RadialProfile {
    /// Exitance R(r) per unit flux, 1/mm^2.
    #[inline]
    pub fn exitance(&self, r: f64) -> f64 {
        match self {
            RadialProfile::Classical(classical) => classical.exitance(r),
            RadialProfile::Better(better) => better.exitance(r),
            RadialProfile::Normalized(normalized) => normalized.exitance(r),
            RadialProfile::Gaussians(gaussians) => gaussians.exitance(r),
        }
    }

    fn exitances(&self, r: &[f64], values: &mut [f64]) {
        match self {
            RadialProfile::Classical(classical) => of_each(classical, r, values),
            RadialProfile::Normalized(normalized) => of_each(normalized, r, values),
            _ => values.iter_mut().zip(r).for_each(|(value, r)| *value = self.exitance(*r)),
        }
    }

    /// R integrated over the plane.
    pub fn total(&self) -> f64 {
        match self {
            RadialProfile::Classical(classical) => classical.total(),
            RadialProfile::Better(better) => better.total(),
            RadialProfile::Normalized(normalized) => normalized.total(),
            RadialProfile::Gaussians(gaussians) => gaussians.total(),
        }
    }

    fn techniques(&self) -> Vec<(f64, Radial)> {
        match self {
            RadialProfile::Classical(classical) => vec![(1.0, Radial::Dipole(classical.shape()))],
            RadialProfile::Better(better) => better.techniques(),
            RadialProfile::Normalized(normalized) => {
                vec![(1.0, Radial::NormalizedDiffusion { d: normalized.d() })]
            }
            RadialProfile::Gaussians(gaussians) => {
                let total = gaussians.total();
                let radial = |term: &Term| {
                    (
                        term.weight / total,
                        Radial::Gaussian { variance: term.variance, r_max: f64::INFINITY },
                    )
                };
                gaussians.terms().iter().map(radial).collect()
            }
        }
    }
}
