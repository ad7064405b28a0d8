//! Sensors: what a pass measures, as rays with weights. A pass plays every ray of the sensor once;
//! ray i belongs to one slot (a pixel, or a bin of a flux), and slots add up to regions.

use std::f64::consts::PI;

use crate::geometry::{BoundingSphere, Ray};
use crate::math::{DVec3, Frame};
use crate::sampling::warp::{square_to_cosine_hemisphere, square_to_disc};

/// What is measured.
#[derive(Clone, Debug)]
pub enum Sensor {
    /// Parallel rays through the pixels of a screen.
    Orthographic(Screen),
    /// Rays from a point through the pixels of a screen.
    Perspective(Pinhole),
    /// One ray, played `paths` times per pass.
    Probe {
        /// The ray.
        ray: Ray,
        /// Paths per pass.
        paths: usize,
    },
    /// A medium vertex, played `paths` times per pass: the ray starts there and travels as a path arrives.
    Vertex {
        /// The vertex and the direction of arrival.
        ray: Ray,
        /// Paths per pass.
        paths: usize,
    },
    /// Radiant exitance of a half-space's or slab's faces by the cosine of the exit direction.
    FaceFlux {
        /// The faces, top first.
        faces: Vec<FluxFace>,
        /// Bins of equal width in the cosine over (0, 1].
        bins: usize,
        /// Paths per bin and pass.
        paths: usize,
    },
    /// Flux of a finite body by the cosine between exit direction and axis.
    BodyFlux {
        /// Sphere around the body.
        bounds: BoundingSphere,
        /// About the axis of the cosine.
        frame: Frame,
        /// Bins of equal width in the cosine over [-1, 1].
        bins: usize,
        /// Paths per bin and pass.
        paths: usize,
    },
}

/// A rectangle of square pixels; row 0 at the top.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Middle of the image plane, mm (orthographic) or the pinhole (perspective).
    pub origin: DVec3,
    /// s right, t down, n along the view; scaled: one pixel is |s| = |t| long.
    pub right: DVec3,
    /// Down by one pixel.
    pub down: DVec3,
    /// Unit vector of view.
    pub view: DVec3,
}

/// A perspective sensor: the screen's pixel vectors are taken at unit distance from the pinhole.
pub type Pinhole = Screen;

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

/// A ray of the sensor and what it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorRay {
    /// The ray, against the flow of light.
    pub ray: Ray,
    /// Factor from radiance to the slot's unit, the mean over the slot's rays included.
    pub weight: f64,
    /// Pixel or bin.
    pub slot: usize,
}

/// A sum of slots that tables speak of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// Its name.
    pub name: String,
    /// True where transport classes and lights are told apart.
    pub split: bool,
}

/// Tiles per side of an image.
const TILES: usize = 4;

impl Sensor {
    /// Pixels per row and rows, for images.
    pub fn pixels(&self) -> Option<(usize, usize)> {
        match self {
            Sensor::Orthographic(screen) | Sensor::Perspective(screen) => {
                Some((screen.width, screen.height))
            }
            _ => None,
        }
    }

    /// Number of rays of a pass.
    pub fn rays_per_pass(&self) -> usize {
        match self {
            Sensor::Orthographic(screen) | Sensor::Perspective(screen) => screen.width * screen.height,
            Sensor::Probe { paths, .. } | Sensor::Vertex { paths, .. } => *paths,
            Sensor::FaceFlux { faces, bins, paths } => faces.len() * bins * paths,
            Sensor::BodyFlux { bins, paths, .. } => bins * paths,
        }
    }

    /// Ray `index` of a pass for uniform numbers `u`.
    ///
    /// Fluxes: over a face, M_bin = int L mu dw = pi (mu1^2 - mu0^2) mean(L) with mu drawn with density
    /// proportional to mu inside the bin. Over a body, Phi_bin = int dw int L dA_perp
    /// = 2 pi dmu * pi R^2 mean(L), directions uniform in the bin, positions uniform on the disc of the
    /// bounding sphere's radius R across the direction.
    #[inline]
    pub fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        match self {
            Sensor::Orthographic(screen) => {
                let origin = screen.origin + screen.offset(index, u);
                SensorRay { ray: Ray { origin, dir: screen.view }, weight: 1.0, slot: index }
            }
            Sensor::Perspective(screen) => {
                let dir = (screen.view + screen.offset(index, u)).normalize();
                SensorRay { ray: Ray { origin: screen.origin, dir }, weight: 1.0, slot: index }
            }
            Sensor::Probe { ray, paths } | Sensor::Vertex { ray, paths } => {
                SensorRay { ray: *ray, weight: 1.0 / *paths as f64, slot: 0 }
            }
            Sensor::FaceFlux { faces, bins, paths } => {
                let slot = index / paths;
                let (face, bin) = (&faces[slot / bins], slot % bins);
                let edge = |b: usize| (b * b) as f64 / (bins * bins) as f64;
                // mu^2 is uniform in the bin; the cosine hemisphere's u0 is 1 - mu^2.
                let mu2 = edge(bin) + (edge(bin + 1) - edge(bin)) * (1.0 - u[0]);
                let out = face.frame.to_world(square_to_cosine_hemisphere([1.0 - mu2, u[1]]));
                let weight = PI * (edge(bin + 1) - edge(bin)) / *paths as f64;
                SensorRay { ray: Ray { origin: face.point + face.reach * out, dir: -out }, weight, slot }
            }
            Sensor::BodyFlux { bounds, frame, bins, paths } => {
                let slot = index / paths;
                let width = 2.0 / *bins as f64;
                let mu = -1.0 + width * (slot as f64 + u[0]);
                let (sin_phi, cos_phi) = crate::math::sin_cos_turns(u[1]);
                let r = (1.0 - mu * mu).max(0.0).sqrt();
                let out = frame.to_world(DVec3::new(r * cos_phi, r * sin_phi, mu));
                let across = Frame::about(out);
                let [x, y] = square_to_disc([u[2], u[3]]);
                let radius = bounds.radius;
                let origin = bounds.center + radius * (2.0 * out + x * across.s + y * across.t);
                let weight = 2.0 * PI * width * PI * radius * radius / *paths as f64;
                SensorRay { ray: Ray { origin, dir: -out }, weight, slot }
            }
        }
    }

    /// The regions, those that are split by class first.
    pub fn regions(&self) -> Vec<Region> {
        let named = |name: String, split: bool| Region { name, split };
        match self {
            Sensor::Orthographic(_) | Sensor::Perspective(_) => {
                let tiles = (0..TILES * TILES).map(|k| format!("tile_{}_{}", k / TILES, k % TILES));
                std::iter::once(named("mean".into(), true))
                    .chain(tiles.map(|name| named(name, false)))
                    .collect()
            }
            Sensor::Probe { .. } => vec![named("probe".into(), true)],
            Sensor::Vertex { .. } => vec![named("vertex".into(), true)],
            Sensor::FaceFlux { faces, bins, .. } => faces
                .iter()
                .flat_map(|face| (0..*bins).map(move |bin| named(format!("{}_{bin}", face.name), true)))
                .collect(),
            Sensor::BodyFlux { bins, .. } => {
                (0..*bins).map(|bin| named(format!("flux_{bin}"), true)).collect()
            }
        }
    }

    /// The regions a slot counts in, each with its factor: an image's mean and the slot's tile.
    #[inline]
    pub fn regions_of(&self, slot: usize) -> [(usize, f64); 2] {
        match self {
            Sensor::Orthographic(screen) | Sensor::Perspective(screen) => {
                let (tile, pixels) = screen.tile(slot);
                [(0, 1.0 / (screen.width * screen.height) as f64), (1 + tile, 1.0 / pixels as f64)]
            }
            Sensor::Probe { .. } | Sensor::Vertex { .. } => [(0, 1.0), (0, 0.0)],
            Sensor::FaceFlux { .. } | Sensor::BodyFlux { .. } => [(slot, 1.0), (slot, 0.0)],
        }
    }
}

impl Screen {
    /// From the middle of the image to a point of pixel `index`.
    #[inline]
    fn offset(&self, index: usize, u: [f64; 4]) -> DVec3 {
        let column = (index % self.width) as f64 + u[0] - 0.5 * self.width as f64;
        let row = (index / self.width) as f64 + u[1] - 0.5 * self.height as f64;
        column * self.right + row * self.down
    }

    /// The tile of a pixel and the number of pixels in that tile. Tiles are as even as integers allow.
    #[inline]
    fn tile(&self, pixel: usize) -> (usize, usize) {
        let across = |at: usize, size: usize| {
            let tile = at * TILES / size;
            // First index with at * TILES >= tile * size, and of the next tile.
            let start = (tile * size).div_ceil(TILES);
            let end = ((tile + 1) * size).div_ceil(TILES);
            (tile, end - start)
        };
        let (column, columns) = across(pixel % self.width, self.width);
        let (row, rows) = across(pixel / self.width, self.height);
        (row * TILES + column, rows * columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn screen(width: usize, height: usize) -> Screen {
        Screen {
            width,
            height,
            origin: DVec3::Z * 5.0,
            right: DVec3::X * 0.1,
            down: -DVec3::Y * 0.1,
            view: -DVec3::Z,
        }
    }

    /// Every pixel lies in one tile, and a tile's factor is one over its pixels.
    #[test]
    fn tiles_partition_images() {
        for (width, height) in [(64, 64), (7, 5), (4, 9), (3, 2)] {
            let screen = screen(width, height);
            let mut counts = [0usize; TILES * TILES];
            for pixel in 0..width * height {
                counts[screen.tile(pixel).0] += 1;
            }
            for pixel in 0..width * height {
                let (tile, pixels) = screen.tile(pixel);
                assert_eq!(counts[tile], pixels, "{width}x{height} pixel {pixel}");
            }
        }
    }

    /// The weights of a flux integrate a radiance of 1 to pi per face and 4 pi * pi R^2 per body.
    #[test]
    fn flux_of_constant_radiance() {
        let face =
            |name| FluxFace { name, point: DVec3::ZERO, reach: 1.0, frame: Frame::about(DVec3::Z) };
        let slab = Sensor::FaceFlux { faces: vec![face("top"), face("bottom")], bins: 3, paths: 2 };
        let body = Sensor::BodyFlux {
            bounds: BoundingSphere { center: DVec3::X, radius: 2.0 },
            frame: Frame::about(DVec3::Y),
            bins: 5,
            paths: 4,
        };
        for (sensor, expected) in [(slab, 2.0 * PI), (body, 4.0 * PI * PI * 4.0)] {
            let rays = (0..sensor.rays_per_pass()).map(|i| sensor.ray(i, [0.4, 0.3, 0.2, 0.1]));
            let sum: f64 = rays.map(|r| r.weight).sum();
            assert!((sum / expected - 1.0).abs() < 1e-14);
        }
    }

    /// Directions fall into the bin that their slot names.
    #[test]
    fn directions_lie_in_their_bins() {
        let sensor = Sensor::BodyFlux {
            bounds: BoundingSphere { center: DVec3::ZERO, radius: 1.0 },
            frame: Frame::about(DVec3::Y),
            bins: 4,
            paths: 1,
        };
        for i in 0..4 {
            for u in [0.0, 0.5, 0.999] {
                let ray = sensor.ray(i, [u, 0.3, 0.5, 0.5]);
                assert_eq!(((-ray.ray.dir.y + 1.0 + 1e-12) * 2.0) as usize, ray.slot);
            }
        }
    }
}
