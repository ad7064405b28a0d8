//! Rows of a sweep from a CSV file, read with `csv`.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use csv::{ReaderBuilder, StringRecord, Trim};

use super::document::{InputKind, Node, Origin, Value};
use super::rules::Findings;
use super::suggest;
use super::sweep_point::{AxisPoint, RowField};
use crate::error::Place;
use crate::input;

/// Reads the rows that the `csv` entry of a sweep names; `path` is that of the CSV file. None where
/// something is wrong with it; the findings state what.
pub(super) fn points(entry: &Node, path: &Path, findings: &Findings) -> Option<Vec<AxisPoint>> {
    let path_node = entry.get("path")?;
    let text = match input::read_text(path, input::LONGEST_TEXT) {
        Ok(text) => text,
        Err(error) => {
            findings.at(path_node.place(), format!("could not read {}: {error}", path.display()), None);
            return None;
        }
    };
    let file = File { name: path.display().to_string().into(), text: text.into() };
    let mut reader =
        ReaderBuilder::new().comment(Some(b'#')).trim(Trim::All).from_reader(file.text.as_bytes());
    let header: Vec<String> = match reader.headers() {
        Ok(header) => header.iter().map(String::from).collect(),
        Err(error) => {
            findings.at(&file.place(0..0), error.to_string(), None);
            return None;
        }
    };
    let sets = columns(entry, &header, findings)?;
    let mut points = Vec::new();
    let mut is_whole = true;
    for record in reader.records() {
        match record {
            Ok(record) => points.push(point(&file, &header, &sets, &record)),
            Err(error) => {
                is_whole = false;
                let start = error.position().map_or(0, |p| p.byte() as usize);
                findings.at(&file.place(file.line(start)), wrong_length(&error), None);
            }
        }
    }
    if !is_whole || !leave_out(entry, &header, &mut points, findings) {
        return None;
    }
    if points.is_empty() {
        findings.at(path_node.place(), format!("empty sweep: {} has no rows", path.display()), None);
    }
    (!points.is_empty()).then_some(points)
}

/// Leaves out the rows that `except` names; false where the file has no such rows.
fn leave_out(entry: &Node, header: &[String], points: &mut Vec<AxisPoint>, findings: &Findings) -> bool {
    let Some(Value::Table(except)) = entry.get("except").map(|node| &node.value) else { return true };
    let has = |point: &AxisPoint, column: &String, value: &Node| {
        let field = point.columns.get(column).map(|field| number_or_text(&field.text));
        field.is_some_and(|field| is_equal(&value.value, &field))
    };
    let mut is_sound = true;
    for (column, values) in except {
        if !header.contains(column) {
            let known: Vec<&str> = header.iter().map(String::as_str).collect();
            let help = Some(suggest::help(column, &known, "columns"));
            let place = values.key.as_ref().unwrap_or(values.place());
            findings.at(place, format!("the CSV file has no column `{column}`"), help);
            is_sound = false;
            continue;
        }
        for value in values.items() {
            if !points.iter().any(|point| has(point, column, value)) {
                let what = format!("no row of the CSV file has {column} = {}", value.label());
                findings.at(value.place(), what, None);
                is_sound = false;
            }
        }
    }
    let is_left_out = |point: &AxisPoint| {
        let is_one_of =
            |(column, values): (&String, &Node)| values.items().iter().any(|v| has(point, column, v));
        !except.is_empty() && except.iter().all(is_one_of)
    };
    points.retain(|point| !is_left_out(point));
    is_sound
}

/// Whether two values are the same text, or the same number in whatever form.
fn is_equal(a: &Value, b: &Value) -> bool {
    let number = |value: &Value| match value {
        Value::Integer(n) => Some(*n as f64),
        Value::Float(x) => Some(*x),
        _ => None,
    };
    match (a, b) {
        (Value::String(a), Value::String(b)) => a == b,
        _ => number(a).is_some() && number(a) == number(b),
    }
}

fn wrong_length(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("the row has {len} fields, the header {expected_len}")
        }
        _ => error.to_string(),
    }
}

struct File {
    name: Arc<str>,
    text: Arc<str>,
}

impl File {
    fn place(&self, span: Range<usize>) -> Place {
        Place { name: self.name.clone(), text: self.text.clone(), span }
    }

    /// The first line with a row that begins at or after `start`, without its end; the reader gives
    /// positions before the comments that it skips.
    fn line(&self, start: usize) -> Range<usize> {
        let mut end = start;
        for line in self.text[start..].split_inclusive('\n') {
            let row = line.trim_end();
            if !row.is_empty() && !row.starts_with('#') {
                return end..end + row.len();
            }
            end += line.len();
        }
        start..end
    }

    /// Field `index` of the row that begins at `start`; the whole row where it has quotes.
    fn field(&self, start: usize, index: usize) -> Range<usize> {
        let line = self.line(start);
        let row = &self.text[line.clone()];
        let Some(field) = row.split(',').nth(index).filter(|_| !row.contains('"')) else { return line };
        let before: usize = row.split(',').take(index).map(|f| f.len() + 1).sum();
        let blanks = field.len() - field.trim_start().len();
        let start = line.start + before + blanks;
        start..start + field.trim().len()
    }
}

/// A column that sets a key: its index, the dotted key, and where that key is.
struct Set {
    index: usize,
    key: String,
    place: Place,
}

fn columns(entry: &Node, header: &[String], findings: &Findings) -> Option<Vec<Set>> {
    let Some(Value::Table(columns)) = entry.get("columns").map(|node| &node.value) else { return None };
    if columns.is_empty() {
        findings.at(entry.get("columns")?.place(), "empty sweep: `columns` sets no key", None);
        return None;
    }
    let known: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut sets = Vec::new();
    for (name, key) in columns {
        let place = key.key.as_ref().unwrap_or(&key.origin.place);
        match header.iter().position(|h| h == name) {
            Some(index) => {
                sets.push(Set { index, key: key.as_str()?.to_string(), place: key.origin.place.clone() })
            }
            None => {
                let help = Some(suggest::help(name, &known, "columns"));
                findings.at(place, format!("the CSV file has no column `{name}`"), help);
            }
        }
    }
    (sets.len() == columns.len()).then_some(sets)
}

fn point(file: &File, header: &[String], sets: &[Set], record: &StringRecord) -> AxisPoint {
    let start = record.position().map_or(0, |p| p.byte() as usize);
    let text = |index: usize| record.get(index).unwrap_or("").to_string();
    let place = |index| file.place(file.field(start, index));
    let columns: BTreeMap<String, RowField> = header
        .iter()
        .enumerate()
        .map(|(i, name)| (name.clone(), RowField { text: text(i), place: place(i) }))
        .collect();
    let value = |set: &Set| Node {
        value: number_or_text(&text(set.index)),
        origin: Origin { source: InputKind::Csv, place: place(set.index) },
        key: Some(set.place.clone()),
        inline: false,
    };
    let texts: Vec<String> = sets.iter().map(|set| text(set.index)).collect();
    let label = columns.get("label").map_or_else(|| texts.join(", "), |column| column.text.clone());
    let line = file.place(file.line(start));
    AxisPoint {
        label,
        place: line.clone(),
        sets: sets.iter().map(|set| (set.key.clone(), value(set))).collect(),
        columns,
        csv_line: Some(line.line_column().0),
    }
}

fn number_or_text(text: &str) -> Value {
    match (text.parse(), text.parse()) {
        (Ok(integer), _) => Value::Integer(integer),
        (_, Ok(number)) => Value::Float(number),
        _ => Value::String(text.to_string()),
    }
}
