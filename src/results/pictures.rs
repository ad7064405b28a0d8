//! `pictures.json`: the pictures that an experiment asks for beside those of every run. It stands beside
//! the record and not in it: how a record is shown changes none of its bits.

use serde::{Deserialize, Serialize};

/// A grid of pictures, a picture a cell, whose left half is one estimator's and whose right half another's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// The estimator of the left halves.
    pub left: String,
    /// The estimator of the right halves.
    pub right: String,
    /// Axis whose labels are the rows.
    pub rows: Option<String>,
    /// Axis whose labels are the columns.
    pub columns: Option<String>,
    /// Stops by which all pictures are brightened; none for a white of each picture's own.
    pub exposure_stops: Option<f64>,
}
