//! Error against time and against rays.
//!
//! The spread of means of m passes, measured: the batches of a record, taken 2^k at a time, are
//! independent means of m passes each; with G of them, s^2 = sum (mean_g - mean)^2 / (G - 1) estimates
//! the variance of such a mean with G - 1 degrees of freedom, whatever m. For independent passes of
//! finite variance s falls as 1/sqrt(m); with a heavy tail it falls more slowly, or in steps. The
//! interval is that of s for near-normal means, s sqrt((G - 1) / chi2). Beside it is the standard
//! error of m passes that the variance of all passes predicts.

use super::section::{PlotFigure, Section, runs};
use crate::report::plot::{Plot, PlotAxis, PlotPoint, Series, Style};
use crate::results::record::{Cell, EstimatorRun};
use crate::results::store::Stored;
use crate::stats::moments::Moments;
use crate::stats::tails::chi_square_critical;
use crate::stats::tree::{Merge, total};

/// Fewest groups for an estimate of the spread.
const FEWEST: usize = 8;
/// Confidence of the intervals.
const CONFIDENCE: f64 = 0.95;

/// Two plots per cell.
pub(super) fn section(stored: &Stored) -> Section {
    let cells = stored.record.cells.iter().enumerate();
    Section {
        heading: "Error against time and rays".into(),
        text: "Relative root-mean-square error of the sensor's first observable, all bands together: how far \
               independent means of so many passes lie apart (points, with 95 % intervals), and what 1 / \
               sqrt(passes) promises from the variance of all passes (dotted, to the end of the run). Points \
               above their dotted line, or falling more slowly, mean that the variance is not what the passes \
               show."
            .into(),
        drawn: cells.flat_map(|(index, cell)| of_cell(stored, index, cell)).collect(),
        are_small: true,
    }
}

/// A measure of the cost of passes.
struct Price {
    label: &'static str,
    name: &'static str,
    of: fn(&Stored, &Cell, &EstimatorRun) -> Option<f64>,
}

const PRICES: [Price; 2] = [
    Price { label: "CPU time / s", name: "time", of: seconds },
    Price { label: "number of rays", name: "rays", of: rays },
];

fn seconds(stored: &Stored, cell: &Cell, run: &EstimatorRun) -> Option<f64> {
    stored.timing.as_ref()?.of(&cell.label, &run.estimator)?.cpu_seconds_per_pass()
}

fn rays(_: &Stored, _: &Cell, run: &EstimatorRun) -> Option<f64> {
    let count = |name: &str| run.cost.get(name).copied().unwrap_or(0) as f64;
    let per_pass = (count("rays") + count("shadow_rays")) / run.passes as f64;
    (per_pass > 0.0).then_some(per_pass)
}

fn of_cell(stored: &Stored, index: usize, cell: &Cell) -> Vec<PlotFigure> {
    let plot = |price: &Price| {
        let series: Vec<Series> = runs(cell)
            .filter_map(|run| {
                let unit = (price.of)(stored, cell, run)?;
                Some(of_run(&errors(stored, run)?, &run.estimator, unit))
            })
            .flatten()
            .collect();
        let is_measured = !series.is_empty();
        let plot = Plot::small(PlotAxis::log(price.label), PlotAxis::log("relative RMS error"), series);
        let name = format!("error-{}-{index:03}", price.name);
        let caption = format!("Against {}.", price.label);
        is_measured.then(|| PlotFigure::of(name, cell.title(), caption, plot))
    };
    PRICES.iter().filter_map(plot).collect()
}

/// Errors of an estimator by number of passes.
struct Errors {
    /// Passes, and the relative error with its interval.
    measured: Vec<(f64, [f64; 3])>,
    /// Relative standard deviation of a pass.
    of_a_pass: f64,
    /// Total number of passes.
    passes: f64,
}

fn of_run(errors: &Errors, name: &str, unit: f64) -> Vec<Series> {
    let points = errors.measured.iter();
    let points = points.map(|(n, [y, low, high])| PlotPoint::new(n * unit, *y, [*low, *high])).collect();
    let guide = |n: f64| PlotPoint::bare(n * unit, errors.of_a_pass / n.sqrt());
    let first = errors.measured.first().map_or(1.0, |(n, _)| *n);
    vec![
        Series::new(name, Style::Marks, points),
        Series::new("", Style::Guide, vec![guide(first), guide(errors.passes)]),
    ]
}

/// None where the mean of the first observable is 0 in a band.
fn errors(stored: &Stored, run: &EstimatorRun) -> Option<Errors> {
    let bands = 0..stored.record.bands.len();
    let moments: Vec<Vec<Moments>> =
        bands.map(|band| stored.moments(run, 0, band)).collect::<Option<_>>()?;
    let all: Vec<Moments> = moments.iter().cloned().map(total).collect::<Option<_>>()?;
    if all.iter().any(|band| band.mean == 0.0 || !band.m2.is_finite()) {
        return None;
    }
    let count = moments.len() as f64;
    let variances = all.iter().map(|band| band.variance() / (band.mean * band.mean));
    let of_a_pass = (variances.sum::<f64>() / count).sqrt();
    let mut measured = Vec::new();
    let mut size = 1;
    while moments[0].len() / size >= FEWEST {
        let groups: Vec<Vec<Moments>> = moments.iter().map(|batches| grouped(batches, size)).collect();
        let relative = |(groups, all): (&Vec<Moments>, &Moments)| spread(groups) / (all.mean * all.mean);
        let error = (groups.iter().zip(&all).map(relative).sum::<f64>() / count).sqrt();
        // Bands may share their paths: the degrees of freedom are those of one.
        let dof = (groups[0].len() - 1) as f64;
        let end = |level: f64| error * (dof / chi_square_critical(level, dof)).sqrt();
        let [low, high] = [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)].map(end);
        if error > 0.0 {
            measured.push((groups[0][0].n as f64, [error, low, high]));
        }
        size *= 2;
    }
    let passes = all[0].n as f64;
    (!measured.is_empty()).then_some(Errors { measured, of_a_pass, passes })
}

/// Batches merged in groups of `size`; remaining batches, and a last batch with fewer passes, are not
/// used.
fn grouped(batches: &[Moments], size: usize) -> Vec<Moments> {
    let whole = batches.chunks_exact(size).map(|group| total(group.to_vec()).unwrap_or_default());
    let mut whole: Vec<Moments> = whole.collect();
    whole.retain({
        let n = whole.first().map_or(0, |first| first.n);
        move |group| group.n == n
    });
    whole
}

/// The variance of the groups' means.
fn spread(groups: &[Moments]) -> f64 {
    let mut means = Moments::default();
    groups.iter().for_each(|group| means = means.merge(Moments::of(group.mean)));
    means.variance()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;

    #[test]
    fn means_of_equal_groups() {
        let batch =
            |values: &[f64]| values.iter().fold(Moments::default(), |all, x| all.merge(Moments::of(*x)));
        let batches = [[1.0, 3.0], [2.0, 4.0], [5.0, 5.0], [0.0, 2.0], [7.0, 7.0]].map(|b| batch(&b));
        let groups = grouped(&batches, 2);
        assert_eq!(groups.iter().map(|g| (g.n, g.mean)).collect::<Vec<_>>(), [(4, 2.5), (4, 3.0)]);
        // Means 2, 3, 5, 1, 7: variance 5.8.
        assert!((spread(&grouped(&batches, 1)) - 5.8).abs() < 1e-14);
        let short = [batches[0], batches[1], batch(&[9.0])];
        assert_eq!(grouped(&short, 1).len(), 2, "a last batch with fewer passes has another variance");
    }

    /// Independent passes: 19 of 20 intervals cover the predicted error.
    #[test]
    fn independent_passes_follow_the_slope() {
        let stored = sample::stored(0.3);
        let run = &stored.record.cells[0].runs[0];
        let errors = errors(&stored, run).expect("errors");
        assert_eq!(errors.measured.iter().map(|(n, _)| *n).collect::<Vec<_>>(), [4.0, 8.0, 16.0, 32.0]);
        for (n, [_, low, high]) in &errors.measured {
            let promised = errors.of_a_pass / n.sqrt();
            assert!((*low..*high).contains(&promised), "{n}: {low} {promised} {high}");
        }
    }

    /// A slow drift is no independent noise: means of many passes lie farther apart than promised.
    #[test]
    fn a_drift_is_seen() {
        let mut stored = sample::stored(0.3);
        sample::set_observables(&mut stored, "mis", |i, _, _| {
            1.0 + 0.1 * sample::uniform(i) + 0.005 * i as f64
        });
        let errors = errors(&stored, &stored.record.cells[0].runs[0]).expect("errors");
        let (n, [_, low, _]) = errors.measured[3];
        assert!(low > errors.of_a_pass / n.sqrt(), "{low}");
    }
}
