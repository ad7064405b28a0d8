//! Setting a value in a document by its dotted key, as `light.0.solid_angle.radiance`.

use std::collections::BTreeMap;

use super::document::{InputKind, Node, Value};
use super::suggest;
use super::validate::grammar::Grammar;
use crate::error::Diagnostic;

/// Sets `value` at the dotted `key`; missing tables are created on the way. Naming a variant of an
/// enum, as `object.boundary.rough`, or one of the keys of which a table has exactly one, as
/// `object.medium.preset`, replaces the one that was there.
///
/// # Errors
/// A key that leads through a value that is no table, or past the end of an array.
pub(super) fn set(root: &mut Node, key: &str, value: Node, grammar: &Grammar) -> Result<(), Diagnostic> {
    let words: Vec<&str> = key.split('.').map(str::trim).collect();
    let refuse = |rule: String| Diagnostic {
        rule,
        place: Some(value.key.clone().unwrap_or_else(|| value.origin.place.clone())),
        help: None,
    };
    if words.iter().any(|word| word.is_empty()) {
        return Err(refuse(format!("`{key}` is not a dotted key")));
    }
    let mut node = &mut *root;
    for (i, word) in words.iter().enumerate() {
        let so_far = words[..i].join(".");
        if i + 1 == words.len()
            && let Value::Table(entries) = &mut node.value
        {
            let rivals = grammar.rivals(&words);
            entries.retain(|key, _| !rivals.contains(&key.as_str()));
        }
        let fresh = fresh(&value, words.get(i + 1).copied());
        node = child(node, word, fresh).map_err(|what| refuse(format!("`{so_far}` {what}")))?;
    }
    let key = node.key.take();
    *node = Node { key: value.key.clone().or(key), ..value };
    Ok(())
}

/// The entries of `[setting.NAME]` as dotted keys and values. Tables written in braces are values,
/// other tables only group keys.
///
/// # Errors
/// A name that the file does not hold; the finding lists those that it does.
pub(super) fn setting(root: &Node, name: &str) -> Result<Vec<(String, Node)>, Diagnostic> {
    let settings = match root.get("setting").map(|node| &node.value) {
        Some(Value::Table(settings)) => settings,
        _ => &BTreeMap::new(),
    };
    let known: Vec<&str> = settings.keys().map(String::as_str).collect();
    let Some(setting) = settings.get(name) else {
        let help = Some(suggest::help(name, &known, "settings"));
        return Err(Diagnostic { rule: format!("unknown setting `{name}`"), place: None, help });
    };
    let mut entries = Vec::new();
    flatten(setting, String::new(), name, &mut entries);
    Ok(entries)
}

fn flatten(node: &Node, key: String, name: &str, entries: &mut Vec<(String, Node)>) {
    match &node.value {
        Value::Table(inner) if key.is_empty() || !node.inline => {
            for (word, child) in inner {
                let key = if key.is_empty() { word.clone() } else { format!("{key}.{word}") };
                flatten(child, key, name, entries);
            }
        }
        _ => {
            let mut node = node.clone();
            relabel(&mut node, &InputKind::Setting(name.into()));
            entries.push((key, node));
        }
    }
}

/// Gives a value and all within it another source.
pub(super) fn relabel(node: &mut Node, source: &InputKind) {
    node.origin.source = source.clone();
    match &mut node.value {
        Value::Array(items) => items.iter_mut().for_each(|item| relabel(item, source)),
        Value::Table(entries) => entries.values_mut().for_each(|entry| relabel(entry, source)),
        _ => {}
    }
}

/// Whether one dotted key is the other or leads to it.
pub(super) fn overlap(a: &str, b: &str) -> bool {
    let mut words = a.split('.').zip(b.split('.'));
    words.all(|(a, b)| a == b)
}

/// Whether `key` is `outer` or below it.
pub(super) fn is_within(key: &str, outer: &str) -> bool {
    overlap(key, outer) && key.split('.').count() >= outer.split('.').count()
}

/// What is created on the way to `next` where there was nothing: an array before `0`, else a table.
fn fresh(value: &Node, next: Option<&str>) -> Node {
    let mut node = Node::empty_table(value.origin.clone());
    node.key = value.key.clone().or(node.key);
    if next == Some("0") {
        node.value = Value::Array(Vec::new());
    }
    node
}

fn child<'a>(node: &'a mut Node, word: &str, fresh: Node) -> Result<&'a mut Node, String> {
    match &mut node.value {
        Value::Table(entries) => Ok(entries.entry(word.to_string()).or_insert(fresh)),
        Value::Array(items) => {
            let index: usize = word.parse().map_err(|_| format!("is an array, `{word}` is no index"))?;
            match index.cmp(&items.len()) {
                std::cmp::Ordering::Greater => {
                    return Err(format!("has {} entries, index {index} is past its end", items.len()));
                }
                std::cmp::Ordering::Equal => items.push(fresh),
                std::cmp::Ordering::Less => {}
            }
            Ok(&mut items[index])
        }
        _ => Err(format!("is not a table, `{word}` cannot be set in it")),
    }
}
