//! Sensors: what a pass measures, as rays with weights. A pass plays every ray of the sensor once;
//! ray i belongs to one slot (a pixel, or a bin of a flux), and slots add up to regions.

use std::f64::consts::PI;

use crate::geometry::{BoundingSphere, Ray};
use crate::math::{DVec3, Frame};
use crate::sampling::warp::square_to_cosine_hemisphere;

/// What is measured.
#[derive(Clone, Debug)]
pub enum Sensor {
    /// Parallel rays through the pixels of a screen.
    Orthographic(Screen),
    /// Rays through the pixels of a screen from a cap of directions about the view.
    Accepting(Acceptance),
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
    /// Radiant exitance of the top face of a half-space or slab by how far from the exit its light came in.
    Rings(Rings),
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
    /// Whether the means of 4 by 4 tiles are observables too.
    pub has_tiles: bool,
}

/// A perspective sensor: the screen's pixel vectors are taken at unit distance from the pinhole.
pub type Pinhole = Screen;

/// A screen whose pixels accept light from a cap of directions: a pixel is the mean radiance over its
/// square and the cap, each direction weighed by its cosine to the view, as flux through the square is.
#[derive(Clone, Copy, Debug)]
pub struct Acceptance {
    screen: Screen,
    /// About the view.
    frame: Frame,
    /// Squared sine of the cap's half angle.
    sin2: f64,
    /// Sphere around the body: rays start before it.
    bounds: BoundingSphere,
}

impl Acceptance {
    /// `height` is 1 - cos of the cap's half angle, solid angle over 2 pi, in (0, 1). The screen stays
    /// where it is, even inside the body: it is the plane on which the image is sharp.
    pub fn new(screen: Screen, height: f64, bounds: BoundingSphere) -> Acceptance {
        let sin2 = height * (2.0 - height);
        Acceptance { screen, frame: Frame::about(screen.view), sin2, bounds }
    }

    /// Ray of pixel `index`: a point uniform in the pixel, a direction with density proportional to its
    /// cosine in the cap. The ray starts two radii before the body's middle: outside the body and before
    /// all of it, wherever the screen is.
    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> Ray {
        let point = self.screen.origin + self.screen.offset(index, u);
        // The cosine hemisphere's u0 is sin^2.
        let dir = self.frame.to_world(square_to_cosine_hemisphere([u[2] * self.sin2, u[3]]));
        let along = (self.bounds.center - point).dot(dir) - 2.0 * self.bounds.radius;
        Ray { origin: point + along * dir, dir }
    }

    /// The pixel whose square the line of `out` crosses, if the cap holds its reversed direction.
    #[inline]
    fn pixel(&self, out: &Ray) -> Option<usize> {
        let Screen { width, height, origin, right, down, view, .. } = self.screen;
        let cos = -out.dir.dot(view);
        let across = out.dir + cos * view;
        if cos <= 0.0 || across.length_squared() >= self.sin2 {
            return None;
        }
        let from_middle = out.at((out.origin - origin).dot(view) / cos) - origin;
        let column = from_middle.dot(right) / right.length_squared() + 0.5 * width as f64;
        let row = from_middle.dot(down) / down.length_squared() + 0.5 * height as f64;
        let inside = column >= 0.0 && column < width as f64 && row >= 0.0 && row < height as f64;
        inside.then(|| row as usize * width + column as usize)
    }

    /// Area of a pixel times the cap's solid angle weighed by cosine, pi sin^2; mm^2 sr.
    fn extent(&self) -> f64 {
        self.screen.right.length() * self.screen.down.length() * PI * self.sin2
    }
}

/// Rings about a point of the top face of a half-space or slab.
///
/// The lights shine on the whole face, and every point of it is alike. So exitance at a point from light that came
/// in within a ring around it is the exitance out of that ring of light that came in at the point: camera paths leave at
/// the origin and find where light came in, photons come in at the origin and leave somewhere. The distance between
/// the two is taken along the face, also where light comes in by a slab's other face; light that the surface
/// reflects leaves where it came in, at distance 0.
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
            Sensor::Orthographic(screen)
            | Sensor::Perspective(screen)
            | Sensor::Accepting(Acceptance { screen, .. }) => Some((screen.width, screen.height)),
            _ => None,
        }
    }

    /// Number of rays of a pass.
    pub fn rays_per_pass(&self) -> usize {
        match self {
            Sensor::Orthographic(screen)
            | Sensor::Perspective(screen)
            | Sensor::Accepting(Acceptance { screen, .. }) => screen.width * screen.height,
            Sensor::Probe { paths, .. } | Sensor::Vertex { paths, .. } => *paths,
            Sensor::FaceFlux { faces, bins, paths } => faces.len() * bins * paths,
            Sensor::Rings(rings) => rings.paths,
            Sensor::BodyFlux { bins, paths, .. } => bins * paths,
        }
    }

    /// Ray `index` of a pass for uniform numbers `u`.
    ///
    /// Fluxes: over a face, M_bin = int L mu dw = pi (mu1^2 - mu0^2) mean(L) with mu drawn with density
    /// proportional to mu inside the bin. Over a body, Phi_bin = int dw int L dA_perp
    /// = 2 pi dmu * pi R^2 mean(L), directions uniform in the bin, positions uniform on the disc of the
    /// bounding sphere's radius R across the direction.
    ///
    /// Rings: the rays are those of a face's flux in one bin; their slot waits for [`Self::slot_of`].
    #[inline]
    pub fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        match self {
            Sensor::Orthographic(screen) => {
                let origin = screen.origin + screen.offset(index, u);
                SensorRay { ray: Ray { origin, dir: screen.view }, weight: 1.0, slot: index }
            }
            Sensor::Accepting(acceptance) => {
                SensorRay { ray: acceptance.ray(index, u), weight: 1.0, slot: index }
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
            Sensor::Rings(Rings { reach, paths, .. }) => {
                let out = Frame::about(DVec3::Z).to_world(square_to_cosine_hemisphere([u[0], u[1]]));
                let ray = Ray { origin: *reach * out, dir: -out };
                SensorRay { ray, weight: PI / *paths as f64, slot: Rings::OUTSIDE }
            }
            Sensor::BodyFlux { bounds, frame, bins, paths } => {
                let slot = index / paths;
                let width = 2.0 / *bins as f64;
                let mu = -1.0 + width * (slot as f64 + u[0]);
                let (sin_phi, cos_phi) = crate::math::sin_cos_turns(u[1]);
                let r = (1.0 - mu * mu).max(0.0).sqrt();
                let out = frame.to_world(DVec3::new(r * cos_phi, r * sin_phi, mu));
                let ray = bounds.beam(out, [u[2], u[3]]);
                let radius = bounds.radius;
                let weight = 2.0 * PI * width * PI * radius * radius / *paths as f64;
                SensorRay { ray, weight, slot }
            }
        }
    }

    /// Where light counts that a ray of slot `slot` finds, having come in at the point `entry` of the body: rings look
    /// at that point, all others have decided by the ray.
    #[inline]
    pub fn slot_of(&self, slot: usize, entry: DVec3) -> usize {
        match self {
            Sensor::Rings(rings) => rings.slot(entry),
            _ => slot,
        }
    }

    /// What light that leaves the body for good along `out` scores: its slot, and the factor from the
    /// power that it carries to the slot's unit. The adjoint of [`Self::ray`]: what the rays of a slot
    /// find as radiance, all light that leaves finds as power.
    ///
    /// Power that leaves is int int L cos dA dw over the lines of the slot, whatever the surface that
    /// they are counted on (radiance is constant along a line):
    ///   body    the lines of a bin are its slot, and its flux is their power: factor 1
    ///   face    the same with power per area of the face, as every point of it is alike: factor 1
    ///   ring    as of a face; it takes light that came in at the origin, by where `out` starts: factor 1
    ///   pixel   its lines cross its square of area A within the cap, so that their power is
    ///           int_A dA int_cap L cos dw; a pixel's value is the mean of L in that very measure, whose
    ///           whole is A int_cap cos dw = A pi sin^2: factor 1 / (A pi sin^2)
    /// A slot of one line or one direction has no power: a probe, a perspective or an orthographic
    /// sensor receives nothing (see [`Self::receives`]).
    #[inline]
    pub fn receive(&self, out: &Ray) -> Option<(usize, f64)> {
        // A cosine of rounded vectors may exceed 1 by a last digit.
        let bin = |cos: f64, width: f64, bins: usize| ((cos / width) as usize).min(bins - 1);
        match self {
            Sensor::FaceFlux { faces, bins, .. } => {
                let (index, mu) = faces
                    .iter()
                    .map(|face| face.frame.n.dot(out.dir))
                    .enumerate()
                    .find(|(_, mu)| *mu > 0.0)?;
                Some((index * bins + bin(mu, 1.0 / *bins as f64, *bins), 1.0))
            }
            Sensor::Rings(rings) => (out.dir.z > 0.0).then(|| (rings.slot(out.origin), 1.0)),
            Sensor::BodyFlux { frame, bins, .. } => {
                let mu = frame.n.dot(out.dir);
                Some((bin(mu + 1.0, 2.0 / *bins as f64, *bins), 1.0))
            }
            Sensor::Accepting(acceptance) => {
                acceptance.pixel(out).map(|pixel| (pixel, 1.0 / acceptance.extent()))
            }
            Sensor::Orthographic(_)
            | Sensor::Perspective(_)
            | Sensor::Probe { .. }
            | Sensor::Vertex { .. } => None,
        }
    }

    /// Whether light that leaves the body can reach it: false where a slot is a single direction or all
    /// of its lines pass through one point.
    pub fn receives(&self) -> bool {
        match self {
            Sensor::FaceFlux { .. }
            | Sensor::Rings(_)
            | Sensor::BodyFlux { .. }
            | Sensor::Accepting(_) => true,
            Sensor::Orthographic(_)
            | Sensor::Perspective(_)
            | Sensor::Probe { .. }
            | Sensor::Vertex { .. } => false,
        }
    }

    /// The regions, those that are split by class first.
    pub fn regions(&self) -> Vec<Region> {
        let named = |name: String, split: bool| Region { name, split };
        match self {
            Sensor::Orthographic(screen)
            | Sensor::Perspective(screen)
            | Sensor::Accepting(Acceptance { screen, .. }) => {
                let count = if screen.has_tiles { TILES * TILES } else { 0 };
                let tiles = (0..count).map(|k| format!("tile_{}_{}", k / TILES, k % TILES));
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
            Sensor::Rings(rings) => {
                let each = (0..rings.edges.len() - 1).map(|ring| named(format!("ring_{ring}"), true));
                std::iter::once(named("all".into(), true)).chain(each).collect()
            }
            Sensor::BodyFlux { bins, .. } => {
                (0..*bins).map(|bin| named(format!("flux_{bin}"), true)).collect()
            }
        }
    }

    /// The regions a slot counts in, each with its factor: an image's mean and the slot's tile, all light that leaves
    /// and the slot's ring.
    #[inline]
    pub fn regions_of(&self, slot: usize) -> [(usize, f64); 2] {
        match self {
            Sensor::Orthographic(screen)
            | Sensor::Perspective(screen)
            | Sensor::Accepting(Acceptance { screen, .. }) => {
                let mean = (0, 1.0 / (screen.width * screen.height) as f64);
                if !screen.has_tiles {
                    return [mean, (0, 0.0)];
                }
                let (tile, pixels) = screen.tile(slot);
                [mean, (1 + tile, 1.0 / pixels as f64)]
            }
            Sensor::Probe { .. } | Sensor::Vertex { .. } => [(0, 1.0), (0, 0.0)],
            Sensor::FaceFlux { .. } | Sensor::BodyFlux { .. } => [(slot, 1.0), (slot, 0.0)],
            Sensor::Rings(_) if slot == Rings::OUTSIDE => [(0, 1.0), (0, 0.0)],
            Sensor::Rings(_) => [(0, 1.0), (slot, 1.0)],
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
    use crate::sampling::warp::square_to_disc;

    fn screen(width: usize, height: usize) -> Screen {
        Screen {
            width,
            height,
            origin: DVec3::Z * 5.0,
            right: DVec3::X * 0.1,
            down: -DVec3::Y * 0.1,
            view: -DVec3::Z,
            has_tiles: true,
        }
    }

    /// Without tiles an image has one region, and every pixel counts in it alone.
    #[test]
    fn tiles_can_be_left_out() {
        let with = Sensor::Orthographic(screen(7, 5));
        let without = Sensor::Orthographic(Screen { has_tiles: false, ..screen(7, 5) });
        assert_eq!((with.regions().len(), without.regions().len()), (17, 1));
        assert_eq!(with.regions_of(9)[0], without.regions_of(9)[0]);
        assert_eq!(without.regions_of(9)[1].1, 0.0);
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

    fn accepting(height: f64) -> Sensor {
        // The screen is seen from below, turned, and stands in the body.
        let view = DVec3::new(0.36, -0.48, 0.8);
        let right = view.cross(DVec3::Z).normalize();
        let screen = Screen {
            width: 6,
            height: 4,
            origin: DVec3::new(0.1, 0.2, -0.1),
            right: 0.2 * right,
            down: 0.2 * view.cross(right),
            view,
            has_tiles: true,
        };
        let bounds = BoundingSphere { center: DVec3::new(0.0, 0.5, 0.0), radius: 1.5 };
        Sensor::Accepting(Acceptance::new(screen, height, bounds))
    }

    /// Rings begin with their inner edge, end before their outer one, and count in `all` too; what none holds
    /// counts there alone. Camera paths and photons are told apart from other slots by the same distance.
    #[test]
    fn rings_by_distance_along_the_face() {
        let sensor = Sensor::Rings(Rings { reach: 1.0, edges: vec![0.5, 1.0, 5.0], paths: 3 });
        let names: Vec<String> = sensor.regions().into_iter().map(|region| region.name).collect();
        assert_eq!(names, ["all", "ring_0", "ring_1"]);
        let up = DVec3::new(0.6, 0.0, 0.8);
        for (r, regions) in [
            (0.0, [(0, 1.0), (0, 0.0)]),
            (0.4999, [(0, 1.0), (0, 0.0)]),
            (0.5, [(0, 1.0), (1, 1.0)]),
            (0.9999, [(0, 1.0), (1, 1.0)]),
            (1.0, [(0, 1.0), (2, 1.0)]),
            (4.9999, [(0, 1.0), (2, 1.0)]),
            (5.0, [(0, 1.0), (0, 0.0)]),
            (1e300, [(0, 1.0), (0, 0.0)]),
        ] {
            for depth in [0.0, 2.0] {
                let point = DVec3::new(r, 0.0, -depth);
                let slot = sensor.slot_of(0, point);
                assert_eq!(sensor.regions_of(slot), regions, "{r}");
                assert_eq!(sensor.receive(&Ray { origin: point, dir: up }), Some((slot, 1.0)));
                assert_eq!(sensor.receive(&Ray { origin: point, dir: -up }), None);
            }
        }
        let face =
            FluxFace { name: "top", point: DVec3::ZERO, reach: 1.0, frame: Frame::about(DVec3::Z) };
        let flux = Sensor::FaceFlux { faces: vec![face], bins: 1, paths: 3 };
        assert_eq!(sensor.rays_per_pass(), 3);
        for u in [0.1, 0.7] {
            let u = [u, 0.3, 0.2, 0.9];
            let (ring, face) = (sensor.ray(2, u), flux.ray(2, u));
            assert!((ring.ray.dir - face.ray.dir).length() < 1e-15);
            assert!((ring.ray.origin - face.ray.origin).length() < 1e-15);
            assert_eq!(ring.weight, face.weight);
        }
    }

    fn receiving() -> Vec<Sensor> {
        let face = |name, n| FluxFace { name, point: DVec3::ZERO, reach: 1.0, frame: Frame::about(n) };
        let faces = vec![face("top", DVec3::Z), face("bottom", -DVec3::Z)];
        let bounds = BoundingSphere { center: DVec3::X, radius: 2.0 };
        let frame = Frame::about(DVec3::new(0.6, 0.0, -0.8));
        vec![
            Sensor::FaceFlux { faces, bins: 3, paths: 2 },
            Sensor::BodyFlux { bounds, frame, bins: 5, paths: 2 },
            accepting(1e-4),
            accepting(0.9),
        ]
    }

    /// Light that goes back along any of a sensor's rays is received by the ray's slot, wherever on the
    /// line it left the body.
    #[test]
    fn light_along_a_ray_is_received_by_its_slot() {
        for sensor in receiving() {
            for index in 0..sensor.rays_per_pass() {
                for k in 0..200u32 {
                    let step = [0.819_172_513, 0.671_043_607, 0.549_700_478, 0.450_333_124];
                    let u = step.map(|step: f64| ((f64::from(k) + 0.5) * step).fract());
                    let SensorRay { ray, slot, .. } = sensor.ray(index, u);
                    let out = Ray { origin: ray.at(f64::from(k) * 0.02), dir: -ray.dir };
                    let received = sensor.receive(&out).map(|(slot, _)| slot);
                    assert_eq!(received, Some(slot), "{sensor:?} {index} {u:?}");
                }
            }
        }
    }

    /// Rays of pixels start outside the body's sphere and before it.
    #[test]
    fn rays_of_caps_start_before_the_body() {
        for height in [1e-4, 0.9] {
            let sensor = accepting(height);
            let Sensor::Accepting(Acceptance { bounds, .. }) = sensor else { unreachable!() };
            for index in 0..sensor.rays_per_pass() {
                for v in [0.0, 0.5, 0.999] {
                    let SensorRay { ray, weight, .. } = sensor.ray(index, [0.3, 0.7, v, 0.9]);
                    let to_middle = bounds.center - ray.origin;
                    assert!(to_middle.dot(ray.dir) > 1.999 * bounds.radius);
                    assert!(weight == 1.0 && (ray.dir.length() - 1.0).abs() < 1e-15);
                }
            }
        }
    }

    /// What a sensor receives from light of radiance 1 in all directions, by a sum over a grid of lines
    /// through the body's sphere: radiance 1 in every pixel, 2 pi dmu * pi R^2 in every bin. Lines are
    /// even in direction and in place across it, each worth 4 pi * pi R^2 over their number.
    #[test]
    fn uniform_light_is_received_as_radiance_one() {
        for (sensor, value, tolerance) in [
            (accepting(0.9), 1.0, 0.02),
            (accepting(0.2), 1.0, 0.05),
            (receiving().swap_remove(1), 2.0 * PI * 0.4 * PI * 4.0, 0.001),
        ] {
            let bounds = match &sensor {
                Sensor::Accepting(Acceptance { bounds, .. }) => *bounds,
                Sensor::BodyFlux { bounds, .. } => *bounds,
                _ => unreachable!(),
            };
            let n = 4_000_000u32;
            let power = 4.0 * PI * PI * bounds.radius * bounds.radius / f64::from(n);
            let slots = sensor.regions().len().max(sensor.pixels().map_or(0, |(w, h)| w * h));
            let mut sums = vec![0.0; slots];
            // Inverse powers of the real root of x^5 = x + 1: Roberts' sequence in four dimensions.
            let root = 1.167_303_978_261_418_7_f64;
            for k in 0..n {
                let u: [f64; 4] =
                    std::array::from_fn(|i| (f64::from(k) * root.powi(-(i as i32) - 1)).fract());
                let (sin, cos) = crate::math::sin_cos_turns(u[1]);
                let z = 1.0 - 2.0 * u[0];
                let r = (1.0 - z * z).sqrt();
                let dir = DVec3::new(r * cos, r * sin, z);
                let across = Frame::about(dir);
                let [x, y] = square_to_disc([u[2], u[3]]);
                let origin = bounds.center + bounds.radius * (x * across.s + y * across.t);
                if let Some((slot, factor)) = sensor.receive(&Ray { origin, dir }) {
                    sums[slot] += power * factor;
                }
            }
            let slots = sensor.pixels().map_or(5, |(w, h)| w * h);
            for (slot, sum) in sums[..slots].iter().enumerate() {
                assert!((sum / value - 1.0).abs() < tolerance, "{slot}: {sum} of {value}");
            }
        }
    }
}
