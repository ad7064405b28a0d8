//! Pictures beside those of every run: what `[[picture]]` may contain.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::results::pictures::{self, Wanted};

/// One picture: exactly one kind. Pictures are views of a record and change none of its bits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["split"] }, { "required": ["running"] }, { "required": ["strip"] }]))]
pub struct PictureEntry {
    /// Two estimators side by side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<SplitEntry>,
    /// Means as passes add up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub running: Option<RunningEntry>,
    /// One estimator's picture band by band.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strip: Option<StripEntry>,
}

/// A row of pictures per cell: all bands together as they are displayed, then bands by themselves in grey, all of
/// them with the same exposure, so that a band is dark where the body is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StripEntry {
    /// The estimator whose pictures are shown.
    pub estimator: String,
    /// How many bands are shown at most, evenly spaced; 8 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 64))]
    pub bands: Option<u32>,
}

/// Bands of a strip without `bands`.
const BANDS_OF_A_STRIP: u32 = 8;

/// A plot per cell: the mean of one number over the first passes, with its interval, against the number of
/// passes; and the value that an `equals` claim expects of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunningEntry {
    /// The estimators; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub estimators: Option<Vec<String>>,
    /// The observable; the sensor's first by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observable: Option<String>,
    /// The transport class; `all` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// Band that is shown.
    pub band: String,
}

/// A grid of pictures, one picture per cell of the sweep: its left half by one estimator, its right half by
/// another, with the same exposure. The caption states the CPU time of each half. Axes that are neither rows
/// nor columns give one grid per label.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SplitEntry {
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
    /// Stops by which all pictures of the grid are brightened; by default each picture has its own white level,
    /// the same for both halves: the 95th percentile of the half with less noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure_stops: Option<f64>,
}

/// The pictures that a file asks for, as the results folder keeps them.
pub(crate) fn wanted(entries: &[PictureEntry]) -> Vec<Wanted> {
    entries.iter().filter_map(PictureEntry::wanted).collect()
}

impl PictureEntry {
    fn wanted(&self) -> Option<Wanted> {
        let split = self.split.as_ref().map(|words| {
            Wanted::Split(pictures::Split {
                left: words.left.clone(),
                right: words.right.clone(),
                rows: words.rows.clone(),
                columns: words.columns.clone(),
                exposure_stops: words.exposure_stops,
            })
        });
        let running = self.running.as_ref().map(|words| {
            Wanted::Running(pictures::Running {
                estimators: words.estimators.clone(),
                observable: words.observable.clone(),
                class: words.class.clone().unwrap_or_else(|| "all".into()),
                band: words.band.clone(),
            })
        });
        let strip = self.strip.as_ref().map(|words| {
            Wanted::Strip(pictures::Strip {
                estimator: words.estimator.clone(),
                bands: words.bands.unwrap_or(BANDS_OF_A_STRIP) as usize,
            })
        });
        split.or(running).or(strip)
    }
}
