//! Directions that photons teach.
//!
//! A walk meets a small light by chance, and then scores its whole radiance. A guess of where light enters fails among the facets
//! of a scan, and neither a guess nor a connection finds light that reaches a medium vertex by a chain: through a refraction and
//! internal reflections, or through another part of a body that is not convex.
//!
//! Before the passes, photons are traced from the lights (Jensen 1995, "Importance driven path tracing using the photon map").
//! The voxels of a grid that their flights inside cross take down the directions against them, up to the first scattering event.
//! Flights after one refraction have their own grids, so that they do not drown those of chains. At a medium vertex x in a voxel
//! with n directions d_i, an extra direction w is drawn from
//!   p(w | x) = 1/n sum_i sum_c s_c [w . d_i >= 1 - c] / (2 pi c)
//! with probability q(x), and followed to the boundary; c are the heights of caps of three widths, with shares s_c. (Of two grids:
//! a coarse one has directions where the fine one has few.) A direction after one refraction ends at its first meeting with the
//! boundary, and finds lights from there alone; one of chains goes on as the walk would, to the next scattering event.
//! The walk draws the same w with density p_w(w) and reaches the boundary with probability T, the transmittance up to there;
//! everything after that is drawn alike, so that by the balance heuristic over both the densities of what BSDF and light sampling find
//! after w become
//!   1 + q p(w | x) / (p_w(w) T)
//! times as large, whichever of the two drew w, and whatever other techniques they are weighed against; q p is the sum over both kinds
//! for lights that are found from the first meeting, and that of chains for lights beyond it. q and p may be any
//! functions of x and w: photons make no result biased. (A guided walk has its own probability of
//! reaching the boundary and draws later flights by its guide, so that all densities are formed over those of a plain walk.)
//!
//! Caps are as wide as the lights, the boundary's lobes and the differences between facets are; where n is small they are wider,
//! as the bandwidth of a density estimate. The widest is for facets next to those that photons have met: a walk that meets
//! the light by one of these, beyond the other caps, scores the whole radiance. q is proportional to the number of photons that have crossed the voxel, up to a largest
//! and, for chains, down to a least value: most vertices receive little light, and following an extra direction takes as long as
//! several steps of the walk.
//!
//! Nearly every vertex asks for q, and nearly none draws: the q of both kinds stand side by side, apart from the lists of
//! directions. A density goes through all directions of up to four lists, eight at a time.

use std::f64::consts::PI;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::guide::Guide;
use crate::estimators::crossing::other;
use crate::estimators::walk::Meeting;
use crate::geometry::{BoundingSphere, Ray, Side};
use crate::math::lanes::{LANES, VectorLanes, set_vector, vector};
use crate::math::{DVec3, Frame, Vectorized, cos, vectorized};
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
    /// Probability with which a medium vertex draws a direction, where many photons have passed near it.
    ///
    /// Where there are fewer, it is smaller.
    #[serde(default = "most")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub most: f64,
}

/// The kinds of photons' flights, and of directions that are drawn against them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PhotonKind {
    /// After one refraction: such a direction finds lights from its first meeting with the boundary.
    Once,
    /// Of chains: such a direction is followed beyond it.
    OfChains,
}

impl PhotonKind {
    pub(super) const ALL: [PhotonKind; 2] = [PhotonKind::Once, PhotonKind::OfChains];

    /// The last meeting with the boundary from which such a direction finds lights.
    pub(super) fn until(self) -> Meeting {
        match self {
            PhotonKind::Once => Meeting::First,
            PhotonKind::OfChains => Meeting::Later,
        }
    }
}

/// Photons as a band uses them.
#[derive(Clone, Debug)]
pub(super) struct PhotonGuide {
    pub map: Arc<PhotonMap>,
    /// The probability of drawing a direction of a kind where many photons have passed.
    pub most: f64,
}

fn paths() -> u64 {
    1 << 20
}

fn most() -> f64 {
    1.0
}

/// Voxels along a side of the finer grids.
const FINE: usize = 64;

/// Voxels along a side of the grids, and the share of draws from each: where few photons have passed, more have in a larger voxel.
const GRIDS: [(usize, f64); 2] = [(FINE, 0.75), (16, 0.25)];

/// Directions that fill a voxel: where there are fewer, caps about them are as much larger in area.
const ENOUGH: usize = 32;

/// What is kept of the flights of a kind.
#[derive(Clone, Copy)]
struct Keep {
    /// Directions of a voxel.
    directions: u32,
    /// The share of all photons that has to cross a fine voxel for a draw to be certain there; in a coarse one it is as much larger
    /// as the sides of the voxel are larger in area.
    certain: f64,
    /// The least probability of a draw.
    least: f64,
}

/// Of each kind. Light after one refraction is found by other techniques, too; nothing else finds that of chains.
const KEEP: [Keep; 2] = [
    Keep { directions: 64, certain: 1.0 / 8192.0, least: 0.0 },
    Keep { directions: 256, certain: 1.0 / 8192.0, least: 0.1 },
];

/// Flights of chains are drawn with this much less extinction. Long chords carry little light, but a walk that meets the light along
/// one that no photon has taken scores the whole radiance.
const STRETCH: f64 = 2.0;

/// Events at the boundary after which a photon is no longer followed.
const MOST_EVENTS: u32 = 16;

/// Heights 1 - cos of caps, from narrow to wide.
type Caps = [f64; 3];

/// Shares of the caps.
const SHARES: Caps = [0.7, 0.24, 0.06];

/// Directions against the flights of photons.
#[derive(Debug)]
pub(super) struct PhotonMap {
    /// As in [`GRIDS`].
    grids: Vec<DirectionGrid>,
    /// The caps about the directions of a voxel with 0, 1, 2 .. of them, and of all with more than are listed.
    caps: Vec<Caps>,
}

/// Directions voxel by voxel.
#[derive(Debug)]
struct DirectionGrid {
    low: DVec3,
    /// Voxels per mm.
    scale: f64,
    /// Voxels along a side.
    count: usize,
    /// The probability with which a direction of each kind is drawn, over [`PhotonGuide::most`], as [`Self::voxel`] counts voxels.
    chances: Vec<[f32; 2]>,
    /// Directions of each kind, in the same order.
    lists: Vec<[DirectionList; 2]>,
    /// List by list, each filled up with NaN.
    directions: Vec<VectorLanes>,
}

/// Directions of a kind in a voxel.
#[derive(Clone, Copy, Debug, Default)]
struct DirectionList {
    /// Where they begin.
    start: u32,
    /// How many there are.
    count: u32,
}

impl PhotonMap {
    /// The maps of all bands with these guides. Bands with the same boundary share one, by the photons of the band with the least
    /// extinction, which fly farthest; the weights hold for any map.
    pub(super) fn of_bands(
        scene: &Scene,
        bounds: &BoundingSphere,
        guides: &[Arc<[Guide]>],
        options: Photons,
    ) -> Vec<Option<PhotonGuide>> {
        let is_alike = |a: usize, b: usize| {
            scene.boundary[a] == scene.boundary[b] && guides[a].is_empty() == guides[b].is_empty()
        };
        let mut maps: Vec<Option<PhotonGuide>> = Vec::new();
        for band in 0..guides.len() {
            let map = match (0..band).find(|&earlier| is_alike(earlier, band)) {
                Some(earlier) => maps[earlier].clone(),
                None => (band..guides.len())
                    .filter(|&other| is_alike(band, other))
                    .min_by(|&a, &b| scene.medium[a].sigma_t.total_cmp(&scene.medium[b].sigma_t))
                    .and_then(|least| PhotonMap::new(scene, bounds, least, &guides[least], options))
                    .map(|map| PhotonGuide { map: Arc::new(map), most: options.most }),
            };
            maps.push(map);
        }
        maps
    }

    /// Of the lights that the guides are of; nothing where a walk can meet none of them.
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
        // Half the angles, rad: the directions of photons already spread as the light does. What is added is for facets.
        let wide = 0.03 + 1.2 * widest + 2.0 * roughness;
        let spreads = [0.01 + 0.3 * widest + roughness, wide, 4.0 * wide];
        let caps = |n: usize| {
            let wider = (ENOUGH as f64 / n.max(1) as f64).sqrt();
            spreads.map(|spread| 1.0 - cos((wider * spread).min(PI)))
        };
        let mut flights = PhotonFlights::default();
        let key = StreamKey::named("what photons teach");
        for photon in 0..options.paths {
            let mut stream = key.pass(photon).stream(band as u64, Purpose::Walk);
            trace(scene, bounds, band, &guides, &mut stream, &mut flights);
        }
        let is_any = flights.iter().any(|flights| !flights.is_empty());
        let grid =
            |(count, _): &(usize, f64)| DirectionGrid::new(bounds, *count, options.paths, &flights);
        is_any.then(|| PhotonMap {
            grids: GRIDS.iter().map(grid).collect(),
            caps: (0..=ENOUGH).map(caps).collect(),
        })
    }

    /// The caps about the directions of a list.
    fn caps(&self, list: DirectionList) -> Caps {
        self.caps[(list.count as usize).min(ENOUGH)]
    }

    /// Memory behind it, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        let of = |grid: &DirectionGrid| {
            size_of_val(&*grid.chances) + size_of_val(&*grid.lists) + size_of_val(&*grid.directions)
        };
        self.grids.iter().map(of).sum()
    }
}

impl PhotonGuide {
    /// A direction at x of each kind, if one is drawn.
    #[inline]
    pub(super) fn sample(&self, x: DVec3, stream: &mut Stream) -> [Option<DVec3>; 2] {
        let Some((grid, _)) = choose_share(GRIDS.iter().map(|(_, share)| *share), stream.draw()) else {
            return [None; 2];
        };
        let grid = &self.map.grids[grid];
        let Some(voxel) = grid.voxel(x) else { return [None; 2] };
        let chances = grid.chances[voxel];
        PhotonKind::ALL.map(|kind| {
            let chance = self.most * f64::from(chances[kind as usize]);
            let is_drawn = chance > 0.0 && stream.draw() < chance;
            is_drawn.then(|| self.sample_about(grid, grid.lists[voxel][kind as usize], stream))
        })
    }

    /// A direction about one of a list that is not empty.
    fn sample_about(&self, grid: &DirectionGrid, list: DirectionList, stream: &mut Stream) -> DVec3 {
        let (cap, _) = choose_share(SHARES.into_iter(), stream.draw()).unwrap_or_default();
        let index = ((stream.draw() * f64::from(list.count)) as usize).min(list.count as usize - 1);
        let local = square_to_cap(self.map.caps(list)[cap], stream.draw2());
        let directions = &grid.directions[list.start as usize + index / LANES];
        Frame::about(vector(directions, index % LANES)).to_world(local)
    }

    /// The density per solid angle of all samples that find lights from this meeting, with the probability of drawing one at all.
    /// What is drawn for the first meeting ends there; what is drawn for later ones has met the boundary a first time, too.
    pub(super) fn density(&self, meeting: Meeting, x: DVec3, dir: DVec3) -> f64 {
        let mut density = 0.0;
        for (grid, (_, share)) in self.map.grids.iter().zip(&GRIDS) {
            let Some(voxel) = grid.voxel(x) else { continue };
            for kind in PhotonKind::ALL {
                let chance = grid.chances[voxel][kind as usize];
                if chance == 0.0 || (kind, meeting) == (PhotonKind::Once, Meeting::Later) {
                    continue;
                }
                let list = grid.lists[voxel][kind as usize];
                let caps = self.map.caps(list);
                let near = vectorized(CountNear { directions: grid.directions(list), dir, caps });
                let of_cap = |cap: usize| SHARES[cap] * pdf_cap(caps[cap]) * near[cap];
                let sum = of_cap(0) + of_cap(1) + of_cap(2);
                density += share * f64::from(chance) * sum / f64::from(list.count);
            }
        }
        self.most * density
    }
}

/// How many directions have `dir` in each of the caps about them.
struct CountNear<'a> {
    directions: &'a [VectorLanes],
    dir: DVec3,
    caps: Caps,
}

impl Vectorized for CountNear<'_> {
    type Output = [f64; 3];

    /// Counted in f64: with whole numbers the loop takes twice as long.
    #[inline(always)]
    fn call(self) -> [f64; 3] {
        let DVec3 { x, y, z } = self.dir;
        let [narrow, wide, widest] = self.caps;
        let [mut near_narrow, mut near_wide, mut near_widest] = [[0.0; LANES]; 3];
        for [xs, ys, zs] in self.directions {
            for lane in 0..LANES {
                // No comparison with the NaN of an empty place holds.
                let cos = xs[lane] * x + ys[lane] * y + zs[lane] * z;
                near_narrow[lane] += if cos >= 1.0 - narrow { 1.0 } else { 0.0 };
                near_wide[lane] += if cos >= 1.0 - wide { 1.0 } else { 0.0 };
                near_widest[lane] += if cos >= 1.0 - widest { 1.0 } else { 0.0 };
            }
        }
        [near_narrow, near_wide, near_widest].map(|counts| counts.iter().sum())
    }
}

/// A photon's flight inside the body.
struct Flight {
    ray: Ray,
    length: f64,
}

/// Flights of each kind.
type PhotonFlights = [Vec<Flight>; 2];

/// Follows one photon to its first scattering event.
fn trace(
    scene: &Scene,
    bounds: &BoundingSphere,
    band: usize,
    guides: &[&Guide],
    stream: &mut Stream,
    flights: &mut PhotonFlights,
) -> Option<()> {
    let (boundary, medium) = (&scene.boundary[band], &scene.medium[band]);
    let (index, _) = choose_share(guides.iter().map(|guide| guide.choice), stream.draw())?;
    let guide = guides[index];
    let light = guide.sample(&scene.lights[guide.light], band, stream.draw2());
    let mut ray = bounds.beam(light.wi, stream.draw2());
    let (mut side, mut from) = (Side::Outside, None);
    for events in 0..MOST_EVENTS {
        let free = match side {
            Side::Inside => sample_exponential(medium.sigma_t, stream.draw()),
            Side::Outside => f64::INFINITY,
        };
        let hit = scene.shape.intersect(&ray, side, from, STRETCH * free);
        if side == Side::Inside {
            let reach = hit.map_or(f64::INFINITY, |hit| hit.t);
            let (kind, free) = match events {
                1 => (PhotonKind::Once, free),
                _ => (PhotonKind::OfChains, STRETCH * free),
            };
            flights[kind as usize].push(Flight { ray, length: free.min(reach) });
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
    fn new(
        bounds: &BoundingSphere,
        count: usize,
        photons: u64,
        flights: &PhotonFlights,
    ) -> DirectionGrid {
        let low = bounds.center - DVec3::splat(bounds.radius);
        let scale = count as f64 / (2.0 * bounds.radius);
        let voxels = count * count * count;
        let (chances, lists) = (vec![[0.0; 2]; voxels], vec![[DirectionList::default(); 2]; voxels]);
        let mut grid = DirectionGrid { low, scale, count, chances, lists, directions: Vec::new() };
        for kind in PhotonKind::ALL {
            grid.fill(kind, photons, &flights[kind as usize]);
        }
        grid
    }

    fn fill(&mut self, kind: PhotonKind, photons: u64, flights: &[Flight]) {
        let (keep, kind) = (KEEP[kind as usize], kind as usize);
        // Voxel and flight, of which there are fewer than a u32 counts: at most 2^24 photons with 16 flights each.
        let mut crossed: Vec<[u32; 2]> = Vec::new();
        for (index, flight) in flights.iter().enumerate() {
            self.cross(flight, |voxel| crossed.push([voxel as u32, index as u32]));
        }
        for [voxel, _] in &crossed {
            self.lists[*voxel as usize][kind].count += 1;
        }
        let sides = FINE as f64 / self.count as f64;
        let certain = photons as f64 * keep.certain * sides * sides;
        let mut end = self.directions.len();
        for (chances, lists) in self.chances.iter_mut().zip(&mut self.lists) {
            let list = &mut lists[kind];
            if list.count > 0 {
                chances[kind] = (f64::from(list.count) / certain).clamp(keep.least, 1.0) as f32;
            }
            list.start = end as u32;
            end += list.count.min(keep.directions).div_ceil(LANES as u32) as usize;
            list.count = 0;
        }
        self.directions.resize(end, [[f64::NAN; LANES]; 3]);
        // Photons come in no order: the first ones of a voxel are as good as any.
        for [voxel, flight] in crossed {
            let list = &mut self.lists[voxel as usize][kind];
            if list.count < keep.directions {
                let index = list.count as usize;
                let block = &mut self.directions[list.start as usize + index / LANES];
                set_vector(block, index % LANES, -flights[flight as usize].ray.dir);
                list.count += 1;
            }
        }
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

    fn directions(&self, list: DirectionList) -> &[VectorLanes] {
        &self.directions[list.start as usize..][..list.count.div_ceil(LANES as u32) as usize]
    }
}

#[cfg(test)]
#[path = "photons_tests.rs"]
mod tests;
