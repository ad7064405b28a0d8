//! Tests of values against one fully specified continuous distribution: Kolmogorov-Smirnov, Kuiper and
//! Anderson-Darling, of u = F(x), which is uniform under the hypothesis.
//!
//! Which one: Kolmogorov-Smirnov sees a shift of the middle, Anderson-Darling (which weights by
//! 1 / (u (1 - u))) the tails too, where errors of a distance sampler sit, and Kuiper is for angles, because it
//! does not depend on where the circle is cut. None of them tells *where* a distribution is wrong: bins do.
//!
//! The p-values of Kuiper and of Anderson-Darling are those of the limit of many values; at 1000 values they are
//! uniform as far as 4000 runs can tell (`tests/calibration.rs`). How well they hold far below 1e-4 at
//! finite n is not known here, so a decision at 1e-6 should rest on bins.

use std::f64::consts::PI;

use super::goodness::Refusal;
use super::hypothesis::Test;
use super::tails::kolmogorov_smirnov;
use crate::math::{cos, exp, ln, ln_1p};

/// The fewest values.
pub const FEWEST: usize = 100;

/// Sorted u = F(x).
#[derive(Clone, Debug, PartialEq)]
pub struct Sorted(Vec<f64>);

impl Sorted {
    /// From u in any order.
    ///
    /// # Errors
    ///
    /// [`Refusal::Empty`] below [`FEWEST`] values, [`Refusal::NotAProbability`] (with the place of the value)
    /// where one is not in [0, 1].
    pub fn new(mut values: Vec<f64>) -> Result<Sorted, Refusal> {
        if let Some(bin) = values.iter().position(|u| !(0.0..=1.0).contains(u)) {
            return Err(Refusal::NotAProbability { bin });
        }
        if values.len() < FEWEST {
            return Err(Refusal::Empty);
        }
        values.sort_by(f64::total_cmp);
        Ok(Sorted(values))
    }

    /// The largest distances of the empirical distribution above and below the uniform one.
    fn distances(&self) -> (f64, f64) {
        let n = self.0.len() as f64;
        let ranked = || self.0.iter().enumerate().map(|(i, u)| (i as f64, *u));
        let above = ranked().map(|(i, u)| (i + 1.0) / n - u).fold(0.0, f64::max);
        let below = ranked().map(|(i, u)| u - i / n).fold(0.0, f64::max);
        (above, below)
    }

    /// Kolmogorov-Smirnov: the statistic is the largest distance D.
    pub fn kolmogorov_smirnov(&self) -> Test {
        let (above, below) = self.distances();
        let statistic = above.max(below);
        let p_value = kolmogorov_smirnov(statistic, self.0.len() as u64);
        Test { statistic, dof: f64::INFINITY, p_value }
    }

    /// Kuiper: the statistic V = D+ + D- is the same wherever the circle is cut. Its limit is taken at
    /// (sqrt(n) + 0.155 + 0.24 / sqrt(n)) V (M. Stephens, "Use of the Kolmogorov-Smirnov, Cramer-von Mises and
    /// related statistics without extensive tables" (1970)).
    pub fn kuiper(&self) -> Test {
        let (above, below) = self.distances();
        let (statistic, root) = (above + below, (self.0.len() as f64).sqrt());
        let p_value = kuiper_limit((root + 0.155 + 0.24 / root) * statistic);
        Test { statistic, dof: f64::INFINITY, p_value }
    }

    /// Anderson-Darling: A^2 = -n - (1/n) sum (2i - 1) (ln u_i + ln(1 - u_(n+1-i))), i from 1. A value of exactly
    /// 0 or 1 makes it infinite and is a failure: u of few bits must stand at the middle of its step.
    pub fn anderson_darling(&self) -> Test {
        let n = self.0.len() as f64;
        let pairs = self.0.iter().zip(self.0.iter().rev()).enumerate();
        let sum: f64 =
            pairs.map(|(i, (low, high))| (2.0 * i as f64 + 1.0) * (ln(*low) + ln_1p(-high))).sum();
        let statistic = -n - sum / n;
        Test { statistic, dof: f64::INFINITY, p_value: anderson_darling_limit(statistic) }
    }
}

/// P(K > x) for the limit of Kuiper's sqrt(n) V: 2 sum (4 k^2 x^2 - 1) exp(-2 k^2 x^2), which below x = 0.4 is 1
/// to 15 digits (N. Kuiper 1960).
pub fn kuiper_limit(x: f64) -> f64 {
    if x < 0.4 {
        return 1.0;
    }
    let term = |k: f64| 2.0 * (4.0 * k * k * x * x - 1.0) * exp(-2.0 * k * k * x * x);
    (1..=12).rev().map(|k| term(f64::from(k))).sum::<f64>().min(1.0)
}

/// P(A^2 > z) for the limit of Anderson and Darling's A^2, relative error below 1e-9 for z >= 0.2.
///
/// The limit is the law of sum Z_j^2 / (j (j + 1)) with standard normal Z_j (T. Anderson, D. Darling 1952). For such
/// sums N. Smirnov (1937) has
///   P(A^2 > z) = (1/pi) sum_k (-1)^(k+1) int e^(-z y / 2) / (y sqrt(-D(y))) dy over y from a_(2k-1) to a_2k,
/// with a_j = j (j + 1) and D(y) = prod (1 - y / a_j) = -cos((pi/2) sqrt(1 + 4 y)) / (pi y) here. All terms keep
/// their digits in the tail, and the first alone is the answer there. D has simple zeros at both ends of an
/// interval: with y = m - h cos(t) the integrand is smooth and periodic in t, for which the midpoint rule
/// converges geometrically. Below z = 0.2 (p > 0.99) the sum would need many intervals; there the complement is
/// taken from the fit of Marsaglia and Marsaglia (2004), good to 2e-6.
pub fn anderson_darling_limit(z: f64) -> f64 {
    if z.is_nan() {
        return f64::NAN;
    }
    if z < 0.2 {
        if z <= 0.0 {
            return 1.0;
        }
        let fit = [2.00012, 0.247105, -0.0649821, 0.0347962, -0.011672, 0.00168691];
        let polynomial = fit.iter().rev().fold(0.0, |sum, c| sum * z + c);
        return 1.0 - exp(-1.2337141 / z) / z.sqrt() * polynomial;
    }
    const POINTS: u32 = 64;
    let mut sum = 0.0;
    for k in (1..=14).rev() {
        let end = |j: f64| j * (j + 1.0);
        let (low, high) = (end(2.0 * f64::from(k) - 1.0), end(2.0 * f64::from(k)));
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let mut integral = 0.0;
        for i in 0..POINTS {
            let angle = PI * (f64::from(i) + 0.5) / f64::from(POINTS);
            let y = middle - half * cos(angle);
            let minus_d = cos(0.5 * PI * (1.0 + 4.0 * y).sqrt()) / (PI * y);
            let dy = half * crate::math::sin(angle);
            integral += exp(-0.5 * z * y) / (y * minus_d.abs().sqrt()) * dy;
        }
        sum += if k % 2 == 1 { integral } else { -integral };
    }
    sum / f64::from(POINTS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a:e} is not {b:e}");
    }

    // mpmath, 50 digits: 1 - the series of Anderson and Darling (1952), which is another formula; 0.1 %
    // and 5 % points as tabulated. The last digits of the tail are those of 1 - cdf at 50 digits.
    #[test]
    fn the_limit_of_anderson_darling() {
        for (z, p) in [
            (0.25, 0.970393327478375),
            (0.5, 0.746814373530344),
            (1.0, 0.357266673214019),
            (1.9329578327416, 0.0999999999999992),
            (2.492367, 0.0500000096690149),
            (3.878, 0.0100014098845005),
            (6.0, 0.000967451941520923),
            (8.0, 0.000113814155726583),
            (12.0, 1.71028699932212e-6),
            (16.0, 2.72054896666912e-8),
            (20.0, 4.46507153831192e-10),
            (26.0, 9.72472965251874e-13),
        ] {
            close(anderson_darling_limit(z), p, 1e-9);
        }
        // The two formulas meet.
        assert!((anderson_darling_limit(0.2 - 1e-12) - anderson_darling_limit(0.2)).abs() < 2e-6);
        assert_eq!((anderson_darling_limit(0.0), anderson_darling_limit(f64::INFINITY)), (1.0, 0.0));
    }

    // mpmath, 50 digits, 200 terms.
    #[test]
    fn the_limit_of_kuiper() {
        for (x, p) in [
            (0.5, 0.999_999_470_519_211_9),
            (0.8, 0.978_351_074_995_650_9),
            (1.2, 0.5348406352935141),
            (1.747, 0.050074681853745285),
            (2.5, 1.788_793_522_597_762_5e-4),
            (4.0, 1.595_684_859_185_866e-12),
            (6.0, 1.538_733_241_766_045_6e-29),
        ] {
            close(kuiper_limit(x), p, 1e-12);
        }
    }

    fn grid(shift: impl Fn(f64) -> f64) -> Sorted {
        Sorted::new((0..1000).map(|i| shift((f64::from(i) + 0.5) / 1000.0)).collect()).expect("enough")
    }

    // By hand on the midpoints of a grid: D = 1/(2n), V = 1/n, and a rotation leaves V where it is. A^2 of two
    // values by its formula.
    #[test]
    fn statistics() {
        let flat = grid(|u| u);
        close(flat.kolmogorov_smirnov().statistic, 0.0005, 1e-9);
        close(flat.kuiper().statistic, 0.001, 1e-9);
        assert!(flat.anderson_darling().p_value > 0.999 && flat.kuiper().p_value > 0.999);
        let turned = grid(|u| (u + 0.3).fract());
        close(turned.kuiper().statistic, 0.001, 1e-9);
        let cut = grid(|u| u * u);
        assert!(cut.kolmogorov_smirnov().p_value < 1e-30 && cut.anderson_darling().p_value < 1e-30);
        let two = Sorted(vec![0.2, 0.7]).anderson_darling().statistic;
        let by_hand = -2.0 - 0.5 * (0.2f64.ln() + 0.3f64.ln() + 3.0 * (0.7f64.ln() + 0.8f64.ln()));
        close(two, by_hand, 1e-13);
    }

    // 20 of 1000 values pushed far into the tail move the distance by 0.02 only, but A^2 by
    // 400 ln(1e9) / 1000 = 8.3 (400 is the sum of their weights 2i - 1), less 0.4: their ln u, of weights near
    // 2 n, rise from -0.01 on average to 0.
    #[test]
    fn anderson_darling_sees_tails() {
        let heavy = grid(|u| if u > 0.98 { 1.0 - (1.0 - u) * 1e-9 } else { u });
        assert!(heavy.kolmogorov_smirnov().p_value > 0.5);
        close(heavy.anderson_darling().statistic, 7.9, 0.01);
        assert!(heavy.anderson_darling().p_value < 2e-4);
        let zero = grid(|u| if u < 0.001 { 0.0 } else { u });
        assert_eq!(zero.anderson_darling().p_value, 0.0);
    }

    #[test]
    fn what_is_no_probability_is_refused() {
        assert_eq!(Sorted::new(vec![0.5; 99]), Err(Refusal::Empty));
        let mut values = vec![0.5; 100];
        values[7] = f64::NAN;
        assert_eq!(Sorted::new(values), Err(Refusal::NotAProbability { bin: 7 }));
    }
}
