//! Spectra from columns of CSV files, averaged over bands.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use csv::{ReaderBuilder, Trim};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value as Json, json};

use super::document::{InputKind, Node, Origin, Value};
use super::resolve::BandInterval;
use super::rules::Findings;
use super::suggest;
use super::sweep::resolve_path;
use super::validate::SchemaWalk;
use super::validate::grammar::Grammar;
use crate::error::Place;
use crate::input;

/// A value per band from a table over wavelength: the mean over each band.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SpectrumFile {
    /// Column of a CSV file with a header; lines that start with # are comments.
    csv: SpectrumColumn,
}

/// A column of a table over wavelength.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SpectrumColumn {
    /// Path, relative to the experiment file.
    path: String,
    /// Column of the wavelengths, which increase.
    wavelength: String,
    /// Unit of the wavelengths.
    unit: WavelengthUnit,
    /// Column of the values.
    column: String,
    /// What holds between two rows.
    interpolation: SpectrumInterpolation,
    /// Factor on the values, for example 0.1 from 1/cm to 1/mm; 1 without it.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    scale: Option<f64>,
}

/// Unit of wavelengths.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum WavelengthUnit {
    /// Nanometres.
    Nm,
    /// Micrometres.
    Um,
}

/// The function that a table's rows stand for.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum SpectrumInterpolation {
    /// Straight lines between rows.
    Linear,
    /// The value of the nearest row.
    Nearest,
}

/// Adds spectra from files to the schema of an experiment file, wherever it takes a value per band.
pub(super) fn extend_schema(schema: &mut Json) {
    let mut own = schemars::schema_for!(SpectrumFile).to_value();
    if let Some(Json::Object(definitions)) = own.as_object_mut().and_then(|own| own.remove("$defs")) {
        for (name, definition) in definitions {
            schema["$defs"][name] = definition;
        }
    }
    if let Some(own) = own.as_object_mut() {
        own.remove("$schema");
        own.remove("title");
    }
    schema["$defs"][NAME] = own;
    for taker in ["Spectrum", "Eta"] {
        if let Some(forms) = schema["$defs"][taker]["anyOf"].as_array_mut() {
            forms.push(json!({ "$ref": format!("#/$defs/{NAME}") }));
        }
    }
}

/// Definition of a spectrum from a file in the schema.
const NAME: &str = "SpectrumFile";

/// Replaces every table `{ csv = ... }` below `node` by a list with its mean over each band. What is wrong
/// with one is found, and a number stands for it then.
pub(super) fn resolve(
    node: &mut Node,
    bands: Option<&[BandInterval]>,
    experiment: &Path,
    grammar: &Grammar,
    findings: &Findings,
) {
    match &mut node.value {
        Value::Table(entries) if entries.len() == 1 && entries.contains_key("csv") => {
            let means = means(node, bands, experiment, grammar, findings);
            let origin = node.origin.clone();
            node.inline = false;
            node.value = match means {
                Some((place, means)) => {
                    let origin = Origin { source: InputKind::Csv, place };
                    let number = |x: f64| Node {
                        value: Value::Float(x),
                        origin: origin.clone(),
                        key: None,
                        inline: false,
                    };
                    Value::Array(means.into_iter().map(number).collect())
                }
                None => Value::Float(0.5),
            };
            node.origin = origin;
        }
        Value::Table(entries) => {
            entries.values_mut().for_each(|entry| resolve(entry, bands, experiment, grammar, findings))
        }
        Value::Array(items) => {
            items.iter_mut().for_each(|item| resolve(item, bands, experiment, grammar, findings));
        }
        _ => {}
    }
}

fn means(
    node: &Node,
    bands: Option<&[BandInterval]>,
    experiment: &Path,
    grammar: &Grammar,
    findings: &Findings,
) -> Option<(Place, Vec<f64>)> {
    let mut walk = SchemaWalk::new(grammar, false);
    walk.node(node, grammar.definition(NAME)?, "");
    let wrong = walk.into_findings();
    let is_sound = wrong.is_empty();
    wrong.into_iter().for_each(|finding| findings.add(finding));
    let words = serde_json::from_value::<SpectrumFile>(node.to_json()).ok().filter(|_| is_sound)?.csv;
    let table = WavelengthTable::read(node.at(&["csv"])?, &words, experiment, findings)?;
    let mut means = Vec::new();
    for band in bands? {
        let Some([from, to]) = band.range_nm else {
            let help = "use `bands.spectral`, or explicit bands with `from_nm` and `to_nm`";
            let rule = format!("a spectrum needs wavelengths, and band `{}` has none", band.name);
            findings.at(node.place(), rule, Some(help.into()));
            return None;
        };
        let Some(mean) = table.mean(from, to, words.interpolation) else {
            let [first, last] = table.range();
            let rule = format!(
                "{} covers {first} to {last} nm, and band `{}` is not within",
                words.path, band.name
            );
            let help = "narrow the bands, or give the table the rows that it lacks";
            findings.at(node.place(), rule, Some(help.into()));
            return None;
        };
        means.push(words.scale.unwrap_or(1.0) * mean);
    }
    Some((table.place, means))
}

/// Values over wavelengths, nm, which increase.
struct WavelengthTable {
    rows: Vec<[f64; 2]>,
    place: Place,
}

impl WavelengthTable {
    fn read(
        node: &Node,
        words: &SpectrumColumn,
        experiment: &Path,
        findings: &Findings,
    ) -> Option<WavelengthTable> {
        let at = |key: &str| node.get(key).map_or(node.place(), Node::place);
        let path = resolve_path(experiment, &words.path);
        let text = match input::read_text(&path, input::LONGEST_TEXT) {
            Ok(text) => text,
            Err(error) => {
                let rule = format!("could not read `{}`: {error}", path.display());
                let help = "its path is relative to the folder of the experiment file";
                findings.at(at("path"), rule, Some(help.into()));
                return None;
            }
        };
        let (name, text): (Arc<str>, Arc<str>) = (path.display().to_string().into(), text.into());
        let place = |line: usize| {
            let start: usize =
                text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
            let end = text[start..].find('\n').map_or(text.len(), |n| start + n);
            Place { name: name.clone(), text: text.clone(), span: start..end }
        };
        let mut reader =
            ReaderBuilder::new().comment(Some(b'#')).trim(Trim::All).from_reader(text.as_bytes());
        let header = reader.headers().ok()?.clone();
        let mut index = BTreeMap::new();
        for (key, column) in [("wavelength", &words.wavelength), ("column", &words.column)] {
            match header.iter().position(|name| name == column) {
                Some(i) => drop(index.insert(key, i)),
                None => {
                    let known: Vec<&str> = header.iter().collect();
                    let help = suggest::help(column, &known, "columns");
                    findings.at(at(key), format!("the CSV file has no column `{column}`"), Some(help));
                }
            }
        }
        let columns = [*index.get("wavelength")?, *index.get("column")?];
        let unit = match words.unit {
            WavelengthUnit::Nm => 1.0,
            WavelengthUnit::Um => 1000.0,
        };
        let mut rows: Vec<[f64; 2]> = Vec::new();
        for record in reader.records() {
            let record = match record {
                Ok(record) => record,
                Err(error) => {
                    let line = error.position().map_or(1, |p| p.line() as usize);
                    findings.at(&place(line), format!("the row cannot be read: {error}"), None);
                    return None;
                }
            };
            let line = record.position().map_or(1, |p| p.line() as usize);
            let mut row = [0.0; 2];
            for (value, column) in row.iter_mut().zip(columns) {
                let text = record.get(column).unwrap_or("");
                match text.parse::<f64>().ok().filter(|x| x.is_finite()) {
                    Some(number) => *value = number,
                    None => {
                        let rule = format!("`{text}` in column `{}` is not a number", &header[column]);
                        let help = "remove the row, or give it a finite number";
                        findings.at(&place(line), rule, Some(help.into()));
                        return None;
                    }
                }
            }
            row[0] *= unit;
            if let Some([last, _]) = rows.last().filter(|[last, _]| *last >= row[0]) {
                let rule = format!("wavelengths must increase, {} nm follows {last} nm", row[0]);
                findings.at(
                    &place(line),
                    rule,
                    Some("sort the rows, and let each wavelength occur once".into()),
                );
                return None;
            }
            rows.push(row);
        }
        if rows.is_empty() {
            findings.at(at("path"), "the CSV file has no rows", None);
            return None;
        }
        Some(WavelengthTable { rows, place: place(1) })
    }

    /// The wavelengths that it covers, nm.
    fn range(&self) -> [f64; 2] {
        [self.rows[0][0], self.rows[self.rows.len() - 1][0]]
    }

    /// The mean over a band; none beyond the table.
    fn mean(&self, from: f64, to: f64, interpolation: SpectrumInterpolation) -> Option<f64> {
        let [first, last] = self.range();
        if from < first || to > last {
            return None;
        }
        let integral: f64 = self
            .rows
            .windows(2)
            .map(|pair| {
                let ([a, left], [b, right]) = (pair[0], pair[1]);
                let (low, high) = (from.max(a), to.min(b));
                if low >= high {
                    return 0.0;
                }
                match interpolation {
                    SpectrumInterpolation::Linear => {
                        let middle = (0.5 * (low + high) - a) / (b - a);
                        (left + (right - left) * middle) * (high - low)
                    }
                    SpectrumInterpolation::Nearest => {
                        let half = 0.5 * (a + b);
                        left * (high.min(half) - low).max(0.0) + right * (high - low.max(half)).max(0.0)
                    }
                }
            })
            .sum();
        Some(integral / (to - from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[[f64; 2]]) -> WavelengthTable {
        let place = Place { name: "".into(), text: "".into(), span: 0..0 };
        WavelengthTable { rows: rows.to_vec(), place }
    }

    /// Means by hand: of a line, across a kink, of steps, and beyond the table.
    #[test]
    fn means_over_bands() {
        use SpectrumInterpolation::{Linear, Nearest};
        let kinked = table(&[[400.0, 0.0], [500.0, 10.0], [700.0, 10.0]]);
        let close = |found: Option<f64>, expected: f64| {
            assert!((found.expect("a mean") - expected).abs() < 1e-12, "{found:?} {expected}");
        };
        close(kinked.mean(400.0, 500.0, Linear), 5.0);
        close(kinked.mean(400.0, 420.0, Linear), 1.0);
        close(kinked.mean(450.0, 550.0, Linear), 0.5 * 7.5 + 0.5 * 10.0);
        close(kinked.mean(400.0, 500.0, Nearest), 5.0);
        close(kinked.mean(400.0, 450.0, Nearest), 0.0);
        close(kinked.mean(440.0, 460.0, Nearest), 5.0);
        close(kinked.mean(400.0, 700.0, Nearest), 10.0 * 250.0 / 300.0);
        assert_eq!(kinked.mean(390.0, 500.0, Linear), None);
        assert_eq!(kinked.mean(600.0, 701.0, Linear), None);
    }
}
