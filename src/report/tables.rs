//! Tables of claims, verdicts, measurements, efficiencies and model errors.

use super::table::Table;
use crate::results::measurements::Measurement;
use crate::results::number::{per_cent, significant, with_error};
use crate::results::record::CostMeasure;
use crate::verify::comparisons::{EfficiencyRow, measure_name};
use crate::verify::model_errors::ModelError;
use crate::verify::verdict::Verdict;

/// Verdicts, with the smallest defect that each test would have found.
pub(crate) fn verdict_table(verdicts: &[Verdict]) -> Table {
    let mut table = Table::new(&[
        "outcome",
        "claim",
        "cell",
        "band",
        "estimators",
        "observable",
        "class",
        "measured",
        "expected",
        "test",
        "statistic",
        "adjusted p",
        "detectable",
        "note",
    ]);
    for v in verdicts {
        let number = |value: Option<f64>, error: Option<f64>| match (value, error) {
            (None, _) => String::new(),
            (Some(value), Some(error)) if error != 0.0 => with_error(value, error),
            // Exact, or without an error of its own.
            (Some(value), _) => significant(value, 6),
        };
        let digits = |x: Option<f64>, digits| x.map_or_else(String::new, |x| significant(x, digits));
        // Relative to the expected value; absolute where that is 0.
        let detectable = match v.expected {
            Some(0.0) => digits(v.detectable, 2),
            _ => v.detectable.map_or_else(String::new, per_cent),
        };
        table.push(vec![
            v.outcome.to_string(),
            v.claim.clone(),
            v.cell_title.clone(),
            v.band.clone(),
            v.estimators.clone(),
            v.observable.clone(),
            v.class.clone(),
            number(v.value, v.std_error),
            number(v.expected, v.expected_error),
            v.test_name(),
            digits(v.statistic, 3),
            digits(v.adjusted_p, 2),
            detectable,
            v.note.clone(),
        ]);
    }
    table.without_empty_columns()
}

/// Claims: the number of comparisons of each claim by outcome.
pub(crate) fn claim_table(verdicts: &[Verdict]) -> Table {
    let mut table = Table::new(&["claim", "comparisons", "pass", "fail", "underpowered", "invalid"]);
    let mut labels: Vec<&str> = Vec::new();
    for v in verdicts {
        if !labels.contains(&v.claim.as_str()) {
            labels.push(&v.claim);
        }
    }
    for label in labels {
        let own: Vec<String> =
            verdicts.iter().filter(|v| v.claim == label).map(|v| v.outcome.to_string()).collect();
        let count = |outcome: &str| own.iter().filter(|o| *o == outcome).count().to_string();
        let counts = table.header[2..].iter().map(|outcome| count(outcome));
        let row = [label.to_string(), own.len().to_string()].into_iter().chain(counts).collect();
        table.push(row);
    }
    table
}

/// Model errors: a row for each model, observable, class and band.
pub(crate) fn model_error_table(rows: &[ModelError]) -> Table {
    let mut table = Table::new(&[
        "cell",
        "model of",
        "band",
        "observable",
        "class",
        "model",
        "truth",
        "model error",
        "note",
    ]);
    for row in rows {
        let (low, high) = row.interval();
        let percent = |x: f64| format!("{:+.1}", 100.0 * x);
        table.push(vec![
            row.cell.clone(),
            row.estimator.clone(),
            row.band.clone(),
            row.observable.name.clone(),
            row.observable.class.clone(),
            with_error(row.value.value, row.value.std_error),
            with_error(row.expected.value, row.expected.std_error),
            format!("{} [{}, {}] %", percent(row.relative.value), percent(low), percent(high)),
            row.note.clone(),
        ]);
    }
    table.without_empty_columns()
}

/// Efficiencies: a row for each pair, class and measure of cost.
pub(crate) fn comparison_table(rows: &[EfficiencyRow]) -> Table {
    let mut table = Table::new(&[
        "cell",
        "candidate",
        "against",
        "band",
        "variance of",
        "class",
        "cost",
        "efficiency",
        "variance",
        "kurtosis",
        "note",
    ]);
    for row in rows {
        let number = |x: f64| significant(x, 3);
        let efficiency = match row.quoted() {
            Some(numbers) => {
                let [ratio, low, high] = numbers.map(number);
                format!("{ratio} [{low}, {high}]")
            }
            None => row.at_least.map_or_else(String::new, at_least),
        };
        let cost = match (row.cost, row.interleaved) {
            (CostMeasure::Cpu, false) => "cpu, not interleaved",
            (cost, _) => measure_name(cost),
        };
        let kurtosis = row.kurtosis_candidate.zip(row.kurtosis_baseline);
        let kurtosis = kurtosis.map_or_else(String::new, |(candidate, baseline)| {
            format!("{}, {}", number(candidate), number(baseline))
        });
        table.push(vec![
            row.cell.clone(),
            row.candidate.clone(),
            row.baseline.clone(),
            row.band.clone(),
            row.metric.clone(),
            row.class.clone(),
            cost.into(),
            efficiency,
            row.variance_ratio.map_or_else(String::new, number),
            kurtosis,
            row.note.clone(),
        ]);
    }
    table.without_empty_columns()
}

/// A lower bound, rounded down: three digits are at most 0.5 % too high.
pub(crate) fn at_least(bound: f64) -> String {
    format!("at least {}", significant(0.995 * bound, 3))
}

/// Measurements: a row for each estimator, observable and class, a column for each band.
pub(crate) fn measurement_table(rows: &[&Measurement], bands: &[String]) -> Table {
    let mut header = vec!["estimator", "observable", "class"];
    header.extend(bands.iter().map(String::as_str));
    let mut table = Table::new(&header);
    // Rows come with the bands of one observable together.
    for group in rows.chunks(bands.len().max(1)) {
        let first = group[0];
        let mut row = vec![first.estimator.clone(), first.observable.clone(), first.class.clone()];
        row.extend(group.iter().map(|m| with_error(m.mean, m.std_error)));
        table.push(row);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::measurements::measurements;
    use crate::results::sample;
    use crate::verify::judge::judge_alone;

    #[test]
    fn measurements_have_a_column_a_band() {
        let rows = measurements(&sample::stored(0.5), None);
        let rows: Vec<&Measurement> = rows.iter().collect();
        let table = measurement_table(&rows, &["R".into(), "G".into()]);
        assert_eq!((table.rows.len(), table.header.len()), (4, 5));
        assert!(table.rows[3][4].contains('('), "{:?}", table.rows);
    }

    #[test]
    fn claims_are_counted() {
        let verdicts = judge_alone(&sample::judged(&[("a", 1.0), ("b", 2.0), ("a", 2.0)]));
        assert_eq!(
            claim_table(&verdicts).rows,
            [["a", "2", "1", "1", "0", "0"], ["b", "1", "0", "1", "0", "0"]]
        );
    }

    #[test]
    fn verdicts_show_what_they_could_see() {
        let text = verdict_table(&judge_alone(&sample::judged(&[("holds", 1.0)]))).to_text();
        assert!(text.contains("pass     holds  boundary = smooth  R     mis"), "{text}");
        assert!(text.contains(" %"), "{text}");
    }
}
