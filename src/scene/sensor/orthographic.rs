//! Parallel rays through the pixels of a screen.

use super::{RegionShares, Screen, SensorMethods, SensorRay, SensorRegion, by_its_screen};
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

impl SensorMethods for Orthographic {
    by_its_screen!();

    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        let origin = self.center + self.screen.offset(index, u);
        SensorRay { ray: Ray { origin, dir: self.screen.view }, weight: 1.0, slot: index }
    }
}
