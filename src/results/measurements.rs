//! The table of all measurements: one row for each band of each observable.

use serde::Serialize;

use super::csv_text;
use super::record::{Cell, EstimatorRun};
use super::store::Stored;
use super::timing::Timing;
use crate::stats::moments::Moments;
use crate::stats::tree::total;

/// One row of `measurements.csv`. Costs are of all bands and observables of the run together.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Measurement {
    /// Experiment name.
    pub experiment: String,
    /// Cell label.
    pub cell: String,
    /// Band name.
    pub band: String,
    /// Estimator name.
    pub estimator: String,
    /// Observable name.
    pub observable: String,
    /// Transport class.
    pub class: String,
    /// Number of passes.
    pub passes: u64,
    /// Mean over passes.
    pub mean: f64,
    /// Its standard error; NaN for one pass.
    pub std_error: f64,
    /// Variance of one pass; NaN for one pass.
    pub variance_per_pass: f64,
    /// Scores of the run that were not finite.
    pub nonfinite: u64,
    /// CPU seconds per pass, where they were measured.
    pub cpu_seconds_per_pass: Option<f64>,
    /// Rays per pass, where they were counted.
    pub rays_per_pass: Option<f64>,
}

/// All rows of a record: by cell, estimator, observable, band.
pub fn measurements(stored: &Stored, timing: Option<&Timing>) -> Vec<Measurement> {
    let cells = stored.record.cells.iter();
    let runs = cells.flat_map(|cell| cell.runs.iter().map(move |run| (cell, run)));
    runs.flat_map(|(cell, run)| of_run(stored, timing, cell, run)).collect()
}

/// The rows as CSV text.
pub fn to_csv(rows: &[Measurement]) -> String {
    csv_text::table(rows)
}

fn of_run(
    stored: &Stored,
    timing: Option<&Timing>,
    cell: &Cell,
    run: &EstimatorRun,
) -> Vec<Measurement> {
    let cost = timing.and_then(|t| t.of(&cell.label, &run.estimator));
    let rays = run.cost.get("rays").map(|rays| *rays as f64 / run.passes as f64);
    let mut rows = Vec::new();
    for (o, observable) in run.observables.iter().enumerate() {
        for (b, band) in stored.record.bands.iter().enumerate() {
            let moments: Moments = stored.moments(run, o, b).and_then(total).unwrap_or_default();
            rows.push(Measurement {
                experiment: stored.record.experiment.clone(),
                cell: cell.label.clone(),
                band: band.name.clone(),
                estimator: run.estimator.clone(),
                observable: observable.name.clone(),
                class: observable.class.clone(),
                passes: moments.n,
                mean: moments.mean,
                std_error: moments.std_error(),
                variance_per_pass: moments.variance(),
                nonfinite: run.anomalies.get("nonfinite").copied().unwrap_or(0),
                cpu_seconds_per_pass: cost.and_then(|c| c.cpu_seconds_per_pass()),
                rays_per_pass: rays,
            });
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::super::timing::TimeSpent;
    use super::*;

    #[test]
    fn one_row_for_each_band_of_each_observable() {
        let stored = sample::stored(0.5);
        let mut timing = Timing::default();
        timing.add(
            "smooth",
            "mis",
            TimeSpent {
                cpu_seconds: 64.0,
                set_up_seconds: 0.0,
                wall_seconds: 64.0,
                passes: 256,
                paths: 1,
            },
        );
        let rows = measurements(&stored, Some(&timing));
        assert_eq!(rows.len(), 2 * 2 * 2);
        assert_eq!((rows[0].passes, rows[0].rays_per_pass), (sample::PASSES, Some(4.0)));
        assert_eq!((rows[0].cpu_seconds_per_pass, rows[4].cpu_seconds_per_pass), (Some(0.25), None));
        assert!((rows[0].mean - 1.0).abs() < 5.0 * rows[0].std_error);
        assert!((rows[0].variance_per_pass - 0.25).abs() < 0.05);
        let csv = to_csv(&rows);
        assert!(
            csv.starts_with("experiment,cell,band,estimator,observable,class,passes,mean,std_error,")
        );
        assert!(csv.contains("\nsample,smooth,R,mis,mean,all,256,"), "{csv}");
        assert!(csv.lines().nth(5).is_some_and(|line| line.ends_with(",0,,4.0")), "{csv}");
    }
}
