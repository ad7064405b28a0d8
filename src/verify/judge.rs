//! From comparisons to verdicts: every comparison by itself (`trial`), then all of them as one family
//! with at most two looks (`levels`), then what controls expect.

use std::collections::BTreeMap;

pub use super::levels::{FAMILY_LEVEL, Looks, POWER};
use super::levels::{FIRST_LOOK, SECOND_LOOK};
use super::trial::{Claim, Evidence, Expect, Item, Trial, trial};
use super::verdict::{Outcome, Verdict};
use crate::results::record::{Against, Quantity};
use crate::results::store::Stored;
use crate::stats::hypothesis::{Test, chi_square_sf, critical_value};
use crate::stats::multiplicity::holm;

/// A table of more comparisons than this is also tested as a whole.
const TABLE: usize = 10;

/// A record to judge.
#[derive(Clone, Copy, Debug)]
pub struct Case<'a> {
    /// What was measured.
    pub main: &'a Stored,
    /// What was measured again for a second look, where there was one.
    pub retest: Option<&'a Stored>,
}

/// What a verification says.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// One verdict a comparison, case by case.
    pub verdicts: Vec<Verdict>,
    /// Number of the case that each verdict is of.
    pub case_of: Vec<usize>,
    /// What wants a second look that no record holds yet; its verdicts are `fail` until then.
    pub wanted: Vec<Wanted>,
}

/// What wants a second look.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// The case.
    pub case: usize,
    /// What is to be measured again.
    pub subject: Measured,
}

/// Something that can be measured again.
#[derive(Clone, Debug, PartialEq)]
pub enum Measured {
    /// A quantity of a scene.
    Quantity(Quantity),
    /// A sampler, by name.
    Sampler(String),
}

/// Judges one record by itself, with one look.
pub fn judge_alone(stored: &Stored) -> Vec<Verdict> {
    judge(&[Case { main: stored, retest: None }], Looks::One).verdicts
}

/// Judges every comparison of every record as one family of tests.
pub fn judge(cases: &[Case], looks: Looks) -> Judgement {
    let mut trials = Vec::new();
    for (case, Case { main, .. }) in cases.iter().enumerate() {
        let comparisons = main.record.comparisons.iter().enumerate();
        let own: Vec<Trial> = comparisons.map(|(index, c)| trial(main, index, c)).collect();
        // Cells that an experiment pairs share their streams: their deviations are not independent.
        let paired = !main.record.resolved["pair"].is_null();
        let tables = if paired { vec![] } else { table_trials(&own) };
        let reproduced = super::reproduction::trials(main);
        let samplers = super::sampler::trials(main);
        let all = own.into_iter().chain(tables).chain(reproduced).chain(samplers);
        trials.extend(all.map(|trial| (case, trial)));
    }
    conclude(cases, trials, looks)
}

/// For each column of a table (one estimator, band, observable and class of an `equals` claim), the
/// sum over its cells of z^2 against chi-square: small deviations that agree in no sign, too small for
/// each cell's own test, add up here. Cells have streams of their own, so the terms are independent;
/// bands may share theirs, so they are not summed. z is the normal value with the cell's p-value.
fn table_trials(trials: &[Trial]) -> Vec<Trial> {
    let mut tables: BTreeMap<_, Vec<&Trial>> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.claim.kind == "equals" && t.claim.expect == Expect::Pass) {
        if matches!(t.evidence, Evidence::Test { .. }) {
            let v = &t.verdict;
            let key = (t.claim_index, &v.estimators, &v.band, &v.observable, &v.class);
            tables.entry(key).or_default().push(t);
        }
    }
    tables.into_values().filter(|rows| rows.len() > TABLE).map(|rows| sum_of_squares(&rows)).collect()
}

fn sum_of_squares(rows: &[&Trial]) -> Trial {
    let statistic = rows.iter().map(|t| normal_equivalent(&t.evidence)).map(|z| z * z).sum();
    let dof = rows.len() as f64;
    let test = Test { statistic, dof, p_value: chi_square_sf(statistic, dof) };
    let nothing = f64::NAN;
    let verdict = Verdict {
        cell: format!("all {} cells", rows.len()),
        test: "sum of z^2".into(),
        value: nothing,
        std_error: nothing,
        expected: nothing,
        expected_error: nothing,
        ..rows[0].verdict.clone()
    };
    let evidence = Evidence::Sum { test };
    Trial {
        item: Item::Table,
        evidence,
        detect: None,
        one_look: true,
        reference: None,
        verdict,
        ..rows[0].clone()
    }
}

/// The |z| whose normal p-value is the test's; the statistic itself where that p-value underflows.
fn normal_equivalent(evidence: &Evidence) -> f64 {
    match evidence {
        Evidence::Test { test, .. } if test.p_value > 0.0 => critical_value(test.p_value, f64::INFINITY),
        Evidence::Test { test, .. } => test.statistic,
        _ => 0.0,
    }
}

/// Adjusts p-values over the family, looks again where that is due, and states outcomes.
fn conclude(cases: &[Case], trials: Vec<(usize, Trial)>, looks: Looks) -> Judgement {
    let p_values: Vec<f64> = trials.iter().filter_map(|(_, t)| t.evidence.p_value()).collect();
    let mut adjusted = holm(&p_values).into_iter();
    let adjusted: Vec<f64> = trials
        .iter()
        .map(|(_, t)| t.evidence.p_value().and_then(|_| adjusted.next()).unwrap_or(f64::NAN))
        .collect();
    let again: Vec<usize> = (0..trials.len())
        .filter(|&i| looks == Looks::Two && wants_second_look(&trials[i].1, adjusted[i], looks))
        .collect();
    let seconds: Vec<Option<Trial>> =
        again.iter().map(|&i| second(&cases[trials[i].0], &trials[i].1)).collect();
    // A look that is still missing counts as one: the level of the others must not depend on it.
    let second_p: Vec<f64> =
        seconds.iter().map(|t| t.as_ref().and_then(|t| t.evidence.p_value()).unwrap_or(1.0)).collect();
    let second_adjusted = holm(&second_p);
    let mut second_looks: BTreeMap<usize, SecondLook> = BTreeMap::new();
    let mut wanted = Vec::new();
    for ((&i, second), adjusted_p) in again.iter().zip(seconds).zip(second_adjusted) {
        let (case, first) = &trials[i];
        let look = match second.map(|t| t.evidence) {
            None => {
                let subjects = measured_by(&cases[*case], first);
                wanted.extend(subjects.into_iter().map(|subject| Wanted { case: *case, subject }));
                SecondLook::Missing
            }
            Some(Evidence::None(reason)) => SecondLook::Invalid(reason),
            Some(Evidence::Efficiency(_)) => SecondLook::Invalid("efficiencies have one look".into()),
            Some(Evidence::Identity { holds } | Evidence::Exact { holds, .. }) => {
                SecondLook::Taken(if holds { 1.0 } else { 0.0 })
            }
            Some(Evidence::Test { test, .. } | Evidence::Sum { test } | Evidence::Fit { test, .. })
                if test.p_value.is_nan() =>
            {
                SecondLook::Invalid("the test has no p-value".into())
            }
            Some(Evidence::Test { .. } | Evidence::Sum { .. } | Evidence::Fit { .. }) => {
                SecondLook::Taken(adjusted_p)
            }
        };
        second_looks.insert(i, look);
    }
    let tests = p_values.len().max(1) as f64;
    let case_of = trials.iter().map(|(case, _)| *case).collect();
    let verdicts = trials
        .into_iter()
        .enumerate()
        .map(|(i, (_, t))| state(t, adjusted[i], second_looks.get(&i), looks, tests))
        .collect();
    Judgement { verdicts, case_of, wanted }
}

/// Did the first look fail, and is it one that a second look decides? A control that must differ has to
/// be seen at once.
fn wants_second_look(trial: &Trial, adjusted_p: f64, looks: Looks) -> bool {
    matches!(trial.evidence, Evidence::Test { .. } | Evidence::Fit { .. })
        && !trial.one_look
        && trial.claim.expect == Expect::Pass
        && (looks.at_once()..FIRST_LOOK).contains(&adjusted_p)
}

/// The same trial on the record of the second look, where that holds all it needs.
fn second(case: &Case, first: &Trial) -> Option<Trial> {
    let retest = case.retest?;
    let is_held = |subject: &Measured| match subject {
        Measured::Quantity(quantity) => retest.batches(quantity).is_some(),
        Measured::Sampler(name) => retest.record.samplers.iter().any(|run| run.sampler == *name),
    };
    let subjects = measured_by(case, first);
    if subjects.is_empty() || !subjects.iter().all(is_held) {
        return None;
    }
    match first.item {
        Item::Comparison(index) => Some(trial(retest, index, &case.main.record.comparisons[index])),
        Item::Sampler => super::sampler::trials(retest).into_iter().find(|again| {
            let of = |t: &Trial| (t.claim_index, t.verdict.estimators.clone(), t.verdict.test.clone());
            of(again) == of(first)
        }),
        Item::Table => None,
    }
}

/// What a second look at a trial has to measure.
fn measured_by(case: &Case, trial: &Trial) -> Vec<Measured> {
    match trial.item {
        Item::Comparison(index) => {
            let comparison = &case.main.record.comparisons[index];
            let other = match &comparison.against {
                Against::Quantity { other, .. } => Some(other.clone()),
                Against::Value { .. } | Against::Efficiency { .. } => None,
            };
            let quantities = std::iter::once(comparison.quantity.clone()).chain(other);
            quantities.map(Measured::Quantity).collect()
        }
        Item::Sampler => vec![Measured::Sampler(trial.verdict.estimators.clone())],
        Item::Table => Vec::new(),
    }
}

/// What a second look came to.
enum SecondLook {
    /// It was not taken yet.
    Missing,
    /// It means nothing, for this reason.
    Invalid(String),
    /// Its adjusted p-value.
    Taken(f64),
}

fn state(
    trial: Trial,
    adjusted_p: f64,
    second: Option<&SecondLook>,
    looks: Looks,
    tests: f64,
) -> Verdict {
    let Trial { claim, evidence, detect, one_look, reference, mut verdict, .. } = trial;
    if let Evidence::Test { test, .. } | Evidence::Sum { test } | Evidence::Fit { test, .. } = &evidence
    {
        (verdict.statistic, verdict.p_value, verdict.dof) = (test.statistic, test.p_value, test.dof);
        verdict.adjusted_p = adjusted_p;
    }
    // The hardest of Holm's steps, so that `detectable` holds whatever the other tests say.
    let own_level = looks.first(one_look || claim.expect != Expect::Pass) / tests;
    if let Evidence::Efficiency(shown) = &evidence {
        let test = &shown.test;
        (verdict.statistic, verdict.p_value, verdict.dof) = (test.statistic, test.p_value, test.dof);
        (verdict.adjusted_p, verdict.detectable) = (adjusted_p, shown.detectable(own_level));
    }
    if let Evidence::Fit { fit, .. } = &evidence {
        verdict.detectable = fit.detectable(own_level, POWER);
    }
    if let Evidence::Test { difference, .. } = &evidence {
        let reference = reference.unwrap_or(verdict.expected.abs());
        let reference = if reference == 0.0 { 1.0 } else { reference };
        verdict.detectable = difference.detectable(own_level, POWER) / reference;
    }
    if let Some(SecondLook::Taken(p)) = second {
        verdict.second_p = *p;
    }
    let found = match (&evidence, second) {
        (Evidence::None(reason), _) => Outcome::Invalid(reason.clone()),
        (Evidence::Efficiency(shown), _) => {
            let levels = (looks.at_once(), own_level);
            shown.outcome(verdict.adjusted_p, levels, detect, claim.expect == Expect::Fails)
        }
        (Evidence::Identity { holds: true } | Evidence::Exact { holds: true, .. }, _) => Outcome::Pass,
        (Evidence::Identity { holds: false } | Evidence::Exact { holds: false, .. }, _) => Outcome::Fail,
        (_, Some(SecondLook::Missing)) => Outcome::Fail,
        (_, Some(SecondLook::Invalid(reason))) => Outcome::Invalid(format!("second look: {reason}")),
        (_, Some(SecondLook::Taken(p))) if *p < SECOND_LOOK => Outcome::Fail,
        // Not `adjusted_p < level`: a NaN must not pass.
        (Evidence::Test { .. } | Evidence::Sum { .. } | Evidence::Fit { .. }, _) => {
            match verdict.adjusted_p {
                p if p.is_nan() => Outcome::Invalid("the test has no p-value".into()),
                p if p < looks.at_once() => Outcome::Fail,
                _ if detect.is_some_and(|d| verdict.detectable > d) => Outcome::Underpowered,
                _ => Outcome::Pass,
            }
        }
    };
    verdict.note = match &evidence {
        Evidence::Efficiency(shown) => shown.note(&found, own_level),
        _ => note(&found, &evidence, detect, &verdict),
    };
    match second {
        Some(SecondLook::Missing) => verdict.note += "; wants a second look on fresh streams",
        Some(SecondLook::Taken(_)) if found == Outcome::Pass => {
            verdict.note = "failed at the first look and cleared by a second on fresh streams".into();
        }
        Some(SecondLook::Taken(_)) => verdict.note += ", at both looks",
        _ => {}
    }
    verdict.outcome = expected_outcome(&claim, found, &mut verdict.note);
    if claim.post_hoc {
        let reason = "post hoc: claimed when passes had been played; another seed makes it evidence";
        verdict.note = reason.into();
        verdict.outcome = Outcome::Invalid(reason.into());
    }
    verdict
}

/// The reason for an outcome.
fn note(found: &Outcome, evidence: &Evidence, detect: Option<f64>, verdict: &Verdict) -> String {
    match (found, evidence) {
        (Outcome::Invalid(reason), _) => reason.clone(),
        (Outcome::Pass, Evidence::Identity { .. }) => {
            "no sampling error, equal to rounding (1e-12)".into()
        }
        (Outcome::Fail, Evidence::Identity { .. }) => {
            format!("no sampling error, and a relative deviation of {:.1e}", verdict.statistic)
        }
        (Outcome::Pass | Outcome::Fail, Evidence::Exact { said, .. }) => said.clone(),
        (Outcome::Fail, Evidence::Fit { said, .. }) => said.clone(),
        (Outcome::Fail, Evidence::Sum { .. }) => "the table as a whole deviates".into(),
        (Outcome::Fail, _) => {
            let difference = verdict.value - verdict.expected;
            let relative = 100.0 * difference / verdict.expected.abs();
            if relative.is_finite() {
                format!("off by {relative:+.2} %")
            } else {
                format!("off by {difference:+.2e}")
            }
        }
        (Outcome::Underpowered, _) => {
            format!(
                "could have missed {:.2e}, the claim wants {:.2e}",
                verdict.detectable,
                detect.unwrap_or(f64::NAN)
            )
        }
        (Outcome::Pass, _) => String::new(),
    }
}

/// A control is green where it finds what it expects.
fn expected_outcome(claim: &Claim, found: Outcome, note: &mut String) -> Outcome {
    let (wanted, green) = match claim.expect {
        Expect::Pass => return found,
        Expect::Differs => ("a difference", found == Outcome::Fail),
        Expect::Fails => ("a failure", found == Outcome::Fail),
        Expect::Invalid => ("an invalid test", matches!(found, Outcome::Invalid(_))),
    };
    let said = if note.is_empty() { "no difference found".to_string() } else { std::mem::take(note) };
    *note = format!("control, expects {wanted}: {said}");
    match found {
        _ if green => Outcome::Pass,
        Outcome::Invalid(reason) => Outcome::Invalid(reason),
        _ => Outcome::Fail,
    }
}

impl Evidence {
    fn p_value(&self) -> Option<f64> {
        match self {
            Evidence::Test { test, .. } | Evidence::Sum { test } | Evidence::Fit { test, .. } => {
                Some(test.p_value).filter(|p| !p.is_nan())
            }
            Evidence::Efficiency(shown) => Some(shown.test.p_value).filter(|p| !p.is_nan()),
            Evidence::None(_) | Evidence::Identity { .. } | Evidence::Exact { .. } => None,
        }
    }
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;
