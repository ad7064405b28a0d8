//! How far a point surely is from the surface: rules out short flights without the tree.
//!
//! A uniform grid of cubic voxels over the mesh's box. A voxel is occupied if a triangle may touch it.
//! Voxels at an offset (i, j, k) are apart by at least `size sqrt(f(i)^2 + f(j)^2 + f(k)^2)` with
//! `f(i) = max(|i| - 1, 0)`; the least such distance to an occupied voxel bounds the distance to the
//! surface from every point of the voxel. Since f(i) is the least |i + e| with e in {-1, 0, 1}, it
//! is the plain distance transform of the occupied set grown by one voxel each way, and both steps
//! go axis by axis (Saito, Toriwaki, "New algorithms for Euclidean distance transformation of an
//! n-dimensional digitized picture", Pattern Recognition 27(11), 1994).

use super::tree::{MeshFrame, PAD};
use crate::math::DVec3;

/// Edge of a voxel, units of the frame: 64 voxels along the longest side.
const VOXEL: f64 = 32.0;

/// Squared distance, in voxels, of what has no occupied voxel in sight.
const FAR: u32 = u32::MAX / 2;

/// Grid of lower bounds of the distance to the surface.
#[derive(Clone, Debug)]
pub(super) struct Clearance {
    /// Least corner, units of the frame.
    corner: DVec3,
    voxels: [usize; 3],
    /// Lower bound of the distance to the surface, units of the frame, x fastest.
    bounds: Vec<f32>,
}

impl Clearance {
    /// The grid of a mesh with the box (`min`, `max`), mm, around its triangles.
    pub(super) fn new<'a>(
        frame: &MeshFrame,
        (min, max): (DVec3, DVec3),
        triangles: impl Iterator<Item = &'a [DVec3; 3]>,
    ) -> Clearance {
        let corner = frame.place(min) - PAD;
        let size = frame.place(max) + PAD - corner;
        let voxels = size.to_array().map(|side| (side / VOXEL) as usize + 1);
        let mut grid = Clearance { corner, voxels, bounds: Vec::new() };
        let mut distance2 = vec![FAR; voxels.iter().product()];
        for triangle in triangles {
            grid.occupy(&triangle.map(|vertex| frame.place(vertex)), &mut distance2);
        }
        for axis in 0..3 {
            grid.along(axis, &mut distance2, grow);
        }
        for axis in 0..3 {
            grid.along(axis, &mut distance2, transform);
        }
        // The padding pays for the rounding of points at voxel borders and of f32.
        let bound = |&d2: &u32| (f64::from(d2).sqrt() * VOXEL - PAD).max(0.0) as f32;
        grid.bounds = distance2.iter().map(bound).collect();
        grid
    }

    /// A lower bound of the distance to the surface, units of the frame; 0 outside the grid.
    pub(super) fn at(&self, point: DVec3) -> f64 {
        let voxel = (point - self.corner) * (1.0 / VOXEL);
        if voxel.min_element() < 0.0 {
            return 0.0;
        }
        let [i, j, k] = voxel.to_array().map(|c| c as usize);
        let [nx, ny, nz] = self.voxels;
        if i < nx && j < ny && k < nz { self.bounds[i + nx * (j + ny * k)].into() } else { 0.0 }
    }

    /// Memory behind the grid, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        size_of_val(&*self.bounds)
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
    fn short_flights_end_as_they_do_without_the_grid() {
        let mut u = Uniform::named("short_flights_end_as_they_do_without_the_grid");
        for (name, shape) in bodies() {
            let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
            let sphere = mesh.bounds();
            for _ in 0..RAYS {
                let origin = sphere.center + direction(&mut u) * (u.next() * sphere.radius);
                let ray = Ray { origin, dir: direction(&mut u) };
                let t_max = u.next().powi(4) * sphere.radius;
                let (with, without) = (
                    mesh.intersect(&ray, Side::Inside, None, t_max),
                    mesh.search(&ray, Side::Inside, None, t_max),
                );
                assert_eq!(with, without, "{name}");
            }
        }
    }
}
