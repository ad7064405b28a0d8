//! Every value of an experiment with where it comes from.

use serde_json::Value as Json;

use super::document::{Node, Value};
use super::resolved::json;
use super::schema::ExperimentFile;

/// The dotted key, value and origin of every leaf of `root`, and of the defaults that `file`, which
/// was read from it, has beside them. A list without tables is one leaf.
pub(super) fn list(root: &Node, file: &ExperimentFile) -> Vec<(String, String, String)> {
    let file = ExperimentFile { sweep: Vec::new(), ..file.clone() };
    let mut leaves = Vec::new();
    given(root, String::new(), &mut leaves);
    defaults(&json(&file), Some(root), String::new(), &mut leaves);
    leaves.sort();
    leaves
}

fn given(node: &Node, key: String, leaves: &mut Vec<(String, String, String)>) {
    match &node.value {
        Value::Table(entries) if !entries.is_empty() => {
            entries.iter().for_each(|(word, child)| given(child, join(&key, word), leaves));
        }
        Value::Array(items) if items.iter().any(|item| matches!(item.value, Value::Table(_))) => {
            items
                .iter()
                .enumerate()
                .for_each(|(i, child)| given(child, join(&key, &i.to_string()), leaves));
        }
        _ => leaves.push((key, node.to_json().to_string(), node.origin.to_string())),
    }
}

fn defaults(json: &Json, node: Option<&Node>, key: String, leaves: &mut Vec<(String, String, String)>) {
    let child = |word: &str| node.and_then(|node| node.at(&[word]));
    match (json, node) {
        (Json::Object(entries), _) => {
            for (word, value) in entries {
                defaults(value, child(word), join(&key, word), leaves);
            }
        }
        (Json::Array(items), Some(_)) => {
            for (i, value) in items.iter().enumerate() {
                let word = i.to_string();
                defaults(value, child(&word), join(&key, &word), leaves);
            }
        }
        (_, None) => leaves.push((key, json.to_string(), "default".into())),
        _ => {}
    }
}

fn join(key: &str, word: &str) -> String {
    if key.is_empty() { word.to_string() } else { format!("{key}.{word}") }
}
