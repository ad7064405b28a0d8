//! Walks on the boundary towards a root, from a starting point: manifold next-event estimation, and
//! specular manifold sampling.
//!
//! A walk takes Newton steps in the tangent plane and returns to the boundary by a ray from x, so that its
//! roots are visible from x (Hanika, Droske & Fascione 2015, "Manifold next event estimation"). A step that
//! makes the residual grow is halved; otherwise the next one is doubled, up to 1.
//!
//! MNEE starts where the straight ray to the light leaves the body. It finds one root or none, and loses all
//! others. From random starts a walk finds each visible root k with an unknown probability p_k > 0. The number
//! of further trials until the same root is found again has the mean 1 / p_k and weights the root without
//! bias (Zeltner, Georgiev & Jakob 2020, "Specular manifold sampling for rendering high-frequency caustics and
//! glints"). Trials are never cut off: their mean number is one for each root that exists.
//!
//! Starts are uniform in the cone about w_L of half angle acos(min(eta, 1 / eta)), seen from x, beyond
//! which no refraction turns light.

use super::facet::{SolverWork, TOLERANCE};
use super::patch::SurfacePatch;
use super::throughput::{Constraint, Judgement, Query, Root};
use crate::geometry::{Hit, Ray, Shape};
use crate::math::{DVec3, Frame};
use crate::sampling::stream::Stream;
use crate::sampling::warp::square_to_cap;

/// Steps of a walk.
const STEPS: u32 = 64;

/// Residual at which a walk stops. Where two roots merge, a root's place is known to its square root:
/// 1e-7.
const CONVERGED: f64 = 1e-14;

/// Part of its Newton step below which a walk gives up, and has a root if its residual is 0 to the
/// tolerance.
const LEAST_SHARE: f64 = 1.0 / 4096.0;

/// Part of the distance from x within which two walks have found the same root.
const SAME: f64 = 1e-6;

fn first_hit(shape: &Shape, x: DVec3, dir: DVec3) -> Option<Hit> {
    shape.leave(&Ray { origin: x, dir })
}

fn patch_of(shape: &Shape, hit: &Hit) -> SurfacePatch {
    SurfacePatch::at(shape, hit.face, hit.point, hit.normal)
}

/// The root that a walk from the boundary point in direction `start` finds.
fn walk(shape: &Shape, query: &Query, start: DVec3, work: &mut SolverWork) -> Option<Root> {
    work.solves += 1;
    work.rays += 1;
    let mut patch = patch_of(shape, &first_hit(shape, query.x, start)?);
    let mut at = query.constraint(&patch);
    let mut share: f64 = 1.0;
    for _ in 0..STEPS {
        if at.residual.length() < CONVERGED {
            break;
        }
        let Some((next, next_at)) = step(shape, query, (&patch, &at), &mut share, work) else { break };
        (patch, at) = (next, next_at);
    }
    match query.judge(&patch, 0.01 * TOLERANCE) {
        Judgement::Root(root) => Some(root),
        Judgement::WrongSide => {
            work.wrong_side += 1;
            None
        }
        Judgement::None => None,
    }
}

/// One step that makes the residual smaller: the share of Newton's that does; `None` where none does.
fn step(
    shape: &Shape,
    query: &Query,
    (patch, at): (&SurfacePatch, &Constraint),
    share: &mut f64,
    work: &mut SolverWork,
) -> Option<(SurfacePatch, Constraint)> {
    let newton = query.step(patch, at)?;
    loop {
        work.steps += 1;
        work.rays += 1;
        let dir = (patch.point + newton * *share - query.x).normalize();
        if let Some(hit) = first_hit(shape, query.x, dir) {
            let next = patch_of(shape, &hit);
            let next_at = query.constraint(&next);
            if next_at.residual.length() < at.residual.length() {
                *share = (2.0 * *share).min(1.0);
                return Some((next, next_at));
            }
        }
        *share *= 0.5;
        if *share < LEAST_SHARE {
            return None;
        }
    }
}

/// Whether two roots of one query are the same.
pub(super) fn is_same(root: &Root, point: DVec3) -> bool {
    root.point.distance(point) <= SAME * root.distance
}

/// The root that MNEE finds.
pub(super) fn mnee(shape: &Shape, query: &Query, work: &mut SolverWork) -> Option<Root> {
    walk(shape, query, query.w_l, work)
}

/// A root that specular manifold sampling finds, and its weight.
pub(super) fn sms(
    shape: &Shape,
    query: &Query,
    stream: &mut Stream,
    work: &mut SolverWork,
) -> Option<(Root, f64)> {
    let frame = Frame::about(query.w_l);
    // Without refraction the cone is one direction.
    let height = 1.0 - query.eta.min(1.0 / query.eta);
    let mut trial = |work: &mut SolverWork| {
        let start = frame.to_world(square_to_cap(height, stream.draw2()));
        walk(shape, query, start, work)
    };
    let root = trial(work)?;
    let mut trials = 1.0;
    while !trial(work).is_some_and(|again| is_same(&again, root.point)) {
        trials += 1.0;
    }
    Some((root, trials))
}

#[cfg(test)]
#[path = "manifold_tests.rs"]
mod tests;
