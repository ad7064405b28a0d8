//! The samplers that come with the program: one line each, and their options in a file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::estimators::read;
use super::registry::SamplerEntry;
use crate::samplers::phase::HenyeyGreensteinSampler;

/// Every sampler of this crate.
pub fn builtin() -> Vec<SamplerEntry> {
    vec![SamplerEntry {
        kind: "henyey_greenstein",
        doc: "directions of the Henyey-Greenstein phase function",
        options_schema: || schemars::schema_for!(HenyeyGreensteinOptions),
        build: |options| {
            let HenyeyGreensteinOptions { g } = read(options)?;
            Ok(Box::new(HenyeyGreensteinSampler::new(g)))
        },
    }]
}

/// Options of `henyey_greenstein`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HenyeyGreensteinOptions {
    /// Mean cosine.
    #[schemars(range(min = -0.9999, max = 0.9999))]
    pub g: f64,
}
