//! e^x inline, for what calls it at every step.
//!
//! x = k ln 2 + r with |r| <= ln(2) / 2, k ln 2 subtracted in two parts, the first of which has 32 bits, so that its product
//! with k is exact. e^r by its Taylor sum to r^13: the first term left out is below 5e-18. Pairs of terms are summed
//! side by side (Estrin), since a chain of 13 would be longer than a call of the library's function.

use std::f64::consts::LOG2_E;

/// Largest |x| of [`exp_within`].
pub const EXP_LIMIT: f64 = 700.0;

/// e^x for |x| <= [`EXP_LIMIT`], relative error below 5e-16.
#[inline]
pub fn exp_within(x: f64) -> f64 {
    let k = (x * LOG2_E + ROUND) - ROUND;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let pair = |i: usize| TAYLOR[i] + TAYLOR[i + 1] * r;
    let r2 = r * r;
    let r4 = r2 * r2;
    let low = (pair(0) + pair(2) * r2) + (pair(4) + pair(6) * r2) * r4;
    let high = (pair(8) + pair(10) * r2) + pair(12) * r4;
    let power = f64::from_bits(((k as i64 + 1023) as u64) << 52);
    (low + high * (r4 * r4)) * power
}

/// 1.5 * 2^52: adding and subtracting it rounds to the nearest integer.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// ln 2 to 32 bits, and the rest of it.
const LN_2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// 1 / i!
const TAYLOR: [f64; 14] = {
    let mut out = [1.0; 14];
    let mut factorial = 1u64;
    let mut i = 1;
    while i < 14 {
        // At most 13! < 2^53: exact.
        factorial *= i as u64;
        out[i] = 1.0 / factorial as f64;
        i += 1;
    }
    out
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_libm() {
        for i in -700_000..=700_000 {
            let x = f64::from(i) / 1000.0 * (1.0 - 1e-9 * f64::from(i % 13).abs());
            let error = exp_within(x) / libm::exp(x) - 1.0;
            assert!(error.abs() < 5e-16, "{x}: {error}");
        }
        assert_eq!(exp_within(0.0), 1.0);
        assert_eq!(exp_within(-0.0), 1.0);
    }
}
