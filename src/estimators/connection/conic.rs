//! Every point of the boundary that refracts the light of a query: the complete solver.
//!
//! Half-space, slab and box are planes, each with at most one root in closed form. On a mesh the
//! hierarchy of `cones` leaves a few triangles, which `facet` solves; `sphere` has the sphere. For eta = 1
//! there is nothing to solve: the light comes straight.

use super::cones::ConeTree;
use super::facet::{self, SolverWork, TOLERANCE, plane_root};
use super::patch::SurfacePatch;
use super::sphere;
use super::straight_line;
use super::throughput::{Judgement, Query, Root};
use crate::geometry::{FaceId, Shape};
use crate::math::DVec3;

/// The solver, for one body.
#[derive(Clone, Debug)]
pub(in crate::estimators) struct Conic {
    tree: Option<ConeTree>,
}

impl Conic {
    pub(in crate::estimators) fn new(shape: &Shape) -> Conic {
        let tree = match shape {
            Shape::Mesh(mesh) => Some(ConeTree::new(mesh)),
            _ => None,
        };
        Conic { tree }
    }

    /// Memory behind it, bytes.
    pub(in crate::estimators) fn heap_bytes(&self) -> usize {
        self.tree.as_ref().map_or(0, ConeTree::heap_bytes)
    }

    /// The hierarchy of a mesh.
    pub(super) fn tree(&self) -> Option<&ConeTree> {
        self.tree.as_ref()
    }

    /// Offers every root to `found`, hidden ones included.
    pub(in crate::estimators) fn roots(
        &self,
        shape: &Shape,
        query: &Query,
        work: &mut SolverWork,
        found: &mut impl FnMut(Root),
    ) {
        if query.eta == 1.0 {
            straight_line::crossings(shape, query, work, found);
            return;
        }
        match (shape, &self.tree) {
            (Shape::Sphere { radius }, _) => {
                work.solves += 1;
                sphere::roots(*radius, query, found);
            }
            (_, Some(tree)) => {
                let nodes = tree.visit(query, |facet| facet::roots(query, facet, work, found));
                work.nodes += nodes;
            }
            _ => planes(shape, query, work, found),
        }
    }
}

fn judged(query: &Query, patch: &SurfacePatch, work: &mut SolverWork, found: &mut impl FnMut(Root)) {
    match query.judge(patch, TOLERANCE) {
        Judgement::Root(root) => found(root),
        Judgement::WrongSide => work.wrong_side += 1,
        Judgement::None => {}
    }
}

/// Roots on the faces of a half-space, slab or box.
fn planes(shape: &Shape, query: &Query, work: &mut SolverWork, found: &mut impl FnMut(Root)) {
    let mut face = |index: u32, on: DVec3, normal: DVec3, half: Option<DVec3>| {
        work.solves += 1;
        let Some(point) = plane_root(query, on, normal) else { return };
        let is_beside = |half: DVec3| (0..3).any(|i| normal[i] == 0.0 && point[i].abs() > half[i]);
        if !half.is_some_and(is_beside) {
            judged(query, &SurfacePatch::plane(point, FaceId(index), normal), work, found);
        }
    };
    match *shape {
        Shape::HalfSpace => face(0, DVec3::ZERO, DVec3::Z, None),
        Shape::Slab { thickness } => {
            face(0, DVec3::ZERO, DVec3::Z, None);
            face(1, DVec3::new(0.0, 0.0, -thickness), -DVec3::Z, None);
        }
        Shape::Box { half } => {
            for axis in 0..3 {
                for (sign, index) in [(-1.0, 2 * axis as u32), (1.0, 2 * axis as u32 + 1)] {
                    let mut normal = DVec3::ZERO;
                    normal[axis] = sign;
                    face(index, normal * half, normal, Some(half));
                }
            }
        }
        Shape::Sphere { .. } | Shape::Mesh(_) => {}
    }
}

#[cfg(test)]
#[path = "conic_tests.rs"]
mod tests;
