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
    let indexed = indexed(root, key).map_err(|(rule, help)| Diagnostic { help, ..refuse(rule) })?;
    let words: Vec<&str> = indexed.split('.').map(str::trim).collect();
    let mut node = &mut *root;
    for (i, word) in words.iter().enumerate() {
        let so_far = words[..i].join(".");
        if let Value::Table(entries) = &mut node.value {
            let rivals = grammar.rivals(&words[..=i]);
            let is_rival = |key: &String| rivals.contains(&key.as_str());
            if i + 1 == words.len() {
                entries.retain(|key, _| !is_rival(key));
            } else if let Some(there) = entries.keys().find(|key| is_rival(key))
                && !entries.contains_key(*word)
            {
                let help = format!("set `{so_far}` as a whole, or give it as `{word}` in the file");
                let rule = format!("`{so_far}` is `{there}` here: it has no `{}`", words[i..].join("."));
                return Err(Diagnostic { help: Some(help), ..refuse(rule) });
            }
        }
        let fresh = fresh(&value, words.get(i + 1).copied());
        node = child(node, word, fresh).map_err(|what| refuse(format!("`{so_far}` {what}")))?;
    }
    let key = node.key.take();
    *node = Node { key: value.key.clone().or(key), ..value };
    Ok(())
}

/// A dotted key whose entries of lists are named by index where it names them by their `name`, as
/// `light.sun.directional`; of a `light` without a name the default is its name. The key itself where it
/// names none.
///
/// # Errors
/// A name that no entry has, and those that there are.
pub(super) fn indexed(root: &Node, key: &str) -> Result<String, (String, Option<String>)> {
    let words: Vec<&str> = key.split('.').map(str::trim).collect();
    let [list, word, ..] = words[..] else { return Ok(key.into()) };
    let entries = root.get(list).map(Node::items).unwrap_or_default();
    if entries.is_empty() || word.parse::<usize>().is_ok() {
        return Ok(key.into());
    }
    let name = |(i, entry): (usize, &Node)| {
        let given = entry.get("name").and_then(Node::as_str).map(String::from);
        given.unwrap_or_else(|| format!("{list}_{}", i + 1))
    };
    let names: Vec<String> = entries.iter().enumerate().map(name).collect();
    // Names may hold dots.
    let rest = &key.trim_start()[list.len() + 1..];
    let found = |name: &&String| {
        rest.strip_prefix(name.as_str()).is_some_and(|r| r.starts_with('.') || r.is_empty())
    };
    match names.iter().filter(found).max_by_key(|name| name.len()) {
        Some(name) => {
            let index = names.iter().position(|known| known == name).unwrap_or_default();
            Ok(format!("{list}.{index}{}", &rest[name.len()..]))
        }
        None => {
            let known: Vec<&str> = names.iter().map(String::as_str).collect();
            let help = match suggest::nearest(word, &known) {
                Some(near) => format!("did you mean `{list}.{near}`?"),
                None => {
                    let numbered = names.iter().enumerate().map(|(i, name)| format!("{i} = `{name}`"));
                    format!("by index or name: {}", numbered.collect::<Vec<_>>().join(", "))
                }
            };
            Err((format!("no `[[{list}]]` is named `{word}`"), Some(help)))
        }
    }
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
