//! Tests of one call, judged under one family-wise error rate: what `judge` and `compare` share.

use super::judge::POWER;
use super::verdict::{Outcome, Verdict};
use crate::stats::hypothesis::{Estimate, Test};
use crate::stats::multiplicity::holm;
use crate::stats::signs;

/// What one test shows.
#[derive(Clone, Debug)]
pub(super) enum Shown {
    /// Nothing, for this reason.
    Nothing(String),
    /// No sampling error: the two sides are the same, or they are not.
    Exact { same: bool },
    /// A difference with its error; its p-value is this many times that of Student's t.
    Difference { estimate: Estimate, times: f64 },
    /// A statistic with the p-value of `signs::one_sided_bound`, from `terms` terms, and the true effect
    /// that moves it by 1; `detectable` is the root of such an effect.
    Bounded { t: f64, terms: f64, unit: f64 },
}

/// One test of a family.
#[derive(Clone, Debug)]
pub(super) struct Finding {
    pub shown: Shown,
    /// What `detectable` is relative to; 0 for absolute.
    pub relative_to: f64,
    /// The largest detectable effect, in those units, that leaves a pass a pass.
    pub detect: Option<f64>,
    /// Filled in but for the test's numbers, outcome and note.
    pub verdict: Verdict,
}

impl Finding {
    fn p_value(&self) -> Option<f64> {
        match &self.shown {
            Shown::Difference { estimate, times } => Some(test(estimate, *times).p_value),
            Shown::Bounded { t, .. } => Some(signs::one_sided_bound(*t)),
            Shown::Nothing(_) | Shown::Exact { .. } => None,
        }
        .filter(|p| !p.is_nan())
    }
}

/// The test that a difference is chance.
fn test(difference: &Estimate, times: f64) -> Test {
    let Estimate { value, std_error, dof } = *difference;
    let statistic = value / std_error;
    let p_value = if statistic.is_finite() {
        // Not `min`, which would make a p-value of what is not a number.
        let p_value = times * difference.test_zero().p_value;
        if p_value > 1.0 { 1.0 } else { p_value }
    } else if std_error == 0.0 && !value.is_nan() {
        if value == 0.0 { 1.0 } else { 0.0 }
    } else {
        f64::NAN
    };
    Test { statistic, dof, p_value }
}

/// The verdicts of a family at `level`: Holm's adjustment over all of it.
pub(super) fn conclude(findings: Vec<Finding>, level: f64) -> Vec<Verdict> {
    let p_values: Vec<f64> = findings.iter().filter_map(Finding::p_value).collect();
    // The hardest of Holm's steps, so that `detectable` holds whatever the other tests say.
    let own_level = level / p_values.len().max(1) as f64;
    let mut adjusted = holm(&p_values).into_iter();
    let mut verdicts = Vec::new();
    for finding in findings {
        let adjusted_p = finding.p_value().and_then(|_| adjusted.next());
        verdicts.push(state(finding, adjusted_p, level, own_level));
    }
    verdicts
}

fn state(finding: Finding, adjusted_p: Option<f64>, level: f64, own_level: f64) -> Verdict {
    let Finding { shown, relative_to, detect, mut verdict } = finding;
    let scale = if relative_to == 0.0 { 1.0 } else { relative_to.abs() };
    match &shown {
        Shown::Nothing(_) => {}
        Shown::Exact { .. } => verdict.statistic = 0.0,
        Shown::Difference { estimate, times } => {
            let test = test(estimate, *times);
            (verdict.statistic, verdict.p_value, verdict.dof) = (test.statistic, test.p_value, test.dof);
            verdict.detectable = estimate.detectable(own_level / times, POWER) / scale;
        }
        Shown::Bounded { t, terms, unit } => {
            (verdict.statistic, verdict.p_value) = (*t, signs::one_sided_bound(*t));
            verdict.detectable = (unit * signs::detectable(own_level, POWER, *terms)).sqrt() / scale;
        }
    }
    verdict.adjusted_p = adjusted_p.unwrap_or(f64::NAN);
    let (outcome, reason) = match shown {
        Shown::Nothing(reason) => (Outcome::Invalid(reason.clone()), reason),
        Shown::Exact { same: true } => (Outcome::Pass, "the same".into()),
        Shown::Exact { same: false } => (Outcome::Fail, format!("no sampling error, {}", off(&verdict))),
        // Not `adjusted_p < level`: a NaN must not pass.
        Shown::Difference { .. } | Shown::Bounded { .. } => match verdict.adjusted_p {
            p if p.is_nan() => {
                let reason = "the test has no p-value".to_string();
                (Outcome::Invalid(reason.clone()), reason)
            }
            p if p < level => (Outcome::Fail, off(&verdict)),
            // What is not a number sees nothing.
            _ if detect.is_some_and(|d| verdict.detectable > d || verdict.detectable.is_nan()) => {
                let wanted = 100.0 * detect.unwrap_or(f64::NAN);
                let seen = 100.0 * verdict.detectable;
                let reason = format!("could have missed {seen:.2} %, {wanted:.2} % are to be seen");
                (Outcome::Underpowered, reason)
            }
            _ => (Outcome::Pass, String::new()),
        },
    };
    if verdict.note.is_empty() {
        verdict.note = reason;
    } else if !reason.is_empty() {
        verdict.note = format!("{reason}; {}", verdict.note);
    }
    verdict.outcome = outcome;
    verdict
}

/// How far a value lies from what is expected; nothing where there are no values.
fn off(verdict: &Verdict) -> String {
    let difference = verdict.value - verdict.expected;
    let relative = 100.0 * difference / verdict.expected.abs();
    if difference.is_nan() {
        String::new()
    } else if relative.is_finite() {
        format!("off by {relative:+.2} %")
    } else {
        format!("off by {difference:+.2e}")
    }
}
