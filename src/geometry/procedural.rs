//! Meshes by formula: closed, outward oriented, their vertices shared exactly.

use std::collections::HashMap;
use std::f64::consts::PI;

use super::{Mesh, Normals};
use crate::error::Result;
use crate::math::{DVec3, cos, sin};

/// Vertices and triangles on the way to a mesh.
#[derive(Default)]
struct MeshParts {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl MeshParts {
    /// Two triangles for a quadrilateral that turns counter-clockwise seen from outside.
    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    fn into_mesh(self, unit_normals: Option<Vec<DVec3>>, interpolated: bool) -> Result<Mesh> {
        let normals = unit_normals.map(|vectors| Normals { vectors, corners: self.triangles.clone() });
        Mesh::new(self.vertices, self.triangles, normals, interpolated)
    }
}

/// A sphere of 20 * 4^subdivisions triangles whose vertices lie on it; its vertex normals are the
/// sphere's.
///
/// # Errors
/// As [`Mesh::new`].
pub fn icosphere(radius: f64, subdivisions: u32, interpolated: bool) -> Result<Mesh> {
    let MeshParts { vertices: normals, triangles } = unit_icosphere(subdivisions);
    let vertices = normals.iter().map(|&n| n * radius).collect();
    MeshParts { vertices, triangles }.into_mesh(Some(normals), interpolated)
}

/// An icosphere displaced along its radius: a unit vector n goes to
/// `radius (1 + amplitude sin(k n.x) sin(k n.y) sin(k n.z)) n`, k the wavenumber.
///
/// # Errors
/// As [`Mesh::new`].
pub fn bumpy_sphere(
    radius: f64,
    subdivisions: u32,
    amplitude: f64,
    wavenumber: f64,
    interpolated: bool,
) -> Result<Mesh> {
    let MeshParts { vertices, triangles } = unit_icosphere(subdivisions);
    let displaced = |n: DVec3| {
        let [x, y, z] = (n * wavenumber).to_array().map(sin);
        n * (radius * (1.0 + amplitude * x * y * z))
    };
    let vertices = vertices.into_iter().map(displaced).collect();
    MeshParts { vertices, triangles }.into_mesh(None, interpolated)
}

/// Octaves of a lumpy sphere, waves in each, wavenumber of the first.
const OCTAVES: u32 = 4;
const WAVES: u32 = 3;
const COARSEST: f64 = 4.0;

/// An icosphere displaced along its radius by irregular detail of four scales, as a scanned body has it:
/// `radius (1 + amplitude h(n)) n`, h being in [-1, 1] the mean, in proportion 1, 1/2, 1/4, 1/8, of
/// octaves of wavenumber 4, 8, 16, 32, each the mean of three plane waves sin(k d.n + phase). Their
/// directions d and phases are spaced by the golden angle. All octaves are about equally steep.
///
/// # Errors
/// As [`Mesh::new`].
pub fn lumpy_sphere(radius: f64, subdivisions: u32, amplitude: f64, interpolated: bool) -> Result<Mesh> {
    let golden_angle = PI * (3.0 - 5.0f64.sqrt());
    let count = OCTAVES * WAVES;
    let waves = (0..count).map(|index| {
        let octave = f64::from(1u32 << (index / WAVES));
        let height = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(count);
        let across = (1.0 - height * height).sqrt();
        let turn = f64::from(index) * golden_angle;
        let direction = DVec3::new(across * cos(turn), across * sin(turn), height);
        (direction * (COARSEST * octave), turn, 1.0 / octave)
    });
    let waves: Vec<(DVec3, f64, f64)> = waves.collect();
    let total: f64 = waves.iter().map(|(.., share)| share).sum();
    let MeshParts { vertices, triangles } = unit_icosphere(subdivisions);
    let displaced = |n: DVec3| {
        let sum: f64 = waves.iter().map(|(k, phase, share)| share * sin(k.dot(n) + phase)).sum();
        n * (radius * (1.0 + amplitude * sum / total))
    };
    let vertices = vertices.into_iter().map(displaced).collect();
    MeshParts { vertices, triangles }.into_mesh(None, interpolated)
}

/// A sphere with a concentric empty cavity, both icospheres of the same subdivisions.
///
/// # Errors
/// As [`Mesh::new`].
pub fn cavity_sphere(
    radius: f64,
    cavity_radius: f64,
    subdivisions: u32,
    interpolated: bool,
) -> Result<Mesh> {
    let MeshParts { vertices: n, triangles } = unit_icosphere(subdivisions);
    let scaled = |r: f64| n.iter().map(move |&n| n * r);
    let count = n.len() as u32;
    let facing_in = triangles.iter().map(|&[a, b, c]| [a + count, c + count, b + count]);
    let vertices = scaled(radius).chain(scaled(cavity_radius)).collect();
    let triangles = triangles.iter().copied().chain(facing_in).collect();
    let normals = scaled(1.0).chain(scaled(-1.0)).collect();
    MeshParts { vertices, triangles }.into_mesh(Some(normals), interpolated)
}

/// A torus about the z axis: a ring of radius `major`, a tube of radius `minor`, with the numbers
/// of segments around the ring and around the tube. Its vertex normals are the torus's.
///
/// # Errors
/// As [`Mesh::new`].
pub fn torus(major: f64, minor: f64, segments: [u32; 2], interpolated: bool) -> Result<Mesh> {
    let [ring, tube] = segments;
    let circle = |n: u32| -> Vec<(f64, f64)> {
        let angle = |i| 2.0 * PI * f64::from(i) / f64::from(n);
        (0..n).map(|i| (cos(angle(i)), sin(angle(i)))).collect()
    };
    let (ring_points, tube_points) = (circle(ring), circle(tube));
    let mut parts = MeshParts::default();
    let mut normals = Vec::new();
    for &(cos_phi, sin_phi) in &ring_points {
        for &(cos_theta, sin_theta) in &tube_points {
            let normal = DVec3::new(cos_phi * cos_theta, sin_phi * cos_theta, sin_theta).normalize();
            parts.vertices.push(DVec3::new(cos_phi, sin_phi, 0.0) * major + normal * minor);
            normals.push(normal);
        }
    }
    let at = |i: u32, j: u32| (i % ring) * tube + j % tube;
    for i in 0..ring {
        for j in 0..tube {
            parts.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    parts.into_mesh(Some(normals), interpolated)
}

/// A box about the origin with square holes through it along z, in a grid of `holes` along x and
/// y. A hole's side is `hole_fraction` times the distance between hole centres, the smaller one
/// where it differs along x and y.
///
/// # Errors
/// As [`Mesh::new`].
pub fn drilled_box(size: DVec3, holes: [u32; 2], hole_fraction: f64) -> Result<Mesh> {
    // Lines at the rims of all holes cut the top into rectangles, so every vertex of a wall is one of
    // the top: rectangle (i, j) is a hole if i and j are odd.
    let pitch = [size.x / f64::from(holes[0]), size.y / f64::from(holes[1])];
    let half_side = 0.5 * hole_fraction * pitch[0].min(pitch[1]);
    let lines = |side: f64, pitch: f64, count: u32| -> Vec<f64> {
        let middle = |i: u32| (f64::from(i) + 0.5) * pitch - 0.5 * side;
        let rims = (0..count).flat_map(|i| [middle(i) - half_side, middle(i) + half_side]);
        [-0.5 * side].into_iter().chain(rims).chain([0.5 * side]).collect()
    };
    let x = lines(size.x, pitch[0], holes[0]);
    let y = lines(size.y, pitch[1], holes[1]);
    let at = |i: usize, j: usize, top: bool| (2 * (i * y.len() + j) + usize::from(top)) as u32;
    let mut parts = MeshParts::default();
    for &x in &x {
        for &y in &y {
            parts.vertices.extend([-0.5, 0.5].map(|z| DVec3::new(x, y, z * size.z)));
        }
    }
    let (columns, rows) = (x.len() as isize - 1, y.len() as isize - 1);
    let solid = |i: isize, j: isize| {
        (0..columns).contains(&i) && (0..rows).contains(&j) && !(i % 2 == 1 && j % 2 == 1)
    };
    for i in 0..columns {
        for j in 0..rows {
            if !solid(i, j) {
                continue;
            }
            let (a, b) = (i as usize, j as usize);
            // The rectangle's corners, counter-clockwise seen from above, and its neighbours' offsets.
            let corners = [(a, b), (a + 1, b), (a + 1, b + 1), (a, b + 1)];
            let beside = [(0, -1), (1, 0), (0, 1), (-1, 0)];
            parts.quad(corners.map(|(i, j)| at(i, j, true)));
            let [p, q, r, s] = corners.map(|(i, j)| at(i, j, false));
            parts.quad([p, s, r, q]);
            for side in 0..4 {
                let (di, dj) = beside[side];
                if !solid(i + di, j + dj) {
                    let ((i0, j0), (i1, j1)) = (corners[side], corners[(side + 1) % 4]);
                    parts.quad([
                        at(i0, j0, false),
                        at(i1, j1, false),
                        at(i1, j1, true),
                        at(i0, j0, true),
                    ]);
                }
            }
        }
    }
    parts.into_mesh(None, false)
}

/// The icosahedron, each triangle cut into four at its sides' middles, put onto the unit sphere.
fn unit_icosphere(subdivisions: u32) -> MeshParts {
    let golden = 0.5 * (1.0 + 5.0f64.sqrt());
    let corner = |axis: usize, one: f64, phi: f64| {
        let mut v = DVec3::ZERO;
        (v[axis], v[(axis + 1) % 3]) = (one, phi);
        v.normalize()
    };
    let signs = [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)];
    let vertices = (0..3).flat_map(|axis| signs.map(|(one, phi)| corner(axis, one, phi))).collect();
    #[rustfmt::skip]
    let triangles = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11],
        [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9],
        [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    let mut parts = MeshParts { vertices, triangles };
    for _ in 0..subdivisions {
        let mut middles = HashMap::new();
        let mut finer = Vec::with_capacity(4 * parts.triangles.len());
        for [a, b, c] in std::mem::take(&mut parts.triangles) {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    let sum = parts.vertices[p as usize] + parts.vertices[q as usize];
                    parts.vertices.push(sum.normalize());
                    parts.vertices.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        parts.triangles = finer;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::triangle;

    #[test]
    fn volumes_and_counts_are_those_of_the_bodies() {
        let sphere = icosphere(2.0, 5, false).expect("closed");
        assert_eq!(sphere.triangles().len(), 20 * 4usize.pow(5));
        assert!((sphere.volume() / (4.0 / 3.0 * PI * 8.0) - 1.0).abs() < 2e-3);

        let cavity = cavity_sphere(2.0, 1.0, 5, true).expect("closed");
        assert!((cavity.volume() / (4.0 / 3.0 * PI * 7.0) - 1.0).abs() < 2e-3);

        // Meridian and tube polygons: their areas per circle's are sin(2 pi / n) / (2 pi / n).
        let ring = torus(2.0, 0.5, [256, 128], true).expect("closed");
        assert_eq!(ring.triangles().len(), 2 * 256 * 128);
        assert!((ring.volume() / (2.0 * PI * PI * 2.0 * 0.25) - 1.0).abs() < 1e-3);

        // Holes of side 0.4 * min(3 / 3, 2 / 2) = 0.4.
        let plate = drilled_box(DVec3::new(3.0, 2.0, 0.5), [3, 2], 0.4).expect("closed");
        assert!((plate.volume() - 0.5 * (6.0 - 6.0 * 0.16)).abs() < 1e-12);

        let smooth = bumpy_sphere(2.0, 5, 0.0, 9.0, false).expect("closed");
        assert_eq!(smooth.vertices(), sphere.vertices());
        let smooth = lumpy_sphere(2.0, 5, 0.0, false).expect("closed");
        assert_eq!(smooth.vertices(), sphere.vertices());
        // Within its amplitude, and using most of it.
        let lumpy = lumpy_sphere(2.0, 5, 0.25, false).expect("closed");
        let heights = lumpy.vertices().iter().map(|v| (v.length() / 2.0 - 1.0) / 0.25);
        let (low, high) = heights.fold((0.0f64, 0.0f64), |(low, high), h| (low.min(h), high.max(h)));
        assert!((-1.0..-0.5).contains(&low) && (0.5..1.0).contains(&high), "{low} {high}");
    }

    #[test]
    fn extremes_of_the_parameters_are_manifolds() {
        for subdivisions in 0..=6 {
            bumpy_sphere(1.0, subdivisions, 0.5, 1000.0, true).expect("closed");
            lumpy_sphere(1.0, subdivisions, 0.5, true).expect("closed");
            cavity_sphere(1.0, 0.999, subdivisions, true).expect("closed");
        }
        torus(1.0, 0.999, [3, 3], true).expect("closed");
        torus(1.0, 1e-3, [3, 500], true).expect("closed");
        drilled_box(DVec3::ONE, [1, 1], 0.999).expect("closed");
        drilled_box(DVec3::new(1.0, 10.0, 0.1), [64, 1], 1e-3).expect("closed");
    }

    #[test]
    fn vertex_normals_agree_with_the_triangles() {
        let meshes = [
            icosphere(1.0, 4, true),
            cavity_sphere(1.0, 0.5, 4, true),
            torus(2.0, 0.7, [96, 48], true),
            bumpy_sphere(1.0, 6, 0.1, 6.0, true),
            lumpy_sphere(1.0, 7, 0.1, true),
        ];
        for mesh in meshes.map(|mesh| mesh.expect("closed")) {
            let normals = mesh.normals().expect("interpolated");
            for (i, t) in mesh.triangles().iter().enumerate() {
                let flat = triangle::normal(&t.map(|i| mesh.vertices()[i as usize]));
                let smooth = normals.at(i, [1.0 / 3.0; 3]).expect("smooth");
                assert!(flat.dot(smooth) > 0.99, "{flat} {smooth}");
            }
        }
    }
}
