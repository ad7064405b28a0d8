//! The jackknife against formulas written out, and what may not be quoted.

use super::*;

fn close(a: f64, b: f64, relative: f64) {
    assert!((a - b).abs() <= relative * b.abs(), "{a:e} is not {b:e}");
}

// For a plain mean the jackknife is the standard error; for its logarithm that over the mean.
#[test]
fn the_jackknife_of_a_mean() {
    let data: Vec<f64> = (0..40).map(|i| 100.0 + f64::from(i * 7 % 11)).collect();
    let n = data.len() as f64;
    let sum: f64 = data.iter().sum();
    let squares: f64 = data.iter().map(|x| (x - sum / n) * (x - sum / n)).sum();
    let expected = (squares / (n * (n - 1.0))).sqrt() / (sum / n);
    let without: Vec<f64> = data.iter().map(|x| (sum - x) / (n - 1.0)).collect();
    assert!((jackknife_log_error(&without) / expected - 1.0).abs() < 1e-3);
    assert_eq!(jackknife_log_error(&[1.0]), f64::INFINITY);
}

// scipy: t.isf(0.025, 7) = 2.364624251592785.
#[test]
fn intervals() {
    let log = Estimate { value: 3f64.ln(), std_error: 0.05, dof: 7.0 };
    let ratio = LogRatio { log };
    let (low, high) = ratio.interval(0.95);
    close(ratio.ratio(), 3.0, 1e-12);
    close(high / 3.0, (0.05f64 * 2.364624251592785).exp(), 1e-9);
    close(low * high, 9.0, 1e-9);
}

// s = 0.03 with 20 degrees of freedom, control 1.04: r = ln 1.04 = 0.03922071, r^2 = 0.00153826,
// s^2 = 0.0009; sum 0.00243826, error 0.04937878; dof 0.00243826^2 / (8.1e-7 / 20 + 0.00153826^2 / k)
// = 2.470184 for k = 1 and 9.405899 for k = 4.
#[test]
fn a_control_widens_the_interval() {
    let ratio = LogRatio { log: Estimate { value: 0.7, std_error: 0.03, dof: 20.0 } };
    let log = 1.04f64.ln();
    for (all, dof) in [(vec![log], 2.470_183_964), (vec![log, -log, log, -log], 9.405_899_113)] {
        let wide = ratio.with_control(&machine(log, &all));
        close(wide.log.std_error, 0.049_378_784_3, 1e-8);
        close(wide.log.dof, dof, 1e-8);
        assert_eq!(wide.log.value, 0.7);
    }
    // Quiet cells do not excuse a cell's own control; loud ones speak for the machine.
    close(machine(0.4, &[0.4, 0.0]).std_error, 0.4, 1e-12);
    close(machine(0.0, &[0.0, 0.4]).std_error, 0.4 / 2f64.sqrt(), 1e-12);
    assert_eq!(ratio.with_control(&machine(0.0, &[0.0])), ratio);
    // A leaking timer: the interval of a claim, 99.9 %, says nothing any more.
    assert!(ratio.with_control(&machine(0.3, &[0.3])).half_width(0.999) > 50.0);
}

fn block(values: &[f64], cost: f64) -> JackknifeBlock {
    let mut moments = Moments::default();
    values.iter().for_each(|x| moments.push(*x));
    JackknifeBlock { moments, cost }
}

/// Values without a pattern: the fractional parts of multiples of an irrational number, cubed.
fn blocks(count: usize, size: usize, seed: f64) -> Vec<JackknifeBlock> {
    let value = |i: usize| ((i as f64 + seed) * 0.618_033_988_749_895).fract();
    let block = |k: usize| {
        let values: Vec<f64> = (0..size).map(|i| value(k * size + i).powi(3)).collect();
        block(&values, 2.0 + value(k))
    };
    (0..count).map(block).collect()
}

fn log_work(blocks: &[JackknifeBlock]) -> f64 {
    let total = Totals::of(blocks);
    (total.moments.m2 / (total.moments.n - 1) as f64).ln() + (total.cost / total.moments.n as f64).ln()
}

// Tukey's formula, written out for equal blocks: joint, and independent with an arm of other length.
#[test]
fn the_jackknife_is_tukeys() {
    let (a, b, short) = (blocks(12, 16, 0.3), blocks(12, 16, 70.7), blocks(9, 16, 5.5));
    let drop =
        |blocks: &[JackknifeBlock], k: usize| log_work(&[&blocks[..k], &blocks[k + 1..]].concat());
    let tukey = |values: Vec<f64>| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (n - 1.0) / n * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
    };
    let joint = compare(&a, &b, Values::Scores).expect("a ratio");
    assert!(joint.is_joint && joint.work.log.dof == 11.0);
    close(joint.work.log.value, log_work(&a) - log_work(&b), 1e-12);
    let variance = tukey((0..12).map(|k| drop(&a, k) - drop(&b, k)).collect());
    close(joint.work.log.std_error, variance.sqrt(), 1e-10);
    close(joint.work.half_width(0.95), 2.200985160082949 * variance.sqrt(), 1e-9);
    let apart = compare(&a, &short, Values::Scores).expect("a ratio");
    let of_a = tukey((0..12).map(|k| drop(&a, k)).collect());
    let of_short = tukey((0..9).map(|k| drop(&short, k)).collect());
    assert!(!apart.is_joint);
    close(apart.work.log.std_error, (of_a + of_short).sqrt(), 1e-10);
    let dof = (of_a + of_short).powi(2) / (of_a * of_a / 11.0 + of_short * of_short / 8.0);
    close(apart.work.log.dof, dof, 1e-9);
    close(apart.variance.log.value + apart.cost.log.value, apart.work.log.value, 1e-12);
}

// The same arm twice: blocks that ran side by side have nothing between them.
#[test]
fn an_arm_against_itself_is_even() {
    let a = blocks(64, 64, 0.3);
    let found = compare(&a, &a, Values::Scores).expect("a ratio");
    assert_eq!((found.work.log.value, found.work.log.std_error), (0.0, 0.0));
    assert_eq!((found.work.ratio(), found.moved), (1.0, Moved { work: 0.0, variance: 0.0 }));
    assert!(found.is_resolved(&found.work, 0.95));
    // Twice the cost and three times the values: ratio 2 * 9, without an error.
    let b: Vec<JackknifeBlock> = a
        .iter()
        .map(|b| {
            let [n, mean, m2, m3, m4] = b.moments.to_array();
            let moments = Moments::from_array([n, 3.0 * mean, 9.0 * m2, 27.0 * m3, 81.0 * m4]);
            JackknifeBlock { moments, cost: 2.0 * b.cost }
        })
        .collect();
    let found = compare(&b, &a, Values::Scores).expect("a ratio");
    close(found.work.ratio(), 18.0, 1e-12);
    close(found.variance.ratio(), 9.0, 1e-12);
    close(found.cost.ratio(), 2.0, 1e-12);
    assert!(found.work.log.std_error < 1e-12);
    close(found.a.kurtosis, found.b.kurtosis, 1e-12);
}

// The influence of a block on a mean is its share of the passes times its distance from the mean, so
// for the cost (log c is nearly linear where costs are nearly equal) the error of blocks of n_k
// passes is sqrt(sum n_k (c_k - c)^2 / ((B - 1) n)) / c, whatever their sizes: the partial block
// counts by its passes, where equal weights would let its own noise dominate.
#[test]
fn a_partial_block_has_its_weight() {
    let mut a = blocks(64, 64, 0.3);
    for (k, b) in a.iter_mut().enumerate() {
        b.cost = 64.0 * (1.0 + 1e-3 * (k as f64 * 0.618).fract());
    }
    a.push(JackknifeBlock { moments: Moments { n: 2, ..a[0].moments }, cost: 2.0 * 1.01 });
    let spread = super::super::hypothesis::Spread::of(
        a.iter().map(|b| (b.moments.n as f64, b.cost / b.moments.n as f64)),
    );
    let b =
        blocks(16, 16, 900.1).into_iter().map(|b| JackknifeBlock { cost: 1.0, ..b }).collect::<Vec<_>>();
    let found = compare(&a, &b, Values::Scores).expect("a ratio").cost.log;
    close(found.std_error, spread.estimate.std_error / spread.estimate.value, 0.03);
}

#[test]
fn shares_of_one_pass_are_bounded() {
    let mut values: Vec<f64> = (0..640).map(|i| f64::from(i % 7)).collect();
    values[77] = 60.0;
    let blocks: Vec<JackknifeBlock> = values.chunks(64).map(|v| block(v, 1.0)).collect();
    let total = Totals::of(&blocks).moments;
    let share = (60.0 - total.mean).powi(2) / total.m2;
    let (low, high) = one_pass_share(&blocks, Values::Scores, total.mean);
    assert!(low <= share && share <= high && high < 1.1 * share, "{low} {share} {high}");
    let one = [JackknifeBlock { moments: total, cost: 1.0 }];
    let (low, high) = one_pass_share(&one, Values::Scores, total.mean);
    close(low, total.kurtosis() / 640.0, 1e-12);
    close(high, (total.kurtosis() / 640.0).sqrt(), 1e-12);
    // The ratio of such an arm is not to be quoted, and of one without the spike it is.
    let calm: Vec<JackknifeBlock> =
        blocks.iter().map(|b| JackknifeBlock { cost: 1.0, ..*b }).skip(2).collect();
    let is_resolved = |a: &[JackknifeBlock]| {
        let found = compare(a, &calm, Values::Scores).expect("a ratio");
        found.is_resolved(&found.work, 0.95)
    };
    assert!(!is_resolved(&blocks) && is_resolved(&calm));
}

// Blocks of variances: the ratio of their means, with Tukey's error of its logarithm, and the
// largest of them as the one that must not decide.
#[test]
fn variances_are_compared_by_their_means() {
    let (a, b) = (blocks(12, 16, 0.3), blocks(12, 16, 70.7));
    let of = |blocks: &[JackknifeBlock]| {
        let total = Totals::of(blocks);
        (total.moments.mean * total.cost / total.moments.n as f64).ln()
    };
    let found = compare(&a, &b, Values::Variances).expect("a ratio");
    close(found.work.log.value, of(&a) - of(&b), 1e-12);
    let drop = |blocks: &[JackknifeBlock], k: usize| of(&[&blocks[..k], &blocks[k + 1..]].concat());
    let values: Vec<f64> = (0..12).map(|k| drop(&a, k) - drop(&b, k)).collect();
    let mean = values.iter().sum::<f64>() / 12.0;
    let variance = 11.0 / 12.0 * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    close(found.work.log.std_error, variance.sqrt(), 1e-10);
    assert!(found.a.kurtosis.is_nan());

    let mut values: Vec<f64> = (0..640).map(|i| 1.0 + f64::from(i % 7)).collect();
    let calm: Vec<JackknifeBlock> = values.chunks(64).map(|v| block(v, 1.0)).collect();
    values[77] = 300.0;
    let loud: Vec<JackknifeBlock> = values.chunks(64).map(|v| block(v, 1.0)).collect();
    let share = 300.0 / values.iter().sum::<f64>();
    let found = compare(&loud, &calm, Values::Variances).expect("a ratio");
    let (low, high) = found.a.largest_pass;
    assert!(low <= share && share <= high && high < 1.05 * share, "{low} {share} {high}");
    assert!(!found.is_resolved(&found.work, 0.999));
    let even = compare(&calm, &calm, Values::Variances).expect("a ratio");
    assert!(even.is_resolved(&even.work, 0.999));
    let none = vec![block(&[0.0, 0.0], 1.0); 16];
    assert_eq!(compare(&none, &calm, Values::Variances).err(), Some(NoRatio::ZeroVariance));
}

// The second half of A is three times as wide as the first: the log ratio moves by log 5 when the
// passes double, while no single pass is to blame. No error of the machine excuses that: the widest
// interval of work does not.
#[test]
fn a_variance_that_moves_is_not_resolved() {
    let steady = blocks(64, 64, 0.3);
    let mut drifting = blocks(64, 64, 40.4);
    for block in &mut drifting[32..] {
        let [n, mean, m2, m3, m4] = block.moments.to_array();
        block.moments = Moments::from_array([n, mean, 9.0 * m2, 27.0 * m3, 81.0 * m4]);
    }
    let found = compare(&drifting, &steady, Values::Scores).expect("a ratio");
    assert!(found.a.largest_pass.1 < LARGEST_SHARE && found.moved.variance > 1.0);
    assert!(!found.is_resolved(&found.work, 0.95));
    let loud = found.work.with_control(&machine(0.3, &[0.3]));
    assert!(loud.half_width(0.95) > found.moved.work && !found.is_resolved(&loud, 0.95));
    // Where arms trade places: B alone is what a lower bound of the ratio rests on.
    let found = compare(&steady, &drifting, Values::Scores).expect("a ratio");
    assert!(!found.b_is_resolved);
}

// A machine that makes A cheaper by a tenth in the second half of the run: the ratio moves by 0.05.
// Without a control, or with one that shows nothing, that is not resolved; with one that shows
// the favour, the interval that is quoted contains it.
#[test]
fn a_cost_that_moves_is_resolved_within_the_control() {
    let steady = blocks(64, 64, 0.3);
    let mut favoured = steady.clone();
    for (k, block) in favoured.iter_mut().enumerate() {
        // The jackknife needs some scatter between the arms, here 1 %.
        let scatter = 1.0 + 0.02 * (k as f64 * 0.618_033_988_749_895).fract();
        block.cost *= scatter * if k < 32 { 1.0 } else { exp(-0.1) };
    }
    let found = compare(&favoured, &steady, Values::Scores).expect("a ratio");
    assert!((found.moved.work - 0.05).abs() < 0.002 && found.moved.variance == 0.0);
    assert!(found.b_is_resolved);
    let is_resolved = |control: f64| {
        let quoted = found.work.with_control(&machine(control, &[control; 4]));
        found.is_resolved(&quoted, 0.999)
    };
    assert!(!is_resolved(0.0) && !is_resolved(0.001) && is_resolved(0.05));
}

#[test]
fn what_has_no_ratio() {
    let good = blocks(16, 16, 0.3);
    let refusal = |bad: Vec<JackknifeBlock>| {
        assert_eq!(
            compare(&bad, &good, Values::Scores).err(),
            compare(&good, &bad, Values::Scores).err()
        );
        compare(&bad, &good, Values::Scores).expect_err("no ratio")
    };
    assert_eq!(refusal(good[..7].to_vec()), NoRatio::TooFewBlocks);
    assert_eq!(refusal(vec![JackknifeBlock { cost: f64::NAN, ..good[0] }; 16]), NoRatio::NotFinite);
    assert_eq!(refusal(vec![JackknifeBlock { cost: 0.0, ..good[0] }; 16]), NoRatio::NotFinite);
    assert_eq!(refusal(vec![block(&[1.0, 1.0], 1.0); 16]), NoRatio::ZeroVariance);
    let mut one = vec![block(&[1.0, 1.0], 1.0); 16];
    one[3] = block(&[1.0, 5.0], 1.0);
    assert_eq!(refusal(one), NoRatio::ZeroVariance);
}
