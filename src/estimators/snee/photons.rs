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
//! with probability q(x), and followed to the boundary; c are the heights of a narrow and a wide cap, with shares s_c. (Of two grids:
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
//! as the bandwidth of a density estimate. q is proportional to the number of photons that have crossed the voxel, up to a largest
//! and, for chains, down to a least value: most vertices receive little light, and following an extra direction takes as long as
//! several steps of the walk.

use std::f64::consts::PI;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::guide::Guide;
use crate::estimators::crossing::other;
use crate::estimators::walk::Meeting;
use crate::geometry::{BoundingSphere, Ray, Side};
use crate::math::{DVec3, Frame, cos};
use crate::optics::boundary::{Boundary, Event};
use crate::sampling::discrete::{choose, choose_share};
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

/// Light after one refraction is found by other techniques, too; nothing else finds that of chains.
const AFTER_ONE_REFRACTION: Keep = Keep { directions: 64, certain: 1.0 / 2048.0, least: 0.0 };

const OF_CHAINS: Keep = Keep { directions: 256, certain: 1.0 / 8192.0, least: 0.1 };

/// Flights of chains are drawn with this much less extinction. Long chords carry little light, but a walk that meets the light along
/// one that no photon has taken scores the whole radiance.
const STRETCH: f64 = 2.0;

/// Events at the boundary after which a photon is no longer followed.
const MOST_EVENTS: u32 = 16;

/// Heights 1 - cos of a narrow and a wide cap.
type Caps = [f64; 2];

/// Share of the narrow cap.
const NARROW: f64 = 0.75;

/// Directions against the flights of photons.
#[derive(Debug)]
pub(super) struct PhotonMap {
    /// The probability of drawing a direction of a kind where many photons have passed.
    most: f64,
    after_one_refraction: PhotonGrids,
    of_chains: PhotonGrids,
    /// The caps about the directions of a voxel with 0, 1, 2 .. of them, and of all with more than are listed.
    caps: Vec<Caps>,
}

/// Directions of one kind of flight.
#[derive(Debug)]
pub(super) struct PhotonGrids {
    /// As in [`GRIDS`].
    grids: Vec<DirectionGrid>,
}

/// Directions voxel by voxel.
#[derive(Debug)]
struct DirectionGrid {
    low: DVec3,
    /// Voxels per mm.
    scale: f64,
    /// Voxels along a side.
    count: usize,
    /// As [`Self::voxel`] counts them.
    voxels: Vec<Voxel>,
    /// Voxel by voxel.
    directions: Vec<DVec3>,
}

/// What is known of a voxel, side by side: most draws end here.
#[derive(Clone, Copy, Debug)]
struct Voxel {
    /// With which probability one of its directions is drawn, over [`PhotonMap::most`].
    chance: f32,
    /// Where its directions begin.
    start: u32,
    /// How many it has.
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
        let spreads = [0.01 + 0.3 * widest + roughness, 0.03 + 1.2 * widest + 2.0 * roughness];
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
        let PhotonFlights { after_one_refraction, of_chains } = flights;
        let is_any = !(after_one_refraction.is_empty() && of_chains.is_empty());
        let of = |flights: &[Flight], keep: Keep| PhotonGrids::new(bounds, options.paths, flights, keep);
        is_any.then(|| PhotonMap {
            most: options.most,
            after_one_refraction: of(&after_one_refraction, AFTER_ONE_REFRACTION),
            of_chains: of(&of_chains, OF_CHAINS),
            caps: (0..=ENOUGH).map(caps).collect(),
        })
    }

    /// Directions in which a path finds lights from this meeting with the boundary.
    pub(super) fn of(&self, meeting: Meeting) -> &PhotonGrids {
        match meeting {
            Meeting::First => &self.after_one_refraction,
            Meeting::Later => &self.of_chains,
        }
    }

    /// The caps about the directions of a voxel.
    fn caps(&self, voxel: &Voxel) -> Caps {
        self.caps[(voxel.count as usize).min(ENOUGH)]
    }

    /// A direction at x for this meeting, if one is drawn.
    pub(super) fn sample(&self, meeting: Meeting, x: DVec3, stream: &mut Stream) -> Option<DVec3> {
        let (grid, _) = choose_share(GRIDS.iter().map(|(_, share)| *share), stream.draw())?;
        let grid = &self.of(meeting).grids[grid];
        let voxel = grid.at(x)?;
        if stream.draw() >= self.most * f64::from(voxel.chance) {
            return None;
        }
        let directions = grid.directions(voxel);
        let (is_narrow, u) = choose(stream.draw(), NARROW);
        let index = ((u * directions.len() as f64) as usize).min(directions.len().checked_sub(1)?);
        let [narrow, wide] = self.caps(voxel);
        let local = square_to_cap(if is_narrow { narrow } else { wide }, stream.draw2());
        Some(Frame::about(directions[index]).to_world(local))
    }

    /// The density per solid angle of all samples that find lights from this meeting, with the probability of drawing one at all.
    /// What is drawn for the first meeting ends there; what is drawn for later ones has met the boundary a first time, too.
    pub(super) fn density(&self, meeting: Meeting, x: DVec3, dir: DVec3) -> f64 {
        let of_grid = |(grid, (_, share)): (&DirectionGrid, &(usize, f64))| {
            let Some(voxel) = grid.at(x).filter(|voxel| voxel.count > 0) else { return 0.0 };
            let (directions, [narrow, wide]) = (grid.directions(voxel), self.caps(voxel));
            let mut near = [0_u32; 2];
            for direction in directions {
                let cos = direction.dot(dir);
                near[0] += u32::from(cos >= 1.0 - narrow);
                near[1] += u32::from(cos >= 1.0 - wide);
            }
            let [near_narrow, near_wide] = near.map(f64::from);
            let sum =
                NARROW * pdf_cap(narrow) * near_narrow + (1.0 - NARROW) * pdf_cap(wide) * near_wide;
            share * f64::from(voxel.chance) * sum / f64::from(voxel.count)
        };
        let of = |grids: &PhotonGrids| grids.grids.iter().zip(&GRIDS).map(of_grid).sum::<f64>();
        let of_chains = of(&self.of_chains);
        self.most
            * match meeting {
                Meeting::First => of_chains + of(&self.after_one_refraction),
                Meeting::Later => of_chains,
            }
    }

    /// Memory behind it, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        let of = |grid: &DirectionGrid| size_of_val(&*grid.voxels) + size_of_val(&*grid.directions);
        [&self.after_one_refraction, &self.of_chains]
            .into_iter()
            .flat_map(|kind| &kind.grids)
            .map(of)
            .sum()
    }
}

/// A photon's flight inside the body.
struct Flight {
    ray: Ray,
    length: f64,
}

#[derive(Default)]
struct PhotonFlights {
    after_one_refraction: Vec<Flight>,
    of_chains: Vec<Flight>,
}

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
            let (flights, free) = match events {
                1 => (&mut flights.after_one_refraction, free),
                _ => (&mut flights.of_chains, STRETCH * free),
            };
            flights.push(Flight { ray, length: free.min(reach) });
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

impl PhotonGrids {
    fn new(bounds: &BoundingSphere, photons: u64, flights: &[Flight], keep: Keep) -> PhotonGrids {
        let grid =
            |(count, _): &(usize, f64)| DirectionGrid::new(bounds, *count, photons, flights, keep);
        PhotonGrids { grids: GRIDS.iter().map(grid).collect() }
    }
}

impl DirectionGrid {
    fn new(
        bounds: &BoundingSphere,
        count: usize,
        photons: u64,
        flights: &[Flight],
        keep: Keep,
    ) -> DirectionGrid {
        let low = bounds.center - DVec3::splat(bounds.radius);
        let scale = count as f64 / (2.0 * bounds.radius);
        let none = Voxel { chance: 0.0, start: 0, count: 0 };
        let voxels = vec![none; count * count * count];
        let mut grid = DirectionGrid { low, scale, count, voxels, directions: Vec::new() };
        // Voxel and flight, of which there are fewer than a u32 counts: at most 2^24 photons with 16 flights each.
        let mut crossed: Vec<[u32; 2]> = Vec::new();
        for (index, flight) in flights.iter().enumerate() {
            grid.cross(flight, |voxel| crossed.push([voxel as u32, index as u32]));
        }
        for [voxel, _] in &crossed {
            grid.voxels[*voxel as usize].count += 1;
        }
        let sides = FINE as f64 / count as f64;
        let certain = photons as f64 * keep.certain * sides * sides;
        let mut end = 0;
        for voxel in &mut grid.voxels {
            if voxel.count > 0 {
                voxel.chance = (f64::from(voxel.count) / certain).clamp(keep.least, 1.0) as f32;
            }
            voxel.start = end;
            end += voxel.count.min(keep.directions);
            voxel.count = 0;
        }
        grid.directions = vec![DVec3::ZERO; end as usize];
        // Photons come in no order: the first ones of a voxel are as good as any.
        for [voxel, flight] in crossed {
            let Voxel { start, count, .. } = &mut grid.voxels[voxel as usize];
            if *count < keep.directions {
                grid.directions[(*start + *count) as usize] = -flights[flight as usize].ray.dir;
                *count += 1;
            }
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

    /// The voxel of a point.
    fn at(&self, x: DVec3) -> Option<&Voxel> {
        self.voxel(x).map(|voxel| &self.voxels[voxel])
    }

    fn directions(&self, voxel: &Voxel) -> &[DVec3] {
        &self.directions[voxel.start as usize..][..voxel.count as usize]
    }
}

#[cfg(test)]
#[path = "photons_tests.rs"]
mod tests;
