//! Evidence of the comparisons of a record, each by itself.

use super::efficiency::{self, EfficiencyClaim};
use super::family::Finding;
use super::means::{Asked, MeanTest, Reference, hold};
use super::verdict::Verdict;
use crate::results::record::{
    Against, Cell, Claim, Comparison, ExpectedOutcome, Observable, Quantity, Record,
};
use crate::results::store::Stored;
use crate::stats::hypothesis::Estimate;
use crate::stats::tree::total;

/// What a trial is about, the same in the record of a second look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Subject {
    /// This one of the record's comparisons.
    Comparison(usize),
    /// This one of its comparisons of samplers; its tests are told apart by their kind.
    Sampler(usize),
    /// A subject that is not measured again.
    Whole,
}

/// One finding, and what it is about.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trial {
    /// What it is about.
    pub subject: Subject,
    /// Index of the claim in its record.
    pub claim: usize,
    pub finding: Finding,
}

impl Trial {
    /// Of a claim of a record. Controls have to be seen at the first look.
    pub(super) fn new(record: &Record, claim: usize, subject: Subject, finding: Finding) -> Trial {
        let one_look = finding.one_look || record.statements[claim].expects != ExpectedOutcome::Pass;
        Trial { subject, claim, finding: Finding { one_look, ..finding } }
    }
}

/// A verdict on a claim that is not judged yet.
pub(super) fn blank(record: &Record, claim: &Claim) -> Verdict {
    Verdict {
        experiment: record.experiment.clone(),
        claim: claim.label.clone(),
        control: claim.expects != ExpectedOutcome::Pass,
        ..Verdict::default()
    }
}

/// Judges comparison `index` by itself.
pub(super) fn trial(stored: &Stored, index: usize, comparison: &Comparison) -> Trial {
    let claim = &stored.record.statements[comparison.claim];
    let Comparison { quantity, detect, .. } = comparison;
    let mut finding = match &comparison.against {
        Against::Value { value, error, .. } => {
            let reference = Reference::Value(Estimate::known(*value, *error));
            of_mean(stored, claim, quantity, quantity, reference)
        }
        Against::Quantity { other, paired } => {
            let reference = Reference::Mean { quantity: other, paired: *paired };
            of_mean(stored, claim, quantity, other, reference)
        }
        Against::Efficiency { baseline, exceeds, cost } => {
            let duel = EfficiencyClaim { candidate: quantity, baseline, bound: *exceeds, cost: *cost };
            let fails = claim.expects == ExpectedOutcome::Fails;
            efficiency::finding(stored, named(&stored.record, claim, quantity, baseline), &duel, fails)
        }
    };
    finding.detect = *detect;
    Trial::new(&stored.record, comparison.claim, Subject::Comparison(index), finding)
}

fn of_mean(
    stored: &Stored,
    claim: &Claim,
    quantity: &Quantity,
    other: &Quantity,
    reference: Reference,
) -> Finding {
    let held = hold(stored, quantity, reference, Asked::by(claim));
    let MeanTest { evidence, test, deviation, value, expected, one_look, .. } = held;
    let mut verdict = named(&stored.record, claim, quantity, other);
    (verdict.test, verdict.statistic) = (test, deviation);
    if let Some(value) = value {
        verdict.set_value(value.value, value.std_error);
    }
    if let Some(expected) = expected {
        verdict.set_expected(expected.value, expected.std_error);
    }
    let whole = claim.each.then(|| whole(stored, quantity)).flatten();
    let relative_to = whole.or(verdict.expected).unwrap_or_default();
    Finding { relative_to, one_look, ..Finding::new(verdict, evidence) }
}

/// The mean of the sum over all classes: what a claim on each class measures its power by.
fn whole(stored: &Stored, quantity: &Quantity) -> Option<f64> {
    let observable = Observable { class: "all".into(), ..quantity.observable.clone() };
    let batches = stored.batches(&Quantity { observable, ..quantity.clone() })?;
    Some(total(batches)?.mean)
}

/// A verdict with the names of two quantities; `a vs b` where they differ.
fn named(record: &Record, claim: &Claim, a: &Quantity, b: &Quantity) -> Verdict {
    let cell = |q: &Quantity| record.cells.get(q.cell).map_or("?", |c| &c.label).to_string();
    let cell_title = |q: &Quantity| record.cells.get(q.cell).map_or("?".into(), Cell::title);
    let band = |q: &Quantity| record.bands.get(q.band).map_or("?", |b| &b.name).to_string();
    let both = |name: &dyn Fn(&Quantity) -> String| {
        let (a, b) = (name(a), name(b));
        if a == b { a } else { format!("{a} vs {b}") }
    };
    Verdict {
        cell: both(&cell),
        cell_title: both(&cell_title),
        band: both(&band),
        class: both(&|q| q.observable.class.clone()),
        estimators: both(&|q| q.estimator.clone()),
        observable: both(&|q| q.observable.name.clone()),
        ..blank(record, claim)
    }
}

#[cfg(test)]
#[path = "trial_tests.rs"]
mod tests;
