//! A test of sums that assumes only that their terms are symmetric about 0 if there is no effect.

use super::hypothesis::critical_value;
use crate::math;

/// P(T > t) <= exp(-t^2 / 2) for T = sum X / sqrt(sum X^2) of independent symmetric X: given the |X|,
/// the signs are fair coins, and W. Hoeffding's inequality applies ("Probability inequalities for sums
/// of bounded random variables", 1963, theorem 2). One-sided: only t > 0 speaks against the hypothesis.
pub(crate) fn one_sided_bound(t: f64) -> f64 {
    if t > 0.0 {
        math::exp(-0.5 * t * t)
    } else if t.is_nan() {
        t
    } else {
        1.0
    }
}

/// The effect on the sum, in units of its noise, that the bound rejects at `level` with probability
/// `power`; infinite where no effect is.
///
/// With n terms of noise s and effect e each, T is about (z + g) / sqrt(1 + z^2 / n), z = e sqrt(n) / s
/// and g normal; T > c where z + g > c / sqrt(1 - c^2 / n). No effect reaches c >= sqrt(n).
pub(crate) fn detectable(level: f64, power: f64, terms: f64) -> f64 {
    let c2 = -2.0 * math::ln(level);
    let normal = critical_value(2.0 * (1.0 - power), f64::INFINITY);
    if c2 >= terms { f64::INFINITY } else { (c2 / (1.0 - c2 / terms)).sqrt() + normal }
}

#[cfg(test)]
mod tests {
    use super::*;

    // All 2^n signs of given sizes: the bound is never below the share of signs that reach t.
    #[test]
    fn the_bound_holds_for_every_choice_of_sizes() {
        for sizes in [[1.0; 12], std::array::from_fn(|i| 1.5f64.powi(i as i32))] {
            let norm = sizes.iter().map(|x| x * x).sum::<f64>().sqrt();
            let sum = |signs: u32| {
                let signed =
                    sizes.iter().enumerate().map(|(i, x)| if signs >> i & 1 == 1 { *x } else { -x });
                signed.sum::<f64>() / norm
            };
            for t in [0.5, 1.0, 2.0, 2.5, 3.0] {
                let reached = (0..1u32 << 12).filter(|signs| sum(*signs) > t).count() as f64 / 4096.0;
                assert!(reached <= one_sided_bound(t), "{t}: {reached}");
            }
        }
        assert_eq!((one_sided_bound(-1.0), one_sided_bound(0.0)), (1.0, 1.0));
        assert!(one_sided_bound(f64::NAN).is_nan());
    }

    // c^2 = -2 ln(level); with many terms c + 2.326, with few of them nothing.
    #[test]
    fn what_can_be_seen() {
        let c = (2.0 * 1e6f64.ln()).sqrt();
        assert!((detectable(1e-6, 0.99, 1e12) - c - 2.3263478740408408).abs() < 1e-6);
        assert!(detectable(1e-6, 0.99, 64.0) > c + 2.4);
        assert_eq!(detectable(1e-6, 0.99, 27.0), f64::INFINITY);
    }
}
