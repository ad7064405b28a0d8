//! For every rule: a case that passes, and a planted defect that is caught.

use serde_json::json;

use super::super::verdict::{exit_code, to_csv};
use super::*;
use crate::results::record::{
    Against, ClaimKind, Comparison, ExpectedOutcome, InvalidReason, Quantity, StatedBias, StatedTail,
};
use crate::results::sample::{PASSES, judged, quantity, set_observables, stored, uniform, with_claim};

const INVALID: ExpectedOutcome = ExpectedOutcome::Invalid(InvalidReason::HeavyTail);

fn value(value: f64, error: f64) -> Against {
    Against::Value { value, error, source: "by hand".into() }
}

fn other(paired: bool) -> Against {
    Against::Quantity { other: quantity("snee", 0), paired }
}

fn one(s: &Stored) -> Verdict {
    let mut verdicts = judge_alone(s);
    assert_eq!(verdicts.len(), 1);
    verdicts.remove(0)
}

fn equals(s: Stored, v: f64, error: f64, detect: Option<f64>) -> Verdict {
    one(&with_claim(s, ClaimKind::Equals, ExpectedOutcome::Pass, value(v, error), detect))
}

fn assert_invalid(v: &Verdict, what: &str) {
    assert!(matches!(&v.outcome, Outcome::Invalid(why) if why.said.contains(what)), "{v:?}");
    assert_eq!(exit_code(std::slice::from_ref(v)), 3);
}

#[test]
fn a_mean_equals_its_value_and_not_another() {
    let good = equals(stored(0.1), 1.0, 0.0, None);
    assert_eq!((&good.outcome, &good.test, good.dof), (&Outcome::Pass, &Some(TestKind::T), Some(63.0)));
    // Standard error 0.1 / 16; one test at level 1e-6 sees 8.0 of them.
    assert!((good.detectable.expect("a size") - 8.0 * 0.1 / 16.0).abs() < 0.01, "{good:?}");
    let bad = equals(stored(0.1), 1.06, 0.0, None);
    assert_eq!(bad.outcome, Outcome::Fail);
    assert!(bad.adjusted_p < Some(FAMILY_LEVEL) && bad.statistic < Some(-8.0), "{bad:?}");
    assert!(bad.note.starts_with("off by -5."), "{}", bad.note);
}

#[test]
fn a_claim_made_after_the_run_is_not_green() {
    let mut s = with_claim(stored(0.1), ClaimKind::Equals, ExpectedOutcome::Pass, value(1.0, 0.0), None);
    s.record.post_hoc = vec![0];
    assert_invalid(&one(&s), "post hoc");
    // Nor is a control that expects invalidity.
    let mut s = with_claim(stored(0.1), ClaimKind::Equals, INVALID, value(1.0, 0.0), None);
    s.record.post_hoc = vec![0];
    assert_invalid(&one(&s), "post hoc");
}

#[test]
fn two_zero_means_are_no_agreement() {
    let mut s = with_claim(stored(0.1), ClaimKind::Agree, ExpectedOutcome::Pass, other(false), None);
    set_observables(&mut s, "mis", |_, _, _| 0.0);
    set_observables(&mut s, "snee", |_, _, _| 0.0);
    assert_invalid(&one(&s), "neither side scored anything");
}

#[test]
fn a_stated_error_widens_the_test() {
    let wide = equals(stored(0.1), 1.06, 0.05, None);
    assert_eq!(wide.outcome, Outcome::Pass);
    assert!(wide.dof > Some(1e4), "nearly all the error is known: {wide:?}");
}

#[test]
fn power_is_part_of_a_pass() {
    assert_eq!(equals(stored(0.1), 1.0, 0.0, Some(0.1)).outcome, Outcome::Pass);
    let weak = equals(stored(0.1), 1.0, 0.0, Some(0.01));
    assert_eq!(weak.outcome, Outcome::Underpowered);
    let missed = 100.0 * weak.detectable.expect("a size");
    assert_eq!(weak.note, format!("could have missed {missed:.2} %, 1.00 % must be found"));
    assert_eq!(equals(stored(0.1), 1.06, 0.0, Some(0.01)).outcome, Outcome::Fail);
}

#[test]
fn an_expected_zero_has_an_absolute_detectable() {
    let mut s = stored(0.1);
    set_observables(&mut s, "mis", |i, _, _| 0.1 * uniform(i));
    let v = equals(s, 0.0, 0.0, Some(0.1));
    assert_eq!(v.outcome, Outcome::Pass);
    assert!((v.detectable.expect("a size") - 0.05).abs() < 0.01, "{v:?}");
    let mut s = stored(0.1);
    set_observables(&mut s, "mis", |i, _, _| 0.1 * uniform(i));
    let weak = equals(s, 0.0, 0.0, Some(0.01));
    let missed = weak.detectable.expect("a size");
    assert_eq!(weak.note, format!("could have missed {missed:.4}, 0.0100 must be found"));
}

#[test]
fn no_variance_passes_only_at_the_value() {
    let exact = |x: f64| {
        let mut s = stored(0.1);
        set_observables(&mut s, "mis", |_, _, _| x);
        s
    };
    let good = equals(exact(0.3), 0.3, 0.0, None);
    assert_eq!((good.outcome, good.test), (Outcome::Pass, Some(TestKind::Identity)));
    assert_eq!(equals(exact(0.3), 0.3 * (1.0 + 1e-13), 0.0, None).outcome, Outcome::Pass);
    assert_eq!(equals(exact(0.3), 0.3 * (1.0 + 1e-11), 0.0, None).outcome, Outcome::Fail);
    assert_eq!(equals(exact(0.0), 0.0, 0.0, None).outcome, Outcome::Pass);
    // A published value's own error may explain a deviation, but not that nothing was scored.
    assert_eq!(equals(exact(0.3), 0.3001, 1e-4, None).test, Some(TestKind::StatedError));
    assert_eq!(equals(exact(0.3), 0.3001, 1e-4, None).outcome, Outcome::Pass);
    assert_eq!(equals(exact(0.3), 0.31, 1e-4, None).outcome, Outcome::Fail);
    assert_eq!(equals(exact(0.0), 1e-4, 1e-4, None).outcome, Outcome::Fail);
}

#[test]
fn rounding_noise_is_no_variance() {
    let mut s = stored(0.1);
    set_observables(&mut s, "mis", |i, _, _| 1.0 + 1e-15 * uniform(i));
    assert_eq!(equals(s, 1.0, 0.0, None).test, Some(TestKind::Identity));
}

#[test]
fn estimators_agree_and_differ() {
    let agree = |s: Stored, paired| {
        one(&with_claim(s, ClaimKind::Agree, ExpectedOutcome::Pass, other(paired), Some(0.1)))
    };
    let good = agree(stored(0.1), false);
    assert_eq!((good.outcome, good.test), (Outcome::Pass, Some(TestKind::WelchT)));
    assert_eq!(good.estimators, "mis vs snee");
    // A defect of 2 % that only pairing can see: both have the same noise.
    let mut s = stored(0.1);
    set_observables(&mut s, "mis", |i, _, _| 1.0 + 0.1 * uniform(i));
    set_observables(&mut s, "snee", |i, _, _| 1.02 + 0.1 * uniform(i) + 0.01 * uniform(i + 9999));
    assert_eq!(agree(s.clone(), false).outcome, Outcome::Pass);
    assert_eq!(agree(s, true).outcome, Outcome::Fail);
}

#[test]
fn identical_paired_runs_are_an_identity() {
    let mut s = stored(0.1);
    ["mis", "snee"].iter().for_each(|e| set_observables(&mut s, e, |i, _, _| 1.0 + uniform(i)));
    let v = one(&with_claim(s, ClaimKind::Agree, ExpectedOutcome::Pass, other(true), Some(0.1)));
    assert_eq!((v.outcome, v.test), (Outcome::Pass, Some(TestKind::Identity)));
}

#[test]
fn anomalies_invalidate_and_conventions_do_not() {
    let with = |name: &str, count| {
        let mut s = stored(0.1);
        s.record.cells[0].runs[0].anomalies.insert(name.into(), count);
        equals(s, 1.0, 0.0, None)
    };
    assert_invalid(&with("nonfinite", 1), "`nonfinite`");
    assert_invalid(&with("lost_ray", 3), "`lost_ray`");
    assert_eq!(with("lost_ray", 0).outcome, Outcome::Pass);
    assert_eq!(with("wrong_side", 7).outcome, Outcome::Pass);
}

#[test]
fn what_a_test_cannot_rest_on_is_invalid() {
    let mut nan = stored(0.1);
    set_observables(&mut nan, "mis", |i, _, _| if i == 7 { f64::NAN } else { 1.0 });
    assert_invalid(&equals(nan, 1.0, 0.0, None), "not finite");

    let mut dropped = stored(0.1);
    dropped.record.cells[0].runs[0].passes = PASSES + 4;
    assert_invalid(&equals(dropped, 1.0, 0.0, None), "256 passes of 260");

    let mut few = stored(0.1);
    let path = few.record.cells[0].runs[0].moments.clone();
    let array = few.arrays.get_mut(&path).expect("moments");
    array.shape[0] = 63;
    array.data.truncate(63 * 20);
    few.record.cells[0].runs[0].passes = 252;
    assert_invalid(&equals(few, 1.0, 0.0, None), "too few passes");

    let mut absent =
        with_claim(stored(0.1), ClaimKind::Equals, ExpectedOutcome::Pass, value(1.0, 0.0), None);
    absent.record.comparisons[0].quantity.estimator = "nobody".into();
    assert_invalid(&one(&absent), "does not hold");
}

#[test]
fn heavy_tails_are_invalid() {
    // One pass in 256 scores 256: mean 1, skewness 16, far below its true mean in most runs.
    let mut rare = stored(0.1);
    set_observables(&mut rare, "mis", |i, _, _| if i == 100 { 256.0 } else { 0.0 });
    assert_invalid(&equals(rare, 1.0, 0.0, None), "|skewness|");
    // +10 four times in one batch, -10 once in each of four others: no skewness, but one batch holds
    // 400 of the 500 between batches.
    let mut share = stored(0.1);
    set_observables(&mut share, "mis", |i, _, _| match i {
        100..=103 => 10.0,
        8 | 60 | 140 | 200 => -10.0,
        _ => 0.0,
    });
    assert_invalid(&equals(share, 0.0, 0.0, None), "one batch of mis holds");
}

#[test]
fn a_biased_estimator_agrees_with_nothing() {
    let mut s = stored(0.1);
    s.record.cells[0].runs[1].bias = StatedBias::Biased("diffusion".into());
    let agree = |s: &Stored, expects| {
        one(&with_claim(s.clone(), ClaimKind::Agree, expects, other(false), Some(0.1)))
    };
    assert_invalid(&agree(&s, ExpectedOutcome::Pass), "diffusion");
    assert_eq!(agree(&s, ExpectedOutcome::Invalid(InvalidReason::Biased)).outcome, Outcome::Pass);
    set_observables(&mut s, "snee", |i, _, _| 2.0 + 0.1 * uniform(i));
    assert_eq!(agree(&s, ExpectedOutcome::Differs).outcome, Outcome::Pass);
}

#[test]
fn controls_are_green_when_they_find_what_they_expect() {
    let control =
        |expects, v| one(&with_claim(stored(0.1), ClaimKind::Equals, expects, value(v, 0.0), None));
    assert_eq!(control(ExpectedOutcome::Differs, 1.2).outcome, Outcome::Pass);
    assert_eq!(control(ExpectedOutcome::Differs, 1.0).outcome, Outcome::Fail);
    assert!(control(ExpectedOutcome::Differs, 1.0).note.contains("no difference found"));
    assert_eq!(control(INVALID, 1.0).outcome, Outcome::Fail);
}

/// Every record whose test is void, beside the reason that a control may name, if there is one.
fn void_records() -> Vec<(Stored, Option<InvalidReason>)> {
    let agreeing =
        || with_claim(stored(0.1), ClaimKind::Agree, ExpectedOutcome::Pass, other(false), None);
    let changed = |change: &dyn Fn(&mut Stored)| {
        let mut s = agreeing();
        change(&mut s);
        s
    };
    let cut = |s: &mut Stored| {
        for run in &mut s.record.cells[0].runs {
            let array = s.arrays.get_mut(&run.moments).expect("moments");
            array.shape[0] = 63;
            array.data.truncate(63 * 20);
            run.passes = 252;
        }
    };
    let tail = StatedTail { class: "all".into(), band: 0, reason: "index 1.5".into() };
    vec![
        (
            changed(&|s| set_observables(s, "mis", |i, _, _| if i == 100 { 256.0 } else { 0.0 })),
            Some(InvalidReason::HeavyTail),
        ),
        (
            changed(&|s| s.record.cells[0].runs[1].heavy_tails = vec![tail.clone()]),
            Some(InvalidReason::HeavyTail),
        ),
        (changed(&cut), Some(InvalidReason::TooFewPasses)),
        (
            changed(&|s| s.record.cells[0].runs[1].bias = StatedBias::Biased("diffusion".into())),
            Some(InvalidReason::Biased),
        ),
        (
            changed(&|s| s.record.cells[0].runs[1].model = Some("dipole".into())),
            Some(InvalidReason::DifferentModels),
        ),
        (
            changed(&|s| {
                ["mis", "snee"].iter().for_each(|e| set_observables(s, e, |_, _, _| 0.0));
            }),
            Some(InvalidReason::NothingScored),
        ),
        (changed(&|s| set_observables(s, "mis", |i, _, _| if i == 7 { f64::NAN } else { 1.0 })), None),
        (
            changed(&|s| {
                s.record.cells[0].runs[0].anomalies.insert("lost_ray".into(), 1);
            }),
            None,
        ),
        (changed(&|s| s.record.cells[0].runs[0].passes = PASSES + 4), None),
        (changed(&|s| s.record.comparisons[0].quantity.estimator = "nobody".into()), None),
        (changed(&|s| s.record.post_hoc = vec![0]), None),
    ]
}

#[test]
fn a_control_takes_the_reason_that_it_names_and_no_other() {
    use InvalidReason::{Biased, DifferentModels, HeavyTail, NothingScored, TooFewPasses};
    for (mut void, reason) in void_records() {
        assert_invalid(&one(&void), "");
        for named in [HeavyTail, TooFewPasses, Biased, DifferentModels, NothingScored] {
            void.record.statements[0].expects = ExpectedOutcome::Invalid(named);
            let v = one(&void);
            if reason == Some(named) {
                assert_eq!(v.outcome, Outcome::Pass, "{v:?}");
                let head = format!("control, expects an invalid test by {}: ", named.words());
                assert!(v.note.starts_with(&head), "{v:?}");
            } else {
                assert_invalid(&v, "");
            }
        }
    }
    // A sound test is not what such a control expects.
    let sound = with_claim(stored(0.1), ClaimKind::Equals, INVALID, value(1.0, 0.0), None);
    assert_eq!(one(&sound).outcome, Outcome::Fail);
}

#[test]
fn many_tests_share_one_level() {
    let alone = judge_alone(&judged(&[("a", 1.04)]));
    let many: Vec<(&str, f64)> = std::iter::repeat_n(("a", 1.04), 1000).collect();
    let many = judge_alone(&judged(&many));
    assert_eq!(alone[0].adjusted_p, alone[0].p_value);
    let ratio = many[0].adjusted_p.zip(many[0].p_value).map(|(adjusted, p)| adjusted / p);
    assert!((ratio.expect("p-values") - 1000.0).abs() < 1e-6);
    assert!(many[0].detectable > alone[0].detectable);
    assert_eq!((exit_code(&alone), exit_code(&many)), (1, 0));
}

/// A table: 30 cells, each with its own noise and `off` standard errors away from its value.
fn table(off: f64) -> Stored {
    let mut s = with_claim(stored(0.1), ClaimKind::Equals, ExpectedOutcome::Pass, value(1.0, 0.0), None);
    let (cell, path) = (s.record.cells[0].clone(), s.record.cells[0].runs[0].moments.clone());
    s.record.comparisons.clear();
    for c in 0..30 {
        let mut cell = cell.clone();
        let sign = if c % 2 == 0 { 1.0 } else { -1.0 };
        set_observables(&mut s, "mis", |i, _, _| {
            1.0 + sign * off * 0.1 / 16.0 + 0.1 * uniform(i + 1000 * c)
        });
        let array = s.arrays[&path].clone();
        cell.runs[0].moments = format!("cell{c}");
        s.arrays.insert(format!("cell{c}"), array);
        s.record.cells.push(cell);
        let quantity = Quantity { cell: c as usize + 1, ..quantity("mis", 0) };
        s.record.comparisons.push(Comparison {
            claim: 0,
            quantity,
            against: value(1.0, 0.0),
            detect: None,
        });
    }
    s
}

#[test]
fn a_table_is_also_judged_as_a_whole() {
    let good = judge_alone(&table(0.0));
    assert_eq!(good.len(), 31);
    assert!(good.iter().all(Verdict::is_green));
    assert_eq!((&good[30].test, good[30].dof), (&Some(TestKind::SumOfSquares), Some(30.0)));
    assert_eq!(good[30].cell, "all 30 cells");
    // Three standard errors in every cell, of alternating sign: no cell alone can tell.
    let bad = judge_alone(&table(3.0));
    assert!(bad[..30].iter().all(Verdict::is_green));
    assert_eq!(bad[30].outcome, Outcome::Fail);
    let mut paired = table(3.0);
    paired.record.resolved["pair"] = json!({"over": ["boundary"]});
    assert_eq!(judge_alone(&paired).len(), 30);
}

#[test]
fn csv_has_the_columns_that_others_rely_on() {
    let csv = to_csv(&judge_alone(&judged(&[("a,b", 1.0)])));
    let head = "experiment,cell,band,class,estimators,claim,test,statistic,p_value,adjusted_p,detectable,outcome,";
    assert!(csv.starts_with(head), "{csv}");
    assert!(csv.contains("\nsample,smooth,R,all,mis,\"a,b\",t,"), "{csv}");
}

#[test]
fn exit_codes() {
    assert_eq!(exit_code(&[]), 0);
    assert_eq!(exit_code(&judge_alone(&judged(&[("a", 1.0), ("b", 2.0)]))), 1);
}

/// A record whose mean is `off` standard errors from the claimed value, and one of a second look.
fn two_looks(off: f64, second_off: f64) -> (Stored, Stored) {
    let at = |off: f64, salt: u64| {
        let mut s =
            with_claim(stored(0.1), ClaimKind::Equals, ExpectedOutcome::Pass, value(1.0, 0.0), None);
        set_observables(&mut s, "mis", |i, _, _| 0.1 * uniform(i + salt));
        let now = judge_alone(&s);
        // Moved so that the statistic is exactly `off`.
        let (mean, error) = now[0].value.zip(now[0].std_error).expect("a mean");
        set_observables(&mut s, "mis", |i, _, _| 1.0 - mean + off * error + 0.1 * uniform(i + salt));
        s
    };
    (at(off, 0), at(second_off, 70_000))
}

fn judged_twice(off: f64, second_off: Option<f64>) -> Judgement {
    let (main, retest) = two_looks(off, second_off.unwrap_or(0.0));
    let retest = second_off.map(|_| &retest);
    judge(&[Case { main: &main, retest }], Looks::Two)
}

#[test]
fn a_first_look_between_the_levels_wants_a_second() {
    // t with 63 degrees of freedom: 4.0 has p 1.7e-4, 3.0 has 3.9e-3, 6.5 has 1.4e-8.
    let waiting = judged_twice(4.0, None);
    assert_eq!(waiting.verdicts[0].outcome, Outcome::Fail);
    assert!(waiting.verdicts[0].note.ends_with("needs a second look on fresh streams"));
    assert_eq!(waiting.wanted, [LookAgain { case: 0, subject: Measured::Quantity(quantity("mis", 0)) }]);
    for off in [3.0, 6.5] {
        let at_once = judged_twice(off, None);
        assert!(at_once.wanted.is_empty(), "{off}");
        assert_eq!(at_once.verdicts[0].is_green(), off == 3.0);
    }
    // Alone, a record is judged with one look at 1e-6.
    let (main, _) = two_looks(4.0, 0.0);
    assert!(judge_alone(&main)[0].is_green());
}

#[test]
fn the_second_look_decides() {
    let cleared = judged_twice(4.0, Some(3.0));
    assert_eq!(cleared.verdicts[0].outcome, Outcome::Pass);
    assert!(cleared.verdicts[0].note.contains("cleared by a second"), "{:?}", cleared.verdicts[0]);
    assert!(cleared.wanted.is_empty());
    let confirmed = judged_twice(4.0, Some(4.0));
    assert_eq!(confirmed.verdicts[0].outcome, Outcome::Fail);
    assert!(confirmed.verdicts[0].second_p.is_some_and(|p| p < 5e-4));
    assert!(confirmed.verdicts[0].note.ends_with("at both looks"));
    // What needed no second look does not listen to one.
    assert!(judged_twice(3.0, Some(9.0)).verdicts[0].is_green());
    assert!(!judged_twice(6.5, Some(0.0)).verdicts[0].is_green());
}

#[test]
fn a_second_look_that_means_nothing_clears_nothing() {
    let (main, mut retest) = two_looks(4.0, 0.0);
    retest.record.cells[0].runs[0].anomalies.insert("nonfinite".into(), 1);
    let judgement = judge(&[Case { main: &main, retest: Some(&retest) }], Looks::Two);
    assert_invalid(&judgement.verdicts[0], "second look: mis counted 1 of `nonfinite`");
    retest.record.cells[0].runs.clear();
    let judgement = judge(&[Case { main: &main, retest: Some(&retest) }], Looks::Two);
    assert_eq!((judgement.verdicts[0].is_green(), judgement.wanted.len()), (false, 1));
}

#[test]
fn shared_errors_and_controls_have_one_look() {
    let claim = |error: f64, expects| {
        let (mut main, retest) = two_looks(4.0, 0.0);
        main.record.statements[0].expects = expects;
        main.record.comparisons[0].against = value(1.0, error);
        judge(&[Case { main: &main, retest: Some(&retest) }], Looks::Two).verdicts.remove(0)
    };
    let error = 0.1 / 16.0;
    assert!(claim(0.01 * error, ExpectedOutcome::Pass).note.contains("cleared"));
    let shared = claim(0.03 * error, ExpectedOutcome::Pass);
    assert!(shared.is_green() && shared.note.is_empty(), "{shared:?}");
    assert!(shared.detectable > claim(0.01 * error, ExpectedOutcome::Pass).detectable);
    assert_eq!(claim(0.0, ExpectedOutcome::Differs).outcome, Outcome::Fail);
}
