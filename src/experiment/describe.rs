//! The kinds that a file may name, described by the schema: keys with types, defaults and choices, and an
//! example of each.

use serde_json::Value as Json;

use super::suggest;
use super::validate::grammar::{Grammar, SchemaForm, Variant, keys, one_of, paragraph, strings};

/// Pages whose examples stand for the kinds; tests run them.
const PAGES: [&str; 2] =
    [include_str!("../../docs/experiment-file.md"), include_str!("../../docs/bssrdf.md")];

/// One key of a table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct KeyDescription {
    /// The key.
    pub key: String,
    /// What it takes, in words: `a number above 0`.
    pub takes: String,
    /// `required`, its default, or nothing.
    pub default: String,
    /// Its documentation.
    pub doc: String,
    /// How deep it is nested.
    pub depth: usize,
}

/// The keys at a path of the schema and, where they are tables of their own, the keys below them.
pub(crate) fn describe(grammar: &Grammar, schema: &Json) -> Vec<KeyDescription> {
    let mut rows = Vec::new();
    table(grammar, schema, 0, &mut rows);
    rows
}

/// Tables are described down to here.
const DEEPEST: usize = 3;

fn table(grammar: &Grammar, schema: &Json, depth: usize, rows: &mut Vec<KeyDescription>) {
    let SchemaForm::Plain(plain) = grammar.form(schema) else {
        return variants(grammar, schema, depth, rows);
    };
    let required = strings(plain.get("required"));
    for key in keys(plain) {
        let property = &plain["properties"][key];
        let default = match property.get("default") {
            Some(value) if !value.is_null() => format!("default {}", toml(value)),
            _ if required.contains(&key) => "required".into(),
            _ => String::new(),
        };
        rows.push(KeyDescription {
            key: key.into(),
            takes: takes(grammar, property),
            default,
            doc: paragraph(property),
            depth,
        });
        below(grammar, property, depth + 1, rows);
    }
}

/// The kinds of a choice that hold keys of their own, and these keys.
fn variants(grammar: &Grammar, schema: &Json, depth: usize, rows: &mut Vec<KeyDescription>) {
    let SchemaForm::Variants(variants) = grammar.form(schema) else { return };
    for variant in variants {
        let takes = variant.content.map_or(String::new(), |content| takes(grammar, content));
        let (key, doc) = (variant.name.to_string(), paragraph(variant.about));
        rows.push(KeyDescription { key, takes, default: String::new(), doc, depth });
        if let Some(content) = variant.content {
            below(grammar, content, depth + 1, rows);
        }
    }
}

fn below(grammar: &Grammar, schema: &Json, depth: usize, rows: &mut Vec<KeyDescription>) {
    if depth >= DEEPEST {
        return;
    }
    match grammar.form(schema) {
        SchemaForm::Plain(plain) if !keys(plain).is_empty() => table(grammar, plain, depth, rows),
        SchemaForm::Variants(_) => variants(grammar, schema, depth, rows),
        SchemaForm::Choice(list) => {
            list.iter().for_each(|alternative| below(grammar, alternative, depth, rows));
        }
        _ => {}
    }
}

/// What a value must be, in words.
pub(crate) fn takes(grammar: &Grammar, schema: &Json) -> String {
    match grammar.form(schema) {
        SchemaForm::Anything => "any value".into(),
        SchemaForm::Choice(alternatives) => {
            let mut words: Vec<String> = alternatives.iter().map(|a| takes(grammar, a)).collect();
            words.dedup();
            suggest::join(&words.iter().map(String::as_str).collect::<Vec<_>>(), "or")
        }
        SchemaForm::Variants(variants) => {
            let name = |v: &Variant| match v.content {
                Some(_) => format!("{{ {} = ... }}", v.name),
                None => format!("\"{}\"", v.name),
            };
            let names: Vec<String> = variants.iter().map(name).collect();
            suggest::join(&names.iter().map(String::as_str).collect::<Vec<_>>(), "or")
        }
        SchemaForm::Plain(plain) => one(grammar, plain),
    }
}

fn one(grammar: &Grammar, schema: &Json) -> String {
    let kinds: Vec<&str> = match &schema["type"] {
        Json::String(name) => vec![name],
        list => strings(Some(list)),
    };
    let words = match kinds.iter().find(|kind| **kind != "null") {
        Some(&"boolean") => "true or false".into(),
        Some(&"integer") => "an integer".to_string(),
        Some(&"number") => "a number".into(),
        Some(&"string") => "a text".into(),
        Some(&"array") => {
            let each = schema.get("items").map_or("any value".into(), |items| takes(grammar, items));
            let many = each.strip_prefix("a number").map(|range| format!("numbers{range}"));
            let many =
                many.or_else(|| each.strip_prefix("an integer").map(|range| format!("integers{range}")));
            let many = many.or_else(|| each.strip_prefix("a text").map(|_| "texts".into()));
            let many = many.unwrap_or_else(|| format!("entries, each {each}"));
            return match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
                (Some(least), Some(most)) if least == most => format!("a list of {least} {many}"),
                _ => format!("a list of {many}"),
            };
        }
        _ => "a table".into(),
    };
    words + &range(schema)
}

fn range(schema: &Json) -> String {
    let bound = |keyword: &str| schema.get(keyword).and_then(Json::as_f64);
    let least = bound("minimum").map(|x| format!("from {x}"));
    let least = bound("exclusiveMinimum").map(|x| format!("above {x}")).or(least);
    let most = bound("maximum").map(|x| format!("to {x}"));
    let most = bound("exclusiveMaximum").map(|x| format!("below {x}")).or(most);
    let words: Vec<String> = [least, most].into_iter().flatten().collect();
    if words.is_empty() { String::new() } else { format!(" {}", words.join(" ")) }
}

/// A value as TOML on one line.
pub(crate) fn toml(value: &Json) -> String {
    match value {
        Json::Object(entries) if entries.is_empty() => "{}".into(),
        Json::Object(entries) => {
            let entries = entries.iter().map(|(key, value)| format!("{key} = {}", toml(value)));
            format!("{{ {} }}", entries.collect::<Vec<_>>().join(", "))
        }
        Json::Array(items) => {
            format!("[{}]", items.iter().map(toml).collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}

/// An example of a kind: a line of the pages that sets `key`, as `object.shape.mesh`, or the key with the
/// simplest value that the schema takes.
pub(crate) fn example(grammar: &Grammar, schema: &Json, key: &str) -> String {
    let is_meant = |line: &&str| {
        let rest = line.strip_prefix(key).map(str::trim_start);
        rest.is_some_and(|rest| rest.starts_with('='))
    };
    let lines = PAGES
        .iter()
        .flat_map(|page| page.lines())
        .map(|l| l.split("   #").next().unwrap_or(l).trim_end());
    let found = lines.filter(is_meant).min_by_key(|line| line.len());
    found.map_or_else(|| format!("{key} = {}", toml(&simplest(grammar, schema))), String::from)
}

/// The simplest value that a schema takes: required keys alone, the first of several kinds.
pub(crate) fn simplest(grammar: &Grammar, schema: &Json) -> Json {
    let number = |schema: &Json| {
        let bound = |keyword: &str| schema.get(keyword).and_then(Json::as_f64);
        let fits = |x: &f64| {
            bound("minimum").is_none_or(|least| *x >= least)
                && bound("exclusiveMinimum").is_none_or(|least| *x > least)
                && bound("maximum").is_none_or(|most| *x <= most)
                && bound("exclusiveMaximum").is_none_or(|most| *x < most)
        };
        let ends = [bound("minimum"), bound("maximum")].into_iter().flatten();
        [1.0, 0.5].into_iter().chain(ends).find(fits).unwrap_or(1.0)
    };
    match grammar.form(schema) {
        SchemaForm::Anything => Json::from(1),
        SchemaForm::Choice(alternatives) => simplest(grammar, alternatives[0]),
        SchemaForm::Variants(variants) => match &variants[0] {
            first if first.content.is_none() => Json::from(first.name),
            first => {
                let content = first.content.map_or(Json::Null, |content| simplest(grammar, content));
                Json::Object([(first.name.to_string(), content)].into_iter().collect())
            }
        },
        SchemaForm::Plain(plain) => match plain["type"].as_str().unwrap_or("object") {
            "boolean" => Json::from(true),
            "integer" => Json::from(number(plain) as i64),
            "number" => Json::from(number(plain)),
            "string" => Json::from("a"),
            "array" => {
                let count = plain["minItems"].as_u64().unwrap_or(1);
                let item = plain.get("items").map_or(Json::from(1), |items| simplest(grammar, items));
                (0..count).map(|_| item.clone()).collect()
            }
            _ => {
                let one = one_of(plain).into_iter().take(1);
                let needed = strings(plain.get("required")).into_iter().chain(one);
                let entry = |key: &str| (key.to_string(), simplest(grammar, &plain["properties"][key]));
                Json::Object(needed.map(entry).collect())
            }
        },
    }
}
