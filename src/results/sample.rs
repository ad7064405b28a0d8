//! A small artificial record for tests of the evidence side.

use std::collections::BTreeMap;

use serde_json::json;

use super::npy::Array;
use super::record::*;
use super::store::{Arrays, Stored, costs_path, observables_path, pixels_path, spread_path};
use crate::stats::moments::Moments;
use crate::stats::tree::{Counter, batch_level};

/// Number of passes of every run.
pub const PASSES: u64 = 256;

/// Two estimators, `mis` and `snee`, two bands, one cell, observables `mean` of all classes and of
/// `single`, and an image of 3 x 2 pixels. A score of pass i has mean 1 and standard deviation `noise`.
pub fn stored(noise: f64) -> Stored {
    let mut arrays = Arrays::new();
    let runs =
        ["mis", "snee"].iter().enumerate().map(|(e, name)| run(e, name, noise, &mut arrays)).collect();
    let band = |name: &str, rgb| Band { name: name.into(), range_nm: None, display_rgb: rgb };
    let cell = Cell {
        label: "smooth".into(),
        axes: BTreeMap::from([("boundary".into(), "smooth".into())]),
        content_hash: "c0".into(),
        regions: vec![ObservedRegion { name: "mean".into(), tile: None }],
        runs,
    };
    let record = Record {
        schema_version: SCHEMA_VERSION,
        experiment: "sample".into(),
        stage: "main".into(),
        fingerprint: "numerical-1".into(),
        experiment_hash: "e0".into(),
        resolved: json!({"display": {"exposure_stops": 0.0}, "name": "sample"}),
        claims_hash: "a0".into(),
        claims: json!([]),
        statements: vec![],
        post_hoc: vec![],
        comparisons: vec![],
        sampler_comparisons: vec![],
        replays: vec![],
        bands: vec![band("R", [1.0, 0.0, 0.0]), band("G", [0.0, 1.0, 0.0])],
        cells: vec![cell],
        samplers: vec![],
        checksums: BTreeMap::new(),
    };
    Stored { record, arrays, timing: None, has_foreign_timing: false }
}

/// Band `band` of the observable `mean` of all classes of an estimator.
pub fn quantity(estimator: &str, band: usize) -> Quantity {
    let observable = Observable { name: "mean".into(), class: "all".into() };
    Quantity { cell: 0, estimator: estimator.into(), observable, band }
}

/// Replaces an estimator's moments by `score(pass, observable, band)`.
pub fn set_observables(stored: &mut Stored, estimator: &str, score: impl Fn(u64, usize, usize) -> f64) {
    let path = observables_path(0, index_of(stored, estimator));
    stored.arrays.insert(path, moments(PASSES, score));
}

/// What pairs of passes show of 16 pixels whose standard deviation is `noise`: see [`Image::spread`].
pub fn pairs(noise: f64, first: u64) -> impl Fn(u64, usize) -> f64 {
    move |pair, band| {
        let score = |i: u64| noise * uniform(first + 32 * pair + i + 100_000 * band as u64);
        let squares =
            (0..16).map(|i| (score(2 * i) - score(2 * i + 1)) * (score(2 * i) - score(2 * i + 1)));
        0.5 * squares.sum::<f64>() / 16.0
    }
}

/// Replaces the spread of an estimator's pixels by `spread(pair, band)`.
pub fn set_spread(stored: &mut Stored, estimator: &str, spread: impl Fn(u64, usize) -> f64) {
    let run = index_of(stored, estimator);
    set_spread_of(&mut stored.arrays, run, spread);
}

/// The index of an estimator's run.
fn index_of(stored: &Stored, estimator: &str) -> usize {
    let mut runs = stored.record.cells[0].runs.iter();
    runs.position(|run| run.estimator == estimator).expect("a run of that name")
}

fn set_spread_of(arrays: &mut Arrays, run: usize, spread: impl Fn(u64, usize) -> f64) {
    let mut tree = Counter::new(0, batch_level(PASSES) - 1);
    (0..PASSES / 2).for_each(|i| tree.push([0, 1].map(|b| Moments::of(spread(i, b))).to_vec()));
    let batches = tree.batches();
    let data = batches.iter().flatten().flat_map(Moments::to_array).collect();
    arrays.insert(spread_path(0, run), Array::new(vec![batches.len(), 2, 5], data));
}

fn moments(passes: u64, score: impl Fn(u64, usize, usize) -> f64) -> Array {
    let mut tree = Counter::new(0, batch_level(passes));
    let pass = |i| (0..4).map(|k| Moments::of(score(i, k / 2, k % 2))).collect::<Vec<_>>();
    (0..passes).for_each(|i| tree.push(pass(i)));
    let batches = tree.batches();
    let data = batches.iter().flatten().flat_map(Moments::to_array).collect();
    Array::new(vec![batches.len(), 2, 2, 5], data)
}

fn run(e: usize, name: &str, noise: f64, arrays: &mut Arrays) -> EstimatorRun {
    let score = |i, o: usize, b: usize| 1.0 + noise * uniform(i + 1000 * (4 * e + 2 * o + b) as u64);
    arrays.insert(observables_path(0, e), moments(PASSES, score));
    let pixels = (0..24).map(|i| if i < 12 { 0.1 * i as f64 } else { 0.01 }).collect();
    arrays.insert(pixels_path(0, e), Array::new(vec![2, 2, 3, 2], pixels));
    set_spread_of(arrays, e, pairs(noise, 1_000_000 * e as u64));
    let costs = (0..PASSES / 4).map(|_| 16.0).collect(); // batches of 4 passes, 4 rays each
    arrays.insert(costs_path(0, e), Array::new(vec![PASSES as usize / 4, 1], costs));
    let observable = |class: &str| Observable { name: "mean".into(), class: class.into() };
    EstimatorRun {
        estimator: name.into(),
        control_of: None,
        kind: "path".into(),
        bias: StatedBias::Unbiased,
        model: None,
        heavy_tails: vec![],
        notes: vec![],
        passes: PASSES,
        observables: vec![observable("all"), observable("single")],
        moments: observables_path(0, e),
        costs: costs_path(0, e),
        guide: None,
        image: Some(Image { width: 3, height: 2, pixels: pixels_path(0, e), spread: spread_path(0, e) }),
        cost: BTreeMap::from([("rays".into(), 1024)]),
        anomalies: BTreeMap::new(),
    }
}

/// Uniform with mean 0 and variance 1, hashed from `i` (the finaliser of splitmix64).
pub fn uniform(i: u64) -> f64 {
    let mut z = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let u = ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64;
    (u - 0.5) * 12f64.sqrt()
}

/// A claim of this name that expects to pass.
pub fn claim(name: &str, kind: ClaimKind) -> Claim {
    Claim { label: name.into(), kind, expects: ExpectedOutcome::Pass, each: false }
}

/// The record with one claim, of this kind and expectation, that makes one comparison.
pub fn with_claim(
    mut stored: Stored,
    kind: ClaimKind,
    expects: ExpectedOutcome,
    against: Against,
    detect: Option<f64>,
) -> Stored {
    stored.record.statements = vec![Claim { expects, ..claim("c", kind) }];
    let quantity = quantity("mis", 0);
    stored.record.comparisons = vec![Comparison { claim: 0, quantity, against, detect }];
    stored
}

/// A record whose estimator `mis`, band 0, is compared with exact values, each a claim with a name.
pub fn judged(claims: &[(&str, f64)]) -> Stored {
    let mut stored = stored(0.1);
    stored.record.statements = claims.iter().map(|(name, _)| claim(name, ClaimKind::Equals)).collect();
    let against = |value| Against::Value { value, error: 0.0, source: "by hand".into() };
    let comparison = |(claim, (_, value)): (usize, &(&str, f64))| Comparison {
        claim,
        quantity: quantity("mis", 0),
        against: against(*value),
        detect: None,
    };
    stored.record.comparisons = claims.iter().enumerate().map(comparison).collect();
    stored
}
