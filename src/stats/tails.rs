//! Survival functions, in one place, and their inverses by bisection.
//!
//! A probability is always computed directly as the tail that is needed: at the levels of tests, 1 - cdf has
//! no correct digits. Chi-square comes from `statrs` (relative error about 1e-15 times the degrees of
//! freedom); everything else is here, because the incomplete beta function of statrs 0.19.1 loses digits
//! for large parameters (binomial tails beyond n = 1e7, Student's t at 1e6 degrees of freedom) and its
//! centre is wrong from 1e5 on. Tests compare each tail with the table `tests/data/tails.csv` (20 digits,
//! `scripts/tails.py`) to a relative 1e-8.

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::math::{self, exp, ln, ln_1p};

/// P(|Z| > |z|) for a standard normal Z.
pub(crate) fn normal_two_sided(z: f64) -> f64 {
    math::erfc(z.abs() * FRAC_1_SQRT_2)
}

/// P(|T| > |t|) for Student's T; the normal at infinitely many degrees of freedom.
///
/// With r = t / sqrt(dof), h = 1 / (1 + r^2) and a = dof/2 this is the incomplete beta function
/// I_h(a, 1/2) = 1 - I_(1-h)(1/2, a), each by its continued fraction where that converges fast. h and
/// 1 - h are both formed from r: next to the centre 1 - h has no digits left in h.
pub(crate) fn student_two_sided(t: f64, dof: f64) -> f64 {
    if dof == f64::INFINITY {
        return normal_two_sided(t);
    }
    let (a, r) = (0.5 * dof, t.abs() / dof.sqrt());
    // Written so that a NaN is refused too.
    if !(dof > 0.0 && r >= 0.0) {
        return f64::NAN;
    }
    if r == 0.0 {
        return 1.0;
    }
    let s = 1.0 / r;
    // ln h, h and 1 - h, of r below 1 and above.
    let (ln_h, h, rest) = if r < 1.0 {
        let r2 = r * r;
        (-ln_1p(r2), 1.0 / (1.0 + r2), r2 / (1.0 + r2))
    } else {
        let s2 = s * s;
        (2.0 * ln(s) - ln_1p(s2), s2 / (1.0 + s2), 1.0 / (1.0 + s2))
    };
    // h^a (1 - h)^(1/2) / B(a, 1/2), B(a, 1/2) = Gamma(a) sqrt(pi) / Gamma(a + 1/2).
    let front = exp(a * ln_h) * (rest / PI).sqrt() * gamma_half_step(a);
    if h < (a + 1.0) / (a + 2.5) {
        front * beta_fraction(a, 0.5, h) / a
    } else {
        1.0 - front * beta_fraction(0.5, a, rest) * 2.0
    }
}

/// Gamma(a + 1/2) / Gamma(a), by Stirling's formula with its remainder s: both have the factor
/// sqrt(2 pi), and (a + 1/2)^(a + 1/2) / a^a = sqrt(a + 1/2) (1 + 1/(2a))^a.
fn gamma_half_step(a: f64) -> f64 {
    let remainders = stirling_remainder(a + 0.5) - stirling_remainder(a);
    a.sqrt() * exp(a * ln_1p(0.5 / a) - 0.5 + remainders)
}

/// The continued fraction of a B(a, b) I_x(a, b) / (x^a (1-x)^b), which converges fast for
/// x < (a + 1) / (a + b + 2): NIST Digital Library of Mathematical Functions, 8.17.22, by the method of
/// Lentz, as modified by Thompson and Barnett.
fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    let nonzero = |y: f64| if y.abs() < 1e-300 { 1e-300 } else { y };
    let (mut c, mut d, mut fraction) = (f64::INFINITY, 1.0, 1.0);
    // The partial numerators d_1, d_2, ... of 1 / (1 + d_1 / (1 + d_2 / ...)).
    for i in 1..10_000 {
        let m = f64::from(i / 2);
        let numerator = if i % 2 == 0 {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        };
        d = 1.0 / nonzero(1.0 + numerator * d);
        c = nonzero(1.0 + numerator / c);
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-16 {
            break;
        }
    }
    fraction
}

/// P(X > x) for a chi-square X.
pub fn chi_square_sf(x: f64, dof: f64) -> f64 {
    ChiSquared::new(dof).map_or(f64::NAN, |d| d.sf(x))
}

// Binomial and Poisson probabilities: C. Loader, "Fast and accurate computation of binomial
// probabilities" (2000). Stirling's formula with its remainder s,
//   n! = sqrt(2 pi n) (n/e)^n e^s(n),
// turns C(n, k) p^k q^(n-k) into sqrt(n / (2 pi k (n-k))) exp(s(n) - s(k) - s(n-k) - D(k, np) - D(n-k,
// nq)), where D(x, m) = x ln(x/m) + m - x >= 0 is the deviance. No large numbers cancel: the exponent's
// error is a rounding of the exponent itself.

/// s(n) = ln n! - ln(sqrt(2 pi n) (n/e)^n), for real n > 0. Six terms of its asymptotic series are good
/// to 2e-16 at 15.
fn stirling_remainder(n: f64) -> f64 {
    if n < 15.0 {
        return math::ln_gamma(n + 1.0) - (n + 0.5) * ln(n) + n - 0.5 * ln(TAU);
    }
    let n2 = n * n;
    let terms =
        [1.0 / 12.0, -1.0 / 360.0, 1.0 / 1260.0, -1.0 / 1680.0, 1.0 / 1188.0, -691.0 / 360_360.0];
    terms.iter().rev().fold(0.0, |sum, term| sum / n2 + term) / n
}

/// D(x, m) = x ln(x/m) + m - x for x, m > 0.
///
/// Near x = m, with v = (x - m) / (x + m), so that x/m = (1 + v)/(1 - v) and ln(x/m) = 2 atanh v:
/// D = (x - m) v + 2 x (v^3/3 + v^5/5 + ...).
fn deviance(x: f64, m: f64) -> f64 {
    let v = (x - m) / (x + m);
    if v.abs() > 0.1 {
        return x * ln(x / m) + m - x;
    }
    let (v2, mut sum, mut power, mut odd) = (v * v, 0.0, v, 1.0);
    loop {
        power *= v2;
        odd += 2.0;
        let next: f64 = sum + power / odd;
        if next == sum {
            return (x - m) * v + 2.0 * x * sum;
        }
        sum = next;
    }
}

/// m^x e^-m / Gamma(x + 1): the Poisson probability of x, continued to real x >= 0; m > 0.
fn poisson_pmf(x: f64, m: f64) -> f64 {
    if x == 0.0 {
        return exp(-m);
    }
    exp(-stirling_remainder(x) - deviance(x, m)) / (TAU * x).sqrt()
}

/// C(n, k) p^k q^(n-k), where q = 1 - p is given too: each of the two may carry the digits.
pub(super) fn binomial_pmf(k: u64, n: u64, p: f64, q: f64) -> f64 {
    let (x, y, m) = (k as f64, (n - k) as f64, n as f64);
    if k == 0 {
        return exp(m * if p < 0.5 { ln_1p(-p) } else { ln(q) });
    }
    if k == n {
        return exp(m * if q < 0.5 { ln_1p(-q) } else { ln(p) });
    }
    let exponent = stirling_remainder(m) - stirling_remainder(x) - stirling_remainder(y);
    exp(exponent - deviance(x, m * p) - deviance(y, m * q)) * (m / (TAU * x * y)).sqrt()
}

/// P(X >= k) for k > n p, 0 < p < 1: the pmf at the tail's edge times 1 + r1 + r1 r2 + ... with the
/// ratios (n - j) p / ((j + 1) q) of neighbouring probabilities. They fall with j and are below 1, so
/// what is left after a term is at most term r / (1 - r): the sum stops where that is below its
/// rounding. About 8 sqrt(n p q) terms next to the mean (4e6 at n = 1e12), a handful in the tail.
fn binomial_far_tail(k: u64, n: u64, p: f64, q: f64) -> f64 {
    let (odds, m) = (p / q, n as f64);
    let (mut term, mut sum, mut j) = (1.0, 1.0, k as f64);
    while j < m {
        let ratio = odds * (m - j) / (j + 1.0);
        term *= ratio;
        sum += term;
        if term * ratio < 1e-17 * sum * (1.0 - ratio) {
            break;
        }
        j += 1.0;
    }
    (binomial_pmf(k, n, p, q) * sum).min(1.0)
}

fn binomial_at_least(k: u64, n: u64, p: f64, q: f64) -> f64 {
    if k == 0 {
        return 1.0;
    }
    if k > n || p <= 0.0 {
        return 0.0;
    }
    if q <= 0.0 {
        return 1.0;
    }
    // On the mean's other side the complement is the smaller tail, and 1 minus it loses nothing.
    if k as f64 <= n as f64 * p {
        1.0 - binomial_far_tail(n - k + 1, n, q, p)
    } else {
        binomial_far_tail(k, n, p, q)
    }
}

/// P(X >= k) for a binomial X of n trials with probability p; any n up to 1e12.
pub(crate) fn binomial_upper(k: u64, n: u64, p: f64) -> f64 {
    binomial_at_least(k, n, p, 1.0 - p)
}

/// P(X <= k) for a binomial X of n trials with probability p; any n up to 1e12.
pub(crate) fn binomial_lower(k: u64, n: u64, p: f64) -> f64 {
    if k >= n { 1.0 } else { binomial_at_least(n - k, n, 1.0 - p, p) }
}

/// The exact two-sided p-value of k successes: twice the smaller tail, at most 1.
pub(crate) fn binomial_two_sided(k: u64, n: u64, p: f64) -> f64 {
    (2.0 * binomial_lower(k, n, p).min(binomial_upper(k, n, p))).min(1.0)
}

/// P(X > x) for a noncentral chi-square X: the expectation of the central tail at `dof` + 2 J degrees of
/// freedom over a Poisson J of mean `lambda` / 2.
///
/// With a = dof/2, y = x/2 and Q the central tail, Q(a + 1, y) = Q(a, y) + y^a e^-y / Gamma(a + 1):
/// upwards in J every operation adds positive numbers. Q grows with J, so the terms more than 9 standard
/// deviations below the mean of J are less than 1e-17 of the sum; Q <= 1 bounds those after the last.
pub(crate) fn noncentral_chi_square_sf(x: f64, dof: f64, lambda: f64) -> f64 {
    let (y, mean) = (0.5 * x, 0.5 * lambda);
    // Written so that a NaN is refused too.
    if !(dof > 0.0 && lambda >= 0.0 && y >= 0.0) {
        return f64::NAN;
    }
    if y == 0.0 || lambda == 0.0 {
        return chi_square_sf(x, dof);
    }
    let mut j = (mean - 9.0 * mean.sqrt() - 40.0).floor().max(0.0);
    let mut a = 0.5 * dof + j;
    let (mut q, mut weight, mut sum) = (chi_square_sf(x, 2.0 * a), poisson_pmf(j, mean), 0.0);
    let mut step = poisson_pmf(a, y);
    loop {
        sum += weight * q;
        q += step;
        a += 1.0;
        // A product has lost its digits before it underflows; the closed form has them again.
        step = if step < 1e-290 { poisson_pmf(a, y) } else { step * (y / a) };
        j += 1.0;
        weight *= mean / j;
        let ratio = mean / (j + 1.0);
        if ratio < 1.0 && weight <= 1e-17 * sum * (1.0 - ratio) {
            return sum.min(1.0);
        }
    }
}

/// The boundary in [low, high] where `is_below` turns from true to false, to a rounding.
pub(crate) fn bisect(is_below: impl Fn(f64) -> bool, low: f64, high: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    while high - low > 1e-14 * high.abs() {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if is_below(middle) { low = middle } else { high = middle }
    }
    high
}

/// As [`bisect`], on [0, infinity), for a boundary that exists.
fn bisect_up(is_below: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while high < f64::MAX && is_below(high) {
        (low, high) = (high, 2.0 * high);
    }
    bisect(is_below, low, high)
}

/// The t > 0 with P(|T| > t) = `level`; `level` in (0, 1].
pub fn critical_value(level: f64, dof: f64) -> f64 {
    bisect_up(|t| student_two_sided(t, dof) > level)
}

/// The x with P(X > x) = `level` for a chi-square X; `level` in (0, 1].
pub(crate) fn chi_square_critical(level: f64, dof: f64) -> f64 {
    bisect_up(|x| chi_square_sf(x, dof) > level)
}

/// The noncentrality at which a chi-square test of `level` rejects with probability `power`.
pub(crate) fn noncentrality(dof: f64, level: f64, power: f64) -> f64 {
    let critical = chi_square_critical(level, dof);
    bisect_up(|lambda| noncentral_chi_square_sf(critical, dof, lambda) < power)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::kolmogorov::{kolmogorov_limit, smirnov};
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a:e} is not {b:e}");
    }

    /// P(Z > z) for a standard normal Z.
    fn normal_upper(z: f64) -> f64 {
        0.5 * math::erfc(z * FRAC_1_SQRT_2)
    }

    /// P(T > t) for Student's T; the normal at infinitely many degrees of freedom.
    fn student_upper(t: f64, dof: f64) -> f64 {
        let half = 0.5 * student_two_sided(t, dof);
        if t < 0.0 { 1.0 - half } else { half }
    }

    /// The tail of a row of the table.
    fn tail(distribution: &str, a: f64, b: f64, statistic: f64) -> f64 {
        match distribution {
            "normal_two_sided" => normal_two_sided(statistic),
            "normal_upper" => normal_upper(statistic),
            "student_two_sided" => student_two_sided(statistic, a),
            "student_upper" => student_upper(statistic, a),
            "chi_square" => chi_square_sf(statistic, a),
            "binomial_upper" => binomial_upper(statistic as u64, a as u64, b),
            "binomial_lower" => binomial_lower(statistic as u64, a as u64, b),
            "kolmogorov_limit" => kolmogorov_limit(statistic),
            "smirnov" => smirnov(statistic, a as u64),
            "noncentral_chi_square" => noncentral_chi_square_sf(statistic, a, b),
            other => panic!("no tail for {other}"),
        }
    }

    /// Rows, worst relative error, and that among probabilities from 1e-12 on, of every distribution.
    type WorstErrors = BTreeMap<String, (usize, f64, f64)>;

    /// Reads every row of the table.
    fn worst_errors(tail: impl Fn(&str, f64, f64, f64) -> f64) -> WorstErrors {
        let table = include_str!("../../tests/data/tails.csv");
        let mut worst = WorstErrors::new();
        for line in table.lines().skip(1) {
            let (name, numbers) = line.split_once(',').expect("a distribution");
            let numbers: Vec<f64> = numbers.split(',').map(|x| x.parse().expect("a number")).collect();
            let [a, b, statistic, p] = numbers[..] else { panic!("{line}") };
            let found = tail(name, a, b, statistic);
            let error = (found / p - 1.0).abs();
            assert!(!error.is_nan(), "{line}: {found}");
            let entry = worst.entry(name.to_string()).or_default();
            entry.0 += 1;
            entry.1 = entry.1.max(error);
            entry.2 = if p >= 1e-12 { entry.2.max(error) } else { entry.2 };
        }
        worst
    }

    #[test]
    fn every_tail_agrees_with_the_table() {
        let worst = worst_errors(tail);
        for (name, (rows, all, from_1e12)) in &worst {
            println!(
                "{name}: {rows} rows, worst relative error {all:.1e}; from p = 1e-12 on {from_1e12:.1e}"
            );
        }
        assert_eq!(worst.len(), 10);
        assert!(worst.values().all(|(_, all, _)| *all <= 1e-8), "{worst:?}");
    }

    // The table detects its targets: a lost digit in the tail, a cdf taken from 1, a wrong edge.
    #[test]
    fn the_table_catches_planted_tails() {
        type Tail = fn(f64, f64, f64) -> f64;
        let defects: [(&str, Tail); 4] = [
            ("normal_upper", |_, _, z| 1.0 - normal_upper(-z)),
            ("student_two_sided", |dof, _, t| student_two_sided(t, dof + 1e-3)),
            ("binomial_upper", |n, p, k| binomial_upper(k as u64 + 1, n as u64, p)),
            ("noncentral_chi_square", |dof, l, x| noncentral_chi_square_sf(x, dof, l * (1.0 + 1e-6))),
        ];
        for (name, defect) in defects {
            let worst =
                worst_errors(|n, a, b, x| if n == name { defect(a, b, x) } else { tail(n, a, b, x) });
            assert!(worst[name].1 > 1e-8, "{name}: {:?}", worst[name]);
        }
    }

    // mpmath 40 digits: betainc(nu/2, 1/2, 0, nu/(nu + t^2), regularized=True).
    #[test]
    fn student_survival() {
        close(student_two_sided(2.0, 63.0), 0.04981576369904481, 1e-12);
        close(student_two_sided(-5.5, 63.0), 7.367567470776202e-07, 1e-12);
        close(student_two_sided(12.0, 127.0), 1.2065688250812803e-22, 1e-12);
        close(student_two_sided(40.0, 63.0), 1.6974279920901165e-46, 1e-12);
        close(student_two_sided(3.3, 10.5), 0.007516643641858988, 1e-12);
        assert!(student_two_sided(1.0, 0.0).is_nan());
    }

    // mpmath: erfc(z / sqrt(2)).
    #[test]
    fn normal_survival() {
        close(normal_two_sided(0.5), 0.6170750774519738, 1e-14);
        close(normal_two_sided(-1.96), 0.04999579029644087, 1e-14);
        close(normal_two_sided(4.9), 9.58366553180638e-07, 1e-13);
        close(normal_two_sided(30.0), 9.813427854296374e-198, 1e-12);
    }

    // mpmath: gammainc(k/2, x/2, inf, regularized=True).
    #[test]
    fn chi_square_survival() {
        close(chi_square_sf(90.0, 63.0), 0.014414544792022971, 1e-12);
        close(chi_square_sf(11.0, 12.0), 0.528918686525862, 1e-12);
        close(chi_square_sf(400.0, 63.0), 1.6839703370731965e-50, 1e-11);
        close(chi_square_sf(1.5, 1.0), 0.2206713619198468, 1e-12);
    }

    // By hand: three fair coins.
    #[test]
    fn small_binomials() {
        close(binomial_upper(2, 3, 0.5), 0.5, 1e-15);
        close(binomial_upper(3, 3, 0.5), 0.125, 1e-15);
        close(binomial_lower(0, 3, 0.5), 0.125, 1e-15);
        close(binomial_two_sided(3, 3, 0.5), 0.25, 1e-15);
        assert_eq!(binomial_two_sided(1, 3, 0.5), 1.0);
        assert_eq!((binomial_upper(0, 5, 0.0), binomial_upper(1, 5, 0.0)), (1.0, 0.0));
        assert_eq!((binomial_lower(5, 5, 1.0), binomial_lower(4, 5, 1.0)), (1.0, 0.0));
        assert_eq!(binomial_lower(0, 0, 0.3), 1.0);
    }

    // At n = 1e12 the normal with its Edgeworth correction knows the answer: by symmetry
    // P(X >= n/2) = 1/2 + pmf/2, and the two tails of any k overlap in one probability.
    #[test]
    fn binomials_of_a_million_million_trials() {
        let n = 1_000_000_000_000;
        let pmf = |k| binomial_pmf(k, n, 0.5, 0.5);
        close(binomial_upper(n / 2, n, 0.5), 0.5 + 0.5 * pmf(n / 2), 1e-10);
        close(pmf(n / 2), (2.0 / (PI * n as f64)).sqrt(), 1e-12);
        let k = n / 2 + 1_000_000;
        close(binomial_upper(k, n, 0.5) + binomial_lower(k - 1, n, 0.5), 1.0, 1e-12);
        // 2 standard deviations, half a count: relative z / (2 sd) * hazard.
        close(binomial_upper(k, n, 0.5), normal_upper((1_000_000.0 - 0.5) / 500_000.0), 1e-10);
    }

    #[test]
    fn inverses_invert() {
        for dof in [1.0, 15.0, 1023.0] {
            for level in [0.5, 1e-6, 1e-12] {
                close(student_two_sided(critical_value(level, dof), dof), level, 1e-10);
                close(chi_square_sf(chi_square_critical(level, dof), dof), level, 1e-10);
                let lambda = noncentrality(dof, level, 0.99);
                let power = noncentral_chi_square_sf(chi_square_critical(level, dof), dof, lambda);
                close(power, 0.99, 1e-10);
            }
        }
        assert!(student_two_sided(1.0, 0.0).is_nan() && chi_square_sf(1.0, -1.0).is_nan());
    }
}
