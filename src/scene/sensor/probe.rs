//! One ray.

use super::{SensorMethods, SensorRay, SensorRegion};
use crate::geometry::{Ray, Side};
use crate::math::DVec3;

/// Radiance along one ray.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    /// Ray along which radiance is measured.
    pub ray: Ray,
    /// Paths per pass.
    pub paths: usize,
}

impl SensorMethods for Probe {
    fn position(&self) -> Option<(DVec3, Side)> {
        Some((self.ray.origin, Side::Outside))
    }

    fn rays_per_pass(&self) -> usize {
        self.paths
    }

    #[inline]
    fn ray(&self, _: usize, _: [f64; 4]) -> SensorRay {
        SensorRay { ray: self.ray, weight: 1.0 / self.paths as f64, slot: 0 }
    }

    fn regions(&self) -> Vec<SensorRegion> {
        vec![SensorRegion::split("probe")]
    }
}
