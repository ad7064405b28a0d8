//! One source of light out of several, with probability proportional to its strength.

use std::f64::consts::PI;

use crate::sampling::discrete::choose_share;
use crate::scene::{Light, Scene};

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

/// Concentration below which a light is even: half a sky of one radiance has 2.
const EVEN: f64 = 2.0;

/// [`light_shares`] without lights that are even. Whatever direction a boundary or a phase function draws finds those; sampled
/// as well, with the balance heuristic between the two, they add noise that exceeds what is left of a guided walk's.
pub(super) fn shares_of_uneven(scene: &Scene) -> Vec<Vec<f64>> {
    let of_band = |band: usize| {
        let strength = |light: &Light| {
            if light.whole_concentration(band) < EVEN { 0.0 } else { light.strength(band) }
        };
        shares(&scene.lights.iter().map(strength).collect::<Vec<_>>())
    };
    (0..scene.bands()).map(of_band).collect()
}

/// The share of even lights in all light that walks find that leave the body, by strength.
pub(super) fn share_of_even(scene: &Scene, band: usize) -> f64 {
    let (mut even, mut all) = (0.0, 0.0);
    for light in scene.lights.iter().filter(|light| !light.is_hidden_by(&scene.boundary[band])) {
        let strength = light.strength(band);
        all += strength;
        even += if light.whole_concentration(band) < EVEN { strength } else { 0.0 };
    }
    if all > 0.0 { even / all } else { 0.0 }
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::geometry::{Ray, Shape};
    use crate::math::{DVec3, Frame};
    use crate::optics::boundary::Boundary;
    use crate::optics::medium::Medium;
    use crate::optics::phase::HenyeyGreenstein;
    use crate::scene::sensor::Probe;
    use crate::scene::{Emission, LatLong, Sensor};

    /// Skies of one radiance and of two alike are even; a part of the sky, a map with a sun, a small disc and parallel light
    /// are sampled, in proportion to their strength. In a band where all are even nothing is.
    #[test]
    fn even_lights_are_not_sampled() {
        let cap = |height: f64| Emission::Cap {
            frame: Frame::about(DVec3::Z),
            height,
            radiance: vec![1.0, if height == 2.0 { 1.0 } else { 0.0 }],
        };
        let map = |bright: f64| {
            let plane: Vec<f64> = (0..32 * 16).map(|k| if k == 100 { bright } else { 1.0 }).collect();
            Emission::Map(Arc::new(LatLong::new(32, 16, vec![plane, vec![1.0; 32 * 16]])))
        };
        let sun = Emission::Directional { toward: DVec3::Z, irradiance: vec![3.0, 0.0] };
        let emissions = [cap(2.0), cap(0.9), cap(1e-3), map(1.5), map(5000.0), sun];
        let light = |emission| Light { name: "light".into(), emission };
        let scene = Scene {
            shape: Arc::new(Shape::Sphere { radius: 1.0 }),
            boundary: vec![Boundary::Matched; 2],
            medium: vec![
                Medium {
                    sigma_t: 1.0,
                    albedo: 0.5,
                    phase: HenyeyGreenstein { g: 0.0 },
                    emission: 0.0
                };
                2
            ],
            lights: emissions.map(light).into(),
            sensor: Sensor::Probe(Probe { ray: Ray { origin: DVec3::ZERO, dir: DVec3::Z }, paths: 1 }),
        };
        let [first, second] = shares_of_uneven(&scene).try_into().expect("two bands");
        assert_eq!([first[0], first[3]], [0.0, 0.0]);
        let strengths: Vec<f64> = [1, 2, 4, 5].map(|k| scene.lights[k].strength(0)).into();
        let sampled: Vec<f64> = [1, 2, 4, 5].map(|k| first[k]).into();
        assert_eq!(sampled, shares(&strengths));
        assert_eq!(second, [0.0; 6]);
    }
}
