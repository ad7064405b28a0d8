//! Inversion of monotone functions, and of the error function.

use super::{erf, erfc, exp, exp_m1, ln_1p};

/// The root of an increasing `f` in [lo, hi], where `f(lo) <= 0 <= f(hi)`: `f` gives value and slope;
/// Newton steps from `start`, bisection wherever a step leaves the bracket. Ends where a step moves x
/// by a rounding error, after which another would only wander among the last bits.
pub fn increasing_root(f: impl Fn(f64) -> (f64, f64), lo: f64, hi: f64, start: f64) -> f64 {
    let (mut lo, mut hi) = (lo, hi);
    let mut x = start.clamp(lo, hi);
    for _ in 0..200 {
        let (value, slope) = f(x);
        if value > 0.0 {
            hi = x;
        } else {
            lo = x;
        }
        let newton = x - value / slope;
        let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
        if (next - x).abs() <= 4.0 * f64::EPSILON * x.abs().max(f64::MIN_POSITIVE) || hi - lo <= 0.0 {
            return next;
        }
        x = next;
    }
    x
}

/// The root of `f`, which gives value and slope, in a bracket of size 1 or so in which its sign changes once, to rounding:
/// Newton's method from `start`, safeguarded by bisection where a step leaves the bracket or is not shorter than half the
/// one before. `f` need not be monotone; `is_rising` is the sense of the change.
#[inline]
pub fn bracketed_root(
    f: impl Fn(f64) -> (f64, f64),
    [mut lo, mut hi]: [f64; 2],
    is_rising: bool,
    start: f64,
) -> f64 {
    const ROUNDING: f64 = 4.0 * f64::EPSILON;
    let mut x = start;
    let mut last = hi - lo;
    for _ in 0..100 {
        let (value, slope) = f(x);
        if value == 0.0 {
            return x;
        }
        if (value > 0.0) == is_rising {
            hi = x;
        } else {
            lo = x;
        }
        let newton = x - value / slope;
        let is_good = newton >= lo && newton <= hi && (newton - x).abs() < 0.5 * last;
        let next = if is_good { newton } else { 0.5 * (lo + hi) };
        last = (next - x).abs();
        x = next;
        if last <= ROUNDING {
            break;
        }
    }
    x
}

/// The root x >= 0 of a x + ln(1 + x) = e, for a >= 0 and e >= 0: x = W(a exp(a + e)) / a - 1 with the
/// principal branch W of Lambert's function, here without overflow for large a, without a difference for
/// small x, and with its limit e^x - 1 at a = 0.
pub fn lambert_excess(a: f64, e: f64) -> f64 {
    // ln(1 + x) >= 0 and a x >= 0 bound the root from above; ln(1 + x) <= x from below. The function is
    // concave, so that Newton's steps approach the root from below.
    let above = exp_m1(e).min(e / a);
    let root = |x: f64| (a * x + ln_1p(x) - e, a + 1.0 / (1.0 + x));
    increasing_root(root, 0.0, above, e / (1.0 + a))
}

/// Inverse of `erf` on (-1, 1); +-infinity at +-1.
///
/// Start: Winitzki's closed form (relative error 2e-3). Polish: two Halley steps, each of which cubes
/// the error, on erf, or on erfc in the tails, where 1 - |y| carries the digits.
pub fn erf_inv(y: f64) -> f64 {
    if y.abs() >= 1.0 {
        return f64::INFINITY.copysign(y);
    }
    let a = 0.147;
    let ln = super::ln_1p(-y * y);
    let b = 2.0 / (std::f64::consts::PI * a) + 0.5 * ln;
    let mut x = ((b * b - ln / a).sqrt() - b).max(0.0).sqrt();
    let target = y.abs();
    for _ in 0..2 {
        let residual = if target < 0.5 { erf(x) - target } else { (1.0 - target) - erfc(x) };
        // erf'(x) = 2/sqrt(pi) exp(-x^2), erf'' = -2x erf'.
        let step = residual / (std::f64::consts::FRAC_2_SQRT_PI * exp(-x * x));
        x -= step / (1.0 + x * step);
    }
    x.copysign(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erf_inverse_inverts() {
        for i in -9999..10_000 {
            let y = f64::from(i) / 10_000.0;
            assert!((erf(erf_inv(y)) - y).abs() < 4e-16, "{y}");
        }
        for k in 1..50 {
            let tail = 0.5f64.powi(k);
            let x = erf_inv(1.0 - tail);
            assert!((erfc(x) / tail - 1.0).abs() < 1e-13, "tail 2^-{k}");
        }
        assert_eq!(erf_inv(0.0), 0.0);
    }

    #[test]
    fn root_of_a_cubic() {
        let root = increasing_root(|x| (x * x * x - 2.0, 3.0 * x * x), 0.0, 2.0, 1.0);
        assert!((root - super::super::cbrt(2.0)).abs() < 2e-15);
    }

    /// Against W to 30 digits (mpmath 1.3: `lambertw(a * exp(a + e)) / a - 1`), and against its own
    /// equation where a and e range over all sizes.
    #[test]
    fn lambert_excess_solves_its_equation() {
        for (a, e, expected) in LAMBERT {
            let x = lambert_excess(a, e);
            assert!((x / expected - 1.0).abs() < 4e-15, "{a} {e}: {x} {expected}");
        }
        for a in [0.0, 1e-12, 1e-3, 0.4, 1.0, 30.0, 1e6] {
            for e in [1e-17, 1e-9, 1e-2, 1.0, 10.0, 36.7] {
                let x = lambert_excess(a, e);
                assert!(((a * x + ln_1p(x)) / e - 1.0).abs() < 1e-14, "{a} {e}: {x}");
            }
            assert_eq!(lambert_excess(a, 0.0), 0.0);
        }
    }

    const LAMBERT: [(f64, f64, f64); 9] = [
        (1e-6, 0.001, 0.0010004991652081774),
        (0.25, 1e-8, 8.0000000256e-09),
        (0.25, 3.0, 4.900113588167485),
        (1.0, 1.0, 0.5571455989976114),
        (1.0, 30.0, 26.67931463003277),
        (7.5, 0.3, 0.03536600148883067),
        (40.0, 36.0, 0.8841629089466799),
        (300.0, 0.01, 3.322259319554195e-05),
        (1e-3, 20.0, 10720.03684905815),
    ];
}
