//! Errors of models: their means against light transport itself, in the same cell. Measured, never
//! judged.

use crate::results::csv_text;
use crate::results::record::{Cell, EstimatorRun, Observable};
use crate::results::store::Stored;
use crate::stats::hypothesis::Estimate;
use crate::stats::tails::critical_value;

/// Confidence of the intervals.
pub(crate) const CONFIDENCE: f64 = 0.95;

/// One model's mean against the truth's.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ModelError {
    /// Cell label.
    pub cell: String,
    /// Band name.
    pub band: String,
    /// Observable that is compared.
    pub observable: Observable,
    /// The estimator of the model.
    pub estimator: String,
    /// Name of the model.
    pub model: String,
    /// Mean of the model's estimator.
    pub value: Estimate,
    /// The estimator of the truth.
    pub truth: String,
    /// Mean of the transport estimator.
    pub expected: Estimate,
    /// (value - expected) / expected, with its error by the delta method.
    pub relative: Estimate,
    /// Why the interval is not to be trusted; empty where it is.
    pub note: String,
}

impl ModelError {
    /// The interval of `relative` at [`CONFIDENCE`].
    pub(crate) fn interval(&self) -> (f64, f64) {
        let reach = critical_value(1.0 - CONFIDENCE, self.relative.dof) * self.relative.std_error;
        (self.relative.value - reach, self.relative.value + reach)
    }
}

/// All rows of a record: each run that estimates a model, against the cell's first that does not;
/// observables of images as a whole, of probes and of fluxes, in the total and in the classes that both
/// scored.
pub(crate) fn model_errors(stored: &Stored) -> Vec<ModelError> {
    let mut rows = Vec::new();
    for cell in &stored.record.cells {
        let Some(truth) = cell.runs.iter().find(|run| run.model.is_none()) else { continue };
        for run in cell.runs.iter().filter(|run| run.control_of.is_none()) {
            if let Some(model) = &run.model {
                rows.extend(of_run(stored, cell, (run, model), truth));
            }
        }
    }
    rows
}

fn of_run(
    stored: &Stored,
    cell: &Cell,
    (run, model): (&EstimatorRun, &str),
    truth: &EstimatorRun,
) -> Vec<ModelError> {
    let mut rows = Vec::new();
    let is_shown =
        |observable: &Observable| cell.region_of(observable).is_some_and(|region| region.tile.is_none());
    for (place, observable) in truth.observables.iter().enumerate().filter(|(_, o)| is_shown(o)) {
        let Some(own) = run.observables.iter().position(|own| own == observable) else { continue };
        for (band, name) in stored.record.bands.iter().enumerate() {
            let mean = |run: &EstimatorRun, place: usize| {
                Some(Estimate::of_batches(&stored.moments(run, place, band)?))
            };
            let (Some(value), Some(expected)) = (mean(run, own), mean(truth, place)) else { continue };
            if value.value == 0.0 || expected.value == 0.0 {
                continue; // a class that one of the two does not have
            }
            let concerns = |class: &str| observable.class == "all" || observable.class == class;
            let tail = run.heavy_tails.iter().find(|tail| tail.band == band && concerns(&tail.class));
            rows.push(ModelError {
                cell: cell.label.clone(),
                band: name.name.clone(),
                observable: observable.clone(),
                estimator: run.estimator.clone(),
                model: model.into(),
                value,
                truth: truth.estimator.clone(),
                expected,
                relative: relative(&value, &expected),
                note: tail.map_or_else(String::new, |tail| format!("heavy tail: {}", tail.reason)),
            });
        }
    }
    rows
}

/// a/b - 1: the variance is (a/b)^2 (v_a / a^2 + v_b / b^2), the degrees of freedom as Welch and
/// Satterthwaite have them.
fn relative(a: &Estimate, b: &Estimate) -> Estimate {
    let ratio = a.value / b.value;
    let scaled = |estimate: &Estimate, scale: f64| Estimate {
        value: 0.0,
        std_error: estimate.std_error * scale.abs(),
        dof: estimate.dof,
    };
    let spread = scaled(a, 1.0 / b.value).minus(&scaled(b, ratio / b.value));
    Estimate { value: ratio - 1.0, ..spread }
}

/// Columns of `model_errors.csv`.
const COLUMNS: [&str; 14] = [
    "cell",
    "band",
    "observable",
    "class",
    "estimator",
    "model",
    "value",
    "std_error",
    "truth",
    "expected",
    "expected_error",
    "ci_low",
    "ci_high",
    "note",
];

/// The rows as CSV text; `ci_low` and `ci_high` are those of (value - expected) / expected.
pub(crate) fn to_csv(rows: &[ModelError]) -> String {
    let fields = |row: &ModelError| {
        let (low, high) = row.interval();
        vec![
            row.cell.clone(),
            row.band.clone(),
            row.observable.name.clone(),
            row.observable.class.clone(),
            row.estimator.clone(),
            row.model.clone(),
            row.value.value.to_string(),
            row.value.std_error.to_string(),
            row.truth.clone(),
            row.expected.value.to_string(),
            row.expected.std_error.to_string(),
            low.to_string(),
            high.to_string(),
            row.note.clone(),
        ]
    };
    csv_text::to_text(&COLUMNS, rows.iter().map(fields))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;

    #[test]
    fn a_model_is_held_against_the_truth() {
        let mut stored = sample::stored(0.1);
        assert!(model_errors(&stored).is_empty());
        stored.record.cells[0].runs[1].model = Some("a dipole".into());
        let rows = model_errors(&stored);
        assert!(!rows.is_empty());
        for row in &rows {
            assert_eq!((row.model.as_str(), row.truth.as_str()), ("a dipole", "mis"));
            let expected = row.value.value / row.expected.value - 1.0;
            assert!((row.relative.value - expected).abs() < 1e-15);
            let (low, high) = row.interval();
            assert!(low < expected && expected < high, "{row:?}");
        }
        assert_eq!(to_csv(&rows).lines().count(), rows.len() + 1);
    }

    /// The error of a ratio of independent means: 3 % and 4 % make 5 % of the ratio.
    #[test]
    fn errors_of_ratios() {
        let found = relative(&Estimate::known(2.0, 0.06), &Estimate::known(4.0, 0.16));
        assert!((found.value + 0.5).abs() < 1e-15 && (found.std_error - 0.025).abs() < 1e-15);
    }
}
