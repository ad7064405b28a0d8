//! The immutable scene: a body in vacuum, lights, a sensor.

mod invariants;
mod latlong;
mod light;
pub mod sensor;

pub use latlong::{Bright, LatLong};
pub use light::{Emission, Light, LightSample};
pub use sensor::Sensor;

use std::sync::Arc;

use crate::geometry::Shape;
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
