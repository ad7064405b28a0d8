//! One Newton iteration on every triangle that the hierarchy leaves (Walter, Zhao, Holzschuch & Bala
//! 2009, "Single scattering in refractive media with triangle mesh boundaries").
//!
//! The iteration starts at the middle of the triangle; a step that makes the residual grow is halved. Where a
//! triangle has two roots, or where the iteration does not converge, roots are lost. The method is complete
//! on flat facets and analytic shapes, where one start suffices or roots have closed forms; with interpolated
//! normals it is not. On a sphere with a rough boundary it is one walk from the straight line.

use super::conic::Conic;
use super::facet::{self, SolverWork, TOLERANCE};
use super::manifold;
use super::patch::Facet;
use super::throughput::{Judgement, Query, Root};
use crate::geometry::{FaceId, Mesh, Shape};
use crate::math::{DVec2, DVec3};

/// Steps of an iteration; about five bring the residual to rounding.
const STEPS: u32 = 20;

/// How a body is searched.
enum NewtonSearch<'a> {
    /// Completely, by closed forms.
    Closed,
    /// By one walk on the boundary: microfacets break the symmetry that the sphere's roots need.
    Walk,
    /// By an iteration on every triangle.
    Triangles(&'a Mesh),
}

fn search<'a>(shape: &'a Shape, query: &Query) -> NewtonSearch<'a> {
    match shape {
        _ if query.eta == 1.0 => NewtonSearch::Closed,
        Shape::Sphere { .. } if query.slopes != DVec2::ZERO => NewtonSearch::Walk,
        Shape::Mesh(mesh) if mesh.normals().is_some() => NewtonSearch::Triangles(mesh),
        _ => NewtonSearch::Closed,
    }
}

/// Offers the roots that it finds. `conic` has the hierarchy, and the closed forms of flat facets and
/// other shapes.
pub(super) fn roots(
    conic: &Conic,
    shape: &Shape,
    query: &Query,
    work: &mut SolverWork,
    found: &mut impl FnMut(Root),
) {
    match (search(shape, query), conic.tree()) {
        (NewtonSearch::Triangles(_), Some(tree)) => {
            let nodes = tree.visit(query, |facet| on_facet(query, facet, work, found));
            work.nodes += nodes;
        }
        (NewtonSearch::Walk, _) => manifold::mnee(shape, query, work).into_iter().for_each(found),
        _ => conic.roots(shape, query, work, found),
    }
}

/// Whether it finds the root of a query that is at this point of a face.
pub(super) fn finds(
    shape: &Shape,
    query: &Query,
    (face, point): (FaceId, DVec3),
    work: &mut SolverWork,
) -> bool {
    let mut is_found = false;
    let mut compare = |root: Root| is_found |= manifold::is_same(&root, point);
    match search(shape, query) {
        NewtonSearch::Closed => return true,
        NewtonSearch::Walk => manifold::mnee(shape, query, work).into_iter().for_each(compare),
        NewtonSearch::Triangles(mesh) => on_facet(query, &Facet::new(mesh, face.0), work, &mut compare),
    }
    is_found
}

fn on_facet(query: &Query, facet: &Facet, work: &mut SolverWork, found: &mut impl FnMut(Root)) {
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
