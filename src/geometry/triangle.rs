//! The watertight ray-triangle test, in f64.
//!
//! Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. The ray is made
//! the z axis by a shear, so that the test is whether the origin of the plane lies in the projected
//! triangle. Why no ray slips through between two triangles:
//! - a vertex is projected by the same operations for each of its triangles, so they agree on it to
//!   the bit: the projected surface is closed as the surface is;
//! - rounding is monotone, so `fl(px qy) - fl(py qx)` has the exact sign or is zero; a zero is
//!   computed again from the products' exact remainders, so the sign is exact throughout;
//! - a zero (the ray meets the very edge) counts as a hit on both sides of the edge.
//!
//! So for the projected surface the test is exact and closed, and the triangles whose signs agree
//! with the wanted orientation cover every face that the ray may leave through.
//!
//! Along the ray nothing is exact: a walk that starts on an edge starts from a rounded point, which may
//! lie beyond the neighbouring face, and the crossing by which it leaves would then lie behind it. So a
//! plane that the origin has passed by no more than the rounding of a point of the surface is crossed
//! at once. Where the origin was not beyond it, the ray is cut short by that rounding.

use super::{Ray, Side};
use crate::math::{DVec3, fma};

/// A triangle as the test reads it: x of the three corners, y, z.
#[derive(Clone, Debug)]
pub(super) struct PackedTriangle([[f64; 3]; 3]);

impl PackedTriangle {
    pub(super) fn new([a, b, c]: &[DVec3; 3]) -> PackedTriangle {
        PackedTriangle([[a.x, b.x, c.x], [a.y, b.y, c.y], [a.z, b.z, c.z]])
    }

    /// Its corners.
    #[inline]
    pub(super) fn corners(&self) -> [DVec3; 3] {
        let [x, y, z] = self.0;
        [DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]), DVec3::new(x[2], y[2], z[2])]
    }
}

/// A ray prepared for many triangles.
pub(super) struct Sheared {
    origin: DVec3,
    /// The axes that become x, y, z: z is the ray's dominant one; x and y are swapped where the ray
    /// runs against it, so that orientation is kept.
    axes: [usize; 3],
    /// The origin's coordinates along them.
    start: [f64; 3],
    shear: [f64; 2],
    /// `t` per unit of z.
    t_per_z: f64,
    /// +1 to see the triangles that are left (`dir . normal > 0`), -1 those that are entered.
    orientation: f64,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy)]
pub(super) struct Crossing {
    /// Distance, mm.
    pub t: f64,
    /// Barycentric coordinates, of sum 1.
    pub weights: [f64; 3],
}

impl Sheared {
    /// Prepares a ray that travels on `side`.
    pub(super) fn new(ray: &Ray, side: Side) -> Sheared {
        let size = ray.dir.abs();
        let z = match () {
            _ if size.x >= size.y && size.x >= size.z => 0,
            _ if size.y >= size.z => 1,
            _ => 2,
        };
        // Arrays: a component of a vector is chosen by branches, which cannot be foreseen.
        let (dir, origin) = (ray.dir.to_array(), ray.origin.to_array());
        let axes = AXES[z][usize::from(dir[z] < 0.0)];
        let t_per_z = 1.0 / dir[z];
        let shear = [dir[axes[0]] * t_per_z, dir[axes[1]] * t_per_z];
        let orientation = if side == Side::Inside { 1.0 } else { -1.0 };
        let start = [origin[axes[0]], origin[axes[1]], origin[axes[2]]];
        Sheared { origin: ray.origin, axes, start, shear, t_per_z, orientation }
    }

    /// The crossing with t > 0, if the orientation is the wanted one; at the smallest t > 0 where the
    /// origin lies beyond the triangle's plane by `slack` or less.
    #[inline(always)]
    pub(super) fn meet(&self, triangle: &PackedTriangle, slack: f64) -> Option<Crossing> {
        let Sheared { axes, start, shear, orientation, .. } = *self;
        let (along_x, along_y, along_z) =
            (triangle.0[axes[0]], triangle.0[axes[1]], triangle.0[axes[2]]);
        // Of the three corners.
        let (mut x, mut y, mut z) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for k in 0..3 {
            z[k] = along_z[k] - start[2];
            x[k] = (along_x[k] - start[0]) - shear[0] * z[k];
            y[k] = (along_y[k] - start[1]) - shear[1] * z[k];
        }
        // As `edge`, where it is not zero, of the edges opposite to the corners.
        let area = |p: usize, q: usize| (x[p] * y[q] - y[p] * x[q]) * orientation;
        let (mut u, mut v, mut w) = (area(1, 2), area(2, 0), area(0, 1));
        // One branch: which of the three is negative cannot be foreseen.
        let least = lesser(lesser(u, v), w);
        if least <= 0.0 {
            if least < 0.0 {
                return None;
            }
            [u, v, w] = edges(x, y).map(|area| area * orientation);
            if u < 0.0 || v < 0.0 || w < 0.0 {
                return None;
            }
        }
        let sum = u + v + w;
        if sum <= 0.0 {
            return None; // seen exactly edge on
        }
        let weights = [u / sum, v / sum, w / sum];
        let t = (weights[0] * z[0] + weights[1] * z[1] + weights[2] * z[2]) * self.t_per_z;
        if t > 0.0 {
            return Some(Crossing { t, weights });
        }
        let just_passed = self.has_just_passed(&triangle.corners(), slack);
        just_passed.then_some(Crossing { t: f64::MIN_POSITIVE, weights })
    }

    /// The origin lies beyond the plane of a triangle of the wanted orientation, by `slack` or less.
    #[cold]
    fn has_just_passed(&self, triangle: &[DVec3; 3], slack: f64) -> bool {
        let beyond = (self.origin - triangle[0]).dot(normal(triangle)) * self.orientation;
        beyond <= slack
    }
}

/// The axes that become x, y, z, by the one that becomes z, for rays along it and against it.
const AXES: [[[usize; 3]; 2]; 3] =
    [[[1, 2, 0], [2, 1, 0]], [[2, 0, 1], [0, 2, 1]], [[0, 1, 2], [1, 0, 2]]];

/// The lesser of two numbers, in one instruction.
#[inline(always)]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// [`edge`] of the edges opposite to the corners of a triangle.
#[cold]
fn edges(x: [f64; 3], y: [f64; 3]) -> [f64; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(p, q)| edge([x[p], y[p]], [x[q], y[q]]))
}

/// Twice the signed area of (0, p, q) in the plane: exact in sign, and `edge(q, p) == -edge(p, q)`
/// to the bit.
fn edge(p: [f64; 2], q: [f64; 2]) -> f64 {
    let (first, second) = (p[0] * q[1], p[1] * q[0]);
    match first - second {
        0.0 => edge_remainder(p, q, first, second),
        area => area,
    }
}

/// The difference of two products that round to the same number, from their exact remainders.
fn edge_remainder(p: [f64; 2], q: [f64; 2], first: f64, second: f64) -> f64 {
    fma(p[0], q[1], -first) - fma(p[1], q[0], -second)
}

/// The unit normal of a triangle whose corners turn counter-clockwise seen from its tip.
pub(super) fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize()
}

/// The unit normal of a triangle that is not so narrow that rounding could turn it. Of a triangle of height h whose corners are
/// known, or are seen by a ray, to `slack`, normals and the orientations that rays see are those of planes that are turned by a
/// few times slack / h: at most 1e-4 here, some 3e-4 in all.
#[derive(Clone, Copy, Debug)]
pub(super) struct PreciseNormal(pub DVec3);

impl PreciseNormal {
    /// None if the triangle is too narrow.
    pub(super) fn of(triangle: &[DVec3; 3], slack: f64) -> Option<PreciseNormal> {
        let [a, b, c] = *triangle;
        let (ab, ac) = (b - a, c - a);
        let longest2 = ab.length_squared().max(ac.length_squared()).max(b.distance_squared(c));
        let area = ab.cross(ac);
        // Height is area over the longest edge.
        let is_wide = slack * slack * longest2 < 1e-8 * area.length_squared();
        is_wide.then(|| PreciseNormal(area.normalize()))
    }
}

/// Whether a point of a triangle's plane is within `margin` of one of its edges (or of their lines).
#[inline]
pub(super) fn is_on_edge([a, b, c]: &[DVec3; 3], point: DVec3, margin: f64) -> bool {
    let near = |p: DVec3, q: DVec3| {
        let edge = q - p;
        edge.cross(point - p).length_squared() <= margin * margin * edge.length_squared()
    };
    near(*a, *b) || near(*b, *c) || near(*c, *a)
}

/// Barycentric coordinates of the point of a triangle that is nearest to `point`: of its plane where
/// that is inside, else of the nearest edge.
pub(super) fn nearest(corners: &[DVec3; 3], point: DVec3) -> [f64; 3] {
    let [a, b, c] = *corners;
    let n = (b - a).cross(c - a);
    let part = |p: DVec3, q: DVec3| (q - p).cross(point - p).dot(n) / n.length_squared();
    let weights = [part(b, c), part(c, a), part(a, b)];
    if weights.iter().all(|w| *w >= 0.0) {
        let sum = weights[0] + weights[1] + weights[2];
        return weights.map(|w| w / sum);
    }
    let on_edge = |i: usize| {
        let (p, q) = (corners[i], corners[(i + 1) % 3]);
        let s = ((point - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
        let mut weights = [0.0; 3];
        (weights[i], weights[(i + 1) % 3]) = (1.0 - s, s);
        ((p + (q - p) * s).distance_squared(point), weights)
    };
    let [x, y, z] = [on_edge(0), on_edge(1), on_edge(2)];
    let nearer = |p: (f64, [f64; 3]), q: (f64, [f64; 3])| if q.0 < p.0 { q } else { p };
    nearer(nearer(x, y), z).1
}

/// The squared distance of a point to a triangle. The distance is known to a few 1e-8 of the triangle's size: a projection
/// onto the plane is as exact as the triangle is wide, and where it is narrow an edge is as near. The point that [`nearest`] finds
/// can be farther away where a triangle is narrow.
pub(super) fn distance2(corners: &[DVec3; 3], point: DVec3) -> f64 {
    let [a, b, c] = *corners;
    let n = (b - a).cross(c - a);
    let (mut nearest, mut is_inside) = (f64::INFINITY, true);
    for (p, q) in [(a, b), (b, c), (c, a)] {
        let (edge, to) = (q - p, point - p);
        let s = (to.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        nearest = nearest.min(to.distance_squared(edge * s));
        is_inside &= edge.cross(to).dot(n) >= 0.0;
    }
    let height = (point - a).dot(n);
    if is_inside { nearest.min(height * height / n.length_squared()) } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, direction};
    use super::*;

    #[test]
    fn edge_is_antisymmetric_and_exact_in_sign() {
        let mut u = Uniform::named("edge_is_antisymmetric_and_exact_in_sign");
        for _ in 0..100_000 {
            let p = [u.next() - 0.5, u.next() - 0.5];
            // q on the line through 0 and p up to one rounding: the products agree to a last digit.
            let s = u.next() + 0.5;
            let q = [p[0] * s, p[1] * s];
            assert_eq!(edge(p, q).to_bits(), (-edge(q, p)).to_bits());
            // p times a power of two lies exactly on the line.
            assert_eq!(edge(p, [p[0] * 0.25, p[1] * 0.25]), 0.0);
            let above = [p[0] * 0.25, (p[1] * 0.25).next_up()];
            assert_eq!(edge(p, above) > 0.0, p[0] > 0.0);
        }
    }

    #[test]
    fn orientation_is_that_of_the_normal() {
        let mut u = Uniform::named("orientation_is_that_of_the_normal");
        for _ in 0..100_000 {
            let triangle = [(); 3].map(|()| direction(&mut u));
            let [a, b, c] = triangle;
            let target = a * 0.2 + b * 0.3 + c * 0.5;
            let origin = direction(&mut u) * 3.0;
            let to = target - origin;
            let ray = Ray { origin, dir: to.normalize() };
            let cosine = ray.dir.dot(normal(&triangle));
            if cosine.abs() < 1e-6 {
                continue;
            }
            let side = if cosine > 0.0 { Side::Inside } else { Side::Outside };
            let other = if cosine > 0.0 { Side::Outside } else { Side::Inside };
            let packed = PackedTriangle::new(&triangle);
            let crossing = Sheared::new(&ray, side).meet(&packed, 0.0).expect("aimed at it");
            assert!((crossing.t - to.length()).abs() < 1e-8, "{} {}", crossing.t, to.length());
            assert!(Sheared::new(&ray, other).meet(&packed, 0.0).is_none());
            let away = Ray { origin, dir: -ray.dir };
            assert!(Sheared::new(&away, side).meet(&packed, 0.0).is_none());
            assert!(Sheared::new(&away, other).meet(&packed, 0.0).is_none());
        }
    }

    /// Corners, origins and directions on a lattice: every product is exact, and many rays meet an edge or a corner.
    #[test]
    fn lattice_rays_meet_what_integers_tell() {
        let mut u = Uniform::named("lattice_rays_meet_what_integers_tell");
        let (mut met, mut at_edges) = (0, 0);
        for i in 0..200_000 {
            let mut number = |n: i64| (u.next() * (2 * n + 1) as f64) as i64 - n;
            let corners = [(); 3].map(|()| [number(3), number(3), number(2)]);
            // Seen along an axis, forwards or backwards.
            let (z, sign) = (i % 3, if i % 2 == 0 { 1 } else { -1 });
            let (x, y) = ((z + 1) % 3, (z + 2) % 3);
            let mut start = [number(3), number(3), number(3)];
            start[z] = -5 * sign;
            let edge = |p: usize, q: usize| {
                let [p, q] = [p, q].map(|k| [corners[k][x] - start[x], corners[k][y] - start[y]]);
                sign * (p[0] * q[1] - p[1] * q[0])
            };
            let areas = [edge(1, 2), edge(2, 0), edge(0, 1)];
            let vector = |v: [i64; 3]| DVec3::from_array(v.map(|x| x as f64));
            let mut dir = [0; 3];
            dir[z] = sign;
            let ray = Ray { origin: vector(start), dir: vector(dir) };
            for (side, orientation) in [(Side::Inside, 1), (Side::Outside, -1)] {
                let areas = areas.map(|area| orientation * area);
                let sum: i64 = areas.iter().sum();
                let triangle = PackedTriangle::new(&corners.map(vector));
                let crossing = Sheared::new(&ray, side).meet(&triangle, 0.0);
                if areas.iter().any(|area| *area < 0) || sum == 0 {
                    assert!(crossing.is_none(), "{corners:?} {ray:?}");
                    continue;
                }
                let crossing = crossing.expect("the ray starts before the triangle");
                let weighted: i64 = (0..3).map(|k| areas[k] * (corners[k][z] - start[z]) * sign).sum();
                assert!((crossing.t - weighted as f64 / sum as f64).abs() < 1e-14 * crossing.t);
                for (weight, area) in crossing.weights.into_iter().zip(areas) {
                    assert_eq!(weight, area as f64 / sum as f64, "{corners:?} {ray:?}");
                }
                met += 1;
                at_edges += usize::from(areas.contains(&0));
            }
        }
        assert!(met > 20_000 && at_edges > 5_000, "{met} {at_edges}");
    }

    /// Corners that are off by `slack` turn a normal that counts as precise by less than 3e-4.
    #[test]
    fn precise_normals_withstand_rounding() {
        let mut u = Uniform::named("precise_normals_withstand_rounding");
        let slack = 1e-9;
        let (mut precise, mut narrow, mut most) = (0, 0, 0.0f64);
        for i in 0..100_000 {
            let mut corners = [(); 3].map(|()| direction(&mut u));
            // Slivers down to a width of 1e-8, which takes the slack for wide.
            let width = crate::math::pow(10.0, -8.0 * u.next());
            corners[2] =
                corners[0] + (corners[1] - corners[0]) * u.next() + (corners[2] - corners[0]) * width;
            corners.rotate_left(i % 3);
            let Some(PreciseNormal(normal)) = PreciseNormal::of(&corners, slack) else {
                narrow += 1;
                continue;
            };
            precise += 1;
            let moved = corners.map(|corner| corner + direction(&mut u) * slack);
            most = most.max(super::normal(&moved).distance(normal));
        }
        assert!(precise > 10_000 && narrow > 10_000, "{precise} {narrow}");
        assert!((3e-5..3e-4).contains(&most), "{most}");
    }

    #[test]
    fn distance_is_that_of_the_nearest_point() {
        let mut u = Uniform::named("distance_is_that_of_the_nearest_point");
        for i in 0..100_000 {
            let mut corners = [(); 3].map(|()| direction(&mut u));
            // Every other one a sliver, down to a width of 1e-10.
            let width = if i % 2 == 0 { 1.0 } else { crate::math::pow(10.0, f64::from(-(i / 2 % 11))) };
            corners[2] =
                corners[0] + (corners[1] - corners[0]) * u.next() + (corners[2] - corners[0]) * width;
            let point = direction(&mut u) * (2.0 * u.next());
            let found = distance2(&corners, point).sqrt();
            let at = |[a, b, c]: [f64; 3]| corners[0] * a + corners[1] * b + corners[2] * c;
            let expected = at(nearest(&corners, point)).distance(point);
            if i % 2 == 0 {
                assert!((found - expected).abs() < 1e-7, "{corners:?} {point}: {found} {expected}");
            }
            // No point of it is nearer.
            for _ in 0..10 {
                let (s, t) = (u.next(), u.next());
                let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                let sample = at([1.0 - s - t, s, t]).distance(point);
                assert!(sample > found - 1e-7, "{corners:?} {point}: {sample} {found}");
            }
        }
    }
}
