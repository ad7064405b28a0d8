//! Rules between values, which the schema cannot express; each reports the place of the offending key.

use std::cell::RefCell;
use std::collections::BTreeSet;

use serde::de::DeserializeOwned;

use super::document::Node;
use super::schema::Spectrum;
use crate::error::{Diagnostic, Place};

mod bands;
mod claims;
mod entries;
mod invariants;
mod lights;
mod object;
mod pictures;
mod sensor;

pub(super) use bands::bands;
pub(super) use claims::{Known, claim};
pub(super) use entries::{
    CELL_KEYS, ExperimentParts, RUN_KEYS, SAMPLER_KEYS, SCENE_KEYS, budget_share, experiment_name,
    names, pair, parts,
};
pub(super) use invariants::{CellPoint, mean_path_length};
pub(super) use lights::lights;
pub(super) use object::{emits, object};
pub(super) use pictures::{has_pixels, picture};
pub(super) use sensor::sensor;

/// Where the rules put their findings; a finding that is already there is not repeated.
#[derive(Default)]
pub(crate) struct Findings {
    list: RefCell<Vec<Diagnostic>>,
    /// Rule and first byte of each, of which a generated file may have thousands.
    known: RefCell<BTreeSet<(String, usize)>>,
}

impl Findings {
    /// Adds a finding unless it is already there.
    pub(crate) fn add(&self, finding: Diagnostic) {
        let start = finding.place.as_ref().map_or(0, |place| place.span.start);
        let mut list = self.list.borrow_mut();
        if self.known.borrow_mut().insert((finding.rule.clone(), start)) || !list.contains(&finding) {
            list.push(finding);
        }
    }

    /// Adds what is wrong at `place`.
    pub(crate) fn at(&self, place: &Place, rule: impl Into<String>, help: Option<String>) {
        self.add(Diagnostic { rule: rule.into(), place: Some(place.clone()), help });
    }

    /// Everything found, in the order of the text.
    pub(crate) fn into_sorted(self) -> Vec<Diagnostic> {
        let mut findings = self.list.into_inner();
        findings.sort_by_key(|f| f.place.as_ref().map(|p| (p.name.to_string(), p.span.start)));
        findings
    }
}

/// A node under the eye of a rule.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    node: &'a Node,
    findings: &'a Findings,
    /// Whether findings are about the key rather than the value.
    is_key: bool,
}

impl<'a> At<'a> {
    /// Looks at `node` and reports to `findings`.
    pub(super) fn new(node: &'a Node, findings: &'a Findings) -> At<'a> {
        At { node, findings, is_key: false }
    }

    /// The entry or element `word`; the node itself where there is none.
    pub(super) fn to(self, word: &str) -> At<'a> {
        At { node: self.node.at(&[word]).unwrap_or(self.node), ..self }
    }

    /// Whether there is an entry `word`.
    pub(super) fn has(self, word: &str) -> bool {
        self.node.at(&[word]).is_some()
    }

    /// The key that holds it.
    pub(super) fn key(self) -> At<'a> {
        At { is_key: true, ..self }
    }

    fn place(self) -> &'a Place {
        self.node.key.as_ref().filter(|_| self.is_key).unwrap_or(self.node.place())
    }

    /// The element `index` of an array.
    pub(super) fn item(self, index: usize) -> At<'a> {
        self.to(&index.to_string())
    }

    /// The entry `word` as its type; none where it is missing or the walk has refused it.
    pub(super) fn typed<T: DeserializeOwned>(self, word: &str) -> Option<T> {
        serde_json::from_value(self.node.at(&[word])?.to_json()).ok()
    }

    /// The number of elements.
    pub(super) fn count(self) -> usize {
        self.node.items().len()
    }

    /// What is wrong here.
    pub(super) fn report(self, rule: impl Into<String>) {
        self.findings.at(self.place(), rule, None);
    }

    /// What is wrong here, and what to do.
    pub(super) fn report_help(self, rule: impl Into<String>, help: impl Into<String>) {
        self.findings.at(self.place(), rule, Some(help.into()));
    }
}

/// A list must have an entry per band.
fn one_per_band(at: At, entries: usize, bands: usize) {
    if entries != bands {
        at.report_help(
            format!("there are {bands} bands, the list has {entries} entries"),
            "give one number for all bands, or a list with one number per band",
        );
    }
}

/// A spectrum has an entry per band, and every entry keeps a rule: `must` states it in words.
fn spectrum(at: At, spectrum: &Spectrum, bands: usize, must: &str, holds: fn(f64) -> bool) {
    match spectrum {
        Spectrum::Grey(value) => value_rule(at, *value, must, holds),
        Spectrum::PerBand(values) => {
            one_per_band(at, values.len(), bands);
            values.iter().enumerate().for_each(|(i, value)| value_rule(at.item(i), *value, must, holds));
        }
    }
}

fn value_rule(at: At, value: f64, must: &str, holds: fn(f64) -> bool) {
    if !holds(value) {
        at.report_help(
            format!("must be {must}, is {value}"),
            "give another number; `scatterproof list KIND` states what a kind takes",
        );
    }
}

/// A vector that gives a direction has a length.
fn nonzero(at: At, vector: [f64; 3]) -> bool {
    let is_zero = vector == [0.0; 3];
    if is_zero {
        at.report_help(
            "a direction must not be the zero vector",
            "give a vector of any length above 0, as [0, 0, -1] for straight down",
        );
    }
    !is_zero
}
