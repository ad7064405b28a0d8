//! Tables that papers quote: a row for each cell and band, a column for each estimator.

use super::document::TableBlock;
use super::table::Table;
use super::tables::at_least;
use crate::results::counted_work;
use crate::results::measurements::Measurement;
use crate::results::number::{significant, with_error};
use crate::results::record::{Cell, CostMeasure, PIXELS};
use crate::results::store::Stored;
use crate::verify::comparisons::EfficiencyRow;
use crate::verify::model_errors::ModelError;

/// The rows by one measure of cost that represent a pair of estimators: all classes together, and pixels
/// rather than their mean. Second arms of one estimator are left out.
pub(crate) fn chosen<'a>(
    stored: &Stored,
    rows: &'a [EfficiencyRow],
    cost: CostMeasure,
) -> Vec<&'a EfficiencyRow> {
    let is_control = |row: &EfficiencyRow| {
        let cell = stored.record.cells.iter().find(|cell| cell.label == row.cell);
        let run = cell.and_then(|cell| cell.runs.iter().find(|run| run.estimator == row.candidate));
        run.is_some_and(|run| run.control_of.is_some())
    };
    let has_pixels = rows.iter().any(|row| row.metric == PIXELS);
    let is_chosen = |row: &&EfficiencyRow| {
        row.cost == cost
            && row.class == "all"
            && (!has_pixels || row.metric == PIXELS)
            && !is_control(row)
    };
    rows.iter().filter(is_chosen).collect()
}

/// The quantity whose variance is compared.
pub(crate) fn metric_words(row: &EfficiencyRow) -> String {
    if row.metric == PIXELS {
        "a pixel (averaged over the image)".into()
    } else {
        format!("`{}`", row.metric)
    }
}

/// Efficiencies by one measure of cost; nothing where there is no ratio.
pub(crate) fn efficiency(
    stored: &Stored,
    rows: &[EfficiencyRow],
    cost: CostMeasure,
) -> Option<TableBlock> {
    let rows = chosen(stored, rows, cost);
    let quoted = rows.iter().find(|row| row.quoted().is_some() || row.at_least.is_some())?;
    let name = |row: &EfficiencyRow| format!("{} / {}", row.candidate, row.baseline);
    let entries = rows.iter().map(|row| PivotEntry {
        cell: row.cell.clone(),
        names: vec![row.band.clone()],
        column: name(row),
        text: ratio(row),
    });
    let table = pivot(stored, &["band"], entries.collect());
    let what = metric_words(quoted);
    let (cost, how) = match cost {
        CostMeasure::Counters => ("counted work", counters_words(stored, &rows)),
        CostMeasure::Cpu => ("CPU time", format!("of this machine, {}", clock_words(&rows))),
    };
    let mut caption = format!(
        "Efficiency: A / B is the variance of {what} times {cost} ({how}) of B over that of A; above 1 A is the \
         better. In brackets the 95 % interval."
    );
    if rows.iter().any(|row| row.quoted().is_some() && !row.resolved) {
        caption += " An asterisk: not resolved, more passes may move the ratio out of its interval.";
    }
    if rows.iter().any(|row| row.quoted().is_none() && row.at_least.is_some()) {
        caption += " \"At least\": the tail of B is not resolved, and the ratio is above this number with 97.5 % \
                    confidence, if the means agree, which such a tail leaves open.";
    }
    if rows.iter().any(|row| row.quoted().is_none() && row.at_least.is_none()) {
        caption += " Where there is none, comparisons.csv has the whole reason.";
    }
    let file = if quoted.cost == CostMeasure::Cpu { "efficiency" } else { "efficiency-counters" };
    Some(TableBlock::new(file, caption, table))
}

/// How CPU times came about.
pub(crate) fn clock_words(rows: &[&EfficiencyRow]) -> String {
    let controls = || rows.iter().filter_map(|row| row.control_ratio);
    let number = |x: f64| significant(x, 4);
    match rows.iter().filter(|row| row.interleaved).count() {
        0 => "not interleaved: what the machine did between two estimators is in their ratio".into(),
        some if some < rows.len() => "interleaved in a part of the cells: see comparisons.csv".into(),
        _ => format!(
            "interleaved: the estimators of a cell by turns, A B B A, and the first of them against itself {} to {}",
            number(controls().fold(f64::INFINITY, f64::min)),
            number(controls().fold(0.0, f64::max))
        ),
    }
}

/// What counted work says.
fn counters_words(stored: &Stored, rows: &[&EfficiencyRow]) -> String {
    let cell = |row: &EfficiencyRow| stored.record.cells.iter().find(|cell| cell.label == row.cell);
    let kind = |row: &EfficiencyRow, name: &str| {
        Some(cell(row)?.runs.iter().find(|run| run.estimator == name)?.kind.clone())
    };
    let factor = |row: &&EfficiencyRow| {
        let (a, b) = kind(row, &row.candidate).zip(kind(row, &row.baseline))?;
        counted_work::factor(&a, &b).ok()
    };
    let same = "the same on every machine";
    match rows.iter().map(factor).collect::<Option<Vec<f64>>>() {
        Some(factors) => {
            let most = factors.into_iter().fold(1.0, f64::max);
            format!("{same}; CPU time may give up to {} times more or less", significant(most, 2))
        }
        None => format!("{same}; never compared with CPU time for some of these kinds"),
    }
}

fn ratio(row: &EfficiencyRow) -> String {
    let Some(numbers) = row.quoted() else {
        if let Some(bound) = row.at_least {
            return at_least(bound);
        }
        let reason = row.note.strip_prefix("no mean test: ").unwrap_or(&row.note);
        return format!("none: {}", reason.split([':', ',']).next().unwrap_or_default());
    };
    let [ratio, low, high] = numbers.map(|x| significant(x, 3));
    let star = if row.resolved { "" } else { "*" };
    format!("{ratio}{star} [{low}, {high}]")
}

/// Means of the sensor's first observable, all classes together.
pub(crate) fn means(stored: &Stored, rows: &[Measurement]) -> Option<TableBlock> {
    let first = |row: &&Measurement| {
        let run = stored.record.cells.iter().find(|cell| cell.label == row.cell)?.runs.first()?;
        let observable = run.observables.first()?;
        Some(row.observable == observable.name && row.class == observable.class)
    };
    let rows: Vec<&Measurement> = rows.iter().filter(|row| first(row) == Some(true)).collect();
    let observable = &rows.first()?.observable;
    let entry = |row: &&Measurement| PivotEntry {
        cell: row.cell.clone(),
        names: vec![row.band.clone()],
        column: row.estimator.clone(),
        text: with_error(row.mean, row.std_error),
    };
    let what = match observable.as_str() {
        "mean" => "Image mean".to_string(),
        other => format!("Mean of `{other}`"),
    };
    let caption = format!(
        "{what}, all transport classes together; in brackets one standard error in units of the \
         last digit."
    );
    Some(TableBlock::new("means", caption, pivot(stored, &["band"], rows.iter().map(entry).collect())))
}

/// Model errors of all classes together; nothing where there are no models.
pub(crate) fn model_errors(stored: &Stored, rows: &[ModelError]) -> Option<TableBlock> {
    let rows: Vec<&ModelError> = rows.iter().filter(|row| row.observable.class == "all").collect();
    let truth = &rows.first()?.truth;
    let entry = |row: &&ModelError| {
        let (low, high) = row.interval();
        let percent = |x: f64| format!("{:+.1}", 100.0 * x);
        let star = if row.note.is_empty() { "" } else { "*" };
        PivotEntry {
            cell: row.cell.clone(),
            names: vec![row.band.clone(), row.observable.name.clone()],
            column: row.estimator.clone(),
            text: format!("{}{star} [{}, {}]", percent(row.relative.value), percent(low), percent(high)),
        }
    };
    let table = pivot(stored, &["band", "observable"], rows.iter().map(entry).collect());
    let mut caption = format!(
        "Error of each model's mean, per cent of that of `{truth}`, which is light transport itself. \
         In brackets the 95 % interval."
    );
    if rows.iter().any(|row| !row.note.is_empty()) {
        caption += " An asterisk: the interval is not to be trusted, for the reason that model_errors.csv gives.";
    }
    Some(TableBlock::new("model-error", caption, table))
}

/// A field of a table: the cell and the names that identify its row, its column, and its text.
struct PivotEntry {
    cell: String,
    names: Vec<String>,
    column: String,
    text: String,
}

impl PivotEntry {
    fn row(&self) -> (&str, &[String]) {
        (&self.cell, &self.names)
    }
}

/// A row for each cell and name, a column for each axis of the sweep, each part of the names, and each
/// column of the entries, in the order in which they come. Columns with the same text in every row
/// are left out.
fn pivot(stored: &Stored, parts: &[&str], entries: Vec<PivotEntry>) -> Table {
    let axes: Vec<&String> =
        stored.record.cells.first().map(|cell| cell.axes.keys().collect()).unwrap_or_default();
    let (mut rows, mut columns): (Vec<(&str, &[String])>, Vec<&String>) = (Vec::new(), Vec::new());
    for entry in &entries {
        if !rows.contains(&entry.row()) {
            rows.push(entry.row());
        }
        if !columns.contains(&&entry.column) {
            columns.push(&entry.column);
        }
    }
    let header: Vec<&str> = axes.iter().chain(&columns).map(|name| name.as_str()).collect::<Vec<_>>();
    let (axis_names, column_names) = header.split_at(axes.len());
    let mut table = Table::new(&[axis_names, parts, column_names].concat());
    for row in rows {
        let cell: Option<&Cell> = stored.record.cells.iter().find(|cell| cell.label == row.0);
        let label =
            |axis: &&String| cell.and_then(|cell| cell.axes.get(*axis)).cloned().unwrap_or_default();
        let mut fields: Vec<String> = axes.iter().map(label).collect();
        fields.extend(row.1.iter().cloned());
        fields.extend(columns.iter().map(|column| {
            let own = entries.iter().find(|entry| entry.row() == row && entry.column == **column);
            own.map(|entry| entry.text.clone()).unwrap_or_default()
        }));
        table.push(fields);
    }
    for column in (0..axes.len() + parts.len()).rev() {
        if table.rows.iter().all(|row| row[column] == table.rows[0][column]) {
            table.remove_column(column);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;
    use crate::verify::comparisons::comparisons;

    #[test]
    fn a_row_a_band_and_a_column_a_pair() {
        let stored = sample::stored(0.1);
        let rows = comparisons(&stored);
        let block = efficiency(&stored, &rows, CostMeasure::Counters).expect("a table");
        assert_eq!(block.name, "efficiency-counters");
        assert_eq!(block.table.header, ["band", "snee / mis"], "one cell has no column");
        assert_eq!(block.table.rows.iter().map(|row| &*row[0]).collect::<Vec<_>>(), ["R", "G"]);
        assert!(block.table.rows[0][1].ends_with(']'), "{:?}", block.table.rows);
        assert!(block.caption.contains("a pixel") && block.caption.contains("counted work"));
        assert!(efficiency(&stored, &rows, CostMeasure::Cpu).is_none(), "no time was measured");
    }

    #[test]
    fn heads_say_how_times_came_about() {
        let row = |interleaved, control_ratio| EfficiencyRow {
            at_least: Some(2.0),
            interleaved,
            control_ratio,
            ..EfficiencyRow::default()
        };
        let (with, other, apart) = (row(true, Some(0.9981)), row(true, Some(1.0042)), row(false, None));
        assert!(clock_words(&[&with, &other]).ends_with("against itself 0.9981 to 1.004"));
        assert!(clock_words(&[&apart]).starts_with("not interleaved"));
        assert!(clock_words(&[&with, &apart]).contains("a part of the cells"));
        assert_eq!(ratio(&with), "at least 1.99");
    }

    #[test]
    fn means_stand_with_their_errors() {
        let stored = sample::stored(0.1);
        let rows = crate::results::measurements::measurements(&stored, None);
        let block = means(&stored, &rows).expect("a table");
        assert_eq!(block.table.header, ["band", "mis", "snee"]);
        assert!(block.table.rows.iter().all(|row| row[1].contains('(') && row[2].contains('(')));
    }

    #[test]
    fn a_missing_ratio_is_shown_as_missing() {
        let mut stored = sample::stored(0.1);
        sample::set_observables(&mut stored, "snee", |i, _, band| {
            let off = if band == 0 { 0.3 } else { 0.0 };
            1.0 + off + 0.05 * sample::uniform(i + 7000)
        });
        let rows = comparisons(&stored);
        let block = efficiency(&stored, &rows, CostMeasure::Counters).expect("a table");
        assert_eq!(block.table.rows[0][1], "none: the means differ");
        assert!(block.caption.contains("whole reason"));
    }
}
