//! Directions that photons teach, for light that reaches a medium vertex by a chain: through a refraction and internal
//! reflections, or through another part of a body that is not convex. Neither a connection nor a guess finds such light, and a
//! walk meets a small light by it only by chance, with the whole radiance of the light.
//!
//! Before the passes, photons are traced from the lights to their first scattering event (Jensen 1995, "Importance driven path
//! tracing using the photon map"). Of every flight inside after two or more events at the boundary, the voxels of a grid that it
//! crosses take down the direction against it. At a medium vertex x in a voxel with n such directions d_i, an extra direction w is
//! drawn from
//!   p(w | x) = 1/n sum_i [w . d_i >= c_n] / (2 pi (1 - c_n))
//! (of two grids: a coarse one has directions where the fine one has few), with probability q, and followed as the walk would
//! follow it, to the next scattering event. Where it meets lights after it has met the boundary twice, it scores. The walk
//! draws the same w with density p_w(w), and everything after it is drawn alike, so that by the balance heuristic over both the
//! scores of a chain that began with w are divided by
//!   1 + q p(w | x) / p_w(w),
//! whichever of the two drew it. p may be any function of x and w: photons make no result biased.
//!
//! The cap about a direction is as wide as the lights, the boundary's lobes and the differences between facets are; where n is
//! small it is wider (c_n), as the bandwidth of a density estimate.

use std::f64::consts::PI;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::guide::Guide;
use crate::estimators::crossing::other;
use crate::estimators::field::Path;
use crate::geometry::{BoundingSphere, Ray, Side};
use crate::math::{DVec3, Frame, cos};
use crate::optics::boundary::{Boundary, Event};
use crate::sampling::discrete::choose_share;
use crate::sampling::distance::sample_exponential;
use crate::sampling::stream::{Purpose, Stream, StreamKey};
use crate::sampling::warp::{pdf_cap, square_to_cap};
use crate::scene::Scene;

/// Options of the photons.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Photons {
    /// Number of photons, for all bands with the same boundary.
    #[serde(default = "paths")]
    #[schemars(range(min = 64, max = 16777216))]
    pub paths: u64,
    /// Probability with which a medium vertex draws a direction, where photons have passed near it.
    #[serde(default = "most")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub most: f64,
}

fn paths() -> u64 {
    1 << 20
}

fn most() -> f64 {
    0.5
}

/// Voxels along a side of the grids, and the share of draws from each: where few photons have passed, more have in a larger voxel.
const GRIDS: [(usize, f64); 2] = [(64, 0.75), (16, 0.25)];

/// Half the angle of a cap beyond what the lights and the boundary spread, rad: directions differ from facet to facet.
const LEAST_CAP: f64 = 0.03;

/// Directions that fill a voxel: where there are fewer, caps about them are as much larger in area.
const ENOUGH: usize = 32;

/// Events at the boundary after which a photon is no longer followed.
const MOST_EVENTS: u32 = 16;

/// Directions against the flights of photons.
#[derive(Debug)]
pub(super) struct PhotonMap {
    /// The probability of drawing a direction at all.
    pub most: f64,
    /// As in [`GRIDS`].
    grids: Vec<DirectionGrid>,
    /// 1 - cos of half the angle of the caps about the directions of a voxel with 0, 1, 2 .. of them, and of all with more.
    heights: Vec<f64>,
}

/// Directions voxel by voxel.
#[derive(Debug)]
struct DirectionGrid {
    low: DVec3,
    /// Voxels per mm.
    scale: f64,
    /// Voxels along a side.
    count: usize,
    /// Where the directions of a voxel begin; one more than there are voxels.
    starts: Vec<u32>,
    directions: Vec<[f32; 3]>,
}

/// A direction in which a path has left a medium vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainStart {
    pub x: DVec3,
    pub arrival: DVec3,
    pub dir: DVec3,
    /// The walk's density of it over that of the phase function.
    pub turn: f64,
    /// Whether the path has met the boundary again after that point of it at which it could leave for the light.
    pub is_chain: bool,
}

/// State of a path that photons guide.
#[derive(Clone, Debug)]
pub(super) struct Chains {
    /// Of directions with what follows, and of the light samples there.
    pub streams: [Stream; 2],
    /// Since the latest medium vertex.
    pub start: Option<ChainStart>,
    /// A direction that was drawn is followed, and is no chain yet: nothing is scored.
    pub is_muted: bool,
}

impl Chains {
    pub(super) fn of_path(path: &Path) -> Chains {
        let stream = |purpose| path.key.stream(path.index as u64, purpose);
        let streams = [stream(Purpose::Chain), stream(Purpose::ChainLight)];
        Chains { streams, start: None, is_muted: false }
    }

    /// A path with this vertex and arrival leaves towards `dir`.
    pub(super) fn start(&mut self, Ray { origin: x, dir: arrival }: Ray, dir: DVec3, turn: f64) {
        self.start = Some(ChainStart { x, arrival, dir, turn, is_chain: false });
    }

    /// It comes into the body, or meets it again from outside.
    pub(super) fn come_back(&mut self) {
        self.is_muted = false;
        if let Some(start) = &mut self.start {
            start.is_chain = true;
        }
    }
}

impl PhotonMap {
    /// The maps of all bands with these guides. Bands with the same boundary share one, by the photons of the band with the least
    /// extinction, which fly farthest; the weights hold for any map.
    pub(super) fn of_bands(
        scene: &Scene,
        bounds: &BoundingSphere,
        guides: &[Arc<[Guide]>],
        options: Photons,
    ) -> Vec<Option<Arc<PhotonMap>>> {
        let is_alike = |a: usize, b: usize| {
            scene.boundary[a] == scene.boundary[b] && guides[a].is_empty() == guides[b].is_empty()
        };
        let mut maps: Vec<Option<Arc<PhotonMap>>> = Vec::new();
        for band in 0..guides.len() {
            let map = match (0..band).find(|&earlier| is_alike(earlier, band)) {
                Some(earlier) => maps[earlier].clone(),
                None => (band..guides.len())
                    .filter(|&other| is_alike(band, other))
                    .min_by(|&a, &b| scene.medium[a].sigma_t.total_cmp(&scene.medium[b].sigma_t))
                    .and_then(|least| PhotonMap::new(scene, bounds, least, &guides[least], options))
                    .map(Arc::new),
            };
            maps.push(map);
        }
        maps
    }

    /// Of the lights that the guides are of; nothing where no chain can be found from inside.
    fn new(
        scene: &Scene,
        bounds: &BoundingSphere,
        band: usize,
        guides: &[Guide],
        options: Photons,
    ) -> Option<PhotonMap> {
        let boundary = &scene.boundary[band];
        let is_found = |guide: &&Guide| !boundary.is_delta() || guide.half_angle > 0.0;
        let guides: Vec<&Guide> = guides.iter().filter(is_found).collect();
        let widest = guides.iter().map(|guide| guide.half_angle).reduce(f64::max)?;
        let roughness = match boundary {
            Boundary::Rough { facets, .. } => facets.alpha,
            _ => 0.0,
        };
        let spread = LEAST_CAP + 1.2 * widest + 2.0 * roughness;
        let height = |n: usize| {
            let wider = (ENOUGH as f64 / n.max(1) as f64).sqrt();
            1.0 - cos((wider * spread).min(PI))
        };
        let mut flights = Vec::new();
        let key = StreamKey::named("what photons teach");
        for photon in 0..options.paths {
            let mut stream = key.pass(photon).stream(band as u64, Purpose::Walk);
            trace(scene, bounds, band, &guides, &mut stream, &mut flights);
        }
        let grids: Vec<DirectionGrid> =
            GRIDS.iter().map(|(count, _)| DirectionGrid::new(bounds, *count, &flights)).collect();
        let heights = (0..=ENOUGH).map(height).collect();
        (!flights.is_empty()).then_some(PhotonMap { most: options.most, grids, heights })
    }

    /// The directions of a grid at a point, and 1 - cos of half the angle of the caps about them.
    fn at<'a>(&self, grid: &'a DirectionGrid, x: DVec3) -> (&'a [[f32; 3]], f64) {
        let directions = grid.at(x);
        (directions, self.heights[directions.len().min(ENOUGH)])
    }

    /// A direction at x, where photons have passed near it.
    pub(super) fn sample(&self, x: DVec3, stream: &mut Stream) -> Option<DVec3> {
        let (grid, _) = choose_share(GRIDS.iter().map(|(_, share)| *share), stream.draw())?;
        let (directions, height) = self.at(&self.grids[grid], x);
        let [u, v, w] = stream.draw3();
        let index = ((u * directions.len() as f64) as usize).min(directions.len().checked_sub(1)?);
        Some(Frame::about(unit(directions[index])).to_world(square_to_cap(height, [v, w])))
    }

    /// The density of [`Self::sample`] per solid angle, with the probability of drawing at all.
    pub(super) fn density(&self, x: DVec3, dir: DVec3) -> f64 {
        let of_grid = |(grid, (_, share)): (&DirectionGrid, &(usize, f64))| {
            let (directions, height) = self.at(grid, x);
            let near = directions.iter().filter(|d| unit(**d).dot(dir) >= 1.0 - height).count();
            if near == 0 { 0.0 } else { share * pdf_cap(height) * near as f64 / directions.len() as f64 }
        };
        self.most * self.grids.iter().zip(&GRIDS).map(of_grid).sum::<f64>()
    }

    /// Memory behind it, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        let of = |grid: &DirectionGrid| size_of_val(&*grid.starts) + size_of_val(&*grid.directions);
        self.grids.iter().map(of).sum()
    }
}

/// A photon's flight inside the body.
struct Flight {
    ray: Ray,
    length: f64,
}

/// Follows one photon to its first scattering event; its flights inside after two events at the boundary are those of a chain.
fn trace(
    scene: &Scene,
    bounds: &BoundingSphere,
    band: usize,
    guides: &[&Guide],
    stream: &mut Stream,
    flights: &mut Vec<Flight>,
) -> Option<()> {
    let (boundary, medium) = (&scene.boundary[band], &scene.medium[band]);
    let (index, _) = choose_share(guides.iter().map(|guide| guide.choice), stream.draw())?;
    let guide = guides[index];
    let light = guide.sample(&scene.lights[guide.light], band, stream.draw2());
    let mut ray = bounds.beam(light.wi, stream.draw2());
    let (mut side, mut from) = (Side::Outside, None);
    for events in 0..MOST_EVENTS {
        let t = match side {
            Side::Inside => sample_exponential(medium.sigma_t, stream.draw()),
            Side::Outside => f64::INFINITY,
        };
        let hit = scene.shape.intersect(&ray, side, from, t);
        if side == Side::Inside && events > 1 {
            let length = hit.map_or(t, |hit| hit.t);
            flights.push(Flight { ray, length });
        }
        let hit = hit?;
        let frame = Frame::about(hit.shading_normal);
        let wo = frame.to_local(-ray.dir);
        if (wo.z > 0.0) != (side == Side::Outside) {
            return None;
        }
        let sample = boundary.sample(wo, stream.draw3())?;
        let dir = frame.to_world(sample.wi);
        side = if sample.event == Event::Refract { other(side) } else { side };
        if (dir.dot(hit.normal) > 0.0) != (side == Side::Outside) {
            return None;
        }
        (ray, from) = (Ray { origin: hit.point, dir }, Some(hit.face));
    }
    None
}

impl DirectionGrid {
    fn new(bounds: &BoundingSphere, count: usize, flights: &[Flight]) -> DirectionGrid {
        let low = bounds.center - DVec3::splat(bounds.radius);
        let scale = count as f64 / (2.0 * bounds.radius);
        let (starts, directions) = (vec![0; count * count * count + 1], Vec::new());
        let mut grid = DirectionGrid { low, scale, count, starts, directions };
        let mut noted = Vec::new();
        for flight in flights {
            let back = (-flight.ray.dir).to_array().map(|c| c as f32);
            grid.cross(flight, |voxel| noted.push((voxel, back)));
        }
        for (voxel, _) in &noted {
            grid.starts[voxel + 1] += 1;
        }
        for voxel in 1..grid.starts.len() {
            grid.starts[voxel] += grid.starts[voxel - 1];
        }
        let mut next = grid.starts.clone();
        grid.directions = vec![[0.0; 3]; noted.len()];
        for (voxel, direction) in noted {
            grid.directions[next[voxel] as usize] = direction;
            next[voxel] += 1;
        }
        grid
    }

    fn voxel(&self, point: DVec3) -> Option<usize> {
        let at = (point - self.low) * self.scale;
        // A negative number becomes 0, which is not below it.
        let [x, y, z] = at.to_array().map(|c| c as usize);
        let is_inside = at.min_element() >= 0.0 && x.max(y).max(z) < self.count;
        is_inside.then(|| (z * self.count + y) * self.count + x)
    }

    /// Visits the voxels that a flight crosses: those of points half a voxel apart.
    fn cross(&self, Flight { ray, length }: &Flight, mut visit: impl FnMut(usize)) {
        let steps = (length * self.scale * 2.0).ceil().clamp(1.0, 4.0 * self.count as f64);
        let mut last = None;
        for step in 0..=steps as u32 {
            let voxel = self.voxel(ray.at(length * f64::from(step) / steps));
            if let Some(voxel) = voxel.filter(|_| voxel != last) {
                visit(voxel);
            }
            last = voxel;
        }
    }

    /// The directions of the voxel of a point.
    fn at(&self, x: DVec3) -> &[[f32; 3]] {
        self.voxel(x).map_or(&[], |voxel| {
            &self.directions[self.starts[voxel] as usize..self.starts[voxel + 1] as usize]
        })
    }
}

fn unit(direction: [f32; 3]) -> DVec3 {
    DVec3::from(direction.map(f64::from)).normalize()
}

#[cfg(test)]
#[path = "photons_tests.rs"]
mod tests;
