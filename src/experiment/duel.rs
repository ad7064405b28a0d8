//! Claims of efficiency: `faster` and `not_slower`, and what they have in common.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use crate::results::record::CostMeasure;

/// Suffix to the name of an estimator that is run a second time as a control.
pub(crate) const CONTROL: &str = " (control)";

/// In every cell and band, the candidate reaches an error at less cost than the baseline, by more than
/// `ratio`: variance times cost of the baseline over that of the candidate exceeds it. The claim must be
/// shown: the 99.9 % interval lies above `ratio`. That the means agree is tested first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Faster {
    /// The estimator that is claimed to be the more efficient one.
    pub candidate: String,
    /// Estimator that the candidate is compared with.
    pub baseline: String,
    /// The bound that the efficiency ratio must exceed.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub ratio: f64,
    /// What counts as cost.
    #[serde(default)]
    pub cost: CostMeasure,
    /// The observable; the sensor's first by default. `pixels` for the variance of a pixel, averaged
    /// over the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observable: Option<String>,
    /// The transport class; `all` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// The largest relative difference of the two means that may go unseen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect: Option<f64>,
    /// Only cells with these labels: axis -> label.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub only: BTreeMap<String, String>,
}

/// In every cell and band, the candidate is at most `margin` times as expensive as the baseline:
/// variance times cost of the candidate over that of the baseline lies below it, with all of its 99.9 %
/// interval. That the means agree is tested first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NotSlower {
    /// The estimator that is claimed not to be slower.
    pub candidate: String,
    /// Estimator that the candidate is compared with.
    pub baseline: String,
    /// The bound that the ratio of inverse efficiencies must stay below.
    #[serde(default = "tenth_more")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub margin: f64,
    /// What counts as cost.
    #[serde(default)]
    pub cost: CostMeasure,
    /// The observable; the sensor's first by default. `pixels` for the variance of a pixel, averaged
    /// over the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observable: Option<String>,
    /// The transport class; `all` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// The largest relative difference of the two means that may go unseen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect: Option<f64>,
    /// Only cells with these labels: axis -> label.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub only: BTreeMap<String, String>,
}

fn one() -> f64 {
    1.0
}

fn tenth_more() -> f64 {
    1.1
}

impl From<&NotSlower> for Faster {
    /// Its ratio of inverse efficiencies stays below `margin` where the efficiency ratio exceeds 1 / `margin`.
    fn from(words: &NotSlower) -> Faster {
        let NotSlower { candidate, baseline, margin, cost, observable, class, detect, only } =
            words.clone();
        Faster { candidate, baseline, ratio: 1.0 / margin, cost, observable, class, detect, only }
    }
}
