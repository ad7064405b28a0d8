//! Parallel light that a sphere refracts: every ray that reaches a point, its focusing, and the energy
//! of all.
//!
//! The light comes from +z. Everything happens in the meridian plane of the point, where a point has the
//! coordinates (rho, z). The light that comes in at p = R (sin a, cos a), a in (-pi/2, pi/2) (the sign
//! tells the side), is refracted to sin t = sin a / eta, and runs inside along -(sin b, cos b), b = a -
//! t. Its line passes the point at the distance
//!   g(a) = rho cos b - z sin b - (R / eta) sin a;
//! a root counts if the point lies on the ray's inner side, s = (p - x).(sin b, cos b) > 0.
//!
//! Magnification: irradiance across the ray at the point, over that outside, without T and absorption.
//! The light between two radii of the beam, R^2 |sin a| cos a da dphi, crosses rho dphi times |g'| da.
//! Equivalent forms, all of which tests compare:
//!   by the ring of rays      M = R^2 |sin a| cos a / (rho |g'|)
//!   by the wavefront         M = (cos a / cos t) / |(1 - s G) (1 - s G / cos^2 t)|, G = (eta cos t -
//!   cos a) / (eta R) by the implicit function M = eta^2 (cos t / s^2) |dp / dw_L|
//! The second holds on the axis, too.
//!
//! After an internal reflection everything is turned by pi - 2 t: p and b advance by that angle, and g
//! keeps its form with the new b.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::math::{Integral, asin, cos, integrate, sin};
use crate::optics::fresnel::fresnel;

/// Light that reaches a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SphereRay {
    /// Polar angle at which it comes in, rad; negative beyond the axis.
    pub entry: f64,
    /// Polar angle of its direction inside, towards where it comes from, rad.
    pub turn: f64,
    /// Length inside since the boundary was last met, mm.
    pub distance: f64,
    /// Length inside altogether, mm.
    pub length: f64,
    /// Irradiance across the ray over that outside, without Fresnel factors and absorption.
    pub magnification: f64,
    /// Product of the Fresnel factors.
    pub transmittance: f64,
}

/// A sphere under parallel light from +z.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LitSphere {
    /// Radius, mm.
    pub radius: f64,
    /// Index inside over outside, at least 1.
    pub eta: f64,
    /// Internal reflections before the point is reached: 0 or 1.
    pub reflections: u32,
}

/// Intervals that are searched for roots and extremes. A pair of roots that lies within one of them has
/// an extreme of g between; two extremes of g within one interval would need g' to turn within pi /
/// 2000.
const INTERVALS: u32 = 2000;

impl LitSphere {
    fn inside(&self, a: f64) -> (f64, f64) {
        let t = asin(sin(a) / self.eta);
        (t, a - t + f64::from(self.reflections) * (PI - 2.0 * t))
    }

    /// g at polar angle a.
    fn miss(&self, a: f64, [rho, z]: [f64; 2]) -> f64 {
        let (_, b) = self.inside(a);
        rho * cos(b) - z * sin(b) - self.radius / self.eta * sin(a)
    }

    /// dg / da: db / da = 1 - t' - 2 k t' with t' = cos a / (eta cos t), k the number of reflections.
    fn slope(&self, a: f64, [rho, z]: [f64; 2]) -> f64 {
        let (t, b) = self.inside(a);
        let dt = cos(a) / (self.eta * cos(t));
        let db = 1.0 - dt - 2.0 * f64::from(self.reflections) * dt;
        -(rho * sin(b) + z * cos(b)) * db - self.radius / self.eta * cos(a)
    }

    /// All light that reaches the point (rho > 0, z). Roots are found by bisection to rounding; those of
    /// a pair that lies closer than 1e-12 rad may be missed, which is where the magnification exceeds
    /// 1e5.
    pub(crate) fn rays(&self, x: [f64; 2]) -> Vec<SphereRay> {
        let at = |i: u32| FRAC_PI_2 * (2.0 * f64::from(i) / f64::from(INTERVALS) - 1.0);
        let mut cuts: Vec<f64> = (0..=INTERVALS).map(at).collect();
        let extremes = cuts.windows(2).filter_map(|w| bisect(|a| self.slope(a, x), w[0], w[1]));
        let extremes: Vec<f64> = extremes.collect();
        cuts.extend(extremes);
        cuts.sort_by(f64::total_cmp);
        let roots = cuts.windows(2).filter_map(|w| bisect(|a| self.miss(a, x), w[0], w[1]));
        roots.filter_map(|a| self.ray(a, x)).collect()
    }

    fn ray(&self, a: f64, [rho, z]: [f64; 2]) -> Option<SphereRay> {
        let (t, b) = self.inside(a);
        let chord = 2.0 * self.radius * cos(t);
        let start = a + f64::from(self.reflections) * (PI - 2.0 * t);
        let distance =
            (self.radius * sin(start) - rho) * sin(b) + (self.radius * cos(start) - z) * cos(b);
        let slope = self.slope(a, [rho, z]);
        let magnification = self.radius * self.radius * sin(a).abs() * cos(a) / (rho * slope.abs());
        let surface = fresnel(cos(a), self.eta);
        let mut transmittance = 1.0 - surface.reflectance;
        (0..self.reflections).for_each(|_| transmittance *= surface.reflectance);
        let length = distance + f64::from(self.reflections) * chord;
        (distance > 0.0).then_some(SphereRay {
            entry: a,
            turn: b,
            distance,
            length,
            magnification,
            transmittance,
        })
    }

    /// Integral over the ball of the sum of Fresnel factors times M, mm^3, without absorption: the flux
    /// that comes in at each radius of the beam times the length that it runs, 2 pi int T b chord(b) db.
    pub(crate) fn budget(&self) -> Integral {
        let ring = |a: f64| {
            let (t, _) = self.inside(a);
            let surface = fresnel(cos(a), self.eta);
            let mut part = 1.0 - surface.reflectance;
            (0..self.reflections).for_each(|_| part *= surface.reflectance);
            part * sin(a) * cos(a) * 2.0 * cos(t)
        };
        let r3 = self.radius * self.radius * self.radius;
        let Integral { value, error } = integrate(ring, 0.0, FRAC_PI_2, 1e-11);
        Integral { value: 2.0 * PI * r3 * value, error: 2.0 * PI * r3 * error }
    }
}

/// A root of `f` in [lo, hi) where its sign differs at the ends.
fn bisect(f: impl Fn(f64) -> f64, lo: f64, hi: f64) -> Option<f64> {
    let (mut lo, mut hi) = (lo, hi);
    let low = f(lo);
    if (low > 0.0) == (f(hi) > 0.0) {
        return None;
    }
    for _ in 0..80 {
        let middle = 0.5 * (lo + hi);
        if (f(middle) > 0.0) == (low > 0.0) { lo = middle } else { hi = middle }
    }
    Some(0.5 * (lo + hi))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{atan2, tan};

    fn sphere(eta: f64, reflections: u32) -> LitSphere {
        LitSphere { radius: 1.0, eta, reflections }
    }

    /// Points of the meridian plane, uniform in the ball: the additive recurrence of the plastic number,
    /// whose discrepancy falls nearly as 1 / n.
    fn points(count: u32) -> impl Iterator<Item = [f64; 2]> {
        (1..=count).map(|i| {
            let [u, v] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3]
                .map(|step| (f64::from(i) * step).fract());
            let (r, mu) = (crate::math::cbrt(u), 2.0 * v - 1.0);
            [r * (1.0 - mu * mu).sqrt(), r * mu]
        })
    }

    /// The magnification by the wavefront and by the implicit function; see the head of the file.
    fn other_forms(sphere: &LitSphere, ray: &SphereRay, x: [f64; 2]) -> [f64; 2] {
        let (LitSphere { eta, radius, .. }, a) = (*sphere, ray.entry);
        let (t, b) = sphere.inside(a);
        let s = ray.distance;
        let g = (eta * cos(t) - cos(a)) / (eta * radius);
        let wavefront = cos(a) / cos(t) / ((1.0 - s * g) * (1.0 - s * g / (cos(t) * cos(t)))).abs();
        // In the plane: p turns with the light by 1 - g_beta / g'. Across it: both turn about the axis
        // from the middle to the point.
        let g_beta = -x[1] * cos(b) - x[0] * sin(b);
        let in_plane = radius * (1.0 - g_beta / sphere.slope(a, x)).abs();
        let across = radius * (x[0] * cos(a) - x[1] * sin(a)).abs() / x[0];
        [wavefront, eta * eta * cos(t) / (s * s) * in_plane * across]
    }

    /// The three forms agree to 1e-11, away from folds, where a rounding of the root is magnified.
    #[test]
    fn three_forms_of_the_magnification_agree() {
        for eta in [1.1, 1.3, 1.5, 2.4] {
            let sphere = sphere(eta, 0);
            for x in points(90) {
                for ray in sphere.rays(x).into_iter().filter(|ray| ray.magnification < 1e2) {
                    for other in other_forms(&sphere, &ray, x) {
                        let ratio = other / ray.magnification;
                        assert!((ratio - 1.0).abs() < 1e-11, "{eta} {x:?} {ray:?}: {ratio}");
                    }
                }
            }
        }
    }

    /// Every root solves the polynomial of degree 8 in tan(a / 2) that squaring gives.
    #[test]
    fn roots_solve_the_polynomial() {
        for eta in [1.3, 1.5] {
            for [rho, z] in points(90) {
                for ray in sphere(eta, 0).rays([rho, z]) {
                    let q = tan(0.5 * ray.entry);
                    let q2 = q * q;
                    let line = rho * (1.0 - q2) - 2.0 * z * q;
                    let chord = (1.0 + q2) - 2.0 * rho * q - z * (1.0 - q2);
                    let left = (eta * eta * (1.0 + q2) * (1.0 + q2) - 4.0 * q2) * line * line;
                    let right = 4.0 * q2 * chord * chord;
                    assert!((left - right).abs() < 1e-13, "{left} {right}");
                }
            }
        }
    }

    /// Shares of the ball's volume that 0, 1, and 2 or 3 rays reach. Three reach a small part beside the
    /// pole that points away from the light, where rays that graze on entry arrive from both sides.
    #[test]
    fn counts_of_rays() {
        for (eta, expected) in [(1.5, [0.2616, 0.7226, 0.0158]), (1.3, [0.1810, 0.7988, 0.0202])] {
            let mut counts = [0u32; 4];
            for x in points(5_000) {
                counts[sphere(eta, 0).rays(x).len()] += 1;
            }
            let [none, one, two, three] = counts.map(|count| f64::from(count) / 5e3);
            assert!(three < 2e-3, "{counts:?}");
            for (got, share) in [none, one, two + three].into_iter().zip(expected) {
                // Expected: sign changes of g on 1200 intervals at 1.5 million random points (standard
                // error 4e-4).
                assert!((got - share).abs() < 2e-3, "{eta}: {counts:?} {expected:?}");
            }
        }
    }

    #[test]
    fn the_energy_has_its_known_value() {
        for (eta, expected) in [(1.5, 5.04762), (1.3, 4.95345)] {
            let budget = sphere(eta, 0).budget();
            assert!((budget.value - expected).abs() < 5e-6 && budget.error < 1e-9, "{budget:?}");
        }
        // Without refraction: the volume of the ball.
        assert!((sphere(1.0, 0).budget().value - 4.0 / 3.0 * PI).abs() < 1e-10);
    }

    /// Rays that are followed from the light, with and without a reflection, are among those found, and
    /// the flux between two neighbours has the stated magnification.
    #[test]
    fn rays_from_the_light_are_found() {
        for (eta, reflections) in [(1.5, 0), (1.3, 0), (1.5, 1), (1.3, 1)] {
            let sphere = sphere(eta, reflections);
            // The ray that comes in at angle a, followed by vectors: point and direction after the last
            // event.
            let follow = |a: f64| {
                let (sin_t, normal) = (sin(a) / eta, [sin(a), cos(a)]);
                let cos_t = (1.0 - sin_t * sin_t).sqrt();
                // Towards where the light goes: -n cos t + (tangential part of -z) / eta.
                let tangential = [sin(a) * cos(a), cos(a) * cos(a) - 1.0];
                let mut dir = [0, 1].map(|i| -normal[i] * cos_t + tangential[i] / eta);
                let mut p = normal;
                for _ in 0..reflections {
                    let chord = -2.0 * (p[0] * dir[0] + p[1] * dir[1]);
                    p = [0, 1].map(|i| p[i] + chord * dir[i]);
                    let out = p[0] * dir[0] + p[1] * dir[1];
                    dir = [0, 1].map(|i| dir[i] - 2.0 * out * p[i]);
                }
                (p, dir)
            };
            for i in 1..40 {
                let a = FRAC_PI_2 * f64::from(i) / 41.0;
                let (p, dir) = follow(a);
                let length = 2.0 * cos(asin(sin(a) / eta)) * (0.1 + 0.8 * f64::from(i * 7 % 40) / 40.0);
                let mut x = [0, 1].map(|k| p[k] + length * dir[k]);
                // The other half of the meridian plane: the same ray has the angle -a there.
                let side = 1f64.copysign(x[0]);
                x[0] *= side;
                let rays = sphere.rays(x);
                let found = rays.iter().find(|ray| (ray.entry - side * a).abs() < 1e-9);
                let found = found.unwrap_or_else(|| panic!("{eta} {reflections} {a}: {rays:?}"));
                assert!((found.distance - length).abs() < 1e-9);
                let whole = length + f64::from(reflections) * 2.0 * cos(asin(sin(a) / eta));
                assert!((found.length - whole).abs() < 1e-9);
                let turn = atan2(-dir[0] * side, -dir[1]);
                assert!((sin(found.turn - turn)).abs() < 1e-9 && cos(found.turn - turn) > 0.0);
                // Across the ray at x, a neighbour passes at d(offset): flux sin a cos a da dphi = M rho
                // |d|.
                let passes = |a: f64| {
                    let (q, to) = follow(a);
                    // Signed distance from x (back in the ray's own half) to the neighbour's line.
                    let from = [side * x[0] - q[0], x[1] - q[1]];
                    from[0] * to[1] - from[1] * to[0]
                };
                let e = 1e-3 * (FRAC_PI_2 - a);
                let slope = |e: f64| (passes(a + e) - passes(a - e)) / (2.0 * e);
                let slope = (4.0 * slope(0.5 * e) - slope(e)) / 3.0;
                let expected = sin(a) * cos(a) / (x[0] * slope.abs());
                let ratio = found.magnification / expected;
                assert!((ratio - 1.0).abs() < 1e-6, "{eta} {reflections} {a}: {ratio}");
            }
        }
    }
}
