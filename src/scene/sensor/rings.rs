//! Radiant exitance of the top face of a half-space or slab by the distance between entry and exit.

use std::f64::consts::PI;

use super::{RegionShares, SensorClass, SensorMethods, SensorRay, SensorRegion};
use crate::geometry::Ray;
use crate::math::{DVec3, Frame};
use crate::sampling::warp::square_to_cosine_hemisphere;

/// Rings about a point of the top face of a half-space or slab.
///
/// The lights shine on the whole face, and every point of it is alike. So exitance at a point from light
/// that came in within a ring around it is the exitance out of that ring of light that came in at the
/// point: camera paths leave at the origin and find where light came in, photons come in at the origin
/// and leave somewhere. The distance between the two is taken along the face, also where light comes in
/// by a slab's other face; light that the surface reflects leaves where it came in, at distance 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Rings {
    /// How far outside its rays start, mm.
    pub reach: f64,
    /// Edges of the rings, mm, increasing: ring i is `edges[i] <= r < edges[i + 1]`.
    pub edges: Vec<f64>,
    /// Paths per pass.
    pub paths: usize,
}

impl Rings {
    /// The slot of what no ring holds; ring i has slot i + 1.
    const OUTSIDE: usize = 0;

    fn slot(&self, entry: DVec3) -> usize {
        let r = (entry.x * entry.x + entry.y * entry.y).sqrt();
        let below = self.edges.partition_point(|&edge| edge <= r);
        if below < self.edges.len() { below } else { Self::OUTSIDE }
    }
}

impl SensorMethods for Rings {
    fn class(&self) -> SensorClass {
        SensorClass::Entries
    }

    fn rays_per_pass(&self) -> usize {
        self.paths
    }

    /// Those of a face's flux in one bin; their slot waits for [`SensorMethods::slot_of`].
    #[inline]
    fn ray(&self, _: usize, u: [f64; 4]) -> SensorRay {
        let out = Frame::about(DVec3::Z).to_world(square_to_cosine_hemisphere([u[0], u[1]]));
        let ray = Ray { origin: self.reach * out, dir: -out };
        SensorRay { ray, weight: PI / self.paths as f64, slot: Rings::OUTSIDE }
    }

    #[inline]
    fn slot_of(&self, _: usize, entry: DVec3) -> usize {
        self.slot(entry)
    }

    fn receives(&self, is_finite: bool) -> bool {
        !is_finite
    }

    /// As of a face; light came in at the origin and counts by where `out` starts.
    #[inline]
    fn receive(&self, out: &Ray) -> Option<(usize, f64)> {
        (out.dir.z > 0.0).then(|| (self.slot(out.origin), 1.0))
    }

    fn regions(&self) -> Vec<SensorRegion> {
        let each = (0..self.edges.len() - 1).map(|ring| SensorRegion::split(format!("ring_{ring}")));
        std::iter::once(SensorRegion::split("all")).chain(each).collect()
    }

    #[inline]
    fn regions_of(&self, slot: usize) -> RegionShares {
        let all = RegionShares::one(0, 1.0);
        if slot == Rings::OUTSIDE { all } else { all.and(slot, 1.0) }
    }
}
