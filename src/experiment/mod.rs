//! Experiment files: schema, validation, build.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::error::{Error, Result};
use crate::input;

/// From entries to scenes.
pub(crate) mod build;

/// Claims as they are written.
mod claim_words;

/// Kinds described by the schema.
pub(crate) mod describe;

/// Directions as they are written.
mod direction;

/// A TOML text as a tree with places.
pub(crate) mod document;

/// Claims of efficiency.
mod duel;

/// From a text to an experiment.
pub(crate) mod load;

/// Every value and where it comes from.
mod origins;

/// Setting values by dotted key.
mod overrides;

/// Pictures that a file may ask for.
pub(crate) mod picture;

/// The kinds of estimators and samplers that a file may name.
pub mod registry;

/// What entries mean: bands, coefficients per band.
pub(crate) mod resolve;

/// Canonical content of cells and experiments.
mod resolved;

/// Rules between values.
mod rules;

/// What a file may contain.
pub(crate) mod schema;

/// The JSON Schema of a file.
pub(crate) mod schema_json;

/// Sensors as they are written.
mod sensor;

/// Where values were written.
mod sources;

/// Spectra from CSV files.
mod spectrum_csv;

/// Suggestions of similar names ("did you mean").
pub(crate) mod suggest;

/// Axes, points and cells.
pub(crate) mod sweep;

/// Rows from a CSV file.
mod sweep_csv;

/// Axes and points as types.
mod sweep_point;

/// Slips of the pen in TOML.
mod syntax;

/// The walk along the schema.
pub(crate) mod validate;

#[cfg(test)]
pub(crate) mod tests;

pub(crate) use crate::results::record::titled;
pub use registry::Registry;
pub(crate) use sources::Sources;
pub(crate) use sweep::resolve_path;

use schema::{Budget, EstimatorEntry, ExperimentFile, LightEntry, Object, SensorEntry};

/// A validated experiment.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The file that it was read from.
    pub path: PathBuf,
    /// Name, seed, bands, estimators, pairing, budget, claims and display of all cells; object, sensor
    /// and lights of the first. Sweeps are in it as rows, CSV files read; settings are applied.
    pub file: ExperimentFile,
    /// The cells, the last axis fastest. Without a sweep there is one, labelled `base`; without a scene,
    /// none.
    pub cells: Vec<CellSpec>,
    /// The axes of the sweep.
    pub axes: Vec<Axis>,
    /// The names of the settings that the file offers.
    pub settings: Vec<String>,
    /// Dotted key, value and origin of everything in the first cell, sorted by key; an origin is a
    /// place, `--set ...`, or `default`.
    pub origins: Vec<(String, String, String)>,
    /// Where values were written.
    pub(crate) sources: Sources,
}

/// An axis of the sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Name of the experiment.
    pub name: String,
    /// The labels of its points in order.
    pub labels: Vec<String>,
}

/// One point of the sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct CellSpec {
    /// The labels of its points, joined by commas.
    pub label: String,
    /// Label of the cell on each axis of the sweep.
    pub axes: BTreeMap<String, String>,
    /// Shape, boundary and medium of the body.
    pub object: Object,
    /// Sensor of the cell.
    pub sensor: SensorEntry,
    /// Lights of the cell.
    pub light: Vec<LightEntry>,
    /// The estimators of the cell, where the sweep sets options of one.
    pub estimator: Option<Vec<EstimatorEntry>>,
    /// The budget of the cell, where the sweep sets it.
    pub budget: Option<Budget>,
    /// The columns of the rows that the cell took, as texts; where two axes have a column of one
    /// name, that of the first.
    pub csv_row: BTreeMap<String, String>,
    /// The line of the first CSV row that the cell took, counted from 1.
    pub csv_line: Option<usize>,
    /// Dotted key -> value that the sweep set.
    pub sweep_values: BTreeMap<String, Value>,
}

/// Overrides from the command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// `key=value` arguments, applied in order after the setting.
    pub sets: Vec<String>,
    /// The `[setting.NAME]` to apply.
    pub setting: Option<String>,
}

/// Reads and validates an experiment file.
///
/// # Errors
/// The file cannot be read, or everything that is wrong with it, at once.
pub fn load(path: &Path, options: &LoadOptions, registry: &Registry) -> Result<Experiment> {
    let text = input::read_text(path, input::LONGEST_TEXT).map_err(|error| {
        Error::input_help(
            format!("could not read the experiment file {}: {error}", path.display()),
            "name a TOML file; `scatterproof init` writes an example",
        )
    })?;
    load::load_text(path, &text, options, registry)
}

impl Experiment {
    /// The estimator `entry` as the cell `cell` runs it.
    pub(crate) fn estimator(&self, cell: usize, entry: usize) -> &EstimatorEntry {
        let own = self.cells.get(cell).and_then(|cell| cell.estimator.as_ref());
        own.and_then(|list| list.get(entry)).unwrap_or(&self.file.estimator[entry])
    }
}

impl From<&sweep::SweepAxis> for Axis {
    fn from(axis: &sweep::SweepAxis) -> Axis {
        let labels = axis.points.iter().map(|point| point.label.clone()).collect();
        Axis { name: axis.name.clone(), labels }
    }
}
