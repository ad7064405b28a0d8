//! The table of efficiencies: every estimator of a cell against the first of the experiment file, by
//! counters and by CPU time.
//!
//! Every ratio is variance times cost of the baseline over that of the candidate: above 1 the candidate is
//! better. A ratio is quoted where the means agree, by the test that an `agree` claim would make, at a level
//! of 1e-3 over the whole table (Bonferroni); its interval, for readers, is at 95 %. Whether the ratio is
//! resolved is decided as for claims (`verify::efficiency`). The metric is the first observable of the sensor,
//! by class; if the sensor has pixels, also `pixels`, the variance of a pixel averaged over the image.
//! Controls are in the table as candidates, by CPU time alone.
//!
//! Where only the tail of the baseline prevents a ratio, its variance still has a lower bound, and so has the
//! ratio (`stats::lower_bound`). Whether the means agree is then unknown, because a mean with such a tail has
//! no interval. But where scores are never negative, the mean has a lower bound, too. A candidate whose mean
//! lies below this bound misses light, and its ratio has no bound.

use serde::Serialize;

use super::efficiency::{contest, control_ratio, mean_of};
use super::evidence::{Evidence, SHOWN};
use super::means::{QuantityMean, evidence_of_means};
use super::verdict::known;
use super::weights;
use crate::results::csv_text;
use crate::results::record::{Cell, CostMeasure, EstimatorRun, Observable, Quantity, StatedBias};
use crate::results::store::Stored;
use crate::stats::hypothesis::Estimate;
use crate::stats::lower_bound::mean_at_least;
use crate::stats::tails::critical_value;
use crate::stats::tree::total;

/// The probability that any efficiency of a table is withheld although the means are equal.
const LEVEL: f64 = 1e-3;

/// One row of `comparisons.csv`. Numbers that are not quoted are absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct EfficiencyRow {
    /// Experiment name.
    pub experiment: String,
    /// Cell label.
    pub cell: String,
    /// Band name.
    pub band: String,
    /// Transport class.
    pub class: String,
    /// Observable name; its variance is that of one pass. `pixels` for the variance of a pixel.
    pub metric: String,
    /// The estimator that the other is compared with.
    pub baseline: String,
    /// Estimator that is compared with the baseline.
    pub candidate: String,
    /// Variance times cost of the baseline over that of the candidate.
    pub efficiency_ratio: Option<f64>,
    /// Lower end of its interval.
    pub ci_low: Option<f64>,
    /// Upper end of the confidence interval.
    pub ci_high: Option<f64>,
    /// Confidence of the interval.
    pub confidence: f64,
    /// What the ratio is at least, where only the baseline's tail is not resolved, at the one-sided
    /// confidence that goes with the interval: 97.5 %.
    pub at_least: Option<f64>,
    /// Variance of a pass, baseline over candidate.
    pub variance_ratio: Option<f64>,
    /// CPU time of a pass, baseline over candidate; over the whole run.
    pub cpu_cost_ratio: Option<f64>,
    /// Rays of a pass, baseline over candidate.
    pub ray_cost_ratio: Option<f64>,
    /// Whether the ratio is resolved: more passes would not move it out of its interval, and no single
    /// pass dominates it.
    pub resolved: bool,
    /// What counts as cost.
    pub cost: CostMeasure,
    /// Whether the two were interleaved and timed with a control; by counters it does not matter.
    pub interleaved: bool,
    /// CPU time of the control: passes of the cell's first estimator over that of the same passes.
    pub control_ratio: Option<f64>,
    /// Kurtosis of a pass of the baseline.
    pub kurtosis_baseline: Option<f64>,
    /// Kurtosis of a pass of the candidate.
    pub kurtosis_candidate: Option<f64>,
    /// Why there is no ratio.
    pub note: String,
}

impl EfficiencyRow {
    /// The efficiency ratio and its interval, where they are quoted.
    pub(crate) fn quoted(&self) -> Option<[f64; 3]> {
        Some([self.efficiency_ratio?, self.ci_low?, self.ci_high?])
    }
}

/// The rows as CSV text.
pub(crate) fn to_csv(rows: &[EfficiencyRow]) -> String {
    csv_text::table(rows)
}

/// The two arms of a row.
struct RowSubject<'a> {
    cell: &'a Cell,
    baseline: (&'a EstimatorRun, Quantity),
    candidate: (&'a EstimatorRun, Quantity),
    cost: CostMeasure,
}

/// All rows of a record: by cell, candidate, class, band, measure.
pub(crate) fn comparisons(stored: &Stored) -> Vec<EfficiencyRow> {
    let subjects = subjects(stored);
    // Two measures share one test of the means.
    let level = 2.0 * LEVEL / subjects.len().max(1) as f64;
    subjects.iter().map(|subject| row(stored, subject, level)).collect()
}

fn subjects(stored: &Stored) -> Vec<RowSubject<'_>> {
    let mut subjects = Vec::new();
    for (index, cell) in stored.record.cells.iter().enumerate() {
        for run in &cell.runs {
            // Against the first that estimates the same.
            let same = |first: &&EstimatorRun| first.control_of.is_none() && first.model == run.model;
            let Some(first) = cell.runs.iter().find(same) else { continue };
            let is_own = run.control_of.as_ref().is_none_or(|of| *of == first.estimator);
            if run.estimator == first.estimator || !is_own {
                continue;
            }
            let metric = first.observables.first().map(|o| &o.name);
            let pixels = [first, run].iter().all(|run| run.image.is_some()).then(Observable::pixels);
            let classes = first.observables.iter().filter(|o| Some(&o.name) == metric);
            for observable in classes.chain(&pixels) {
                for band in 0..stored.record.bands.len() {
                    let quantity = |run: &EstimatorRun| Quantity {
                        cell: index,
                        estimator: run.estimator.clone(),
                        observable: observable.clone(),
                        band,
                    };
                    let arms = [(first, quantity(first)), (run, quantity(run))];
                    if arms.iter().all(|(_, quantity)| is_silent(stored, quantity)) {
                        continue;
                    }
                    for cost in [CostMeasure::Counters, CostMeasure::Cpu] {
                        if run.control_of.is_some() && cost == CostMeasure::Counters {
                            continue;
                        }
                        let [baseline, candidate] = arms.clone();
                        subjects.push(RowSubject { cell, baseline, candidate, cost });
                    }
                }
            }
        }
    }
    subjects
}

fn is_silent(stored: &Stored, quantity: &Quantity) -> bool {
    let all = stored.batches(&mean_of(stored, quantity)).and_then(total);
    all.is_none_or(|all| all.mean == 0.0 && all.m2 == 0.0)
}

fn row(stored: &Stored, subject: &RowSubject, level: f64) -> EfficiencyRow {
    let RowSubject { cell, baseline, candidate, cost } = subject;
    let Observable { name, class } = &baseline.1.observable;
    let biased = bias_objection(&[baseline.0, candidate.0]).map(|note| (note, false));
    let (note, is_bounded) =
        biased.or_else(|| means_objection(stored, &candidate.1, &baseline.1, level)).unwrap_or_default();
    let control_ratio = match cost {
        CostMeasure::Counters => None,
        CostMeasure::Cpu => control_ratio(stored, &candidate.1, &baseline.1),
    };
    let row = EfficiencyRow {
        experiment: stored.record.experiment.clone(),
        cell: cell.label.clone(),
        band: stored.record.bands[baseline.1.band].name.clone(),
        class: class.clone(),
        metric: name.clone(),
        baseline: baseline.0.estimator.clone(),
        candidate: candidate.0.estimator.clone(),
        confidence: SHOWN,
        cpu_cost_ratio: ratio(cpu(stored, cell, baseline.0), cpu(stored, cell, candidate.0)),
        ray_cost_ratio: ratio(rays(stored, baseline.0), rays(stored, candidate.0)),
        cost: *cost,
        interleaved: *cost == CostMeasure::Counters || control_ratio.is_some(),
        control_ratio,
        note,
        ..EfficiencyRow::default()
    };
    if !row.note.is_empty() && !is_bounded {
        return row;
    }
    let contest = match contest(stored, &candidate.1, &baseline.1, *cost) {
        Ok(contest) => contest,
        Err(_) if is_bounded => return row,
        Err(note) => return EfficiencyRow { note, ..row },
    };
    let at_least = contest.at_least.and_then(known);
    if is_bounded {
        return EfficiencyRow { at_least, ..row };
    }
    let resolved = contest.is_resolved();
    let efficiency = contest.efficiency;
    let (low, high) = contest.ratio.interval(SHOWN);
    EfficiencyRow {
        at_least: at_least.filter(|_| !resolved),
        efficiency_ratio: known(efficiency.work.ratio()),
        ci_low: known(low),
        ci_high: known(high),
        variance_ratio: known(efficiency.variance.ratio()),
        resolved,
        kurtosis_baseline: known(efficiency.a.kurtosis),
        kurtosis_candidate: known(efficiency.b.kurtosis),
        note: if resolved { String::new() } else { "not resolved".into() },
        ..row
    }
}

/// The baseline's cost over the candidate's, where both were measured.
fn ratio(baseline: Option<f64>, candidate: Option<f64>) -> Option<f64> {
    known(baseline? / candidate?)
}

/// A biased estimator's variance is not its error.
fn bias_objection(runs: &[&EstimatorRun]) -> Option<String> {
    runs.iter().find_map(|run| match &run.bias {
        StatedBias::Biased(why) => Some(format!("{} is biased: {why}", run.estimator)),
        StatedBias::Unbiased | StatedBias::Consistent => None,
    })
}

/// Why the two cannot be taken to estimate one number, and whether that leaves a bound of the ratio.
fn means_objection(
    stored: &Stored,
    candidate: &Quantity,
    baseline: &Quantity,
    level: f64,
) -> Option<(String, bool)> {
    let held = evidence_of_means(stored, &mean_of(stored, candidate), &mean_of(stored, baseline));
    match held.evidence {
        Evidence::Difference { difference, .. } => {
            let p = difference.test_zero().p_value;
            (p < level || p.is_nan()).then(|| (format!("the means differ, p = {p:.1e}"), false))
        }
        Evidence::Nothing(_)
            if held.other_tail_alone && misses_light(stored, candidate, baseline, level) =>
        {
            Some(("the means differ: the candidate's is too small".into(), false))
        }
        Evidence::Nothing(reason) => Some((format!("no mean test: {reason}"), held.other_tail_alone)),
        _ => Some(("zero variance".into(), false)),
    }
}

/// Whether the candidate's mean is shown to be below that of the baseline, whose tail allows no t test;
/// also where scores are negative, so that nothing can be shown.
fn misses_light(stored: &Stored, candidate: &Quantity, baseline: &Quantity, level: f64) -> bool {
    let mean = |quantity| QuantityMean::of(stored, &mean_of(stored, quantity));
    let Some((candidate, baseline)) = mean(candidate).zip(mean(baseline)) else { return true };
    let batches: Vec<f64> = baseline.batches.iter().map(|batch| batch.mean).collect();
    let Some(least) = mean_at_least(&batches, 0.5 * level) else { return true };
    let Estimate { value, std_error, dof } = candidate.mean;
    least > value + critical_value(level, dof) * std_error
}

/// CPU time of a pass, seconds, where it was measured.
fn cpu(stored: &Stored, cell: &Cell, run: &EstimatorRun) -> Option<f64> {
    stored.timing.as_ref()?.of(&cell.label, &run.estimator)?.cpu_seconds_per_pass()
}

/// Closest-hit and occlusion queries of a pass, where they were counted.
fn rays(stored: &Stored, run: &EstimatorRun) -> Option<f64> {
    let count =
        |name: &str| weights::counter(stored, run, name).map(|batches| batches.iter().sum::<f64>());
    Some((count("rays")? + count("shadow_rays").unwrap_or(0.0)) / run.passes as f64)
}

/// Name of a measure in tables.
pub(crate) fn measure_name(measure: CostMeasure) -> &'static str {
    match measure {
        CostMeasure::Counters => "counters",
        CostMeasure::Cpu => "cpu",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample::{self, set_observables, uniform};

    #[test]
    fn every_pair_has_a_row_and_a_reason() {
        let mut stored = sample::stored(0.1);
        // `snee` has a quarter of the variance at the same counted cost; no time was measured.
        set_observables(&mut stored, "snee", |i, o, b| {
            1.0 + 0.05 * uniform(i + 7000 + (1000 * (2 * o + b)) as u64)
        });
        sample::set_spread(&mut stored, "snee", sample::pairs(0.05, 7_000_000));
        let rows = comparisons(&stored);
        assert_eq!(rows.len(), 3 * 2 * 2, "two classes and the pixels, bands, measures");
        let counted: Vec<&EfficiencyRow> =
            rows.iter().filter(|r| r.cost == CostMeasure::Counters).collect();
        for row in &counted {
            assert!(row.resolved, "{row:?}");
            assert!(
                row.ci_low < Some(4.0) && row.ci_high > Some(4.0) && row.ci_low > Some(2.0),
                "{row:?}"
            );
            assert_eq!((row.ray_cost_ratio, row.baseline.as_str()), (Some(1.0), "mis"));
        }
        let timed = rows.iter().find(|r| r.cost == CostMeasure::Cpu).expect("a row");
        assert!(timed.note.contains("no CPU time") && timed.efficiency_ratio.is_none(), "{timed:?}");
        let csv = to_csv(&rows);
        assert!(csv.starts_with(
            "experiment,cell,band,class,metric,baseline,candidate,efficiency_ratio,ci_low,ci_high,"
        ));
        assert_eq!(csv.lines().count(), 13);
    }

    #[test]
    fn nothing_is_quoted_where_the_means_differ() {
        let mut stored = sample::stored(0.1);
        set_observables(&mut stored, "snee", |i, _, _| 1.1 + 0.05 * uniform(i + 7000));
        let rows = comparisons(&stored);
        assert!(
            rows.iter().all(|r| r.note.contains("the means differ") && r.efficiency_ratio.is_none())
        );
        assert!(rows.iter().all(|r| r.variance_ratio.is_none() && !r.resolved));
    }

    /// One batch of `mis` holds most of its variance: no mean test and no ratio, but a bound. Scores of
    /// `mis` are never negative.
    #[test]
    fn a_baseline_with_a_tail_leaves_a_bound() {
        let mut stored = sample::stored(0.1);
        let heavy = |i: u64| if i % 16 == 3 { 1.0 + 0.2 * uniform(i).abs() } else { 0.9 };
        let spiked = move |i: u64, _: usize, _: usize| if i == 77 { 9.0 } else { heavy(i) };
        set_observables(&mut stored, "mis", spiked);
        set_observables(&mut stored, "snee", |i, _, _| 0.94 + 0.001 * uniform(i + 7000));
        let rows = comparisons(&stored);
        let row = rows.iter().find(|r| r.metric == "mean" && r.cost == CostMeasure::Counters);
        let row = row.expect("a row");
        assert!(row.note.contains("heavy tail") && row.efficiency_ratio.is_none(), "{row:?}");
        assert!(row.at_least.is_some_and(|bound| bound > 10.0), "{row:?}");
        // A candidate that misses light has no bound, nor has one with a tail of its own.
        let mut dark = stored.clone();
        set_observables(&mut dark, "snee", |i, _, _| 0.5 + 0.001 * uniform(i + 7000));
        assert!(comparisons(&dark).iter().all(|r| r.at_least.is_none()), "{:?}", comparisons(&dark));
        set_observables(&mut stored, "snee", spiked);
        let own = comparisons(&stored);
        assert!(own.iter().filter(|r| r.metric == "mean").all(|r| r.at_least.is_none()), "{own:?}");
    }

    #[test]
    fn silent_classes_have_no_row() {
        let mut stored = sample::stored(0.1);
        for name in ["mis", "snee"] {
            set_observables(
                &mut stored,
                name,
                |i, o, _| if o == 1 { 0.0 } else { 1.0 + 0.1 * uniform(i) },
            );
        }
        let rows = comparisons(&stored);
        assert!(!rows.is_empty() && rows.iter().all(|r| r.class == "all"));
    }
}
