//! Words for the estimators that integrate a BSSRDF without a point cloud.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bssrdf::ModelWords;
use super::estimators::{looks_from_outside, read};
use super::registry::RegistryEntry;
use crate::estimators::bssrdf_density::{BssrdfDensity, DensityOptions};
use crate::estimators::bssrdf_probe::{BssrdfProbe, ProbeOptions};
use crate::estimators::bssrdf_rays::{BssrdfRays, RayOptions};

/// `bssrdf_probe`.
pub const BSSRDF_PROBE: RegistryEntry = RegistryEntry {
    kind: "bssrdf_probe",
    doc: "a BSSRDF integrated by lines through the body near the exit; unbiased for the model without `reach_mm`",
    options_schema: || schemars::schema_for!(BssrdfProbeWords),
    build: |options, scene| {
        let words: BssrdfProbeWords = read(options)?;
        looks_from_outside("bssrdf_probe", &scene)?;
        Ok(Box::new(BssrdfProbe::new(scene, &words.options())?))
    },
};

/// `bssrdf_rays`.
pub const BSSRDF_RAYS: RegistryEntry = RegistryEntry {
    kind: "bssrdf_rays",
    doc: "a BSSRDF integrated by rays from under the exit; unbiased for the model in convex bodies",
    options_schema: || schemars::schema_for!(BssrdfRaysWords),
    build: |options, scene| {
        let words: BssrdfRaysWords = read(options)?;
        looks_from_outside("bssrdf_rays", &scene)?;
        Ok(Box::new(BssrdfRays::new(scene, &words.options())?))
    },
};

/// `bssrdf_density`.
pub const BSSRDF_DENSITY: RegistryEntry = RegistryEntry {
    kind: "bssrdf_density",
    doc: "a BSSRDF summed over points whose irradiance is a density of flux; biased, unbiased without `radius_mm`",
    options_schema: || schemars::schema_for!(BssrdfDensityWords),
    build: |options, scene| {
        let words: BssrdfDensityWords = read(options)?;
        looks_from_outside("bssrdf_density", &scene)?;
        Ok(Box::new(BssrdfDensity::new(scene, &words.options())?))
    },
};

/// Options of `bssrdf_probe`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BssrdfProbeWords {
    /// The model.
    pub model: ModelWords,
    /// Lines per refraction of a camera path.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 65536))]
    pub probes: usize,
    /// Whether the single-scattering term is added; without it where the model leaves single scattering out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub single: Option<bool>,
    /// Whether light that goes straight through the body is followed.
    #[serde(default = "yes")]
    pub straight: bool,
    /// Light that enters farther from the exit is left out, mm; biased. Without it none is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reach_mm: Option<f64>,
}

/// Options of `bssrdf_rays`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BssrdfRaysWords {
    /// The model.
    pub model: ModelWords,
    /// Rays per refraction of a camera path.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 65536))]
    pub rays: usize,
    /// How far under the exit the rays start, mm; without it the reduced mean free path.
    ///
    /// At most half way to the opposite side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub depth_mm: Option<f64>,
    /// Whether the single-scattering term is added; without it where the model leaves single scattering out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub single: Option<bool>,
    /// Whether light that goes straight through the body is followed.
    #[serde(default = "yes")]
    pub straight: bool,
}

/// Options of `bssrdf_density`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BssrdfDensityWords {
    /// The model; one that needs no directions.
    pub model: ModelWords,
    /// Points of the surface per pass.
    #[schemars(range(min = 2, max = 16777216))]
    pub samples: usize,
    /// Radius of the discs over which irradiance is averaged, mm; biased. Without it each point has its own alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius_mm: Option<f64>,
    /// Whether the single-scattering term is added; without it where the model leaves single scattering out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub single: Option<bool>,
    /// Whether light that goes straight through the body is followed.
    #[serde(default = "yes")]
    pub straight: bool,
}

fn one() -> usize {
    1
}

fn yes() -> bool {
    true
}

impl BssrdfProbeWords {
    fn options(&self) -> ProbeOptions {
        ProbeOptions {
            model: (&self.model).into(),
            probes: self.probes,
            single: self.single,
            straight: self.straight,
            reach: self.reach_mm,
        }
    }
}

impl BssrdfRaysWords {
    fn options(&self) -> RayOptions {
        RayOptions {
            model: (&self.model).into(),
            rays: self.rays,
            depth: self.depth_mm,
            single: self.single,
            straight: self.straight,
        }
    }
}

impl BssrdfDensityWords {
    fn options(&self) -> DensityOptions {
        DensityOptions {
            model: (&self.model).into(),
            samples: self.samples,
            radius: self.radius_mm,
            single: self.single,
            straight: self.straight,
        }
    }
}
