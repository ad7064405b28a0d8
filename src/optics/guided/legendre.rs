//! Legendre polynomials as sums of powers, and Legendre functions of the second kind.

use super::TERMS;
use crate::math::ln;

/// A polynomial of low degree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polynomial(pub(super) [f64; TERMS]);

impl Polynomial {
    /// sum of c_l P_l, by l P_l = (2l - 1) x P_{l-1} - (l - 1) P_{l-2}.
    pub(super) fn of_legendre(coefficients: &[f64]) -> Polynomial {
        let mut sum = [0.0; TERMS];
        let (mut before, mut here) = ([0.0; TERMS], [0.0; TERMS]);
        here[0] = 1.0;
        for (l, c) in coefficients.iter().enumerate() {
            if l > 0 {
                let (l, mut next) = (l as f64, [0.0; TERMS]);
                for k in 0..TERMS {
                    let shifted = if k > 0 { here[k - 1] } else { 0.0 };
                    next[k] = ((2.0 * l - 1.0) * shifted - (l - 1.0) * before[k]) / l;
                }
                (before, here) = (here, next);
            }
            for k in 0..TERMS {
                sum[k] += c * here[k];
            }
        }
        Polynomial(sum)
    }

    #[inline(always)]
    pub(super) fn at(&self, x: f64) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.0;
        let x2 = x * x;
        ((a + b * x) + (c + d * x) * x2) + ((e + f * x) + (g + h * x) * x2) * (x2 * x2)
    }
}

/// Q_0 to Q_l of nu > 1 by backward recursion (Miller), which damps the other solution P_l:
///   l Q_{l-1} = (2l + 1) nu Q_l - (l + 1) Q_{l+1},
/// started twice as deep as the terms that count, and scaled to Q_0.
pub(super) fn second_kind(nu: f64, q_0: f64) -> Vec<f64> {
    // Q_l falls off as e^{-l eta}, cosh(eta) = nu.
    let fall = ln(nu + (nu * nu - 1.0).sqrt());
    let terms = (40.0 / fall).ceil() as usize + 4;
    let (mut above, mut q) = (0.0, 1e-250);
    let mut all = vec![0.0; terms];
    for l in (1..2 * terms).rev() {
        let below = ((2 * l + 1) as f64 * nu * q - (l + 1) as f64 * above) / l as f64;
        (above, q) = (q, below);
        if l <= terms {
            all[l - 1] = q;
        }
    }
    let scale = q_0 / all[0];
    all.iter().map(|q| q * scale).collect()
}
