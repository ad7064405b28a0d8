//! One source of light out of several, with probability proportional to its strength.

use std::f64::consts::PI;

use crate::sampling::discrete::choose_share;
use crate::scene::Scene;

/// Probability of choosing each light, per band; all 0 where no light shines.
pub(super) fn light_shares(scene: &Scene) -> Vec<Vec<f64>> {
    source_shares(scene, None)
}

/// The same of every source of light, the emission of the medium as a light that shines from everywhere
/// with the radiance of a ray of length `emitting`, mm; without it the emission is left out.
pub(super) fn source_shares(scene: &Scene, emitting: Option<f64>) -> Vec<Vec<f64>> {
    (0..scene.bands())
        .map(|band| {
            let mut strengths: Vec<f64> = scene.lights.iter().map(|l| l.strength(band)).collect();
            strengths.extend(emitting.map(|length| 4.0 * PI * length * scene.medium[band].emission));
            shares(&strengths)
        })
        .collect()
}

/// Each of the strengths over their sum; all 0 where they are.
pub(super) fn shares(strengths: &[f64]) -> Vec<f64> {
    let total: f64 = strengths.iter().sum();
    let share = |s: &f64| if total > 0.0 { s / total } else { 0.0 };
    strengths.iter().map(share).collect()
}

/// The light that `u` selects and the probability of that choice, from one band's shares.
#[inline]
pub(super) fn choose_light(shares: &[f64], u: f64) -> Option<(usize, f64)> {
    choose_share(shares.iter().copied(), u)
}
