//! The output of `run`: a row per measurement, short enough for a terminal.

use super::data::{FOREIGN_TIMING, ReportData};
use super::document::TableBlock;
use super::summary;
use super::table::Table;
use crate::results::measurements::Measurement;
use crate::results::number::{per_cent, significant, with_error};
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
    fn add<T>(lines: &mut Vec<(String, Vec<T>)>, text: String, of_cell: T) {
        match lines.iter_mut().find(|(known, _)| *known == text) {
            Some((_, cells)) => cells.push(of_cell),
            None => lines.push((text, vec![of_cell])),
        }
    }
    let record = &data.stored.record;
    let (mut notes, mut anomalies) = (Vec::new(), Vec::new());
    for cell in &record.cells {
        for run in &cell.runs {
            let own = run.notes.iter().map(|note| format!("{}: {note}", run.estimator));
            own.for_each(|note| add(&mut notes, note, cell.title()));
            let paths = run.cost.get("paths").copied().unwrap_or(0);
            for (name, count) in run.anomalies.iter().filter(|(_, count)| **count > 0) {
                let share = *count as f64 / paths as f64;
                add(&mut anomalies, format!("{}: `{name}`", run.estimator), (*count, share));
            }
        }
    }
    let is_swept = record.cells.len() > 1;
    let note = |(text, cells): (String, Vec<String>)| match is_swept {
        true => format!("{text} [{}]", cells.join("; ")),
        false => text,
    };
    let mut lines: Vec<String> = notes.into_iter().map(note).collect();
    lines.extend(anomalies.into_iter().map(|(text, cells)| text + &shares(&cells, is_swept)));
    lines.extend(data.stored.has_foreign_timing.then(|| FOREIGN_TIMING.into()));
    lines
}

/// How often something happened in so many cells: counts, and between what shares of the paths they are.
fn shares(cells: &[(u64, f64)], is_swept: bool) -> String {
    let all: u64 = cells.iter().map(|(count, _)| count).sum();
    let least = cells.iter().map(|(_, share)| *share).fold(f64::INFINITY, f64::min);
    let most = cells.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    let [least, most] = [least, most].map(|share| significant(100.0 * share, 2));
    let times = if all == 1 { "time" } else { "times" };
    let of = if is_swept { format!(", in {} cells", cells.len()) } else { String::new() };
    match most.parse::<f64>().is_ok_and(f64::is_finite) {
        true if least == most => format!(" {all} {times}, in {most} % of paths{of}"),
        true => format!(" {all} {times}, in {least} to {most} % of paths{of}"),
        false => format!(" {all} {times}{of}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_cells_are_told_together() {
        assert_eq!(shares(&[(20, 0.05)], false), " 20 times, in 5.0 % of paths");
        assert_eq!(
            shares(&[(20, 0.05), (25, 0.0625)], true),
            " 45 times, in 5.0 to 6.2 % of paths, in 2 cells"
        );
        assert_eq!(shares(&[(1, f64::INFINITY)], false), " 1 time");
    }

    #[test]
    fn lines_are_broken_at_blanks() {
        assert_eq!(wrapped("one two  three\nfour", 9), "one two\nthree\nfour");
        assert_eq!(
            (wrapped("", 5), wrapped("longer-than-a-line x", 5)),
            (String::new(), "longer-than-a-line\nx".into())
        );
    }
}
