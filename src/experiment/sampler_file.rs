//! What an experiment on samplers may say. As in `schema`, the types are the single source of what
//! `scatterproof schema` prints and of what validation walks.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::resolved;
use super::schema::Expect;

/// An experiment that holds samplers against the densities they claim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SamplerFile {
    /// Name of the experiment and of its folder under `results/`: letters, digits, `-`, `_`.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"))]
    pub name: String,
    /// What the experiment shows, for reports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// A text that enters the name of every stream, as `verify --fresh-seed` sets it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fresh: Option<String>,
    /// Draws per sampler.
    #[schemars(range(min = 1000, max = 10000000000u64))]
    pub samples: u64,
    /// The samplers.
    #[schemars(length(min = 1))]
    pub sampler: Vec<SamplerEntry>,
    /// What must hold.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub claim: Vec<SamplerClaimEntry>,
    /// Named sets of overrides, chosen by `--setting NAME`: dotted key -> value. Tables in braces are
    /// values, others only group keys.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub setting: BTreeMap<String, BTreeMap<String, Value>>,
}

/// One sampler: a unique `name` and exactly one kind with its options, as
/// `henyey_greenstein = { g = 0.9 }`. The kinds are those that the program registers (`scatterproof list`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SamplerEntry {
    /// Name in tables and claims, unique.
    #[schemars(length(min = 1))]
    pub name: String,
    /// The kind and its options.
    #[serde(flatten)]
    pub kind: BTreeMap<String, Value>,
}

/// One claim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SamplerClaimEntry {
    /// Label in verdict tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The outcome that makes the claim green, where it is not a pass (controls).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expect: Option<Expect>,
    /// Samplers draw from the densities that they claim.
    pub sampler: SamplerClaim,
}

/// Samplers draw from the densities that they claim: cell counts, consecutive draws, directed contrasts,
/// discrete outcomes, and the identities between draws and densities.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SamplerClaim {
    /// Their names; all of them without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub samplers: Option<Vec<String>>,
    /// The largest relative error of the density, of one size in all coarse cells, that may go unseen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect: Option<f64>,
}

/// A validated experiment on samplers.
#[derive(Clone, Debug, PartialEq)]
pub struct SamplerExperiment {
    /// The file that it was read from.
    pub path: PathBuf,
    /// What it says, overrides applied.
    pub file: SamplerFile,
    /// The names of the settings that the file offers.
    pub settings: Vec<String>,
    /// Dotted key, value and origin of everything, sorted by key.
    pub origins: Vec<(String, String, String)>,
}

impl SamplerExperiment {
    /// The whole experiment without its claims, as a file of its own.
    pub fn resolved(&self) -> Value {
        resolved::json(&SamplerFile { claim: Vec::new(), ..self.file.clone() })
    }
}

impl SamplerEntry {
    /// Its kind and options, which validation has found to be one pair.
    pub fn choice(&self) -> Option<(&str, &Value)> {
        self.kind.iter().next().map(|(kind, options)| (kind.as_str(), options))
    }

    /// Kind and options in canonical form: what names its streams beside its name.
    pub fn content(&self) -> Value {
        json!(self.kind)
    }
}
