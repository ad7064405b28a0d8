//! Subdivision: first a boundary point x_k by a probe from x_i, then x_j on the way, from either end.
//!
//! With p(x_k | x_i) = p_probe(w_ik) cos_ik / d_ik^2 wherever x_i sees x_k, q the probability of the
//! call, and U of [`super::connections`],
//!   top to bottom   w_L from the light, w_kj by refraction, a distance along it by exponential and
//!                   equiangular sampling towards x_i:
//!                   q p(x_k | x_i) p_G(w_L) p(w_kj | w_L) p_t(d_jk) / d_jk^2
//!                   over U:  q p(x_k | x_i) p_G p_rev p_t d_ij^2
//!                            / (phase_i sigma_t T_ij phase_j T_jk cos_k)
//!   bottom to top   w_ij and distance by joint importance sampling towards x_k, w_L by refraction at
//!                   x_k:
//!                   q p(x_k | x_i) p_dir(w_ij) p_s(d_ij) / d_ij^2 p(w_L | w_kj)
//!                   over U:  q p(x_k | x_i) p_dir p_s p_fwd d_jk^2 / (the same)
//! Both force refraction; a sample that fails (total reflection, x_j outside the body, light below the
//! horizon) counts as 0.

use super::SneeOptions;
use super::end::{Call, End, Middle};
use super::guide::Guide;
use super::probe::ProbeMixture;
use super::state::{Connections, Slot};
use crate::estimators::Cost;
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::WalkExit;
use crate::estimators::walk::CameraWalk;
use crate::geometry::{FaceId, Hit, Ray, Side};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::sampling::distance::{DistanceMixture, Equiangular, transmittance};

/// Share of the exponential distances, top to bottom.
const EXPONENTIAL: f64 = 0.5;

/// How far a ray goes before distances along it end: to the boundary, or without end.
fn chord<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    ray: &Ray,
    from: Option<FaceId>,
) -> f64 {
    if !walk.rivals.setup.options.truncated {
        return f64::INFINITY;
    }
    walk.scores.count(Cost::Rays);
    let hit = walk.scene.shape.intersect(ray, Side::Inside, from, f64::INFINITY);
    hit.map_or(f64::INFINITY, |hit| hit.t)
}

/// Distances from x_k along `dir`, top to bottom.
fn from_boundary<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    x_i: DVec3,
    hit: &Hit,
    dir: DVec3,
) -> Option<DistanceMixture> {
    let t_max = chord(walk, &Ray { origin: hit.point, dir }, Some(hit.face));
    let equiangular = Equiangular::towards(x_i - hit.point, dir, t_max)?;
    let sigma_t = walk.rivals.setup.sigma;
    Some(DistanceMixture { sigma_t, t_max, equiangular, share_exponential: EXPONENTIAL })
}

/// Distances from x_i along `dir`, bottom to top.
fn from_vertex<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    x_i: DVec3,
    x_k: DVec3,
    dir: DVec3,
) -> Option<Equiangular> {
    let t_max = chord(walk, &Ray { origin: x_i, dir }, None);
    Equiangular::towards(x_k - x_i, dir, t_max)
}

/// The density of both directions of subdivision for an end, over U, times the density of the walk up to
/// x_i. The caller has seen to it that x_i sees x_k.
pub(super) fn density<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    x_i: Slot,
    middle: &Middle,
    exit: &WalkExit,
    end: &End<'_>,
) -> f64 {
    let setup = walk.rivals.setup;
    let options = &setup.options;
    if end.by_guide == 0.0 {
        return 0.0;
    }
    let call = options.call_for(&walk.boundary, end.guide);
    let needs_guess = call.decay > 0.0 || options.probe.needs_guess();
    let guess = if needs_guess { walk.guess(x_i, end.guide) } else { None };
    let q = call.probability(setup.sigma, guess.as_ref());
    if q == 0.0 {
        return 0.0;
    }
    let x_i = walk.rivals.vertex(x_i);
    let edge = exit.hit.point - x_i.point;
    let d_ik = edge.length();
    let to_k = edge / d_ik;
    let cos_ik = to_k.dot(exit.hit.normal);
    if cos_ik <= 0.0 {
        return 0.0;
    }
    let probe = ProbeMixture::new(options.probe, guess.as_ref(), 1.0 / setup.sigma);
    let point = q * probe.pdf(to_k) * cos_ik / (d_ik * d_ik);

    let Middle { to_j, to_k: leg_k, cos_k } = middle;
    let mut sum = 0.0;
    if options.strategies.top_to_bottom && end.reverse > 0.0 {
        let distances = from_boundary(walk, x_i.point, &exit.hit, -leg_k.dir);
        let pdf_distance = distances.map_or(0.0, |d| d.pdf_distance(leg_k.length));
        sum += end.by_guide * end.reverse * pdf_distance * (to_j.length * to_j.length);
    }
    if options.strategies.bottom_to_top && end.forward > 0.0 {
        let distances = from_vertex(walk, x_i.point, exit.hit.point, to_j.dir);
        let pdf_distance = distances.map_or(0.0, |d| d.pdf_distance(to_j.length));
        let directions = setup.joint.towards(x_i.arrival, to_k);
        let pdf_direction = directions.pdf(to_j.dir);
        sum += end.guide.choice
            * pdf_direction
            * pdf_distance
            * end.forward
            * (leg_k.length * leg_k.length);
    }
    if sum == 0.0 {
        return 0.0;
    }
    let medium = &walk.medium;
    let phases = medium.phase.pdf(x_i.arrival.dot(to_j.dir)) * medium.phase.pdf(to_j.dir.dot(leg_k.dir));
    let through = transmittance(medium.sigma_t, to_j.length + leg_k.length);
    point * sum * x_i.walks / (phases * medium.sigma_t * through * cos_k)
}

impl SneeOptions {
    /// How often an edge is subdivided for a guide.
    pub(super) fn call_for(&self, boundary: &Boundary, guide: &Guide) -> Call {
        let is_smooth = matches!(boundary, Boundary::Smooth { .. });
        let is_alone = is_smooth && guide.half_angle == 0.0 && self.connection.is_none();
        if is_alone { self.call_alone } else { self.call }
    }
}

/// An edge from the walk's latest vertex to a boundary point.
pub(super) struct ProbedEdge<'a> {
    guide: &'a Guide,
    hit: Hit,
}

/// A subdivided edge and the direction to the light at its end.
pub(super) struct Subdivided<'a> {
    pub guide: &'a Guide,
    pub x_j: DVec3,
    pub middle: Middle,
    pub exit: WalkExit,
    /// Unit direction towards the light.
    pub w_l: DVec3,
    /// Of the light, where it is known from the draw.
    pub radiance: Option<f64>,
}

/// Draws an edge at the walk's latest vertex.
pub(super) fn draw_edge<'a, B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'a>, B>,
) -> Option<ProbedEdge<'a>> {
    let setup = walk.rivals.setup;
    let options = &setup.options;
    let guide = walk.rivals.choose_guide()?;
    let call = options.call_for(&walk.boundary, guide);
    let x_i = walk.rivals.vertex(Slot::Latest);
    let u = walk.rivals.stream.draw();
    let reach = call.reach(setup.sigma, u, || walk.least_distance(guide))?;
    let needs_guess = call.decay > 0.0 || options.probe.needs_guess();
    let guess = if needs_guess { walk.guess(Slot::Latest, guide) } else { None };
    if reach < f64::INFINITY && guess.is_none_or(|guess| guess.distance >= reach) {
        return None;
    }
    let probe = ProbeMixture::new(options.probe, guess.as_ref(), 1.0 / setup.sigma);
    let dir = probe.sample(walk.rivals.stream.draw2());
    walk.scores.count(Cost::Rays);
    let ray = Ray { origin: x_i.point, dir };
    let hit = walk.scene.shape.leave(&ray)?;
    Some(ProbedEdge { guide, hit })
}

/// Subdivides an edge from the light's end.
pub(super) fn top_to_bottom<'a, B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'a>, B>,
    edge: &ProbedEdge<'a>,
) -> Option<Subdivided<'a>> {
    let &ProbedEdge { guide, hit } = edge;
    let x_i = walk.rivals.vertex(Slot::Latest);
    let light = &walk.scene.lights[guide.light];
    let sample = guide.sample(light, walk.band, walk.rivals.stream.draw2());
    let [u, v, w] = walk.rivals.stream.draw3();
    let frame = Frame::about(hit.shading_normal);
    let from = frame.to_local(sample.wi);
    let exit = WalkExit { hit, frame, wo: DVec3::ZERO };
    if !walk.leads_outside(&exit, sample.wi) {
        return None;
    }
    let inward = match walk.boundary {
        Boundary::Rough { .. } => walk.boundary.sample_refraction(from, [u, v]),
        _ => walk.boundary.refract(from),
    };
    let dir = frame.to_world(inward?);
    if dir.dot(hit.normal) >= 0.0 {
        return None;
    }
    let distances = from_boundary(walk, x_i.point, &hit, dir)?;
    let t = distances.sample(w);
    let down = Ray { origin: hit.point, dir };
    let x_j = down.at(t);
    let middle = Middle::new(x_i.point, x_j, &hit)?;
    let exit = WalkExit { wo: frame.to_local(dir), ..exit };
    // The leg from x_k to x_j, unless the chord has measured it.
    if distances.t_max == f64::INFINITY {
        walk.scores.count(Cost::ShadowRays);
        if walk.scene.shape.intersect(&down, Side::Inside, Some(hit.face), t).is_some() {
            return None;
        }
    }
    Some(Subdivided { guide, x_j, middle, exit, w_l: sample.wi, radiance: Some(sample.radiance) })
}

/// Subdivides an edge from the walk's end.
pub(super) fn bottom_to_top<'a, B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'a>, B>,
    edge: &ProbedEdge<'a>,
) -> Option<Subdivided<'a>> {
    let &ProbedEdge { guide, hit } = edge;
    let x_i = walk.rivals.vertex(Slot::Latest);
    if walk.scene.lights[guide.light].is_directional() {
        return None; // refraction never finds the one direction
    }
    let [a, b, c] = walk.rivals.stream.draw3();
    let [u, v] = walk.rivals.stream.draw2();
    let to_k = (hit.point - x_i.point).normalize();
    let dir = walk.rivals.setup.joint.towards(x_i.arrival, to_k).sample([a, b]);
    let s = from_vertex(walk, x_i.point, hit.point, dir)?.sample(c);
    let leg = Ray { origin: x_i.point, dir };
    let x_j = leg.at(s);
    let middle = Middle::new(x_i.point, x_j, &hit)?;
    let exit = walk.exit_at(hit, middle.to_k.dir)?;
    let outward = match walk.boundary {
        Boundary::Rough { .. } => walk.boundary.sample_refraction(exit.wo, [u, v]),
        _ => walk.boundary.refract(exit.wo),
    };
    let w_l = exit.frame.to_world(outward?);
    if !walk.leads_outside(&exit, w_l) {
        return None;
    }
    if !walk.rivals.setup.options.truncated {
        walk.scores.count(Cost::ShadowRays);
        if walk.scene.shape.intersect(&leg, Side::Inside, None, s).is_some() {
            return None;
        }
    }
    Some(Subdivided { guide, x_j, middle, exit, w_l, radiance: None })
}
