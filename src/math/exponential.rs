//! e^x with the bits of `libm::exp`, in a form that loops over many x can be compiled to vectors in: half of a point cloud's
//! time would be spent in `libm`.
//!
//! Method and constants are those of FreeBSD's e_exp.c (Copyright (C) 2004 by Sun Microsystems, Inc.; permission to use, copy,
//! modify, and distribute is freely granted), which `libm` ports. With x = k ln 2 + r, |r| <= ln(2) / 2,
//!   e^r = 1 + r + r c / (2 - c),   c = r - r^2 (P1 + r^2 (P2 + ... + r^2 P5)),   e^x = 2^k e^r,
//! k being x / ln 2 rounded away from 0 at halves. Every operation is that of the original in its order, so that the
//! results are the same to the bit, with its error below 1 ulp; only k and 2^k are found without conversions between integers
//! and floats.

use super::turns::ROUND;

/// ln 2 in two parts; a multiple of the first by k is exact.
pub(super) const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
pub(super) const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
const INV_LN2: f64 = std::f64::consts::LOG2_E;
const P: [f64; 5] = [
    1.666_666_666_666_660_2e-1,
    -2.777_777_777_701_559_3e-3,
    6.613_756_321_437_934e-5,
    -1.653_390_220_546_525_2e-6,
    4.138_136_797_057_238_5e-8,
];

/// See [`exp_near`].
pub(crate) const NEAR: f64 = 708.0;

/// The upper half of |x| from which results may overflow, or have fewer digits.
const FAR: u32 = 0x4086_232b;
/// The upper half of |x|, just above ln(2) / 2, up to which k = 0.
const HALF_LN2: u32 = 0x3fd6_2e42;
/// The upper half of |x|, 2^-28, up to which e^x is 1 + x.
const TINY: u32 = 0x3e30_0000;

/// e^x.
#[inline]
pub fn exp(x: f64) -> f64 {
    if magnitude(x) >= FAR { far(x) } else { exp_near(x) }
}

#[cold]
fn far(x: f64) -> f64 {
    libm::exp(x)
}

/// The upper half of |x|.
#[inline(always)]
fn magnitude(x: f64) -> u32 {
    (x.to_bits() >> 32) as u32 & 0x7fff_ffff
}

/// e^x for |x| below [`NEAR`], without a branch, for loops over lanes; of other x something else.
#[inline(always)]
pub(crate) fn exp_near(x: f64) -> f64 {
    let steps = INV_LN2 * x + 0.5f64.copysign(x);
    let nearest = (steps + ROUND) - ROUND;
    let truncated = if nearest.abs() > steps.abs() { nearest - 1f64.copysign(x) } else { nearest };
    let k = if magnitude(x) > HALF_LN2 { truncated } else { 0.0 };
    let (high, low) = (x - k * LN2_HIGH, k * LN2_LOW);
    let r = high - low;
    let r2 = r * r;
    let c = r - r2 * (P[0] + r2 * (P[1] + r2 * (P[2] + r2 * (P[3] + r2 * P[4]))));
    let e_r = 1.0 + (r * c / (2.0 - c) - low + high);
    let two_to_k = f64::from_bits(((k + ROUND).to_bits() + 1023) << 52);
    if magnitude(x) > TINY { e_r * two_to_k } else { 1.0 + x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::bits::{around, assert_same, scattered};

    /// At both sides of every change of method, of every change of k, and at numbers of every size.
    #[test]
    fn bits_are_those_of_libm() {
        let same = |x: f64| assert_same(exp, libm::exp, x);
        let both = |x: f64| [x, -x].iter().for_each(|&x| around(x, same));
        for high in [FAR, HALF_LN2, TINY, 0x3ff0_a2b2, 0x3fd6_2e43, 0x3e30_0001] {
            both(f64::from_bits(u64::from(high) << 32));
        }
        for x in
            [0.0, f64::MIN_POSITIVE, 708.396_418_532_264_1, 709.782_712_893_384, 745.133_219_101_941_1]
        {
            both(x);
        }
        for k in 0..1024 {
            both((f64::from(k) + 0.5) * std::f64::consts::LN_2);
            both(f64::from(k) * std::f64::consts::LN_2);
        }
        [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, f64::MAX, f64::MIN, -0.0]
            .into_iter()
            .for_each(same);
        for (k, (bits, u)) in (0..).zip(scattered()) {
            same(f64::from_bits(bits));
            same(1500.0 * (u - 0.5));
            same(4.0 * (u - 0.5));
            // Of either sign and every size from 2^-40 to 2^10.
            let exponent = 1023 - 40 + k % 50;
            same(f64::from_bits((bits & 0x800f_ffff_ffff_ffff) | (exponent << 52)));
        }
    }
}
