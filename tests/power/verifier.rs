//! The verifier's own arithmetic with places for defects, and tests of it: fixed data with
//! a known answer, and the false alarms of many correct null hypotheses, drawn by another family of
//! generators than the streams under test (SplitMix64; Steele, Lea & Flood 2014).

use std::f64::consts::TAU;

use scatterproof::math::{cos, ln};
use scatterproof::stats::hypothesis::Estimate;
use scatterproof::stats::moments::Moments;

use super::defects::Defect;

/// Pixels of a pass, which share most of their noise.
const PIXELS: usize = 16;

/// Passes of one data set; each is a batch.
const PASSES: usize = 64;

/// Data sets of the calibration.
const SETS: u32 = 2000;

/// Both tests, and whether each is broken.
pub fn all(defect: Defect) -> Vec<(String, bool)> {
    let fixed = ("calibration fixed-data".to_string(), !fixed_data(defect));
    vec![fixed, ("calibration false-alarms".to_string(), !false_alarms(defect))]
}

/// Variance of a sample.
fn variance(data: &[f64], defect: Defect) -> f64 {
    if defect == Defect::VarianceByDifference {
        let n = data.len() as f32;
        let sum: f32 = data.iter().map(|&x| x as f32).sum();
        let squares: f32 = data.iter().map(|&x| x as f32 * x as f32).sum();
        return f64::from(squares / n - (sum / n) * (sum / n));
    }
    let mut moments = Moments::default();
    data.iter().for_each(|&x| moments.push(x));
    moments.variance()
}

/// Two-sided p-value of the mean 0 for passes of pixels.
fn p_value(passes: &[[f64; PIXELS]], defect: Defect) -> f64 {
    let means = || passes.iter().map(|pixels| pixels.iter().sum::<f64>() / PIXELS as f64);
    let batches: Vec<Moments> = match defect {
        Defect::PixelsForPasses => passes.iter().flatten().map(|&x| Moments::of(x)).collect(),
        _ => means().map(Moments::of).collect(),
    };
    let mut estimate = Estimate::of_batches(&batches);
    if defect == Defect::DeviationForError {
        estimate.std_error *= (batches.len() as f64).sqrt();
    }
    let p = estimate.test_zero().p_value;
    if defect == Defect::OneSided { 0.5 * p } else { p }
}

/// 10,000 numbers of mean 1000 and variance 1: 1000 + sqrt(2) cos at equal steps of its period.
fn fixed_data(defect: Defect) -> bool {
    let n = 10_000;
    let step = TAU / f64::from(n);
    let data: Vec<f64> =
        (0..n).map(|i| 1000.0 + std::f64::consts::SQRT_2 * cos(step * f64::from(i))).collect();
    let exact = f64::from(n) / f64::from(n - 1);
    (variance(&data, defect) / exact - 1.0).abs() < 1e-9
}

/// Of correct null hypotheses, a share q has p < q; six standard errors of that count are allowed.
fn false_alarms(defect: Defect) -> bool {
    let mut state = 0;
    let mut normals = || normals(&mut state);
    let p_values: Vec<f64> = (0..SETS)
        .map(|_| {
            let pass = |common: f64, own: [f64; 2]| std::array::from_fn(|i| common + 0.1 * own[i % 2]);
            let passes: Vec<[f64; PIXELS]> =
                (0..PASSES).map(|_| pass(normals()[0], normals())).collect();
            p_value(&passes, defect)
        })
        .collect();
    [0.1, 0.01].iter().all(|&q| {
        let expected = q * f64::from(SETS);
        let count = p_values.iter().filter(|p| **p < q).count() as f64;
        (count - expected).abs() < 6.0 * expected.sqrt()
    })
}

/// Two independent normal numbers (Box & Muller 1958).
fn normals(state: &mut u64) -> [f64; 2] {
    let mut uniform = || {
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    let (radius, turns) = ((-2.0 * ln(1.0 - uniform())).sqrt(), uniform());
    [radius * cos(TAU * turns), radius * cos(TAU * (turns - 0.25))]
}
