//! What files of meshes hold: triangles, and normals where there are any.

use std::collections::HashMap;

use super::{Mesh, Normals};
use crate::error::Result;
use crate::math::DVec3;

/// Triangles as they are collected from a file. Vertices at exactly the same position become one.
pub(super) struct ImportedMesh {
    welder: Welder,
    triangles: Vec<[u32; 3]>,
    normals: Normals,
    /// Whether every corner has a normal of the file's.
    has_normals: bool,
}

impl ImportedMesh {
    /// Nothing so far.
    pub(super) fn new() -> ImportedMesh {
        ImportedMesh {
            welder: Welder::default(),
            triangles: Vec::new(),
            normals: Normals { vectors: Vec::new(), corners: Vec::new() },
            has_normals: true,
        }
    }

    /// Adds triangles between `positions`, by their indices; normals are those of the positions, or none.
    pub(super) fn add(
        &mut self,
        positions: impl IntoIterator<Item = DVec3>,
        normals: impl IntoIterator<Item = DVec3>,
        triangles: impl IntoIterator<Item = [u32; 3]>,
    ) {
        let offset = self.normals.vectors.len() as u32;
        let welded: Vec<u32> = positions.into_iter().map(|p| self.welder.index(p)).collect();
        for corners in triangles {
            self.triangles.push(corners.map(|i| welded[i as usize]));
            self.normals.corners.push(corners.map(|i| i + offset));
        }
        let before = self.normals.vectors.len();
        self.normals.vectors.extend(normals.into_iter().map(DVec3::normalize_or_zero));
        self.has_normals &= self.normals.vectors.len() - before == welded.len();
    }

    /// The positions of the vertices.
    pub(super) fn vertices(&mut self) -> &mut [DVec3] {
        &mut self.welder.vertices
    }

    /// Normals turn with the body.
    pub(super) fn turn_normals(&mut self, turn: impl Fn(DVec3) -> DVec3) {
        self.normals.vectors.iter_mut().for_each(|normal| *normal = turn(*normal));
    }

    /// The closed mesh. `interpolated` shading uses the file's normals if every corner has one, else
    /// angle-weighted ones.
    pub(super) fn finish(self, interpolated: bool) -> Result<Mesh> {
        let complete = self.has_normals && self.normals.vectors.iter().all(|n| *n != DVec3::ZERO);
        let normals = complete.then_some(self.normals);
        Mesh::new(self.welder.vertices, self.triangles, normals, interpolated)
    }
}

/// Gives equal positions one index.
#[derive(Default)]
struct Welder {
    vertices: Vec<DVec3>,
    known: HashMap<[u64; 3], u32>,
}

impl Welder {
    fn index(&mut self, point: DVec3) -> u32 {
        // Adding 0 makes -0 and 0 the same bits.
        let bits = point.to_array().map(|x| (x + 0.0).to_bits());
        *self.known.entry(bits).or_insert_with(|| {
            self.vertices.push(point);
            self.vertices.len() as u32 - 1
        })
    }
}
