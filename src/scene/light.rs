//! Lights at infinity: parallel light, a disc of directions, an environment.

use std::f64::consts::PI;
use std::sync::Arc;

use super::latlong::LatLong;
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::sampling::warp::{pdf_cap, square_to_cap};

/// A light, with its radiance (or irradiance) per band.
#[derive(Debug)]
pub struct Light {
    /// Name of the light in observables.
    pub name: String,
    /// Radiance or irradiance by direction and band.
    pub emission: Emission,
}

/// Kinds of light.
#[derive(Debug)]
pub enum Emission {
    /// Parallel light.
    Directional {
        /// Unit direction towards the light.
        toward: DVec3,
        /// On a plane that faces it, W/mm^2, per band.
        irradiance: Vec<f64>,
    },
    /// Uniform radiance from a cap of directions.
    Cap {
        /// About the cap's middle (n is towards the light).
        frame: Frame,
        /// 1 - cos of the cap's half angle: solid angle over 2 pi; 2 is every direction.
        height: f64,
        /// W/(mm^2 sr), per band.
        radiance: Vec<f64>,
    },
    /// A latitude-longitude map.
    Map(Arc<LatLong>),
}

/// A direction drawn from a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction towards the light.
    pub wi: DVec3,
    /// Radiance, W/(mm^2 sr); for parallel light the irradiance, W/mm^2.
    pub radiance: f64,
    /// Density per solid angle; `None` for parallel light, which no other technique can hit.
    pub pdf: Option<f64>,
}

impl Light {
    /// 4 pi int L^2 / (int L)^2: 1 for a constant sky, 4 pi over its solid angle for a disc, infinite for
    /// parallel light. A map counts as a sky; its bright part has a concentration of its own.
    pub(crate) fn concentration(&self) -> f64 {
        match self.emission {
            Emission::Directional { .. } => f64::INFINITY,
            Emission::Cap { height, .. } => 2.0 / height,
            Emission::Map(_) => 1.0,
        }
    }

    /// 4 pi int L^2 / (int L)^2 of the whole light, a map included, in one band.
    pub(crate) fn whole_concentration(&self, band: usize) -> f64 {
        match &self.emission {
            Emission::Map(map) => map.concentration(band),
            _ => self.concentration(),
        }
    }

    /// Draws a direction towards the light.
    #[inline]
    pub fn sample(&self, band: usize, u: [f64; 2]) -> LightSample {
        match &self.emission {
            Emission::Directional { toward, irradiance } => {
                LightSample { wi: *toward, radiance: irradiance[band], pdf: None }
            }
            Emission::Cap { frame, height, radiance } => LightSample {
                wi: frame.to_world(square_to_cap(*height, u)),
                radiance: radiance[band],
                pdf: Some(pdf_cap(*height)),
            },
            Emission::Map(map) => {
                let (wi, radiance, pdf) = map.sample(band, u);
                LightSample { wi, radiance, pdf: Some(pdf) }
            }
        }
    }

    /// Radiance from direction `wi` and the density with which [`Self::sample`] draws it; (0, 0) for
    /// parallel light.
    #[inline]
    pub fn eval(&self, band: usize, wi: DVec3) -> (f64, f64) {
        match &self.emission {
            Emission::Directional { .. } => (0.0, 0.0),
            Emission::Cap { frame, height, radiance } => {
                // A direction's length carries rounding, so the whole sphere (height 2) is asked for by
                // name: at its far pole 1 - cos may exceed 2 by a last digit.
                if *height == 2.0 || 1.0 - wi.dot(frame.n) < *height {
                    (radiance[band], pdf_cap(*height))
                } else {
                    (0.0, 0.0)
                }
            }
            Emission::Map(map) => map.eval(band, wi),
        }
    }

    /// What another band has in a direction that was drawn from this light: radiance, or irradiance of
    /// parallel light.
    #[inline]
    pub fn sampled_radiance(&self, band: usize, wi: DVec3) -> f64 {
        match &self.emission {
            Emission::Directional { irradiance, .. } => irradiance[band],
            Emission::Cap { radiance, .. } => radiance[band],
            Emission::Map(map) => map.eval(band, wi).0,
        }
    }

    /// Radiance integrated over directions, W/mm^2: the weight with which a light is chosen.
    pub fn strength(&self, band: usize) -> f64 {
        match &self.emission {
            Emission::Directional { irradiance, .. } => irradiance[band],
            Emission::Cap { height, radiance, .. } => 2.0 * PI * height * radiance[band],
            Emission::Map(map) => map.strength(band),
        }
    }

    /// Whether two bands get the same light.
    pub fn is_same_in(&self, a: usize, b: usize) -> bool {
        match &self.emission {
            Emission::Directional { irradiance: per_band, .. }
            | Emission::Cap { radiance: per_band, .. } => per_band[a] == per_band[b],
            Emission::Map(map) => map.is_same_in(a, b),
        }
    }

    /// True for parallel light.
    pub fn is_directional(&self) -> bool {
        matches!(self.emission, Emission::Directional { .. })
    }

    /// Whether no walk that leaves the body through this boundary finds the light: parallel light behind a smooth boundary.
    pub fn is_hidden_by(&self, boundary: &Boundary) -> bool {
        self.is_directional() && matches!(boundary, Boundary::Smooth { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn caps() -> Vec<Light> {
        [1.1e-5, 6.8e-3 / (2.0 * PI), 0.3, 1.0, 2.0]
            .map(|height| Light {
                name: "cap".into(),
                emission: Emission::Cap {
                    frame: Frame::about(DVec3::new(0.6, 0.0, -0.8)),
                    height,
                    radiance: vec![3.0],
                },
            })
            .into()
    }

    /// D5: the direction drawn has the radiance and density reported. Directions within rounding of the
    /// rim are left out: 1 - cos carries 1e-16, not 1e-16 of the height.
    #[test]
    fn sample_and_eval_agree() {
        for light in caps() {
            for i in 0..4000 {
                let u = [(f64::from(i) + 0.5) / 4001.0, f64::from(i * 7 % 4000) / 4000.0];
                let sample = light.sample(0, u);
                assert_eq!(light.eval(0, sample.wi), (sample.radiance, sample.pdf.unwrap_or(0.0)));
            }
        }
    }

    /// The whole sphere has no hole where its axis points away from.
    #[test]
    fn the_whole_sphere_is_whole() {
        let all = Emission::Cap { frame: Frame::about(DVec3::Z), height: 2.0, radiance: vec![1.0] };
        let light = Light { name: "sky".into(), emission: all };
        for wi in [DVec3::Z, -DVec3::Z, DVec3::X, -DVec3::Z * (1.0 + 4e-16)] {
            assert_eq!(light.eval(0, wi).0, 1.0);
        }
    }

    /// D7: density times solid angle is 1; strength is radiance times solid angle.
    #[test]
    fn normalised() {
        for light in caps() {
            let Emission::Cap { height, .. } = light.emission else { unreachable!() };
            assert!((pdf_cap(height) * 2.0 * PI * height - 1.0).abs() < 1e-15);
            assert!((light.strength(0) / (3.0 * 2.0 * PI * height) - 1.0).abs() < 1e-15);
        }
    }

    /// D1: the cap's sampler inverts: 1 - cos is u times the height.
    #[test]
    fn cap_height_is_uniform() {
        for height in [1e-5, 0.1, 2.0] {
            for u in [6e-8, 0.25, 0.5, 1.0 - 6e-8] {
                let z = square_to_cap(height, [u, 0.3]).z;
                assert!((1.0 - z - u * height).abs() < 1e-15);
                assert!((square_to_cap(height, [u, 0.3]).length() - 1.0).abs() < 1e-15);
            }
        }
    }
}
