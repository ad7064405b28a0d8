//! Half-space, slab, box and sphere in exact f64: no epsilon, every hit put back onto its surface.
//!
//! The sphere is inlined by force, and each shape compares with the end of the ray itself: a hit that is returned and then
//! filtered is copied through memory, where the copy waits for what has just been stored.

use super::{FaceId, Hit, Ray, Side};
use crate::math::DVec3;

/// Where a query looks for a crossing, beside its ray: as [`super::Shape::intersect`] has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub side: Side,
    pub from: Option<FaceId>,
    pub t_max: f64,
}

/// How far inside a shape, in parts of its size, the end of a flight is that surely has met nothing
/// ([`super::Shape::is_clear`]).
const MARGIN: f64 = 1e-9;

/// Whether a flight of length `t` surely ends in the half-space z < 0. Without an end it leaves it at no point, and does not.
#[inline(always)]
pub(super) fn ends_in_half_space(origin: DVec3, end: DVec3, t: f64) -> bool {
    end.z < MARGIN * origin.z && t < f64::INFINITY
}

/// Whether a flight surely ends in the slab -thickness < z < 0.
#[inline(always)]
pub(super) fn ends_in_slab(thickness: f64, end: DVec3) -> bool {
    end.z < -MARGIN * thickness && end.z > -(1.0 - MARGIN) * thickness
}

/// Whether a flight surely ends in the box.
#[inline(always)]
pub(super) fn ends_in_cuboid(half: DVec3, end: DVec3) -> bool {
    end.abs().cmplt(half * (1.0 - MARGIN)).all()
}

/// Whether a flight surely ends in the sphere.
#[inline(always)]
pub(super) fn ends_in_sphere(radius: f64, end: DVec3) -> bool {
    end.length_squared() < radius * radius * (1.0 - MARGIN)
}

/// A crossing of an unshaded surface.
#[inline(always)]
fn hit(t: f64, point: DVec3, normal: DVec3, face: u32) -> Option<Hit> {
    Some(Hit { t, point, normal, shading_normal: normal, face: FaceId(face) })
}

/// A ray inside a convex shape must leave it. Where rounding has put its origin on or a last digit
/// beyond the surface, the crossing lies at `t <= 0`: it leaves at once.
#[inline(always)]
fn at_once_if_behind(t: f64) -> f64 {
    t.max(f64::MIN_POSITIVE)
}

/// Distance to the plane `coordinate = plane` along an axis; `d` is not zero.
fn to_plane(plane: f64, o: f64, d: f64) -> f64 {
    (plane - o) / d
}

/// Crossing of the half-space z < 0.
pub(super) fn half_space(ray: &Ray, range: Range) -> Option<Hit> {
    horizontal_plane(0.0, 1.0, 0, ray, range)
}

/// Crossing of the slab -thickness < z < 0: each side of it is left through one plane only, chosen
/// by the sign of `dir.z`.
pub(super) fn slab(thickness: f64, ray: &Ray, range: Range) -> Option<Hit> {
    let upwards = ray.dir.z > 0.0;
    match (range.side, upwards) {
        (Side::Inside, true) | (Side::Outside, false) => horizontal_plane(0.0, 1.0, 0, ray, range),
        _ => horizontal_plane(-thickness, -1.0, 1, ray, range),
    }
}

/// The plane z = `z` with the outward normal (0, 0, `up`).
fn horizontal_plane(z: f64, up: f64, face: u32, ray: &Ray, range: Range) -> Option<Hit> {
    let Range { side, from, t_max } = range;
    let outward = ray.dir.z * up;
    let t = match side {
        _ if from == Some(FaceId(face)) => return None,
        Side::Inside if outward > 0.0 => at_once_if_behind(to_plane(z, ray.origin.z, ray.dir.z)),
        Side::Outside if outward < 0.0 => to_plane(z, ray.origin.z, ray.dir.z),
        _ => return None,
    };
    let point = ray.at(t).with_z(z);
    if t > 0.0 && t <= t_max { hit(t, point, DVec3::new(0.0, 0.0, up), face) } else { None }
}

/// Crossing of the box |x| < half.x, |y| < half.y, |z| < half.z.
///
/// Per axis the ray is within the two planes for t in [near, far]; it is in the box for t in
/// [max near, min far]. Inside, the crossing is the smallest `far`; outside, the largest `near`.
pub(super) fn cuboid(half: DVec3, ray: &Ray, range: Range) -> Option<Hit> {
    let Range { side, from, t_max } = range;
    let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for axis in 0..3 {
        let (h, o, d) = (half[axis], ray.origin[axis], ray.dir[axis]);
        if d == 0.0 {
            if side == Side::Outside && o.abs() >= h {
                return None; // passes beside the box, or slides along its face
            }
            continue;
        }
        let (near, far) = (to_plane(-h.copysign(d), o, d), to_plane(h.copysign(d), o, d));
        let (minus, plus) = (2 * axis as u32, 2 * axis as u32 + 1);
        let (near_face, far_face) = if d > 0.0 { (minus, plus) } else { (plus, minus) };
        if near > enter.0 {
            enter = (near, near_face);
        }
        if far < leave.0 && !(side == Side::Inside && from == Some(FaceId(far_face))) {
            leave = (far, far_face);
        }
    }
    let (t, face) = match side {
        Side::Inside => (at_once_if_behind(leave.0), leave.1),
        Side::Outside if enter.0 > 0.0 && enter.0 <= leave.0 => enter,
        Side::Outside => return None,
    };
    if t == f64::INFINITY || t > t_max || from == Some(FaceId(face)) {
        return None;
    }
    let (axis, sign) = ((face / 2) as usize, if face % 2 == 1 { 1.0 } else { -1.0 });
    let mut point = ray.at(t).clamp(-half, half);
    point[axis] = sign * half[axis];
    let mut normal = DVec3::ZERO;
    normal[axis] = sign;
    hit(t, point, normal, face)
}

/// Crossing of the sphere |x| < radius.
///
/// |o + t d|^2 = r^2 with b = o.d and c = |o|^2 - r^2 has the roots -b -+ sqrt(b^2 - c). Three
/// rewrites keep every digit (Haines, Günther, Akenine-Möller, "Precision Improvements for
/// Ray/Sphere Intersection", Ray Tracing Gems 2019):
/// - b^2 - c = r^2 - |o - b d|^2 = (r - m)(r + m), m the ray's distance from the middle, does not
///   cancel for far origins;
/// - c = (|o| - r)(|o| + r) does not cancel near the surface;
/// - of the two roots the one whose terms add is computed, the other one is c divided by it.
///
/// From a point on the surface c = 0, and the roots are 0 (where the ray starts) and -2 b.
#[inline(always)]
pub(super) fn sphere(radius: f64, ray: &Ray, range: Range) -> Option<Hit> {
    let Range { side, from, t_max } = range;
    let b = ray.origin.dot(ray.dir);
    let t = match (side, from) {
        (Side::Inside, Some(_)) => at_once_if_behind(-2.0 * b),
        (Side::Outside, Some(_)) => return None,
        (side, None) => {
            let miss = (ray.origin - ray.dir * b).length();
            let root2 = (radius - miss) * (radius + miss);
            let distance = ray.origin.length();
            let c = (distance - radius) * (distance + radius);
            match side {
                Side::Inside => {
                    let root = root2.max(0.0).sqrt();
                    at_once_if_behind(if b > 0.0 { -c / (b + root) } else { root - b })
                }
                Side::Outside if b < 0.0 && root2 >= 0.0 => c / (root2.sqrt() - b),
                Side::Outside => return None,
            }
        }
    };
    if t <= 0.0 || t > t_max {
        return None;
    }
    let normal = ray.at(t).normalize();
    hit(t, normal * radius, normal, 0)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, direction, inward};
    use super::super::{Ray, Shape, Side};
    use super::*;

    /// However far.
    fn all(side: Side, from: Option<FaceId>) -> Range {
        Range { side, from, t_max: f64::INFINITY }
    }

    const RAYS: usize = 200_000;

    fn shapes() -> Vec<Shape> {
        vec![
            Shape::HalfSpace,
            Shape::Slab { thickness: 0.3 },
            Shape::Box { half: DVec3::new(1.0, 0.25, 3.0) },
            Shape::Sphere { radius: 0.7 },
        ]
    }

    /// Distance of a point to the surface's equation.
    fn residual(shape: &Shape, p: DVec3) -> f64 {
        match *shape {
            Shape::HalfSpace => p.z.abs(),
            Shape::Slab { thickness } => p.z.abs().min((p.z + thickness).abs()),
            Shape::Box { half } => (p.abs() - half).max_element().abs(),
            Shape::Sphere { radius } => (p.length() - radius).abs(),
            Shape::Mesh(_) => unreachable!("analytic shapes only"),
        }
    }

    #[test]
    fn inside_rays_always_leave_and_hits_lie_on_the_surface() {
        let mut u = Uniform::named("inside_rays_always_leave_and_hits_lie_on_the_surface");
        for shape in shapes() {
            let mut ray = Ray { origin: DVec3::new(0.01, 0.02, -0.1), dir: DVec3::Z };
            let mut from = None;
            for _ in 0..RAYS {
                let hit = shape.intersect(&ray, Side::Inside, from, f64::INFINITY);
                let Some(hit) = hit else {
                    assert!(matches!(shape, Shape::HalfSpace), "{shape:?} lost {ray:?}");
                    (ray, from) = (Ray { origin: DVec3::new(0.0, 0.0, -1.0), dir: DVec3::Z }, None);
                    continue;
                };
                assert!(hit.t > 0.0 && ray.dir.dot(hit.normal) > -1e-15, "{shape:?} {ray:?} {hit:?}");
                assert!(residual(&shape, hit.point) <= 4e-16, "{shape:?} {hit:?}");
                let miss = (hit.point - ray.at(hit.t)).length();
                assert!(miss <= 4e-16 * (1.0 + hit.t + ray.origin.length()), "{miss:e} {ray:?}");
                ray = Ray { origin: hit.point, dir: inward(hit.normal, &mut u) };
                from = Some(hit.face);
            }
        }
    }

    #[test]
    fn outside_rays_never_meet_the_face_they_start_on() {
        let mut u = Uniform::named("outside_rays_never_meet_the_face_they_start_on");
        for shape in shapes() {
            for _ in 0..RAYS {
                let origin = DVec3::new(0.0, 0.0, -0.1);
                let ray = Ray { origin, dir: direction(&mut u) };
                let hit = shape.leave(&ray);
                assert_eq!(hit, shape.intersect(&ray, Side::Inside, None, f64::INFINITY));
                let Some(hit) = hit else { continue };
                let away = Ray { origin: hit.point, dir: -inward(hit.normal, &mut u) };
                assert!(!shape.occluded(&away, Some(hit.face)), "{shape:?} {away:?}");
            }
        }
    }

    #[test]
    fn far_origins_hit_the_sphere_where_they_are_aimed() {
        let mut u = Uniform::named("far_origins_hit_the_sphere_where_they_are_aimed");
        let radius = 0.7;
        let shape = Shape::Sphere { radius };
        for _ in 0..RAYS {
            // A ray that passes the middle at distance q r, from 10^6 radii, in exact terms: its
            // hit lies r sqrt(1 - q^2) before the point nearest to the middle.
            let (dir, q) = (direction(&mut u), u.next());
            let across = dir.any_orthonormal_vector() * (q * radius);
            let ray = Ray { origin: across - dir * (1e6 * radius), dir };
            let hit = shape.intersect(&ray, Side::Outside, None, f64::INFINITY);
            let expected = across - dir * (radius * ((1.0 - q) * (1.0 + q)).sqrt());
            // The origin's own rounding, 1e6 2^-53 radii, over the cosine of incidence.
            let tolerance = 1e-9 / (1.0 - q).sqrt();
            match hit {
                Some(hit) => assert!((hit.point - expected).length() < tolerance, "{q} {hit:?}"),
                None => assert!(q > 1.0 - 1e-9, "lost at q = {q}"),
            }
        }
    }

    #[test]
    fn grazing_rays_near_the_sphere_keep_their_digits() {
        // 1e-12 below the pole and tangential: the chord's half-length is sqrt(2 r h - h^2).
        let (radius, depth) = (1.0, 1.0 - (1.0 - 1e-12f64));
        let ray = Ray { origin: DVec3::new(0.0, 0.0, radius - depth), dir: DVec3::X };
        let hit = sphere(radius, &ray, all(Side::Inside, None)).expect("inside");
        let expected = (depth * (2.0 * radius - depth)).sqrt();
        assert!((hit.t / expected - 1.0).abs() < 1e-15, "{} {expected}", hit.t);
        // Straight out from the same depth: t is the depth itself.
        let out = Ray { origin: ray.origin, dir: DVec3::Z };
        assert_eq!(sphere(radius, &out, all(Side::Inside, None)).expect("inside").t, depth);
        // Just beside it.
        let beside = Ray { origin: DVec3::new(-5.0, 0.0, radius * (1.0 + 1e-15)), dir: DVec3::X };
        assert!(sphere(radius, &beside, all(Side::Outside, None)).is_none());
    }

    #[test]
    fn other_root_from_the_surface_is_exact() {
        let ray = Ray { origin: DVec3::new(0.0, 0.0, 2.0), dir: DVec3::new(0.6, 0.0, -0.8) };
        let hit = sphere(2.0, &ray, all(Side::Inside, Some(FaceId(0)))).expect("inside");
        assert_eq!(hit.t, 3.2);
    }

    #[test]
    fn box_faces_are_numbered_as_documented() {
        let half = DVec3::new(1.0, 2.0, 3.0);
        for face in 0..6u32 {
            let mut dir = DVec3::ZERO;
            dir[face as usize / 2] = if face % 2 == 1 { 1.0 } else { -1.0 };
            let inside = cuboid(half, &Ray { origin: DVec3::ZERO, dir }, all(Side::Inside, None));
            let hit = inside.expect("leaves");
            assert_eq!((hit.face, hit.normal, hit.point), (FaceId(face), dir, dir * half));
            let back = Ray { origin: dir * 10.0, dir: -dir };
            let entry = cuboid(half, &back, all(Side::Outside, None)).expect("enters");
            assert_eq!((entry.face, entry.point), (FaceId(face), dir * half));
        }
        // Along a face's plane, and beside it.
        let slide = Ray { origin: DVec3::new(-5.0, 2.0, 0.0), dir: DVec3::X };
        assert!(cuboid(half, &slide, all(Side::Outside, None)).is_none());
    }

    #[test]
    fn planar_faces_are_never_met_from_themselves() {
        let mut u = Uniform::named("planar_faces_are_never_met_from_themselves");
        for shape in &shapes()[..3] {
            for _ in 0..RAYS / 10 {
                let origin = direction(&mut u) * 4.0;
                let ray = Ray { origin, dir: direction(&mut u) };
                let side = if shape.contains(origin) { Side::Inside } else { Side::Outside };
                if let Some(hit) = shape.intersect(&ray, side, None, f64::INFINITY) {
                    let again = shape.intersect(&ray, side, Some(hit.face), f64::INFINITY);
                    assert!(again.is_none_or(|a| a.face != hit.face), "{shape:?} {ray:?}");
                }
            }
        }
    }

    #[test]
    fn a_ray_from_the_very_edge_leaves_at_once() {
        let half = DVec3::ONE;
        let dir = DVec3::new(-0.6, 0.8, 0.0);
        let ray = Ray { origin: DVec3::new(1.0, 1.0, 0.0), dir };
        let hit = cuboid(half, &ray, all(Side::Inside, Some(FaceId(1)))).expect("leaves");
        assert_eq!((hit.face, hit.t), (FaceId(3), f64::MIN_POSITIVE));
    }

    /// A flight inside ends at the boundary exactly where the closest crossing says so, to the last digit
    /// of its length.
    #[test]
    fn the_end_of_a_flight_shows_what_it_meets() {
        let mut u = Uniform::named("the_end_of_a_flight_shows_what_it_meets");
        for shape in shapes() {
            let mut ray = Ray { origin: DVec3::new(0.01, 0.02, -0.1), dir: DVec3::Z };
            let mut from = None;
            for _ in 0..RAYS / 10 {
                let free = shape.intersect(&ray, Side::Inside, from, f64::INFINITY);
                let reach = free.map_or(1.0, |hit| hit.t);
                for exponent in 0..=52 {
                    let off = reach * 0.5f64.powi(exponent);
                    for t in [reach - off, reach, reach + off] {
                        let met = shape.intersect(&ray, Side::Inside, from, t);
                        assert_eq!(shape.end_of_flight(&ray, from, t), met, "{shape:?} {ray:?} {t}");
                    }
                }
                // On from a point of the flight, close to its end as often as not, or from the surface.
                let depth = 0.1f64.powf(15.0 * u.next());
                (ray, from) = match free {
                    Some(hit) if u.next() < 0.5 => {
                        (Ray { origin: hit.point, dir: inward(hit.normal, &mut u) }, Some(hit.face))
                    }
                    Some(hit) => {
                        (Ray { origin: ray.at(hit.t * (1.0 - depth)), dir: direction(&mut u) }, None)
                    }
                    None => (Ray { origin: DVec3::new(0.0, 0.0, -depth), dir: direction(&mut u) }, None),
                };
            }
        }
    }

    #[test]
    fn bounded_rays_see_only_what_they_reach() {
        let ray = Ray { origin: DVec3::new(0.0, 0.0, -0.25), dir: DVec3::Z };
        for shape in [Shape::HalfSpace, Shape::Slab { thickness: 1.0 }] {
            assert!(shape.intersect(&ray, Side::Inside, None, 0.25).is_some());
            assert!(shape.intersect(&ray, Side::Inside, None, 0.25f64.next_down()).is_none());
        }
    }
}
