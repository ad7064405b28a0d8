//! Words for `[[claim]]`: what must hold. Claims of efficiency are in [`super::duel`].

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::duel::{Faster, NotSlower};
use crate::results::record::InvalidReason;

/// One claim: exactly one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["equals"] }, { "required": ["agree"] }, { "required": ["differs"] }, { "required": ["mean_path_length"] }, { "required": ["reproduces"] }, { "required": ["faster"] }, { "required": ["not_slower"] }, { "required": ["sampler"] }]))]
pub struct ClaimEntry {
    /// Label in verdict tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The outcome that makes the claim green, where it is not a pass (controls).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expect: Option<Expect>,
    /// The reason for which a control expects its test to be invalid; any other reason makes it fail.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub because: Option<InvalidReason>,
    /// A quantity equals a known value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equals: Option<Equals>,
    /// Two measurements of one integral agree.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub agree: Option<Agree>,
    /// Two measurements do not agree (a control): the difference must be found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub differs: Option<Differs>,
    /// The mean path length is 4 eta^2 V / S.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_path_length: Option<MeanPathLength>,
    /// The record is reproduced bit for bit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reproduces: Option<Reproduces>,
    /// An estimator is more efficient than another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub faster: Option<Faster>,
    /// An estimator is not much less efficient than another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_slower: Option<NotSlower>,
    /// Samplers draw from the densities that they claim.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampler: Option<SamplerClaim>,
}

impl ClaimEntry {
    /// The key of its kind.
    pub(crate) fn kind(&self) -> &'static str {
        let kinds = [
            ("equals", self.equals.is_some()),
            ("agree", self.agree.is_some()),
            ("differs", self.differs.is_some()),
            ("mean_path_length", self.mean_path_length.is_some()),
            ("reproduces", self.reproduces.is_some()),
            ("faster", self.faster.is_some()),
            ("not_slower", self.not_slower.is_some()),
        ];
        kinds.into_iter().find(|(_, is_there)| *is_there).map_or("sampler", |(kind, _)| kind)
    }

    /// The comparison of efficiencies that the claim makes, if it makes one.
    pub fn duel(&self) -> Option<Faster> {
        let not_slower = || self.not_slower.as_ref().map(Faster::from);
        self.faster.clone().or_else(not_slower)
    }
}

/// Samplers draw from the densities that they claim: counts by bin, consecutive draws, directed
/// contrasts, discrete outcomes, and the identities between draws and densities.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SamplerClaim {
    /// Their names; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub samplers: Option<Vec<String>>,
    /// The largest relative error of the density, of the same size in all coarse bins, that may go undetected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect: Option<f64>,
    /// The same for fine bins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect_fine: Option<f64>,
    /// The same for bins of pairs of consecutive draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect_serial: Option<f64>,
}

/// Outcomes that controls expect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Expect {
    /// The test must find a difference.
    Differs,
    /// The claim must be found not to hold.
    Fails,
    /// The test must be refused as statistically invalid, for the reason stated by `because`.
    Invalid,
}

/// A quantity equals a known value in every cell and band: `value` and `error`, or the `column`
/// (and `error_column`) of the row that the cell took from a CSV sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["value"] }, { "required": ["column"] }]))]
pub struct Equals {
    /// The estimator; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimator: Option<String>,
    /// The observable; the sensor's first by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observable: Option<String>,
    /// The transport class; `all` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// Expected value of the quantity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Its stated standard error; exact by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub error: Option<f64>,
    /// Column of the expected value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Column of its stated error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error_column: Option<String>,
    /// Where the expected value comes from.
    pub source: String,
    /// The largest relative defect that may go unseen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect: Option<f64>,
    /// The band; every band by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub band: Option<String>,
    /// Only cells with these labels: axis -> label.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub only: BTreeMap<String, String>,
}

/// In a sky of equal radiance L, with scattering but no absorption, and a boundary that loses nothing, the
/// mean of `path_length` is 4 eta^2 V / S times L and that of `incident` is L, whatever the shape, the
/// medium and the phase function; V is the volume of the body, or of the sensor's ball, and S the body's surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeanPathLength {
    /// The estimators; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub estimators: Option<Vec<String>>,
    /// The largest relative defect of either mean that may go unseen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect: Option<f64>,
    /// The band; every band by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub band: Option<String>,
    /// Only cells with these labels: axis -> label.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub only: BTreeMap<String, String>,
}

/// Estimators differ in every cell, or cells that differ only `across` one axis do, and the test finds the
/// difference: a negative control.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Differs {
    /// The estimators: two or more, or one with `across`.
    #[schemars(length(min = 1))]
    pub estimators: Vec<String>,
    /// Axis of the sweep whose cells must differ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub across: Option<String>,
    /// The observable; the sensor's first by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observable: Option<String>,
    /// The transport class; `all` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// The band; every band by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub band: Option<String>,
    /// Only cells with these labels: axis -> label.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub only: BTreeMap<String, String>,
}

/// The first passes of every measurement, run again by one thread in blocks of another size, give the
/// same bits; and, where a checksum is stated, the record's numbers are those.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reproduces {
    /// Passes that are run again, rounded up to whole batches.
    #[schemars(range(min = 1, max = 1099511627776u64))]
    pub passes: u64,
    /// blake3 over the record's arrays, hex, as `summary.json` states it (`numbers`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub numbers: Option<String>,
}

/// Estimators agree in every cell, or cells that differ only `across` one axis agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Agree {
    /// The estimators: two or more, or one with `across`.
    #[schemars(length(min = 1))]
    pub estimators: Vec<String>,
    /// Axis of the sweep whose cells must agree.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub across: Option<String>,
    /// The observable, or `each`; the sensor's first by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observable: Option<String>,
    /// The transport class, or `each` (all of them and their sum); `all` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// The largest relative difference that may go unseen.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub detect: f64,
    /// The band; every band by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub band: Option<String>,
    /// Only cells with these labels: axis -> label.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub only: BTreeMap<String, String>,
}
