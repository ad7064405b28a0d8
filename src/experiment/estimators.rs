//! The estimators that come with the program: their options in a file, and how each is built.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::point_cloud::PointCloudWords;
use super::registry::{Registry, RegistryEntry};
use super::snee::SneeWords;
use crate::error::{Error, Result};
use crate::estimators::light_trace::LightTracer;
use crate::estimators::path::{PathTracer, Roulette};
use crate::estimators::point_cloud::PointCloud;
use crate::estimators::snee::{Bidirectional, Snee, TwoBounce};
use crate::scene::{Scene, Sensor};

/// Every estimator and sampler of this crate; a program of one's own may push its entries on top.
pub fn builtin() -> Registry {
    Registry {
        samplers: super::samplers::builtin(),
        entries: vec![
            PATH,
            SNEE,
            TWO_BOUNCE,
            BIDIRECTIONAL,
            LIGHT_TRACE,
            POINT_CLOUD,
            super::bssrdf_probe::BSSRDF_PROBE,
            super::bssrdf_probe::BSSRDF_RAYS,
            super::bssrdf_probe::BSSRDF_DENSITY,
        ],
    }
}

const PATH: RegistryEntry = RegistryEntry {
    kind: "path",
    doc: "unidirectional path tracing with MIS between BSDF and light sampling; unbiased",
    options_schema: || schemars::schema_for!(PathOptions),
    build: |options, scene| {
        let options: PathOptions = read(options)?;
        looks_from_outside("path", &scene)?;
        Ok(Box::new(PathTracer::new(scene, options.roulette.into())))
    },
};

const SNEE: RegistryEntry = RegistryEntry {
    kind: "snee",
    doc: "path tracing with subdivision next-event estimation, as published or guided; unbiased",
    options_schema: || schemars::schema_for!(SneeWords),
    build: |options, scene| {
        let words: SneeWords = read(options)?;
        looks_from_outside("snee", &scene)?;
        knows_no_entries("snee", &scene)?;
        Ok(Box::new(Snee::new(scene, words.options()?)?))
    },
};

const TWO_BOUNCE: RegistryEntry = RegistryEntry {
    kind: "two_bounce",
    doc: "the last two segments alone, from a medium vertex, by snee's techniques; unbiased",
    options_schema: || schemars::schema_for!(SneeWords),
    build: |options, scene| {
        let words: SneeWords = read(options)?;
        Ok(Box::new(TwoBounce::new(scene, words.options()?)?))
    },
};

const BIDIRECTIONAL: RegistryEntry = RegistryEntry {
    kind: "bidirectional",
    doc: "path tracing whose medium vertices connect to one light vertex inside the body; unbiased",
    options_schema: || schemars::schema_for!(PathOptions),
    build: |options, scene| {
        let options: PathOptions = read(options)?;
        looks_from_outside("bidirectional", &scene)?;
        knows_no_entries("bidirectional", &scene)?;
        Ok(Box::new(Bidirectional::new(scene, options.roulette.into())?))
    },
};

const LIGHT_TRACE: RegistryEntry = RegistryEntry {
    kind: "light_trace",
    doc: "analog tracing from the lights, into `flux`, `rings` or `acceptance_sr`; unbiased at true normals",
    options_schema: || schemars::schema_for!(LightTraceOptions),
    build: |options, scene| {
        let options: LightTraceOptions = read(options)?;
        Ok(Box::new(LightTracer::new(scene, options.paths)?))
    },
};

const POINT_CLOUD: RegistryEntry = RegistryEntry {
    kind: "point_cloud",
    doc: "a BSSRDF summed over points of the surface, accepted by distance; unbiased for the model",
    options_schema: || schemars::schema_for!(PointCloudWords),
    build: |options, scene| {
        let words: PointCloudWords = read(options)?;
        looks_from_outside("point_cloud", &scene)?;
        Ok(Box::new(PointCloud::new(scene, (&words).into())?))
    },
};

/// Whole paths start outside the body.
pub fn looks_from_outside(kind: &str, scene: &Scene) -> Result<()> {
    match scene.sensor {
        Sensor::Vertex { .. } => Err(Error::input_help(
            format!("{kind} starts its paths outside the body, the sensor `vertex` stands inside"),
            "use two_bounce, or another sensor",
        )),
        _ => Ok(()),
    }
}

/// Rings count light by where it came in, which connections here do not keep.
fn knows_no_entries(kind: &str, scene: &Scene) -> Result<()> {
    match scene.sensor {
        Sensor::Rings(_) => Err(Error::input_help(
            format!("{kind} does not keep where light came in, by which the sensor `rings` counts"),
            "use light_trace, path, bssrdf_probe or bssrdf_rays, or the sensor `flux`",
        )),
        _ => Ok(()),
    }
}

/// Options of `path` and `bidirectional`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PathOptions {
    /// When a path is ended by chance; both ways are unbiased.
    #[serde(default)]
    pub roulette: RouletteOption,
}

/// Options of `light_trace`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightTraceOptions {
    /// Photons whose sum is one pass; without it as many as the sensor has rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1073741824))]
    pub paths: Option<usize>,
}

/// Russian roulette.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RouletteOption {
    /// At every scattering event with probability 1 - albedo.
    Analog {},
    /// Only where the path's weight has fallen below this.
    Below(#[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))] f64),
}

impl Default for RouletteOption {
    fn default() -> Self {
        RouletteOption::Below(0.25)
    }
}

impl From<RouletteOption> for Roulette {
    fn from(option: RouletteOption) -> Roulette {
        match option {
            RouletteOption::Analog {} => Roulette::Analog,
            RouletteOption::Below(threshold) => Roulette::Below(threshold),
        }
    }
}

/// Options from their validated JSON.
pub fn read<T: for<'a> Deserialize<'a>>(options: &Json) -> Result<T> {
    serde_json::from_value(options.clone())
        .map_err(|error| Error::input(format!("estimator options: {error}")))
}
