//! `compare` on artificial records.

use serde_json::json;

use super::*;
use crate::results::sample::{self, set_observables, uniform};
use crate::verify::judge::FAMILY_LEVEL;

const TERMS: Terms = Terms { level: FAMILY_LEVEL, detect: None, max_slowdown: None };

/// A record whose runs have noise 0.5, and a seed.
fn stored() -> Stored {
    let mut stored = sample::stored(0.5);
    stored.record.resolved = json!({"name": "sample", "seed": 1, "budget": {"passes": 256}});
    stored
}

fn compared(a: &Stored, b: &Stored) -> Compared {
    compare(a, b, &TERMS).expect("a comparison")
}

fn outcome(compared: &Compared, estimator: &str) -> (String, Outcome) {
    let v = compared.verdicts.iter().find(|v| v.estimators == estimator).expect("a verdict");
    (v.test_name(), v.outcome.clone())
}

/// The score that `sample` gives a pass of `mis`, and more.
fn score(pass: u64, observable: usize, band: usize) -> f64 {
    1.0 + 0.5 * uniform(pass + 1000 * (2 * observable + band) as u64)
}

#[test]
fn the_same_record_is_identical() {
    let a = stored();
    let same = compared(&a, &a);
    assert_eq!(same.changes, [""; 0]);
    assert_eq!(same.verdicts.len(), 8);
    assert!(same.verdicts.iter().all(|v| v.test == Some(TestKind::Identical) && v.is_green()));
    assert_eq!(same.exit_code(), 0);
    assert!(same.work.iter().all(|w| w.counts["rays"] == 1.0 && w.variance == [1.0, 1.0]));
}

// A shift of 1 % under noise of 50 %: pass by pass it exceeds noise of 1 %, and independent means
// of 256 passes would hide it.
#[test]
fn the_same_streams_are_paired() {
    let a = stored();
    let shifted = |by: f64| {
        let mut b = a.clone();
        let noise = |i, o, band| 0.01 * uniform(900_000 + i + 1000 * (2 * o + band) as u64);
        set_observables(&mut b, "mis", |i, o, band| score(i, o, band) + by + noise(i, o, band));
        b
    };
    let found = compared(&a, &shifted(0.01));
    assert_eq!(outcome(&found, "mis"), ("paired t".into(), Outcome::Fail));
    assert_eq!(outcome(&found, "snee").0, "identical");
    assert_eq!(found.exit_code(), 1);
    assert_eq!(outcome(&compared(&a, &shifted(0.0)), "mis"), ("paired t".into(), Outcome::Pass));

    let mut b = shifted(0.01);
    b.record.resolved["seed"] = json!(2);
    let hidden = compared(&a, &b);
    assert_eq!(outcome(&hidden, "mis"), ("welch t".into(), Outcome::Pass));
    assert_eq!(hidden.changes, ["seed: 1, then 2"]);
    b.record.resolved = a.record.resolved.clone();
    b.record.cells[0].content_hash = "c1".into();
    assert_eq!(outcome(&compared(&a, &b), "mis").0, "welch t", "other physics has other streams");
    b.record.resolved["pair"] = json!({"over": ["boundary"]});
    assert_eq!(outcome(&compared(&a, &b), "mis").0, "sum of errors", "paired cells may share theirs");
}

// The last passes left out: b's mean is nearly a's, and neither paired with it nor independent.
#[test]
fn other_numbers_of_passes_add_their_errors() {
    let a = stored();
    let mut b = a.clone();
    let run = &mut b.record.cells[0].runs[0];
    run.passes = 252;
    let path = run.moments.clone();
    let array = b.arrays.get_mut(&path).expect("moments");
    array.shape[0] -= 1;
    array.data.truncate(array.shape.iter().product());
    // 63 batches are too few for a t test.
    assert!(matches!(outcome(&compared(&a, &b), "mis").1, Outcome::Invalid(_)));
    assert_eq!(compared(&a, &b).exit_code(), 3);

    let mut more = crate::stats::tree::Counter::new(0, 2);
    for i in 0..300 {
        let all = (0..4).map(|k| Moments::of(score(i, k / 2, k % 2)));
        more.push(all.collect::<Vec<_>>());
    }
    let batches = more.batches();
    let data: Vec<f64> = batches.iter().flatten().flat_map(Moments::to_array).collect();
    let array = crate::results::npy::Array::new(vec![batches.len(), 2, 2, 5], data);
    b.arrays.insert(path, array);
    b.record.cells[0].runs[0].passes = 300;
    let found = compared(&a, &b);
    assert_eq!(outcome(&found, "mis"), ("sum of errors".into(), Outcome::Pass));
    let v = &found.verdicts[0];
    let numbers = [v.value, v.std_error, v.expected, v.expected_error, v.statistic, v.dof];
    let [value, std_error, expected, expected_error, t, dof] = numbers.map(|x| x.expect("a number"));
    assert!((t * (std_error + expected_error) / (value - expected) - 1.0).abs() < 1e-12);
    let p = crate::stats::tails::student_two_sided(t, dof);
    assert_eq!(v.p_value, Some((2.0 * p).min(1.0)));
    assert!(
        found.changes.contains(&"smooth: mis: 256 passes, then 300".to_string()),
        "{:?}",
        found.changes
    );
}

#[test]
fn what_only_one_record_has() {
    let a = stored();
    let mut b = a.clone();
    b.record.cells[0].runs[1].estimator = "other".into();
    b.record.bands[1].name = "X".into();
    let found = compared(&a, &b);
    assert_eq!(found.verdicts.len(), 2, "one run, one band, two observables");
    for part in
        ["band `G`: only in the first", "band `X`: only in the second", "estimator `other` in cell"]
    {
        assert!(found.changes.iter().any(|c| c.contains(part)), "{part}: {:?}", found.changes);
    }
    b.record.cells[0].label = "rough".into();
    assert_eq!(compare(&a, &b, &TERMS), None, "nothing in common");
}

#[test]
fn work_and_power_are_gates_where_asked() {
    let a = stored();
    let mut b = a.clone();
    b.record.resolved["seed"] = json!(2);
    set_observables(&mut b, "mis", |i, o, band| score(i + 500_000, o, band));
    b.record.cells[0].runs[0].cost.insert("rays".into(), 1280);
    let with = |detect, max_slowdown| {
        compare(&a, &b, &Terms { detect, max_slowdown, ..TERMS }).expect("a comparison").exit_code()
    };
    assert_eq!((with(None, None), with(None, Some(1.3)), with(None, Some(1.2))), (0, 0, 1));
    // The error of a difference is 0.5 sqrt(2 / 256) = 4.4 %.
    assert_eq!((with(Some(0.9), None), with(Some(0.1), None)), (0, 3));
    b.record.cells[0].runs[0].anomalies.insert("nonfinite".into(), 1);
    assert_eq!(compared(&a, &b).exit_code(), 3, "a score that is not finite is no pass");
}
