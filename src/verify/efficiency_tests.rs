//! For every rule of claims of efficiency: a case that passes, and a planted defect that is caught.

use super::super::judge::judge_alone;
use super::super::verdict::Outcome;
use super::*;
use crate::results::record::{
    Against, Claim, ClaimKind, Comparison, ExpectedOutcome, Observable, StatedBias,
};
use crate::results::sample::{
    PASSES, claim, pairs, quantity, set_observables, set_spread, stored, uniform,
};
use crate::results::store::observables_path;
use crate::results::timing::{Batches, Timing};

const BATCHES: usize = 64;

/// Both estimators score 1 with this standard deviation, on numbers of their own.
fn scored(mis: f64, snee: f64) -> Stored {
    let mut s = stored(0.1);
    set_observables(&mut s, "mis", |i, o, b| 1.0 + mis * uniform(i + (1000 * (2 * o + b)) as u64));
    set_observables(&mut s, "snee", |i, o, b| {
        1.0 + snee * uniform(i + (9000 + 1000 * (2 * o + b)) as u64)
    });
    s
}

/// A claim that `snee` is more than `bound` times as efficient as `mis`, judged.
fn claimed(mut s: Stored, bound: f64, cost: CostMeasure, expects: ExpectedOutcome) -> Verdict {
    s.record.statements = vec![Claim { expects, ..claim("c", ClaimKind::Faster) }];
    let against = Against::Efficiency { baseline: quantity("mis", 0), exceeds: bound, cost };
    s.record.comparisons =
        vec![Comparison { claim: 0, quantity: quantity("snee", 0), against, detect: None }];
    let mut verdicts = judge_alone(&s);
    assert_eq!(verdicts.len(), 1);
    verdicts.remove(0)
}

fn by_counters(s: Stored, bound: f64) -> Verdict {
    claimed(s, bound, CostMeasure::Counters, ExpectedOutcome::Pass)
}

#[track_caller]
fn assert_invalid(v: &Verdict, what: &str) {
    assert!(matches!(&v.outcome, Outcome::Invalid(why) if why.said.contains(what)), "{v:?}");
}

/// `snee` has a quarter of the variance, at equal counts: the ratio is 4.
#[test]
fn a_claim_of_speed_has_three_outcomes() {
    let pass = by_counters(scored(0.1, 0.05), 1.5);
    assert_eq!(pass.outcome, Outcome::Pass, "{pass:?}");
    assert!(
        (pass.value.expect("a ratio") / 4.0 - 1.0).abs() < 0.2 && pass.note.contains("kurtosis 1."),
        "{pass:?}"
    );
    assert!(pass.detectable > Some(0.0) && pass.detectable < Some(1.0), "{pass:?}");
    let open = by_counters(scored(0.1, 0.05), 4.0);
    assert_eq!(open.outcome, Outcome::Underpowered, "{open:?}");
    assert!(open.note.starts_with("not shown to exceed 4.000"), "{}", open.note);
    let fail = by_counters(scored(0.1, 0.05), 20.0);
    assert_eq!(fail.outcome, Outcome::Fail, "{fail:?}");
    assert!(fail.statistic < Some(-5.0) && fail.p_value < Some(1e-6), "{fail:?}");
}

#[test]
fn controls_expect_failure_of_the_efficiency_alone() {
    let fails = |s| claimed(s, 20.0, CostMeasure::Counters, ExpectedOutcome::Fails);
    assert_eq!(fails(scored(0.1, 0.05)).outcome, Outcome::Pass);
    assert_eq!(
        claimed(scored(0.1, 0.05), 1.5, CostMeasure::Counters, ExpectedOutcome::Fails).outcome,
        Outcome::Fail
    );
    let mut differing = scored(0.1, 0.05);
    set_observables(&mut differing, "snee", |i, _, _| 1.2 + 0.05 * uniform(i + 9000));
    // With a smaller bound, the means speak louder than the efficiency.
    assert_invalid(
        &claimed(differing, 4.0, CostMeasure::Counters, ExpectedOutcome::Fails),
        "the means differ by +",
    );
}

#[test]
fn energy_that_is_missing_is_no_efficiency() {
    let mut s = scored(0.1, 0.05);
    set_observables(&mut s, "snee", |i, _, _| 0.9 + 0.05 * uniform(i + 9000));
    let v = by_counters(s, 1.5);
    assert_eq!(v.outcome, Outcome::Fail);
    assert!(v.note.starts_with("the means differ by -10"), "{}", v.note);
}

#[test]
fn what_an_efficiency_cannot_rest_on_is_invalid() {
    let mut biased = scored(0.1, 0.05);
    biased.record.cells[0].runs[1].bias = StatedBias::Biased("a cut".into());
    assert_invalid(&by_counters(biased, 1.5), "no mean test: snee is biased");

    let mut exact = scored(0.1, 0.05);
    set_observables(&mut exact, "snee", |_, _, _| 1.0);
    assert_invalid(&by_counters(exact, 1.5), "zero variance");

    let mut anomalous = scored(0.1, 0.05);
    anomalous.record.cells[0].runs[1].anomalies.insert("nonfinite".into(), 1);
    assert_invalid(&by_counters(anomalous, 1.5), "no mean test: snee counted 1");

    let mut absent = scored(0.1, 0.05);
    absent.record.cells[0].runs.remove(0);
    assert_invalid(&by_counters(absent, 1.5), "does not hold this quantity");

    let mut uncounted = scored(0.1, 0.05);
    let path = uncounted.record.cells[0].runs[0].costs.clone();
    uncounted.arrays.remove(&path);
    assert_invalid(&by_counters(uncounted, 1.5), "no counts of work by batch");
}

/// A symmetric tail, so that the mean test has no objection: four passes of 256 make the variance.
#[test]
fn a_variance_that_few_passes_make_is_not_resolved() {
    let mut s = scored(0.1, 0.05);
    set_observables(&mut s, "snee", |i, _, _| match (i % 64, (i / 64) % 2) {
        (5, 0) => 4.0,
        (5, _) => -2.0,
        _ => 1.0 + 0.05 * uniform(i + 9000),
    });
    assert_invalid(&by_counters(s, 0.001), "not resolved");
}

/// Counters doubled halve the efficiency: a planted defect that the claim sees.
#[test]
fn doubled_counters_turn_the_claim_red() {
    let mut s = scored(0.1, 0.05);
    let path = s.record.cells[0].runs[1].costs.clone();
    s.arrays.get_mut(&path).expect("costs").data.iter_mut().for_each(|n| *n *= 2.0);
    let v = by_counters(s, 2.5);
    assert!((v.value.expect("a ratio") / 2.0 - 1.0).abs() < 0.2, "{v:?}");
    assert_ne!(v.outcome, Outcome::Pass);
    assert_eq!(by_counters(scored(0.1, 0.05), 2.5).outcome, Outcome::Pass);
}

/// CPU seconds of a batch, by estimator and batch; the control is `mis (control)`.
fn timed(mut s: Stored, seconds: impl Fn(&str, usize) -> f64) -> Stored {
    let mut control = s.record.cells[0].runs[0].clone();
    control.estimator = "mis (control)".into();
    control.control_of = Some("mis".into());
    control.moments = observables_path(0, 2);
    s.record.cells[0].runs.push(control);
    set_observables(&mut s, "mis (control)", |i, o, b| {
        1.0 + 0.1 * uniform(i + (50_000 + 1000 * (2 * o + b)) as u64)
    });
    let mut timing = Timing::default();
    for name in ["mis", "snee", "mis (control)"] {
        let batches = Batches {
            processes: 1,
            cpu_seconds: (0..BATCHES).map(|batch| seconds(name, batch)).collect(),
            // The first quadruple warms up.
            settled: (0..BATCHES).map(|batch| batch > 1).collect(),
            twice: (0..BATCHES).map(|batch| again(name, batch, &seconds)).collect(),
        };
        timing.set_batches("smooth", name, batches);
    }
    s.timing = Some(timing);
    s
}

/// In every eighth batch of `mis` its passes ran a second time, 0.1 % slower.
fn again(name: &str, batch: usize, seconds: &impl Fn(&str, usize) -> f64) -> [f64; 2] {
    if name != "mis" || batch % 8 != 7 {
        return [0.0; 2];
    }
    [1.0, 1.001].map(|factor| factor * seconds(name, batch))
}

/// Noise of 2 % on top of 1 s.
fn noisy(name: &str, batch: usize) -> f64 {
    1.0 + 0.02 * uniform((1000 * name.len() + batch) as u64)
}

fn by_cpu(s: Stored, bound: f64) -> Verdict {
    claimed(s, bound, CostMeasure::Cpu, ExpectedOutcome::Pass)
}

#[test]
fn cpu_time_counts_where_the_machine_is_quiet() {
    let quiet = timed(scored(0.1, 0.05), noisy);
    assert_eq!(by_cpu(quiet, 1.5).outcome, Outcome::Pass);
    // Warm-up does not count, whatever it took.
    let cold = timed(scored(0.1, 0.05), |name, batch| if batch < 2 { 50.0 } else { noisy(name, batch) });
    assert_eq!(by_cpu(cold, 1.5).outcome, Outcome::Pass);
    // Twice the time is half of the efficiency.
    let slow = timed(scored(0.1, 0.05), |name, batch| {
        noisy(name, batch) * if name == "snee" { 2.0 } else { 1.0 }
    });
    let v = by_cpu(slow, 1.5);
    assert!((v.value.expect("a ratio") / 2.0 - 1.0).abs() < 0.2, "{v:?}");
}

/// The timer also counts the time of the arm before: half of the control follows another arm, and differs.
#[test]
fn a_timer_that_counts_another_arms_time_is_found() {
    let cost = |name: &str| if name == "snee" { 0.3 } else { 1.0 };
    let leaking = timed(scored(0.1, 0.05), |name, batch| {
        // A C B, B C A: before the control comes `mis` or `snee`, before `mis` itself or the control.
        let after_mis = if name == "mis (control)" { 0.5 } else { 1.0 };
        let before = after_mis * cost("mis") + (1.0 - after_mis) * cost("snee");
        cost(name) * noisy(name, batch) + before
    });
    assert_invalid(&by_cpu(leaking, 1.5), "machine too noisy");
}

/// A control arm that took 2 % longer is no reason to drop a ratio of 4: the interval contains it.
#[test]
fn what_a_control_arm_shows_is_in_the_interval() {
    let by = |factor: f64| {
        let cost = move |name: &str| if name == "mis (control)" { factor } else { 1.0 };
        by_cpu(timed(scored(0.1, 0.05), |name, batch| cost(name) * noisy(name, batch)), 1.5)
    };
    let [even, off] = [by(1.0), by(1.02)];
    assert!(even.outcome == Outcome::Pass && off.outcome == Outcome::Pass, "{even:?} {off:?}");
    let error = |v: &Verdict| v.std_error.expect("an error") / v.value.expect("a ratio");
    assert!(error(&off).powi(2) > error(&even).powi(2) + 0.015_f64.powi(2), "{even:?} {off:?}");
    assert_invalid(&by(1.2), "machine too noisy");
}

/// The times of an arm.
fn batches_of<'a>(s: &'a mut Stored, name: &str) -> &'a mut Batches {
    let timing = s.timing.as_mut().expect("a timing");
    timing.batches.get_mut("smooth").expect("a cell").get_mut(name).expect("an arm")
}

/// Replaces the times of the passes that ran twice.
fn set_control(s: &mut Stored, twice: [f64; 2]) {
    batches_of(s, "mis").twice = vec![twice; BATCHES];
}

/// The same work took 1.3 times as long at another place: a ratio of 4 says nothing any more, and neither
/// passes nor fails. At 1.01 it still does.
#[test]
fn what_the_control_shows_is_in_the_interval() {
    for (again, bound, outcome) in [
        (1.01, 1.5, Outcome::Pass),
        (1.01, 20.0, Outcome::Fail),
        (1.3, 1.5, Outcome::Underpowered),
        (1.3, 20.0, Outcome::Underpowered),
    ] {
        let mut s = timed(scored(0.1, 0.05), noisy);
        set_control(&mut s, [1.0, again]);
        let v = by_cpu(s, bound);
        assert_eq!(v.outcome, outcome, "{again}: {v:?}");
    }
}

/// `snee` takes 1/3 of the time in the second half: not resolved, unless the control shows that the machine
/// does such things; then the interval says that nothing is known. A variance that grows 16 times in the second
/// half is not resolved, whatever the control shows.
#[test]
fn a_ratio_that_moves_with_the_machine_is_within_the_control() {
    let moved = |name: &str, batch: usize| {
        noisy(name, batch) * if name == "snee" && batch >= BATCHES / 2 { 1.0 / 3.0 } else { 1.0 }
    };
    for again in [1.001, 1.3] {
        let mut s = timed(scored(0.1, 0.05), moved);
        set_control(&mut s, [1.0, again]);
        let v = by_cpu(s, 1.5);
        match again > 1.1 {
            true => assert_eq!(v.outcome, Outcome::Underpowered, "{v:?}"),
            false => assert_invalid(&v, "not resolved"),
        }
        let mut s = timed(scored(0.1, 0.05), noisy);
        set_observables(&mut s, "snee", |i, _, _| {
            1.0 + if i < PASSES / 2 { 0.0125 } else { 0.05 } * uniform(i + 9000).signum()
        });
        set_control(&mut s, [1.0, again]);
        assert_invalid(&by_cpu(s, 1.5), "not resolved");
    }
}

/// Between kinds counted work may be off by a factor: a claim within it is not shown, beyond it is.
#[test]
fn counted_work_decides_beyond_its_own_error_only() {
    let mut s = scored(0.1, 0.05);
    assert_eq!(by_counters(s.clone(), 2.0).outcome, Outcome::Pass);
    s.record.cells[0].runs[1].kind = "snee".into();
    let v = by_counters(s.clone(), 2.0);
    assert_eq!(v.outcome, Outcome::Underpowered, "{v:?}");
    assert!(v.note.contains("counted work may be off by"), "{}", v.note);
    assert_eq!(by_counters(s.clone(), 0.5).outcome, Outcome::Pass);
    assert_ne!(by_counters(s.clone(), 6.0).outcome, Outcome::Fail);
    s.record.cells[0].runs[1].kind = "ballistic".into();
    assert_invalid(&by_counters(s, 2.0), "never been compared with CPU time");
}

/// Arms of 256 and 200 passes, 64 batches of 4 and 100 of 2: 32 parts of each, that of a cold batch
/// left out.
#[test]
fn arms_of_different_lengths_have_the_same_parts() {
    let arm = |count: usize, n: u64| CostedBatches {
        batches: vec![Moments { n, ..Moments::default() }; count],
        costs: (0..count).map(|i| i as f64).collect(),
        settled: (0..count).map(|i| i > 0).collect(),
    };
    let (a, b) = parts(&arm(64, 4), &arm(100, 2));
    assert_eq!((a.len(), b.len()), (31, 31));
    assert_eq!((a[0].moments.n, a[0].cost), (8, 2.0 + 3.0));
    // Batches 4 to 6 of 100 begin in [1/32, 2/32) of the run.
    assert_eq!((b[0].moments.n, b[0].cost), (6, 4.0 + 5.0 + 6.0));
    let passes: u64 = b.iter().map(|block| block.moments.n).sum();
    assert_eq!(passes, 200 - 8);
    assert!(parts(&arm(1, 1), &arm(1, 1)).0.is_empty());
    // A second of CPU time for each pass of both: controls are compared by the pass.
    let even = |count: usize, n: u64| CostedBatches { costs: vec![n as f64; count], ..arm(count, n) };
    let (a, b) = parts(&even(64, 4), &even(100, 2));
    assert_eq!(ratio_log(per_pass(&a), per_pass(&b)), Some(0.0));
    assert_eq!(ratio_log(per_pass(&[]), 1.0), None);
}

#[test]
fn cpu_time_needs_its_conditions() {
    let mut without = timed(scored(0.1, 0.05), noisy);
    without.record.cells[0].runs.pop();
    assert_invalid(&by_cpu(without, 1.5), "no control: mis was not run twice");

    let mut apart = timed(scored(0.1, 0.05), noisy);
    batches_of(&mut apart, "snee").settled = vec![false; BATCHES];
    assert_invalid(&by_cpu(apart, 1.5), "not interleaved");

    // Neither did passes run twice, nor was the control arm interleaved.
    let mut uncontrolled = timed(scored(0.1, 0.05), noisy);
    set_control(&mut uncontrolled, [0.0; 2]);
    assert_eq!(by_cpu(uncontrolled.clone(), 1.5).outcome, Outcome::Pass);
    batches_of(&mut uncontrolled, "mis (control)").settled = vec![false; BATCHES];
    assert_invalid(&by_cpu(uncontrolled, 1.5), "not interleaved");

    assert_invalid(&by_cpu(scored(0.1, 0.05), 1.5), "no CPU time");

    let zero = timed(scored(0.1, 0.05), |_, _| 0.0);
    assert_invalid(&by_cpu(zero, 1.5), "not finite, or a cost is not positive");
}

/// A claim about the pixels that `snee` is more than `bound` times as efficient, judged.
fn of_pixels(mut s: Stored, bound: f64) -> Verdict {
    let pixels = |name| Quantity { observable: Observable::pixels(), ..quantity(name, 0) };
    s.record.statements = vec![claim("c", ClaimKind::Faster)];
    let (baseline, cost) = (pixels("mis"), CostMeasure::Counters);
    let against = Against::Efficiency { baseline, exceeds: bound, cost };
    s.record.comparisons =
        vec![Comparison { claim: 0, quantity: pixels("snee"), against, detect: None }];
    judge_alone(&s).remove(0)
}

/// The images' means know nothing of it: only the pixels of `snee` vary less, by 9.
#[test]
fn pixels_have_an_efficiency_of_their_own() {
    let mut s = scored(0.1, 0.1);
    set_spread(&mut s, "mis", pairs(0.3, 0));
    set_spread(&mut s, "snee", pairs(0.1, 5_000_000));
    let pass = of_pixels(s.clone(), 3.0);
    assert_eq!((&pass.outcome, pass.observable.as_str()), (&Outcome::Pass, "pixels"), "{pass:?}");
    assert!((pass.value.expect("a ratio") / 9.0).ln().abs() < 0.15, "{pass:?}");
    let fail = of_pixels(s.clone(), 60.0);
    assert_eq!(fail.outcome, Outcome::Fail, "{fail:?}");
    assert_eq!(by_counters(s.clone(), 3.0).outcome, Outcome::Fail, "the images' means are even");
    // One pair of passes with a bright pixel makes half of a variance.
    let mut loud = s.clone();
    set_spread(&mut loud, "mis", |i, _| if i == 77 { 64.0 } else { 0.5 });
    assert_invalid(&of_pixels(loud, 3.0), "not resolved");
    // The means must agree all the same.
    set_observables(&mut s, "snee", |i, _, _| 1.2 + 0.1 * uniform(i + 9000));
    let differ = of_pixels(s, 3.0);
    assert_eq!(differ.outcome, Outcome::Fail);
    assert!(differ.note.contains("the means differ"), "{differ:?}");
}

/// What pairs cost is what their passes do, in batches of one pass and of several.
#[test]
fn pairs_have_the_cost_of_their_passes() {
    let passes = |n: &[u64]| n.iter().map(|&n| Moments { n, ..Moments::default() }).collect::<Vec<_>>();
    let side = |batches: &[u64], pairs: &[u64], costs: &[f64]| {
        let settled: Vec<bool> = (0..costs.len()).map(|i| i != 1).collect();
        CostedBatches::of_pairs(&passes(batches), &passes(pairs), costs, &settled)
    };
    let four = side(&[4, 4, 3], &[2, 2, 1], &[8.0, 12.0, 9.0]).expect("pairs");
    assert_eq!((four.costs, four.settled), (vec![4.0, 6.0, 3.0], vec![true, false, true]));
    let one = side(&[1; 5], &[1; 2], &[1.0, 2.0, 3.0, 4.0, 5.0]).expect("pairs");
    assert_eq!((one.costs, one.settled), (vec![1.5, 3.5], vec![false, true]));
    // A last pass alone; two passes that are in no pair.
    assert!(side(&[4, 1], &[2], &[1.0, 1.0]).is_some());
    assert!(side(&[4, 4], &[2], &[1.0, 1.0]).is_none());
    assert!(side(&[4, 4], &[2, 1], &[1.0, 1.0]).is_none());
}
