//! Two records of one experiment: their descriptions, and whether their means differ.
//!
//! A quantity that both records hold is compared in one of four ways:
//! - `identical`: the moments of every batch are the same bits. There is nothing to test.
//! - `paired t`: pass k of both was run on the same random numbers, so that the differences pass by pass
//!   come from a change in the program. They are independent between passes, even if the change affects how
//!   numbers are used within a pass. The t test of their batch means is therefore valid, and more sensitive
//!   the more similar the two programs are. Welch's test would treat the shared noise as independent.
//! - `welch t`: other seeds, names or physics, hence other random numbers: independent batches. The
//!   fewer of both sides' degrees of freedom are used, which bounds the tails for every ratio of
//!   variances (M. Mickey, M. Brown, "Bounds on the distribution functions of the Behrens-Fisher
//!   statistic", 1966).
//! - `sum of errors`: the same random numbers and another number of passes, or an experiment that pairs
//!   cells and whose physics changed: the means are neither paired nor independent. |a - b| > c (e_a + e_b)
//!   needs |a - mu| > c e_a or |b - mu| > c e_b, so twice the t tail is a p-value whatever the
//!   correlation.

use std::collections::BTreeMap;

use serde_json::Value;

use super::evidence::Evidence;
use super::family::{Finding, conclude};
use super::levels::Looks;
use super::means::{QuantityMean, ROUNDING, same_passes};
use super::verdict::{Outcome, TestKind, Verdict};
use crate::results::record::{Cell, EstimatorRun, Observable, Quantity, Record};
use crate::results::store::Stored;
use crate::stats::hypothesis::Estimate;
use crate::stats::moments::Moments;

/// Criteria for the comparison of two records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Terms {
    /// Probability of any false alarm.
    pub level: f64,
    /// The largest difference that may go unseen in the first observable of a run, relative to it.
    pub detect: Option<f64>,
    /// The largest factor by which the work per pass may grow.
    pub max_slowdown: Option<f64>,
}

/// Result of the comparison.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Compared {
    /// Differences of the descriptions, as text; empty where only numbers can differ.
    pub changes: Vec<String>,
    /// One verdict for each quantity that both hold.
    pub verdicts: Vec<Verdict>,
    /// Change of work of every run that both hold.
    pub work: Vec<WorkChange>,
}

/// Work and its worth, second record over first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WorkChange {
    /// Cell label.
    pub cell: String,
    /// Estimator name.
    pub estimator: String,
    /// Counter -> counts per pass, second over first; infinite where the first counted none.
    pub counts: BTreeMap<String, f64>,
    /// Variance of a pass of the first observable, second over first, by band.
    pub variance: Vec<f64>,
    /// The counter that grew by more than was allowed.
    pub too_slow: Option<String>,
}

impl Compared {
    /// 1: a mean differs or the work grew too much. 3: a run's first observable could not be judged, or
    /// not well enough. 0: neither; rarer observables that cannot be judged are no reason to fail.
    pub(crate) fn exit_code(&self) -> u8 {
        let differs = self.verdicts.iter().any(|v| v.outcome == Outcome::Fail);
        if differs || self.work.iter().any(|work| work.too_slow.is_some()) {
            1
        } else if self.verdicts.iter().any(|v| !v.is_green() && self.is_first(v)) {
            3
        } else {
            0
        }
    }

    /// Whether it is of the first observable that its run shares with the other record.
    pub(crate) fn is_first(&self, verdict: &Verdict) -> bool {
        let same = |v: &&Verdict| v.cell == verdict.cell && v.estimators == verdict.estimators;
        let first = self.verdicts.iter().find(same);
        first.is_some_and(|v| v.observable == verdict.observable && v.class == verdict.class)
    }
}

/// Compares two records; nothing where they hold no quantity in common.
pub(crate) fn compare(a: &Stored, b: &Stored, terms: &Terms) -> Option<Compared> {
    let mut changes = changed_words(&a.record, &b.record);
    let mut findings = Vec::new();
    let mut work = Vec::new();
    for (ia, cell_a) in a.record.cells.iter().enumerate() {
        let Some(ib) = b.record.cells.iter().position(|cell| cell.label == cell_a.label) else {
            continue;
        };
        let cell_b = &b.record.cells[ib];
        for run_a in &cell_a.runs {
            let Some(run_b) = cell_b.runs.iter().find(|run| run.estimator == run_a.estimator) else {
                continue;
            };
            let pair =
                RunPair { a, b, cells: [ia, ib], runs: [run_a, run_b], streams: streams(a, b, ia, ib) };
            changes.extend(pair.changed_run(&cell_a.label));
            findings.extend(pair.findings(terms));
            work.push(pair.work(&cell_a.label, terms));
        }
    }
    if findings.is_empty() {
        return None;
    }
    let verdicts = conclude(findings, Looks::One { level: terms.level }, |_, _| None).verdicts;
    Some(Compared { changes, verdicts, work })
}

/// Two runs with the same name.
struct RunPair<'a> {
    a: &'a Stored,
    b: &'a Stored,
    cells: [usize; 2],
    runs: [&'a EstimatorRun; 2],
    streams: Streams,
}

/// How the random numbers of two runs with the same name are related.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Streams {
    /// Pass k of both was run on the same numbers.
    Same,
    /// Independent numbers.
    Others,
    /// Unknown: the experiment pairs cells, and the physics of this one changed.
    Unknown,
}

/// What names the random numbers of a pass: experiment, seed, bands, and the cell's physics except what
/// the experiment pairs over. Neither claims nor budget.
fn streams(a: &Stored, b: &Stored, cell_a: usize, cell_b: usize) -> Streams {
    let (a, b) = (&a.record, &b.record);
    let bands = |record: &Record| record.bands.iter().map(|band| band.name.clone()).collect::<Vec<_>>();
    let has_pairs = !a.resolved["pair"].is_null() || !b.resolved["pair"].is_null();
    if a.experiment != b.experiment || a.resolved["seed"] != b.resolved["seed"] || bands(a) != bands(b) {
        Streams::Others
    } else if a.cells[cell_a].content_hash == b.cells[cell_b].content_hash
        && a.resolved["pair"] == b.resolved["pair"]
    {
        Streams::Same
    } else if has_pairs {
        Streams::Unknown
    } else {
        Streams::Others
    }
}

impl RunPair<'_> {
    fn cell(&self) -> &Cell {
        &self.a.record.cells[self.cells[0]]
    }

    fn changed_run(&self, cell: &str) -> Vec<String> {
        let [a, b] = self.runs;
        let place =
            if cell.is_empty() { a.estimator.clone() } else { format!("{cell}: {}", a.estimator) };
        let mut changes = Vec::new();
        if a.passes != b.passes {
            changes.push(format!("{place}: {} passes, then {}", a.passes, b.passes));
        }
        if a.kind != b.kind {
            changes.push(format!("{place}: kind {}, then {}", a.kind, b.kind));
        }
        if a.anomalies != b.anomalies {
            changes.push(format!("{place}: counts of {:?}, then {:?}", a.anomalies, b.anomalies));
        }
        changes
    }

    fn findings(&self, terms: &Terms) -> Vec<Finding> {
        let mut findings = Vec::new();
        let common = |o: &&Observable| self.runs[1].observables.contains(o);
        for (index, observable) in self.runs[0].observables.iter().filter(common).enumerate() {
            for (band, about) in self.a.record.bands.iter().enumerate() {
                let other = self.b.record.bands.iter().position(|b| b.name == about.name);
                let Some(other) = other else { continue };
                let mut finding = self.finding(observable, [band, other]);
                finding.detect = terms.detect.filter(|_| index == 0);
                findings.push(finding);
            }
        }
        findings
    }

    fn finding(&self, observable: &Observable, bands: [usize; 2]) -> Finding {
        let quantity = |side: usize| Quantity {
            cell: self.cells[side],
            estimator: self.runs[side].estimator.clone(),
            observable: observable.clone(),
            band: bands[side],
        };
        let means = [(self.a, quantity(0)), (self.b, quantity(1))];
        let means = means.each_ref().map(|(stored, quantity)| QuantityMean::of(stored, quantity));
        let mut verdict = Verdict {
            experiment: self.a.record.experiment.clone(),
            cell: self.cell().label.clone(),
            cell_title: self.cell().title(),
            band: self.a.record.bands[bands[0]].name.clone(),
            class: observable.class.clone(),
            estimators: self.runs[0].estimator.clone(),
            claim: "compare".into(),
            observable: observable.name.clone(),
            ..Verdict::default()
        };
        let evidence = match &means {
            [Some(a), Some(b)] => {
                verdict.set_expected(a.mean.value, a.mean.std_error);
                verdict.set_value(b.mean.value, b.mean.std_error);
                self.weigh(a, b, &mut verdict)
            }
            _ => Evidence::Nothing("a record does not hold this quantity".into()),
        };
        let relative_to = verdict.expected.unwrap_or_default();
        Finding { relative_to, ..Finding::new(verdict, evidence) }
    }

    fn weigh(&self, a: &QuantityMean, b: &QuantityMean, verdict: &mut Verdict) -> Evidence {
        if let Some(objection) = a.objection().or_else(|| b.objection()) {
            return Evidence::Nothing(objection);
        }
        if identical(&a.batches, &b.batches) {
            (verdict.test, verdict.statistic) = (Some(TestKind::Identical), Some(0.0));
            return Evidence::of_sides(true, verdict);
        }
        let scale = a.mean.value.abs().max(b.mean.value.abs());
        if a.all.std_error().max(b.all.std_error()) <= ROUNDING * scale {
            (verdict.test, verdict.statistic) = (Some(TestKind::Identity), Some(0.0));
            let holds = (b.mean.value - a.mean.value).abs() <= ROUNDING * scale;
            return Evidence::of_sides(holds, verdict);
        }
        if let Some(objection) = a.tail_objection().or_else(|| b.tail_objection()) {
            return Evidence::Nothing(objection);
        }
        let is_paired = self.streams == Streams::Same && same_passes(&a.batches, &b.batches);
        verdict.test = Some(match (is_paired, self.streams) {
            (true, _) => TestKind::PairedT,
            (false, Streams::Others) => TestKind::WelchT,
            (false, Streams::Same | Streams::Unknown) => TestKind::SumOfErrors,
        });
        if !is_paired {
            return self.unpaired(a, b);
        }
        let d = Estimate::of_differences(&b.batches, &a.batches);
        // Differences of rounding alone have an error of rounding alone: neither counts.
        let rounding = ROUNDING * scale;
        let std_error = (d.std_error * d.std_error + rounding * rounding).sqrt();
        Evidence::of_difference(Estimate { std_error, ..d })
    }

    fn unpaired(&self, a: &QuantityMean, b: &QuantityMean) -> Evidence {
        let (ea, eb) = (a.mean.std_error, b.mean.std_error);
        let dof = a.mean.dof.min(b.mean.dof);
        let value = b.mean.value - a.mean.value;
        if self.streams == Streams::Others {
            let std_error = (ea * ea + eb * eb).sqrt();
            return Evidence::of_difference(Estimate { value, std_error, dof });
        }
        Evidence::Difference { difference: Estimate { value, std_error: ea + eb, dof }, times: 2.0 }
    }

    fn work(&self, cell: &str, terms: &Terms) -> WorkChange {
        let [a, b] = self.runs;
        let per_pass = |run: &EstimatorRun, count: u64| count as f64 / run.passes.max(1) as f64;
        let ratio = |(name, count): (&String, &u64)| {
            let before = per_pass(a, a.cost.get(name).copied().unwrap_or(0));
            let now = per_pass(b, *count);
            (name.clone(), if now == before { 1.0 } else { now / before })
        };
        let counts: BTreeMap<String, f64> = b.cost.iter().map(ratio).collect();
        let allowed = terms.max_slowdown.unwrap_or(f64::INFINITY);
        let worst = counts.iter().filter(|(_, ratio)| **ratio > allowed);
        let worst = worst.max_by(|x, y| x.1.total_cmp(y.1));
        WorkChange {
            cell: cell.into(),
            estimator: a.estimator.clone(),
            variance: self.variance_ratios(),
            too_slow: worst.map(|(name, _)| name.clone()),
            counts,
        }
    }

    fn variance_ratios(&self) -> Vec<f64> {
        let Some(first) = self.runs[0].observables.first() else { return vec![] };
        let variance = |stored: &Stored, side: usize, band: usize| {
            let estimator = self.runs[side].estimator.clone();
            let observable = first.clone();
            let quantity = Quantity { cell: self.cells[side], estimator, observable, band };
            QuantityMean::of(stored, &quantity).map_or(f64::NAN, |mean| mean.all.variance())
        };
        let bands = self.a.record.bands.iter().enumerate();
        let ratio = |(band, about): (usize, &crate::results::record::Band)| {
            let other = self.b.record.bands.iter().position(|b| b.name == about.name)?;
            Some(variance(self.b, 1, other) / variance(self.a, 0, band))
        };
        bands.filter_map(ratio).collect()
    }
}

/// Whether two runs have the same bits.
fn identical(a: &[Moments], b: &[Moments]) -> bool {
    let bits = |m: &Moments| m.to_array().map(f64::to_bits);
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| bits(a) == bits(b))
}

/// Differences between the two records' descriptions, cells and runs that only one of them has included.
fn changed_words(a: &Record, b: &Record) -> Vec<String> {
    let mut changes = Vec::new();
    let mut words = |what: &str, a: &str, b: &str| {
        if a != b {
            changes.push(format!("{what}: {a}, then {b}"));
        }
    };
    words("experiment", &a.experiment, &b.experiment);
    words("numerical version and crates", &a.fingerprint, &b.fingerprint);
    if a.experiment_hash != b.experiment_hash {
        words("experiment's hash", &a.experiment_hash, &b.experiment_hash);
    }
    differences("", &a.resolved, &b.resolved, &mut changes);
    if a.claims_hash != b.claims_hash {
        changes.push("the claims".into());
    }
    let names = |record: &Record| -> Vec<String> {
        let mut names: Vec<String> =
            record.bands.iter().map(|band| format!("band `{}`", band.name)).collect();
        for cell in &record.cells {
            names.push(format!("cell `{}`", cell.label));
            for run in &cell.runs {
                names.push(format!("estimator `{}` in cell `{}`", run.estimator, cell.label));
            }
        }
        names
    };
    let (first, second) = (names(a), names(b));
    changes
        .extend(first.iter().filter(|n| !second.contains(n)).map(|n| format!("{n}: only in the first")));
    changes.extend(
        second.iter().filter(|n| !first.contains(n)).map(|n| format!("{n}: only in the second")),
    );
    changes
}

/// Dotted keys whose values differ.
fn differences(key: &str, a: &Value, b: &Value, found: &mut Vec<String>) {
    let below = |name: &str| if key.is_empty() { name.to_string() } else { format!("{key}.{name}") };
    match (a, b) {
        (Value::Object(x), Value::Object(y)) => {
            let mut names: Vec<&String> = x.keys().chain(y.keys()).collect();
            names.sort();
            names.dedup();
            for name in names {
                let side =
                    |map: &serde_json::Map<String, Value>| map.get(name).cloned().unwrap_or(Value::Null);
                differences(&below(name), &side(x), &side(y), found);
            }
        }
        (Value::Array(x), Value::Array(y)) if x.len() == y.len() => {
            for (index, (x, y)) in x.iter().zip(y).enumerate() {
                differences(&below(&index.to_string()), x, y, found);
            }
        }
        _ if a == b => {}
        _ => {
            let short = |value: &Value| {
                let text = if value.is_null() { "nothing".into() } else { value.to_string() };
                let cut: String = text.chars().take(60).collect();
                if cut.len() < text.len() { format!("{cut}...") } else { cut }
            };
            found.push(format!("{key}: {}, then {}", short(a), short(b)));
        }
    }
}

#[cfg(test)]
#[path = "difference_tests.rs"]
mod tests;
