//! Significance tests of means, and the smallest difference that they detect. Two-sided throughout.

use super::moments::Moments;
use super::tails::student_two_sided;
pub use super::tails::{chi_square_sf, critical_value};

/// An estimate with its standard error and the degrees of freedom of that error (infinite where the
/// error is known).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Estimate of the mean.
    pub value: f64,
    /// Standard error of the estimate.
    pub std_error: f64,
    /// Degrees of freedom of the error.
    pub dof: f64,
}

impl Estimate {
    /// A value with a known error: 0 for an exact one.
    pub fn known(value: f64, std_error: f64) -> Estimate {
        Estimate { value, std_error, dof: f64::INFINITY }
    }

    /// The mean of all passes, with its error taken from the spread of the batch means.
    ///
    /// Batches of n_b passes, N in all: with independent passes of variance s^2, the expectation of
    /// sum n_b (mean_b - mean)^2 is (B - 1) s^2 for any n_b, so a partial last batch enters with its
    /// own weight, and se^2 = sum n_b (mean_b - mean)^2 / ((B - 1) N) has B - 1 degrees of freedom.
    pub fn of_batches(batches: &[Moments]) -> Estimate {
        Spread::of(batches.iter().map(|b| (b.n as f64, b.mean))).estimate
    }

    /// The mean difference of paired batches: the same passes on both sides.
    pub fn of_differences(a: &[Moments], b: &[Moments]) -> Estimate {
        assert_eq!(a.len(), b.len(), "paired batches");
        Spread::of(a.iter().zip(b).map(|(a, b)| (a.n as f64, a.mean - b.mean))).estimate
    }

    /// The difference of independent estimates, as Welch has it: the variances add, and by
    /// Satterthwaite dof = (sum v)^2 / sum (v^2 / dof).
    pub fn minus(&self, other: &Estimate) -> Estimate {
        let (va, vb) = (self.std_error * self.std_error, other.std_error * other.std_error);
        let spread = va * va / self.dof + vb * vb / other.dof;
        let dof = if spread == 0.0 { f64::INFINITY } else { (va + vb) * (va + vb) / spread };
        Estimate { value: self.value - other.value, std_error: (va + vb).sqrt(), dof }
    }

    /// Tests that the estimate's expectation is 0: by Student's t, or the normal where the error is
    /// known.
    pub fn test_zero(&self) -> Test {
        let statistic = self.value / self.std_error;
        Test { statistic, dof: self.dof, p_value: student_two_sided(statistic, self.dof) }
    }

    /// The smallest true difference that this test, at two-sided `level`, rejects with probability
    /// `power`.
    ///
    /// A noncentral t with noncentrality D exceeds the critical value c with probability `power` at
    /// D = c + z sqrt(1 + c^2 / (2 dof)), z the normal quantile of `power` (N. Johnson, B. Welch,
    /// "Applications of the non-central t-distribution" (1940), to first order; 0.3 % too large at 63
    /// degrees of freedom and level 1e-6).
    pub fn detectable(&self, level: f64, power: f64) -> f64 {
        let c = critical_value(level, self.dof);
        let z = critical_value(2.0 * (1.0 - power), f64::INFINITY);
        self.std_error * (c + z * (1.0 + 0.5 * c * c / self.dof).sqrt())
    }
}

/// The result of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Test {
    /// z, t or chi-square.
    pub statistic: f64,
    /// Degrees of freedom; infinite for a z test.
    pub dof: f64,
    /// Probability of a statistic at least as extreme.
    pub p_value: f64,
}

/// The weighted mean of batch means, and how the batches spread about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The mean and its error.
    pub estimate: Estimate,
    /// The largest batch's share of the sum of squares between batches; 0 where there is none.
    pub largest_share: f64,
}

impl Spread {
    /// From batches of (weight, mean). Means are taken relative to the first, so that equal batches
    /// have exactly their mean and exactly no error.
    pub fn of(batches: impl Iterator<Item = (f64, f64)> + Clone) -> Spread {
        let first = batches.clone().next().map_or(0.0, |(_, mean)| mean);
        let weight: f64 = batches.clone().map(|(n, _)| n).sum();
        let value = first + batches.clone().map(|(n, mean)| n * (mean - first)).sum::<f64>() / weight;
        let square = |(n, mean): (f64, f64)| n * (mean - value) * (mean - value);
        let sum: f64 = batches.clone().map(square).sum();
        let largest = batches.clone().map(square).fold(0.0, f64::max);
        let dof = batches.count() as f64 - 1.0;
        let std_error = (sum / (dof * weight)).sqrt();
        let largest_share = if sum > 0.0 { largest / sum } else { 0.0 };
        Spread { estimate: Estimate { value, std_error, dof }, largest_share }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a:e} is not {b:e}");
    }

    // scipy: t.isf(0.5e-6, 63), norm.isf(0.5e-6), t.isf(0.5e-8, 63).
    #[test]
    fn critical_values() {
        close(critical_value(1e-6, 63.0), 5.420029671037226, 1e-10);
        close(critical_value(1e-6, f64::INFINITY), 4.891638475698591, 1e-12);
        close(critical_value(1e-8, 63.0), 6.5974680330632545, 1e-10);
    }

    // scipy: root of nct.sf(t.isf(level/2, dof), dof, d) = 0.99 in d.
    #[test]
    fn detectable_effects() {
        let detectable =
            |dof, level| Estimate { value: 0.0, std_error: 1.0, dof }.detectable(level, 0.99);
        close(detectable(63.0, 1e-6), 7.986920162853748, 3e-3);
        close(detectable(63.0, 1e-8), 9.27824542272205, 3e-3);
        close(detectable(127.0, 1e-6), 7.577782199229958, 3e-3);
        close(detectable(f64::INFINITY, 1e-6), 4.891638475698591 + 2.3263478740408408, 1e-9);
    }

    const A: [f64; 7] = [1.0, 2.5, 3.25, 0.5, 9.0, 4.0, 4.5];
    const B: [f64; 7] = [2.0, 2.25, 7.5, 1.5, 9.5, 8.0, 3.0];

    fn check(test: Test, statistic: f64, p_value: f64, dof: f64) {
        close(test.statistic, statistic, 1e-13);
        close(test.p_value, p_value, 1e-12);
        close(test.dof, dof, 1e-13);
    }

    // scipy.stats: ttest_1samp(A, 3.0), ttest_ind(A, B, equal_var=False), ttest_rel(A, B).
    #[test]
    fn t_tests() {
        let (a, b) = (A.map(Moments::of), B.map(Moments::of));
        let (mean_a, mean_b) = (Estimate::of_batches(&a), Estimate::of_batches(&b));
        let one = mean_a.minus(&Estimate::known(3.0, 0.0)).test_zero();
        check(one, 0.5021433329077596, 0.6334586414588788, 6.0);
        let welch = mean_a.minus(&mean_b).test_zero();
        check(welch, -0.7739996775002014, 0.45436054217716465, 11.643267924725107);
        let paired = Estimate::of_differences(&a, &b).test_zero();
        check(paired, -1.6019789741639454, 0.1602798298021094, 6.0);
    }

    // Two passes a batch, the last of one: se^2 = sum n_b (m_b - m)^2 / ((B - 1) N), by hand for
    // means 1, 3, 2 with weights 2, 2, 1: m = 2, sum = 4, se^2 = 4 / (2 * 5).
    #[test]
    fn a_partial_batch_has_its_weight() {
        let batch = |n, mean| Moments { n, mean, ..Moments::default() };
        let e = Estimate::of_batches(&[batch(2, 1.0), batch(2, 3.0), batch(1, 2.0)]);
        assert_eq!((e.value, e.dof), (2.0, 2.0));
        close(e.std_error, 0.4f64.sqrt(), 1e-15);
    }

    #[test]
    fn one_wild_batch_has_the_largest_share() {
        let share = |last| {
            Spread::of((0..64).map(|i| (1.0, f64::from(i % 7))).chain([(1.0, last)])).largest_share
        };
        assert!(share(3.0) < 0.1 && share(1e4) > 0.9);
    }

    /// Uniform with mean 0, hashed from `i` (the finaliser of splitmix64).
    fn uniform(i: u64) -> f64 {
        let mut z = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    // 20000 tests of a true hypothesis: rejections at level p are binomial, within 4.5 standard
    // deviations (7e-6) of 20000 p. The last batch is partial.
    #[test]
    fn false_alarms_have_their_level() {
        let batch = |seed: u64, b: u64| {
            let n = if b == 63 { 2 } else { 6 };
            let mut m = Moments::default();
            (0..n).for_each(|i| m.push(uniform(seed * 512 + b * 8 + i)));
            m
        };
        let batches = |seed| (0..64).map(|b| batch(seed, b)).collect::<Vec<_>>();
        let (mut one, mut welch, mut paired) = (vec![], vec![], vec![]);
        for run in 0..20_000 {
            let (a, b) = (batches(2 * run), batches(2 * run + 1));
            let (mean_a, mean_b) = (Estimate::of_batches(&a), Estimate::of_batches(&b));
            one.push(mean_a.test_zero().p_value);
            welch.push(mean_a.minus(&mean_b).test_zero().p_value);
            paired.push(Estimate::of_differences(&a, &b).test_zero().p_value);
        }
        for (name, p_values) in [("one", one), ("welch", welch), ("paired", paired)] {
            for level in [0.5, 0.1, 0.01, 0.001] {
                let found = p_values.iter().filter(|p| **p < level).count() as f64;
                let (mean, variance) = (20_000.0 * level, 20_000.0 * level * (1.0 - level));
                assert!((found - mean).abs() < 4.5 * variance.sqrt(), "{name} {level}: {found}");
            }
        }
    }
}
