//! Points of a plane by the radial profiles of subsurface scattering.

use schemars::JsonSchema;
use serde::Deserialize;

use super::chart::{Charted, PlaneChart, PolarPoint, Technique};
use super::distance::end;
use super::kind::{SamplerKind, sampler_kind};
use super::sampler::Contrast;
use crate::math::exp;
use crate::sampling::radial::{Dipole, Radial};
use crate::sampling::stream::Stream;

/// `radial` in experiment files.
pub const KIND: SamplerKind = sampler_kind!(
    "radial",
    "points of a plane by a BSSRDF's radial profile",
    RadialOptions => |o| {
        let profile = Radial::from(o);
        Ok(Charted::new(profile, chart(profile)))
    }
);

/// Options of `radial`: the profile.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum RadialOptions {
    /// Exponential radius.
    Exponential {
        /// Rate of the exponential, 1/mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        sigma_per_mm: f64,
    },
    /// A Gaussian of the plane.
    Gaussian {
        /// Variance along each axis, mm^2.
        #[schemars(extend("exclusiveMinimum" = 0))]
        variance_mm2: f64,
        /// Radius of the disc that it is cut to; left out, it is not.
        #[schemars(extend("exclusiveMinimum" = 0))]
        r_max_mm: Option<f64>,
    },
    /// Normalized diffusion (Christensen & Burley 2015).
    NormalizedDiffusion {
        /// Parameter d of the profile, mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        d_mm: f64,
    },
    /// The classical dipole (Jensen et al. 2001).
    Dipole {
        /// Effective transport coefficient.
        #[schemars(range(min = 0.0))]
        sigma_tr_per_mm: f64,
        /// Depth of the real source.
        #[schemars(extend("exclusiveMinimum" = 0))]
        z_real_mm: f64,
        /// Height of the virtual source.
        #[schemars(extend("exclusiveMinimum" = 0))]
        z_virtual_mm: f64,
    },
}

impl From<RadialOptions> for Radial {
    fn from(profile: RadialOptions) -> Radial {
        match profile {
            RadialOptions::Exponential { sigma_per_mm: sigma } => Radial::Exponential { sigma },
            RadialOptions::Gaussian { variance_mm2: variance, r_max_mm } => {
                Radial::Gaussian { variance, r_max: end(r_max_mm) }
            }
            RadialOptions::NormalizedDiffusion { d_mm: d } => Radial::NormalizedDiffusion { d },
            RadialOptions::Dipole {
                sigma_tr_per_mm: sigma_tr,
                z_real_mm: z_real,
                z_virtual_mm: z_virtual,
            } => Radial::Dipole(Dipole { sigma_tr, z_real, z_virtual }),
        }
    }
}

/// A chart of the profile's own size.
fn chart(profile: Radial) -> PlaneChart {
    match profile {
        Radial::Exponential { sigma } => PlaneChart::Plane(1.0 / sigma),
        Radial::Gaussian { r_max, .. } if r_max.is_finite() => PlaneChart::Disc(r_max),
        Radial::Gaussian { variance, .. } => PlaneChart::Plane(variance.sqrt()),
        Radial::NormalizedDiffusion { d } => PlaneChart::Plane(2.0 * d),
        // A strongly absorbing layer narrows the profile from z to sqrt(z / sigma_tr).
        Radial::Dipole(Dipole { sigma_tr, z_real, .. }) => {
            PlaneChart::Plane(z_real / (1.0 + sigma_tr * z_real).sqrt())
        }
    }
}

impl Technique<PlaneChart> for Radial {
    fn sample(&self, stream: &mut Stream) -> (PolarPoint, Option<f64>) {
        let point = PolarPoint::of(self.sample(stream.draw2()));
        (point, Some(self.pdf_area(point.r)))
    }

    fn pdf(&self, PolarPoint { r, .. }: PolarPoint) -> f64 {
        self.pdf_area(r)
    }

    fn contrasts(&self, chart: &PlaneChart) -> Vec<Contrast> {
        let (expected, decay) = decay(*self);
        let chart = *chart;
        let mean = move |[x, _]: [f64; 2]| chart.at(x).map_or(0.0, |(r, _)| decay(r));
        vec![Contrast::of("mean decay", expected, mean), Contrast::azimuth()]
    }
}

/// A bounded function of r whose mean is known: of the radius of the exponential e^(-sigma r), 1/2; of
/// the Gaussian e^(-r^2/2v), 1/2 over the plane; of normalized diffusion e^(-r/d), with a quarter
/// Exp(d) and three quarters Exp(3d): 1/4 * 1/2 + 3/4 * 1/4 = 5/16.
fn decay(profile: Radial) -> (Option<f64>, Box<dyn Fn(f64) -> f64 + Send + Sync>) {
    match profile {
        Radial::Exponential { sigma } => (Some(0.5), Box::new(move |r| exp(-sigma * r))),
        Radial::Gaussian { variance, r_max } => {
            let known = r_max.is_infinite().then_some(0.5);
            (known, Box::new(move |r| exp(-r * r / (2.0 * variance))))
        }
        Radial::NormalizedDiffusion { d } => (Some(5.0 / 16.0), Box::new(move |r| exp(-r / d))),
        Radial::Dipole(Dipole { z_real, .. }) => (None, Box::new(move |r| z_real / (r + z_real))),
    }
}
