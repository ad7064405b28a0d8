//! Rules of `[[claim]]`.

use std::collections::BTreeMap;

use super::{At, ExperimentParts};
use crate::experiment::schema::{
    CONTROL, ClaimEntry, CostMeasure, Equals, EstimatorEntry, Expect, Faster, SamplerClaim,
};
use crate::experiment::suggest;
use crate::experiment::sweep_point::SweepAxis;
use crate::results::counted_work;

/// The names that claims may use.
pub(crate) struct Known<'a> {
    /// What the experiment is made of.
    pub parts: ExperimentParts,
    /// Names that claims may refer to as estimators.
    pub estimators: Vec<&'a str>,
    /// The estimators; none where they could not be read.
    pub entries: Vec<EstimatorEntry>,
    /// Names that claims may refer to as samplers.
    pub samplers: Vec<&'a str>,
    /// Names of bands; none where they could not be read.
    pub bands: Option<Vec<String>>,
    /// The sweep; none where it could not be read.
    pub axes: Option<&'a [SweepAxis]>,
}

/// The rules of one claim.
pub(crate) fn claim(at: At, claim: &ClaimEntry, known: &Known) {
    reason(at, claim);
    if let Some(words) = &claim.sampler {
        return samplers(at.to("sampler"), words, known);
    }
    if !known.parts.scene {
        return at.report_help(
            "the claim is about estimators, and there are none",
            "with samplers alone a claim is `sampler = {}`",
        );
    }
    let equals = claim.equals.as_ref().and_then(|words| Some(("equals", words.band.as_ref()?)));
    let agree = claim.agree.as_ref().and_then(|words| Some(("agree", words.band.as_ref()?)));
    let differs = claim.differs.as_ref().and_then(|words| Some(("differs", words.band.as_ref()?)));
    let lengths = claim.mean_path_length.as_ref();
    let length = lengths.and_then(|words| Some(("mean_path_length", words.band.as_ref()?)));
    for (kind, name) in [equals, agree, differs, length].into_iter().flatten() {
        band(at.to(kind).to("band"), name, known);
    }
    if let Some(equals) = &claim.equals {
        expected(at.to("equals"), equals, known);
    }
    if let Some(words) = lengths {
        let at = at.to("mean_path_length");
        names(at.to("estimators"), words.estimators.as_deref().unwrap_or_default(), known);
        if let Some(axes) = known.axes {
            filter(at, &words.only, axes);
        }
    }
    if let Some(agree) = &claim.agree {
        let (names, across, only) = (&agree.estimators, &agree.across, &agree.only);
        pairs(at.to("agree"), names, across.as_deref(), only, known);
    }
    if let Some(words) = &claim.faster {
        duel(at.to("faster"), words, known);
    }
    if let Some(words) = &claim.not_slower {
        duel(at.to("not_slower"), &words.into(), known);
    }
    if claim.duel().is_some() && claim.expect == Some(Expect::Differs) {
        at.to("expect").report_help(
            "`differs` is about means, and this claim is about efficiency",
            "write `expect = \"fails\"`",
        );
    }
    if (claim.equals.is_some() || claim.agree.is_some()) && claim.expect == Some(Expect::Fails) {
        at.to("expect").report_help(
            "`fails` is about efficiency, and this claim is about means",
            "write `expect = \"differs\"`",
        );
    }
    if let Some(differs) = &claim.differs {
        let (names, across, only) = (&differs.estimators, &differs.across, &differs.only);
        pairs(at.to("differs"), names, across.as_deref(), only, known);
        if claim.expect.is_some() {
            at.to("expect").report("`differs` states what is expected already");
        }
    }
}

/// A control that expects an invalid test of means names the reason, and no other claim does.
fn reason(at: At, claim: &ClaimEntry) {
    let is_of_means = claim.equals.is_some() || claim.agree.is_some();
    match (claim.expect, claim.because) {
        (Some(Expect::Invalid), _) if !is_of_means => at
            .to("expect")
            .report_help("`invalid` is about a test of means", "expect it of `equals` or `agree`"),
        (Some(Expect::Invalid), None) => at.report_help(
            "`expect = \"invalid\"` without the reason: lost rays would satisfy it as well",
            "add `because = \"heavy_tail\"`, or `too_few_passes`, `biased`, `different_models`, \
             `nothing_scored`",
        ),
        (Some(Expect::Differs | Expect::Fails) | None, Some(_)) => at.to("because").report_help(
            "a reason for an invalid test, and none is expected",
            "add `expect = \"invalid\"`, or remove `because`",
        ),
        _ => {}
    }
}

/// The samplers are there, each named once.
fn samplers(at: At, claim: &SamplerClaim, known: &Known) {
    if !known.parts.samplers {
        return at.report_help(
            "the claim is about samplers, and there are none",
            "give `samples` and `[[sampler]]`",
        );
    }
    let names = claim.samplers.as_deref().unwrap_or_default();
    let at = at.to("samplers");
    for (i, name) in names.iter().enumerate() {
        if !known.samplers.contains(&name.as_str()) {
            let help = suggest::help(name, &known.samplers, "samplers");
            at.item(i).report_help(format!("unknown sampler `{name}`"), help);
        } else if names[..i].contains(name) {
            at.item(i).report(format!("`{name}` occurs twice"));
        }
    }
}

/// A candidate and a baseline.
fn duel(at: At, duel: &Faster, known: &Known) {
    estimator(at.to("candidate"), &duel.candidate, known);
    estimator(at.to("baseline"), &duel.baseline, known);
    if duel.candidate == duel.baseline {
        at.to("candidate").report_help(
            format!("`{}` is candidate and baseline", duel.candidate),
            "an estimator is as fast as itself: name two",
        );
    }
    if duel.cost == CostMeasure::Cpu {
        for name in known.estimators.iter().filter(|name| name.ends_with(CONTROL)) {
            at.to("cost").report_help(
                format!("`{name}` is the name of a control: comparing CPU time adds one of that ending"),
                "give the estimator another name",
            );
        }
    }
    if duel.cost == CostMeasure::Counters {
        counted(at, duel, known);
    }
    if let Some(axes) = known.axes {
        filter(at, &duel.only, axes);
    }
}

/// Counted work decides a claim only where it can: a ratio that must not fall below 1 by more than a
/// margin is not shown by a measure that may be off by more.
fn counted(at: At, duel: &Faster, known: &Known) {
    let kind = |name: &str| {
        let entry = known.entries.iter().find(|entry| entry.name == *name)?;
        entry.choice().map(|(kind, _)| kind)
    };
    let Some((a, b)) = kind(&duel.candidate).zip(kind(&duel.baseline)) else { return };
    let help = "let the clock decide: `cost = \"cpu\"`";
    match counted_work::factor(a, b) {
        Err(why) => at.report_help(format!("{why}, so that it decides no claim"), help),
        Ok(factor) if duel.ratio * factor >= 1.0 && duel.ratio < 1.0 => at.report_help(
            format!(
                "the counted work of `{a}` and `{b}` may be off by {factor:.2} times, which is more than the margin of {:.2}",
                1.0 / duel.ratio
            ),
            help,
        ),
        Ok(_) => {}
    }
}

fn expected(at: At, claim: &Equals, known: &Known) {
    if let Some(name) = &claim.estimator {
        estimator(at.to("estimator"), name, known);
    }
    if claim.error.is_some() && claim.value.is_none() {
        at.to("error").report("`error` belongs to `value`, and there is none");
    }
    if claim.error_column.is_some() && claim.column.is_none() {
        at.to("error_column").report("`error_column` belongs to `column`, and there is none");
    }
    if let Some(axes) = known.axes {
        if let Some(name) = &claim.column {
            column(at.to("column"), name, axes, false);
        }
        if let Some(name) = &claim.error_column {
            column(at.to("error_column"), name, axes, true);
        }
        filter(at, &claim.only, axes);
    }
}

fn pairs(
    at: At,
    estimators: &[String],
    across: Option<&str>,
    only: &BTreeMap<String, String>,
    known: &Known,
) {
    names(at.to("estimators"), estimators, known);
    if estimators.len() == 1 && across.is_none() {
        at.to("estimators").report_help(
            "one estimator agrees with itself",
            "name two or more, or the axis `across` which its cells are compared",
        );
    }
    let Some(axes) = known.axes else { return };
    if let Some(name) = across {
        axis(at.to("across"), name, axes);
        if only.contains_key(name) {
            let rule = format!("`{name}` is compared across, `where` cannot fix it");
            at.to("where").to(name).key().report(rule);
        }
    }
    filter(at, only, axes);
}

/// The estimators are there, each named once.
pub(super) fn names(at: At, estimators: &[String], known: &Known) {
    for (i, name) in estimators.iter().enumerate() {
        estimator(at.item(i), name, known);
        if estimators[..i].contains(name) {
            at.item(i).report(format!("`{name}` occurs twice"));
        }
    }
}

/// An estimator of this name is there.
pub(super) fn estimator(at: At, name: &str, known: &Known) {
    if !known.estimators.contains(&name) {
        let help = suggest::help(name, &known.estimators, "estimators");
        at.report_help(format!("unknown estimator `{name}`"), help);
    }
}

/// A band of this name is there.
pub(super) fn band(at: At, name: &str, known: &Known) {
    let Some(bands) = &known.bands else { return };
    if !bands.iter().any(|band| band == name) {
        let names: Vec<&str> = bands.iter().map(String::as_str).collect();
        at.report_help(format!("unknown band `{name}`"), suggest::help(name, &names, "bands"));
    }
}

/// The axis of this name, which is there.
pub(super) fn axis<'a>(at: At, name: &str, axes: &'a [SweepAxis]) -> Option<&'a SweepAxis> {
    let axis = axes.iter().find(|axis| axis.name == name);
    if axis.is_none() {
        let names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
        at.report_help(format!("unknown axis `{name}`"), suggest::help(name, &names, "axes"));
    }
    axis
}

/// The axes and labels of a `where` are there.
pub(super) fn filter(at: At, only: &BTreeMap<String, String>, axes: &[SweepAxis]) {
    for (name, label) in only {
        let at = at.to("where").to(name);
        let Some(axis) = axis(at.key(), name, axes) else { continue };
        let labels: Vec<&str> = axis.points.iter().map(|point| point.label.as_str()).collect();
        if !labels.contains(&label.as_str()) {
            let help = suggest::help(label, &labels, "labels");
            at.report_help(format!("unknown label `{label}` of axis `{name}`"), help);
        }
    }
}

/// A column of expected values: every row of the axis that holds it gives a finite number.
fn column(at: At, name: &str, axes: &[SweepAxis], is_error: bool) {
    let has = |axis: &&SweepAxis| axis.points.iter().any(|point| point.columns.contains_key(name));
    let Some(axis) = axes.iter().find(has) else {
        let columns = axes.iter().flat_map(|axis| &axis.points).flat_map(|point| point.columns.keys());
        let mut columns: Vec<&str> = columns.map(String::as_str).collect();
        columns.sort_unstable();
        columns.dedup();
        let help = suggest::help(name, &columns, "columns");
        return at.report_help(format!("no row of the sweep has a column `{name}`"), help);
    };
    for point in &axis.points {
        let Some(column) = point.columns.get(name) else {
            at.report(format!("row `{}` of axis `{}` has no column `{name}`", point.label, axis.name));
            continue;
        };
        let number = column.text.parse::<f64>().ok().filter(|x| x.is_finite());
        if number.is_none() {
            let rule = format!("column `{name}` must be a number, is `{}`", column.text);
            at.findings.at(&column.place, rule, None);
        } else if is_error && number.is_some_and(|x| x < 0.0) {
            let rule = format!("a standard error must be at least 0, is {}", column.text);
            at.findings.at(&column.place, rule, None);
        }
    }
}
