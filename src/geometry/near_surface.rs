//! What is known of the surface beside it, for flights that [`super::clearance`] does not show to be clear: most of them start on
//! the surface or close to it, and meet nothing all the same.
//!
//! Two questions decide without the tree. Are both ends in a ball without surface inside? Voxels of half the edge have a ball
//! each, chosen among those about the coarse ones near. And does the flight lead away from all surface that it can reach
//! ([`super::facing`])? Fine voxels exist where the surface passes through a coarse one, or may pass through one
//! beside it, eight by eight.

use super::balls::{CenteredBalls, EmptyBall};
use super::clearance::Clearance;
use super::facing::{NormalBounds, NormalGrid, REACH};
use super::tree::MeshFrame;
use super::triangle::PreciseNormal;
use super::voxels::Voxels;
use crate::math::DVec3;

/// Edge of a fine voxel, units of the frame: half of the edge of a coarse one.
const FINE: f64 = 0.5 * super::clearance::VOXEL;

/// The longest flight that a fine voxel has bounds of normals for.
const SHORT: f64 = REACH as f64 * FINE;

/// The flight that balls are chosen for, units of the frame.
const FLIGHT: f64 = 24.0;

/// More than the way from the middle of a coarse voxel to that of a fine one in it, sqrt 3 / 2 of the fine one's edge.
const MIDDLES: f64 = 0.87 * FINE;

/// Grids of normals for longer flights: up to 64 times as long, more than the body is.
const GRIDS: usize = 6;

/// A voxel where there are no fine ones.
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct FineVoxel {
    ball: EmptyBall,
    normals: NormalBounds,
}

/// Whether flights that start beside the surface meet it.
#[derive(Clone, Debug)]
pub(super) struct NearSurface {
    /// The fine ones.
    voxels: Voxels,
    coarse: Voxels,
    /// Of a coarse voxel: which eight of the fine ones are in it.
    eights: Vec<u32>,
    fine: Vec<[FineVoxel; 8]>,
    /// For flights of up to twice [`SHORT`], four times that length, and so on.
    grids: Vec<NormalGrid>,
}

impl NearSurface {
    /// From the triangles, in units of the frame.
    pub(super) fn new(
        frame: &MeshFrame,
        extent: (DVec3, DVec3),
        triangles: impl Iterator<Item = ([DVec3; 3], Option<PreciseNormal>)>,
        (clearance, balls): (&Clearance, &CenteredBalls),
    ) -> NearSurface {
        let voxels = Voxels::over(frame, extent, FINE);
        let mut normals = NormalGrid::new(voxels, triangles);
        let mut grids = Vec::new();
        let mut coarse = normals.coarser();
        for _ in 0..GRIDS {
            let next = coarse.coarser();
            grids.push(coarse.within_reach());
            coarse = next;
        }
        normals = normals.within_reach();
        let mut eights = vec![NONE; clearance.voxels.len()];
        let mut fine = Vec::new();
        for (index, eight) in eights.iter_mut().enumerate() {
            if !clearance.is_beside_surface(index) {
                continue;
            }
            let place = clearance.voxels.place(index);
            let balls = balls.about(place, FLIGHT, MIDDLES);
            let best_at = |middle: DVec3| {
                let worth = balls.iter().map(|ball| (ball.worth(middle, FLIGHT), ball));
                worth.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(EmptyBall::NONE, |(_, ball)| *ball)
            };
            *eight = fine.len() as u32;
            fine.push(std::array::from_fn(|part| {
                let place = std::array::from_fn(|axis| 2 * place[axis] + (part >> axis & 1));
                FineVoxel {
                    ball: best_at(voxels.center(place)),
                    normals: normals.at(place).copied().unwrap_or(NormalBounds::ALL),
                }
            }));
        }
        NearSurface { voxels, coarse: clearance.voxels, eights, fine, grids }
    }

    /// Whether a flight inside surely meets nothing: its start, units of the frame, its direction and its length there.
    #[inline]
    pub(super) fn is_clear(&self, start: DVec3, dir: DVec3, length: f64) -> bool {
        let place = self.voxels.nearest(start);
        let fine = self.fine_voxel(place);
        if fine
            .is_some_and(|FineVoxel { ball, .. }| ball.holds(start) && ball.holds(start + dir * length))
        {
            return true;
        }
        self.normals_within(place, fine, length).is_some_and(|normals| normals.are_against(dir))
    }

    /// The fine voxel at a place, if there is one.
    #[inline]
    fn fine_voxel(&self, [i, j, k]: [usize; 3]) -> Option<&FineVoxel> {
        let eight = self.eights[self.coarse.index([i / 2, j / 2, k / 2])?];
        Some(&self.fine.get(eight as usize)?[i % 2 + 2 * (j % 2) + 4 * (k % 2)])
    }

    /// Bounds of the normals of all triangles that are no farther away than a length from a point in the voxel at a place, whose
    /// fine voxel is `fine`; none beside the box, or where that is farther than the body is large.
    #[inline]
    fn normals_within<'a>(
        &'a self,
        place: [usize; 3],
        fine: Option<&'a FineVoxel>,
        length: f64,
    ) -> Option<&'a NormalBounds> {
        if let Some(FineVoxel { normals, .. }) = fine
            && length < SHORT
        {
            return Some(normals);
        }
        // 0 for lengths below 2 SHORT, 1 for those in [2 SHORT, 4 SHORT), and so on.
        let exponent = (length * (1.0 / SHORT)).to_bits() >> 52;
        let octave = exponent.max(1023) as usize - 1023;
        let [i, j, k] = place;
        self.grids.get(octave)?.at([i >> (octave + 1), j >> (octave + 1), k >> (octave + 1)])
    }

    /// Memory that making it needed for a moment beside what it holds, bytes: bounds in every fine voxel.
    pub(super) fn building_bytes(&self) -> usize {
        size_of::<NormalBounds>() * self.voxels.len()
    }

    /// Memory behind it, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        let grids: usize = self.grids.iter().map(NormalGrid::heap_bytes).sum();
        size_of_val(&*self.eights) + size_of_val(&*self.fine) + grids
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, bodies, direction, inward};
    use super::super::{FaceId, Mesh, Ray, Shape, Side, triangle};
    use super::*;

    impl Mesh {
        /// A point of a triangle, its corner or a point of its edge included.
        fn some_point(&self, u: &mut Uniform) -> (DVec3, usize) {
            let index = (u.next() * self.triangles().len() as f64) as usize;
            let [a, b, c] = self.triangles()[index].map(|v| self.vertices()[v as usize]);
            let (s, t) = (u.next(), u.next());
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            let kind = (u.next() * 8.0) as usize;
            let point = match kind {
                0 => a,
                1 => a + (b - a) * s,
                _ => a + (b - a) * s + (c - a) * t,
            };
            (point, index)
        }
    }

    fn meshes() -> Vec<(&'static str, Mesh)> {
        let mesh = |(name, shape)| match shape {
            Shape::Mesh(mesh) => (name, mesh),
            _ => unreachable!("bodies are meshes"),
        };
        bodies().into_iter().map(mesh).collect()
    }

    #[test]
    fn flights_near_the_surface_end_as_the_tree_tells() {
        const FLIGHTS: usize = 40_000;
        let mut u = Uniform::named("flights_near_the_surface_end_as_the_tree_tells");
        for (name, mesh) in meshes() {
            let size = mesh.bounds().radius;
            // Those that meet nothing and are in no coarse ball, and those of them that are clear here; those that meet something.
            let (mut unclear, mut clear, mut met) = (0, 0, 0);
            for i in 0..FLIGHTS {
                let (point, face) = mesh.some_point(&mut u);
                let corners = mesh.triangles()[face].map(|v| mesh.vertices()[v as usize]);
                let normal = triangle::normal(&corners);
                let dir = inward(normal, &mut u);
                // Flat along the surface, one in four.
                let flat = dir - normal * (dir.dot(normal) * (1.0 - 1e-3 * u.next()));
                let dir = if i % 4 == 0 { flat.normalize() } else { dir };
                let t = u.next().powi(3) * size;
                // On the surface, or from a point inside beside it in any direction.
                let (ray, from) = if i % 2 == 0 {
                    (Ray { origin: point, dir }, Some(FaceId(face as u32)))
                } else {
                    let origin = point + dir * (u.next().powi(3) * 0.1 * size);
                    (Ray { origin, dir: direction(&mut u) }, None)
                };
                if from.is_none() && !mesh.contains(ray.origin) {
                    continue;
                }
                let by_tree = mesh.search(&ray, Side::Inside, from, t);
                assert_eq!(mesh.end_of_unclear(&ray, from, t), by_tree, "{name}: {ray:?} {t}");
                met += usize::from(by_tree.is_some());
                if by_tree.is_none() && !mesh.is_clear(ray.origin, ray.at(t)) {
                    unclear += 1;
                    clear += usize::from(mesh.is_clear_near_surface(&ray, t));
                }
            }
            assert!(met > FLIGHTS / 20, "{name}: {met}");
            assert!(10 * clear > unclear, "{name}: {clear} of {unclear}");
        }
    }

    /// Sharper than flights: every triangle within a length of a point has its normal in the bounds.
    #[test]
    fn bounds_hold_the_normals_within_every_length() {
        const POINTS: usize = 300;
        let mut u = Uniform::named("bounds_hold_the_normals_within_every_length");
        for (name, mesh) in meshes() {
            let (near_surface, frame) = mesh.near_surface();
            let corners = |t: &[u32; 3]| t.map(|v| mesh.vertices()[v as usize]);
            let (mut short, mut long) = (0, 0);
            for _ in 0..POINTS {
                let (point, _) = mesh.some_point(&mut u);
                let start = frame.place(point) + direction(&mut u) * (u.next().powi(3) * 100.0);
                let length = u.next().powi(3) * 600.0;
                let place = near_surface.voxels.nearest(start);
                let fine = near_surface.fine_voxel(place);
                let Some(bounds) = near_surface.normals_within(place, fine, length) else { continue };
                short += usize::from(fine.is_some() && length < SHORT);
                long += usize::from(length >= SHORT);
                for triangle in mesh.triangles().iter().map(corners) {
                    let placed = triangle.map(|corner| frame.place(corner));
                    if triangle::distance2(&placed, start) <= length * length {
                        let normal = triangle::normal(&triangle);
                        assert!(bounds.hold(normal), "{name}: {bounds:?} {normal} {start} {length}");
                    }
                }
            }
            assert!(short > POINTS / 10 && long > POINTS / 10, "{name}: {short} {long}");
        }
    }

    #[test]
    fn fine_balls_hold_no_surface() {
        let mut u = Uniform::named("fine_balls_hold_no_surface");
        for (name, mesh) in meshes() {
            let (near_surface, frame) = mesh.near_surface();
            let mut looked_at = 0;
            for _ in 0..300_000 {
                let on = frame.place(mesh.some_point(&mut u).0);
                let about = on + direction(&mut u) * (u.next().powi(2) * 300.0);
                if let Some(fine) = near_surface.fine_voxel(near_surface.voxels.nearest(about)) {
                    looked_at += 1;
                    assert!(!fine.ball.holds(on), "{name}: {fine:?} {on}");
                }
            }
            assert!(looked_at > 50_000, "{name}: {looked_at}");
        }
    }

    #[test]
    fn flights_without_an_end_are_not_clear() {
        for (name, mesh) in meshes() {
            let (point, _) = mesh.some_point(&mut Uniform::named(name));
            for dir in [DVec3::X, DVec3::new(0.0, -0.6, 0.8)] {
                for t in [f64::INFINITY, f64::NAN] {
                    assert!(!mesh.is_clear_near_surface(&Ray { origin: point, dir }, t), "{name}");
                }
            }
        }
    }
}
