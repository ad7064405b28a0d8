//! E-values: evidence that multiplies over independent experiments.

use crate::math::ln;

/// ln of the e-value 1 / (2 sqrt(p)) of a p-value: its expectation under a uniform p is the integral of
/// 1 / (2 sqrt(p)) over [0, 1], which is 1; under a conservative p it is less.
/// V. Vovk, R. Wang, "E-values: Calibration, combination and applications" (2021), with exponent 1/2.
pub(crate) fn calibrated(p: f64) -> f64 {
    -0.5 * ln(p) - ln(2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn p_values_become_e_values() {
        for (p, expected) in [(1e-6, 500f64.ln()), (1.0, 0.5f64.ln())] {
            assert!((calibrated(p) - expected).abs() <= 1e-12 * expected.abs());
        }
    }
}
