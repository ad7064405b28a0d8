//! Rules of lists of named entries and of `pair`.

use super::At;
use crate::experiment::document::Node;
use crate::experiment::suggest;
use crate::experiment::validate::grammar::Grammar;

/// The `name`s of a list's entries are unique; `what` they are, in words: `estimators`.
pub fn unique_names(at: At, entries: &Node, what: &str) {
    let mut seen = Vec::new();
    for (i, entry) in entries.items().iter().enumerate() {
        let Some(name) = entry.get("name").and_then(Node::as_str) else { continue };
        if seen.contains(&name) {
            at.item(i).to("name").report(format!("two {what} are named `{name}`"));
        }
        seen.push(name);
    }
}

/// The first words of keys that cells may differ in.
pub const CELL_KEYS: [&str; 3] = ["object", "sensor", "light"];

/// The keys of `pair.over` lead somewhere in object, sensor or light.
pub fn pair(at: At, over: &Node, grammar: &Grammar) {
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
