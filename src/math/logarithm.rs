//! ln x with the bits of `libm::log`, inlined: a call from the middle of a walk's step spills what the step holds in registers.
//!
//! Method and constants are those of FreeBSD's e_log.c (Copyright (C) 1993 by Sun Microsystems, Inc.; permission to use, copy,
//! modify, and distribute is freely granted), which `libm` ports. With x = 2^k (1 + f), sqrt(2)/2 < 1 + f < sqrt(2), and
//! s = f / (2 + f),
//!   ln(1 + f) = f - f^2/2 + s (f^2/2 + R),   R = L1 s^2 + L2 s^4 + ... + L7 s^14,   ln x = k ln 2 + ln(1 + f).
//! Every operation is that of the original in its order, so that the results are the same to the bit, with its error below
//! 1 ulp.

use super::exponential::{LN2_HIGH, LN2_LOW};

const L: [f64; 7] = [
    6.666_666_666_666_735e-1,
    3.999_999_999_940_942e-1,
    2.857_142_874_366_239e-1,
    2.222_219_843_214_978_4e-1,
    1.818_357_216_161_805e-1,
    1.531_383_769_920_937_3e-1,
    1.479_819_860_511_658_6e-1,
];

/// The bits of the least normal number.
const LEAST: u64 = 1 << 52;
/// 2^52: the numbers from here to twice this are whole.
const TWO_52: f64 = 4_503_599_627_370_496.0;
/// The bits of infinity.
const END: u64 = 0x7ff << 52;
/// The upper half of sqrt(2) / 2.
const HALF_ROOT: u64 = 0x3fe6_a09e << 32;
/// From there to 1.
const UP_TO_ONE: u64 = (0x3ff0_0000 << 32) - HALF_ROOT;

/// Natural logarithm.
#[inline]
pub fn ln(x: f64) -> f64 {
    if x.to_bits().wrapping_sub(LEAST) < END - LEAST { ln_of_normal(x) } else { no_normal_number(x) }
}

/// The same of a positive normal number, without branches: for loops over lanes.
#[inline(always)]
pub(crate) fn ln_of_normal(x: f64) -> f64 {
    let raised = x.to_bits() + UP_TO_ONE;
    // As the last digits of a number near 2^52: vectors of AVX2 have no conversion of 64-bit integers.
    let k = f64::from_bits((raised >> 52) | TWO_52.to_bits()) - (TWO_52 + 1023.0);
    let f = f64::from_bits((raised & (LEAST - 1)) + HALF_ROOT) - 1.0;
    let half_square = 0.5 * f * f;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let even = w * (L[1] + w * (L[3] + w * L[5]));
    let odd = z * (L[0] + w * (L[2] + w * (L[4] + w * L[6])));
    s * (half_square + (odd + even)) + k * LN2_LOW - half_square + f + k * LN2_HIGH
}

/// 0, less, subnormal, infinite, or none.
#[cold]
fn no_normal_number(x: f64) -> f64 {
    libm::log(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::bits::{around, assert_same, scattered};

    /// Around every power of 2 and of sqrt(2), where k changes, at the ends of the range, and at numbers of every size.
    #[test]
    fn bits_are_those_of_libms_logarithm() {
        let same = |x: f64| assert_same(ln, libm::log, x);
        for k in 1..2047u64 {
            around(f64::from_bits(k << 52), same);
            around(f64::from_bits(k << 52) * std::f64::consts::SQRT_2, same);
        }
        [0.0, -0.0, 1.0, -1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, f64::MAX]
            .into_iter()
            .for_each(same);
        for (bits, u) in scattered() {
            same(f64::from_bits(bits));
            same(u);
            same(1.0 + (u - 0.5) * 1e-3);
        }
    }
}
