//! Every point of the boundary that refracts the light of a query: the complete solver.
//!
//! Half-space, slab and box are planes, each with at most one root in closed form. On a mesh the
//! hierarchy of `cones` leaves a few triangles, which `facet` solves. On the sphere of radius R about
//! the origin everything lies in the plane of C = -x and w_L. With p - x = P = k' N + s w_L and N = P -
//! C (of length R), and 1 - k' = +-q,
//!   P = C + (s w_L - C) / (+-q),   q = |s w_L - C| / R,
//! the sign being that of s - c, c = w_L . C, since w_L . N > 0. |P| = eta s turns into
//!   +-q (R^2 + C^2 - eta^2 s^2) = 2 (C^2 - s c),
//! squared a polynomial of degree 6 in s, on the interval R - |C| <= eta s <= R + |C| of distances to
//! the sphere. Of its roots those count at which s - c and (R^2 + C^2 - eta^2 s^2) (C^2 - s c) have one sign: squaring has
//! added the others. For eta = 1 there is nothing to solve: the light comes straight.

use super::cones::ConeTree;
use super::facet::{self, SolverWork, TOLERANCE, plane_root};
use super::patch::SurfacePatch;
use super::polynomial::{self, BernsteinForm};
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
            (Shape::Sphere { radius }, _) => sphere(*radius, query, work, found),
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

/// Roots on a sphere, in units of its radius.
fn sphere(radius: f64, query: &Query, work: &mut SolverWork, found: &mut impl FnMut(Root)) {
    work.solves += 1;
    let Query { x, w_l, eta } = *query;
    let center = -x / radius;
    let (c2, c) = (center.length_squared(), center.dot(w_l));
    let distance = c2.sqrt();
    // Distances to the sphere; widened, for a point in the middle or on the surface.
    const PAD: f64 = 1e-9;
    let [low, high] = [(1.0 - distance - PAD) / eta, (1.0 + distance + PAD) / eta];
    let width = high - low;
    // In t, s = low + width t. Quadratics a + b s + e s^2 in Bernstein form.
    let quadratic = |a: f64, b: f64, e: f64| {
        let middle = a + 0.5 * b * (low + high) + e * low * high;
        [a + b * low + e * low * low, middle, a + b * high + e * high * high]
    };
    let q2 = quadratic(c2, -2.0 * c, 1.0);
    let k = quadratic(1.0 + c2, 0.0, -eta * eta);
    let line = [c2 - low * c, c2 - high * c];
    let mut square: [f64; 5] = [0.0; 5];
    for (i, p) in k.iter().enumerate() {
        for (j, q) in k.iter().enumerate() {
            let share = [[1.0, 0.5, 1.0 / 6.0], [0.5, 4.0 / 6.0, 0.5], [1.0 / 6.0, 0.5, 1.0]];
            square[i + j] += share[i][j] * p * q;
        }
    }
    let mut f: BernsteinForm = [0.0; polynomial::DEGREE + 1];
    polynomial::add_product(&mut f, 1.0, &q2, &square);
    polynomial::add_product(&mut f, -4.0, &line, &line);
    let conditions = [polynomial::line([low - c, high - c]), polynomial::cubic(line, k)];
    // Twice found are those at which an interval was cut.
    let mut seen = [DVec3::ZERO; 2 * polynomial::DEGREE];
    let mut count = 0;
    let mut candidate = |t: f64| {
        let s = low + width * t;
        let normal = ((w_l * s - center) * (s - c)).normalize_or_zero();
        if normal == DVec3::ZERO {
            return;
        }
        let patch = polish(query, SurfacePatch::sphere(radius, normal));
        if seen[..count].iter().any(|n| n.distance(patch.normal) < 1e-12) {
            return;
        }
        if let Some(place) = seen.get_mut(count) {
            *place = patch.normal;
            count += 1;
        }
        judged(query, &patch, work, found);
    };
    // Where it vanishes, on the axis, are the rings of light that come from all around it: no point is
    // on it.
    let noise = 1e-14 * f.iter().fold(0.0f64, |most, c| most.max(c.abs()));
    if polynomial::roots(&f, noise, &conditions, &mut candidate).is_err() {
        [0.0, 0.5, 1.0].into_iter().for_each(candidate);
    }
}

/// Newton's steps on a sphere from a point close to a root.
fn polish(query: &Query, patch: SurfacePatch) -> SurfacePatch {
    const NEAR: f64 = 1e-3;
    let radius = patch.point.length();
    let start = patch.normal;
    let mut best = patch;
    let mut at = query.constraint(&best);
    for _ in 0..4 {
        let Some(step) = query.step(&best, &at) else { return best };
        let next = SurfacePatch::sphere(radius, (best.point + step).normalize());
        let next_at = query.constraint(&next);
        if next.normal.distance(start) > NEAR || next_at.residual.length() >= at.residual.length() {
            return best;
        }
        (best, at) = (next, next_at);
    }
    best
}

#[cfg(test)]
#[path = "conic_tests.rs"]
mod tests;
