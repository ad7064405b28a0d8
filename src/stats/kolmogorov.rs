//! The Kolmogorov-Smirnov test of uniformity, with which the calibration tests p-values.

use std::f64::consts::{PI, TAU};

use super::tails::binomial_pmf;
use crate::math::exp;

/// The largest distance between the empirical distribution of values and the uniform one on [0, 1], and
/// its p-value; 20 values or more.
pub(crate) fn uniformity(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let ranked = || sorted.iter().enumerate().map(|(i, u)| (i as f64, *u));
    let above = ranked().map(|(i, u)| (i + 1.0) / n - u).fold(0.0, f64::max);
    let below = ranked().map(|(i, u)| u - i / n).fold(0.0, f64::max);
    let distance = above.max(below);
    (distance, kolmogorov_smirnov(distance, sorted.len() as u64))
}

/// P(K > x) for Kolmogorov's distribution, the limit of sqrt(n) D.
///
/// 2 sum (-1)^(k-1) exp(-2 k^2 x^2); for small x, by the transformation of the theta function,
/// 1 - sqrt(2 pi)/x sum exp(-(2k-1)^2 pi^2 / (8 x^2)) (W. Feller 1948).
pub(crate) fn kolmogorov_limit(x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    if x < 1.0 {
        let term = |k: f64| exp(-(k * PI / x) * (k * PI / x) / 8.0);
        return 1.0 - TAU.sqrt() / x * (term(1.0) + term(3.0) + term(5.0) + term(7.0));
    }
    let term = |k: f64| 2.0 * exp(-2.0 * k * k * x * x);
    term(1.0) - term(2.0) + term(3.0) - term(4.0) + term(5.0)
}

/// P(D+ >= d) for Smirnov's one-sided statistic of n independent values, exactly.
///
/// Z. Birnbaum, F. Tingey, "One-sided confidence contours for probability distribution functions"
/// (1951): d sum_j C(n, j) (d + j/n)^(j-1) (1 - d - j/n)^(n-j) over j <= n (1 - d): binomial
/// probabilities of j with p = d + j/n, each times d / p. All terms are positive.
pub(crate) fn smirnov(d: f64, n: u64) -> f64 {
    if d <= 0.0 {
        return 1.0;
    }
    let m = n as f64;
    let mut sum = 0.0;
    for j in 0..n {
        let p = d + j as f64 / m;
        let q = (1.0 - d) - j as f64 / m;
        if q <= 0.0 {
            break;
        }
        sum += binomial_pmf(j, n, p, q) * (d / p);
    }
    sum.min(1.0)
}

/// P(D >= d) for the two-sided Kolmogorov-Smirnov statistic of n independent values of a fully specified
/// continuous distribution; n >= 20.
///
/// From n d^2 = 4 on, twice the one-sided probability: both sides reach d with a probability of about
/// exp(-8 n d^2), so the relative error is about exp(-6 n d^2) <= 4e-11. Below (p > 6e-4), the limit at
/// x + 1/(6 sqrt(n)) + (x - 1)/(4 n), x = sqrt(n) d (J. Vrbik, "Small-sample corrections to
/// Kolmogorov-Smirnov test statistic" (2018)): within 5e-4 of the exact value at n = 20, 1.5e-4 at 100
/// and 2e-5 at 1000.
pub(crate) fn kolmogorov_smirnov(d: f64, n: u64) -> f64 {
    let root = (n as f64).sqrt();
    let x = root * d;
    if x >= 2.0 {
        return (2.0 * smirnov(d, n)).min(1.0);
    }
    kolmogorov_limit(x + 1.0 / (6.0 * root) + (x - 1.0) / (4.0 * n as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    // scipy 1.x, exact: kstwo.sf(d, n), with the stated error below n d^2 = 4.
    #[test]
    fn kolmogorov_smirnov_at_finite_n() {
        for (d, n, p, error) in [
            (0.111803, 20, 0.940331111310461, 5e-4),
            (0.178885, 20, 0.4890880369176859, 5e-4),
            (0.290689, 20, 0.05437596648008136, 5e-4),
            (0.402492, 20, 0.0019415598121073074, 5e-4),
            (0.447214, 20, 0.00036273384795459246, 4e-11 * 4e-4),
            (0.782624, 20, 1.7138802916583963e-13, 1e-24),
            (0.05, 100, 0.9532159710635725, 1.5e-4),
            (0.08, 100, 0.5182193645480672, 1.5e-4),
            (0.18, 100, 0.0026300498454605607, 1.5e-4),
            (0.25, 100, 5.408871776434847e-06, 1e-16),
            (0.031623, 1000, 0.26440178193924346, 2e-5),
            (0.056921, 1000, 0.002943763655322148, 2e-5),
            (0.079057, 1000, 6.9671355831871364e-06, 1e-16),
            (0.11068, 1000, 3.9977883250764165e-11, 1e-20),
        ] {
            let found = kolmogorov_smirnov(d, n);
            assert!((found - p).abs() < error, "{d} {n}: {found} is not {p}");
        }
    }
}
