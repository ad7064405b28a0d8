//! Vertex normals of meshes: those of a file, or angle-weighted ones.

use crate::math::{DVec3, atan2};

/// Unit normals with a triangle's corners pointing to them; a vertex on a crease may have several.
#[derive(Clone, Debug, PartialEq)]
pub struct Normals {
    /// Outward unit vectors.
    pub vectors: Vec<DVec3>,
    /// For each triangle the indices of its corners' normals.
    pub corners: Vec<[u32; 3]>,
}

impl Normals {
    /// One normal a vertex: the sum of the normals of its triangles, each weighted by its angle at
    /// the vertex (Thürmer, Wüthrich, "Computing Vertex Normals from Polygonal Facets", 1998), which
    /// does not depend on how a flat part is cut into triangles. A vertex whose sum vanishes keeps
    /// the zero vector, and hits near it fall back on the triangle's normal.
    pub fn angle_weighted(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Normals {
        let mut sums = vec![DVec3::ZERO; vertices.len()];
        for corners in triangles {
            let triangle = corners.map(|i| vertices[i as usize]);
            let normal = super::triangle::normal(&triangle);
            for i in 0..3 {
                let to_next = triangle[(i + 1) % 3] - triangle[i];
                let to_last = triangle[(i + 2) % 3] - triangle[i];
                let angle = atan2(to_next.cross(to_last).length(), to_next.dot(to_last));
                sums[corners[i] as usize] += normal * angle;
            }
        }
        let vectors = sums.into_iter().map(DVec3::normalize_or_zero).collect();
        Normals { vectors, corners: triangles.to_vec() }
    }

    /// The interpolated unit normal at barycentric coordinates of a triangle; none if it vanishes.
    pub fn at(&self, triangle: usize, weights: [f64; 3]) -> Option<DVec3> {
        self.between(self.corners[triangle], weights)
    }

    /// The same between normals by their indices.
    #[inline]
    pub(super) fn between(&self, [a, b, c]: [u32; 3], weights: [f64; 3]) -> Option<DVec3> {
        // Not `map`, which is not inlined.
        let (a, b, c) = (self.vectors[a as usize], self.vectors[b as usize], self.vectors[c as usize]);
        (a * weights[0] + b * weights[1] + c * weights[2]).try_normalize()
    }

    /// Memory behind the normals, bytes.
    pub fn heap_bytes(&self) -> usize {
        size_of_val(&*self.vectors) + size_of_val(&*self.corners)
    }
}
