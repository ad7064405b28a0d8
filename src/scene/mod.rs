//! The immutable scene: a body in vacuum, lights, a sensor.

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
    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.medium.len()
    }
}
