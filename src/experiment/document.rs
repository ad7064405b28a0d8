//! A TOML text as a tree in which every value knows its place. The only module that uses `toml`.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use serde_json::json;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error as TomlError};

use super::syntax;
use crate::error::{Diagnostic, Place};

/// What kind of input a value was read from.
#[derive(Clone, Debug, PartialEq)]
pub enum InputKind {
    /// The experiment file itself.
    File,
    /// A `--set` argument.
    Set,
    /// An entry of `[setting.NAME]`.
    Setting(Arc<str>),
    /// A row of the sweep over this axis.
    Sweep(Arc<str>),
    /// A row of a CSV file.
    Csv,
}

/// Where a value comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// The kind of input.
    pub source: InputKind,
    /// The bytes of the value in that input.
    pub place: Place,
}

impl Origin {
    /// For people, at a line and column of its text that are known.
    pub(super) fn words(&self, [line, column]: [usize; 2]) -> String {
        let name = &self.place.name;
        match &self.source {
            InputKind::File => format!("{name}:{line}:{column}"),
            InputKind::Set => format!("--set {}", self.place.text),
            InputKind::Setting(setting) => format!("setting `{setting}` ({name}:{line}:{column})"),
            InputKind::Sweep(axis) => format!("sweep `{axis}` ({name}:{line}:{column})"),
            InputKind::Csv => format!("{name}:{line}"),
        }
    }
}

/// The value of a node. Datetimes, which no key takes, are kept as such for the message.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `true` or `false`.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// Any other number; may be infinite or NaN.
    Float(f64),
    /// A text.
    String(String),
    /// A date or time.
    Datetime,
    /// A list.
    Array(Vec<Node>),
    /// A table.
    Table(BTreeMap<String, Node>),
}

/// A value and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Parsed value.
    pub value: Value,
    /// Where the value is.
    pub origin: Origin,
    /// Where its key is; none for elements of arrays and for the root.
    pub key: Option<Place>,
    /// Whether it is a table written in braces, that is, as one value.
    pub inline: bool,
}

impl Node {
    /// An empty table that an override creates on its way down.
    pub fn empty_table(origin: Origin) -> Node {
        Node {
            value: Value::Table(BTreeMap::new()),
            key: Some(origin.place.clone()),
            origin,
            inline: false,
        }
    }

    /// The entry `key` of a table.
    pub fn get(&self, key: &str) -> Option<&Node> {
        match &self.value {
            Value::Table(entries) => entries.get(key),
            _ => None,
        }
    }

    /// The elements of an array; none of anything else.
    pub fn items(&self) -> &[Node] {
        match &self.value {
            Value::Array(items) => items,
            _ => &[],
        }
    }

    /// The text of a string.
    pub fn as_str(&self) -> Option<&str> {
        match &self.value {
            Value::String(text) => Some(text),
            _ => None,
        }
    }

    /// The node at a path of keys and indices.
    pub fn at(&self, path: &[&str]) -> Option<&Node> {
        path.iter().try_fold(self, |node, word| match &node.value {
            Value::Table(entries) => entries.get(*word),
            Value::Array(items) => items.get(word.parse::<usize>().ok()?),
            _ => None,
        })
    }

    /// The place to report for an error in the whole node: the key of a table, else the value.
    pub fn place(&self) -> &Place {
        match (&self.value, &self.key) {
            (Value::Table(_), Some(key)) if !self.inline => key,
            _ => &self.origin.place,
        }
    }

    /// The value without places. Numbers that JSON lacks and datetimes become null.
    pub fn to_json(&self) -> serde_json::Value {
        match &self.value {
            Value::Bool(value) => json!(value),
            Value::Integer(value) => json!(value),
            Value::Float(value) => json!(value),
            Value::String(value) => json!(value),
            Value::Datetime => serde_json::Value::Null,
            Value::Array(items) => items.iter().map(Node::to_json).collect(),
            Value::Table(entries) => {
                entries.iter().map(|(key, node)| (key.clone(), node.to_json())).collect()
            }
        }
    }

    /// The value as a label: a text without quotes, anything else as compact JSON.
    pub fn label(&self) -> String {
        match &self.value {
            Value::String(text) => text.clone(),
            _ => self.to_json().to_string(),
        }
    }
}

/// Parses a whole file.
///
/// # Errors
/// Every syntax error, each with its place.
pub(crate) fn parse(name: &str, text: &str) -> Result<Node, Vec<Diagnostic>> {
    let reader = Reader { name: name.into(), text: text.into(), offset: 0, source: InputKind::File };
    let (table, errors) = DeTable::parse_recoverable(text);
    if let (false, Some(open)) = (errors.is_empty(), unclosed(text)) {
        let sign = &text[open..=open];
        let close = if sign == "{" { "}" } else { "]" };
        let rule = format!("this `{sign}` is not closed");
        // What the parser makes of the text behind it helps nobody.
        let help = Some(format!("end it with `{close}`"));
        return Err(vec![Diagnostic { rule, place: Some(reader.place(open..open + 1)), help }]);
    }
    if let Some(finding) = errors.iter().find_map(|error| reader.single_bracket(error)) {
        return Err(vec![finding]);
    }
    let mut findings: Vec<Diagnostic> = errors.iter().map(|e| reader.syntax_error(e)).collect();
    let span = table.span();
    let root = reader.table(table.get_ref(), span, &mut findings);
    syntax::keep_first_of_lines(&mut findings);
    if findings.is_empty() { Ok(root) } else { Err(findings) }
}

/// The first bracket of a text that no bracket closes; comments and texts in quotes hold none.
fn unclosed(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let mut open: Vec<usize> = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let rest = &text.as_bytes()[at..];
        let long = [&b"\"\"\""[..], b"'''"].into_iter().find(|quotes| rest.starts_with(quotes));
        match bytes[at] {
            b'#' => at += rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len()),
            _ if long.is_some() => {
                let quotes = long.unwrap_or_default();
                let end = rest[3..].windows(3).position(|w| w == quotes).unwrap_or(rest.len());
                at = (at + 3 + end + 3).min(bytes.len());
                continue;
            }
            quote @ (b'"' | b'\'') => {
                let mut end = 1;
                while end < rest.len() && rest[end] != quote && rest[end] != b'\n' {
                    end += if rest[end] == b'\\' && quote == b'"' { 2 } else { 1 };
                }
                at += end;
            }
            b'{' | b'[' => open.push(at),
            close @ (b'}' | b']') => {
                let wanted = if close == b'}' { b'{' } else { b'[' };
                match open.pop() {
                    Some(last) if bytes[last] == wanted => {}
                    other => return other,
                }
            }
            _ => {}
        }
        at += 1;
    }
    open.first().copied()
}

/// Parses `key=value`, the argument of `--set`, into the dotted key and the value; a value that is
/// not TOML but a plain word is a string.
///
/// # Errors
/// Every syntax error, each with its place in the argument.
pub(crate) fn parse_set(argument: &str) -> Result<(String, Node), Vec<Diagnostic>> {
    let reader =
        Reader { name: "--set".into(), text: argument.into(), offset: 0, source: InputKind::Set };
    let Some((key, value)) = argument.split_once('=') else {
        return Err(vec![Diagnostic {
            rule: "`--set` needs `key=value`".into(),
            place: Some(reader.place(0..argument.len())),
            help: Some("for example `--set budget.passes=64`".into()),
        }]);
    };
    let blanks = value.len() - value.trim_start().len();
    let reader = Reader { offset: key.len() + 1 + blanks, ..reader };
    let value = value.trim();
    let mut findings = Vec::new();
    let mut node = match DeValue::parse_recoverable(value) {
        (parsed, errors) if errors.is_empty() => reader.node(&parsed, &mut findings),
        _ if is_plain(value) => reader.leaf(Value::String(value.into()), 0..value.len()),
        (_, errors) => return Err(errors.iter().map(|e| reader.syntax_error(e)).collect()),
    };
    node.key = Some(Reader { offset: 0, ..reader.clone() }.place(0..key.len()));
    if findings.is_empty() { Ok((key.trim().to_string(), node)) } else { Err(findings) }
}

/// Whether a text that is not TOML was meant as a string: letters, digits and the signs of paths.
fn is_plain(text: &str) -> bool {
    text.starts_with(|c: char| c.is_alphabetic() || "_./~".contains(c))
        && text.chars().all(|c| c.is_alphanumeric() || "_-./~ ".contains(c))
}

/// Turns what the crate parsed into nodes whose places point into `text`.
#[derive(Clone)]
struct Reader {
    name: Arc<str>,
    text: Arc<str>,
    offset: usize,
    source: InputKind,
}

impl Reader {
    fn place(&self, span: Range<usize>) -> Place {
        let end = self.text.len();
        let span = (span.start + self.offset).min(end)..(span.end + self.offset).min(end);
        Place { name: self.name.clone(), text: self.text.clone(), span }
    }

    fn leaf(&self, value: Value, span: Range<usize>) -> Node {
        let inline = self.text[(span.start + self.offset).min(self.text.len())..].starts_with('{');
        let origin = Origin { source: self.source.clone(), place: self.place(span) };
        Node { value, origin, key: None, inline }
    }

    /// A header `[light]` among headers `[[light]]`, which makes its keys those of another entry.
    fn single_bracket(&self, error: &TomlError) -> Option<Diagnostic> {
        let place = self.place(error.span()?);
        let (key, begin) = (place.text(), place.span.start);
        let before = self.text[..begin].rsplit('\n').next().unwrap_or("");
        let is_header = before.trim() == "[" && self.text.contains(&format!("[[{key}]]"));
        let rule = format!("`[{key}]` beside `[[{key}]]`");
        let help = Some(format!("write `[[{key}]]`, with two brackets, before every entry of a list"));
        is_header.then(|| Diagnostic { rule, place: Some(place.clone()), help })
    }

    fn syntax_error(&self, error: &TomlError) -> Diagnostic {
        syntax::finding(error.message(), self.place(error.span().unwrap_or(0..0)))
    }

    fn table(&self, table: &DeTable, span: Range<usize>, findings: &mut Vec<Diagnostic>) -> Node {
        let mut entries = BTreeMap::new();
        for (key, value) in table {
            let mut node = self.node(value, findings);
            node.key = Some(self.place(key.span()));
            entries.insert(key.get_ref().to_string(), node);
        }
        self.leaf(Value::Table(entries), span)
    }

    fn node(&self, parsed: &Spanned<DeValue>, findings: &mut Vec<Diagnostic>) -> Node {
        let span = parsed.span();
        let value = match parsed.get_ref() {
            DeValue::Table(table) => return self.table(table, span, findings),
            DeValue::Array(items) => {
                Value::Array(items.iter().map(|i| self.node(i, findings)).collect())
            }
            DeValue::String(text) => Value::String(text.to_string()),
            DeValue::Boolean(value) => Value::Bool(*value),
            DeValue::Datetime(_) => Value::Datetime,
            DeValue::Float(number) => match number.as_str().parse() {
                Ok(value) => Value::Float(value),
                Err(_) => self.bad_number("the number cannot be read", &span, findings),
            },
            DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
                Ok(value) => Value::Integer(value),
                Err(_) => self.bad_number("the integer must fit into 64 bits", &span, findings),
            },
        };
        self.leaf(value, span)
    }

    fn bad_number(&self, rule: &str, span: &Range<usize>, findings: &mut Vec<Diagnostic>) -> Value {
        let place = Some(self.place(span.clone()));
        findings.push(Diagnostic { rule: rule.into(), place, help: None });
        Value::Integer(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_keys_know_their_places() {
        let text = "a.b = { c = [1, 2.5] }\n[d]\ne = true\n";
        let root = parse("x.toml", text).unwrap();
        let at = |path: &[&str]| root.at(path).unwrap();
        assert_eq!(at(&["a", "b", "c", "1"]).origin.place.line_column(), (1, 17));
        assert_eq!(at(&["a", "b", "c"]).key.as_ref().unwrap().line_column(), (1, 9));
        assert!(at(&["a", "b"]).inline && !at(&["a"]).inline && !at(&["d"]).inline);
        assert_eq!(at(&["a"]).place().line_column(), (1, 1));
        assert_eq!(at(&["d"]).place().line_column(), (2, 2));
        assert_eq!(at(&["d", "e"]).origin.place.line_column(), (3, 5));
        assert_eq!(root.to_json(), json!({"a": {"b": {"c": [1, 2.5]}}, "d": {"e": true}}));
    }

    #[test]
    fn several_syntax_errors_come_out_together() {
        let findings = parse("x.toml", "a = \nb = 1\nc = [1,,2]\nb = 2\n").unwrap_err();
        let lines: Vec<_> = findings.iter().map(|f| f.place.as_ref().unwrap().line_column().0).collect();
        assert!(lines.contains(&1) && lines.contains(&3) && lines.contains(&4), "{findings:#?}");
    }

    #[test]
    fn integers_beyond_64_bits_are_refused() {
        let findings = parse("x.toml", "a = 99999999999999999999").unwrap_err();
        assert_eq!(findings[0].rule, "the integer must fit into 64 bits");
    }

    #[test]
    fn set_takes_toml_values_and_bare_words() {
        let value = |argument| parse_set(argument).unwrap().1.to_json();
        assert_eq!(value("a.b=1.5"), json!(1.5));
        assert_eq!(value("a = [1, 2]"), json!([1, 2]));
        assert_eq!(value("a=ggx"), json!("ggx"));
        assert_eq!(value("a=meshes/bunny.obj"), json!("meshes/bunny.obj"));
        let (key, node) = parse_set("a.b = 3").unwrap();
        assert_eq!((key.as_str(), node.origin.place.line_column()), ("a.b", (1, 7)));
        assert!(parse_set("a=[1,").is_err());
        assert!(parse_set("a").unwrap_err()[0].rule.contains("key=value"));
    }
}
