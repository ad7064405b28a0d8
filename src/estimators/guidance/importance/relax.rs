//! The linear equations of importance on a grid.

use super::NONE;
use crate::math::cos;

/// Solves  diagonal phi = source + sum of phi over the faces that lead inside.
pub(super) fn relax(
    near: &[[u32; 6]],
    source: &[f64],
    diagonal: &[f64],
    start: f64,
    counts: [usize; 3],
) -> Vec<f64> {
    /// Relative change of a sweep below which nothing is gained.
    const ENOUGH: f64 = 1e-4;
    // Young's factor, for Jacobi's spectral radius cos(pi / n) on the longest side, which absorption lowers.
    let longest = counts.into_iter().max().unwrap_or(1) as f64;
    let mean = diagonal.iter().sum::<f64>() / diagonal.len() as f64;
    let radius = cos(std::f64::consts::PI / longest) * 6.0 / mean.max(6.0);
    let factor = 2.0 / (1.0 + (1.0 - radius * radius).sqrt());
    let mut phi = vec![start; source.len()];
    for _ in 0..20 * longest as usize {
        let mut change = 0f64;
        for (number, faces) in near.iter().enumerate() {
            let mut sum = source[number];
            for &next in faces {
                if next != NONE {
                    sum += phi[next as usize];
                }
            }
            let old = phi[number];
            let relaxed = old + factor * (sum / diagonal[number] - old);
            // Over-relaxation may overshoot what is positive.
            let new = if relaxed > 0.0 { relaxed } else { sum / diagonal[number] };
            phi[number] = new;
            change = change.max((new - old).abs() / new.max(f64::MIN_POSITIVE));
        }
        if change < ENOUGH {
            break;
        }
    }
    phi
}
