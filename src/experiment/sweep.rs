//! The sweep of an experiment file: its axes, their points, and the cells that they span.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::document::{InputKind, Node, Value};
use super::overrides::{indexed, is_within, overlap, relabel};
use super::rules::{CELL_KEYS, Findings, RUN_KEYS};
use super::suggest;
use super::sweep_csv;
pub(crate) use super::sweep_point::{AxisPoint, RowField, SweepAxis};
use crate::error::Place;

/// More cells than this are taken for a mistake.
const MOST_CELLS: usize = 100_000;

/// The path of a file that an experiment file names, relative to the folder of that file.
pub(crate) fn resolve_path(experiment: &Path, named: &str) -> PathBuf {
    experiment.parent().unwrap_or(Path::new("")).join(named)
}

/// Reads the axes of a document; none where something is wrong, the findings state what.
/// `overridden` are the keys that a setting or `--set` has set, which a sweep must not set again.
pub(crate) fn axes(
    root: &Node,
    experiment: &Path,
    overridden: &[(String, Place)],
    findings: &Findings,
) -> Option<Vec<SweepAxis>> {
    let entries = root.get("sweep").map(Node::items).unwrap_or_default();
    let read = entries.iter().map(|entry| by_index(root, axis(entry, experiment, findings)?, findings));
    let axes: Vec<Option<SweepAxis>> = read.collect();
    let axes: Option<Vec<SweepAxis>> = axes.into_iter().collect();
    let axes = axes?;
    let sound = [
        unique_axes(&axes, entries, findings),
        keys_apart(&axes, findings),
        not_overridden(root, &axes, overridden, findings),
        few_cells(&axes, entries, findings),
    ];
    sound.iter().all(|ok| *ok).then_some(axes)
}

/// The points of every cell, the first axis slowest. Without axes there is one cell.
pub(crate) fn cells(axes: &[SweepAxis]) -> Vec<Vec<&AxisPoint>> {
    axes.iter().fold(vec![Vec::new()], |cells, axis| {
        let extend = |cell: Vec<_>| axis.points.iter().map(move |point| [&cell[..], &[point]].concat());
        cells.into_iter().flat_map(extend).collect()
    })
}

fn axis(entry: &Node, experiment: &Path, findings: &Findings) -> Option<SweepAxis> {
    let mut points = match form(entry, findings)? {
        AxisForm::Values => from_values(entry, findings),
        AxisForm::Rows => from_rows(entry, findings),
        AxisForm::Csv => {
            let entry = entry.get("csv")?;
            let path = entry.get("path").and_then(Node::as_str)?;
            sweep_csv::points(entry, &resolve_path(experiment, path), findings)
        }
    }?;
    let first_key = points.first().and_then(|point| point.sets.first()).map(|(key, _)| key.clone());
    let named = entry.get("name").and_then(Node::as_str).map(String::from);
    let name = named.or_else(|| Some(first_key?.rsplit('.').next()?.to_string()))?;
    let source = InputKind::Sweep(name.as_str().into());
    for (_, value) in points.iter_mut().filter(|p| p.csv_line.is_none()).flat_map(|p| &mut p.sets) {
        relabel(value, &source);
    }
    let known_keys = cell_keys_only(&points, findings);
    (unique_labels(&points, findings) && known_keys).then_some(SweepAxis { name, points })
}

/// Keys that name a light or an estimator, by its index.
fn by_index(root: &Node, mut axis: SweepAxis, findings: &Findings) -> Option<SweepAxis> {
    let mut sound = true;
    for (key, value) in axis.points.iter_mut().flat_map(|point| &mut point.sets) {
        match indexed(root, key) {
            Ok(by_index) => {
                *key = by_index;
                if let Some((rule, help)) = other_estimator(root, key) {
                    sound = false;
                    findings.at(value.key.as_ref().unwrap_or(&value.origin.place), rule, Some(help));
                }
            }
            Err((rule, help)) => {
                sound = false;
                findings.at(value.key.as_ref().unwrap_or(&value.origin.place), rule, help);
            }
        }
    }
    sound.then_some(axis)
}

/// Why a key cannot be swept that is about an estimator: a sweep changes its options and neither its name
/// nor its kind, by which claims and tables know it.
fn other_estimator(root: &Node, key: &str) -> Option<(String, String)> {
    let words: Vec<&str> = key.split('.').collect();
    let ["estimator", rest @ ..] = &words[..] else { return None };
    let entry = rest.first().and_then(|index| root.at(&["estimator", index]))?;
    let is_kind = |word: &&&str| **word != "name" && entry.get(word).is_some();
    if rest.get(1).filter(is_kind).is_some() {
        return None;
    }
    let name = entry.get("name").and_then(Node::as_str).unwrap_or_default();
    let kind = match &entry.value {
        Value::Table(entries) => entries.keys().find(|key| *key != "name").cloned(),
        _ => None,
    };
    let kind = kind.unwrap_or_else(|| "KIND".into());
    Some((
        format!("`{key}` cannot be swept: a sweep changes options of an estimator"),
        format!(
            "an option of `{name}` is `estimator.{name}.{kind}.OPTION` (`scatterproof list {kind}`)"
        ),
    ))
}

enum AxisForm {
    Values,
    Rows,
    Csv,
}

fn form(entry: &Node, findings: &Findings) -> Option<AxisForm> {
    let keys = ["csv", "key", "keys", "rows", "values"];
    let given: Vec<&str> = keys.into_iter().filter(|key| entry.get(key).is_some()).collect();
    match given[..] {
        ["csv"] => Some(AxisForm::Csv),
        ["key", "values"] => Some(AxisForm::Values),
        ["keys", "rows"] => Some(AxisForm::Rows),
        _ => {
            let found = if given.is_empty() { "none".into() } else { suggest::quoted(&given) };
            let rule = "a sweep needs exactly one of `key` with `values`, `keys` with `rows`, `csv`";
            findings.at(entry.place(), format!("{rule}; found {found}"), None);
            None
        }
    }
}

fn from_values(entry: &Node, findings: &Findings) -> Option<Vec<AxisPoint>> {
    let (key, values) = (entry.get("key")?, entry.get("values")?);
    not_empty(values, findings)?;
    let point = |value: &Node| {
        Some(AxisPoint {
            label: value.label(),
            place: value.origin.place.clone(),
            sets: vec![setting(key, value)?],
            columns: BTreeMap::new(),
            csv_line: None,
        })
    };
    values.items().iter().map(point).collect()
}

fn from_rows(entry: &Node, findings: &Findings) -> Option<Vec<AxisPoint>> {
    let (keys, rows) = (entry.get("keys")?, entry.get("rows")?);
    not_empty(keys, findings)?;
    not_empty(rows, findings)?;
    let points: Vec<Option<AxisPoint>> =
        rows.items().iter().map(|row| from_row(keys.items(), row, findings)).collect();
    points.into_iter().collect()
}

fn from_row(keys: &[Node], row: &Node, findings: &Findings) -> Option<AxisPoint> {
    let (label, values) = (row.get("label")?, row.get("values")?);
    let count = values.items().len();
    if count != keys.len() {
        let rule = format!("the row has {count} values for {} keys", keys.len());
        findings.at(values.place(), rule, None);
        return None;
    }
    let sets: Option<Vec<_>> = keys.iter().zip(values.items()).map(|(k, v)| setting(k, v)).collect();
    let columns = match row.get("columns").map(|node| &node.value) {
        Some(Value::Table(columns)) => {
            columns.iter().map(|(name, node)| (name.clone(), column(node))).collect()
        }
        _ => BTreeMap::new(),
    };
    Some(AxisPoint {
        label: label.as_str()?.to_string(),
        place: label.origin.place.clone(),
        sets: sets?,
        columns,
        csv_line: None,
    })
}

fn column(node: &Node) -> RowField {
    RowField { text: node.label(), place: node.origin.place.clone() }
}

/// A key with its value, which takes the place of the key's text for findings about the key.
fn setting(key: &Node, value: &Node) -> Option<(String, Node)> {
    let value = Node { key: Some(key.origin.place.clone()), ..value.clone() };
    Some((key.as_str()?.to_string(), value))
}

fn not_empty(list: &Node, findings: &Findings) -> Option<()> {
    if list.items().is_empty() {
        let help = "give the list at least one entry, or remove the sweep";
        findings.at(list.place(), "empty sweep", Some(help.into()));
        return None;
    }
    Some(())
}

fn unique_labels(points: &[AxisPoint], findings: &Findings) -> bool {
    let mut labels = BTreeSet::new();
    let twice: Vec<&AxisPoint> = points.iter().filter(|point| !labels.insert(&point.label)).collect();
    for point in &twice {
        let help = "drop one of the two, or give rows a `label` each";
        let rule = format!("label `{}` occurs twice on the axis", point.label);
        findings.at(&point.place, rule, Some(help.into()));
    }
    twice.is_empty()
}

fn cell_keys_only(points: &[AxisPoint], findings: &Findings) -> bool {
    let sets = points.first().map(|point| &point.sets[..]).unwrap_or_default();
    let known = |word: &str| CELL_KEYS.contains(&word) || RUN_KEYS.contains(&word);
    let is_foreign = |key: &str| !key.split('.').next().is_some_and(known);
    let foreign: Vec<_> = sets.iter().filter(|(key, _)| is_foreign(key)).collect();
    for (key, value) in &foreign {
        let place = value.key.as_ref().unwrap_or(&value.origin.place);
        let help =
            "a sweep sets keys that begin with `object`, `sensor`, `light`, `estimator` or `budget`";
        findings.at(place, format!("`{key}` cannot be swept"), Some(help.into()));
    }
    foreign.is_empty()
}

fn unique_axes(axes: &[SweepAxis], entries: &[Node], findings: &Findings) -> bool {
    let mut names = BTreeSet::new();
    let mut sound = true;
    for (axis, entry) in axes.iter().zip(entries) {
        if !names.insert(&axis.name) {
            sound = false;
            let place = entry.get("name").unwrap_or(entry).place();
            let help = "give the sweep another `name`";
            findings.at(place, format!("two axes are named `{}`", axis.name), Some(help.into()));
        }
    }
    sound
}

/// No key is set twice: neither within an axis nor by two of them, nor one below the other.
fn keys_apart(axes: &[SweepAxis], findings: &Findings) -> bool {
    let sets = axes.iter().filter_map(|axis| axis.points.first()).flat_map(|point| &point.sets);
    let mut seen: Vec<&str> = Vec::new();
    let mut sound = true;
    for (key, value) in sets {
        if let Some(other) = seen.iter().find(|other| overlap(other, key)) {
            sound = false;
            let place = value.key.as_ref().unwrap_or(&value.origin.place);
            let rule = match *other == key {
                true => format!("`{key}` is swept twice"),
                false => format!("`{key}` and `{other}` are swept, and one contains the other"),
            };
            findings.at(place, rule, None);
        }
        seen.push(key);
    }
    sound
}

fn not_overridden(
    root: &Node,
    axes: &[SweepAxis],
    overridden: &[(String, Place)],
    findings: &Findings,
) -> bool {
    let swept: Vec<(&str, &str)> = axes
        .iter()
        .filter_map(|axis| Some((axis, axis.points.first()?)))
        .flat_map(|(axis, point)| point.sets.iter().map(|(key, _)| (axis.name.as_str(), key.as_str())))
        .collect();
    let mut sound = true;
    for (key, place) in overridden {
        let key = &indexed(root, key).unwrap_or_else(|_| key.clone());
        if let Some((axis, _)) = swept.iter().find(|(_, swept)| is_within(key, swept)) {
            sound = false;
            let rule = format!("`{key}` has no effect: the sweep `{axis}` sets it in every cell");
            let help = "drop it, or set the values of the sweep, as `--set sweep.0.values=[0.5]`";
            findings.at(place, rule, Some(help.into()));
        }
    }
    sound
}

fn few_cells(axes: &[SweepAxis], entries: &[Node], findings: &Findings) -> bool {
    let count = axes.iter().try_fold(1usize, |n, axis| n.checked_mul(axis.points.len()));
    let sound = count.is_some_and(|n| n <= MOST_CELLS);
    if !sound && let Some(entry) = entries.last() {
        findings.at(entry.place(), format!("the sweep has more than {MOST_CELLS} cells"), None);
    }
    sound
}
