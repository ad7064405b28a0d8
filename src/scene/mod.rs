//! The immutable scene: a body in vacuum, lights, a sensor.

mod invariants;
mod latlong;
mod light;
pub mod sensor;

pub use latlong::{Bright, LatLong};
pub use light::{Emission, Light, LightSample};
pub use sensor::Sensor;

use std::sync::Arc;

use crate::geometry::{Shape, Side};
use crate::optics::boundary::Boundary;
use crate::optics::medium::Medium;

/// A body, its lights and its sensor. Optical properties are per band.
#[derive(Debug)]
pub struct Scene {
    /// Geometry of the body; cells of a sweep share it.
    pub shape: Arc<Shape>,
    /// Its surface, per band.
    pub boundary: Vec<Boundary>,
    /// The medium inside, per band.
    pub medium: Vec<Medium>,
    /// The lights, all shining at once.
    pub lights: Vec<Light>,
    /// Sensor, which defines what is measured.
    pub sensor: Sensor,
}

impl Scene {
    /// Name of the medium's emission among the sources of light, as in `mean@emission`.
    pub const EMISSION: &str = "emission";

    /// Whether a ray of the sensor meets the body: of an image every pixel's, up to some millions, and
    /// never fewer than some ten thousand; of a probe the one that it has. All other sensors look at the
    /// body from where it is.
    pub(crate) fn is_seen(&self) -> bool {
        const LEAST: usize = 1 << 16;
        const MOST: usize = 1 << 22;
        /// Steps of a sequence that fills the square evenly (Roberts 2018).
        const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
        let rays = match self.sensor {
            Sensor::Probe(_) => 1,
            _ if self.sensor.pixels().is_some() => self.sensor.rays_per_pass().clamp(LEAST, MOST),
            _ => return true,
        };
        let per_pass = self.sensor.rays_per_pass();
        (0..rays).any(|k| {
            let [x, y] = STEPS.map(|step| (step * k as f64).fract());
            let index = (k as u128 * per_pass as u128 / rays as u128) as usize;
            let ray = self.sensor.ray(index, [x, y, y, x]).ray;
            self.shape.intersect(&ray, Side::Outside, None, f64::INFINITY).is_some()
        })
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.medium.len()
    }

    /// Whether the medium emits in any band.
    pub fn emits(&self) -> bool {
        self.medium.iter().any(|medium| medium.emission > 0.0)
    }

    /// Names of the sources of light: the lights in their order, and after them the medium where it
    /// emits.
    pub fn sources(&self) -> impl Iterator<Item = &str> {
        let lights = self.lights.iter().map(|light| light.name.as_str());
        lights.chain(self.emits().then_some(Scene::EMISSION))
    }
}
