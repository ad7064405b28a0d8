//! Pictures beside those of every run: what `[[picture]]` may say.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::results::pictures;

/// One picture: exactly one kind. Pictures are views of a record and change none of its bits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["split"] }]))]
pub struct PictureEntry {
    /// Two estimators side by side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<Split>,
}

/// A grid of pictures, a picture a cell of the sweep: its left half by one estimator, its right half by
/// another, shown alike. The caption says what CPU time each half took. Axes that are neither rows nor
/// columns give one grid per label.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// The estimator of the left halves.
    pub left: String,
    /// The estimator of the right halves.
    pub right: String,
    /// The axis of the sweep whose labels are the rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<String>,
    /// The axis of the sweep whose labels are the columns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<String>,
    /// Stops by which all pictures of the grid are brightened; without it each picture has a white of its
    /// own, the same for both halves: the 95th percentile of the half with less noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure_stops: Option<f64>,
}

/// What the results folder keeps of the pictures that a file asks for.
pub fn wanted(entries: &[PictureEntry]) -> Vec<pictures::Split> {
    let split = |entry: &PictureEntry| {
        entry.split.as_ref().map(|words| pictures::Split {
            left: words.left.clone(),
            right: words.right.clone(),
            rows: words.rows.clone(),
            columns: words.columns.clone(),
            exposure_stops: words.exposure_stops,
        })
    };
    entries.iter().filter_map(split).collect()
}
