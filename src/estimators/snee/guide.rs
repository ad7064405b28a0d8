//! The concentrated part of a light, from which techniques that start at the light sample.

use std::f64::consts::PI;

use crate::geometry::Cone;
use crate::math::DVec3;
use crate::optics::boundary::Boundary;
use crate::scene::{Bright, Emission, Light, LightSample};

/// The concentrated part of one light in one band.
#[derive(Debug)]
pub(super) struct Guide {
    /// Index of the light.
    pub light: usize,
    /// Probability of choosing it among the guides.
    pub choice: f64,
    /// Unit direction towards the middle of the guide's cap.
    pub axis: DVec3,
    /// Half the angle that it covers, rad; 0 for parallel light.
    pub half_angle: f64,
    /// The directions from a point inside against the axis's light, whatever the normal at which that is refracted.
    pub refracted: Cone,
    /// Part of a map; the other lights are concentrated as a whole or not at all.
    bright: Option<Bright>,
}

/// How many times brighter than its mean a map's texel is that counts as concentrated light.
const BRIGHT: f64 = 10.0;

/// Half the angle about a map's brightest texel within which light counts as one concentrated part, rad.
const COMPACT: f64 = 0.3;

impl Guide {
    /// The guides among lights whose concentration reaches `least`. A map is split: the part of it that
    /// is far brighter than its mean, and near its brightest texel, is the guide; the rest has none.
    pub(super) fn all(lights: &[Light], band: usize, least: f64, boundary: &Boundary) -> Vec<Guide> {
        let mut guides: Vec<Guide> = lights
            .iter()
            .enumerate()
            .filter_map(|(index, light)| Guide::of(index, light, band, least, boundary))
            .collect();
        let total: f64 = guides.iter().map(|guide| guide.choice).sum();
        guides.iter_mut().for_each(|guide| guide.choice /= total);
        guides
    }

    fn of(index: usize, light: &Light, band: usize, least: f64, boundary: &Boundary) -> Option<Guide> {
        let strength = light.strength(band);
        let refracted = |axis| Cone::new(axis, boundary.least_cosine_of_refraction());
        let whole = |axis, half_angle| {
            let is_guide = strength > 0.0 && light.concentration() >= least;
            is_guide.then(|| Guide {
                light: index,
                choice: strength,
                axis,
                half_angle,
                refracted: refracted(axis),
                bright: None,
            })
        };
        match &light.emission {
            Emission::Directional { toward, .. } => whole(*toward, 0.0),
            // 1 - cos = height: sin(half / 2)^2 = height / 2.
            Emission::Cap { frame, height, .. } => {
                whole(frame.n, 2.0 * crate::math::asin((0.5 * height).sqrt().min(1.0)))
            }
            Emission::Map(map) => {
                let is_whole = least <= 1.0;
                let (excess, reach) = if is_whole { (0.0, PI) } else { (BRIGHT, COMPACT) };
                let bright = map.bright(band, excess, reach)?;
                (is_whole || bright.concentration() >= least).then(|| Guide {
                    light: index,
                    choice: bright.strength(),
                    axis: bright.axis(),
                    half_angle: bright.half_angle(),
                    refracted: refracted(bright.axis()),
                    bright: Some(bright),
                })
            }
        }
    }

    /// Whether it is all of its light.
    pub(super) fn is_whole(&self) -> bool {
        self.bright.is_none()
    }

    /// A direction towards the guide's part of its light.
    pub(super) fn sample(&self, light: &Light, band: usize, u: [f64; 2]) -> LightSample {
        match (&self.bright, &light.emission) {
            (Some(bright), Emission::Map(map)) => {
                let (wi, radiance, pdf) = bright.sample(map, u);
                LightSample { wi, radiance, pdf: Some(pdf) }
            }
            _ => light.sample(band, u),
        }
    }

    /// Density of [`Self::sample`] per solid angle, the choice of the guide included; for parallel light
    /// the probability of the choice.
    pub(super) fn density(&self, light: &Light, band: usize, wi: DVec3) -> f64 {
        self.choice
            * match (&self.bright, &light.emission) {
                (Some(bright), Emission::Map(map)) => bright.pdf(map, wi),
                (_, Emission::Directional { .. }) => 1.0,
                _ => light.eval(band, wi).1,
            }
    }
}
