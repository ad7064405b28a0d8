//! What one comparison shows by itself, before it is held against the others.

use super::efficiency::{self, Shown};
use super::levels::SHARED_ERROR;
use super::verdict::{Outcome, Verdict};
use crate::results::record::{
    Against, Comparison, EstimatorRun, Observable, Quantity, Record, StatedBias, StatedTail,
};
use crate::results::store::Stored;
use crate::stats::goodness::{Goodness, Proportion};
use crate::stats::hypothesis::{Estimate, Spread, Test};
use crate::stats::moments::Moments;
use crate::stats::tree::total;

/// A t test rests on at least this many batch means.
const MIN_BATCHES: usize = 64;

/// Limit of |skewness| / sqrt(passes). With log-normal scores in 64 batches, a t test at level 1e-4
/// was measured to give twice as many false alarms at 0.26, and 30 times as many at 3.2; batching does
/// not cure skewness, only passes do.
const SKEWNESS_LIMIT: f64 = 0.1;

/// Limit of one batch's share of the variance between batches. Of 64 normal batches, one holds more
/// than a half with probability below 1e-13; with more, one score decides, and hides every other
/// difference behind its own error.
pub(super) const SHARE_LIMIT: f64 = 0.5;

/// Sampling errors and deviations below this, relative to the value, are rounding.
pub(super) const ROUNDING: f64 = 1e-12;

/// Kinds of claims.
const KINDS: [&str; 7] = ["equals", "agree", "differs", "reproduces", "sampler", "faster", "not_slower"];

/// Kinds of claims that rest on the agreement of two means.
const AGREEING: [&str; 3] = ["agree", "faster", "not_slower"];

/// Anomalies that are counted for the reader and bias nothing: the convention scores them 0.
const STATED: [&str; 1] = ["wrong_side"];

/// What a claim says of itself.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Claim {
    /// Its name, or its kind and place in the file.
    pub label: String,
    /// One of [`KINDS`].
    pub kind: String,
    /// The outcome that makes it green.
    pub expect: Expect,
    /// It was made when passes had already been played.
    pub post_hoc: bool,
    /// It speaks of each class or observable that there is: some may be dark.
    pub each: bool,
}

/// The outcome that makes a claim green.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Expect {
    Pass,
    Differs,
    Fails,
    Invalid,
}

impl Claim {
    /// Reads claim `index` of a record: `name`, `expect`, and the one other key, its kind.
    pub fn of(record: &Record, index: usize) -> Claim {
        let entry = &record.claims[index];
        let text = |key: &str| entry[key].as_str();
        let kind = KINDS.iter().find(|kind| !entry[**kind].is_null());
        let kind = kind.map_or("claim", |kind| *kind).to_string();
        let expect = match text("expect") {
            Some("differs") => Expect::Differs,
            Some("fails") => Expect::Fails,
            Some("invalid") => Expect::Invalid,
            _ if kind == "differs" => Expect::Differs,
            _ => Expect::Pass,
        };
        let each = ["class", "observable"].iter().any(|key| entry[&kind][key] == "each");
        let label = text("name").map_or_else(|| format!("{kind} #{}", index + 1), String::from);
        Claim { label, kind, expect, post_hoc: record.post_hoc.contains(&index), each }
    }
}

/// What the numbers of a comparison show.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Evidence {
    /// Nothing, for this reason.
    None(String),
    /// No sampling error: the values are equal to rounding, or they are not.
    Identity { holds: bool },
    /// A difference that a test judges.
    Test { difference: Estimate, test: Test },
    /// An efficiency against a bound.
    Efficiency(Box<Shown>),
    /// A test of many comparisons at once.
    Sum { test: Test },
    /// Counts against probabilities.
    Fit { fit: Fit, test: Test, said: String },
    /// A statement without chance: it holds, or it does not.
    Exact { holds: bool, said: String },
}

/// Counts against probabilities: what knows the smallest defect that it would have found.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fit {
    /// Of many bins.
    Bins(Goodness),
    /// Of one outcome.
    Share(Proportion),
}

impl Fit {
    /// The smallest relative error of the density, or of the probability, that is rejected at `level`
    /// with probability `power`.
    pub fn detectable(&self, level: f64, power: f64) -> f64 {
        match self {
            Fit::Bins(found) => found.detectable(level, power).relative,
            Fit::Share(found) => {
                let (below, above) = found.detectable(level, power);
                (found.mass - below).max(above - found.mass) / found.mass
            }
        }
    }
}

/// What a trial is about, the same in the record of a second look.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Item {
    /// This comparison of the record.
    Comparison(usize),
    /// Many of them.
    Table,
    /// A sampler.
    Sampler,
}

/// One comparison and what it shows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trial {
    /// What it is about.
    pub item: Item,
    pub claim: Claim,
    /// Index of the claim in its record.
    pub claim_index: usize,
    pub evidence: Evidence,
    /// The largest difference that may go unseen, in the units of the verdict's `detectable`.
    pub detect: Option<f64>,
    /// A second look would share this one's errors: there is none.
    pub one_look: bool,
    /// What `detectable` is relative to, where that is not the expected value.
    pub reference: Option<f64>,
    /// Filled in but for adjusted p-value, detectable, outcome and note.
    pub verdict: Verdict,
}

/// One side of a comparison.
pub(super) struct Arm<'a> {
    pub run: &'a EstimatorRun,
    pub batches: Vec<Moments>,
    pub all: Moments,
    pub mean: Estimate,
}

impl<'a> Arm<'a> {
    pub fn of(stored: &'a Stored, quantity: &Quantity) -> Option<Arm<'a>> {
        let (run, batches) = (stored.run(quantity)?, stored.batches(quantity)?);
        let all = total(batches.iter().copied())?;
        let mean = Estimate::of_batches(&batches);
        Some(Arm { run, batches, all, mean })
    }

    /// Why no statement about this arm's mean is worth anything.
    pub fn objection(&self) -> Option<String> {
        let name = &self.run.estimator;
        let anomaly =
            self.run.anomalies.iter().find(|(kind, n)| **n > 0 && !STATED.contains(&kind.as_str()));
        if let Some((kind, count)) = anomaly {
            return Some(format!("{name} counted {count} of `{kind}`"));
        }
        if self.all.n != self.run.passes {
            return Some(format!("{name} holds {} passes of {}", self.all.n, self.run.passes));
        }
        if self.all.n < 2 {
            return Some(format!("too few passes: {name} has {}", self.all.n));
        }
        let finite = self.all.to_array().iter().all(|x| x.is_finite());
        (!finite).then(|| format!("{name} has a mean or moment that is not finite"))
    }

    /// Why its mean is known beforehand not to be nearly normal.
    fn known_tail(&self, quantity: &Quantity) -> Option<String> {
        let class = &quantity.observable.class;
        let concerns =
            |tail: &&StatedTail| tail.band == quantity.band && (class == "all" || *class == tail.class);
        let tail = self.run.heavy_tails.iter().find(concerns)?;
        Some(format!("heavy tail, known beforehand: {}: {}", self.run.estimator, tail.reason))
    }

    /// Why its mean is not nearly normal.
    pub fn tail_objection(&self) -> Option<String> {
        let name = &self.run.estimator;
        if self.batches.len() < MIN_BATCHES {
            let n = self.batches.len();
            return Some(format!(
                "too few passes: {name} has {n} batches, a t test wants {MIN_BATCHES}"
            ));
        }
        let skewness = self.all.skewness().abs() / (self.all.n as f64).sqrt();
        if skewness >= SKEWNESS_LIMIT {
            return Some(format!(
                "heavy tail: {name} has |skewness| / sqrt(passes) = {skewness:.2}, limit {SKEWNESS_LIMIT}"
            ));
        }
        let share = Spread::of(self.batches.iter().map(|b| (b.n as f64, b.mean))).largest_share;
        (share > SHARE_LIMIT).then(|| {
            format!("heavy tail: one batch of {name} holds {:.0} % of the variance", 100.0 * share)
        })
    }
}

/// Judges comparison `index` of a record by itself.
pub(super) fn trial(stored: &Stored, index: usize, comparison: &Comparison) -> Trial {
    if let Against::Efficiency { baseline, exceeds, cost } = &comparison.against {
        let mut means = trial(stored, index, &efficiency::of_means(stored, comparison, baseline));
        means.verdict.observable = comparison.quantity.observable.name.clone();
        return efficiency::trial(stored, means, &comparison.quantity, baseline, (*exceeds, *cost));
    }
    let claim = Claim::of(&stored.record, comparison.claim);
    let a = Arm::of(stored, &comparison.quantity);
    let (other, paired) = match &comparison.against {
        Against::Value { .. } => (None, false),
        Against::Quantity { other, paired } => (Some(other), *paired),
        Against::Efficiency { baseline, .. } => (Some(baseline), false),
    };
    let b = other.and_then(|other| Arm::of(stored, other));
    let mut verdict = blank_verdict(stored, comparison, &claim);
    if let Some(a) = &a {
        (verdict.value, verdict.std_error) = (a.mean.value, a.mean.std_error);
    }
    let expected = match (&comparison.against, &b) {
        (Against::Value { value, error, .. }, _) => Estimate::known(*value, *error),
        (_, Some(b)) => b.mean,
        (_, None) => Estimate::known(f64::NAN, f64::NAN),
    };
    (verdict.expected, verdict.expected_error) = (expected.value, expected.std_error);

    let arms: Vec<&Arm> = a.iter().chain(&b).collect();
    let missing = a.is_none() || (other.is_some() && b.is_none());
    let objection = if missing {
        Some("the record does not hold this quantity".to_string())
    } else {
        arms.iter()
            .find_map(|arm| arm.objection())
            .or_else(|| bias_objection(&claim, &arms))
            .or_else(|| model_objection(&claim, &arms))
            .or_else(|| arms.iter().find_map(|arm| arm.known_tail(&comparison.quantity)))
            .or_else(|| silence_objection(&claim, &comparison.quantity, &arms))
    };
    let evidence = match (objection, &a) {
        (None, Some(a)) => weigh(a, b.as_ref().filter(|_| paired), &expected, &arms, &mut verdict),
        (objection, _) => Evidence::None(objection.unwrap_or_default()),
    };
    let claim_reference = claim.each.then(|| whole(stored, &comparison.quantity)).flatten();
    let sampling = a.as_ref().map_or(f64::NAN, |a| a.mean.std_error);
    let one_look = stated_error(&expected, &arms) > SHARED_ERROR * sampling;
    Trial {
        item: Item::Comparison(index),
        claim,
        claim_index: comparison.claim,
        evidence,
        detect: comparison.detect,
        one_look,
        reference: claim_reference,
        verdict,
    }
}

/// Holds an arm against what is expected; `pair` is the other arm where both shared their streams.
fn weigh(
    a: &Arm,
    pair: Option<&Arm>,
    expected: &Estimate,
    arms: &[&Arm],
    verdict: &mut Verdict,
) -> Evidence {
    if pair.is_some_and(|b| !same_passes(&a.batches, &b.batches)) {
        return Evidence::None("paired runs of different numbers of passes".into());
    }
    let difference = match pair {
        Some(b) => Estimate::of_differences(&a.batches, &b.batches),
        None => a.mean.minus(expected),
    };
    let scale = a.mean.value.abs().max(expected.value.abs());
    let sampling_error = match pair {
        Some(_) => difference.std_error,
        None => arms.iter().map(|arm| arm.all.std_error()).fold(0.0, f64::max),
    };
    if sampling_error <= ROUNDING * scale {
        return weigh_exact(
            difference.value,
            scale,
            stated_error(expected, arms),
            a.mean.value,
            verdict,
        );
    }
    if let Some(objection) = arms.iter().find_map(|arm| arm.tail_objection()) {
        return Evidence::None(objection);
    }
    verdict.test = match (pair, arms.len()) {
        (Some(_), _) => "paired t",
        (None, 1) => "t",
        (None, _) => "welch t",
    }
    .into();
    Evidence::Test { difference, test: difference.test_zero() }
}

/// No sampling error. Equal to rounding passes; a value published with an error is then tested against
/// that error alone, unless nothing was ever scored.
fn weigh_exact(difference: f64, scale: f64, stated: f64, value: f64, verdict: &mut Verdict) -> Evidence {
    let holds = difference.abs() <= ROUNDING * scale;
    if !holds && stated > 0.0 && value != 0.0 {
        verdict.test = "stated error".into();
        let difference = Estimate::known(difference, stated);
        return Evidence::Test { difference, test: difference.test_zero() };
    }
    verdict.test = "identity".into();
    verdict.statistic = if scale == 0.0 { 0.0 } else { difference / scale };
    Evidence::Identity { holds }
}

/// The stated error of an expected value; 0 where it was measured.
fn stated_error(expected: &Estimate, arms: &[&Arm]) -> f64 {
    if arms.len() == 1 { expected.std_error } else { 0.0 }
}

/// A biased estimator agrees with nothing by right; a control may say that it differs.
fn bias_objection(claim: &Claim, arms: &[&Arm]) -> Option<String> {
    if !AGREEING.contains(&claim.kind.as_str()) || claim.expect == Expect::Differs {
        return None;
    }
    arms.iter().find_map(|arm| match &arm.run.bias {
        StatedBias::Biased(why) => Some(format!("{} is biased: {why}", arm.run.estimator)),
        StatedBias::Unbiased | StatedBias::Consistent => None,
    })
}

/// Estimators of different integrals owe each other nothing; a control may say that they differ.
fn model_objection(claim: &Claim, arms: &[&Arm]) -> Option<String> {
    let [a, b] = arms else { return None };
    if claim.expect == Expect::Differs || a.run.model == b.run.model {
        return None;
    }
    let name = |arm: &Arm| arm.run.model.clone().unwrap_or_else(|| "light transport".into());
    Some(format!(
        "{} estimates {}, {} {}: their difference is a model error, which the report shows",
        a.run.estimator,
        name(a),
        b.run.estimator,
        name(b)
    ))
}

/// Two estimators that both scored nothing agree on nothing: they may share what keeps them dark. A
/// claim on each class is not void by one that does not occur, as long as their sum is not dark.
fn silence_objection(claim: &Claim, quantity: &Quantity, arms: &[&Arm]) -> Option<String> {
    if claim.each && quantity.observable.class != "all" {
        return None;
    }
    let silent = |arm: &&Arm| arm.all.mean == 0.0 && arm.all.variance() == 0.0;
    let all = arms.len() > 1 && arms.iter().all(silent);
    all.then(|| "neither side scored anything; claim `equals = { value = 0 }` if that is meant".into())
}

/// The mean of the sum over all classes: what a claim on each class measures its power by.
fn whole(stored: &Stored, quantity: &Quantity) -> Option<f64> {
    let observable = Observable { class: "all".into(), ..quantity.observable.clone() };
    let batches = stored.batches(&Quantity { observable, ..quantity.clone() })?;
    Some(total(batches)?.mean.abs())
}

pub(super) fn same_passes(a: &[Moments], b: &[Moments]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.n == b.n)
}

/// A verdict on a claim of which nothing is said yet.
pub(super) fn blank(record: &Record, claim: &Claim) -> Verdict {
    Verdict {
        experiment: record.experiment.clone(),
        cell: String::new(),
        band: String::new(),
        class: String::new(),
        estimators: String::new(),
        claim: claim.label.clone(),
        test: String::new(),
        statistic: f64::NAN,
        p_value: f64::NAN,
        adjusted_p: f64::NAN,
        detectable: f64::NAN,
        outcome: Outcome::Invalid("not judged".into()),
        observable: String::new(),
        value: f64::NAN,
        std_error: f64::NAN,
        expected: f64::NAN,
        expected_error: f64::NAN,
        dof: f64::NAN,
        second_p: f64::NAN,
        note: String::new(),
        control: claim.expect != Expect::Pass,
    }
}

fn blank_verdict(stored: &Stored, comparison: &Comparison, claim: &Claim) -> Verdict {
    let (a, b) = match &comparison.against {
        Against::Value { .. } => (&comparison.quantity, &comparison.quantity),
        Against::Quantity { other, .. } | Against::Efficiency { baseline: other, .. } => {
            (&comparison.quantity, other)
        }
    };
    let record = &stored.record;
    let cell = |q: &Quantity| record.cells.get(q.cell).map_or("?", |c| &c.label).to_string();
    let band = |q: &Quantity| record.bands.get(q.band).map_or("?", |b| &b.name).to_string();
    let both = |name: &dyn Fn(&Quantity) -> String| {
        let (a, b) = (name(a), name(b));
        if a == b { a } else { format!("{a} vs {b}") }
    };
    Verdict {
        cell: both(&cell),
        band: both(&band),
        class: both(&|q| q.observable.class.clone()),
        estimators: both(&|q| q.estimator.clone()),
        observable: both(&|q| q.observable.name.clone()),
        ..blank(record, claim)
    }
}
