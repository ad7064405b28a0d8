//! The kinds of estimators and samplers that an experiment file may name.

use serde_json::Value as Json;

use super::validate::grammar;
use crate::estimators::{self, EstimatorKind};
use crate::samplers::{self, SamplerKind};

/// What an estimator of your own derives its options with: these very versions, under
/// `#[serde(crate = "scatterproof::experiment::registry::serde")]`.
pub use {schemars, serde, serde_json};

/// The kinds of estimators and samplers that an experiment file may name.
#[derive(Clone, Debug, Default)]
pub struct Registry {
    /// The kinds of estimators, in the order in which they are listed.
    pub estimators: Vec<EstimatorKind>,
    /// The kinds of samplers, in the order in which they are listed.
    pub samplers: Vec<SamplerKind>,
}

impl Registry {
    /// Every estimator and sampler of this crate; a program of your own may push its kinds on top.
    pub fn builtin() -> Registry {
        Registry { estimators: estimators::KINDS.to_vec(), samplers: samplers::KINDS.to_vec() }
    }

    /// The kind of estimator of a name.
    pub fn get(&self, kind: &str) -> Option<&EstimatorKind> {
        self.estimators.iter().find(|known| known.kind == kind)
    }
}

/// Options, by the schema of their type, with the first line of their documentation.
pub fn option_docs(options: &Json) -> Vec<(String, String)> {
    let keys = grammar::keys(options).into_iter();
    keys.map(|key| (key.to_string(), grammar::doc(&options["properties"][key]).to_string())).collect()
}
