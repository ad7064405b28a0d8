//! Many tests under one error rate.

use super::tails::{bisect, critical_value, normal_upper};

/// Holm's adjusted p-values: rejecting those below `level` keeps the probability of any false
/// rejection below `level`, whatever the dependence between the tests.
///
/// With p sorted upwards, adjusted(i) = max over j <= i of min(1, (m - j) p(j)), j counted from 0.
/// S. Holm, "A simple sequentially rejective multiple test procedure" (1979). A p-value that is no number
/// counts as a test and stays no number.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut adjusted = vec![0.0; p.len()];
    let mut largest: f64 = 0.0;
    for (rank, &i) in order.iter().enumerate() {
        largest = largest.max((p[i] * (p.len() - rank) as f64).min(1.0));
        adjusted[i] = if p[i].is_nan() { p[i] } else { largest };
    }
    adjusted
}

/// Two stages: tests that fail Holm's procedure at `level` are repeated on fresh streams with
/// [`TwoStage::FACTOR`] times the samples, and judged by Holm among themselves at `level` again.
///
/// A false alarm needs a true hypothesis to fail twice. Holm lets any of them fail stage 1 with a
/// probability of at most `level`; given that, stage 2 is independent, and again at most `level`: `level`^2 in
/// all. As repeats are rare, they may be long: the power is stage 1's, whose critical value is that of a level
/// a thousand times as large as a single stage of the same error rate would need. Repeating with
/// *equally many* samples would lose power instead, and taking the best of several seeds is no test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoStage {
    /// The level of each stage.
    pub level: f64,
}

impl TwoStage {
    /// At most 1e-6 false alarms per family.
    pub const GATE: TwoStage = TwoStage { level: 1e-3 };

    /// Samples of a repeat, in those of the first stage.
    pub const FACTOR: u64 = 4;

    /// The probability of any false alarm.
    pub fn false_alarms(&self) -> f64 {
        self.level * self.level
    }

    /// Which tests fail the first stage and are to be repeated. A p-value that is no number is one of them:
    /// nothing passes unseen.
    pub fn suspects(&self, p: &[f64]) -> Vec<usize> {
        let adjusted = holm(p);
        (0..p.len()).filter(|&i| self.is_failure(adjusted[i])).collect()
    }

    /// Of the repeated tests' p-values, which fail again.
    pub fn confirmed(&self, repeated: &[f64]) -> Vec<bool> {
        holm(repeated).into_iter().map(|p| self.is_failure(p)).collect()
    }

    fn is_failure(&self, adjusted: f64) -> bool {
        adjusted.is_nan() || adjusted < self.level
    }

    /// The true difference, in standard errors of the first stage, that fails both stages with probability
    /// `power` among `tests` tests: with c the two-sided critical value of level / tests and f the factor,
    /// P(Z > c - D) P(Z > c - sqrt(f) D) = power. It is what a test must see whose neighbours all pass, the
    /// hardest case of Holm's procedure.
    pub fn detectable(&self, tests: usize, power: f64) -> f64 {
        let c = critical_value(self.level / tests.max(1) as f64, f64::INFINITY);
        let gain = (TwoStage::FACTOR as f64).sqrt();
        let found = |d: f64| normal_upper(c - d) * normal_upper(c - gain * d);
        bisect(|d| found(d) < power, 0.0, c + 40.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // By hand: 4 * 0.01, max(that, 3 * 0.02), max(that, 2 * 0.03), max(that, 0.5).
    #[test]
    fn small_example() {
        assert_eq!(holm(&[0.5, 0.01, 0.03, 0.02]), [0.5, 0.04, 0.06, 0.06]);
        assert_eq!(holm(&[0.7, 0.9]), [1.0, 1.0]);
        assert!(holm(&[]).is_empty());
    }

    #[test]
    fn a_p_value_that_is_no_number_never_passes() {
        let adjusted = holm(&[0.01, f64::NAN, 0.5]);
        assert!((adjusted[0] - 0.03).abs() < 1e-15 && adjusted[1].is_nan() && adjusted[2] == 1.0);
        assert_eq!(TwoStage::GATE.suspects(&[0.01, f64::NAN, 0.5]), [1]);
        assert_eq!(TwoStage::GATE.confirmed(&[f64::NAN, 0.5, 1e-9]), [true, false, true]);
    }

    // By hand: of four tests 2e-4 is below 1e-3 / 4, then 3e-4 below 1e-3 / 3, then 0.01 not below 1e-3 / 2.
    #[test]
    fn two_stages() {
        let gate = TwoStage::GATE;
        assert_eq!(gate.suspects(&[0.01, 3e-4, 0.5, 2e-4]), [1, 3]);
        assert_eq!(gate.suspects(&[0.01, 6e-4, 0.5, 3e-4]), [0usize; 0]);
        assert_eq!(gate.confirmed(&[6e-4, 2e-4]), [true, true]);
        assert_eq!(gate.confirmed(&[6e-4, 0.3]), [false, false]);
        assert_eq!((gate.false_alarms(), gate.suspects(&[]).len()), (1e-6, 0));
    }

    // scipy: norm.isf(1e-3 / 600) + norm.ppf(0.99); the second stage, at twice as many standard errors, loses
    // nothing. One stage at 1e-6 would see norm.isf(1e-6 / 600) + norm.ppf(0.99).
    #[test]
    fn two_stages_see_more_than_one() {
        let d = TwoStage::GATE.detectable(300, 0.99);
        assert!((d - (4.649_6 + 2.326_3)).abs() < 1e-3, "{d}");
        let one = critical_value(1e-6 / 300.0, f64::INFINITY) + 2.326_3;
        assert!((one - 8.24).abs() < 0.01 && (one / d).powi(2) > 1.39, "{one}");
    }

    /// Uniform in (0, 1), hashed from `i` (the finaliser of splitmix64).
    fn uniform(i: u64) -> f64 {
        let mut z = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 12) as f64 + 0.5) / (1u64 << 52) as f64
    }

    // At level 0.1 a stage, 1e-2 in all: 20000 families of 8 true hypotheses, of which at most 200 may be
    // alarmed, within 4 standard deviations (57).
    #[test]
    fn families_keep_their_level() {
        let gate = TwoStage { level: 0.1 };
        let (mut first, mut both) = (0, 0);
        for family in 0..20_000u64 {
            let p: Vec<f64> = (0..8).map(|i| uniform(family * 16 + i)).collect();
            let suspects = gate.suspects(&p);
            let repeated: Vec<f64> =
                suspects.iter().map(|i| uniform(family * 16 + 8 + *i as u64)).collect();
            first += u32::from(!suspects.is_empty());
            both += u32::from(gate.confirmed(&repeated).contains(&true));
        }
        assert!((1700..2100).contains(&first) && (100..257).contains(&both), "{first} {both}");
    }
}
