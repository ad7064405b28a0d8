//! Tests of one call, judged as one family: Holm's adjustment over all of them, second looks where there
//! are two, the smallest detectable defect, and the outcome. `verify`, `judge` and `compare` share it.

use std::collections::BTreeMap;

use super::evidence::Evidence;
use super::levels::{FIRST_LOOK, Looks, SECOND_LOOK};
use super::verdict::{Objection, Outcome, Verdict, known};
use crate::results::number::significant;
use crate::stats::multiplicity::holm;

/// One test of a family.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Finding {
    /// Evidence of the test by itself.
    pub evidence: Evidence,
    /// What `detectable` of a difference is relative to; 0 for absolute.
    pub relative_to: f64,
    /// The largest defect that may go unseen, in the units of the verdict's `detectable`.
    pub detect: Option<f64>,
    /// Whether it has one look: a second one would share its errors, or come too late.
    pub one_look: bool,
    /// Filled in except for the test's numbers, outcome and note.
    pub verdict: Verdict,
}

impl Finding {
    /// With an absolute `detectable`, nothing that must be detected, and a second look.
    pub(super) fn new(verdict: Verdict, evidence: Evidence) -> Finding {
        Finding { evidence, relative_to: 0.0, detect: None, one_look: false, verdict }
    }

    /// Whether the first look failed and a second look decides.
    fn wants_second_look(&self, adjusted_p: Option<f64>, looks: Looks) -> bool {
        matches!(self.evidence, Evidence::Difference { .. } | Evidence::Counts { .. })
            && !self.one_look
            && looks == Looks::Two
            && adjusted_p.is_some_and(|p| (looks.at_once()..FIRST_LOOK).contains(&p))
    }
}

/// The verdicts of a family.
pub(super) struct Concluded {
    /// One verdict for each finding.
    pub verdicts: Vec<Verdict>,
    /// The findings that need a second look which was not taken yet; their verdicts are `fail` until
    /// then.
    pub wanted: Vec<usize>,
}

/// State of a second look.
enum SecondLook {
    /// Not taken yet.
    Missing,
    /// Void, for this reason.
    Invalid(Objection),
    /// Taken, with this adjusted p-value.
    Taken(f64),
}

/// The verdicts of a family; `again` is what the second look at a finding shows, where it was taken.
pub(super) fn conclude(
    findings: Vec<Finding>,
    looks: Looks,
    again: impl Fn(usize, &Finding) -> Option<Evidence>,
) -> Concluded {
    let p_values: Vec<f64> = findings.iter().filter_map(|f| f.evidence.p_value()).collect();
    let mut adjusted = holm(&p_values).into_iter();
    let adjusted: Vec<Option<f64>> =
        findings.iter().map(|f| f.evidence.p_value().and_then(|_| adjusted.next())).collect();
    let due = |&i: &usize| findings[i].wants_second_look(adjusted[i], looks);
    let seconds: BTreeMap<usize, Option<Evidence>> =
        (0..findings.len()).filter(due).map(|i| (i, again(i, &findings[i]))).collect();
    let wanted = seconds.iter().filter(|(_, second)| second.is_none()).map(|(i, _)| *i).collect();
    let mut second_looks = second_looks(seconds);
    let tests = p_values.len().max(1) as f64;
    let verdicts = findings.into_iter().zip(adjusted).enumerate();
    let verdicts = verdicts
        .map(|(i, (finding, adjusted_p))| {
            state(finding, adjusted_p, second_looks.remove(&i), looks, tests)
        })
        .collect();
    Concluded { verdicts, wanted }
}

/// Second looks with p-values adjusted over all of them. One that is still missing counts: the level of
/// the others must not depend on it.
fn second_looks(seconds: BTreeMap<usize, Option<Evidence>>) -> BTreeMap<usize, SecondLook> {
    let p_value = |second: &Option<Evidence>| second.as_ref()?.p_value();
    let p_values: Vec<f64> = seconds.values().map(|second| p_value(second).unwrap_or(1.0)).collect();
    let look = |((index, second), adjusted_p)| {
        let look = match second {
            None => SecondLook::Missing,
            Some(Evidence::Nothing(objection)) => SecondLook::Invalid(objection),
            Some(Evidence::Exact { holds, .. }) => SecondLook::Taken(if holds { 1.0 } else { 0.0 }),
            Some(evidence) if evidence.p_value().is_none() => {
                SecondLook::Invalid("the test has no p-value".into())
            }
            Some(_) => SecondLook::Taken(adjusted_p),
        };
        (index, look)
    };
    seconds.into_iter().zip(holm(&p_values)).map(look).collect()
}

fn state(
    finding: Finding,
    adjusted_p: Option<f64>,
    second: Option<SecondLook>,
    looks: Looks,
    tests: f64,
) -> Verdict {
    let Finding { evidence, relative_to, detect, one_look, mut verdict } = finding;
    // The hardest of Holm's steps, so that `detectable` holds whatever the outcomes of the other tests.
    let own_level = looks.first(one_look) / tests;
    if let Some(test) = evidence.test() {
        verdict.statistic = known(test.statistic);
        (verdict.p_value, verdict.dof) = (known(test.p_value), known(test.dof));
        (verdict.adjusted_p, verdict.detectable) =
            (adjusted_p, evidence.detectable(own_level, relative_to));
    }
    if let Some(SecondLook::Taken(p)) = second {
        verdict.second_p = Some(p);
    }
    let found = match (&evidence, &second) {
        (Evidence::Nothing(objection), _) => Outcome::Invalid(objection.clone()),
        (Evidence::Exact { holds: true, .. }, _) => Outcome::Pass,
        (Evidence::Exact { holds: false, .. }, _) => Outcome::Fail,
        (Evidence::Efficiency(shown), _) => {
            shown.outcome(adjusted_p, looks.at_once(), own_level, detect)
        }
        (_, Some(SecondLook::Missing)) => Outcome::Fail,
        (_, Some(SecondLook::Invalid(objection))) => {
            Outcome::Invalid(format!("second look: {objection}").into())
        }
        (_, Some(SecondLook::Taken(p))) if *p < SECOND_LOOK => Outcome::Fail,
        _ => match adjusted_p {
            None => Outcome::Invalid("the test has no p-value".into()),
            Some(p) if p < looks.at_once() => Outcome::Fail,
            // Without a known detectable size nothing counts as detectable.
            _ if detect.is_some_and(|d| verdict.detectable.is_none_or(|found| found > d)) => {
                Outcome::Underpowered
            }
            _ => Outcome::Pass,
        },
    };
    verdict.passes_factor = match (&found, &evidence) {
        (Outcome::Invalid(objection), _) => objection.passes_factor,
        (Outcome::Underpowered, Evidence::Efficiency(shown)) => shown.passes_factor(own_level, detect),
        // Errors fall with the root of the passes.
        (Outcome::Underpowered, _) => {
            detect.zip(verdict.detectable).map(|(wanted, found)| (found / wanted) * (found / wanted))
        }
        (Outcome::Pass | Outcome::Fail, _) => None,
    };
    let mut reason = match &evidence {
        Evidence::Efficiency(shown) => shown.note(&found, own_level),
        _ => reason(&found, &evidence, detect, &verdict),
    };
    match second {
        Some(SecondLook::Missing) => reason += "; needs a second look on fresh streams",
        Some(SecondLook::Taken(_)) if found == Outcome::Pass => {
            reason = "failed at the first look and cleared by a second on fresh streams".into();
        }
        Some(SecondLook::Taken(_)) => reason += ", at both looks",
        Some(SecondLook::Invalid(_)) | None => {}
    }
    verdict.note = match (reason.is_empty(), verdict.note.is_empty()) {
        (_, true) => reason,
        (true, false) => verdict.note,
        (false, false) => format!("{reason}; {}", verdict.note),
    };
    verdict.outcome = found;
    verdict
}

/// The reason for an outcome.
fn reason(found: &Outcome, evidence: &Evidence, detect: Option<f64>, verdict: &Verdict) -> String {
    match (found, evidence) {
        (Outcome::Invalid(objection), _) => objection.to_string(),
        (Outcome::Pass | Outcome::Fail, Evidence::Exact { said, .. })
        | (Outcome::Fail, Evidence::Counts { said, .. }) => said.clone(),
        (Outcome::Fail, Evidence::Sum(_)) => "the table as a whole deviates".into(),
        (Outcome::Fail, _) => verdict.deviation(),
        (Outcome::Underpowered, _) => {
            // Relative to the expected value, absolute where that is 0; three digits tell 2.04 % from 2 %.
            let shown = |size: f64| match verdict.expected {
                Some(0.0) => significant(size, 3),
                _ => format!("{} %", significant(100.0 * size, 3)),
            };
            let missed = shown(verdict.detectable.unwrap_or(f64::INFINITY));
            format!("could have missed {missed}, {} must be found", shown(detect.unwrap_or_default()))
        }
        (Outcome::Pass, _) => String::new(),
    }
}
