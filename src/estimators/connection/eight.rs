//! [`Bounds`] of eight parts, tested all at once in single precision: the compiler vectorises the loop to the width that the
//! target features of the caller allow. What it rules out holds no root; it keeps a little more than `Bounds::may_hold`.
//!
//! Instead of angles it adds chords, which needs fewer roots: unit vectors at an angle a are 2 sin(a / 2) apart, and such
//! distances satisfy the triangle inequality. With D the distance of the centre, w its direction from x, and s = r / D < 1:
//!   directions to points of the part are at most t = 2 sin(asin(s) / 2) <= s (1 + 0.42 s^2) from w;
//!   normals are at most c from the axis, the chord of the cone's half angle;
//!   h = +-(eta w - w_L), which a root has along N, changes by eta t at most, its direction with q = eta t / |h| < 1 by
//!   q (1 + 0.42 q^2).
//! For a root at a point in the direction w' with the normal N
//!   N . w_L > 0,    so axis . w_L > -c;
//!   N . w' > 0,     so axis . w > -c - t;
//!   w' . w_L is at least min(eta, 1 / eta), so w . w_L is at least that less t;
//!   h' is along N,  so |h - |h| axis| <= |h| (c + q (1 + 0.42 q^2)).
//! Rounding: points are relative to the middle of the body, whose size times [`ROUNDING`] is added to r, and a multiple of
//! [`ROUNDING`] to what is compared. That is some ten units of the last place, of which the sums above need four.

use super::bounds::Bounds;
use super::throughput::Query;
use crate::math::DVec3;

/// Bounds the rounding of a sum of few terms of size 1.
const ROUNDING: f32 = 1e-6;

/// Bounds of up to eight parts.
#[derive(Clone, Debug)]
pub(super) struct EightBounds {
    center: [[f32; 8]; 3],
    radius: [f32; 8],
    axis: [[f32; 8]; 3],
    /// Chord of the cone's half angle.
    chord: [f32; 8],
    /// Eight.
    lanes: u32,
    /// A bit for every part.
    parts: u8,
}

/// Where coordinates are relative to, and how large they get.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyFrame {
    pub middle: DVec3,
    /// The farthest that a point of the body is from the middle.
    pub size: f64,
}

/// What the test needs of a query.
#[derive(Clone, Copy, Debug)]
pub(super) struct EightQuery {
    x: [f32; 3],
    w_l: [f32; 3],
    eta: f32,
    /// Cosine of the largest angle by which refraction turns light.
    turn: f32,
    /// The sign of eta - 1.
    sign: f32,
    /// Chord of the angle by which microfacets are tilted; 0 at a smooth boundary.
    tilt: f32,
    /// What rounding may add to h.
    slack: f32,
}

impl EightQuery {
    pub(super) fn new(query: &Query, frame: &BodyFrame) -> EightQuery {
        let Query { x, w_l, eta, slopes } = *query;
        let single = |v: DVec3| v.to_array().map(|c| c as f32);
        let tilt = 1.0 / (1.0 + slopes.length_squared()).sqrt();
        EightQuery {
            x: single(x - frame.middle),
            w_l: single(w_l),
            eta: eta as f32,
            turn: eta.min(1.0 / eta) as f32,
            sign: (eta - 1.0).signum() as f32,
            tilt: if tilt < 1.0 { chord(tilt) } else { 0.0 },
            slack: 2.0 * ROUNDING * (1.0 + eta as f32),
        }
    }
}

/// The chord of an angle, at least, from its cosine.
fn chord(cos: f64) -> f32 {
    (2.0 * (1.0 - cos).max(0.0)).sqrt() as f32 * (1.0 + ROUNDING) + ROUNDING
}

impl EightBounds {
    /// # Panics
    /// With more than eight parts.
    pub(super) fn new(parts: &[Bounds], frame: &BodyFrame) -> EightBounds {
        assert!(parts.len() <= 8, "eight lanes");
        let of = |part: &dyn Fn(&Bounds) -> f32| {
            let mut lanes = [0.0; 8];
            lanes.iter_mut().zip(parts).for_each(|(lane, bounds)| *lane = part(bounds));
            lanes
        };
        let added = frame.size as f32 * ROUNDING;
        EightBounds {
            center: [0, 1, 2].map(|axis| of(&|bounds| (bounds.center - frame.middle)[axis] as f32)),
            radius: of(&|bounds| bounds.radius as f32 * (1.0 + ROUNDING) + added),
            axis: [0, 1, 2].map(|axis| of(&|bounds| bounds.axis[axis] as f32)),
            chord: of(&|bounds| chord(bounds.cos)),
            lanes: 8,
            parts: ((1u32 << parts.len()) - 1) as u8,
        }
    }

    /// A bit for every part that may hold a root.
    #[inline(always)]
    pub(super) fn may_hold(&self, asked: &EightQuery) -> u8 {
        let EightBounds { center: [x, y, z], radius, axis: [u, v, w], chord, .. } = self;
        let mut holds = [0; 8];
        // A length that the compiler does not know: of eight it would make eight copies first.
        let lanes = self.lanes.min(8) as usize;
        for i in 0..lanes {
            let may = asked.may_hold([x[i], y[i], z[i]], radius[i], [u[i], v[i], w[i]], chord[i]);
            holds[i] = u32::from(may) << i;
        }
        holds.into_iter().fold(0, |all, bit| all | bit) as u8 & self.parts
    }
}

impl EightQuery {
    /// Whether a part with these bounds may hold a root. Without a branch: whatever is computed for a part that an earlier
    /// reason rules out is not looked at.
    #[inline(always)]
    fn may_hold(&self, center: [f32; 3], radius: f32, axis: [f32; 3], chord: f32) -> bool {
        let EightQuery { x, w_l, eta, turn, sign, tilt, slack } = *self;
        let chord = chord + tilt;
        let faces_away = dot(axis, w_l) < -chord - slack;

        let to = [center[0] - x[0], center[1] - x[1], center[2] - x[2]];
        let distance = dot(to, to).sqrt();
        let inverse = 1.0 / distance;
        let w = [to[0] * inverse, to[1] * inverse, to[2] * inverse];
        let s = radius * inverse;
        let t = s * (1.0 + 0.42 * (s * s));
        let is_turned = dot(w, w_l) < turn - t - slack;
        let is_behind = dot(axis, w) < -chord - t - slack;

        let h =
            [(w[0] * eta - w_l[0]) * sign, (w[1] * eta - w_l[1]) * sign, (w[2] * eta - w_l[2]) * sign];
        let length = dot(h, h).sqrt();
        let q = eta * t / length;
        let apart = length * (chord + q * (1.0 + 0.42 * (q * q))) + slack;
        let off = [h[0] - length * axis[0], h[1] - length * axis[1], h[2] - length * axis[2]];
        let is_beside = (q < 1.0) & (dot(off, off) > apart * apart);

        !faces_away & ((s >= 1.0) | !(is_turned | is_behind | is_beside))
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimators::connection::testing::{direction, stream};
    use crate::math::DVec2;
    use crate::sampling::stream::Stream;

    /// A part of three corners with normals of their own, about a point at the distance 1 from the middle.
    struct Part {
        points: [DVec3; 3],
        normals: [DVec3; 3],
    }

    impl Part {
        fn draw(middle: DVec3, size: f64, spread: f64, stream: &mut Stream) -> Part {
            let normal = direction(stream);
            let mut part = Part { points: [DVec3::ZERO; 3], normals: [DVec3::ZERO; 3] };
            for i in 0..3 {
                part.points[i] = middle + normal + direction(stream) * size;
                part.normals[i] = (normal + direction(stream) * spread).normalize();
            }
            part
        }

        fn bounds(&self) -> Bounds {
            Bounds::new(self.points.into_iter(), self.normals.into_iter())
        }

        /// A point and the normal there.
        fn at(&self, stream: &mut Stream) -> (DVec3, DVec3) {
            let weights = [0.0; 3].map(|_| stream.draw());
            let mix = |of: [DVec3; 3]| of[0] * weights[0] + of[1] * weights[1] + of[2] * weights[2];
            (mix(self.points) / weights.iter().sum::<f64>(), mix(self.normals).normalize())
        }
    }

    /// The direction to a light that a microfacet refracts to `w`, if there is one.
    fn light(w: DVec3, facet: DVec3, eta: f64) -> Option<DVec3> {
        let ct = w.dot(facet);
        let cl2 = 1.0 - eta * eta * (1.0 - ct * ct);
        (ct > 0.0 && cl2 > 0.0).then(|| w * eta - facet * (eta * ct - cl2.sqrt()))
    }

    /// No part with a root is ruled out: narrow and wide cones, far,
    /// near and around the point, both sides of refraction, smooth and tilted, near the origin and far from it.
    #[test]
    fn a_part_with_a_root_is_kept() {
        let mut stream = stream("a_part_with_a_root_is_kept");
        let mut roots = 0;
        for round in 0..60_000 {
            let size = [1e-4, 0.01, 0.1, 0.7][round % 4];
            let middle = [DVec3::ZERO, DVec3::new(1e4, -3e3, 70.0)][round / 2 % 2];
            let frame = BodyFrame { middle, size: 2.0 };
            let slopes = if round % 5 == 0 { DVec2::new(0.2, -0.1) } else { DVec2::ZERO };
            let eta = [1.4, 0.7, 1.001][round / 7 % 3];
            let x = middle + direction(&mut stream) * stream.draw();
            let spread = size * [0.1, 1.0, 3.0][round / 3 % 3];
            let parts: Vec<Part> =
                (0..1 + round % 8).map(|_| Part::draw(middle, size, spread, &mut stream)).collect();
            let bounds: Vec<Bounds> = parts.iter().map(Part::bounds).collect();
            let eight = EightBounds::new(&bounds, &frame);
            let keeps =
                |w_l: DVec3| eight.may_hold(&EightQuery::new(&Query { x, w_l, eta, slopes }, &frame));
            for (lane, part) in parts.iter().enumerate() {
                let (point, normal) = part.at(&mut stream);
                let across = normal.cross(direction(&mut stream)).normalize();
                let facet = (normal + across * slopes.length()).normalize();
                let Some(w_l) = light((point - x).normalize(), facet, eta) else { continue };
                // Normals of more than a hemisphere say nothing about those between.
                if bounds[lane].cos > 0.0 {
                    roots += 1;
                    assert_eq!(keeps(w_l) >> lane & 1, 1, "{round} {lane}");
                }
            }
            assert_eq!(
                u32::from(keeps(direction(&mut stream))) >> parts.len(),
                0,
                "no part beyond the last"
            );
        }
        assert!(roots > 200_000, "{roots}");
    }

    /// Chords add up to no less than angles, and for small ones to the same, but for their squares and for rounding: of small parts
    /// hardly more are kept than by angles in double precision, for light about that of a root.
    #[test]
    fn hardly_more_is_kept_than_by_angles() {
        const SIZE: f64 = 0.01;
        let mut stream = stream("hardly_more_is_kept_than_by_angles");
        let frame = BodyFrame { middle: DVec3::ZERO, size: 2.0 };
        let (mut held, mut kept) = (0, 0);
        for _ in 0..40_000 {
            let part = Part::draw(DVec3::ZERO, SIZE, SIZE, &mut stream);
            let bounds = part.bounds();
            let x = direction(&mut stream) * (0.5 * stream.draw());
            let (point, normal) = part.at(&mut stream);
            let Some(w_l) = light((point - x).normalize(), normal, 1.4) else { continue };
            let w_l = (w_l + direction(&mut stream) * (5.0 * SIZE * stream.draw())).normalize();
            let query = Query { x, w_l, eta: 1.4, slopes: DVec2::ZERO };
            let asked = EightQuery::new(&query, &frame);
            let is_kept = EightBounds::new(&[bounds], &frame).may_hold(&asked) == 1;
            let is_held = bounds.may_hold(&query);
            held += u32::from(is_held);
            kept += u32::from(is_kept);
            assert!(is_kept || !is_held, "{query:?}");
        }
        println!("{held} held by angles, {kept} kept");
        // Angles of some SIZE / 0.5 in all: their squares, and 1e-5 of rounding over SIZE.
        assert!(held > 3000 && f64::from(kept) < 1.005 * f64::from(held), "{held} {kept}");
    }
}
