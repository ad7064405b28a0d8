//! Every root on a sphere.
//!
//! All of it lies in the plane of x and w_L. In units of the radius, x = z w_L + y e with e across w_L
//! and y >= 0; rho = |x|. Light comes in at p = cos(a) w_L + sin(a) e, |a| < pi/2, is refracted to v =
//! sin(r) = sin(a) / eta, and runs against w = cos(b) w_L + sin(b) e, b = a - r. Its line passes the
//! middle at the distance v, and x at the distance
//!   F = y cos(b) - z sin(b) - v.
//! x is inside, and the line meets the ball from p on, so every zero of F is a root. With x = rho
//! (cos(phi), sin(phi)), 0 <= phi <= pi, F = rho sin(phi - b) - v vanishes where
//!   phi = P(v) = b + asin(v / rho)            ahead of the middle,  cos(phi - b) >= 0, or
//!   phi - pi = Q(v) = b - asin(v / rho)       beyond it,            cos(phi - b) < 0.
//! In v, P' = b' + 1 / sqrt(rho^2 - v^2) > 0, since b' = eta / cos(a) - 1 / cos(r) and rho <= 1. And
//!   Q' > 0 where  g = (cos(a) / eta) (1 / cos(r) + 1 / sqrt(rho^2 - v^2)) < 1;
//! for eta rho > 1, g falls from (1 + 1 / rho) / eta at v = 0 to 0 at grazing light, so that Q falls and
//! then rises. For eta rho <= 1, which holds for every eta < 1, g > 1 and Q falls.
//!
//! eta rho <= 1: P and Q meet at v = rho and together run through phi = 0 to pi once. One root, v >= 0.
//! eta rho > 1:
//!   v < 0    P < 0, so beyond the middle; where b rises above the rest of Q: one root or none, by the
//!            sign of F at grazing light.
//!   v > 0    from v = 0 to cos(phi - b) = 0 beyond the middle, where F > 0 at both ends and has one
//!            least value, where g = 1: two roots if it is negative. After that, ahead of the middle, F
//!            falls: a root if it ends below 0.
//! So there are three at most, each in an interval of its own. The unknown is t = tan(a / 2), for
//! eta < 1 t = tan(r / 2): F is smooth in it to the end, and needs no function but the square root.

use super::patch::SurfacePatch;
use super::throughput::{Query, Root, solid_angle_ratio};
use crate::math::{DVec3, bracketed_root};
use crate::optics::fresnel::fresnel;

/// Offers every root.
pub(super) fn roots(radius: f64, query: &Query, found: &mut impl FnMut(Root)) {
    let Query { x, w_l, eta, .. } = *query;
    let place = x / radius;
    let z = place.dot(w_l);
    // Twice across: e has no part along w_L, even where x is next to the axis.
    let across = w_l.cross(place).cross(w_l);
    let y = across.length();
    let meridian = Meridian { eta, y, z };
    let e = if y > 0.0 { across / y } else { DVec3::ZERO };
    let mut offer = |t: f64| {
        let Refraction { a, r, .. } = meridian.refraction(t);
        let [sin_b, cos_b] = turn(a, r);
        let normal = w_l * a[1] + e * a[0];
        let patch = SurfacePatch::sphere(radius, normal);
        let dir = w_l * cos_b + e * sin_b;
        let distance = (patch.point - x).dot(dir);
        // A point on the surface, to rounding.
        if distance <= 0.0 {
            return;
        }
        found(Root {
            point: patch.point,
            face: patch.face,
            normal,
            shading: normal,
            dir,
            distance,
            ratio: solid_angle_ratio(&patch, dir, distance, w_l, eta),
            transmittance: 1.0 - fresnel(a[1], eta).reflectance,
        });
    };
    if y > 0.0 {
        meridian.roots(&mut offer);
    } else {
        // On the axis. What comes from a ring about it has no focusing.
        offer(0.0);
    }
}

/// A point in the plane of its light.
#[derive(Clone, Copy, Debug)]
struct Meridian {
    eta: f64,
    y: f64,
    z: f64,
}

/// Light of one parameter: sine and cosine of the angles outside and inside, and their slopes.
#[derive(Clone, Copy, Debug)]
struct Refraction {
    a: [f64; 2],
    r: [f64; 2],
    da: f64,
    dr: f64,
}

/// Sine and cosine of b = a - r.
fn turn([sin_a, cos_a]: [f64; 2], [sin_r, cos_r]: [f64; 2]) -> [f64; 2] {
    [sin_a * cos_r - cos_a * sin_r, cos_a * cos_r + sin_a * sin_r]
}

impl Meridian {
    #[inline]
    fn refraction(&self, t: f64) -> Refraction {
        let scale = 1.0 / (1.0 + t * t);
        let free = [2.0 * t * scale, (1.0 - t * t) * scale];
        let ratio = if self.eta > 1.0 { 1.0 / self.eta } else { self.eta };
        let sine = ratio * free[0];
        let bound = [sine, (1.0 - sine * sine).sqrt()];
        let slope = 2.0 * scale;
        let bound_slope = slope * ratio * free[1] / bound[1];
        if self.eta > 1.0 {
            Refraction { a: free, r: bound, da: slope, dr: bound_slope }
        } else {
            Refraction { a: bound, r: free, da: bound_slope, dr: slope }
        }
    }

    /// F and its slope.
    #[inline]
    fn miss(&self, t: f64) -> (f64, f64) {
        let Refraction { a, r, da, dr } = self.refraction(t);
        let [sin_b, cos_b] = turn(a, r);
        let ahead = self.y * sin_b + self.z * cos_b;
        (self.y * cos_b - self.z * sin_b - r[0], -ahead * (da - dr) - r[1] * dr)
    }

    /// rho cos(phi - b) and its slope.
    fn ahead(&self, t: f64) -> (f64, f64) {
        let Refraction { a, r, da, dr } = self.refraction(t);
        let [sin_b, cos_b] = turn(a, r);
        (self.y * sin_b + self.z * cos_b, (self.y * cos_b - self.z * sin_b) * (da - dr))
    }

    /// g - 1 and its slope, for eta rho > 1.
    fn fall(&self, t: f64) -> (f64, f64) {
        let Refraction { a, r, da, dr } = self.refraction(t);
        let reach = 1.0 / (self.y * self.y + self.z * self.z - r[0] * r[0]).sqrt();
        let (scale, sum) = (1.0 / self.eta, 1.0 / r[1] + reach);
        let change = r[0] / (r[1] * r[1]) + r[0] * r[1] * reach * reach * reach;
        (scale * a[1] * sum - 1.0, scale * (a[1] * change * dr - a[0] * da * sum))
    }

    fn root(&self, [lo, hi]: [f64; 2], is_rising: bool) -> f64 {
        bracketed_root(|t| self.miss(t), [lo, hi], is_rising, 0.5 * (lo + hi))
    }

    /// The zero of F in [0, 1] where it is the only one; first guess for small angles.
    fn falling_root(&self) -> f64 {
        let flat =
            |slope: f64, ratio: f64| 0.5 * self.y / (ratio + self.z * (slope - ratio)).max(0.5 * self.y);
        let start = if self.eta > 1.0 { flat(1.0, 1.0 / self.eta) } else { flat(self.eta, 1.0) };
        bracketed_root(|t| self.miss(t), [0.0, 1.0], false, start)
    }

    /// Offers the parameters of all roots.
    fn roots(&self, offer: &mut impl FnMut(f64)) {
        let eta_rho = self.eta * (self.y * self.y + self.z * self.z).sqrt();
        if eta_rho <= 1.0 || self.eta < 1.0 {
            offer(self.falling_root());
            return;
        }
        if self.miss(-1.0).0 < 0.0 {
            offer(self.root([-1.0, 0.0], true));
        }
        let is_below = self.miss(1.0).0 < 0.0;
        let Some(least) = self.least() else {
            if is_below {
                offer(self.falling_root());
            }
            return;
        };
        offer(self.root([0.0, least], false));
        if !is_below {
            offer(self.root([least, 1.0], true));
        } else if self.ahead(1.0).0 > 0.0 {
            let middle = bracketed_root(|t| self.ahead(t), [least, 1.0], true, 0.5 * (least + 1.0));
            offer(self.root([least, middle], true));
            offer(self.root([middle, 1.0], false));
        }
    }

    /// Where F has its least value beyond the middle, if it is negative there.
    fn least(&self) -> Option<f64> {
        if self.z >= 0.0 || self.fall(0.0).0 <= 0.0 {
            return None;
        }
        let t = bracketed_root(|t| self.fall(t), [0.0, 1.0], false, 0.5);
        (self.ahead(t).0 < 0.0 && self.miss(t).0 < 0.0).then_some(t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimators::connection::testing::stream;

    /// Against changes of sign of F on a fine grid of angles, everywhere in the ball: the number of roots, and their
    /// place. Pairs closer than the grid are told by the least value of F between.
    #[test]
    fn every_zero_has_its_interval() {
        let mut stream = stream("every_zero_has_its_interval");
        let mut count = [0u32; 4];
        for eta in [0.3, 0.8, 0.999, 1.001, 1.2, 1.5, 2.4, 4.0] {
            for index in 0..400 {
                // Half of the points next to the axis, away from the light, where rays cross.
                let [u, v] = stream.draw2();
                let (rho, cosine) = match index % 2 {
                    0 => (crate::math::cbrt(u), 2.0 * v - 1.0),
                    _ => (0.4 + 0.6 * u, 0.1 * v * v * v * v - 1.0),
                };
                let meridian =
                    Meridian { eta, y: rho * (1.0 - cosine * cosine).sqrt(), z: rho * cosine };
                let mut got = Vec::new();
                meridian.roots(&mut |t| got.push(t));
                got.sort_by(f64::total_cmp);
                let expected = scanned(&meridian);
                count[got.len()] += 1;
                assert_eq!(got.len(), expected.len(), "{meridian:?} {got:?} {expected:?}");
                for (t, [lo, hi]) in got.iter().zip(&expected) {
                    assert!(
                        (*lo - 1e-12..=*hi + 1e-12).contains(t),
                        "{meridian:?} {got:?} {expected:?}"
                    );
                }
            }
        }
        println!("roots: none {}, one {}, two {}, three {}", count[0], count[1], count[2], count[3]);
        assert!(count.iter().all(|n| *n > 10), "{count:?}");
    }

    /// Intervals of the grid in which F changes its sign; one in which its slope does is searched again.
    fn scanned(meridian: &Meridian) -> Vec<[f64; 2]> {
        fn search(
            meridian: &Meridian,
            [from, to]: [f64; 2],
            parts: u32,
            depth: u32,
            found: &mut Vec<[f64; 2]>,
        ) {
            let at = |i: u32| from + (to - from) * f64::from(i) / f64::from(parts);
            for i in 0..parts {
                let [lo, hi] = [at(i), at(i + 1)];
                let [(f, df), (g, dg)] = [lo, hi].map(|t| meridian.miss(t));
                if (f < 0.0) != (g < 0.0) {
                    found.push([lo, hi]);
                } else if df * dg < 0.0 && depth > 0 {
                    search(meridian, [lo, hi], 16, depth - 1, found);
                }
            }
        }
        let mut found = Vec::new();
        search(meridian, [-1.0, 1.0], 4000, 6, &mut found);
        found
    }
}
