//! The numbers of a verdict, as `judge` reports them, against numbers computed elsewhere; and the
//! p-values of `judge` itself where every claim is true.
//!
//! Numbers to more than three digits are from scipy 1.16 (`ttest_1samp`, `ttest_ind` with
//! `equal_var=False`, `ttest_rel`, `sem`, `norm.sf`, `t.sf`) on the 64 means of four passes of [`A`] and
//! [`B`], whose errors differ by a factor of 4; a stated error e adds to sem^2 as e^2, with sem^4 / 63
//! below dof. `detectable` is the root in d of `nct.sf(t.isf(L/2, dof), dof, d) = 0.99` at L = 1e-6.

use super::super::judge::{Case, Looks, judge, judge_alone};
use super::super::verdict::{Outcome, TestKind, Verdict};
use crate::results::record::{Against, ClaimKind, Comparison, ExpectedOutcome, InvalidReason, Quantity};
use crate::results::sample::{PASSES, claim, quantity, set_observables, stored, with_claim};
use crate::results::store::Stored;
use crate::stats::calibration::NamedRng;
use crate::stats::kolmogorov::uniformity;
use crate::stats::tails::binomial_two_sided;

/// Score of pass i of `mis`.
const A: fn(u64) -> f64 = |i| 2.0 + 0.5 * (((7 * i * i + 3 * i) % 61) as f64 - 30.0) / 30.0;
/// Score of pass i of `snee`.
const B: fn(u64) -> f64 = |i| 2.1 + 0.2 * (((5 * i * i + 11 * i) % 53) as f64 - 26.0) / 26.0;

fn value(value: f64, error: f64) -> Against {
    Against::Value { value, error, source: "by hand".into() }
}

/// The verdict on `mis` with these scores, and `snee` with those.
fn verdict(mis: fn(u64) -> f64, snee: fn(u64) -> f64, against: Against) -> Verdict {
    let kind = match against {
        Against::Value { .. } => ClaimKind::Equals,
        Against::Quantity { .. } | Against::Efficiency { .. } => ClaimKind::Agree,
    };
    let mut s = with_claim(stored(0.1), kind, ExpectedOutcome::Pass, against, None);
    set_observables(&mut s, "mis", |i, _, _| mis(i));
    set_observables(&mut s, "snee", |i, _, _| snee(i));
    judge_alone(&s).remove(0)
}

/// Statistic, p-value, degrees of freedom, and what is detectable.
fn numbers(v: &Verdict, test: TestKind, expected: [f64; 4]) {
    assert_eq!((&v.test, &v.outcome), (&Some(test), &Outcome::Pass), "{v:?}");
    let [statistic, p_value, dof, detectable] = expected;
    let close = |found: Option<f64>, expected: f64, relative: f64| {
        let found = found.unwrap_or(f64::INFINITY);
        assert!(
            found == expected || (found / expected - 1.0).abs() < relative,
            "{found:e} {expected:e} {v:?}"
        );
    };
    close(v.statistic, statistic, 1e-11);
    close(v.p_value, p_value, 1e-9);
    close(v.dof, dof, 1e-11);
    close(v.detectable, detectable, 3e-3);
}

#[test]
fn a_value_is_tested_by_student() {
    let v = verdict(A, B, value(1.96, 0.0));
    numbers(&v, TestKind::T, [2.6397354035257257, 0.010445451363695086, 63.0, 0.10717]);
    assert!((v.std_error.expect("an error") / 0.026300773645951007 - 1.0).abs() < 1e-12);
}

#[test]
fn a_stated_error_adds_to_the_sampling_error() {
    let v = verdict(A, B, value(1.9, 0.03));
    let expected = [3.244071135564234, 0.001297609594696293, 333.5843267260151, 0.15434];
    numbers(&v, TestKind::T, expected);
    assert_eq!(v.expected_error, Some(0.03));
    // Without sampling error it is the whole error, of known size: (2 - 1.9) / 0.03.
    let alone = verdict(|_| 2.0, B, value(1.9, 0.03));
    let expected = [3.3333333333333366, 0.0008581206663936653, f64::INFINITY, 0.11397];
    numbers(&alone, TestKind::StatedError, expected);
}

/// The error of either arm alone would make of 1.72 either 1.77 or 7.47.
#[test]
fn two_means_are_tested_by_welch() {
    let against = || Against::Quantity { other: quantity("snee", 0), paired: false };
    let (t, p, dof) = (-1.7196020290571021, 0.08992224311443954, 70.02482241492369);
    let v = verdict(A, B, against());
    numbers(&v, TestKind::WelchT, [t, p, dof, 0.10287]);
    assert!((v.expected_error.expect("an error") / 0.006219837867909007 - 1.0).abs() < 1e-12);
    let v = verdict(B, A, against());
    numbers(&v, TestKind::WelchT, [-t, p, dof, 0.10287 * 2.0759014423076927 / 2.029427083333333]);
}

#[test]
fn paired_runs_are_tested_by_their_differences() {
    let v = verdict(A, B, Against::Quantity { other: quantity("snee", 0), paired: true });
    numbers(&v, TestKind::PairedT, [-1.7638430756809156, 0.08260672037667015, 63.0, 0.10137]);
}

/// `count` of the 256 passes score 1, evenly spread: |skewness| / 16 is
/// (1 - 2p) / (16 sqrt(p (1 - p))) with p = count / 256, 0.0961 for 50 and 0.1021 for 47.
#[test]
fn skewness_has_the_stated_limit() {
    let ones = |count: u64| {
        let mut s =
            with_claim(stored(0.1), ClaimKind::Equals, ExpectedOutcome::Pass, value(0.19, 0.0), None);
        set_observables(&mut s, "mis", |i, _, _| {
            if (i + 1) * count / PASSES > i * count / PASSES { 1.0 } else { 0.0 }
        });
        judge_alone(&s).remove(0).outcome
    };
    assert_eq!(ones(50), Outcome::Pass);
    assert!(is_heavy(&ones(47)));
    // Where most passes score, the mirrored law.
    assert_eq!(ones(256 - 50), Outcome::Fail);
    assert!(is_heavy(&ones(256 - 47)));
}

/// Batches score +1 and -1 in turns, and one of them x: it holds x^2 / (x^2 + 63) of the variance but
/// for the shift of the mean, half at x = 7.9. Its passes alternate, which removes their skewness.
#[test]
fn one_batch_has_the_stated_limit() {
    let with = |x: f64| {
        let mut s =
            with_claim(stored(0.1), ClaimKind::Equals, ExpectedOutcome::Pass, value(0.0, 0.0), None);
        set_observables(&mut s, "mis", |i, _, _| {
            let batch = if i / 4 == 10 { x } else { 1.0 - 2.0 * ((i / 4) % 2) as f64 };
            batch + 40.0 * (1.0 - 2.0 * (i % 2) as f64)
        });
        judge_alone(&s).remove(0).outcome
    };
    assert_eq!(with(7.6), Outcome::Pass);
    assert!(is_heavy(&with(8.2)));
}

fn is_heavy(found: &Outcome) -> bool {
    matches!(found, Outcome::Invalid(why) if why.reason == Some(InvalidReason::HeavyTail))
}

/// A record on which four claims are true: a value, a published value with an error as large as the
/// sampling error, two independent means, the first with 4 times the other's error, and two means that
/// share most of their noise. Scores are normal.
fn null_record(rng: &mut NamedRng) -> Stored {
    let mut s = stored(0.1);
    let mut scores = || (0..PASSES).map(|_| rng.normal()).collect::<Vec<f64>>();
    let (a, b, shared, own) = (scores(), scores(), scores(), scores());
    set_observables(&mut s, "mis", |i, _, band| match band {
        0 => 1.0 + 0.4 * a[i as usize],
        _ => 1.0 + shared[i as usize],
    });
    set_observables(&mut s, "snee", |i, _, band| match band {
        0 => 1.0 + 0.1 * b[i as usize],
        _ => 1.0 + shared[i as usize] + 0.2 * own[i as usize],
    });
    let error = 0.4 / 16.0;
    let published = 1.0 + error * rng.normal();
    let comparison = |claim, against: Against, band| Comparison {
        claim,
        quantity: Quantity { band, ..quantity("mis", 0) },
        against,
        detect: None,
    };
    let other = |band, paired| Against::Quantity { other: quantity("snee", band), paired };
    s.record.statements = vec![claim("equals", ClaimKind::Equals), claim("agree", ClaimKind::Agree)];
    s.record.comparisons = vec![
        comparison(0, value(1.0, 0.0), 0),
        comparison(0, value(published, error), 0),
        comparison(1, other(0, false), 0),
        comparison(1, other(1, true), 1),
    ];
    s
}

/// Rejections at each level are binomial, and p-values uniform, each at 1e-6 two-sided.
#[test]
fn true_claims_have_uniform_p_values() {
    const RECORDS: u64 = 4000;
    let mut rng = NamedRng::of("true_claims_have_uniform_p_values");
    let mut p_values = vec![Vec::new(); 4];
    for _ in 0..RECORDS {
        let s = null_record(&mut rng);
        let verdicts = judge(&[Case { main: &s, retest: None }], Looks::ALONE).verdicts;
        assert_eq!(verdicts.len(), 4);
        for (list, v) in p_values.iter_mut().zip(&verdicts) {
            list.push(v.p_value.unwrap_or_else(|| panic!("no p-value: {v:?}")));
        }
    }
    for (kind, list) in ["value", "stated error", "welch", "paired"].iter().zip(&p_values) {
        for level in [0.5, 0.1, 0.01, 0.001] {
            let count = list.iter().filter(|p| **p < level).count() as u64;
            let p = binomial_two_sided(count, RECORDS, level);
            assert!(p > 1e-6, "{kind}: {count} of {RECORDS} below {level}, p = {p:.1e}");
        }
        let (_, p) = uniformity(list);
        assert!(p > 1e-6, "{kind}: not uniform, p = {p:.1e}");
    }
}
