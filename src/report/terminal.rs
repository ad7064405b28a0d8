//! The output of `run`: a row per measurement, short enough for a terminal.

use super::data::{FOREIGN_TIMING, ReportData};
use super::document::TableBlock;
use super::number::{per_cent, significant, with_error};
use super::summary;
use super::table::Table;
use crate::results::measurements::Measurement;
use crate::results::record::CostMeasure;
use crate::verify::comparisons::EfficiencyRow;
use crate::verify::verdict::{TestKind, Verdict};

/// One row per cell and estimator: the sensor's first observable in every band, passes, CPU time, speed.
pub(crate) fn run_table(data: &ReportData) -> Table {
    let record = &data.stored.record;
    let mut header = vec!["cell", "estimator", "observable"];
    header.extend(record.bands.iter().map(|band| band.name.as_str()));
    header.extend(["passes", "CPU s", "paths/s/core"]);
    let mut table = Table::new(&header);
    for cell in &record.cells {
        for run in &cell.runs {
            let Some(first) = run.observables.first() else { continue };
            let own = |m: &&Measurement| {
                let observable = m.observable == first.name && m.class == first.class;
                observable && m.cell == cell.label && m.estimator == run.estimator
            };
            let mut row = vec![cell.label.clone(), run.estimator.clone(), first.name.clone()];
            row.extend(data.rows.iter().filter(own).map(|m| with_error(m.mean, m.std_error)));
            let cost = data.stored.timing.as_ref().and_then(|t| t.of(&cell.label, &run.estimator));
            let rate = cost.and_then(|c| c.paths_per_second());
            row.push(run.passes.to_string());
            row.push(cost.map_or(String::new(), |c| significant(c.all_seconds(), 3)));
            row.push(rate.map_or(String::new(), |rate| significant(rate, 3)));
            table.push(row);
        }
    }
    if table.rows.is_empty() { Table::default() } else { table }
}

/// One row per sampler: the number of its tests and of those that are green, and the smallest defect
/// that they would have found.
pub(crate) fn sampler_table(data: &ReportData) -> Table {
    let record = &data.stored.record;
    let header = ["sampler", "draws", "bins", "tests", "green", "detectable", "CPU s", "draws/s/core"];
    let mut table = Table::new(&header);
    for run in &record.samplers {
        let is_own = |v: &&Verdict| {
            v.estimators == run.sampler && v.test.as_ref().is_some_and(TestKind::is_of_sampler)
        };
        let own = || data.verdicts.iter().filter(is_own);
        let green = own().filter(|v| v.is_green()).count();
        let coarse = own().find(|v| v.test == Some(TestKind::Chi2Coarse));
        let bins = [Some(&run.coarse), run.fine.as_ref()].into_iter().flatten();
        let bins = bins.filter_map(|path| data.stored.bins(path));
        let bins: Vec<String> = bins.map(|bins| (bins.mass.len() - 1).to_string()).collect();
        let cost = data.stored.timing.as_ref().and_then(|t| t.of("", &run.sampler));
        let rate = cost.and_then(|c| c.paths_per_second());
        table.push(vec![
            run.sampler.clone(),
            run.samples.to_string(),
            bins.join(" + "),
            own().count().to_string(),
            green.to_string(),
            coarse.and_then(|v| v.detectable).map_or_else(String::new, per_cent),
            cost.map_or(String::new(), |c| significant(c.all_seconds(), 3)),
            rate.map_or(String::new(), |rate| significant(rate, 3)),
        ]);
    }
    if table.rows.is_empty() { Table::default() } else { table.without_empty_columns() }
}

/// One efficiency per pair of estimators: by CPU time where it was measured, else by
/// counted work.
pub(crate) fn efficiency_table(data: &ReportData) -> Option<TableBlock> {
    let by = |cost| summary::efficiency(&data.stored, &data.comparisons, cost);
    by(CostMeasure::Cpu).or_else(|| by(CostMeasure::Counters))
}

/// The rows of that table.
pub(crate) fn efficiency_rows(data: &ReportData) -> Vec<&EfficiencyRow> {
    let by = |cost| summary::chosen(&data.stored, &data.comparisons, cost);
    let has_ratio = |rows: &Vec<&EfficiencyRow>| rows.iter().any(|row| row.quoted().is_some());
    Some(by(CostMeasure::Cpu)).filter(has_ratio).unwrap_or_else(|| by(CostMeasure::Counters))
}

/// Why a row has no ratio.
pub(crate) fn reason(row: &EfficiencyRow) -> &str {
    row.note.strip_prefix("no mean test: ").unwrap_or(&row.note)
}

/// A text in lines of at most `width` characters, broken at blanks.
pub(crate) fn wrapped(text: &str, width: usize) -> String {
    let (mut lines, mut length) = (String::new(), 0);
    for word in text.split_whitespace() {
        let letters = word.chars().count();
        if length > 0 && length + 1 + letters > width {
            lines.push('\n');
            length = 0;
        } else if length > 0 {
            lines.push(' ');
            length += 1;
        }
        lines += word;
        length += letters;
    }
    lines
}

/// Notes of estimators and counts of anomalies, each once, with its cells.
pub(crate) fn notes(data: &ReportData) -> Vec<String> {
    let mut lines: Vec<(String, Vec<String>)> = Vec::new();
    let mut add = |text: String, cell: &str| match lines.iter_mut().find(|(known, _)| *known == text) {
        Some((_, cells)) => cells.push(cell.to_string()),
        None => lines.push((text, vec![cell.to_string()])),
    };
    for cell in &data.stored.record.cells {
        let title = cell.title();
        for run in &cell.runs {
            run.notes.iter().for_each(|note| add(format!("{}: {note}", run.estimator), &title));
            for (name, _) in run.anomalies.iter().filter(|(_, count)| **count > 0) {
                let total = run.cost.get("paths").copied().unwrap_or(0);
                let count = run.anomalies[name];
                add(format!("{}: {count} of `{name}` in {total} paths", run.estimator), &title);
            }
        }
    }
    if data.stored.has_foreign_timing {
        add(FOREIGN_TIMING.into(), "");
    }
    let line = |(text, cells): (String, Vec<String>)| {
        let cells: Vec<String> = cells.into_iter().filter(|cell| !cell.is_empty()).collect();
        if cells.is_empty() { text } else { format!("{text} [{}]", cells.join("; ")) }
    };
    lines.into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_at_blanks() {
        assert_eq!(wrapped("one two  three\nfour", 9), "one two\nthree\nfour");
        assert_eq!(
            (wrapped("", 5), wrapped("longer-than-a-line x", 5)),
            (String::new(), "longer-than-a-line\nx".into())
        );
    }
}
