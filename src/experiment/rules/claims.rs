//! Rules of `[[claim]]`.

use std::collections::BTreeMap;

use super::{At, ExperimentParts};
use crate::experiment::schema::{
    Budget, CONTROL, ClaimEntry, CostMeasure, Equals, Expect, Faster, SamplerClaim,
};
use crate::experiment::suggest;
use crate::experiment::sweep_point::SweepAxis;

/// The names that claims may use.
pub(crate) struct Known<'a> {
    /// What the experiment is made of.
    pub parts: ExperimentParts,
    /// Names that claims may refer to as estimators.
    pub estimators: Vec<&'a str>,
    /// Names that claims may refer to as samplers.
    pub samplers: Vec<&'a str>,
    /// Names of bands; none where they could not be read.
    pub bands: Option<Vec<String>>,
    /// The sweep; none where it could not be read.
    pub axes: Option<&'a [SweepAxis]>,
    /// How much work; none where it could not be read.
    pub budget: Option<Budget>,
}

/// The rules of one claim.
pub(crate) fn claim(at: At, claim: &ClaimEntry, known: &Known) {
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
    for (kind, name) in [equals, agree, differs].into_iter().flatten() {
        band(at.to(kind).to("band"), name, known);
    }
    if let Some(equals) = &claim.equals {
        expected(at.to("equals"), equals, known);
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
    if let Some(differs) = &claim.differs {
        let (names, across, only) = (&differs.estimators, &differs.across, &differs.only);
        pairs(at.to("differs"), names, across.as_deref(), only, known);
        if claim.expect.is_some() {
            at.to("expect").report("`differs` states what is expected already");
        }
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

/// A candidate and a baseline; what is compared by CPU time runs side by side, pass for pass.
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
        if known.budget.as_ref().is_some_and(|budget| !matches!(budget, Budget::Passes(_))) {
            at.to("cost").report_help(
                "CPU time is compared pass for pass, and this budget may give each estimator another number",
                "state `budget.passes`, or compare by `counters`",
            );
        }
        for name in known.estimators.iter().filter(|name| name.ends_with(CONTROL)) {
            at.to("cost").report_help(
                format!("`{name}` is the name of a control: comparing CPU time adds one of that ending"),
                "give the estimator another name",
            );
        }
    }
    if let Some(axes) = known.axes {
        filter(at, &duel.only, axes);
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
    let names = at.to("estimators");
    for (i, name) in estimators.iter().enumerate() {
        estimator(names.item(i), name, known);
        if estimators[..i].contains(name) {
            names.item(i).report(format!("`{name}` occurs twice"));
        }
    }
    if estimators.len() == 1 && across.is_none() {
        names.report_help(
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

fn filter(at: At, only: &BTreeMap<String, String>, axes: &[SweepAxis]) {
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
