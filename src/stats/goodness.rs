//! Tests of samples against known probabilities, and the smallest defect that each would have found.
//!
//! K. Pearson's statistic X2 = sum (n_i - N p_i)^2 / (N p_i) over bins whose probabilities p_i come from
//! quadrature with errors of at most d_i. Three conditions make its chi-square tail valid at levels down to
//! 1e-6, and a test that does not meet them is refused, never passed:
//!
//! - *The expectations are resolved.* With p_i off by d_i, X2 of a perfect sampler is a noncentral
//!   chi-square with noncentrality lambda = N sum d_i^2 / p_i at most. That moves its mean by lambda;
//!   one standard deviation of X2 is sqrt(2 dof). Required: lambda <= 0.02 sqrt(2 dof), a shift that
//!   takes a level of 1e-6 to 1.1e-6 at most.
//! - *No bin is thin*: N p_i >= 25. At 5, the usual rule, there are twice too many rejections at the level
//!   1e-3 where one bin dominates. The likelihood-ratio statistic G would need 100.
//! - *The bins cover all outcomes*: sum p_i = 1 within the sum of the errors. Failed samples have a separate
//!   bin, and so has each discrete direction.
//!
//! A sample in a bin of probability exactly 0 refutes the probabilities at once.

use std::fmt;

use super::hypothesis::{Estimate, Test};
use super::moments::Moments;
use super::tails::{
    binomial_lower, binomial_two_sided, binomial_upper, bisect, chi_square_sf, noncentrality,
};

/// The least expected count of a bin.
pub(crate) const LEAST_EXPECTED: f64 = 25.0;

/// The largest noncentrality from errors of the expectations, in standard deviations of the statistic.
pub(crate) const LARGEST_SHIFT: f64 = 0.02;

/// The largest |skewness| / sqrt(n) at which the mean of n values is tested as a normal: at 0.26, t
/// tests of skewed values at the level 1e-3 rejected 2.5 times too often.
pub(crate) const LARGEST_SKEW: f64 = 0.1;

/// Why a test is void: never a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Refusal {
    /// No samples, or fewer than two bins that can hold any.
    Empty,
    /// A probability or its error is not a number in [0, 1].
    NotAProbability {
        /// The bin, counted from 0.
        bin: usize,
    },
    /// The probabilities are not known well enough for so many samples.
    Unresolved {
        /// The noncentrality that their errors may cause.
        lambda: f64,
        /// The largest that is allowed.
        limit: f64,
    },
    /// A bin expects too few samples.
    Thin {
        /// The bin, counted from 0.
        bin: usize,
        /// Expected count of the bin.
        expected: f64,
    },
    /// The probabilities do not sum to 1.
    NotNormalised {
        /// Sum over the bins.
        sum: f64,
        /// How far from 1 their errors allow it to be.
        bound: f64,
    },
    /// All values are equal: a mean without an error cannot be tested by its error.
    NoSpread,
    /// Too skewed for so few values.
    Skewed {
        /// |skewness| / sqrt(n).
        skew: f64,
    },
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Refusal::Empty => write!(f, "no samples, or fewer than two bins that can hold any"),
            Refusal::NotAProbability { bin } => {
                write!(f, "the mass of bin {bin} or its error is not in [0, 1]")
            }
            Refusal::Unresolved { lambda, limit } => write!(
                f,
                "the expected masses are not resolved: their errors shift the statistic by {lambda:.3e}, \
                 more than {limit:.3e}; refine the quadrature or test with fewer samples"
            ),
            Refusal::Thin { bin, expected } => write!(
                f,
                "bin {bin} expects {expected:.3} samples, fewer than {LEAST_EXPECTED}; merge it with a \
                 neighbour or draw more"
            ),
            Refusal::NotNormalised { sum, bound } => write!(
                f,
                "the expected masses sum to {sum:.15}, further from 1 than their errors allow ({bound:.1e})"
            ),
            Refusal::NoSpread => write!(f, "all values are equal"),
            Refusal::Skewed { skew } => write!(
                f,
                "too skewed for so few values: |skewness| / sqrt(n) is {skew:.3}, more than {LARGEST_SKEW}"
            ),
        }
    }
}

/// One bin of a goodness-of-fit test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bin {
    /// Probability of the bin.
    pub mass: f64,
    /// A bound of the error of `mass`; 0 with `mass` 0 for a bin that nothing may enter.
    pub error: f64,
    /// The samples that fell into it.
    pub count: u64,
}

/// The outcome of a chi-square test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Goodness {
    /// Pearson's X2; infinite where an impossible bin was entered.
    pub statistic: f64,
    /// Degrees of freedom: the possible bins less one.
    pub dof: f64,
    /// P(X2 at least as large); 0 where an impossible bin was entered.
    pub p_value: f64,
    /// The largest noncentrality that errors of the expectations cause.
    pub lambda_err: f64,
    /// Number of samples in all bins.
    pub samples: u64,
}

/// The smallest defect that a chi-square test finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Detectable {
    /// Its noncentrality, N sum (q_i - p_i)^2 / p_i for true probabilities q_i.
    pub lambda: f64,
    /// r = sqrt(lambda / N): the defect as a relative error of the density by +-r everywhere.
    pub relative: f64,
}

impl Goodness {
    /// The defect that is rejected at `level` with probability `power`.
    pub(crate) fn detectable(&self, level: f64, power: f64) -> Detectable {
        let lambda = noncentrality(self.dof, level, power);
        Detectable { lambda, relative: (lambda / self.samples as f64).sqrt() }
    }
}

/// Pearson's chi-square test of counts against the bins' masses.
///
/// # Errors
///
/// Every [`Refusal`] except those of means. A sample in an impossible bin is an outcome and comes first.
pub(crate) fn pearson(bins: &[Bin]) -> Result<Goodness, Refusal> {
    let is_probability = |x: f64| (0.0..=1.0).contains(&x);
    if let Some(bin) = bins.iter().position(|c| !is_probability(c.mass) || !is_probability(c.error)) {
        return Err(Refusal::NotAProbability { bin });
    }
    let samples: u64 = bins.iter().map(|c| c.count).sum();
    let n = samples as f64;
    let is_possible = |c: &&Bin| c.mass > 0.0 || c.error > 0.0;
    let possible = || bins.iter().filter(is_possible);
    let dof = possible().count() as f64 - 1.0;
    let lambda_err: f64 = n * possible().map(|c| c.error * c.error / c.mass).sum::<f64>();
    if bins.iter().any(|c| !is_possible(&c) && c.count > 0) {
        return Ok(Goodness { statistic: f64::INFINITY, dof, p_value: 0.0, lambda_err, samples });
    }
    if samples == 0 || dof < 1.0 {
        return Err(Refusal::Empty);
    }
    let sum: f64 = bins.iter().map(|c| c.mass).sum();
    let rounding = bins.len() as f64 * f64::EPSILON;
    let bound = bins.iter().map(|c| c.error).sum::<f64>() + rounding;
    if (sum - 1.0).abs() > bound {
        return Err(Refusal::NotNormalised { sum, bound });
    }
    let thin = bins.iter().position(|c| is_possible(&c) && n * c.mass < LEAST_EXPECTED);
    if let Some(bin) = thin {
        return Err(Refusal::Thin { bin, expected: n * bins[bin].mass });
    }
    resolved(lambda_err, dof)?;
    let term = |c: &Bin| (c.count as f64 - n * c.mass) * (c.count as f64 - n * c.mass) / (n * c.mass);
    let statistic = possible().map(term).sum();
    Ok(Goodness { statistic, dof, p_value: chi_square_sf(statistic, dof), lambda_err, samples })
}

fn resolved(lambda: f64, dof: f64) -> Result<(), Refusal> {
    let limit = LARGEST_SHIFT * (2.0 * dof).sqrt();
    // A NaN is refused too.
    if lambda <= limit { Ok(()) } else { Err(Refusal::Unresolved { lambda, limit }) }
}

/// The outcome of a test of one probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Proportion {
    /// Number of successes.
    pub count: u64,
    /// Number of trials.
    pub samples: u64,
    /// The probability under test.
    pub mass: f64,
    /// Exact, two-sided: twice the smaller tail.
    pub p_value: f64,
}

/// The exact two-sided binomial test of `count` of `samples` against the probability `mass`, known
/// within `error`: the mass of a discrete direction, or of failed samples. A mass of 0 or 1 is refuted
/// by a single sample on the wrong side.
///
/// # Errors
///
/// [`Refusal::Empty`] without samples, [`Refusal::NotAProbability`], [`Refusal::Unresolved`] where
/// N error^2 / (p q) exceeds the bound that [`pearson`] sets for its two bins.
pub(crate) fn proportion(
    count: u64,
    samples: u64,
    mass: f64,
    error: f64,
) -> Result<Proportion, Refusal> {
    let is_probability = |x: f64| (0.0..=1.0).contains(&x);
    if !is_probability(mass) || !is_probability(error) {
        return Err(Refusal::NotAProbability { bin: 0 });
    }
    if samples == 0 || count > samples {
        return Err(Refusal::Empty);
    }
    if error > 0.0 {
        resolved(samples as f64 * error * error / (mass * (1.0 - mass)), 1.0)?;
    }
    Ok(Proportion { count, samples, mass, p_value: binomial_two_sided(count, samples, mass) })
}

impl Proportion {
    /// The nearest probabilities below and above that are rejected at `level` with probability `power`;
    /// 0 or 1 where there is none on that side.
    pub(crate) fn detectable(&self, level: f64, power: f64) -> (f64, f64) {
        let (n, p) = (self.samples, self.mass);
        // Rejected: counts up to `low` - 1, and from `high` on.
        let low = first(n + 1, |k| 2.0 * binomial_lower(k, n, p) > level);
        let high = first(n + 1, |k| 2.0 * binomial_upper(k, n, p) <= level);
        let below = match low {
            0 => 0.0,
            low => bisect(|q| binomial_lower(low - 1, n, q) >= power, 0.0, p),
        };
        let above = match high {
            high if high > n => 1.0,
            high => bisect(|q| binomial_upper(high, n, q) < power, p, 1.0),
        };
        (below, above)
    }
}

/// The first k in [0, end) with `holds(k)`, which holds from some k on; `end` where it never does.
fn first(end: u64, holds: impl Fn(u64) -> bool) -> u64 {
    let (mut low, mut high) = (0, end);
    while low < high {
        let middle = low + (high - low) / 2;
        if holds(middle) { high = middle } else { low = middle + 1 }
    }
    low
}

/// A test with one degree of freedom of a mean against its known value: the mean cosine, of cos(2 phi),
/// of the forward half. The cheapest test, in samples, of a defect that moves the mean.
///
/// `values` are the moments of independent values of bounded spread, `expected` their mean by quadrature
/// and a bound of its error. Student's t with n - 1 degrees of freedom.
///
/// # Errors
///
/// [`Refusal::Empty`] below two values, [`Refusal::NoSpread`], [`Refusal::Skewed`] (above
/// [`LARGEST_SKEW`]), [`Refusal::Unresolved`] where the error's noncentrality n error^2 / s^2 exceeds
/// its bound.
pub(crate) fn contrast(values: &Moments, expected: f64, error: f64) -> Result<ContrastTest, Refusal> {
    if values.n < 2 {
        return Err(Refusal::Empty);
    }
    if values.m2 == 0.0 {
        return Err(Refusal::NoSpread);
    }
    let n = values.n as f64;
    let skew = values.skewness().abs() / n.sqrt();
    if skew.is_nan() || skew > LARGEST_SKEW {
        return Err(Refusal::Skewed { skew });
    }
    let shift = error / values.std_error();
    let lambda_err = shift * shift;
    resolved(lambda_err, 1.0)?;
    let estimate =
        Estimate { value: values.mean - expected, std_error: values.std_error(), dof: n - 1.0 };
    Ok(ContrastTest { estimate, test: estimate.test_zero(), lambda_err })
}

/// The outcome of [`contrast`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ContrastTest {
    /// The difference from the expected mean; its `detectable` is the contrast's.
    pub estimate: Estimate,
    /// Statistic, degrees of freedom and p-value.
    pub test: Test,
    /// The largest noncentrality that the error of the expectation causes.
    pub lambda_err: f64,
}

#[cfg(test)]
mod tests {
    use super::super::tails::chi_square_critical;
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a:e} is not {b:e}");
    }

    fn bins(masses: &[f64], counts: &[u64]) -> Vec<Bin> {
        masses
            .iter()
            .zip(counts)
            .map(|(mass, count)| Bin { mass: *mass, error: 0.0, count: *count })
            .collect()
    }

    // scipy 1.x: chisquare([120, 90, 190], [100, 100, 200]); an impossible bin stays out.
    #[test]
    fn pearson_is_pearsons() {
        let found = pearson(&bins(&[0.25, 0.25, 0.5, 0.0], &[120, 90, 190, 0])).expect("a test");
        assert_eq!((found.dof, found.samples), (2.0, 400));
        close(found.statistic, 5.5, 1e-14);
        close(found.p_value, 0.06392786120670757, 1e-12);
    }

    #[test]
    fn void_tests_are_refused() {
        let good = bins(&[0.25, 0.75], &[120, 280]);
        assert!(pearson(&good).is_ok());
        let refusal = |change: fn(&mut Vec<Bin>)| {
            let mut bins = good.clone();
            change(&mut bins);
            pearson(&bins).expect_err("a refusal")
        };
        assert!(matches!(refusal(|c| c[0].mass = 0.26), Refusal::NotNormalised { .. }));
        assert!(matches!(refusal(|c| c[0].mass = f64::NAN), Refusal::NotAProbability { bin: 0 }));
        assert!(matches!(refusal(|c| c[1].error = -1.0), Refusal::NotAProbability { bin: 1 }));
        // N d^2 (1/p + 1/q) = 400 * 1e-4 * 5.33 > 0.02 sqrt 2; a tenth of the error is enough.
        assert!(matches!(
            refusal(|c| (c[0].error, c[1].error) = (0.01, 0.01)),
            Refusal::Unresolved { .. }
        ));
        let mut resolved = good.clone();
        (resolved[0].error, resolved[1].error) = (0.001, 0.001);
        close(pearson(&resolved).expect("a test").lambda_err, 400.0 * 1e-6 * (4.0 + 4.0 / 3.0), 1e-12);
        // A mass of 0 that is only known within an error is thin, not impossible.
        let push = |c: &mut Vec<Bin>| c.push(Bin { mass: 0.0, error: 1e-9, count: 0 });
        assert!(matches!(refusal(push), Refusal::Thin { bin: 2, .. }));
        let thin = bins(&[0.06, 0.94], &[24, 376]);
        assert!(matches!(pearson(&thin), Err(Refusal::Thin { bin: 0, .. })));
        assert_eq!(pearson(&[]), Err(Refusal::Empty));
        assert_eq!(pearson(&bins(&[1.0], &[400])), Err(Refusal::Empty));
        assert_eq!(pearson(&bins(&[0.5, 0.5], &[0, 0])), Err(Refusal::Empty));
    }

    #[test]
    fn one_sample_where_none_can_be_is_a_failure() {
        // Before any other refusal of the test.
        for masses in [[0.5, 0.5, 0.0], [0.01, 0.99, 0.0]] {
            let found = pearson(&bins(&masses, &[100, 100, 1])).expect("a verdict");
            assert_eq!((found.p_value, found.statistic), (0.0, f64::INFINITY));
        }
    }

    // scipy 1.x: root of ncx2.sf(chi2.isf(level, dof), dof, lambda) = 0.99.
    #[test]
    fn detectable_defects() {
        for (dof, at_1e4, at_1e6) in [
            (1.0, 38.65033998511294, 52.099326945024835),
            (15.0, 64.30682792873579, 80.81523155590074),
            (63.0, 99.66064204380491, 121.7966824988955),
            (255.0, 168.9513435490755, 202.75319233784822),
            (1023.0, 306.3907222521027, 363.65585926478735),
        ] {
            let goodness =
                Goodness { statistic: 0.0, dof, p_value: 1.0, lambda_err: 0.0, samples: 1_000_000 };
            close(goodness.detectable(1e-4, 0.99).lambda, at_1e4, 1e-8);
            let found = goodness.detectable(1e-6, 0.99);
            close(found.lambda, at_1e6, 1e-8);
            close(found.relative, (at_1e6 / 1e6).sqrt(), 1e-8);
        }
    }

    #[test]
    fn proportions() {
        // Three fair coins, by hand.
        close(proportion(3, 3, 0.5, 0.0).expect("a test").p_value, 0.25, 1e-15);
        assert_eq!(proportion(1, 1_000_000, 0.0, 0.0).expect("a test").p_value, 0.0);
        assert_eq!(proportion(0, 1_000_000, 0.0, 0.0).expect("a test").p_value, 1.0);
        assert_eq!(proportion(999_999, 1_000_000, 1.0, 0.0).expect("a test").p_value, 0.0);
        assert_eq!(proportion(0, 0, 0.5, 0.0), Err(Refusal::Empty));
        assert!(matches!(proportion(1, 10_000, 0.3, 0.01), Err(Refusal::Unresolved { .. })));
        assert!(matches!(proportion(1, 10_000, 0.0, 1e-9), Err(Refusal::Unresolved { .. })));
        assert!(matches!(proportion(1, 10_000, f64::NAN, 0.0), Err(Refusal::NotAProbability { .. })));
    }

    // The detectable masses are rejected with the power that they are defined by, and no closer ones: by
    // the normal approximation (z(1e-6) + z(0.99)) sd away, which a million trials follow within 1 %.
    #[test]
    fn detectable_proportions() {
        let test = proportion(300_000, 1_000_000, 0.3, 0.0).expect("a test");
        let (below, above) = test.detectable(1e-6, 0.99);
        let sd = (0.3f64 * 0.7 / 1e6).sqrt();
        close(above - 0.3, (4.891638 + 2.326348) * sd, 1e-2);
        close(0.3 - below, (4.891638 + 2.326348) * sd, 1e-2);
        let none = proportion(0, 1000, 0.0, 0.0).expect("a test");
        // One sample in 1000 refutes 0: 1 - (1 - q)^1000 = 0.99.
        close(none.detectable(1e-6, 0.99).1, 1.0 - 0.01f64.powf(1e-3), 1e-9);
    }

    // scipy 1.x: ttest_1samp([1, 2.5, 3.25, 0.5, 9, 4, 4.5], 3.0), twenty times over.
    #[test]
    fn contrasts() {
        let mut values = Moments::default();
        (0..20).for_each(|_| [1.0, 2.5, 3.25, 0.5, 9.0, 4.0, 4.5].iter().for_each(|x| values.push(*x)));
        let found = contrast(&values, 3.0, 0.0).expect("a test");
        close(found.test.statistic, found.estimate.value / found.estimate.std_error, 1e-14);
        close(found.test.statistic, (15.0 / 28.0) / (values.variance() / 140.0).sqrt(), 1e-12);
        assert_eq!(found.test.dof, 139.0);
        assert!(matches!(contrast(&values, 3.0, 0.1), Err(Refusal::Unresolved { .. })));
        let mut spike = Moments::default();
        (0..1000).for_each(|i| spike.push(if i == 0 { 1.0 } else { 0.0 }));
        assert!(matches!(contrast(&spike, 0.001, 0.0), Err(Refusal::Skewed { .. })));
        let mut equal = Moments::default();
        (0..10).for_each(|_| equal.push(0.1));
        assert_eq!(contrast(&equal, 0.1, 0.0), Err(Refusal::NoSpread));
        assert_eq!(contrast(&Moments::of(1.0), 1.0, 0.0), Err(Refusal::Empty));
    }

    // Doses: the detectable defect, a density wrong by +-r in alternate bins, has the stated
    // noncentrality, so that counts at their expectations under it exceed the critical value by about
    // lambda.
    #[test]
    fn the_detectable_defect_is_rejected() {
        let (n, k) = (1_000_000.0, 64);
        let flat = |r: f64| -> Vec<Bin> {
            let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
            let count = |i| (n / k as f64 * (1.0 + sign(i) * r)).round() as u64;
            (0..k).map(|i| Bin { mass: 1.0 / k as f64, error: 0.0, count: count(i) }).collect()
        };
        let sham = pearson(&flat(0.0)).expect("a test");
        let defect = sham.detectable(1e-6, 0.99);
        let found = pearson(&flat(defect.relative)).expect("a test");
        close(found.statistic, defect.lambda, 1e-2);
        // Under the defect the statistic's mean is dof + lambda.
        assert!(found.statistic + found.dof > chi_square_critical(1e-6, found.dof));
    }
}
