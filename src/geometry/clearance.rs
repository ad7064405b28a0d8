//! What is known of the surface without the tree: how far a point surely is from it, and where flights surely do not meet it.
//!
//! A uniform grid of cubic voxels over the mesh's box. A voxel is occupied if a triangle may touch it.
//! Voxels at an offset (i, j, k) are apart by at least `edge sqrt(f(i)^2 + f(j)^2 + f(k)^2)` with
//! `f(i) = max(|i| - 1, 0)`; the least such distance to an occupied voxel bounds the distance to the
//! surface from every point of the voxel. Since f(i) is the least |i + e| with e in {-1, 0, 1}, it
//! is the plain distance transform of the occupied set grown by one voxel each way, and both steps
//! go axis by axis (Saito, Toriwaki, "New algorithms for Euclidean distance transformation of an
//! n-dimensional digitized picture", Pattern Recognition 27(11), 1994). And each voxel has a ball ([`super::balls`]).

use super::balls::{CenteredBalls, EmptyBall};
use super::tree::{MeshFrame, PAD};
use super::triangle::PreciseNormal;
use super::voxels::Voxels;
use crate::math::DVec3;

/// Edge of a voxel, units of the frame: 32 to 64 voxels along the longest side.
pub(super) const VOXEL: f64 = 32.0;

/// Squared distance, in voxels, of what has no occupied voxel in sight.
const FAR: u32 = u32::MAX / 2;

/// Grid of lower bounds of the distance to the surface, and of balls.
#[derive(Clone, Debug)]
pub(super) struct Clearance {
    pub voxels: Voxels,
    /// Lower bound of the distance to the surface, units of the frame.
    bounds: Vec<f32>,
    balls: Vec<EmptyBall>,
}

impl Clearance {
    /// The grid of a mesh with the box `extent`, mm, around its triangles, which are in units of the frame; and the balls that
    /// those of the voxels are chosen from. `distance` is that of a point to the surface, both in these units.
    pub(super) fn new(
        frame: &MeshFrame,
        extent: (DVec3, DVec3),
        triangles: impl Iterator<Item = ([DVec3; 3], Option<PreciseNormal>)>,
        distance: impl FnMut(DVec3) -> f64,
    ) -> (Clearance, CenteredBalls) {
        let voxels = Voxels::over(frame, extent, VOXEL);
        let mut distance2 = vec![FAR; voxels.len()];
        for (triangle, normal) in triangles {
            voxels.touched(&triangle, normal, |index| distance2[index] = 0);
        }
        let outside = outside(&voxels, &distance2);
        (0..3).for_each(|axis| voxels.along(axis, &mut distance2, grow));
        (0..3).for_each(|axis| voxels.along(axis, &mut distance2, transform));
        // The padding pays for the rounding of points at voxel borders and of f32.
        let bound = |&d2: &u32| (f64::from(d2).sqrt() * VOXEL - PAD).max(0.0) as f32;
        let bounds: Vec<f32> = distance2.iter().map(bound).collect();
        let centered = CenteredBalls::new(voxels, &bounds, &outside, distance);
        let balls = centered.handed_on(&outside);
        (Clearance { voxels, bounds, balls }, centered)
    }

    /// A lower bound of the distance to the surface, units of the frame; 0 outside the grid.
    #[inline]
    pub(super) fn at(&self, point: DVec3) -> f64 {
        self.voxels.index_of(point).map_or(0.0, |index| self.bounds[index].into())
    }

    /// The centre and the radius of the ball of a point's voxel, units of the frame; `None` outside the grid.
    #[inline]
    pub(super) fn ball(&self, point: DVec3) -> Option<(DVec3, f64)> {
        let ball = &self.balls[self.voxels.index(self.voxels.nearest(point))?];
        Some((ball.center(), ball.radius()))
    }

    /// Whether both points, units of the frame, are in a ball without surface inside: that of the first point's voxel.
    #[inline]
    pub(super) fn has_ball_around(&self, start: DVec3, end: DVec3) -> bool {
        let Some((center, radius)) = self.ball(start) else { return false };
        // Without an end, `end` is infinite or NaN, and in no ball.
        let (from2, to2) = (start.distance_squared(center), end.distance_squared(center));
        from2 < radius * radius && to2 < radius * radius
    }

    /// Whether a voxel, or one beside it, may hold some of the surface, and not all of the voxel is outside.
    pub(super) fn is_beside_surface(&self, index: usize) -> bool {
        self.bounds[index] == 0.0 && self.balls[index].radius() > 0.0
    }

    /// Memory behind the grid, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        size_of_val(&*self.bounds) + size_of_val(&*self.balls)
    }
}

/// The voxels outside the body: those that the border of the grid is connected with by voxels that are not occupied.
fn outside(voxels: &Voxels, distance2: &[u32]) -> Vec<bool> {
    let counts = voxels.counts();
    let is_border = |index: usize| {
        let place = voxels.place(index);
        (0..3).any(|axis| place[axis] == 0 || place[axis] + 1 == counts[axis])
    };
    let mut is_outside = vec![false; distance2.len()];
    let mut open: Vec<usize> = (0..distance2.len()).filter(|&i| is_border(i)).collect();
    while let Some(index) = open.pop() {
        if distance2[index] != 0 && !is_outside[index] {
            is_outside[index] = true;
            let beside = |axis| [-1, 1].map(|step| voxels.beside(index, axis, step));
            open.extend((0..3).flat_map(beside).flatten());
        }
    }
    is_outside
}

/// The least of a voxel and its two neighbours.
fn grow(line: &[u32], grown: &mut [u32]) {
    for (i, value) in grown.iter_mut().enumerate() {
        *value = line[i.saturating_sub(1)..(i + 2).min(line.len())].iter().copied().fold(FAR, u32::min);
    }
}

/// The least of value plus squared distance.
fn transform(line: &[u32], transformed: &mut [u32]) {
    for (i, value) in transformed.iter_mut().enumerate() {
        let mut least = line[i];
        // From there on every value is larger.
        for (away, far) in (1..line.len()).map(|away| (away, (away * away) as u32)) {
            if far >= least {
                break;
            }
            let beside = [i.checked_sub(away), Some(i + away)].map(|j| line.get(j?).copied());
            least = beside
                .into_iter()
                .flatten()
                .fold(least, |least, value| least.min(value.saturating_add(far)));
        }
        *value = least;
    }
}

#[cfg(test)]
mod tests {
    use super::super::Shape;
    use super::super::testing::{Uniform, bodies, direction};
    use super::super::{Ray, Side};
    use crate::math::DVec3;

    const RAYS: usize = 20_000;

    #[test]
    fn bound_is_never_above_the_distance_to_what_any_ray_meets() {
        let mut u = Uniform::named("bound_is_never_above_the_distance_to_what_any_ray_meets");
        for (name, shape) in bodies() {
            let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
            let sphere = mesh.bounds();
            let mut used = 0;
            for _ in 0..RAYS {
                let cube = DVec3::new(u.next(), u.next(), u.next()) * 2.0 - 1.0;
                let origin = sphere.center + cube * sphere.radius;
                let bound = mesh.clearance(origin);
                used += usize::from(bound > 0.0);
                let ray = Ray { origin, dir: direction(&mut u) };
                for side in [Side::Inside, Side::Outside] {
                    if let Some(hit) = mesh.search(&ray, side, None, f64::INFINITY) {
                        assert!(hit.t > bound, "{name}: {} <= {bound} at {origin}", hit.t);
                    }
                }
                // The nearest vertex is a sharper test than a ray.
                let nearest = |near: f64, v: &DVec3| near.min(v.distance(origin));
                if used % 50 == 1 {
                    let near = mesh.vertices().iter().fold(f64::INFINITY, nearest);
                    assert!(near > bound, "{name}: {near} <= {bound} at {origin}");
                }
            }
            assert!(used > RAYS / 50, "{name}: the bound is positive at {used} points only");
        }
    }

    #[test]
    fn flights_end_as_they_do_without_the_grid() {
        let mut u = Uniform::named("flights_end_as_they_do_without_the_grid");
        for (name, shape) in bodies() {
            let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
            let sphere = mesh.bounds();
            // Flights inside of any length that meet nothing, and those of them that are seen to.
            let (mut inside, mut clear) = (0, 0);
            for _ in 0..RAYS {
                let origin = sphere.center + direction(&mut u) * (u.next() * sphere.radius);
                let ray = Ray { origin, dir: direction(&mut u) };
                let t_max = u.next().powi(4) * sphere.radius;
                let (with, without) = (
                    mesh.intersect(&ray, Side::Inside, None, t_max),
                    mesh.search(&ray, Side::Inside, None, t_max),
                );
                assert_eq!(with, without, "{name}");
                if without.is_none() && mesh.contains(origin) {
                    inside += 1;
                    clear += usize::from(mesh.is_clear(origin, ray.at(t_max)));
                }
            }
            assert!(10 * clear > 7 * inside, "{name}: {clear} of {inside}");
        }
    }

    /// Sharper than rays: no point of the surface is in a ball.
    #[test]
    fn balls_hold_no_surface() {
        let mut u = Uniform::named("balls_hold_no_surface");
        for (name, shape) in bodies() {
            let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
            let sphere = mesh.bounds();
            for i in 0..10 * RAYS {
                let triangle = mesh.triangles()[(u.next() * mesh.triangles().len() as f64) as usize];
                let [a, b, c] = triangle.map(|v| mesh.vertices()[v as usize]);
                let (s, t) = (u.next(), u.next());
                let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                let on = [a + (b - a) * s + (c - a) * t, a + (b - a) * s, a][i % 3];
                let from = on + direction(&mut u) * (u.next().powi(3) * sphere.radius);
                assert!(!mesh.is_clear(from, on) && !mesh.is_clear(on, from), "{name}: {from} {on}");
            }
        }
    }

    #[test]
    fn flights_without_an_end_are_not_clear() {
        for (name, shape) in bodies() {
            let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
            let center = mesh.bounds().center;
            for dir in [DVec3::X, DVec3::new(0.0, -0.6, 0.8)] {
                let end = Ray { origin: center, dir }.at(f64::INFINITY);
                assert!(!mesh.is_clear(center, end) && !mesh.is_clear(end, center), "{name}");
            }
        }
    }
}
