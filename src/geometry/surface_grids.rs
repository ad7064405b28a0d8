//! What is known of the surface of a mesh without the tree, and the memory that it takes.

use super::clearance::{self, Clearance};
use super::near_surface::{self, NearSurface};
use super::tree::MeshFrame;
use super::triangle::PreciseNormal;
use super::voxels::Voxels;
use crate::math::DVec3;

/// Grids that flights are asked of before the tree is.
#[derive(Clone, Debug)]
pub(super) struct SurfaceGrids {
    pub clearance: Clearance,
    pub near_surface: NearSurface,
}

impl SurfaceGrids {
    /// Of a mesh with the box `extent`, mm, from its triangles and the distance of a point to them, both in units of the frame.
    pub(super) fn new(
        frame: &MeshFrame,
        extent: (DVec3, DVec3),
        triangles: impl Iterator<Item = ([DVec3; 3], Option<PreciseNormal>)> + Clone,
        distance: impl FnMut(DVec3) -> f64,
    ) -> SurfaceGrids {
        let (clearance, balls) = Clearance::new(frame, extent, triangles.clone(), distance);
        let near_surface = NearSurface::new(frame, extent, triangles, (&clearance, &balls));
        SurfaceGrids { clearance, near_surface }
    }

    /// Memory behind them, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        self.clearance.heap_bytes() + self.near_surface.heap_bytes()
    }
}

/// About what [`SurfaceGrids::heap_bytes`] will be, of a surface of an area in units of the frame.
pub(super) fn expected_bytes(frame: &MeshFrame, extent: (DVec3, DVec3), area: f64) -> usize {
    let voxels = Voxels::over(frame, extent, clearance::VOXEL);
    clearance::expected_bytes(&voxels) + near_surface::expected_bytes(&voxels, area)
}

/// Memory that making them needs for a moment beside what they hold, bytes.
pub(super) fn building_bytes(frame: &MeshFrame, extent: (DVec3, DVec3)) -> usize {
    near_surface::building_bytes(&Voxels::over(frame, extent, clearance::VOXEL))
}

#[cfg(test)]
mod tests {
    use super::super::Shape;
    use super::super::testing::bodies;

    /// Of bodies of every kind, within 0.8 and 1.5 of it: a megabyte or two. A copy takes the grids along.
    #[test]
    fn memory_is_known_before_the_grids_are() {
        for (name, shape) in bodies() {
            let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
            let expected = mesh.heap_bytes();
            shape.prepare();
            let ratio = expected as f64 / mesh.heap_bytes() as f64;
            println!("{name}: {expected} of {} bytes, {ratio:.2}", mesh.heap_bytes());
            assert!((0.8..1.5).contains(&ratio), "{name}: {ratio}");
            assert_eq!(mesh.clone().heap_bytes(), mesh.heap_bytes(), "{name}");
        }
    }
}
