//! Rays from a point through the pixels of a screen.

use super::{RegionShares, Screen, SensorKind, SensorRay, SensorRegion};
use crate::geometry::{Ray, Side};
use crate::math::DVec3;

/// Radiance per pixel at a pinhole.
#[derive(Clone, Copy, Debug)]
pub struct Perspective {
    /// The pixels, at unit distance from the pinhole.
    pub screen: Screen,
    /// Where all rays start, mm.
    pub pinhole: DVec3,
}

impl SensorKind for Perspective {
    fn pixels(&self) -> Option<(usize, usize)> {
        Some(self.screen.size())
    }

    fn position(&self) -> Option<(DVec3, Side)> {
        Some((self.pinhole, Side::Outside))
    }

    fn rays_per_pass(&self) -> usize {
        self.screen.count()
    }

    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        let dir = (self.screen.view + self.screen.offset(index, u)).normalize();
        SensorRay { ray: Ray { origin: self.pinhole, dir }, weight: 1.0, slot: index }
    }

    fn regions(&self) -> Vec<SensorRegion> {
        self.screen.regions()
    }

    #[inline]
    fn regions_of(&self, slot: usize) -> RegionShares {
        self.screen.regions_of(slot)
    }
}
