//! Parallel rays through the pixels of a screen.

use super::{RegionShares, Screen, SensorKind, SensorRay, SensorRegion};
use crate::geometry::Ray;
use crate::math::DVec3;

/// Radiance per pixel in one direction.
#[derive(Clone, Copy, Debug)]
pub struct Orthographic {
    /// The pixels, in mm.
    pub screen: Screen,
    /// Middle of the plane on which rays start, mm.
    pub center: DVec3,
}

impl SensorKind for Orthographic {
    fn pixels(&self) -> Option<(usize, usize)> {
        Some(self.screen.size())
    }

    fn rays_per_pass(&self) -> usize {
        self.screen.count()
    }

    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        let origin = self.center + self.screen.offset(index, u);
        SensorRay { ray: Ray { origin, dir: self.screen.view }, weight: 1.0, slot: index }
    }

    fn regions(&self) -> Vec<SensorRegion> {
        self.screen.regions()
    }

    #[inline]
    fn regions_of(&self, slot: usize) -> RegionShares {
        self.screen.regions_of(slot)
    }
}
