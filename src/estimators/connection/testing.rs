//! Shared by the tests of connections: bodies, points inside them, light traced from its source, and a
//! search for roots that shares nothing with the solvers except the constraint.

use super::facet::TOLERANCE;
use super::patch::Facet;
use super::throughput::{Judgement, Query, Root};
use crate::geometry::{Hit, Ray, Shape, Side, procedural};
use crate::math::DVec3;
use crate::sampling::stream::{Purpose, Stream, StreamKey};
use crate::sampling::warp::square_to_cap;

pub(super) fn stream(name: &str) -> Stream {
    StreamKey::named(name).pass(0).stream(0, Purpose::Sensor)
}

/// Meshes with flat and with interpolated normals, smooth and bumpy ones.
pub(super) fn meshes(subdivisions: u32) -> Vec<(&'static str, Shape)> {
    let meshes = [
        ("flat sphere", procedural::icosphere(1.0, subdivisions, false)),
        ("interpolated sphere", procedural::icosphere(1.0, subdivisions, true)),
        ("flat bumps", procedural::bumpy_sphere(1.0, subdivisions, 0.03, 6.0, false)),
        ("interpolated bumps", procedural::bumpy_sphere(1.0, subdivisions, 0.03, 6.0, true)),
        ("fine interpolated bumps", procedural::bumpy_sphere(1.0, subdivisions, 0.03, 12.0, true)),
        ("interpolated torus", procedural::torus(0.7, 0.3, [24, 12], true)),
    ];
    meshes.map(|(name, mesh)| (name, Shape::Mesh(mesh.expect(name)))).into()
}

pub(super) fn direction(stream: &mut Stream) -> DVec3 {
    square_to_cap(2.0, stream.draw2())
}

/// Light of direction `w_l` that meets the body: where it comes in, the direction inside towards there,
/// and the length that it runs.
pub(super) fn entering(shape: &Shape, w_l: DVec3, eta: f64, u: [f64; 2]) -> Option<(Hit, DVec3, f64)> {
    let beam = shape.bounds()?.beam(w_l, u);
    let hit = shape.intersect(&beam, Side::Outside, None, f64::INFINITY)?;
    let n = hit.shading_normal;
    let cl = w_l.dot(n);
    let eta_ct2 = eta * eta - 1.0 + cl * cl;
    if cl <= 0.0 || eta_ct2 <= 0.0 {
        return None;
    }
    let toward = (w_l + n * (eta_ct2.sqrt() - cl)) / eta;
    if toward.dot(hit.normal) <= 0.0 {
        return None;
    }
    let inside = Ray { origin: hit.point, dir: -toward };
    let length = shape.intersect(&inside, Side::Inside, Some(hit.face), f64::INFINITY)?.t;
    Some((hit, toward, length))
}

/// A point inside, uniform along a random chord.
pub(super) fn point_inside(shape: &Shape, stream: &mut Stream) -> Option<DVec3> {
    let w_l = direction(stream);
    let (hit, toward, length) = entering(shape, w_l, 1.0, stream.draw2())?;
    Some(hit.point - toward * (length * stream.draw()))
}

/// Every root on a facet, by subdivision: parts whose points and normals cannot obey Snell's law are
/// dropped, and from the middle of every part that is left after `depth` cuts, and that is small beside
/// its distance, a Newton iteration starts.
pub(super) fn exhaustive(query: &Query, facet: &Facet, depth: u32, found: &mut Vec<Root>) {
    let mut seen: Vec<[f64; 2]> = Vec::new();
    let mut open = vec![([0.0, 0.0], 1.0, 0)];
    while let Some((at, size, level)) = open.pop() {
        let corners = [at, [at[0] + size, at[1]], [at[0], at[1] + size]];
        let middle = [at[0] + size / 3.0, at[1] + size / 3.0];
        if !may_hold(query, facet, corners, middle) {
            continue;
        }
        let reach =
            corners.map(|c| facet.at(c).distance(facet.at(middle))).into_iter().fold(0.0, f64::max);
        let is_near = reach > 0.25 * facet.at(middle).distance(query.x);
        if level < depth || is_near && level < 40 {
            let half = 0.5 * size;
            let [u, v] = at;
            open.extend([
                (at, half, level + 1),
                ([u + half, v], half, level + 1),
                ([u, v + half], half, level + 1),
                ([u + half, v + half], -half, level + 1),
            ]);
            continue;
        }
        let Some(place) = newton(query, facet, middle) else { continue };
        let is_new = !seen.iter().any(|s| (0..2).all(|i| (s[i] - place[i]).abs() < 1e-9));
        if facet.owns(place)
            && is_new
            && let Judgement::Root(root) = query.judge(&facet.patch(place), TOLERANCE)
        {
            seen.push(place);
            found.push(root);
        }
    }
}

fn may_hold(query: &Query, facet: &Facet, corners: [[f64; 2]; 3], middle: [f64; 2]) -> bool {
    let patch = facet.patch(middle);
    let to = patch.point - query.x;
    let distance = to.length();
    let reach = corners.map(|c| facet.at(c).distance(patch.point)).into_iter().fold(0.0, f64::max);
    let turn =
        corners.map(|c| facet.patch(c).shading.dot(patch.shading)).into_iter().fold(1.0, f64::min);
    if reach >= distance || turn <= 0.0 {
        return true;
    }
    let h = (to * (query.eta / distance) - query.w_l) * (query.eta - 1.0).signum();
    let change = query.eta * 2.0 * (0.5 * (reach / distance).asin()).sin();
    if change >= h.length() {
        return true;
    }
    let angle = (h.dot(patch.shading) / h.length()).clamp(-1.0, 1.0).acos();
    angle <= turn.min(1.0).acos() + (change / h.length()).asin() + 1e-6
}

fn newton(query: &Query, facet: &Facet, start: [f64; 2]) -> Option<[f64; 2]> {
    let mut place = start;
    for _ in 0..50 {
        let patch = facet.patch(place);
        let at = query.constraint(&patch);
        let step = query.step(&patch, &at)?;
        let next = facet.place(patch.point + step);
        if next.iter().any(|c| c.abs() > 100.0) {
            return None;
        }
        let moved = (0..2).map(|i| (next[i] - place[i]).abs()).fold(0.0, f64::max);
        place = next;
        if moved < 1e-14 {
            break;
        }
    }
    Some(place)
}
