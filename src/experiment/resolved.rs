//! Canonical content: what a cell and an experiment are, apart from how their file writes it.

use serde::Serialize;
use serde_json::{Value as Json, json};

use super::schema::{ExperimentFile, Scalar, Sweep, SweepRow};
use super::sweep::{AxisPoint, SweepAxis};
use super::{CellSpec, Experiment};

impl CellSpec {
    /// Object, sensor and lights, and what else the sweep sets, with sorted keys, every number of a continuous quantity as f64.
    /// Files (a mesh, a map) are in it by their path.
    pub fn content(&self) -> Json {
        let mut content = json!({
            "object": json(&self.object),
            "sensor": json(&self.sensor),
            "light": json(&self.light),
        });
        // Only where they are swept: cells that measure one scene in several ways have streams of their own.
        if let Some(estimators) = &self.estimator {
            content["estimator"] = json(estimators);
        }
        if let Some(budget) = &self.budget {
            content["budget"] = json(budget);
        }
        content
    }

    /// The content without the values at the dotted `keys`: equal for cells that are paired over them.
    pub fn content_without(&self, keys: &[String]) -> Json {
        let mut content = self.content();
        for key in keys {
            remove(&mut content, &key.split('.').collect::<Vec<_>>());
        }
        content
    }
}

impl Experiment {
    /// The whole experiment without its claims and pictures, as a file of its own: overrides applied,
    /// defaults written out, object, sensor and lights of the first cell, sweeps as rows. Loading it
    /// again gives the same cells.
    pub fn resolved(&self) -> Json {
        json(&ExperimentFile { claim: Vec::new(), picture: Vec::new(), ..self.file.clone() })
    }
}

/// The sweep with every row written out; columns of CSV files that set nothing are in `columns`.
pub(super) fn sweep(axes: &[SweepAxis]) -> Vec<Sweep> {
    axes.iter().map(axis).collect()
}

fn axis(axis: &SweepAxis) -> Sweep {
    let keys = axis.points.first().map(|point| point.sets.iter().map(|(key, _)| key.clone()).collect());
    Sweep {
        name: Some(axis.name.clone()),
        key: None,
        values: None,
        keys,
        rows: Some(axis.points.iter().map(row).collect()),
        csv: None,
    }
}

fn row(point: &AxisPoint) -> SweepRow {
    let text = |text: &String| Scalar::Text(text.clone());
    SweepRow {
        label: point.label.clone(),
        values: point.sets.iter().map(|(_, value)| value.to_json()).collect(),
        columns: point.columns.iter().map(|(name, column)| (name.clone(), text(&column.text))).collect(),
    }
}

/// A value of the schema as JSON; its types cannot fail to serialise.
pub(super) fn json<T: Serialize>(value: &T) -> Json {
    serde_json::to_value(value).unwrap_or_else(|error| panic!("schema type without JSON: {error}"))
}

fn remove(json: &mut Json, path: &[&str]) {
    match (path, json) {
        ([last], Json::Object(entries)) => {
            entries.remove(*last);
        }
        ([last], Json::Array(items)) => {
            if let Some(item) = last.parse::<usize>().ok().and_then(|i| items.get_mut(i)) {
                *item = Json::Null;
            }
        }
        ([first, rest @ ..], Json::Object(entries)) => {
            if let Some(child) = entries.get_mut(*first) {
                remove(child, rest);
            }
        }
        ([first, rest @ ..], Json::Array(items)) => {
            if let Some(child) = first.parse::<usize>().ok().and_then(|i| items.get_mut(i)) {
                remove(child, rest);
            }
        }
        _ => {}
    }
}
