//! From comparisons to verdicts: every comparison by itself (`trial`), then all of them as one family
//! (`family`) with at most two looks (`levels`), then the expectations of controls.

use std::collections::BTreeMap;

use super::evidence::Evidence;
use super::family::{Concluded, Finding, conclude};
pub(crate) use super::levels::{FAMILY_LEVEL, Looks};
use super::trial::{Subject, Trial, trial};
use super::verdict::{Outcome, TestKind, Verdict};
use crate::results::record::{Against, ClaimKind, ExpectedOutcome, Quantity};
use crate::results::store::Stored;
use crate::stats::hypothesis::{Test, chi_square_sf, critical_value};

/// A table of more comparisons than this is also tested as a whole.
const TABLE: usize = 10;

/// A record to judge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case<'a> {
    /// Record of the main run.
    pub main: &'a Stored,
    /// Record of the second look, where there was one.
    pub retest: Option<&'a Stored>,
}

/// The result of a verification.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Judgement {
    /// One verdict for each comparison, case by case.
    pub verdicts: Vec<Verdict>,
    /// Number of the case that each verdict is of.
    pub case_of: Vec<usize>,
    /// Cases that need a second look that no record holds yet; their verdicts are `fail` until then.
    pub wanted: Vec<LookAgain>,
}

/// A case that needs a second look.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LookAgain {
    /// Index of the case.
    pub case: usize,
    /// Subjects to measure again.
    pub subject: Measured,
}

/// A subject that can be measured again.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Measured {
    /// A quantity of a scene.
    Quantity(Quantity),
    /// A sampler, by name.
    Sampler(String),
}

/// Judges one record by itself, with one look.
#[cfg(test)]
pub(crate) fn judge_alone(stored: &Stored) -> Vec<Verdict> {
    judge(&[Case { main: stored, retest: None }], Looks::ALONE).verdicts
}

/// Subject of a trial.
#[derive(Clone, Copy)]
struct TrialOf {
    case: usize,
    claim: usize,
    subject: Subject,
}

/// Judges every comparison of every record as one family of tests.
pub(crate) fn judge(cases: &[Case], looks: Looks) -> Judgement {
    let (mut places, mut findings) = (Vec::new(), Vec::new());
    for (case, Case { main, .. }) in cases.iter().enumerate() {
        for Trial { subject, claim, finding } in trials(main) {
            places.push(TrialOf { case, claim, subject });
            findings.push(finding);
        }
    }
    let again = |i: usize, finding: &Finding| {
        second(&cases[places[i].case], places[i].subject, finding.verdict.test.as_ref())
    };
    let Concluded { mut verdicts, wanted } = conclude(findings, looks, again);
    for (verdict, place) in verdicts.iter_mut().zip(&places) {
        expect(verdict, cases[place.case].main, place.claim);
    }
    let subjects = |TrialOf { case, subject, .. }: TrialOf| {
        let subjects = measured_by(cases[case].main, subject).into_iter();
        subjects.map(move |subject| LookAgain { case, subject })
    };
    Judgement {
        verdicts,
        case_of: places.iter().map(|place| place.case).collect(),
        wanted: wanted.into_iter().flat_map(|i| subjects(places[i])).collect(),
    }
}

/// All that the claims of a record state.
fn trials(main: &Stored) -> Vec<Trial> {
    let comparisons = main.record.comparisons.iter().enumerate();
    let own: Vec<Trial> = comparisons.map(|(index, c)| trial(main, index, c)).collect();
    // Cells that an experiment pairs share their streams: their deviations are not independent.
    let paired = !main.record.resolved["pair"].is_null();
    let tables = if paired { vec![] } else { table_trials(main, &own) };
    let reproduced = super::reproduction::trials(main);
    let samplers = main.record.sampler_comparisons.iter().enumerate();
    let samplers = samplers.flat_map(|(index, c)| super::sampler::trials(main, index, c));
    own.into_iter().chain(tables).chain(reproduced).chain(samplers).collect()
}

/// For each column of a table (one estimator, band, observable and class of an `equals` claim), the
/// sum over its cells of z^2 against chi-square: small deviations that agree in no sign, too small for
/// each cell's own test, add up here. Cells have streams of their own, so the terms are independent;
/// bands may share theirs, so they are not summed. z is the normal value with the cell's p-value.
fn table_trials(main: &Stored, trials: &[Trial]) -> Vec<Trial> {
    let mut tables: BTreeMap<_, Vec<&Trial>> = BTreeMap::new();
    for (t, comparison) in trials.iter().zip(&main.record.comparisons) {
        let claim = &main.record.statements[t.claim];
        let is_row = claim.kind == ClaimKind::Equals && claim.expects == ExpectedOutcome::Pass;
        if is_row && matches!(t.finding.evidence, Evidence::Difference { .. }) {
            let Quantity { estimator, observable, band, .. } = &comparison.quantity;
            let key = (t.claim, estimator, &main.record.bands[*band].name, observable);
            tables.entry(key).or_default().push(t);
        }
    }
    tables.into_values().filter(|rows| rows.len() > TABLE).map(|rows| sum_of_squares(&rows)).collect()
}

fn sum_of_squares(rows: &[&Trial]) -> Trial {
    let z = |t: &&Trial| normal_equivalent(&t.finding.evidence);
    let statistic = rows.iter().map(z).map(|z| z * z).sum();
    let dof = rows.len() as f64;
    let test = Test { statistic, dof, p_value: chi_square_sf(statistic, dof) };
    let verdict = Verdict {
        cell: format!("all {} cells", rows.len()),
        test: Some(TestKind::SumOfSquares),
        value: None,
        std_error: None,
        expected: None,
        expected_error: None,
        ..rows[0].finding.verdict.clone()
    };
    let finding = Finding { one_look: true, ..Finding::new(verdict, Evidence::Sum(test)) };
    Trial { subject: Subject::Whole, claim: rows[0].claim, finding }
}

/// The |z| whose normal p-value is the test's; the statistic itself where that p-value underflows.
fn normal_equivalent(evidence: &Evidence) -> f64 {
    match evidence.test() {
        Some(test) if test.p_value > 0.0 => critical_value(test.p_value, f64::INFINITY),
        Some(test) => test.statistic,
        None => 0.0,
    }
}

/// What the same trial shows on the record of the second look, where that holds all it needs.
fn second(case: &Case, subject: Subject, test: Option<&TestKind>) -> Option<Evidence> {
    let retest = case.retest?;
    let is_held = |subject: &Measured| match subject {
        Measured::Quantity(quantity) => retest.batches(quantity).is_some(),
        Measured::Sampler(name) => retest.record.samplers.iter().any(|run| run.sampler == *name),
    };
    let measured = measured_by(case.main, subject);
    if measured.is_empty() || !measured.iter().all(is_held) {
        return None;
    }
    let record = &case.main.record;
    let finding = match subject {
        Subject::Comparison(index) => trial(retest, index, &record.comparisons[index]).finding,
        Subject::Sampler(index) => {
            let trials = super::sampler::trials(retest, index, &record.sampler_comparisons[index]);
            trials.into_iter().find(|t| t.finding.verdict.test.as_ref() == test)?.finding
        }
        Subject::Whole => return None,
    };
    Some(finding.evidence)
}

/// What a second look at a trial has to measure.
fn measured_by(main: &Stored, subject: Subject) -> Vec<Measured> {
    match subject {
        Subject::Comparison(index) => {
            let comparison = &main.record.comparisons[index];
            let other = match &comparison.against {
                Against::Quantity { other, .. } => Some(other.clone()),
                Against::Value { .. } | Against::Efficiency { .. } => None,
            };
            let quantities = std::iter::once(comparison.quantity.clone()).chain(other);
            quantities.map(Measured::Quantity).collect()
        }
        Subject::Sampler(index) => {
            vec![Measured::Sampler(main.record.sampler_comparisons[index].sampler.clone())]
        }
        Subject::Whole => Vec::new(),
    }
}

/// A control is green where it finds what it expects, and a claim made after the run is no evidence.
fn expect(verdict: &mut Verdict, main: &Stored, claim: usize) {
    let found = std::mem::take(&mut verdict.outcome);
    let expects = main.record.statements[claim].expects;
    verdict.outcome = expected_outcome(expects, found, &mut verdict.note);
    if main.record.post_hoc.contains(&claim) {
        let reason = "post hoc: claimed when passes had been run; another seed makes it evidence";
        verdict.note = reason.into();
        verdict.passes_factor = None;
        verdict.outcome = Outcome::Invalid(reason.into());
    }
}

fn expected_outcome(expects: ExpectedOutcome, found: Outcome, note: &mut String) -> Outcome {
    let (wanted, green) = match expects {
        ExpectedOutcome::Pass => return found,
        ExpectedOutcome::Differs => ("a difference".into(), found == Outcome::Fail),
        ExpectedOutcome::Fails => ("a failure".to_string(), found == Outcome::Fail),
        ExpectedOutcome::Invalid(reason) => {
            let is_it = matches!(&found, Outcome::Invalid(why) if why.reason == Some(reason));
            (format!("an invalid test by {}", reason.words()), is_it)
        }
    };
    let said = if note.is_empty() { "no difference found".to_string() } else { std::mem::take(note) };
    *note = format!("control, expects {wanted}: {said}");
    match found {
        _ if green => Outcome::Pass,
        Outcome::Invalid(objection) => Outcome::Invalid(objection),
        _ => Outcome::Fail,
    }
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;
