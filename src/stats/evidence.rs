//! E-values: evidence that may be looked at after every sample and every night.
//!
//! An e-process is a non-negative process that starts at 1 and whose expectation under the hypothesis is at
//! most 1 whenever one stops. By Ville's inequality the probability that it *ever* reaches 1/alpha is at
//! most alpha. It is a gambler's wealth in a game that is fair, or unfavourable, under the hypothesis.
//!
//! *Non-negative values.* Let X >= 0 have an expectation of at most mu. A stake l in [0, 1) turns a wealth of 1
//! into 1 + l (X/mu - 1) > 0, whose expectation is at most 1: no variance is needed, which is why this is the
//! test of the mean for weights whose variance is infinite, where a z-test alarms up to a third of the time
//! at the level 1e-2. The mean over several fixed stakes is an e-process again, and within a factor of
//! their number as good as the best of them in hindsight.
//!
//! *Only upwards.* A mean that is too *low* cannot be refuted for non-negative values without a bound:
//! the missing mass may hide in a tail that no sample has reached (R. Bahadur, L. Savage, "The nonexistence of
//! certain statistical procedures in nonparametric problems" (1956)). With X <= B the mirror image
//! B - X is non-negative too, with the mean B - mu: betting on both is a two-sided test.
//!
//! Source: I. Waudby-Smith, A. Ramdas, "Estimating means of bounded random variables by betting" (2024).
//! Wealth is kept as logarithms, so that it neither overflows nor dies.

use std::fmt;

use crate::math::{exp, ln, ln_1p};

/// Stakes of the mixture: large ones for gross defects, small ones for long series.
pub const STAKES: [f64; 7] = [0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005];

/// A value that the hypothesis excludes or that is no number: there is no evidence, only a refutation of
/// what was assumed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// The value.
    pub value: f64,
    /// The largest that is allowed; infinite where only a sign is required.
    pub bound: f64,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} is not a finite number in [0, {}]", self.value, self.bound)
    }
}

/// ln(mean of e^x): no term overflows.
fn log_mean_exp(logs: &[f64]) -> f64 {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest.is_infinite() {
        return largest;
    }
    largest + ln(logs.iter().map(|x| exp(x - largest)).sum::<f64>() / logs.len() as f64)
}

/// A running e-process and the largest value that it had.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// ln e now: what multiplies with the evidence of other samples.
    pub log: f64,
    /// The largest ln e so far, at least 0: what an alarm looks at.
    pub peak: f64,
}

impl Evidence {
    const NONE: Evidence = Evidence { log: 0.0, peak: 0.0 };

    fn now(&mut self, log: f64) {
        *self = Evidence { log, peak: self.peak.max(log) };
    }

    /// Has it ever reached 1/alpha? True with a probability of at most alpha under the hypothesis.
    pub fn alarms(&self, alpha: f64) -> bool {
        self.peak >= -ln(alpha)
    }

    /// 1/peak: a p-value, valid at every moment, conservative.
    pub fn p_value(&self) -> f64 {
        exp(-self.peak)
    }
}

/// Bets that the mean of non-negative values exceeds `mean`.
#[derive(Clone, Debug, PartialEq)]
pub struct Upward {
    mean: f64,
    log_wealth: [f64; STAKES.len()],
    evidence: Evidence,
}

impl Upward {
    /// Against the hypothesis that the expectation is at most `mean` > 0.
    pub fn new(mean: f64) -> Upward {
        assert!(mean > 0.0, "a positive mean, not {mean}");
        Upward { mean, log_wealth: [0.0; STAKES.len()], evidence: Evidence::NONE }
    }

    /// Takes the next value.
    ///
    /// # Errors
    ///
    /// [`OutOfRange`] where it is negative or not finite.
    pub fn push(&mut self, value: f64) -> Result<(), OutOfRange> {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(OutOfRange { value, bound: f64::INFINITY });
        }
        let gain = value / self.mean - 1.0;
        for (wealth, stake) in self.log_wealth.iter_mut().zip(STAKES) {
            *wealth += ln_1p(stake * gain);
        }
        self.evidence.now(log_mean_exp(&self.log_wealth));
        Ok(())
    }

    /// The evidence so far.
    pub fn evidence(&self) -> Evidence {
        self.evidence
    }
}

/// Bets that the mean of values in [0, bound] is not `mean`: half the wealth on either side.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoSided {
    bound: f64,
    up: Upward,
    down: Upward,
    evidence: Evidence,
}

impl TwoSided {
    /// Against the hypothesis that the expectation is `mean`, 0 < mean < bound.
    pub fn new(mean: f64, bound: f64) -> TwoSided {
        TwoSided {
            bound,
            up: Upward::new(mean),
            down: Upward::new(bound - mean),
            evidence: Evidence::NONE,
        }
    }

    /// Takes the next value.
    ///
    /// # Errors
    ///
    /// [`OutOfRange`] where it is not in [0, bound].
    pub fn push(&mut self, value: f64) -> Result<(), OutOfRange> {
        if !(0.0..=self.bound).contains(&value) {
            return Err(OutOfRange { value, bound: self.bound });
        }
        self.up.push(value)?;
        self.down.push(self.bound - value)?;
        self.evidence.now(log_mean_exp(&[self.up.evidence.log, self.down.evidence.log]));
        Ok(())
    }

    /// The evidence so far, of both sides.
    pub fn evidence(&self) -> Evidence {
        self.evidence
    }
}

/// ln of the e-value 1 / (2 sqrt(p)) of a p-value: its expectation under a uniform p is the integral of
/// 1 / (2 sqrt(p)) over [0, 1], which is 1; under a conservative p it is less.
/// V. Vovk, R. Wang, "E-values: Calibration, combination and applications" (2021), with exponent 1/2.
pub fn calibrated(p: f64) -> f64 {
    -0.5 * ln(p) - ln(2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a:e} is not {b:e}");
    }

    // By hand: every stake's wealth after 2 and 0.5 with mean 1 is (1 + l)(1 - l/2).
    #[test]
    fn wealth_is_the_mean_over_stakes() {
        let mut bets = Upward::new(1.0);
        assert_eq!((bets.evidence().p_value(), bets.evidence().alarms(0.999)), (1.0, false));
        [2.0, 0.5].iter().for_each(|x| bets.push(*x).expect("in range"));
        let expected = STAKES.iter().map(|l| (1.0 + l) * (1.0 - 0.5 * l)).sum::<f64>() / 7.0;
        close(bets.evidence().log, expected.ln(), 1e-13);
        let peak = STAKES.iter().map(|l| 1.0 + l).sum::<f64>() / 7.0;
        close(bets.evidence().peak, peak.ln(), 1e-13);
        close(bets.evidence().p_value(), 1.0 / peak, 1e-13);
    }

    // Exactly: X in {0, 3} with mean 1, all 2^10 courses of ten bets, weighted: the expectation of the wealth is
    // 1, and its peak reaches 1/alpha with a probability of at most alpha.
    #[test]
    fn the_game_is_fair() {
        for two_sided in [false, true] {
            let (mut mean, mut alarms) = (0.0, [0.0; 3]);
            for course in 0..1u32 << 10 {
                let (mut up, mut both) = (Upward::new(1.0), TwoSided::new(1.0, 3.0));
                let mut probability = 1.0;
                for i in 0..10 {
                    let hit = course >> i & 1 == 1;
                    probability *= if hit { 1.0 / 3.0 } else { 2.0 / 3.0 };
                    up.push(if hit { 3.0 } else { 0.0 }).expect("in range");
                    both.push(if hit { 3.0 } else { 0.0 }).expect("in range");
                }
                let evidence = if two_sided { both.evidence() } else { up.evidence() };
                mean += probability * evidence.log.exp();
                for (alarm, alpha) in alarms.iter_mut().zip([0.5, 0.2, 0.05]) {
                    *alarm += if evidence.alarms(alpha) { probability } else { 0.0 };
                }
            }
            close(mean, 1.0, 1e-12);
            assert!(alarms[0] <= 0.5 && alarms[1] <= 0.2 && alarms[2] <= 0.05, "{alarms:?}");
            assert!(alarms[0] > 0.0, "the test can alarm");
        }
    }

    #[test]
    fn wrong_means_are_found_on_both_sides_and_nothing_overflows() {
        let wealth = |value: f64| {
            let mut bets = TwoSided::new(1.0, 2.0);
            (0..100_000)
                .for_each(|i| bets.push(value + if i % 2 == 0 { 0.5 } else { -0.5 }).expect("in range"));
            bets.evidence()
        };
        assert!(wealth(1.1).alarms(1e-300) && wealth(0.9).alarms(1e-300));
        assert!(wealth(1.1).log.is_finite() && wealth(1.1).log > 710.0, "beyond exp's range");
        assert!(!wealth(1.0).alarms(0.1));
    }

    #[test]
    fn values_outside_are_refused() {
        for value in [-0.1, f64::NAN, f64::INFINITY] {
            assert!(Upward::new(1.0).push(value).is_err());
        }
        let refused = TwoSided::new(1.0, 2.0).push(2.1).expect_err("out of range");
        assert_eq!(refused, OutOfRange { value: 2.1, bound: 2.0 });
    }

    #[test]
    fn p_values_become_e_values() {
        close(calibrated(1e-6), 500f64.ln(), 1e-12);
        close(calibrated(1.0), 0.5f64.ln(), 1e-12);
    }
}
