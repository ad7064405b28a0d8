//! Radiant exitance of the faces of a half-space or slab by the cosine of the exit direction.

use std::f64::consts::PI;

use super::{RegionShares, SensorMethods, SensorRay, SensorRegion, bin};
use crate::geometry::Ray;
use crate::math::{DVec3, Frame};
use crate::sampling::warp::square_to_cosine_hemisphere;

/// Radiant exitance of faces; every point of a face is alike.
#[derive(Clone, Debug)]
pub struct FaceFlux {
    /// The faces, top first.
    pub faces: Vec<FluxFace>,
    /// Bins of equal width in the cosine over (0, 1].
    pub bins: usize,
    /// Paths per bin and pass.
    pub paths: usize,
}

/// One face of a half-space or slab.
#[derive(Clone, Debug)]
pub struct FluxFace {
    /// `top` or `bottom`.
    pub name: &'static str,
    /// A point of it.
    pub point: DVec3,
    /// How far outside its rays start, mm.
    pub reach: f64,
    /// Its outward normal and tangents.
    pub frame: Frame,
}

impl SensorMethods for FaceFlux {
    fn rays_per_pass(&self) -> usize {
        self.faces.len() * self.bins * self.paths
    }

    /// M_bin = int L mu dw = pi (mu1^2 - mu0^2) mean(L), with mu drawn with density proportional to mu
    /// inside the bin.
    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        let FaceFlux { faces, bins, paths } = self;
        let slot = index / paths;
        let (face, bin) = (&faces[slot / bins], slot % bins);
        let edge = |b: usize| (b * b) as f64 / (bins * bins) as f64;
        // mu^2 is uniform in the bin; the cosine hemisphere's u0 is 1 - mu^2.
        let mu2 = edge(bin) + (edge(bin + 1) - edge(bin)) * (1.0 - u[0]);
        let out = face.frame.to_world(square_to_cosine_hemisphere([1.0 - mu2, u[1]]));
        let weight = PI * (edge(bin + 1) - edge(bin)) / *paths as f64;
        SensorRay { ray: Ray { origin: face.point + face.reach * out, dir: -out }, weight, slot }
    }

    fn receives(&self, is_finite: bool) -> bool {
        !is_finite
    }

    /// The lines of a bin are its slot, and its exitance is their power per area of the face, as every
    /// point of it is alike: factor 1.
    #[inline]
    fn receive(&self, out: &Ray) -> Option<(usize, f64)> {
        let (index, mu) = self
            .faces
            .iter()
            .map(|face| face.frame.n.dot(out.dir))
            .enumerate()
            .find(|(_, mu)| *mu > 0.0)?;
        Some((index * self.bins + bin(mu, 1.0 / self.bins as f64, self.bins), 1.0))
    }

    fn regions(&self) -> Vec<SensorRegion> {
        let bins = |face: &FluxFace| {
            let name = face.name;
            (0..self.bins).map(move |bin| SensorRegion::split(format!("{name}_{bin}")))
        };
        self.faces.iter().flat_map(bins).collect()
    }

    #[inline]
    fn regions_of(&self, slot: usize) -> RegionShares {
        RegionShares::one(slot, 1.0)
    }
}
