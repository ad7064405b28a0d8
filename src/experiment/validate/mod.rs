//! Validates a document against the JSON Schema that the types of `schema` generate: types, keys, variants,
//! ranges. Every violation is reported, not only the first.

use std::collections::BTreeMap;

use serde_json::Value as Json;

use super::document::{Node, Value};
use super::suggest;
use crate::error::{Diagnostic, Place};

/// A JSON Schema as the grammar of a file.
pub(crate) mod grammar;

use grammar::{Grammar, SchemaForm, Variant};

/// The findings of a walk.
pub(crate) struct SchemaWalk<'a> {
    grammar: &'a Grammar,
    findings: Vec<Diagnostic>,
    /// Whether keys may be missing (where a sweep that is itself at fault might supply them).
    lenient: bool,
}

impl<'a> SchemaWalk<'a> {
    /// A walk along `grammar`; `lenient` walks let required keys be missing.
    pub(crate) fn new(grammar: &'a Grammar, lenient: bool) -> SchemaWalk<'a> {
        SchemaWalk { grammar, findings: Vec::new(), lenient }
    }

    /// Everything found so far.
    pub(crate) fn into_findings(self) -> Vec<Diagnostic> {
        self.findings
    }

    /// Checks the whole document except its entries `except`; the keys `required` must be there.
    pub(crate) fn root(&mut self, node: &Node, except: &[&str], required: &[&str]) {
        let mut schema = self.grammar.root().clone();
        if let Some(properties) = schema["properties"].as_object_mut() {
            except.iter().for_each(|key| properties[*key] = Json::Bool(true));
        }
        if let Some(keys) = schema["required"].as_array_mut() {
            keys.extend(required.iter().map(|key| Json::from(*key)));
        }
        if let Value::Table(entries) = &node.value {
            self.table(node, entries, &schema, "");
        }
    }

    /// Checks one top-level entry, which must be there.
    pub(crate) fn entry(&mut self, root: &Node, key: &str) {
        match (root.get(key), self.grammar.at(&[key])) {
            (Some(node), Some(schema)) => self.node(node, schema, key),
            _ if self.lenient => {}
            _ => self.missing(root, key, ""),
        }
    }

    /// Checks `node`, found at the dotted `path`, along `schema`.
    pub(crate) fn node(&mut self, node: &Node, schema: &Json, path: &str) {
        match self.grammar.form(schema) {
            SchemaForm::Anything => self.finite(node),
            SchemaForm::Choice(alternatives) => {
                match alternatives.iter().find(|a| self.accepts(a, &node.value)) {
                    Some(alternative) => self.node(node, alternative, path),
                    None => self.wrong_type(node, schema),
                }
            }
            SchemaForm::Variants(variants) => self.variants(node, schema, &variants, path),
            SchemaForm::Plain(plain) if !self.accepts(plain, &node.value) => {
                self.wrong_type(node, plain)
            }
            SchemaForm::Plain(plain) => match &node.value {
                Value::Table(entries) => self.table(node, entries, plain, path),
                Value::Array(items) => self.array(node, items, plain, path),
                Value::String(text) => self.string(node, text, plain),
                Value::Integer(number) => self.number(node, *number as f64, plain),
                Value::Float(number) => self.number(node, *number, plain),
                Value::Bool(_) | Value::Datetime => {}
            },
        }
    }

    fn report(&mut self, place: &Place, rule: String, help: Option<String>) {
        self.findings.push(Diagnostic { rule, place: Some(place.clone()), help });
    }

    fn accepts(&self, schema: &Json, value: &Value) -> bool {
        self.types(schema).iter().any(|name| match value {
            Value::Bool(_) => *name == "boolean",
            Value::Integer(_) => matches!(*name, "integer" | "number"),
            Value::Float(_) => *name == "number",
            Value::String(_) => *name == "string",
            Value::Array(_) => *name == "array",
            Value::Table(_) => *name == "object",
            Value::Datetime => false,
        })
    }

    /// The JSON types that a schema accepts.
    fn types<'b>(&'b self, schema: &'b Json) -> Vec<&'b str> {
        match self.grammar.form(schema) {
            SchemaForm::Anything => vec!["boolean", "integer", "number", "string", "array", "object"],
            SchemaForm::Choice(alternatives) => {
                alternatives.iter().flat_map(|a| self.types(a)).collect()
            }
            SchemaForm::Variants(variants) => {
                let mut types = Vec::new();
                if variants.iter().any(|v| v.content.is_none()) {
                    types.push("string");
                }
                if variants.iter().any(|v| v.content.is_some()) {
                    types.push("object");
                }
                types
            }
            SchemaForm::Plain(plain) => match &plain["type"] {
                Json::String(name) => vec![name],
                list => grammar::strings(Some(list)),
            },
        }
    }

    fn wrong_type(&mut self, node: &Node, schema: &Json) {
        let mut types: Vec<&str> = Vec::new();
        for name in self.types(schema).into_iter().filter(|t| *t != "null").map(article) {
            types.extend((!types.contains(&name)).then_some(name));
        }
        let mut rule = format!("expected {}, found {}", suggest::join(&types, "or"), found(node));
        let mut help = Some(grammar::doc(schema).to_string()).filter(|doc| !doc.is_empty());
        match (&node.value, types[..].contains(&"an integer")) {
            (Value::Float(number), true) if number.fract() == 0.0 && number.abs() < 1e15 => {
                rule = format!("expected an integer, found `{}`", node.origin.place.text());
                help = Some(format!("write {number}: an integer has neither a point nor an exponent"));
            }
            (Value::Table(_), _) if types == ["an array"] && self.holds_tables(schema) => {
                let key = node.key.as_ref().map_or("entry", |key| key.text());
                let of = if node.inline {
                    format!(
                        "write `[[{key}]]` and its keys below it, or put the table in an array: `[{{ ... }}]`"
                    )
                } else {
                    format!("write `[[{key}]]`, with two brackets")
                };
                help = Some(help.map_or(of.clone(), |doc| format!("{of}. {doc}")));
            }
            (Value::String(text), _) if text.ends_with(".csv") && types.contains(&"a table") => {
                help = Some(format!(
                    "a column of a file is `{{ csv = {{ path = \"{text}\", wavelength = \"COLUMN\", unit = \
                     \"nm\", column = \"COLUMN\", interpolation = \"linear\" }} }}`"
                ));
            }
            (Value::String(text), _) if text.parse::<f64>().is_ok_and(f64::is_finite) => {
                let is_number = types.iter().any(|name| ["an integer", "a number"].contains(name));
                help = is_number.then(|| format!("write {text}, without quotes")).or(help);
            }
            _ => {}
        }
        self.report(node.place(), rule, help);
    }

    /// Whether an array is one of tables.
    fn holds_tables(&self, schema: &Json) -> bool {
        schema.get("items").is_some_and(|items| self.types(items).contains(&"object"))
    }

    fn missing(&mut self, node: &Node, key: &str, path: &str) {
        let path = join_path(path, key);
        let words: Vec<&str> = path.split('.').collect();
        let schema = self.grammar.at(&words);
        let doc = schema.map(grammar::doc).filter(|doc| !doc.is_empty());
        let kinds = match schema.map(|schema| self.grammar.form(schema)) {
            Some(SchemaForm::Variants(variants)) => variants.iter().map(|v| v.name).collect(),
            _ => Vec::new(),
        };
        let help = doc.map(|doc| match kinds.is_empty() {
            true => format!("`{key}`: {doc}"),
            false => format!("`{key}`: {doc} One of {}", suggest::quoted(&kinds)),
        });
        self.report(node.place(), format!("missing key `{path}`"), help);
    }

    fn table(&mut self, node: &Node, entries: &BTreeMap<String, Node>, schema: &Json, path: &str) {
        let known = grammar::keys(schema);
        let mut meant = Vec::new();
        for (key, entry) in entries {
            let path = join_path(path, key);
            match (schema["properties"].get(key), &schema["additionalProperties"]) {
                (Some(property), _) => self.node(entry, property, &path),
                (None, Json::Bool(false)) => {
                    meant.extend(suggest::nearest(key, &known));
                    let help = Some(suggest::help(key, &known, "keys"));
                    let place = entry.key.as_ref().unwrap_or(&entry.origin.place);
                    self.report(place, format!("unknown key `{key}`"), help);
                }
                (None, rest) if rest.is_object() => self.node(entry, rest, &path),
                (None, _) => self.finite(entry),
            }
        }
        for key in grammar::strings(schema.get("required")) {
            if !self.lenient && !entries.contains_key(key) && !meant.contains(&key) {
                self.missing(node, key, path);
            }
        }
        self.one_of(node, entries, schema, &meant);
    }

    /// A table whose `oneOf` lists keys of which exactly one must be there.
    fn one_of(&mut self, node: &Node, entries: &BTreeMap<String, Node>, schema: &Json, meant: &[&str]) {
        let keys = grammar::one_of(schema);
        if keys.is_empty() {
            return;
        }
        let given: Vec<&str> = keys.iter().copied().filter(|key| entries.contains_key(*key)).collect();
        let needed = suggest::quoted(&keys);
        match given[..] {
            [_] => {}
            [] if self.lenient || keys.iter().any(|key| meant.contains(key)) => {}
            [] => {
                let rule = format!("exactly one of {needed} is needed, found none");
                let help = format!("add one of them; `scatterproof list {}` shows how", keys[0]);
                self.report(node.place(), rule, Some(help));
            }
            [.., last] => {
                let place = entries[last].key.clone().unwrap_or_else(|| node.place().clone());
                let rule =
                    format!("exactly one of {needed} is needed, found {}", suggest::quoted(&given));
                self.report(&place, rule, Some("keep one of those found, and remove the others".into()));
            }
        }
    }

    fn array(&mut self, node: &Node, items: &[Node], schema: &Json, path: &str) {
        let bound = |keyword: &str| schema[keyword].as_u64().map(|n| n as usize);
        let (least, most) = (bound("minItems").unwrap_or(0), bound("maxItems").unwrap_or(usize::MAX));
        if items.len() < least || items.len() > most {
            let needed = match (least, most) {
                (least, most) if least == most => format!("exactly {least}"),
                (least, _) if items.len() < least => format!("at least {least}"),
                (_, most) => format!("at most {most}"),
            };
            let last = path.rsplit('.').next().unwrap_or(path);
            let rule = match items.len() {
                0 => format!("`{last}` is empty, it must have {needed} {}", entries_word(least)),
                n => format!("`{last}` must have {needed} entries, has {n}"),
            };
            self.report(node.place(), rule, None);
        }
        if let Some(schema) = schema.get("items") {
            for (i, item) in items.iter().enumerate() {
                self.node(item, schema, &join_path(path, &i.to_string()));
            }
        }
    }

    fn string(&mut self, node: &Node, text: &str, schema: &Json) {
        let doc = Some(grammar::doc(schema)).filter(|doc| !doc.is_empty()).map(String::from);
        if text.is_empty() && schema["minLength"].as_u64().is_some_and(|least| least > 0) {
            self.report(node.place(), "must not be empty".into(), doc);
        }
    }

    fn number(&mut self, node: &Node, number: f64, schema: &Json) {
        if !number.is_finite() {
            return self.finite(node);
        }
        type Bound = (&'static str, &'static str, fn(f64, f64) -> bool);
        let rules: [Bound; 4] = [
            ("minimum", "at least", |x, bound| x >= bound),
            ("maximum", "at most", |x, bound| x <= bound),
            ("exclusiveMinimum", "greater than", |x, bound| x > bound),
            ("exclusiveMaximum", "less than", |x, bound| x < bound),
        ];
        for (keyword, words, holds) in rules {
            let of_format = || format_maximum(schema).filter(|_| keyword == "maximum");
            if let Some(bound) = schema[keyword].as_f64().or_else(of_format)
                && !holds(number, bound)
            {
                let doc = Some(grammar::doc(schema)).filter(|doc| !doc.is_empty()).map(String::from);
                self.report(node.place(), format!("must be {words} {bound}, is {number}"), doc);
            }
        }
    }

    /// Refuses NaN, infinities and dates in values that the schema leaves open.
    fn finite(&mut self, node: &Node) {
        match &node.value {
            Value::Float(number) if !number.is_finite() => {
                self.report(node.place(), "must be a finite number".into(), None);
            }
            Value::Datetime => self.report(node.place(), "dates have no use here".into(), None),
            Value::Array(items) => items.iter().for_each(|item| self.finite(item)),
            Value::Table(entries) => entries.values().for_each(|entry| self.finite(entry)),
            _ => {}
        }
    }

    fn variants(&mut self, node: &Node, schema: &Json, variants: &[Variant], path: &str) {
        let names: Vec<&str> = variants.iter().map(|v| v.name).collect();
        match &node.value {
            Value::String(text) if variants.iter().any(|v| v.content.is_none()) => {
                if !variants.iter().any(|v| v.content.is_none() && v.name == text) {
                    self.unknown_variant(node.place(), text, &names);
                }
            }
            Value::Table(entries) if variants.iter().any(|v| v.content.is_some()) => {
                for (key, entry) in entries {
                    match variants.iter().find(|v| v.name == key).and_then(|v| v.content) {
                        Some(content) => self.node(entry, content, &join_path(path, key)),
                        None => {
                            let place = entry.key.as_ref().unwrap_or(&entry.origin.place);
                            self.unknown_variant(place, key, &names);
                        }
                    }
                }
                self.one_variant(node, entries, &names);
            }
            _ => self.wrong_type(node, schema),
        }
    }

    fn one_variant(&mut self, node: &Node, entries: &BTreeMap<String, Node>, names: &[&str]) {
        let given: Vec<&str> = entries.keys().map(String::as_str).collect();
        let rule = match given.len() {
            0 if self.lenient => return,
            0 => format!("exactly one of {} is needed, found none", suggest::quoted(names)),
            1 => return,
            // One that is unknown is told at its own place.
            _ if given.iter().any(|name| !names.contains(name)) => return,
            _ => format!("only one kind may be given, found {}", suggest::quoted(&given)),
        };
        let help = (!given.is_empty()).then(|| "keep one of them, and remove the others".to_string());
        self.report(node.place(), rule, help);
    }

    fn unknown_variant(&mut self, place: &Place, name: &str, names: &[&str]) {
        self.report(place, format!("unknown kind `{name}`"), Some(suggest::help(name, names, "kinds")));
    }
}

/// The largest number of an integer type narrower than the 64 bits of the file's integers.
fn format_maximum(schema: &Json) -> Option<f64> {
    match schema["format"].as_str()? {
        "uint8" => Some(f64::from(u8::MAX)),
        "uint16" => Some(f64::from(u16::MAX)),
        "uint32" => Some(f64::from(u32::MAX)),
        "int32" => Some(f64::from(i32::MAX)),
        _ => None,
    }
}

fn join_path(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_string() } else { format!("{path}.{key}") }
}

fn entries_word(count: usize) -> &'static str {
    if count == 1 { "entry" } else { "entries" }
}

fn article(json_type: &str) -> &str {
    match json_type {
        "boolean" => "true or false",
        "integer" => "an integer",
        "number" => "a number",
        "string" => "a string",
        "array" => "an array",
        _ => "a table",
    }
}

fn found(node: &Node) -> String {
    match &node.value {
        Value::Bool(value) => value.to_string(),
        Value::Integer(value) => value.to_string(),
        Value::Float(value) => value.to_string(),
        Value::String(_) => "a string".into(),
        Value::Array(_) => "an array".into(),
        Value::Table(_) => "a table".into(),
        Value::Datetime => "a date".into(),
    }
}
