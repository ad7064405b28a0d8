//! The straight line: light that reaches a point as if the boundary did not refract it.
//!
//! p is where the ray from x towards the light leaves the body; Fresnel's factor and the attenuation are
//! those of p, the focusing is 1. Wherever eta is not 1, boundary points are wrong in place, number and strength
//! (Walter et al. 2009 compare this method), and points are lit that are dark in truth.

use super::facet::SolverWork;
use super::patch::SurfacePatch;
use super::throughput::{Query, Root, solid_angle_ratio};
use crate::geometry::{Hit, Ray, Shape};
use crate::optics::fresnel::fresnel;

/// The first crossing of the straight ray; its focusing as if it were the whole truth, eta^2 / J = 1.
pub(super) fn root(shape: &Shape, query: &Query, work: &mut SolverWork) -> Option<Root> {
    work.rays += 1;
    let hit = first(shape, query)?;
    let cl = query.w_l.dot(hit.shading_normal);
    let Query { w_l: dir, eta, .. } = *query;
    (cl > 0.0).then(|| Root {
        point: hit.point,
        face: hit.face,
        normal: hit.normal,
        shading: hit.shading_normal,
        dir,
        distance: hit.t,
        ratio: eta * eta,
        transmittance: 1.0 - fresnel(cl, eta).reflectance,
    })
}

fn first(shape: &Shape, query: &Query) -> Option<Hit> {
    let ray = Ray { origin: query.x, dir: query.w_l };
    shape.leave(&ray)
}

/// The root without refraction, eta = 1, where w is w_L: all later crossings are hidden behind the
/// first.
pub(super) fn crossings(
    shape: &Shape,
    query: &Query,
    work: &mut SolverWork,
    found: &mut impl FnMut(Root),
) {
    work.solves += 1;
    let Some(root) = root(shape, query, work) else { return };
    let Some(hit) = first(shape, query) else { return };
    let patch = SurfacePatch::at(shape, hit.face, hit.point, hit.normal);
    let ratio = solid_angle_ratio(&patch, query.w_l, hit.t, query.w_l, query.eta);
    found(Root { ratio, ..root });
}
