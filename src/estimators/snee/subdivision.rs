//! Subdivision: first a boundary point x_k by a probe from x_i, then x_j on the way, from either end.
//!
//! With p(x_k | x_i) = p_probe(w_ik) cos_ik / d_ik^2 wherever x_i sees x_k, q the probability of the call, and
//! U of [`super::connections`],
//!   top to bottom   w_L from the light, w_kj by refraction, a distance along it by exponential and
//!                   equiangular sampling towards x_i:
//!                   q p(x_k | x_i) p_G(w_L) p(w_kj | w_L) p_t(d_jk) / d_jk^2
//!                   over U:  q p(x_k | x_i) p_G p_rev p_t d_ij^2 / (phase_i sigma_t T_ij phase_j T_jk cos_k)
//!   bottom to top   w_ij and distance by joint importance sampling towards x_k, w_L by refraction at x_k:
//!                   q p(x_k | x_i) p_dir(w_ij) p_s(d_ij) / d_ij^2 p(w_L | w_kj)
//!                   over U:  q p(x_k | x_i) p_dir p_s p_fwd d_jk^2 / (the same)
//! Both force refraction; a sample that fails (total reflection, x_j outside the body, light below the
//! horizon) counts as 0.

use super::SneeOptions;
use super::connections::{Call, Connections, End, Middle, Vertex};
use super::guide::Guide;
use super::last_vertex;
use super::probe::Probe;
use crate::estimators::Cost;
use crate::estimators::bands::Bands;
use crate::estimators::walk::{Exit, Walk};
use crate::geometry::{FaceId, Hit, Ray, Side};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::sampling::distance::{DistanceMixture, Equiangular, transmittance};

/// Share of the exponential distances, top to bottom.
const EXPONENTIAL: f64 = 0.5;

/// How far a ray goes before distances along it end: to the boundary, or without end.
fn chord<B: Bands>(walk: &mut Walk<'_, Connections<'_>, B>, ray: &Ray, from: Option<FaceId>) -> f64 {
    if !walk.rivals.setup.options.truncated {
        return f64::INFINITY;
    }
    walk.scores.count(Cost::Rays);
    let hit = walk.scene.shape.intersect(ray, Side::Inside, from, f64::INFINITY);
    hit.map_or(f64::INFINITY, |hit| hit.t)
}

/// Distances from x_k along `dir`, top to bottom.
fn from_boundary<B: Bands>(
    walk: &mut Walk<'_, Connections<'_>, B>,
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
fn from_vertex<B: Bands>(
    walk: &mut Walk<'_, Connections<'_>, B>,
    x_i: DVec3,
    x_k: DVec3,
    dir: DVec3,
) -> Option<Equiangular> {
    let t_max = chord(walk, &Ray { origin: x_i, dir }, None);
    Equiangular::towards(x_k - x_i, dir, t_max)
}

/// The density of both directions of subdivision for an end, over U, times the density of the walk up to x_i.
/// The caller has seen to it that x_i sees x_k.
pub(super) fn density<B: Bands>(
    walk: &mut Walk<'_, Connections<'_>, B>,
    x_i: &mut Vertex,
    guide: &Guide,
    middle: &Middle,
    exit: &Exit,
    end: &End,
) -> f64 {
    let setup = walk.rivals.setup;
    let options = &setup.options;
    if end.guide == 0.0 {
        return 0.0;
    }
    let call = options.call_for(&walk.boundary, guide);
    let needs_guess = call.decay > 0.0 || options.probe.needs_guess();
    let guess = if needs_guess { x_i.guess(walk, guide) } else { None };
    let q = call.probability(setup.sigma, guess.as_ref());
    if q == 0.0 {
        return 0.0;
    }
    let edge = exit.hit.point - x_i.point;
    let d_ik = edge.length();
    let to_k = edge / d_ik;
    let cos_ik = to_k.dot(exit.hit.normal);
    if cos_ik <= 0.0 {
        return 0.0;
    }
    let probe = Probe::new(options.probe, guess.as_ref(), 1.0 / setup.sigma);
    let point = q * probe.pdf(to_k) * cos_ik / (d_ik * d_ik);

    let mut sum = 0.0;
    if options.strategies.top_to_bottom && end.reverse > 0.0 {
        let distances = from_boundary(walk, x_i.point, &exit.hit, -middle.to_k);
        let pdf_distance = distances.map_or(0.0, |d| d.pdf_distance(middle.d_jk));
        sum += end.guide * end.reverse * pdf_distance * (middle.d_ij * middle.d_ij);
    }
    if options.strategies.bottom_to_top && end.forward > 0.0 {
        let distances = from_vertex(walk, x_i.point, exit.hit.point, middle.to_j);
        let pdf_distance = distances.map_or(0.0, |d| d.pdf_distance(middle.d_ij));
        let directions = setup.joint.towards(x_i.arrival, to_k);
        let pdf_direction = directions.pdf(middle.to_j);
        sum += guide.choice * pdf_direction * pdf_distance * end.forward * (middle.d_jk * middle.d_jk);
    }
    if sum == 0.0 {
        return 0.0;
    }
    let medium = &walk.medium;
    let phases =
        medium.phase.pdf(x_i.arrival.dot(middle.to_j)) * medium.phase.pdf(middle.to_j.dot(middle.to_k));
    let through = transmittance(medium.sigma_t, middle.d_ij + middle.d_jk);
    point * sum * x_i.walks / (phases * medium.sigma_t * through * middle.cos_k)
}

impl SneeOptions {
    /// How often an edge is subdivided for a guide.
    fn call_for(&self, boundary: &Boundary, guide: &Guide) -> Call {
        let is_alone = matches!(boundary, Boundary::Smooth { .. }) && guide.half_angle == 0.0;
        if is_alone { self.call_alone } else { self.call }
    }
}

/// Draws both directions of subdivision at the walk's latest vertex and scores what they find.
pub(super) fn call<B: Bands>(walk: &mut Walk<'_, Connections<'_>, B>) {
    let setup = walk.rivals.setup;
    let options = &setup.options;
    let Some(guide) = walk.rivals.choose_guide() else { return };
    let call = options.call_for(&walk.boundary, guide);
    let Some(reach) = call.reach(setup.sigma, walk.rivals.stream.draw()) else { return };
    let mut x_i = walk.rivals.vertices[1];
    if reach < f64::INFINITY && walk.scene.shape.clearance(x_i.point) >= reach {
        return;
    }
    let needs_guess = call.decay > 0.0 || options.probe.needs_guess();
    let guess = if needs_guess { x_i.guess(walk, guide) } else { None };
    walk.rivals.vertices[1] = x_i;
    if reach < f64::INFINITY && guess.is_none_or(|guess| guess.distance >= reach) {
        return;
    }
    let probe = Probe::new(options.probe, guess.as_ref(), 1.0 / setup.sigma);
    let to_k = probe.sample(walk.rivals.stream.draw2());
    walk.scores.count(Cost::Rays);
    let ray = Ray { origin: x_i.point, dir: to_k };
    let Some(hit) = walk.scene.shape.intersect(&ray, Side::Inside, None, f64::INFINITY) else { return };
    if options.strategies.top_to_bottom {
        top_to_bottom(walk, &mut x_i, guide, &hit);
    }
    if options.strategies.bottom_to_top {
        bottom_to_top(walk, &mut x_i, guide, &hit);
    }
    walk.rivals.vertices[1] = x_i;
}

fn top_to_bottom<B: Bands>(
    walk: &mut Walk<'_, Connections<'_>, B>,
    x_i: &mut Vertex,
    guide: &Guide,
    hit: &Hit,
) {
    let light = &walk.scene.lights[guide.light];
    let sample = guide.sample(light, walk.band, walk.rivals.stream.draw2());
    let [u, v, w] = walk.rivals.stream.draw3();
    let frame = Frame::about(hit.shading_normal);
    let from = frame.to_local(sample.wi);
    let exit = Exit { hit: *hit, frame, wo: DVec3::ZERO };
    if !walk.leads_outside(&exit, sample.wi) {
        return;
    }
    let inward = match walk.boundary {
        Boundary::Rough { .. } => walk.boundary.sample_refraction(from, [u, v]),
        _ => walk.boundary.refract(from),
    };
    let Some(dir) = inward.map(|inward| frame.to_world(inward)) else { return };
    if dir.dot(hit.normal) >= 0.0 {
        return;
    }
    let Some(distances) = from_boundary(walk, x_i.point, hit, dir) else { return };
    let t = distances.sample(w);
    let down = Ray { origin: hit.point, dir };
    let x_j = down.at(t);
    let Some(middle) = Middle::new(x_i.point, x_j, hit.point, hit.normal) else { return };
    let exit = Exit { wo: frame.to_local(dir), ..exit };
    // The leg from x_k to x_j, unless the chord has measured it.
    if distances.t_max == f64::INFINITY {
        walk.scores.count(Cost::ShadowRays);
        if walk.scene.shape.intersect(&down, Side::Inside, Some(hit.face), t).is_some() {
            return;
        }
    }
    score(walk, x_i, guide, &middle, x_j, &exit, (sample.wi, Some(sample.radiance)));
}

fn bottom_to_top<B: Bands>(
    walk: &mut Walk<'_, Connections<'_>, B>,
    x_i: &mut Vertex,
    guide: &Guide,
    hit: &Hit,
) {
    if walk.scene.lights[guide.light].is_directional() {
        return; // refraction never finds the one direction
    }
    let [a, b, c] = walk.rivals.stream.draw3();
    let [u, v] = walk.rivals.stream.draw2();
    let to_k = (hit.point - x_i.point).normalize();
    let dir = walk.rivals.setup.joint.towards(x_i.arrival, to_k).sample([a, b]);
    let Some(distances) = from_vertex(walk, x_i.point, hit.point, dir) else { return };
    let s = distances.sample(c);
    let leg = Ray { origin: x_i.point, dir };
    let x_j = leg.at(s);
    let Some(middle) = Middle::new(x_i.point, x_j, hit.point, hit.normal) else { return };
    let Some(exit) = walk.exit_at(*hit, middle.to_k) else { return };
    let outward = match walk.boundary {
        Boundary::Rough { .. } => walk.boundary.sample_refraction(exit.wo, [u, v]),
        _ => walk.boundary.refract(exit.wo),
    };
    let Some(w_l) = outward.map(|outward| exit.frame.to_world(outward)) else { return };
    if !walk.leads_outside(&exit, w_l) {
        return;
    }
    if !walk.rivals.setup.options.truncated {
        walk.scores.count(Cost::ShadowRays);
        if walk.scene.shape.intersect(&leg, Side::Inside, None, s).is_some() {
            return;
        }
    }
    score(walk, x_i, guide, &middle, x_j, &exit, (w_l, None));
}

/// Scores a subdivided path; the leg along which x_j was drawn is known to be free.
fn score<B: Bands>(
    walk: &mut Walk<'_, Connections<'_>, B>,
    x_i: &mut Vertex,
    guide: &Guide,
    middle: &Middle,
    x_j: DVec3,
    exit: &Exit,
    (w_l, radiance): (DVec3, Option<f64>),
) {
    let keep = walk.rivals.takes_part(2);
    let end = End::new(walk, guide, exit, w_l, keep, radiance);
    if end.value == 0.0 || end.guide == 0.0 {
        return;
    }
    let media = &walk.scene.medium;
    let mut bands = walk.bands.clone();
    bands.turn(media, x_i.arrival.dot(middle.to_j));
    bands.flight(media, middle.d_ij, true);
    let mut x_j = Vertex::new(x_j, middle.to_j, bands.density());
    bands.turn(media, middle.to_j.dot(middle.to_k));
    bands.flight(media, middle.d_jk, false);
    let rivals = density(walk, x_i, guide, middle, exit, &end)
        + last_vertex::density(walk, &mut x_j, guide, (middle.to_k, middle.d_jk), w_l, &end);
    let survival = walk.bands.survival(&walk.medium);
    let value = walk.throughput * survival * end.value / (bands.density() * end.unidirectional + rivals);
    if value == 0.0 {
        return;
    }
    walk.scores.count(Cost::ShadowRays);
    let shadow = Ray { origin: exit.hit.point, dir: w_l };
    if walk.scene.shape.occluded(&shadow, Some(exit.hit.face)) {
        return;
    }
    // The leg that closes the path: to x_i from the top, to x_k from the bottom; the other one is free.
    if !walk.sees_point(x_i.point, x_j.point) || !walk.sees_point(x_j.point, exit.hit.point) {
        return;
    }
    let mut history = walk.history;
    history.scatter();
    walk.score_with(&bands, history.class(), guide.light, value);
}
