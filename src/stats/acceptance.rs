//! Tests of a technique that accepts a sample with a probability and reweights it by the inverse:
//! X = V e^(sigma d) with V accepted with probability e^(-sigma d).
//!
//! Such an X has the right mean whenever V has its probability, but its variance is infinite as soon as long
//! flights are likely (d of rate lambda <= sigma: P(X > x) falls as x^-(1 + lambda/sigma)), and a z-test of
//! its mean alarms without cause. What can be tested is the acceptance itself: V is bounded. Trials
//! enter bins of optical depth, and each bin compares accepted with expected.

use std::fmt;

use super::tails::{binomial_lower, binomial_upper, critical_value, normal_quantile};

/// The trials of one bin of optical depth tau = sigma d.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Trials.
    pub tried: u64,
    /// Trials that were accepted.
    pub accepted: u64,
    /// Sum of the probabilities p_i of acceptance.
    pub sum_p: f64,
    /// Sum of p_i (1 - p_i): the variance of `accepted`.
    pub sum_variance: f64,
    /// Sum of tau_i p_i: minus the derivative of `sum_p` by log sigma, for p_i = e^-tau_i.
    pub sum_slope: f64,
}

impl Bin {
    /// Adds a trial at optical depth `tau`, which should be accepted with probability e^-tau = `p`.
    pub fn push(&mut self, tau: f64, p: f64, accepted: bool) {
        self.tried += 1;
        self.accepted += u64::from(accepted);
        self.sum_p += p;
        self.sum_variance += p * (1.0 - p);
        self.sum_slope += tau * p;
    }

    /// z = (accepted - sum p_i) / sqrt(sum p_i (1 - p_i)): Poisson-binomial, of mean 0 and variance 1.
    pub fn z(&self) -> f64 {
        (self.accepted as f64 - self.sum_p) / self.sum_variance.sqrt()
    }

    /// A two-sided p-value that is valid for any number of trials.
    ///
    /// Of all sums of independent trials with the same expected number, the binomial with equal probabilities
    /// has the heaviest tails beyond one count from the mean (W. Hoeffding, "On the distribution of the number
    /// of successes in independent trials" (1956), theorem 4). So its exact tail, doubled, bounds that of the
    /// sum. What is given away is the excess of its variance, n times the variance of the p_i: little in a
    /// narrow bin. Within one count of the mean the p-value is 1. The normal tail of z would be wrong
    /// here: at 25 expected counts its level of 1e-6 is 4e-5.
    pub fn p_value(&self) -> f64 {
        if self.tried == 0 || (self.accepted as f64 - self.sum_p).abs() < 1.0 {
            return 1.0;
        }
        let p = self.sum_p / self.tried as f64;
        let tail = if (self.accepted as f64) < self.sum_p {
            binomial_lower(self.accepted, self.tried, p)
        } else {
            binomial_upper(self.accepted, self.tried, p)
        };
        (2.0 * tail).min(1.0)
    }

    /// The relative error of sigma that this bin finds at two-sided `level` with probability `power`, by
    /// the normal approximation: acceptance with e^(-(1 + r) tau) lowers the expected number by r sum tau_i p_i.
    pub fn detectable(&self, level: f64, power: f64) -> f64 {
        let sd = critical_value(level, f64::INFINITY) + normal_quantile(power);
        sd * self.sum_variance.sqrt() / self.sum_slope
    }
}

/// Numbers u = (k + 1/2) / 2^16 for every k: what a discrete choice is enumerated with.
pub const ENUMERATED: u32 = 1 << 16;

/// How often a choice made from one uniform number falls on each of `choices` outcomes, over all enumerated
/// u; the last entry counts outcomes beyond them.
pub fn enumerate(choices: usize, mut choose: impl FnMut(f64) -> usize) -> Vec<u32> {
    let mut counts = vec![0; choices + 1];
    for k in 0..ENUMERATED {
        counts[choose((f64::from(k) + 0.5) / f64::from(ENUMERATED)).min(choices)] += 1;
    }
    counts
}

/// A choice whose enumeration is not its stated probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrongChoice {
    /// The outcome.
    pub outcome: usize,
    /// Its share of the enumerated numbers.
    pub found: f64,
    /// Its stated probability.
    pub stated: f64,
}

impl fmt::Display for WrongChoice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let WrongChoice { outcome, found, stated } = self;
        write!(f, "outcome {outcome} is chosen with probability {found:.6}, not {stated:.6}")
    }
}

/// Compares an enumeration with stated probabilities. An outcome that is one interval of u has two ends,
/// each of which misplaces at most half a number: its share is within 2^-16. An outcome made of several
/// intervals is allowed as many steps; `intervals` is the largest number of them.
///
/// # Errors
///
/// [`WrongChoice`] for the first outcome that is further off, and for outcomes beyond the stated ones.
pub fn check_enumeration(counts: &[u32], stated: &[f64], intervals: u32) -> Result<(), WrongChoice> {
    let allowed = f64::from(intervals) / f64::from(ENUMERATED);
    let probabilities = stated.iter().copied().chain(std::iter::repeat(0.0));
    for (outcome, (count, stated)) in counts.iter().zip(probabilities).enumerate() {
        let found = f64::from(*count) / f64::from(ENUMERATED);
        // An impossible outcome is impossible for every number; a NaN is refused too.
        let is_right = if stated == 0.0 { *count == 0 } else { (found - stated).abs() <= allowed };
        if !is_right {
            return Err(WrongChoice { outcome, found, stated });
        }
    }
    if counts.len() < stated.len() {
        return Err(WrongChoice { outcome: counts.len(), found: 0.0, stated: stated[counts.len()] });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a:e} is not {b:e}");
    }

    fn bin_at(tau: f64, tried: u64) -> Bin {
        let (n, p) = (tried as f64, (-tau).exp());
        Bin {
            tried,
            accepted: (n * p).round() as u64,
            sum_p: n * p,
            sum_variance: n * p * (1.0 - p),
            sum_slope: n * p * tau,
        }
    }

    // By hand at tau = 1, n = 1e6: 7.218 sqrt(e^-1 (1 - e^-1)) / (1e3 e^-1) = 0.946 %.
    #[test]
    fn detectable_errors_of_sigma() {
        for (tau, r) in [
            (0.1, 0.0234),
            (0.5, 0.01163),
            (1.0, 0.00946),
            (1.6, 0.00897),
            (3.0, 0.01051),
            (6.0, 0.02413),
        ] {
            close(bin_at(tau, 1_000_000).detectable(1e-6, 0.99), r, 2e-3);
        }
    }

    // Exactly, for 2 x 6 trials of two probabilities: the tail of the sum, by convolution, is never above the
    // p-value.
    #[test]
    fn the_p_value_bounds_the_poisson_binomial() {
        let mut pmf = vec![1.0];
        let mut bin = Bin::default();
        for i in 0..12 {
            let p = if i % 2 == 0 { 0.15f64 } else { 0.5 };
            let mut next = vec![0.0; pmf.len() + 1];
            for (k, x) in pmf.iter().enumerate() {
                next[k] += x * (1.0 - p);
                next[k + 1] += x * p;
            }
            pmf = next;
            bin.push(-p.ln(), p, false);
        }
        let p_values: Vec<f64> = (0..=12).map(|k| Bin { accepted: k, ..bin }.p_value()).collect();
        for level in &p_values {
            let found: f64 =
                pmf.iter().zip(&p_values).filter(|(_, p)| *p <= level).map(|(x, _)| x).sum();
            assert!(found <= level * (1.0 + 1e-12), "{found} at {level}");
        }
        assert!(p_values[12] < 1e-3 && p_values[4] == 1.0);
    }

    #[test]
    fn a_wrong_sigma_is_found() {
        let mut bin = bin_at(1.6, 1_000_000);
        assert!(bin.p_value() > 0.99 && bin.z().abs() < 0.01);
        let r = bin.detectable(1e-6, 0.99);
        bin.accepted = (1e6 * (-1.6 * (1.0 + r)).exp()) as u64;
        close(bin.z(), -7.2, 0.02);
        assert!(bin.p_value() < 1e-11);
    }

    #[test]
    fn choices_are_enumerated() {
        let stated = [0.3, 0.0, 0.7];
        let choose = |u: f64| if u < 0.3 { 0 } else { 2 };
        assert_eq!(check_enumeration(&enumerate(3, choose), &stated, 1), Ok(()));
        // An error of 1e-4 in the probability; an outcome that cannot be; one that nobody stated.
        let wrong = |u: f64| if u < 0.3001 { 0 } else { 2 };
        let found = check_enumeration(&enumerate(3, wrong), &stated, 1).expect_err("wrong");
        assert_eq!(found.outcome, 0);
        let once = |u: f64| if u > 0.99999 { 1 } else { choose(u) };
        assert!(check_enumeration(&enumerate(3, once), &stated, 1).is_err());
        let beyond = |u: f64| if u > 0.99999 { 7 } else { choose(u) };
        assert_eq!(check_enumeration(&enumerate(3, beyond), &stated, 2).expect_err("wrong").outcome, 3);
        assert!(check_enumeration(&[ENUMERATED], &[1.0, 0.0], 1).is_err());
    }
}
