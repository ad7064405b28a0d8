//! Rays from a point through the pixels of a screen.

use super::{RegionShares, Screen, SensorMethods, SensorRay, SensorRegion, by_its_screen};
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

impl SensorMethods for Perspective {
    by_its_screen!();

    fn position(&self) -> Option<(DVec3, Side)> {
        Some((self.pinhole, Side::Outside))
    }

    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        let dir = (self.screen.view + self.screen.offset(index, u)).normalize();
        SensorRay { ray: Ray { origin: self.pinhole, dir }, weight: 1.0, slot: index }
    }
}
