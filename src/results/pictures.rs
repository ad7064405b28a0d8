//! `pictures.json`: the pictures that an experiment requests in addition to those of every run. It is stored
//! beside the record and not in it, so that the display of a record changes none of its bits.

use serde::{Deserialize, Serialize};

/// A picture that is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Wanted {
    /// Two estimators side by side.
    Split(Split),
    /// Means as passes add up.
    Running(Running),
    /// One estimator's picture in every band.
    Strip(Strip),
}

/// A grid of pictures, a picture a cell, whose left half is one estimator's and whose right half
/// another's.
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

/// A plot a cell: the mean of one number over the first passes, with its interval, as passes add up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Running {
    /// The estimators, or all.
    pub estimators: Option<Vec<String>>,
    /// The observable; the sensor's first by default.
    pub observable: Option<String>,
    /// Transport class that is shown.
    pub class: String,
    /// Band that is shown.
    pub band: String,
}

/// A row of pictures a cell: all bands together as they are displayed, then bands by themselves in grey.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Strip {
    /// The estimator whose pictures are shown.
    pub estimator: String,
    /// How many bands are shown at most, evenly spaced.
    pub bands: usize,
}
