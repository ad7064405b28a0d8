//! Every value of an experiment with where it comes from.

use serde_json::Value as Json;

use super::document::{Node, Origin, Value};
use super::resolved::json;
use super::schema::ExperimentFile;

/// The dotted key, value and origin of every leaf of `root`, and of the defaults that `file`, which
/// was read from it, has beside them. A list without tables is one leaf.
pub(super) fn list(root: &Node, file: &ExperimentFile) -> Vec<(String, String, String)> {
    let file = ExperimentFile { sweep: Vec::new(), ..file.clone() };
    let mut found = Vec::new();
    given(root, String::new(), &mut found);
    let mut leaves = in_words(found);
    defaults(&json(&file), Some(root), String::new(), &mut leaves);
    leaves.sort();
    leaves
}

/// Origins with their lines and columns, counted in one sweep over each text: a count from its beginning for every leaf
/// would take minutes in a file of many claims.
fn in_words(mut found: Vec<(String, String, &Origin)>) -> Vec<(String, String, String)> {
    let start = |origin: &Origin| origin.place.span.start;
    found.sort_by_key(|(_, _, origin)| (origin.place.text.as_ptr(), start(origin)));
    let (mut text, mut at, mut place) = (std::ptr::null(), 0, [1, 1]);
    let mut leaves = Vec::new();
    for (key, value, origin) in found {
        if origin.place.text.as_ptr() != text {
            (text, at, place) = (origin.place.text.as_ptr(), 0, [1, 1]);
        }
        for letter in origin.place.text.get(at..start(origin)).unwrap_or("").chars() {
            place = if letter == '\n' { [place[0] + 1, 1] } else { [place[0], place[1] + 1] };
        }
        at = start(origin);
        leaves.push((key, value, origin.words(place)));
    }
    leaves
}

fn given<'a>(node: &'a Node, key: String, leaves: &mut Vec<(String, String, &'a Origin)>) {
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
        _ => leaves.push((key, node.to_json().to_string(), &node.origin)),
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

#[cfg(test)]
mod tests {
    use super::super::document;
    use super::*;

    #[test]
    fn one_sweep_counts_as_each_place_does() {
        let text = "a = [1, 2]\n[b]\nc = \"\u{3b7}\"\nd = { e = 1,\n f = \"\u{3b7}\", g = 2 }\n";
        let root = document::parse("x.toml", text).expect("a document");
        let mut found = Vec::new();
        given(&root, String::new(), &mut found);
        let expected: Vec<String> = found
            .iter()
            .map(|(_, _, origin)| {
                let (line, column) = origin.place.line_column();
                format!("x.toml:{line}:{column}")
            })
            .collect();
        let mut places: Vec<String> = in_words(found).into_iter().map(|(_, _, words)| words).collect();
        assert_eq!(places.pop().as_deref(), Some("x.toml:5:15"));
        assert_eq!(places, expected[..4]);
    }
}
