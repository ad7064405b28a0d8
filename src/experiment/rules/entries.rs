//! Rules of lists of named entries and of `pair`.

use std::collections::BTreeSet;

use super::At;
use super::claims::{Known, filter, names as estimators};
use crate::experiment::document::Node;
use crate::experiment::schema::{Budget, BudgetShare};
use crate::experiment::suggest;
use crate::experiment::validate::grammar::Grammar;

/// The name of an experiment is that of its folder.
pub(crate) fn experiment_name(at: At, name: &str) {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    let begins_well = name.starts_with(|c: char| c.is_ascii_alphanumeric());
    let is_good = begins_well && name.chars().all(is_plain);
    if !name.is_empty() && !is_good {
        at.report_help(
            format!("`{name}` cannot name a folder"),
            "take letters, digits, `-` and `_` only, the first of them a letter or a digit",
        );
    }
    is_short(at, name);
}

/// Longest name, bytes: file systems take 255, of which what surrounds a name in a file's name needs some.
const LONGEST_NAME: usize = 128;

/// Files carry the name.
fn is_short(at: At, name: &str) {
    if name.len() > LONGEST_NAME {
        at.report_help(
            format!("the name has {} bytes, and at most {LONGEST_NAME} are possible", name.len()),
            "files carry the name; a `description` may be as long as you like",
        );
    }
}

/// The names of a list's entries are unique and of printable signs; `what` they are, in words:
/// `estimators`.
pub(crate) fn names(at: At, entries: &Node, what: &str) {
    let mut seen = BTreeSet::new();
    for (i, entry) in entries.items().iter().enumerate() {
        let Some(name) = entry.get("name").and_then(Node::as_str) else { continue };
        if !seen.insert(name) {
            let rule = format!("two {what} are named `{name}`");
            at.item(i).to("name").report_help(rule, "give each a name of its own");
        }
        if let Some(sign) = name.chars().find(|c| "/\\".contains(*c) || c.is_control()) {
            at.item(i).to("name").report_help(
                format!("the name {name:?} contains {sign:?}"),
                "pictures and tables carry the name: leave out `/`, `\\` and control characters",
            );
        }
        is_short(at.item(i).to("name"), name);
    }
}

/// Keys of a scene with estimators, which are all needed where one of them is there.
pub(crate) const SCENE_KEYS: [&str; 6] = ["bands", "object", "sensor", "light", "estimator", "budget"];

/// Keys of samplers, likewise.
pub(crate) const SAMPLER_KEYS: [&str; 2] = ["samples", "sampler"];

/// Keys that describe more of a scene.
const MORE_OF_SCENES: [&str; 5] = ["sweep", "pair", "picture", "only_claimed", "budget_share"];

/// What an experiment is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExperimentParts {
    /// A scene with estimators.
    pub scene: bool,
    /// Whether the experiment has samplers.
    pub samplers: bool,
}

impl ExperimentParts {
    /// The keys that must be there, except those that a sweep may supply.
    pub(crate) fn required(self) -> Vec<&'static str> {
        let of_scene = SCENE_KEYS.into_iter().filter(|key| self.scene && !CELL_KEYS.contains(key));
        of_scene.chain(SAMPLER_KEYS.into_iter().filter(|_| self.samplers)).collect()
    }
}

/// What the experiment `root` is made of: of something, and keys that describe more of a scene need one.
pub(crate) fn parts(at: At, root: &Node) -> ExperimentParts {
    let has = |keys: &[&str]| keys.iter().any(|key| root.get(key).is_some());
    let parts = ExperimentParts { scene: has(&SCENE_KEYS), samplers: has(&SAMPLER_KEYS) };
    let quoted = [suggest::quoted(&SCENE_KEYS), suggest::quoted(&SAMPLER_KEYS)];
    if !parts.scene && !parts.samplers {
        at.report_help(
            "nothing is measured: there is neither a scene with estimators nor are there samplers",
            format!("a scene takes {}; samplers take {}", quoted[0], quoted[1]),
        );
    } else if !parts.scene {
        for key in MORE_OF_SCENES.iter().filter(|key| root.get(key).is_some()) {
            at.to(key).key().report_help(
                format!("`{key}` belongs to a scene, and there is none"),
                format!("leave it out, or give the scene: {}", quoted[0]),
            );
        }
    }
    parts
}

/// A share of the budget names estimators and labels that are there, and the budget can be shared out.
pub(crate) fn budget_share(at: At, entry: &BudgetShare, budget: Option<&Budget>, known: &Known) {
    estimators(at.to("estimators"), &entry.estimators, known);
    if let Some(axes) = known.axes {
        filter(at, &entry.only, axes);
    }
    if matches!(budget, Some(Budget::RelativeError(_))) {
        at.report_help(
            "an error cannot be shared out: `relative_error` already gives every run its own number of passes",
            "leave it out, or take a budget in passes or seconds",
        );
    }
}

/// The first words of keys that cells may differ in.
pub(crate) const CELL_KEYS: [&str; 3] = ["object", "sensor", "light"];

/// The first words of further keys that a sweep may set: how a cell is measured.
pub(crate) const RUN_KEYS: [&str; 2] = ["estimator", "budget"];

/// The keys of `pair.over` lead somewhere in object, sensor or light.
pub(crate) fn pair(at: At, over: &Node, grammar: &Grammar) {
    for (i, key) in over.items().iter().enumerate() {
        let Some(text) = key.as_str() else { continue };
        let words: Vec<&str> = text.split('.').collect();
        if !CELL_KEYS.contains(&words[0]) {
            at.item(i).report_help(
                format!("unknown key `{text}`"),
                "keys begin with `object`, `sensor` or `light`, as `object.shape`",
            );
            continue;
        }
        let unknown = (1..words.len()).find(|&n| {
            let is_known = grammar.at(&words[..=n]).is_some();
            !is_known && !grammar.names_at(&words[..n]).contains(&words[n])
        });
        if let Some(n) = unknown {
            let help = suggest::help(words[n], &grammar.names_at(&words[..n]), "keys");
            at.item(i).report_help(format!("unknown key `{text}`"), help);
        }
    }
}
