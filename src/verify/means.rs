//! A mean compared with a value or with another mean, and why the comparison may be void.

use super::evidence::Evidence;
use super::levels::SHARED_ERROR;
use super::verdict::{Objection, TestKind};
use crate::results::record::{
    Claim, ClaimKind, EstimatorRun, ExpectedOutcome, InvalidReason, Quantity, StatedBias, StatedTail,
};
use crate::results::store::Stored;
use crate::stats::hypothesis::{Estimate, Spread};
use crate::stats::moments::Moments;
use crate::stats::tree::total;

/// A t test rests on at least this many batch means.
const MIN_BATCHES: usize = 64;

/// Limit of |skewness| / sqrt(passes). With log-normal scores in 64 batches, a t test at level 1e-4
/// was measured to give twice as many false alarms at 0.26, and 30 times as many at 3.2; batching does
/// not cure skewness, only passes do.
pub(crate) const SKEWNESS_LIMIT: f64 = 0.1;

/// Limit of one batch's share of the variance between batches. Of 64 normal batches, one holds more
/// than a half with probability below 1e-13; with more, one score decides, and hides every other
/// difference behind its own error.
pub(super) const SHARE_LIMIT: f64 = 0.5;

/// Sampling errors and deviations below this, relative to the value, are rounding.
pub(super) const ROUNDING: f64 = 1e-12;

/// Anomalies that are counted for the reader and bias nothing: the convention scores them 0.
const STATED: [&str; 1] = ["wrong_side"];

/// The mean of a quantity, and what it rests on.
pub(super) struct QuantityMean<'a> {
    pub run: &'a EstimatorRun,
    pub batches: Vec<Moments>,
    pub all: Moments,
    pub mean: Estimate,
}

impl<'a> QuantityMean<'a> {
    pub(super) fn of(stored: &'a Stored, quantity: &Quantity) -> Option<QuantityMean<'a>> {
        let (run, batches) = (stored.run(quantity)?, stored.batches(quantity)?);
        let all = total(batches.iter().copied())?;
        let mean = Estimate::of_batches(&batches);
        Some(QuantityMean { run, batches, all, mean })
    }

    /// Why every statement about it is void.
    pub(super) fn objection(&self) -> Option<Objection> {
        let name = &self.run.estimator;
        let anomaly =
            self.run.anomalies.iter().find(|(kind, n)| **n > 0 && !STATED.contains(&kind.as_str()));
        if let Some((kind, count)) = anomaly {
            return Some(format!("{name} counted {count} of `{kind}`").into());
        }
        if self.all.n != self.run.passes {
            return Some(format!("{name} holds {} passes of {}", self.all.n, self.run.passes).into());
        }
        if self.all.n < 2 {
            let said = format!("too few passes: {name} has {}", self.all.n);
            let few = Objection::new(InvalidReason::TooFewPasses, said);
            return Some(few.until(MIN_BATCHES as f64 / self.all.n.max(1) as f64));
        }
        let finite = self.all.to_array().iter().all(|x| x.is_finite());
        (!finite).then(|| format!("{name} has a mean or moment that is not finite").into())
    }

    /// Why it is known beforehand not to be nearly normal.
    fn known_tail(&self, quantity: &Quantity) -> Option<Objection> {
        let class = &quantity.observable.class;
        let concerns =
            |tail: &&StatedTail| tail.band == quantity.band && (class == "all" || *class == tail.class);
        let tail = self.run.heavy_tails.iter().find(concerns)?;
        let said = format!("heavy tail, known beforehand: {}: {}", self.run.estimator, tail.reason);
        Some(Objection::new(InvalidReason::HeavyTail, said))
    }

    /// Why it is not nearly normal.
    pub(super) fn tail_objection(&self) -> Option<Objection> {
        let name = &self.run.estimator;
        if self.batches.len() < MIN_BATCHES {
            let n = self.batches.len();
            let said = format!("too few passes: {name} has {n} batches, a t test needs {MIN_BATCHES}");
            // From 64 passes on there are at least as many batches.
            let few = Objection::new(InvalidReason::TooFewPasses, said);
            return Some(few.until(MIN_BATCHES as f64 / self.all.n as f64));
        }
        let skewness = self.all.skewness().abs() / (self.all.n as f64).sqrt();
        if skewness >= SKEWNESS_LIMIT {
            let said = format!(
                "heavy tail: {name} has |skewness| / sqrt(passes) = {skewness:.2}, limit {SKEWNESS_LIMIT}"
            );
            let factor = (skewness / SKEWNESS_LIMIT) * (skewness / SKEWNESS_LIMIT);
            return Some(Objection::new(InvalidReason::HeavyTail, said).until(factor));
        }
        let share = Spread::of(self.batches.iter().map(|b| (b.n as f64, b.mean))).largest_share;
        (share > SHARE_LIMIT).then(|| {
            let said =
                format!("heavy tail: one batch of {name} holds {:.0} % of the variance", 100.0 * share);
            Objection::new(InvalidReason::HeavyTail, said)
        })
    }
}

/// What a claim asks of the means that it is about.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    /// Whether they must be equal: an estimator with a bias cannot claim that.
    agreement: bool,
    /// Whether a difference must be found, so that a reason for one is no objection.
    difference: bool,
    /// Whether it is on each class or observable that exists: some may be 0.
    each: bool,
}

impl Asked {
    /// A claim that two means are equal.
    pub(super) const EQUAL: Asked = Asked { agreement: true, difference: false, each: false };

    /// What a claim asks.
    pub(super) fn by(claim: &Claim) -> Asked {
        Asked {
            agreement: matches!(claim.kind, ClaimKind::Agree | ClaimKind::Faster | ClaimKind::NotSlower),
            difference: claim.expects == ExpectedOutcome::Differs,
            each: claim.each,
        }
    }
}

/// What a mean is compared with.
#[derive(Clone, Copy, Debug)]
pub(super) enum Reference<'a> {
    /// A value with its stated error.
    Value(Estimate),
    /// Another mean; `paired` where both were run on the same random streams.
    Mean { quantity: &'a Quantity, paired: bool },
}

/// Result of comparing a mean with its reference.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeanTest {
    /// The evidence.
    pub evidence: Evidence,
    /// The test, where one was possible.
    pub test: Option<TestKind>,
    /// The relative deviation, where there is no sampling error.
    pub deviation: Option<f64>,
    /// The mean, where the record holds it.
    pub value: Option<Estimate>,
    /// What it was compared with, where that is known.
    pub expected: Option<Estimate>,
    /// A second look would share this one's errors.
    pub one_look: bool,
    /// Whether there is no evidence for the tail of the other mean alone.
    pub other_tail_alone: bool,
}

/// Whether two means of a record are equal.
pub(super) fn evidence_of_means(stored: &Stored, a: &Quantity, b: &Quantity) -> MeanTest {
    hold(stored, a, Reference::Mean { quantity: b, paired: false }, Asked::EQUAL)
}

/// Holds a mean against its reference.
pub(super) fn hold(
    stored: &Stored,
    quantity: &Quantity,
    reference: Reference,
    asked: Asked,
) -> MeanTest {
    let a = QuantityMean::of(stored, quantity);
    let (b, is_paired, stated) = match reference {
        Reference::Value(value) => (None, false, Some(value)),
        Reference::Mean { quantity, paired } => (QuantityMean::of(stored, quantity), paired, None),
    };
    let expected = stated.or_else(|| b.as_ref().map(|b| b.mean));
    let stated_error = stated.map_or(0.0, |value| value.std_error);
    let mut held = MeanTest {
        evidence: Evidence::Nothing("the record does not hold this quantity".into()),
        test: None,
        deviation: None,
        value: a.as_ref().map(|a| a.mean),
        expected,
        one_look: a.as_ref().is_some_and(|a| stated_error > SHARED_ERROR * a.mean.std_error),
        other_tail_alone: false,
    };
    let (Some(a), Some(expected)) = (&a, expected) else { return held };
    let means: Vec<&QuantityMean> = std::iter::once(a).chain(&b).collect();
    if let Some(objection) = objection(quantity, &means, asked) {
        held.evidence = Evidence::Nothing(objection);
        return held;
    }
    let pair = b.as_ref().filter(|_| is_paired);
    if pair.is_some_and(|b| !same_passes(&a.batches, &b.batches)) {
        held.evidence = Evidence::Nothing("paired runs of different numbers of passes".into());
        return held;
    }
    let difference = match pair {
        Some(b) => Estimate::of_differences(&a.batches, &b.batches),
        None => a.mean.minus(&expected),
    };
    let scale = a.mean.value.abs().max(expected.value.abs());
    let sampling_error = match pair {
        Some(_) => difference.std_error,
        None => means.iter().map(|mean| mean.all.std_error()).fold(0.0, f64::max),
    };
    if sampling_error <= ROUNDING * scale {
        hold_exact(&mut held, difference.value, scale, stated_error, a.mean.value);
        return held;
    }
    if let Some(objection) = means.iter().find_map(|mean| mean.tail_objection()) {
        held.evidence = Evidence::Nothing(objection);
        held.other_tail_alone = a.tail_objection().is_none();
        return held;
    }
    held.test = Some(match (pair, stated) {
        (Some(_), _) => TestKind::PairedT,
        (None, Some(_)) => TestKind::T,
        (None, None) => TestKind::WelchT,
    });
    held.evidence = Evidence::of_difference(difference);
    held
}

/// No sampling error. Equal to rounding passes; a value published with an error is then tested against
/// that error alone, unless nothing was ever scored.
fn hold_exact(held: &mut MeanTest, difference: f64, scale: f64, stated_error: f64, value: f64) {
    let holds = difference.abs() <= ROUNDING * scale;
    if !holds && stated_error > 0.0 && value != 0.0 {
        held.test = Some(TestKind::StatedError);
        held.evidence = Evidence::of_difference(Estimate::known(difference, stated_error));
        return;
    }
    let deviation = if scale == 0.0 { 0.0 } else { difference / scale };
    let said = match holds {
        true => "no sampling error, equal to rounding (1e-12)".into(),
        false => format!("no sampling error, and a relative deviation of {deviation:.1e}"),
    };
    (held.test, held.deviation) = (Some(TestKind::Identity), Some(deviation));
    held.evidence = Evidence::Exact { holds, said };
}

/// Why the test would be void.
fn objection(quantity: &Quantity, means: &[&QuantityMean], asked: Asked) -> Option<Objection> {
    means
        .iter()
        .find_map(|mean| mean.objection())
        .or_else(|| bias_objection(means, asked))
        .or_else(|| model_objection(means, asked))
        .or_else(|| means.iter().find_map(|mean| mean.known_tail(quantity)))
        .or_else(|| silence_objection(quantity, means, asked))
}

/// A biased estimator may not claim to agree; a control may state that it differs.
fn bias_objection(means: &[&QuantityMean], asked: Asked) -> Option<Objection> {
    if !asked.agreement || asked.difference {
        return None;
    }
    means.iter().find_map(|mean| match &mean.run.bias {
        StatedBias::Biased(why) => {
            let said = format!("{} is biased: {why}", mean.run.estimator);
            Some(Objection::new(InvalidReason::Biased, said))
        }
        StatedBias::Unbiased | StatedBias::Consistent => None,
    })
}

/// Estimators of different integrals need not agree; a control may state that they differ.
fn model_objection(means: &[&QuantityMean], asked: Asked) -> Option<Objection> {
    let [a, b] = means else { return None };
    if asked.difference || a.run.model == b.run.model {
        return None;
    }
    let name = |mean: &QuantityMean| mean.run.model.clone().unwrap_or_else(|| "light transport".into());
    let said = format!(
        "{} estimates {}, {} {}: their difference is a model error, which the report shows",
        a.run.estimator,
        name(a),
        b.run.estimator,
        name(b)
    );
    Some(Objection::new(InvalidReason::DifferentModels, said))
}

/// Two estimators that both scored nothing agree on nothing: they may share the defect that makes them
/// zero. A claim on each class is not void by one that does not occur, as long as their sum is not 0.
fn silence_objection(quantity: &Quantity, means: &[&QuantityMean], asked: Asked) -> Option<Objection> {
    if asked.each && quantity.observable.class != "all" {
        return None;
    }
    let is_silent = |mean: &&QuantityMean| mean.all.mean == 0.0 && mean.all.variance() == 0.0;
    let all = means.len() > 1 && means.iter().all(is_silent);
    all.then(|| {
        let said = "neither side scored anything; claim `equals = { value = 0 }` if that is meant";
        Objection::new(InvalidReason::NothingScored, said.into())
    })
}

/// The same numbers of passes, batch by batch.
pub(super) fn same_passes(a: &[Moments], b: &[Moments]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.n == b.n)
}
