//! All points of one triangle with interpolated normals that refract the light of a query: a conic,
//! parametrised, and one polynomial on it.
//!
//! With P(u, v) = p - x and N(u, v), both linear, Snell's law reads
//!   P = k N + s w_L,    |P| = eta s,    s > 0,    sign k = sign(eta - 1),
//! since eta P / |P| = w_L + (k / s) N is what `throughput` states. The first equation alone is the
//! coplanarity N . (P x w_L) = 0, a conic in (u, v), which k parametrises: with a = e_0 - k m_0,
//! b = e_1 - k m_1, c = P_0 - k N_0, linear in k, it is u a + v b + c = s w_L, and by Cramer's rule
//!   D = (a x b) . w_L,   u D = (b x c) . w_L,   v D = (c x a) . w_L,   s D = (a x b) . c.
//! So u, v are quotients of quadratics, and the second equation becomes, with the quadratic
//! Q = D P = D P_0 + u D e_0 + v D e_1,
//!   |Q|^2 - eta^2 (s D)^2 = 0,
//! a polynomial of degree 6 in k: a triangle has at most 6 candidates. k is bounded: its size is
//!   k |N| = s |eta ct - cl|,   s = |P| / eta,   |eta ct - cl| = |eta^2 - 1| / (eta ct + cl),
//! and the last falls as cl grows. On that interval the roots are isolated in Bernstein form
//! (`polynomial`), so none is lost, and intervals whose u, v, 1 - u - v cannot all be positive are
//! dropped at once. A Newton step on the triangle removes the rounding error of the polynomial.
//!
//! Where the normals are an affine image of the points the conic is a line (`solve_line`).
//!
//! With one normal for the whole facet the root has a closed form: cl is known, hence ct, w and p.

use super::bounds::Bounds;
use super::patch::{Facet, SurfacePatch};
use super::polynomial::{self, BernsteinForm, parabola};
use super::throughput::{Judgement, Query, Root};
use crate::geometry::FaceId;
use crate::math::DVec3;

/// Residual of Snell's law (sines) that counts as 0.
pub(super) const TOLERANCE: f64 = 1e-9;

/// How often a triangle is cut in four where its interpolated normals may vanish.
const CUTS: u32 = 6;

/// Part of the size of what is summed up that bounds the rounding of the polynomial.
const ROUNDING: f64 = 1e-14;

/// How often a part on which the conic degenerates is cut in four: at least, and at most.
const LEAST_CUTS: u32 = 5;
const PARTS: u32 = 30;

/// Barycentric coordinates at which a Newton iteration has gone astray.
const FAR: f64 = 10.0;

/// Part of a normal's length by which normals may differ from an affine image of the points: rounding.
const AFFINE: f64 = 1e-12;

/// Sine up to which two directions are too close to span a plane.
const NEAR_AXIS: f64 = 1e-6;

/// Barycentric coordinate beyond an edge up to which candidates are looked for.
const MARGIN: f64 = 1e-6;

/// Height below a facet, in parts of its shorter edge, up to which its conic may not tell the root from x.
const NEARLY_ON: f64 = 1e-4;

/// Sine of the angle between H and N below which a triangle is solved, whatever else: more than what counts as a root.
const CLOSE: f64 = 1e-7;

/// Newton steps from the middle of a part.
const ITERATIONS: u32 = 50;

/// What the search for roots has met.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::estimators) struct SolverWork {
    /// Nodes of a hierarchy that were looked at, and triangles that were ruled out without being solved.
    pub nodes: u64,
    /// Triangles, or starts of a walk, that were solved for roots.
    pub solves: u64,
    /// Newton steps.
    pub steps: u64,
    /// Closest-hit queries.
    pub rays: u64,
    /// Roots of the shading normal that the geometric one excludes.
    pub wrong_side: u64,
}

/// The point of a plane through `point` with this outward normal that refracts the light to x: closed.
pub(super) fn plane_root(query: &Query, point: DVec3, normal: DVec3) -> Option<DVec3> {
    shaded_plane_root(query, point, normal, normal)
}

/// That of a plane with one shading normal throughout.
fn shaded_plane_root(query: &Query, point: DVec3, normal: DVec3, shading: DVec3) -> Option<DVec3> {
    let facet = query.facet_normal(shading);
    let height = (point - query.x).dot(normal);
    let cl = query.w_l.dot(facet);
    let eta_ct2 = (query.eta * query.eta - 1.0) + cl * cl;
    if height <= 0.0 || cl <= 0.0 || eta_ct2 <= 0.0 {
        return None;
    }
    let eta_w = query.w_l + facet * (eta_ct2.sqrt() - cl);
    let along = eta_w.dot(normal);
    (along > 0.0).then(|| query.x + eta_w * (height / along))
}

/// Offers every root on the facet to `found`.
pub(super) fn roots(query: &Query, facet: &Facet, work: &mut SolverWork, found: &mut impl FnMut(Root)) {
    let Some((n, m)) = facet.shading else {
        work.solves += 1;
        if let Some(point) = plane_root(query, facet.corner, facet.normal) {
            let place = facet.place(point);
            let patch = SurfacePatch::plane(point, FaceId(facet.index), facet.normal);
            if facet.owns(place)
                && let Judgement::Root(root) = query.judge(&patch, TOLERANCE)
            {
                found(root);
            }
        }
        return;
    };
    let whole = Linear { p: facet.corner - query.x, e: facet.edges, n, m };
    if whole.has_no_root(query) {
        work.nodes += 1;
        return;
    }
    work.solves += 1;
    let mut places = FacetRoots { query, facet, work, found, seen: Vec::new() };
    places.search(&whole, [0.0; 2], [[1.0, 0.0], [0.0, 1.0]], CUTS);
    places.search_above();
}

/// Positions, from x, and normals of a triangle or of a part of it.
#[derive(Clone, Copy)]
struct Linear {
    p: DVec3,
    e: [DVec3; 2],
    n: DVec3,
    m: [DVec3; 2],
}

impl Linear {
    /// Values at the corners.
    fn corners(base: DVec3, change: [DVec3; 2]) -> [DVec3; 3] {
        [base, base + change[0], base + change[1]]
    }

    /// Whether it is shown to hold no root, without solving for any.
    ///
    /// A root has H x N = 0 with H = eta w - w_L and w = P / |P|. Over the triangle, with barycentric coordinates l_i, N is
    /// sum l_i N_i, and w is sum l_i w_i to within M R^2 / 2: R is the radius of a circle about the triangle, and M bounds the
    /// second derivative of w, which along a unit vector of sine s to w is s sqrt(4 - 3 s^2) / |P|^2 <= 2 / (sqrt 3 |P|^2). So
    ///   H x N = sum_ij l_i l_j H_i x N_j, to within eta M R^2 / 2 max |N_i|,
    /// is a convex combination of the six H_i x N_i and (H_i x N_j + H_j x N_i) / 2. Where these lie beyond that bound in one
    /// direction, it does not vanish. Directions that are tried: that of their sum, and, since all six lie near a plane across N
    /// and the mixed ones near the middles of the edges of H_i x N_i, across these edges.
    fn has_no_root(&self, query: &Query) -> bool {
        let corners = Linear::corners(self.p, self.e);
        let normals = Linear::corners(self.n, self.m);
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius2 = corners.iter().map(|p| p.distance_squared(middle)).fold(0.0, f64::max);
        let nearest = middle.length() - radius2.sqrt();
        // Also where x is on the facet.
        if nearest <= 0.0 {
            return false;
        }
        let h = corners.map(|p| p * (query.eta / p.length()) - query.w_l);
        let longest = |of: &[DVec3; 3]| of.iter().map(|v| v.length_squared()).fold(0.0, f64::max).sqrt();
        let bent = query.eta * radius2 / (3f64.sqrt() * nearest * nearest);
        let bound = longest(&normals) * (bent + CLOSE * longest(&h));
        let mixed = |i: usize, j: usize| (h[i].cross(normals[j]) + h[j].cross(normals[i])) * 0.5;
        let products = [mixed(0, 0), mixed(1, 1), mixed(2, 2), mixed(0, 1), mixed(1, 2), mixed(2, 0)];
        let is_beyond = |direction: DVec3| {
            let least = products.iter().map(|p| p.dot(direction)).fold(f64::INFINITY, f64::min);
            least > bound * direction.length()
        };
        let across = |i: usize, j: usize, third: usize| {
            let normal = (normals[0] + normals[1] + normals[2]).cross(products[j] - products[i]);
            if normal.dot(products[third] - products[i]) < 0.0 { -normal } else { normal }
        };
        is_beyond(products.into_iter().sum())
            || [(0, 1, 2), (1, 2, 0), (2, 0, 1)].into_iter().any(|(i, j, k)| {
                // The third corner lies on one side; the origin has to on the other.
                is_beyond(across(i, j, k))
            })
    }

    /// The part with the corner `at` and these sides, in this one's coordinates.
    fn part(&self, at: [f64; 2], sides: [[f64; 2]; 2]) -> Linear {
        let map = |change: [DVec3; 2], [u, v]: [f64; 2]| change[0] * u + change[1] * v;
        Linear {
            p: self.p + map(self.e, at),
            e: sides.map(|side| map(self.e, side)),
            n: self.n + map(self.m, at),
            m: sides.map(|side| map(self.m, side)),
        }
    }
}

/// Roots of one facet, as they are found.
struct FacetRoots<'a, F> {
    query: &'a Query,
    facet: &'a Facet,
    work: &'a mut SolverWork,
    found: &'a mut F,
    /// FacetRoots of the roots found so far: rounding may offer a double root twice.
    seen: Vec<[f64; 2]>,
}

impl<F: FnMut(Root)> FacetRoots<'_, F> {
    /// Searches a part of the facet, whose corner and sides have the coordinates `at` and `sides`.
    fn search(&mut self, part: &Linear, at: [f64; 2], sides: [[f64; 2]; 2], cuts: u32) {
        if self.solve_line(part, at, sides) {
            return;
        }
        let Query { w_l, eta, .. } = *self.query;
        let normals = Linear::corners(part.n, part.m);
        let heights = normals.map(|n| n.dot(w_l));
        let highest = heights.into_iter().fold(f64::NEG_INFINITY, f64::max);
        if highest <= 0.0 {
            return;
        }
        // |N|^2 is at least the least product of two corners' normals.
        let mut least = f64::INFINITY;
        for i in 0..3 {
            for j in i..3 {
                least = least.min(normals[i].dot(normals[j]));
            }
        }
        let is_wide = least < 0.25 * normals[0].length_squared();
        if is_wide && cuts > 0 {
            let map = |[u, v]: [f64; 2]| [0, 1].map(|i| at[i] + sides[0][i] * u + sides[1][i] * v);
            for (corner, size) in
                [([0.0, 0.0], 0.5), ([0.5, 0.0], 0.5), ([0.0, 0.5], 0.5), ([0.5, 0.5], -0.5)]
            {
                let steps = [[size, 0.0], [0.0, size]];
                let finer = sides.map(|side| side.map(|s| s * size));
                self.search(&part.part(corner, steps), map(corner), finer, cuts - 1);
            }
            return;
        }
        // Below a cosine of 1e-3 between corners' normals the triangle has no normal to speak of.
        let shortest = least.max(1e-6).sqrt();
        let longest = normals.into_iter().map(DVec3::length).fold(0.0, f64::max);
        let lowest = heights.into_iter().fold(f64::INFINITY, f64::min).max(0.0);
        let deviation = |cl: f64| {
            let eta_ct = ((eta * eta - 1.0) + cl * cl).max(0.0).sqrt();
            (eta * eta - 1.0).abs() / (eta_ct + cl)
        };
        let corners = Linear::corners(part.p, part.e);
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = corners.into_iter().map(|c| c.distance(middle)).fold(0.0, f64::max);
        let distances = [(middle.length() - radius).max(0.0), middle.length() + radius];
        // For eta < 1 light from below the critical angle is refracted, and no other.
        let critical = (1.0 - eta * eta).max(0.0).sqrt();
        let cosines = [(highest / shortest).min(1.0), (lowest / longest).clamp(critical, 1.0)];
        const PAD: f64 = 1e-6;
        let k_least = distances[0] * deviation(cosines[0]) / (eta * longest) * (1.0 - PAD);
        let k_most = distances[1] * deviation(cosines[1]) / (eta * shortest) * (1.0 + PAD);
        let sign = (eta - 1.0).signum();
        self.solve(part, at, sides, [sign * k_least, sign * k_most]);
    }

    /// Roots with k in this interval.
    fn solve(&mut self, part: &Linear, at: [f64; 2], sides: [[f64; 2]; 2], k: [f64; 2]) {
        let Query { w_l, eta, .. } = *self.query;
        // Linear in k: values at the ends, which are the Bernstein coefficients.
        let [a, b, c] = [(part.e[0], part.m[0]), (part.e[1], part.m[1]), (part.p, part.n)]
            .map(|(e, m)| k.map(|k| e - m * k));
        let cross = |p: [DVec3; 2], q: [DVec3; 2]| {
            [p[0].cross(q[0]), (p[0].cross(q[1]) + p[1].cross(q[0])) * 0.5, p[1].cross(q[1])]
        };
        let area = cross(a, b);
        let u = cross(b, c).map(|n| n.dot(w_l));
        let v = cross(c, a).map(|n| n.dot(w_l));
        let d = area.map(|n| n.dot(w_l));
        let w: [f64; 3] = std::array::from_fn(|i| d[i] - u[i] - v[i]);
        let s = [
            area[0].dot(c[0]),
            (area[0].dot(c[1]) + 2.0 * area[1].dot(c[0])) / 3.0,
            (2.0 * area[1].dot(c[1]) + area[2].dot(c[0])) / 3.0,
            area[2].dot(c[1]),
        ];
        let conditions = [parabola(u), parabola(v), parabola(w), s];
        if polynomial::excludes(&conditions) {
            return;
        }
        let q: [DVec3; 3] = std::array::from_fn(|i| part.p * d[i] + part.e[0] * u[i] + part.e[1] * v[i]);
        // |Q|^2, of degree 4.
        let middle = (q[0].dot(q[2]) + 2.0 * q[1].length_squared()) / 3.0;
        let square =
            [q[0].length_squared(), q[0].dot(q[1]), middle, q[1].dot(q[2]), q[2].length_squared()];
        let mut f: BernsteinForm = [0.0; polynomial::DEGREE + 1];
        polynomial::add_product(&mut f, 1.0, &square, &[1.0]);
        polynomial::add_product(&mut f, -eta * eta, &s, &s);
        let size2 = |q: &[DVec3]| q.iter().map(|q| q.length_squared()).fold(0.0, f64::max);
        let most = s.iter().fold(0.0f64, |most, s| most.max(s.abs()));
        let noise = ROUNDING * (size2(&q) + eta * eta * most * most);
        let mut candidates = Vec::new();
        if polynomial::roots(&f, noise, &conditions, &mut |t| candidates.push(t)).is_err() {
            self.subdivide(at, sides, PARTS);
            return;
        }
        for t in candidates {
            let quadratic = |c: &[f64; 3]| {
                let r = 1.0 - t;
                c[0] * (r * r) + c[1] * (2.0 * r * t) + c[2] * (t * t)
            };
            let d = quadratic(&d);
            let place = [quadratic(&u) / d, quadratic(&v) / d];
            // Newton's step decides what lies near an edge.
            if place.iter().all(|c| c.is_finite() && c.abs() < 2.0) {
                let place = [0, 1].map(|i| at[i] + sides[0][i] * place[0] + sides[1][i] * place[1]);
                self.offer(place);
            }
        }
    }

    /// Roots on a part whose normals are an affine image of its points, N = N_0 + a P, as on the mesh of a
    /// sphere; false where they are not, or where x is close to the axis of symmetry. There
    ///   (1 - a k) P = k N_0 + s w_L:
    /// the conic is the line of the triangle in the plane of N_0 and w_L, and k = 1 / a a multiple root of
    /// the polynomial in k, which is no point. On the line P = mu N_0 + q w_L with mu and q linear, k = mu /
    /// (1 + a mu) and s = q / (1 + a mu), so that |P| = eta s becomes
    ///   |P|^2 (1 + a mu)^2 - eta^2 q^2 = 0,
    /// of degree 4 along the line.
    fn solve_line(&mut self, part: &Linear, at: [f64; 2], sides: [[f64; 2]; 2]) -> bool {
        let Query { w_l, eta, .. } = *self.query;
        let Linear { p, e, n, m } = *part;
        let a = (m[0].dot(e[0]) + m[1].dot(e[1])) / (e[0].length_squared() + e[1].length_squared());
        if (0..2).any(|i| (m[i] - e[i] * a).length() > AFFINE * n.length()) {
            return false;
        }
        let origin = n - p * a;
        let across = origin.cross(w_l);
        // across . P at the corner and its change along u and v; the line is where it is 0.
        let [height, by_u, by_v] = [p, e[0], e[1]].map(|v| v.dot(across));
        let steepness = (by_u * by_u + by_v * by_v).sqrt();
        let size = e[0].length().max(e[1].length());
        let is_on_axis = across.length() <= NEAR_AXIS * n.length();
        if is_on_axis || steepness <= NEAR_AXIS * across.length() * size {
            return false;
        }
        let beside = (height + (by_u + by_v) / 3.0) / (steepness * steepness);
        let middle = [1.0 / 3.0 - beside * by_u, 1.0 / 3.0 - beside * by_v];
        let Some(ends) = clipped(middle, [-by_v / steepness, by_u / steepness]) else { return true };
        let points = ends.map(|[u, v]| p + e[0] * u + e[1] * v);
        let square = |[x, y]: [f64; 2]| [x * x, x * y, y * y];
        let scale = across.length_squared();
        let stretch = square(points.map(|p| 1.0 + a * p.cross(w_l).dot(across) / scale));
        let light = square(points.map(|p| origin.cross(p).dot(across) / scale));
        let distance = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| points[i].dot(points[j]));
        let mut f: BernsteinForm = [0.0; polynomial::DEGREE + 1];
        polynomial::add_product(&mut f, 1.0, &distance, &stretch);
        polynomial::add_product(&mut f, -eta * eta, &light, &[1.0]);
        let most = |c: [f64; 3]| c[0].max(c[2]);
        let noise = ROUNDING * (most(distance) * most(stretch) + eta * eta * most(light));
        let mut candidates = Vec::new();
        if polynomial::roots(&f, noise, &[], &mut |t| candidates.push(t)).is_err() {
            return false;
        }
        for t in candidates {
            let [u, v] = [0, 1].map(|i| ends[0][i] + (ends[1][i] - ends[0][i]) * t);
            self.offer([0, 1].map(|i| at[i] + sides[0][i] * u + sides[1][i] * v));
        }
        true
    }

    /// Searches a part on which the conic degenerates (points near an axis of symmetry of the normals)
    /// by its bounds: it is cut in four until it is small, and beside its distance, too; then a Newton
    /// iteration starts.
    fn subdivide(&mut self, at: [f64; 2], sides: [[f64; 2]; 2], cuts: u32) {
        let [p, q] = sides.map(|side| [at[0] + side[0], at[1] + side[1]]);
        let corners = [at, p, q];
        let normals = corners.map(|corner| self.facet.patch(corner).shading);
        let bounds = Bounds::new(corners.map(|c| self.facet.at(c)).into_iter(), normals.into_iter());
        if !bounds.may_hold(self.query) {
            return;
        }
        let is_near = bounds.radius > 0.25 * bounds.center.distance(self.query.x);
        if cuts > 0 && (is_near || cuts > PARTS - LEAST_CUTS) {
            let half = sides.map(|side| side.map(|s| 0.5 * s));
            let along = |i: usize| [at[0] + half[i][0], at[1] + half[i][1]];
            let opposite = [along(0)[0] + half[1][0], along(0)[1] + half[1][1]];
            let turned = half.map(|side| side.map(|s| -s));
            for (corner, sides) in [(at, half), (along(0), half), (along(1), half), (opposite, turned)] {
                self.subdivide(corner, sides, cuts - 1);
            }
            return;
        }
        let mut place = [0, 1].map(|i| at[i] + (sides[0][i] + sides[1][i]) / 3.0);
        for _ in 0..ITERATIONS {
            self.work.steps += 1;
            let patch = self.facet.patch(place);
            let Some(step) = self.query.step(&patch, &self.query.constraint(&patch)) else { return };
            let next = self.facet.place(patch.point + step);
            let moved = (0..2).map(|i| (next[i] - place[i]).abs()).fold(0.0, f64::max);
            place = next;
            if moved < 1e-10 {
                break;
            }
            if !place.iter().all(|c| c.abs() < FAR) {
                return;
            }
        }
        self.offer(place);
    }

    /// Just below the facet one root is close to x, and the conic does not resolve it. There the facet is
    /// a plane with the shading normal above x, whose root starts Newton's steps.
    fn search_above(&mut self) {
        let Query { x, .. } = *self.query;
        let Facet { corner, edges, normal, .. } = *self.facet;
        let height = (corner - x).dot(normal);
        if !(height > 0.0 && height < NEARLY_ON * edges[0].length().min(edges[1].length())) {
            return;
        }
        let shading = self.facet.patch(self.facet.place(x)).shading;
        if let Some(point) = shaded_plane_root(self.query, corner, normal, shading) {
            self.offer(self.facet.place(point));
        }
    }

    /// Offers a place where a root is to rounding.
    fn offer(&mut self, place: [f64; 2]) {
        let place = polish(self.query, self.facet, place);
        let is_seen = |other: &[f64; 2]| (0..2).all(|i| (place[i] - other[i]).abs() < 1e-10);
        if !self.facet.owns(place) || self.seen.iter().any(is_seen) {
            return;
        }
        match self.query.judge(&self.facet.patch(place), TOLERANCE) {
            Judgement::Root(root) => {
                self.seen.push(place);
                (self.found)(root);
            }
            Judgement::WrongSide => {
                self.seen.push(place);
                self.work.wrong_side += 1;
            }
            Judgement::None => {}
        }
    }
}

/// Ends, in barycentric coordinates, of the part of a line in a triangle, [`MARGIN`] beyond its edges.
fn clipped(middle: [f64; 2], along: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let weights = [
        [middle[0], along[0]],
        [middle[1], along[1]],
        [1.0 - middle[0] - middle[1], -along[0] - along[1]],
    ];
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for [weight, slope] in weights {
        let end = -(weight + MARGIN) / slope;
        if slope > 0.0 {
            from = from.max(end);
        } else if slope < 0.0 {
            to = to.min(end);
        } else if weight < -MARGIN {
            return None;
        }
    }
    (from < to).then(|| [from, to].map(|t| [0, 1].map(|i| middle[i] + along[i] * t)))
}

/// Newton's steps from a place close to a root, as long as they are small and make the residual smaller.
pub(super) fn polish(query: &Query, facet: &Facet, place: [f64; 2]) -> [f64; 2] {
    const NEAR: f64 = 1e-3;
    let mut best = place;
    let mut patch = facet.patch(best);
    let mut at = query.constraint(&patch);
    for _ in 0..4 {
        let Some(step) = query.step(&patch, &at) else { return best };
        let next = facet.place(patch.point + step);
        if (0..2).any(|i| (next[i] - place[i]).abs() > NEAR) {
            return best;
        }
        let next_patch = facet.patch(next);
        let next_at = query.constraint(&next_patch);
        if next_at.residual.length() >= at.residual.length() {
            return best;
        }
        (best, patch, at) = (next, next_patch, next_at);
    }
    best
}
