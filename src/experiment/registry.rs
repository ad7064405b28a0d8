//! The estimators and samplers that a program knows by name.

use std::sync::Arc;

use schemars::Schema;
use serde_json::Value as Json;

use super::validate::grammar;
use crate::error::Result;
use crate::estimators::Estimator;
use crate::samplers::Sampler;
use crate::scene::Scene;

/// What an estimator of one's own derives its options with: these very versions, under
/// `#[serde(crate = "scatterproof::experiment::registry::serde")]`.
pub use {schemars, serde, serde_json};

/// How a registered estimator is built from its options and a scene.
pub type Build = fn(&Json, Arc<Scene>) -> Result<Box<dyn Estimator>>;

/// The estimators and samplers that an experiment file may name.
#[derive(Clone, Debug, Default)]
pub struct Registry {
    /// One entry a kind of estimator, in the order in which they are listed.
    pub entries: Vec<RegistryEntry>,
    /// One entry a kind of sampler, in the order in which they are listed.
    pub samplers: Vec<SamplerEntry>,
}

/// One kind of sampler.
#[derive(Clone, Copy, Debug)]
pub struct SamplerEntry {
    /// The name under which a `[[sampler]]` asks for it.
    pub kind: &'static str,
    /// What it draws, in one line.
    pub doc: &'static str,
    /// The schema of its options, as [`RegistryEntry::options_schema`].
    pub options_schema: fn() -> Schema,
    /// Builds it from its validated options.
    pub build: fn(&Json) -> Result<Box<dyn Sampler>>,
}

/// One kind of estimator.
#[derive(Clone, Copy, Debug)]
pub struct RegistryEntry {
    /// The name under which an `[[estimator]]` asks for it.
    pub kind: &'static str,
    /// What it does, in one line.
    pub doc: &'static str,
    /// The schema of its options, `|| schemars::schema_for!(Options)`; options must refuse unknown
    /// keys and keep to the keywords that validation understands.
    pub options_schema: fn() -> Schema,
    /// Builds it from its validated options and a scene.
    pub build: Build,
}

impl Registry {
    /// The entry of a kind.
    pub fn get(&self, kind: &str) -> Option<&RegistryEntry> {
        self.entries.iter().find(|entry| entry.kind == kind)
    }

    /// The names of all kinds.
    pub fn kinds(&self) -> Vec<&'static str> {
        self.entries.iter().map(|entry| entry.kind).collect()
    }
}

impl RegistryEntry {
    /// The schema of its options as JSON, with its own definitions beside it.
    pub fn options(&self) -> Json {
        (self.options_schema)().to_value()
    }

    /// Its options with the first line of their documentation.
    pub fn option_docs(&self) -> Vec<(String, String)> {
        option_docs(&self.options())
    }
}

impl SamplerEntry {
    /// The schema of its options as JSON, with its own definitions beside it.
    pub fn options(&self) -> Json {
        (self.options_schema)().to_value()
    }

    /// Its options with the first line of their documentation.
    pub fn option_docs(&self) -> Vec<(String, String)> {
        option_docs(&self.options())
    }
}

fn option_docs(options: &Json) -> Vec<(String, String)> {
    let keys = grammar::keys(options).into_iter();
    keys.map(|key| (key.to_string(), grammar::doc(&options["properties"][key]).to_string())).collect()
}
