//! What is known of the surface without the tree: how far a point surely is from it, and where flights surely do not meet it.
//!
//! A uniform grid of cubic voxels over the mesh's box. A voxel is occupied if a triangle may touch it.
//! Voxels at an offset (i, j, k) are apart by at least `size sqrt(f(i)^2 + f(j)^2 + f(k)^2)` with
//! `f(i) = max(|i| - 1, 0)`; the least such distance to an occupied voxel bounds the distance to the
//! surface from every point of the voxel. Since f(i) is the least |i + e| with e in {-1, 0, 1}, it
//! is the plain distance transform of the occupied set grown by one voxel each way, and both steps
//! go axis by axis (Saito, Toriwaki, "New algorithms for Euclidean distance transformation of an
//! n-dimensional digitized picture", Pattern Recognition 27(11), 1994).
//!
//! # Balls
//!
//! A ball about a point, as large as the distance from it to the surface, is convex and has no surface inside: a flight
//! with both ends in it meets nothing. The ball about the start of a flight shows that of few flights that start near the
//! surface, where most do. A large ball that touches the surface near the start shows it of nearly all that do not go
//! outwards. So each voxel has a ball about the centre of some voxel, not of its own in general. The deeper the ball holds
//! the voxel, margin m = r - d (d from centre to centre), the farther a flight may go outwards; the larger it is, the
//! farther inwards and along the surface, where the ball curves away from a flight of length l by l^2 / (2 r). So
//! m - l^2 / (2 r) is made large, with l = 2 voxels. Voxels hand their balls on to their neighbours, forth and back
//! through the grid, and each keeps the best that it is offered, as in transforms of vector distances (Danielsson,
//! "Euclidean distance mapping", Computer Graphics and Image Processing 14, 1980): that does not find the best ball
//! always, and need not.

use std::array;

use super::tree::{MeshFrame, PAD};
use crate::math::DVec3;

/// Edge of a voxel, units of the frame: 32 to 64 voxels along the longest side.
const VOXEL: f64 = 32.0;

/// Squared distance, in voxels, of what has no occupied voxel in sight.
const FAR: u32 = u32::MAX / 2;

/// From here on not every voxel is the centre of a ball, units of the frame.
const DEEP: f64 = VOXEL;

/// The flight that balls are chosen for, voxels.
const FLIGHT: f32 = 2.0;

/// A ball without surface inside, units of the frame.
#[derive(Clone, Copy, Debug)]
struct EmptyBall {
    center: [f32; 3],
    /// 0 if there is none.
    radius: f32,
}

/// A ball about the centre of a voxel, as another voxel sees it.
#[derive(Clone, Copy, Debug)]
struct NearbyBall {
    /// The way to the voxel of the centre, voxels.
    offset: [i8; 3],
    /// Units of the frame; 0 if there is none.
    radius: f32,
}

impl NearbyBall {
    const NONE: NearbyBall = NearbyBall { offset: [0; 3], radius: 0.0 };

    /// What the ball is worth, voxels.
    fn score(&self) -> f32 {
        let [i, j, k] = self.offset.map(f32::from);
        let radius = self.radius / VOXEL as f32;
        if radius > 0.0 {
            radius - (i * i + j * j + k * k).sqrt() - FLIGHT * FLIGHT / (2.0 * radius)
        } else {
            f32::NEG_INFINITY
        }
    }

    /// The same ball for a neighbour of the voxel along an axis.
    fn seen_from(self, axis: usize, step: i8) -> NearbyBall {
        let mut offset = self.offset;
        match offset[axis].checked_sub(step) {
            Some(moved) => offset[axis] = moved,
            None => return NearbyBall::NONE,
        }
        NearbyBall { offset, ..self }
    }
}

/// Grid of lower bounds of the distance to the surface, and of balls.
#[derive(Clone, Debug)]
pub(super) struct Clearance {
    /// Least corner, units of the frame.
    corner: DVec3,
    /// Centre of the first voxel, units of the frame.
    first: DVec3,
    voxels: [usize; 3],
    /// Lower bound of the distance to the surface, units of the frame, x fastest.
    bounds: Vec<f32>,
    balls: Vec<EmptyBall>,
}

impl Clearance {
    /// The grid of a mesh with the box (`min`, `max`), mm, around its triangles. `distance` is that of a point to the
    /// surface, both in units of the frame.
    pub(super) fn new(
        frame: &MeshFrame,
        (min, max): (DVec3, DVec3),
        triangles: impl Iterator<Item = [DVec3; 3]>,
        distance: impl FnMut(DVec3) -> f64,
    ) -> Clearance {
        let corner = frame.place(min) - PAD;
        let size = frame.place(max) + PAD - corner;
        let voxels = size.to_array().map(|side| (side / VOXEL) as usize + 1);
        let first = corner + 0.5 * VOXEL;
        let mut grid = Clearance { corner, first, voxels, bounds: Vec::new(), balls: Vec::new() };
        let mut distance2 = vec![FAR; voxels.iter().product()];
        for triangle in triangles {
            grid.occupy(&triangle.map(|vertex| frame.place(vertex)), &mut distance2);
        }
        let is_outside = grid.outside(&distance2);
        for axis in 0..3 {
            grid.along(axis, &mut distance2, grow);
        }
        for axis in 0..3 {
            grid.along(axis, &mut distance2, transform);
        }
        // The padding pays for the rounding of points at voxel borders and of f32.
        let bound = |&d2: &u32| (f64::from(d2).sqrt() * VOXEL - PAD).max(0.0) as f32;
        grid.bounds = distance2.iter().map(bound).collect();
        grid.balls = grid.find_balls(&is_outside, distance);
        grid
    }

    /// A lower bound of the distance to the surface, units of the frame; 0 outside the grid.
    #[inline]
    pub(super) fn at(&self, point: DVec3) -> f64 {
        let voxel = (point - self.corner) * (1.0 / VOXEL);
        if voxel.min_element() < 0.0 {
            return 0.0;
        }
        // Not `map`, which is not inlined.
        let (i, j, k) = (voxel.x as usize, voxel.y as usize, voxel.z as usize);
        let [nx, ny, nz] = self.voxels;
        if i < nx && j < ny && k < nz { self.bounds[i + nx * (j + ny * k)].into() } else { 0.0 }
    }

    /// The centre and the radius of the ball of a point's voxel, units of the frame; `None` outside the grid.
    #[inline]
    pub(super) fn ball(&self, point: DVec3) -> Option<(DVec3, f64)> {
        /// A sum with this is rounded to a whole number, whose bits are the last ones: the nearest voxel, in fewer
        /// instructions than a conversion.
        const WHOLE: f64 = (3u64 << 51) as f64;
        let voxel = (point - self.first) * (1.0 / VOXEL) + WHOLE;
        let whole = |x: f64| x.to_bits() as u32 as usize;
        let (i, j, k) = (whole(voxel.x), whole(voxel.y), whole(voxel.z));
        let [nx, ny, nz] = self.voxels;
        if i >= nx || j >= ny || k >= nz {
            return None;
        }
        let EmptyBall { center: [x, y, z], radius } = self.balls[i + nx * (j + ny * k)];
        Some((DVec3::new(x.into(), y.into(), z.into()), radius.into()))
    }

    /// Whether both points, units of the frame, are in a ball without surface inside: that of the first point's voxel.
    #[inline]
    pub(super) fn has_ball_around(&self, start: DVec3, end: DVec3) -> bool {
        let Some((center, radius)) = self.ball(start) else { return false };
        // Without an end, `end` is infinite or NaN, and in no ball.
        let (from2, to2) = (start.distance_squared(center), end.distance_squared(center));
        from2 < radius * radius && to2 < radius * radius
    }

    /// Memory behind the grid, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        size_of_val(&*self.bounds) + size_of_val(&*self.balls)
    }

    /// The place of a voxel in the grid.
    fn place(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.voxels;
        [index % nx, index / nx % ny, index / nx / ny]
    }

    /// The voxel beside one along an axis.
    fn beside(&self, index: usize, axis: usize, step: i8) -> Option<usize> {
        let at = self.place(index)[axis].checked_add_signed(step.into())?;
        let stride: usize = self.voxels[..axis].iter().product();
        (at < self.voxels[axis]).then(|| index.wrapping_add_signed(isize::from(step) * stride as isize))
    }

    /// The voxels outside the body: those that the border of the grid is connected with by voxels that are not occupied.
    fn outside(&self, distance2: &[u32]) -> Vec<bool> {
        let is_border = |index: usize| {
            let place = self.place(index);
            (0..3).any(|axis| place[axis] == 0 || place[axis] + 1 == self.voxels[axis])
        };
        let mut is_outside = vec![false; distance2.len()];
        let mut open: Vec<usize> = (0..distance2.len()).filter(|&i| is_border(i)).collect();
        while let Some(index) = open.pop() {
            if distance2[index] != 0 && !is_outside[index] {
                is_outside[index] = true;
                let beside = |axis| [-1, 1].map(|step| self.beside(index, axis, step));
                open.extend((0..3).flat_map(beside).flatten());
            }
        }
        is_outside
    }

    /// The balls of all voxels but those outside. Deep inside, where every ball serves many voxels and its radius takes
    /// longest to be found, only every eighth voxel has one of its own.
    fn find_balls(&self, is_outside: &[bool], mut distance: impl FnMut(DVec3) -> f64) -> Vec<EmptyBall> {
        let center =
            |[i, j, k]: [usize; 3]| self.first + DVec3::new(i as f64, j as f64, k as f64) * VOXEL;
        let mut balls = vec![NearbyBall::NONE; is_outside.len()];
        let is_asked = |index: usize| {
            let is_even = self.place(index).iter().all(|at| at % 2 == 0);
            !is_outside[index] && (is_even || f64::from(self.bounds[index]) < DEEP)
        };
        for index in (0..balls.len()).filter(|&index| is_asked(index)) {
            // The padding pays for the rounding of the distance, of f32 and of points that are looked up.
            let radius = distance(center(self.place(index))) - 2.0 * PAD;
            balls[index].radius = radius.max(0.0) as f32;
        }
        for _ in 0..2 {
            (0..balls.len()).for_each(|index| self.improve(index, &mut balls, is_outside, -1));
            (0..balls.len()).rev().for_each(|index| self.improve(index, &mut balls, is_outside, 1));
        }
        let about = |(index, ball): (usize, NearbyBall)| {
            let place = self.place(index);
            let at = array::from_fn(|axis| place[axis].wrapping_add_signed(ball.offset[axis].into()));
            EmptyBall { center: center(at).as_vec3().to_array(), radius: ball.radius }
        };
        balls.into_iter().enumerate().map(about).collect()
    }

    /// Gives a voxel the ball of a neighbour on one side if that is better.
    fn improve(&self, index: usize, balls: &mut [NearbyBall], is_outside: &[bool], step: i8) {
        if is_outside[index] {
            return;
        }
        for axis in 0..3 {
            let Some(beside) = self.beside(index, axis, step) else { continue };
            // The way from here is the way from there and one step more.
            let ball = balls[beside].seen_from(axis, -step);
            if ball.score() > balls[index].score() {
                balls[index] = ball;
            }
        }
    }

    /// Sets the voxels that the triangle, units of the frame, may touch to 0: those in its box that
    /// its plane passes.
    fn occupy(&self, triangle: &[DVec3; 3], distance2: &mut [u32]) {
        let [a, b, c] = *triangle;
        let voxel = |point: DVec3| ((point - self.corner) / VOXEL).to_array().map(|x| x as usize);
        let (low, high) = (voxel(a.min(b).min(c) - PAD), voxel(a.max(b).max(c) + PAD));
        let normal = super::triangle::normal(triangle);
        let reach = (0.5 * VOXEL + PAD) * normal.abs().element_sum();
        let [nx, ny, nz] = self.voxels;
        for k in low[2]..=high[2].min(nz - 1) {
            for j in low[1]..=high[1].min(ny - 1) {
                for i in low[0]..=high[0].min(nx - 1) {
                    let index = DVec3::new(i as f64, j as f64, k as f64);
                    let middle = self.corner + (index + 0.5) * VOXEL;
                    if normal.dot(middle - a).abs() <= reach {
                        distance2[i + nx * (j + ny * k)] = 0;
                    }
                }
            }
        }
    }

    /// Applies `step` to every line of voxels along an axis.
    fn along(&self, axis: usize, field: &mut [u32], step: fn(&[u32], usize) -> u32) {
        let n = self.voxels[axis];
        let stride: usize = self.voxels[..axis].iter().product();
        let mut line = vec![0; n];
        for start in (0..field.len()).filter(|i| (i / stride).is_multiple_of(n)) {
            for (i, value) in line.iter_mut().enumerate() {
                *value = field[start + i * stride];
            }
            for i in 0..n {
                field[start + i * stride] = step(&line, i);
            }
        }
    }
}

/// The least of a voxel and its two neighbours.
fn grow(line: &[u32], i: usize) -> u32 {
    line[i.saturating_sub(1)..(i + 2).min(line.len())].iter().copied().fold(FAR, u32::min)
}

/// The least of value plus squared distance.
fn transform(line: &[u32], i: usize) -> u32 {
    let far = |j: usize| (i.abs_diff(j) * i.abs_diff(j)) as u32;
    line.iter().enumerate().map(|(j, &value)| value.saturating_add(far(j))).fold(FAR, u32::min)
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
