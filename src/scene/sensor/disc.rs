//! Parallel rays through a disc.

use super::{SensorMethods, SensorRay, SensorRegion};
use crate::geometry::{Ray, Side};
use crate::math::{DVec3, Frame};
use crate::sampling::warp::square_to_disc;

/// Mean radiance over a disc, along its axis.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    /// Centre, mm, and direction of the rays.
    pub axis: Ray,
    /// Radius, mm.
    pub radius: f64,
    /// Paths per pass.
    pub paths: usize,
}

impl SensorMethods for Disc {
    fn position(&self) -> Option<(DVec3, Side)> {
        Some((self.axis.origin, Side::Outside))
    }

    fn rays_per_pass(&self) -> usize {
        self.paths
    }

    #[inline]
    fn ray(&self, _: usize, [a, b, ..]: [f64; 4]) -> SensorRay {
        let [x, y] = square_to_disc([a, b]);
        let offset = self.radius * DVec3::new(x, y, 0.0);
        let origin = self.axis.origin + Frame::about(self.axis.dir).to_world(offset);
        let ray = Ray { origin, ..self.axis };
        SensorRay { ray, weight: 1.0 / self.paths as f64, slot: 0 }
    }

    fn regions(&self) -> Vec<SensorRegion> {
        vec![SensorRegion::split("disc")]
    }
}
