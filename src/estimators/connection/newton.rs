//! One Newton iteration on every triangle that the hierarchy leaves (Walter, Zhao, Holzschuch & Bala
//! 2009, "Single scattering in refractive media with triangle mesh boundaries").
//!
//! The iteration starts at the triangle's middle; a step that makes the residual grow is halved. Where a
//! triangle has two roots, or where the iteration goes astray, roots are lost: on flat facets and
//! analytic shapes, where one start is enough or the roots are closed, it is complete, with interpolated
//! normals it is not.

use super::conic::Conic;
use super::facet::{self, SolverWork, TOLERANCE};
use super::patch::Facet;
use super::throughput::{Judgement, Query, Root};
use crate::geometry::Shape;

/// Steps of an iteration; about five bring the residual to rounding.
const STEPS: u32 = 20;

/// Offers the roots that it finds. `conic` has the hierarchy, and the closed forms of flat facets and
/// other shapes.
pub(super) fn roots(
    conic: &Conic,
    shape: &Shape,
    query: &Query,
    work: &mut SolverWork,
    found: &mut impl FnMut(Root),
) {
    let is_interpolated = matches!(shape, Shape::Mesh(mesh) if mesh.normals().is_some());
    let Some(tree) = conic.tree().filter(|_| is_interpolated && query.eta != 1.0) else {
        conic.roots(shape, query, work, found);
        return;
    };
    let nodes = tree.visit(query, |facet| {
        work.solves += 1;
        let Some(place) = iterate(query, facet, work) else { return };
        if !facet.owns(place) {
            return;
        }
        match query.judge(&facet.patch(place), TOLERANCE) {
            Judgement::Root(root) => found(root),
            Judgement::WrongSide => work.wrong_side += 1,
            Judgement::None => {}
        }
    });
    work.nodes += nodes;
}

/// Barycentric coordinates of a root, from the middle of a facet.
fn iterate(query: &Query, facet: &Facet, work: &mut SolverWork) -> Option<[f64; 2]> {
    /// Residual at which the last digits are left to `polish`.
    const CLOSE: f64 = 1e-10;
    let mut place = [1.0 / 3.0; 2];
    let mut patch = facet.patch(place);
    let mut at = query.constraint(&patch);
    let mut share = 1.0;
    for _ in 0..STEPS {
        work.steps += 1;
        let step = query.step(&patch, &at)? * share;
        let next = facet.place(patch.point + step);
        let next_patch = facet.patch(next);
        let next_at = query.constraint(&next_patch);
        if next_at.residual.length() > at.residual.length() {
            share *= 0.5;
            continue;
        }
        (place, patch, at, share) = (next, next_patch, next_at, 1.0);
        if at.residual.length() < CLOSE {
            return Some(facet::polish(query, facet, place));
        }
    }
    None
}
