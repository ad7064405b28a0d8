//! A medium vertex.

use super::{SensorClass, SensorMethods, SensorRay, SensorRegion};
use crate::geometry::{Ray, Side};
use crate::math::DVec3;

/// Radiance that arrives at a medium vertex: rays start there and travel as a path arrives.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// The vertex and the direction of arrival.
    pub ray: Ray,
    /// Paths per pass.
    pub paths: usize,
}

impl SensorMethods for Vertex {
    fn class(&self) -> SensorClass {
        SensorClass::Inside
    }

    fn position(&self) -> Option<(DVec3, Side)> {
        Some((self.ray.origin, Side::Inside))
    }

    fn rays_per_pass(&self) -> usize {
        self.paths
    }

    #[inline]
    fn ray(&self, _: usize, _: [f64; 4]) -> SensorRay {
        SensorRay { ray: self.ray, weight: 1.0 / self.paths as f64, slot: 0 }
    }

    fn regions(&self) -> Vec<SensorRegion> {
        vec![SensorRegion::split("vertex")]
    }
}
