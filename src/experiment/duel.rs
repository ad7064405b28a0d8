//! Claims of efficiency: `faster` and `not_slower`, and what they have in common.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::schema::ClaimEntry;

/// Suffix to the name of an estimator that is run a second time as a control.
pub const CONTROL: &str = " (control)";

/// Measure of an estimator's work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CostMeasure {
    /// Counts of rays, events and paths with fixed weights: the same on every machine.
    #[default]
    Counters,
    /// CPU time. The estimators are run side by side, and the baseline twice, so that what the
    /// machine adds is seen.
    Cpu,
}

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
    /// What the efficiency ratio must exceed.
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
    /// What the ratio of inverse efficiencies must stay below.
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

/// Common form of both claims: an efficiency ratio that must exceed a bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Duel<'a> {
    /// The estimator under test.
    pub candidate: &'a str,
    /// Estimator that the candidate is compared with.
    pub baseline: &'a str,
    /// What variance times cost of the baseline over that of the candidate must exceed.
    pub exceeds: f64,
    /// What counts as cost.
    pub cost: CostMeasure,
    /// Observable whose variance is compared; the sensor's first by default.
    pub observable: &'a Option<String>,
    /// Transport class whose variance is compared.
    pub class: &'a Option<String>,
    /// The largest relative difference of the two means that may go unseen.
    pub detect: Option<f64>,
    /// Cells that the claim is on: label of each axis.
    pub only: &'a BTreeMap<String, String>,
}

impl<'a> From<&'a Faster> for Duel<'a> {
    fn from(words: &'a Faster) -> Duel<'a> {
        Duel {
            candidate: &words.candidate,
            baseline: &words.baseline,
            exceeds: words.ratio,
            cost: words.cost,
            observable: &words.observable,
            class: &words.class,
            detect: words.detect,
            only: &words.only,
        }
    }
}

impl<'a> From<&'a NotSlower> for Duel<'a> {
    fn from(words: &'a NotSlower) -> Duel<'a> {
        Duel {
            candidate: &words.candidate,
            baseline: &words.baseline,
            exceeds: 1.0 / words.margin,
            cost: words.cost,
            observable: &words.observable,
            class: &words.class,
            detect: words.detect,
            only: &words.only,
        }
    }
}

impl ClaimEntry {
    /// The comparison of efficiencies that the claim makes, if it makes one.
    pub fn duel(&self) -> Option<Duel<'_>> {
        let not_slower = || self.not_slower.as_ref().map(Duel::from);
        self.faster.as_ref().map(Duel::from).or_else(not_slower)
    }
}
