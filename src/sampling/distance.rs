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
