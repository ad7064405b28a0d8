//! The connection: from a medium vertex x_j to every point of a smooth boundary that refracts light from a drawn
//! direction to it.
//!
//! Draw a guide and w_L from it, with density p_G (the choice included; of parallel light the choice alone), and find
//! all x_k with a complete solver ([`crate::estimators::connection`]). With w_jk the direction to x_k and J = |d w_L /
//! d w_jk| at fixed x_j, w_jk has the density q p_G J per solid angle, q being the probability of the call: per
//! area of x_k q p_G J cos_k / d_jk^2, times the Dirac factor of refraction, written in w_L as everywhere here. Under
//! parallel light the Dirac factor of the light stays beside it. So the coefficient is the same for every light, and
//!   over U of [`super::connections`]:   q p_G J / (phase_j T_jk).
//!
//! Against subdivision. x_j itself is the walk's, with the density p_walk = phase_i sigma_t T_ij / d_ij^2 per volume.
//! Both densities over U, divided by the part that they share, are those per volume of x_j given x_i:
//!   connection      q p_walk
//!   top to bottom   q' p(x_k | x_i) p_t M cos_T / (cos_L cos_k),   M = eta^2 / J,
//! cos_T and cos_L at the shading normal. M is the magnification on the camera's side, and M cos_T / (cos_L cos_k) =
//! M_g / cos_Lg with that on the light's side, M_g, by which a pencil of rays spreads behind the boundary, and the
//! cosine of the light to the geometric normal: dV = (cos_Lg / M_g) dA dt. Their ratio is Veach's factor (1997, 5.3), so no
//! technique needs it as a weight: all score the camera's f, the light's side only states how densely it draws.
//! At a caustic J goes to 0 and f = T eta^2 E / J without bound. The connection alone has a second moment that
//! diverges as a logarithm (M is 1 / sqrt of the distance). Subdivision is the denser the brighter the caustic, so
//!   f / (p_connection + p_subdivision)
//! is bounded where both take part; subdivision's own tails (x_j by x_i, x_k far from x_i) are where the connection is
//! dense.
//!
//!   what of the path              walk (a disc)   top to bottom   connection
//!   x_j and no vertex before it   yes             -               yes           single scattering
//!   x_i -> x_j, x_i sees x_k      yes             yes             yes
//!   x_i -> x_j, x_k is hidden     yes             -               yes
//!   x_i, reflected inside, x_j    yes             -               yes
//!   light reflected inside        yes             -               -
//! Under parallel light the walk finds nothing. Where the connection is alone, its caustics keep their tail.
//!
//! The call's probability falls with a lower bound of the distance to the boundary, not with that of the specular
//! guess: no root is nearer, so for decay <= 1 no weight grows with depth, wherever the roots are.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::end::{Call, End, Leg};
use super::guide::Guide;
use super::last_vertex::GuidedEnd;
use super::state::{Connections, Slot};
use crate::estimators::Anomaly;
use crate::estimators::bands::WalkBands;
use crate::estimators::connection::{Conic, Query, Root, SolverWork, SurfacePatch, solid_angle_ratio};
use crate::estimators::vertices::WalkExit;
use crate::estimators::walk::CameraWalk;
use crate::geometry::Hit;
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::sampling::distance::transmittance;

/// How often a medium vertex is connected through a smooth boundary.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConnectionCall {
    /// Probability of a connection at the boundary; 0 switches it off.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub most: f64,
    /// How fast it falls per mean free path of distance to the boundary (a lower bound of it).
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub decay: f64,
    /// Factor of the probability at all medium vertices but the first one inside the boundary, whose paths subdivision
    /// finds, too.
    #[serde(default = "whole")]
    #[schemars(range(min = 0.01, max = 1.0))]
    pub later: f64,
}

fn whole() -> f64 {
    1.0
}

impl Default for ConnectionCall {
    fn default() -> ConnectionCall {
        ConnectionCall { most: 1.0, decay: 1.0, later: 0.5 }
    }
}

impl ConnectionCall {
    /// At the walk's vertex of this slot, the walk having come to `count` of them since it met the boundary.
    fn call(&self, slot: Slot, count: u32) -> Call {
        let is_first = matches!(slot, Slot::Latest) && count == 1;
        Call { most: self.most * if is_first { 1.0 } else { self.later }, decay: self.decay }
    }
}

/// The technique, prepared for a body.
#[derive(Clone, Debug)]
pub(super) struct Specular {
    pub call: ConnectionCall,
    pub solver: Arc<Conic>,
}

/// How near the boundary may be to a point, mm: rounding may put a vertex outside.
fn clearance<R, B>(walk: &CameraWalk<'_, R, B>, point: DVec3) -> f64 {
    walk.scene.shape.clearance(point).max(0.0)
}

/// The technique's density of an end whose last vertex is x_j, over U, times the density of the walk up to x_j. The
/// caller has seen to it that x_k is the first boundary point that x_j sees.
pub(super) fn density<B: WalkBands>(
    walk: &CameraWalk<'_, Connections<'_>, B>,
    x_j: Slot,
    to_k: &Leg,
    exit: &WalkExit,
    end: &End<'_>,
) -> f64 {
    let setup = walk.rivals.setup;
    let Some(technique) = &setup.specular else { return 0.0 };
    if end.by_guide == 0.0 {
        return 0.0;
    }
    let call = technique.call.call(x_j, walk.rivals.count);
    let x_j = walk.rivals.vertex(x_j);
    let q = call.within(setup.sigma, clearance(walk, x_j.point));
    let Hit { face, point, normal, .. } = exit.hit;
    let patch = SurfacePatch::at(&walk.scene.shape, face, point, normal);
    let ratio = solid_angle_ratio(&patch, to_k.dir, to_k.length, end.w_l, walk.boundary.eta());
    let pdf = q * end.by_guide * ratio;
    if pdf == 0.0 {
        return 0.0;
    }
    let phase = walk.medium.phase.pdf(x_j.arrival.dot(to_k.dir));
    pdf * x_j.walks / (phase * transmittance(walk.medium.sigma_t, to_k.length))
}

/// Light from one direction, and where it is refracted to the walk's latest vertex.
pub(super) struct LitVertex<'a> {
    pub guide: &'a Guide,
    pub w_l: DVec3,
    pub radiance: f64,
    /// Hidden ones included.
    pub roots: Vec<Root>,
}

/// Draws the technique at the walk's latest vertex.
pub(super) fn draw<'a, B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'a>, B>,
    technique: &Specular,
) -> Option<LitVertex<'a>> {
    let sigma = walk.rivals.setup.sigma;
    let call = technique.call.call(Slot::Latest, walk.rivals.count);
    let x_j = walk.rivals.vertex(Slot::Latest).point;
    let u = walk.rivals.stream.draw();
    call.reach(sigma, u, || clearance(walk, x_j))?;
    let guide = walk.rivals.choose_guide()?;
    let light = &walk.scene.lights[guide.light];
    let sample = guide.sample(light, walk.band, walk.rivals.stream.draw2());
    let query = Query::new(x_j, sample.wi, walk.boundary.eta());
    let mut roots = std::mem::take(&mut walk.rivals.roots);
    roots.clear();
    let mut work = SolverWork::default();
    technique.solver.roots(&walk.scene.shape, &query, &mut work, &mut |root| roots.push(root));
    walk.rivals.search(&work);
    (0..work.wrong_side).for_each(|_| walk.scores.note(Anomaly::WrongSide));
    Some(LitVertex { guide, w_l: sample.wi, radiance: sample.radiance, roots })
}

impl<'a> LitVertex<'a> {
    /// The path's end at a root; `None` where something is between it and the walk's latest vertex.
    pub(super) fn end<B: WalkBands>(
        &self,
        walk: &mut CameraWalk<'_, Connections<'a>, B>,
        root: &Root,
    ) -> Option<GuidedEnd<'a>> {
        let Root { point, face, normal, shading, dir, distance, .. } = *root;
        let x_j = walk.rivals.vertex(Slot::Latest).point;
        if !walk.sees_point(x_j, point) {
            return None;
        }
        let hit = Hit { t: distance, point, normal, shading_normal: shading, face };
        let frame = Frame::about(shading);
        let exit = WalkExit { hit, frame, wo: frame.to_local(-dir) };
        let leg = Leg { dir, length: distance };
        let radiance = Some(self.radiance);
        Some(GuidedEnd { guide: self.guide, exit, leg, w_l: self.w_l, radiance })
    }
}

/// Whether the technique takes part at a boundary.
pub(super) fn is_served(boundary: &Boundary) -> bool {
    matches!(boundary, Boundary::Smooth { .. })
}
