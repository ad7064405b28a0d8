//! From a text to a validated experiment: overrides, the walk, the sweep, the rules, the types.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::document::{self, Node, Value};
use super::picture::PictureEntry;
use super::registry::Registry;
use super::rules::{self, At, CELL_KEYS, CellPoint, ExperimentParts, Findings, Known, RUN_KEYS};
use super::schema::{BandsEntry, BudgetShare, ClaimEntry, ExperimentFile};
use super::schema_json::json_schema;
use super::spectrum_csv;
use super::sweep::{self, AxisPoint, SweepAxis};
use super::validate::SchemaWalk;
use super::validate::grammar::Grammar;
use super::{Axis, CellSpec, Experiment, LoadOptions, Sources, origins, overrides, resolved};
use crate::error::{Diagnostic, Error, Place, Result};

/// Reads, overrides and validates the experiment in `text`, which was read from `path`.
///
/// # Errors
/// Everything that is wrong with it, at once.
pub(crate) fn load_text(
    path: &Path,
    text: &str,
    options: &LoadOptions,
    registry: &Registry,
) -> Result<Experiment> {
    let grammar = Grammar::new(json_schema(registry));
    let mut root = document::parse(&path.display().to_string(), text).map_err(Error::Input)?;
    let overridden = apply(&mut root, options, &grammar).map_err(Error::Input)?;
    let loader = Loader { path, root, grammar, findings: Findings::default() };
    loader.experiment(&overridden)
}

/// Applies the chosen setting, then the `--set` arguments; the keys that they set, and where.
fn apply(
    root: &mut Node,
    options: &LoadOptions,
    grammar: &Grammar,
) -> std::result::Result<Vec<(String, Place)>, Vec<Diagnostic>> {
    let mut findings = Vec::new();
    let mut entries = Vec::new();
    if let Some(name) = &options.setting {
        match overrides::setting(root, name) {
            Ok(setting) => entries.extend(setting),
            Err(finding) => findings.push(finding),
        }
    }
    for argument in &options.sets {
        match document::parse_set(argument) {
            Ok(entry) => entries.push(entry),
            Err(errors) => findings.extend(errors),
        }
    }
    let mut overridden = Vec::new();
    for (key, value) in entries {
        let place = value.key.clone().unwrap_or_else(|| value.origin.place.clone());
        match overrides::set(root, &key, value, grammar) {
            Ok(()) => overridden.push((key, place)),
            Err(finding) => findings.push(finding),
        }
    }
    if findings.is_empty() { Ok(overridden) } else { Err(findings) }
}

struct Loader<'a> {
    path: &'a Path,
    root: Node,
    grammar: Grammar,
    findings: Findings,
}

impl Loader<'_> {
    fn experiment(mut self, overridden: &[(String, Place)]) -> Result<Experiment> {
        let parts = rules::parts(At::new(&self.root, &self.findings), &self.root);
        let mut walk = SchemaWalk::new(&self.grammar, false);
        walk.root(&self.root, &CELL_KEYS, &parts.required());
        walk.into_findings().into_iter().for_each(|finding| self.findings.add(finding));
        let mut axes = sweep::axes(&self.root, self.path, overridden, &self.findings);
        self.shared_rules(parts, axes.as_deref());
        let bands = self.bands();
        self.read_spectra(bands.as_ref(), axes.as_deref_mut().unwrap_or_default());
        let Some(axes) = axes else {
            self.cell_rules(&self.root, bands.as_ref(), true);
            return Err(refusal(self.findings.into_sorted()));
        };
        let points = if parts.scene { sweep::cells(&axes) } else { Vec::new() };
        let trees: Vec<Node> = points.iter().map(|points| self.cell_tree(points)).collect();
        trees.iter().for_each(|tree| self.cell_rules(tree, bands.as_ref(), false));
        if let Some(bands) = &bands {
            let cells = trees.iter().zip(&points);
            cells.for_each(|(tree, points)| self.claim_rules(tree, bands, &axes, points));
        }
        let cells: Option<Vec<CellSpec>> =
            trees.iter().zip(&points).map(|(tree, points)| cell(tree, &axes, points)).collect();
        let first = self.first_cell(trees.first());
        let settings = settings(&self.root);
        match (self.findings.into_sorted(), cells, typed::<ExperimentFile>(&first)) {
            (findings, Some(cells), Some(mut file)) if findings.is_empty() => {
                file.sweep = resolved::sweep(&axes);
                file.setting.clear();
                let origins = origins::list(&first, &file);
                let (names, path) = (axes.iter().map(Axis::from).collect(), self.path.to_path_buf());
                let sources = Sources::new(self.root, axes);
                Ok(Experiment { path, file, cells, axes: names, settings, origins, sources })
            }
            (findings, ..) => Err(refusal(findings)),
        }
    }

    /// Puts numbers in the place of spectra from files.
    fn read_spectra(&mut self, bands: Option<&BandsEntry>, axes: &mut [SweepAxis]) {
        let bands = bands.map(BandsEntry::list);
        let Loader { path, root, grammar, findings } = self;
        let resolve =
            |node: &mut Node| spectrum_csv::resolve(node, bands.as_deref(), path, grammar, findings);
        if let Value::Table(entries) = &mut root.value {
            entries
                .iter_mut()
                .filter(|(key, _)| CELL_KEYS.contains(&key.as_str()))
                .for_each(|(_, n)| resolve(n));
        }
        let points = axes.iter_mut().flat_map(|axis| &mut axis.points);
        points.flat_map(|point| &mut point.sets).for_each(|(_, value)| resolve(value));
    }

    /// The bands where nothing is wrong with them: otherwise their number may be absurd.
    fn bands(&self) -> Option<BandsEntry> {
        self.root.get("bands")?;
        let mut walk = SchemaWalk::new(&self.grammar, false);
        walk.entry(&self.root, "bands");
        let is_sound = walk.into_findings().is_empty();
        self.root.get("bands").filter(|_| is_sound).and_then(typed)
    }

    /// Rules of what all cells share.
    fn shared_rules(&self, parts: ExperimentParts, axes: Option<&[SweepAxis]>) {
        let at = At::new(&self.root, &self.findings);
        if let Some(name) = self.root.get("name").and_then(Node::as_str) {
            rules::experiment_name(at.to("name"), name);
        }
        if let Some(bands) = at.typed("bands") {
            rules::bands(at.to("bands"), &bands);
        }
        for (key, what) in [("estimator", "estimators"), ("sampler", "samplers")] {
            if let Some(entries) = self.root.get(key) {
                rules::names(at.to(key), entries, what);
            }
        }
        if let Some(over) = self.root.at(&["pair", "over"]) {
            rules::pair(at.to("pair").to("over"), over, &self.grammar);
        }
        let names = |key: &str| -> Vec<&str> {
            let entries = self.root.get(key).map(Node::items).unwrap_or_default();
            entries.iter().filter_map(|entry| entry.get("name")?.as_str()).collect()
        };
        let (estimators, samplers) = (names("estimator"), names("sampler"));
        let bands = self.bands().map(|bands| bands.list().into_iter().map(|band| band.name).collect());
        let entries = at.typed("estimator").unwrap_or_default();
        let known = Known { parts, estimators, entries, samplers, bands, axes };
        let claims = at.to("claim");
        for (i, entry) in self.root.get("claim").map(Node::items).unwrap_or_default().iter().enumerate()
        {
            if let Some(claim) = typed::<ClaimEntry>(entry) {
                rules::claim(claims.item(i), &claim, &known);
            }
        }
        let (shares, budget) = (at.to("budget_share"), at.typed("budget"));
        for (i, share) in at.typed::<Vec<BudgetShare>>("budget_share").iter().flatten().enumerate() {
            rules::budget_share(shares.item(i), share, budget.as_ref(), &known);
        }
        let pictures = at.to("picture");
        let entries = self.root.get("picture").map(Node::items).unwrap_or_default();
        for (i, entry) in entries.iter().enumerate() {
            if let Some(picture) = typed::<PictureEntry>(entry) {
                rules::picture(pictures.item(i), &picture, &known);
            }
        }
    }

    /// The walk and the rules of object, sensor and lights in one cell.
    fn cell_rules(&self, tree: &Node, bands: Option<&BandsEntry>, lenient: bool) {
        let mut walk = SchemaWalk::new(&self.grammar, lenient);
        let at = At::new(tree, &self.findings);
        let emits = rules::emits(at.to("object"));
        let is_needed = |key: &&&str| **key != "light" || !emits || tree.get("light").is_some();
        CELL_KEYS.iter().filter(is_needed).for_each(|key| walk.entry(tree, key));
        let swept = RUN_KEYS.iter().filter(|key| tree.get(key).is_some());
        swept.for_each(|key| walk.entry(tree, key));
        walk.into_findings().into_iter().for_each(|finding| self.findings.add(finding));
        if let Some(bands) = bands {
            rules::object(at.to("object"), bands);
            rules::lights(at.to("light"), bands, emits);
        }
        if let Some(sensor) = at.typed("sensor") {
            let shape = at.to("object").typed("shape");
            rules::sensor(at.to("sensor"), &sensor, shape.as_ref());
            if let Some(pictures) = self.root.get("picture") {
                rules::has_pixels(At::new(pictures, &self.findings), &sensor);
            }
        }
    }

    /// Rules of claims that hold in some cells only.
    fn claim_rules(&self, tree: &Node, bands: &BandsEntry, axes: &[SweepAxis], points: &[&AxisPoint]) {
        let claims = At::new(&self.root, &self.findings).to("claim");
        let cell = CellPoint { tree: At::new(tree, &self.findings), bands, axes, points };
        for (i, entry) in self.root.get("claim").map(Node::items).unwrap_or_default().iter().enumerate()
        {
            if let Some(words) = typed::<ClaimEntry>(entry).and_then(|claim| claim.mean_path_length) {
                rules::mean_path_length(claims.item(i).to("mean_path_length"), &words, &cell);
            }
        }
    }

    /// Object, sensor and lights of the cell at `points`, and what else its sweep sets.
    fn cell_tree(&self, points: &[&AxisPoint]) -> Node {
        let mut tree = Node { value: Value::Table(Default::default()), ..self.bare_root() };
        if let (Value::Table(entries), Value::Table(all)) = (&mut tree.value, &self.root.value) {
            let sets = || points.iter().flat_map(|point| &point.sets);
            let is_swept = |key: &str| sets().any(|(set, _)| set.split('.').next() == Some(key));
            let is_own =
                |key: &str| CELL_KEYS.contains(&key) || RUN_KEYS.contains(&key) && is_swept(key);
            let kept = all.iter().filter(|(key, _)| is_own(key));
            entries.extend(kept.map(|(key, node)| (key.clone(), node.clone())));
        }
        for (key, value) in points.iter().flat_map(|point| &point.sets) {
            if let Err(finding) = overrides::set(&mut tree, key, value.clone(), &self.grammar) {
                self.findings.add(finding);
            }
        }
        tree
    }

    fn bare_root(&self) -> Node {
        Node::empty_table(self.root.origin.clone())
    }

    /// The document with the first cell's object, sensor and lights, and without sweep and settings.
    fn first_cell(&self, tree: Option<&Node>) -> Node {
        let mut first = self.root.clone();
        if let Value::Table(entries) = &mut first.value {
            if let Some(Value::Table(cell)) = tree.map(|tree| &tree.value) {
                entries.extend(cell.clone());
            }
            entries.retain(|key, _| key != "sweep" && key != "setting");
        }
        first
    }
}

/// The names of the settings that a file offers.
fn settings(root: &Node) -> Vec<String> {
    match root.get("setting").map(|node| &node.value) {
        Some(Value::Table(settings)) => settings.keys().cloned().collect(),
        _ => Vec::new(),
    }
}

/// The findings, of which there must be one where an experiment is refused.
fn refusal(findings: Vec<Diagnostic>) -> Error {
    match findings.is_empty() {
        true => Error::input("the experiment passed every rule and still does not fit its types"),
        false => Error::Input(findings),
    }
}

/// A node as its type, where it fits.
fn typed<T: DeserializeOwned>(node: &Node) -> Option<T> {
    serde_json::from_value(node.to_json()).ok()
}

/// What the sweep sets of how a cell is measured; none within where it sets nothing.
fn swept<T: DeserializeOwned>(tree: &Node, key: &str) -> Option<Option<T>> {
    tree.get(key).map_or(Some(None), |node| typed(node).map(Some))
}

fn cell(tree: &Node, axes: &[SweepAxis], points: &[&AxisPoint]) -> Option<CellSpec> {
    let labels: Vec<&str> = points.iter().map(|point| point.label.as_str()).collect();
    let mut csv_row = std::collections::BTreeMap::new();
    for (name, column) in points.iter().flat_map(|point| &point.columns) {
        csv_row.entry(name.clone()).or_insert_with(|| column.text.clone());
    }
    let sets = points.iter().flat_map(|point| &point.sets);
    Some(CellSpec {
        label: if labels.is_empty() { "base".into() } else { labels.join(", ") },
        axes: axes
            .iter()
            .map(|axis| axis.name.clone())
            .zip(labels.iter().map(|l| l.to_string()))
            .collect(),
        object: typed(tree.get("object")?)?,
        sensor: typed(tree.get("sensor")?)?,
        light: tree.get("light").map_or(Some(Vec::new()), typed)?,
        estimator: swept(tree, "estimator")?,
        budget: swept(tree, "budget")?,
        csv_row,
        csv_line: points.iter().find_map(|point| point.csv_line),
        sweep_values: sets.map(|(key, value)| (key.clone(), value.to_json())).collect(),
    })
}
