//! From comparisons to verdicts: every comparison by itself (`trial`), then all of them under
//! one family-wise error rate, then what controls expect.

use std::collections::BTreeMap;

use super::trial::{Claim, Evidence, Expect, Trial, trial};
use super::verdict::{Outcome, Verdict};
use crate::results::store::Stored;
use crate::stats::hypothesis::{Test, chi_square_sf, critical_value};
use crate::stats::multiplicity::holm;

/// The probability of any false failure in one whole verification.
pub const FAMILY_LEVEL: f64 = 1e-6;

/// The probability with which a difference of size `detectable` is found.
pub const POWER: f64 = 0.99;

/// A table of more comparisons than this is also tested as a whole.
const TABLE: usize = 10;

/// Judges every comparison of every record as one family of tests at `level` ([`FAMILY_LEVEL`]).
pub fn judge(records: &[&Stored], level: f64) -> Vec<Verdict> {
    let mut trials = Vec::new();
    for stored in records {
        let own: Vec<Trial> = stored.record.comparisons.iter().map(|c| trial(stored, c)).collect();
        // Cells that an experiment pairs share their streams: their deviations are not independent.
        let paired = !stored.record.resolved["pair"].is_null();
        let tables = if paired { vec![] } else { table_trials(&own) };
        trials.extend(own);
        trials.extend(tables);
    }
    conclude(trials, level)
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
    Trial { evidence: Evidence::Sum { test }, detect: None, verdict, ..rows[0].clone() }
}

/// The |z| whose normal p-value is the test's; the statistic itself where that p-value underflows.
fn normal_equivalent(evidence: &Evidence) -> f64 {
    match evidence {
        Evidence::Test { test, .. } if test.p_value > 0.0 => critical_value(test.p_value, f64::INFINITY),
        Evidence::Test { test, .. } => test.statistic,
        _ => 0.0,
    }
}

/// Adjusts p-values over the family and states outcomes.
fn conclude(trials: Vec<Trial>, level: f64) -> Vec<Verdict> {
    let p_values: Vec<f64> = trials.iter().filter_map(|t| t.evidence.p_value()).collect();
    // The hardest of Holm's steps, so that `detectable` holds whatever the other tests say.
    let own_level = level / p_values.len().max(1) as f64;
    let mut adjusted = holm(&p_values).into_iter();
    trials
        .into_iter()
        .map(|t| {
            let adjusted_p = t.evidence.p_value().and_then(|_| adjusted.next());
            state(t, adjusted_p, level, own_level)
        })
        .collect()
}

fn state(trial: Trial, adjusted_p: Option<f64>, level: f64, own_level: f64) -> Verdict {
    let Trial { claim, evidence, detect, mut verdict, .. } = trial;
    if let Evidence::Test { test, .. } | Evidence::Sum { test } = &evidence {
        (verdict.statistic, verdict.p_value, verdict.dof) = (test.statistic, test.p_value, test.dof);
        verdict.adjusted_p = adjusted_p.unwrap_or(f64::NAN);
    }
    if let Evidence::Test { difference, .. } = &evidence {
        let reference = if verdict.expected == 0.0 { 1.0 } else { verdict.expected.abs() };
        verdict.detectable = difference.detectable(own_level, POWER) / reference;
    }
    let found = match &evidence {
        Evidence::None(reason) => Outcome::Invalid(reason.clone()),
        Evidence::Identity { holds: true } => Outcome::Pass,
        Evidence::Identity { holds: false } => Outcome::Fail,
        // Not `adjusted_p < level`: a NaN must not pass.
        Evidence::Test { .. } | Evidence::Sum { .. } => match verdict.adjusted_p {
            p if p.is_nan() => Outcome::Invalid("the test has no p-value".into()),
            p if p < level => Outcome::Fail,
            _ if detect.is_some_and(|d| verdict.detectable > d) => Outcome::Underpowered,
            _ => Outcome::Pass,
        },
    };
    verdict.note = note(&found, &evidence, detect, &verdict);
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
            Evidence::Test { test, .. } | Evidence::Sum { test } => {
                Some(test.p_value).filter(|p| !p.is_nan())
            }
            Evidence::None(_) | Evidence::Identity { .. } => None,
        }
    }
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;
