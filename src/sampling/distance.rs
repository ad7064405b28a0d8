//! Flight distances in a homogeneous medium.

use crate::math::{exp, ln};

/// The distance of a flight through a medium of extinction `sigma_t` (1/mm): the inverse of
/// F(t) = 1 - exp(-sigma_t t), t = -ln(1 - u) / sigma_t. Infinite where `sigma_t` is 0. `1 - u` is
/// exact for the 53-bit numbers of a stream.
#[inline]
pub fn sample_exponential(sigma_t: f64, u: f64) -> f64 {
    if sigma_t == 0.0 { f64::INFINITY } else { -ln(1.0 - u) / sigma_t }
}

/// Density of [`sample_exponential`] per mm.
#[inline]
pub fn pdf_distance_exponential(sigma_t: f64, t: f64) -> f64 {
    sigma_t * exp(-sigma_t * t)
}

/// Probability of a flight longer than `t`.
#[inline]
pub fn transmittance(sigma_t: f64, t: f64) -> f64 {
    if sigma_t == 0.0 { 1.0 } else { exp(-sigma_t * t) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{exp_m1, integrate};

    const SIGMAS: [f64; 4] = [1e-3, 1.0, 10.0, 1e4];

    /// D1: F(t(u)) = u over a grid with both ends.
    #[test]
    fn inverse_distribution_function() {
        for sigma_t in SIGMAS {
            for i in 0..=4097u32 {
                let u = match i {
                    0 => 1.0 / f64::from(1 << 24),
                    4097 => 1.0 - 1.0 / f64::from(1 << 24),
                    i => (f64::from(i) - 0.5) / 4096.0,
                };
                let t = sample_exponential(sigma_t, u);
                assert!((-exp_m1(-sigma_t * t) - u).abs() < 1e-12, "{sigma_t} {u}");
            }
            assert_eq!(sample_exponential(sigma_t, 0.0), 0.0);
        }
        assert_eq!(sample_exponential(0.0, 0.5), f64::INFINITY);
    }

    /// D7: the density over [0, T] and the probability of flying farther add up to 1. The flight to the
    /// boundary has the probability `transmittance`, not a density.
    #[test]
    fn density_and_transmittance_sum_to_one() {
        for sigma_t in SIGMAS {
            for tau in [0.01, 1.0, 30.0] {
                let t_max = tau / sigma_t;
                let inside = integrate(|t| pdf_distance_exponential(sigma_t, t), 0.0, t_max, 1e-12);
                assert!((inside.value + transmittance(sigma_t, t_max) - 1.0).abs() < 1e-10);
            }
        }
        assert_eq!(transmittance(0.0, 5.0), 1.0);
    }
}
