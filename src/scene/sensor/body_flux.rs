//! Flux of a finite body by the cosine between exit direction and axis.

use std::f64::consts::PI;

use super::{RegionShares, SensorMethods, SensorRay, SensorRegion, bin};
use crate::geometry::{BoundingSphere, Ray};
use crate::math::{DVec3, Frame, sin_cos_turns};

/// Flux of a whole body.
#[derive(Clone, Debug)]
pub struct BodyFlux {
    /// Sphere around the body.
    pub bounds: BoundingSphere,
    /// About the axis of the cosine.
    pub frame: Frame,
    /// Bins of equal width in the cosine over [-1, 1].
    pub bins: usize,
    /// Paths per bin and pass.
    pub paths: usize,
}

impl SensorMethods for BodyFlux {
    fn rays_per_pass(&self) -> usize {
        self.bins * self.paths
    }

    /// Phi_bin = int dw int L dA_perp = 2 pi dmu * pi R^2 mean(L), directions uniform in the bin,
    /// positions uniform on the disc of the bounding sphere's radius R across the direction.
    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        let BodyFlux { bounds, frame, bins, paths } = self;
        let slot = index / paths;
        let width = 2.0 / *bins as f64;
        let mu = -1.0 + width * (slot as f64 + u[0]);
        let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
        let r = (1.0 - mu * mu).max(0.0).sqrt();
        let out = frame.to_world(DVec3::new(r * cos_phi, r * sin_phi, mu));
        let ray = bounds.beam(out, [u[2], u[3]]);
        let radius = bounds.radius;
        let weight = 2.0 * PI * width * PI * radius * radius / *paths as f64;
        SensorRay { ray, weight, slot }
    }

    fn receives(&self, is_finite: bool) -> bool {
        is_finite
    }

    /// The lines of a bin are its slot, and its flux is their power: factor 1.
    #[inline]
    fn receive(&self, out: &Ray) -> Option<(usize, f64)> {
        let mu = self.frame.n.dot(out.dir);
        Some((bin(mu + 1.0, 2.0 / self.bins as f64, self.bins), 1.0))
    }

    fn regions(&self) -> Vec<SensorRegion> {
        (0..self.bins).map(|bin| SensorRegion::split(format!("flux_{bin}"))).collect()
    }

    #[inline]
    fn regions_of(&self, slot: usize) -> RegionShares {
        RegionShares::one(slot, 1.0)
    }
}
