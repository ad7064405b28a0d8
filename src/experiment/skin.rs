//! Words for skin by its constituents.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::optics::skin::Skin;

/// Volume fractions, and the mean cosine of the phase function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkinFractions {
    /// Melanosomes: about 0.01 in light skin, 0.4 in dark.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub melanin: f64,
    /// Eumelanin of all melanin.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub eumelanin_share: f64,
    /// Blood: about 0.002 to 0.07.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub blood: f64,
    /// Oxygenated haemoglobin of all: about 0.7.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub oxygenation: f64,
    /// Mean cosine; sigma_s = sigma_s' / (1 - g). Without it g = 0 and sigma_s = sigma_s'.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 1))]
    pub g: Option<f64>,
}

impl From<&SkinFractions> for Skin {
    fn from(words: &SkinFractions) -> Skin {
        let SkinFractions { melanin, eumelanin_share, blood, oxygenation, .. } = *words;
        Skin { melanin, eumelanin_share, blood, oxygenation }
    }
}
