//! Flight distances in a homogeneous medium.

use super::discrete::choose;
use crate::math::{DVec3, atan2, exp, exp_m1, ln, ln_1p, ln_of_normal, sin};

/// The distance of a flight through a medium of extinction `sigma_t` (1/mm): the inverse of
/// F(t) = 1 - exp(-sigma_t t), t = -ln(1 - u) / sigma_t. Infinite where `sigma_t` is 0. `1 - u` is
/// exact for the 53-bit numbers of a stream.
#[inline]
pub fn sample_exponential(sigma_t: f64, u: f64) -> f64 {
    if sigma_t == 0.0 { f64::INFINITY } else { -ln(1.0 - u) / sigma_t }
}

/// The same for a positive extinction, without branches: for loops over lanes.
#[inline(always)]
pub(crate) fn sample_exponential_in_lanes(sigma_t: f64, u: f64) -> f64 {
    -ln_of_normal(1.0 - u) / sigma_t
}

/// Density of [`sample_exponential`] per mm.
#[inline]
pub fn pdf_distance_exponential(sigma_t: f64, t: f64) -> f64 {
    sigma_t * exp(-sigma_t * t)
}

/// Probability of a flight longer than `t`.
#[inline]
pub fn transmittance(sigma_t: f64, t: f64) -> f64 {
    if sigma_t == 0.0 { 1.0 } else { exp(-sigma_t * t) }
}

/// A distance in [0, `t_max`] in proportion to exp(-sigma_t t): the inverse of
/// F(t) = (1 - e^(-sigma_t t)) / (1 - e^(-tau)), tau = sigma_t t_max.
///
/// e^(-sigma_t t) = 1 - u (1 - e^(-tau)) = (1 - u) + u e^(-tau): the first form keeps the digits of a
/// thin medium, the second, a sum of positive terms, those of the far end of a thick one. Uniform where
/// tau is 0; the plain exponential where `t_max` is infinite.
#[inline]
pub fn sample_truncated_exponential(sigma_t: f64, t_max: f64, u: f64) -> f64 {
    if sigma_t == 0.0 {
        return t_max * u;
    }
    let tau = sigma_t * t_max;
    let lost = -u * exp_m1(-tau);
    let depth = if lost < 0.5 { -ln_1p(-lost) } else { -ln((1.0 - u) + u * exp(-tau)) };
    (depth / sigma_t).min(t_max)
}

/// Density of [`sample_truncated_exponential`] per mm; 0 outside [0, `t_max`].
#[inline]
pub fn pdf_distance_truncated_exponential(sigma_t: f64, t_max: f64, t: f64) -> f64 {
    if !(0.0..=t_max).contains(&t) {
        0.0
    } else if sigma_t == 0.0 {
        1.0 / t_max
    } else {
        sigma_t * exp(-sigma_t * t) / -exp_m1(-sigma_t * t_max)
    }
}

/// Distances along a ray with density in proportion to 1 / (squared distance to a point): equiangular
/// sampling (Kulla & Fajardo 2012, section 4).
///
/// The ray's origin, the point and the sample form a triangle. With delta the coordinate of the point's
/// foot on the ray, D its distance from the line and L^2 = delta^2 + D^2, the triangle's angle at the
/// origin is `near` = atan2(D, delta); the segment [0, t_max] is seen from the point under the angle
/// `span`, and what lies beyond it under `rest`, in all half a turn. A sample divides the span in the
/// ratio u, and by the law of sines
///   t = L sin(u span) / sin(near + u span) = L sin(u span) / sin(rest + (1 - u) span).
/// A sine is that of what is left to half a turn; of the two arguments the smaller is a sum of positive
/// terms below a quarter turn. So there is no difference of near numbers at either end, nor close to a
/// point on the line, for t_max infinite (rest = 0) as for a short segment far away. rest = atan2(D,
/// t_max - delta); span = atan2(t_max D, D^2 - delta (t_max - delta)), or atan2(D, -delta) for the
/// infinite ray.
///
/// A point on the line would leave no density anywhere else: D is never below [`Equiangular::CLAMP`] L,
/// for the sample and for the density alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equiangular {
    delta: f64,
    distance: f64,
    /// Distance of the point from the ray's origin, L, mm.
    far: f64,
    near: f64,
    span: f64,
    rest: f64,
    t_max: f64,
}

impl Equiangular {
    /// The least distance of the point from the line, in units of its distance from the ray's origin.
    pub const CLAMP: f64 = 1e-9;

    /// Along a ray of length `t_max` (mm, may be infinite) from the origin with unit direction `dir`,
    /// for a point at `offset` from the origin.
    ///
    /// `None` where there is nothing to sample: the point is the origin itself, or the segment is seen
    /// under no angle that a number can hold. A technique then has density 0 there.
    #[inline]
    pub fn towards(offset: DVec3, dir: DVec3, t_max: f64) -> Option<Equiangular> {
        Equiangular::new(offset.dot(dir), offset.cross(dir).length(), t_max)
    }

    /// The same from the point's foot on the ray and its distance from the line, mm.
    #[inline]
    pub fn new(delta: f64, distance: f64, t_max: f64) -> Option<Equiangular> {
        let distance = distance.max(Equiangular::CLAMP * (delta * delta + distance * distance).sqrt());
        let far2 = delta * delta + distance * distance;
        let (span, rest) = if t_max == f64::INFINITY {
            (atan2(distance, -delta), 0.0)
        } else {
            let beyond = t_max - delta;
            (atan2(t_max * distance, distance * distance - delta * beyond), atan2(distance, beyond))
        };
        let (far, near) = (far2.sqrt(), atan2(distance, delta));
        let is_seen = far2 > 0.0 && span > f64::MIN_POSITIVE;
        is_seen.then_some(Equiangular { delta, distance, far, near, span, rest, t_max })
    }

    /// The distance that `u` selects, mm.
    #[inline]
    pub fn sample(&self, u: f64) -> f64 {
        let seen = u * self.span;
        let beyond = self.rest + (1.0 - u) * self.span;
        let opposite = (self.near + seen).min(beyond);
        (self.far * sin(seen.min(self.near + beyond)) / sin(opposite)).min(self.t_max)
    }

    /// Density of [`Self::sample`] per mm, D / (span (D^2 + (t - delta)^2)); 0 outside [0, t_max].
    #[inline]
    pub fn pdf_distance(&self, t: f64) -> f64 {
        if !(0.0..=self.t_max).contains(&t) {
            return 0.0;
        }
        let along = t - self.delta;
        self.distance / (self.span * (self.distance * self.distance + along * along))
    }
}

/// Truncated exponential and equiangular distances as one technique: one number chooses between them and
/// draws, and the density is that of both together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceMixture {
    /// Extinction of the exponential part, 1/mm, positive.
    pub sigma_t: f64,
    /// Length of the ray, mm; may be infinite. The equiangular part is built with the same.
    pub t_max: f64,
    /// Equiangular part of the mixture.
    pub equiangular: Equiangular,
    /// The exponential part's probability.
    pub share_exponential: f64,
}

impl DistanceMixture {
    /// The distance that `u` selects, mm.
    #[inline]
    pub fn sample(&self, u: f64) -> f64 {
        match choose(u, self.share_exponential) {
            (true, u) => sample_truncated_exponential(self.sigma_t, self.t_max, u),
            (false, u) => self.equiangular.sample(u),
        }
    }

    /// Density of [`Self::sample`] per mm.
    #[inline]
    pub fn pdf_distance(&self, t: f64) -> f64 {
        self.share_exponential * pdf_distance_truncated_exponential(self.sigma_t, self.t_max, t)
            + (1.0 - self.share_exponential) * self.equiangular.pdf_distance(t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::integrate;

    const SIGMAS: [f64; 4] = [1e-3, 1.0, 10.0, 1e4];

    /// 4096 numbers and both ends.
    fn grid() -> impl Iterator<Item = f64> {
        let end = 1.0 / f64::from(1 << 24);
        (0..4096).map(|i| (f64::from(i) + 0.5) / 4096.0).chain([end, 1.0 - end])
    }

    /// D1: F(t(u)) = u over a grid with both ends.
    #[test]
    fn inverse_distribution_function() {
        for sigma_t in SIGMAS {
            for u in grid() {
                let t = sample_exponential(sigma_t, u);
                assert!((-exp_m1(-sigma_t * t) - u).abs() < 1e-12, "{sigma_t} {u}");
            }
            assert_eq!(sample_exponential(sigma_t, 0.0), 0.0);
        }
        assert_eq!(sample_exponential(0.0, 0.5), f64::INFINITY);
    }

    /// D7: the density over [0, T] and the probability of flying farther add up to 1. The flight to the
    /// boundary has the probability `transmittance`, not a density.
    #[test]
    fn density_and_transmittance_sum_to_one() {
        for sigma_t in SIGMAS {
            for tau in [0.01, 1.0, 30.0] {
                let t_max = tau / sigma_t;
                let inside = integrate(|t| pdf_distance_exponential(sigma_t, t), 0.0, t_max, 1e-12);
                assert!((inside.value + transmittance(sigma_t, t_max) - 1.0).abs() < 1e-10);
            }
        }
        assert_eq!(transmittance(0.0, 5.0), 1.0);
    }

    const TAUS: [f64; 7] = [1e-9, 1e-4, 0.1, 1.0, 20.0, 1e3, f64::INFINITY];

    /// D1 for the truncated exponential, from thin to thick; 0 and `t_max` come out exactly.
    #[test]
    fn truncated_inverse_distribution_function() {
        for sigma_t in SIGMAS {
            for tau in TAUS {
                let t_max = tau / sigma_t;
                for u in grid() {
                    let t = sample_truncated_exponential(sigma_t, t_max, u);
                    let back = exp_m1(-sigma_t * t) / exp_m1(-tau);
                    assert!((0.0..=t_max).contains(&t));
                    assert!((back - u).abs() < 1e-12, "{sigma_t} {tau} {u}: {back}");
                }
                assert_eq!(sample_truncated_exponential(sigma_t, t_max, 0.0), 0.0);
                let end = sample_truncated_exponential(sigma_t, t_max, 1.0);
                assert!(end <= t_max && (end / t_max > 1.0 - 1e-15 || tau == f64::INFINITY), "{tau}");
            }
        }
        assert_eq!(sample_truncated_exponential(0.0, 4.0, 0.25), 1.0);
        assert_eq!(pdf_distance_truncated_exponential(0.0, 4.0, 1.0), 0.25);
    }

    /// D7, D2: the truncated density adds up to 1, is the inverse slope of the map, and is 0 outside.
    #[test]
    fn truncated_density() {
        for tau in TAUS {
            let (sigma_t, t_max) = (2.0, tau / 2.0);
            let pdf = |t| pdf_distance_truncated_exponential(sigma_t, t_max, t);
            let mass = integrate(pdf, 0.0, t_max.min(20.0), 1e-12);
            assert!((mass.value - 1.0).abs() < 1e-10, "{tau}: {mass:?}");
            assert_eq!(
                (pdf(-1e-300), pdf(t_max * (1.0 + 1e-15))),
                (0.0, if tau.is_finite() { 0.0 } else { pdf(t_max) })
            );
            for u in [0.1, 0.5, 0.9] {
                let at = |u| sample_truncated_exponential(sigma_t, t_max, u);
                let slope = (at(u + 1e-6) - at(u - 1e-6)) / 2e-6;
                assert!((slope * pdf(at(u)) - 1.0).abs() < 1e-8, "{tau} {u}");
            }
        }
    }

    /// (delta, D, t_max): beside, before and behind the ray, on its line, near and far.
    const EQUIANGULAR: [[f64; 3]; 11] = [
        [2.0, 0.5, 5.0],
        [2.0, 0.5, f64::INFINITY],
        [-2.0, 0.5, 5.0],
        [-2.0, 0.5, f64::INFINITY],
        [9.0, 0.5, 5.0],
        [0.0, 1.0, f64::INFINITY],
        [2.0, 1e-4, 5.0],
        [2.0, 0.0, 5.0],
        [-2.0, 0.0, f64::INFINITY],
        [1e6, 1e3, 1e-3],
        [-1e6, 1e3, 1e-3],
    ];

    /// D1: the angle from the origin to the sample, by the tangents' difference, over that to the end.
    #[test]
    fn equiangular_inverse_distribution_function() {
        for [delta, distance, t_max] in EQUIANGULAR {
            let sampler = Equiangular::new(delta, distance, t_max).expect("seen");
            let d = distance.max(1e-9 * delta.hypot(distance));
            // L^2 - delta t, in a form whose digits survive near the point.
            let angle = |t: f64| atan2(t * d, d * d - delta * (t - delta));
            let span = if t_max.is_finite() { angle(t_max) } else { atan2(d, -delta) };
            for u in grid() {
                let t = sampler.sample(u);
                assert!((0.0..=t_max).contains(&t));
                // F rises by `pdf` a millimetre, steeply near the point, where t's own rounding is what
                // comes on top; a sine of an angle x passes the angle's rounding on by cot(x) < 1/x.
                let opposite = atan2(d, (t - delta).abs());
                let rounding = 4.0 * f64::EPSILON * t * (1.0 + 1.0 / opposite) * sampler.pdf_distance(t);
                let error = (angle(t) / span - u).abs();
                assert!(error < 1e-12 + rounding, "{delta} {distance} {t_max} {u}: {error}");
            }
            assert_eq!(sampler.sample(0.0), 0.0);
            let end = sampler.sample(1.0);
            assert!(end == t_max || (end / t_max - 1.0).abs() < 1e-12 || t_max.is_infinite(), "{end}");
        }
    }

    /// D7: the density adds up to 1 on both sides of its peak, in the variable that straightens it.
    #[test]
    fn equiangular_density() {
        for [delta, distance, t_max] in EQUIANGULAR {
            let sampler = Equiangular::new(delta, distance, t_max).expect("seen");
            let d = distance.max(1e-9 * delta.hypot(distance));
            // t = delta + d sinh(y) makes the peak a bump of width 1; a short segment has none.
            let mass = if t_max < 1e-3 * delta.abs() {
                integrate(|t| sampler.pdf_distance(t), 0.0, t_max, 1e-12)
            } else {
                let end = t_max.min(1e14 * delta.hypot(d));
                let bump = |y: f64| {
                    sampler.pdf_distance((delta + d * y.sinh()).clamp(0.0, t_max)) * d * y.cosh()
                };
                integrate(bump, (-delta / d).asinh(), ((end - delta) / d).asinh(), 1e-12)
            };
            assert!((mass.value - 1.0).abs() < 1e-9, "{delta} {distance} {t_max}: {mass:?}");
            assert_eq!(sampler.pdf_distance(-1e-9), 0.0);
            assert!(sampler.pdf_distance(t_max * 1.01) == 0.0 || t_max.is_infinite());
        }
    }

    /// A point on the line is handled by the clamp, a point at the origin is refused; vectors and
    /// their two numbers agree.
    #[test]
    fn equiangular_limits() {
        assert_eq!(Equiangular::new(0.0, 0.0, 1.0), None);
        assert_eq!(Equiangular::new(1.0, 1.0, 0.0), None);
        assert_eq!(Equiangular::new(2.0, 0.0, 5.0), Equiangular::new(2.0, 2e-9, 5.0));
        let dir = DVec3::new(0.48, -0.6, 0.64);
        let side = dir.cross(DVec3::X).normalize();
        let by_vectors = Equiangular::towards(dir * 2.0 + side * 0.5, dir, 5.0).expect("seen");
        let by_numbers = Equiangular::new(2.0, 0.5, 5.0).expect("seen");
        for u in grid() {
            let t = by_numbers.sample(u);
            assert!((by_vectors.sample(u) - t).abs() < 1e-13);
            assert!((by_vectors.pdf_distance(t) / by_numbers.pdf_distance(t) - 1.0).abs() < 1e-12);
        }
    }

    /// D1 and D3: the mixture's distribution function, both parts in their shares.
    #[test]
    fn mixture_of_distances() {
        let equiangular = Equiangular::new(2.0, 0.5, 5.0).expect("seen");
        let mixture = DistanceMixture { sigma_t: 1.3, t_max: 5.0, equiangular, share_exponential: 0.3 };
        let n = 1u32 << 16;
        let mut below = 0u32;
        for k in 0..n {
            below += u32::from(mixture.sample((f64::from(k) + 0.5) / f64::from(n)) < 1.7);
        }
        let mass = integrate(|t| mixture.pdf_distance(t), 0.0, 1.7, 1e-12).value;
        // Each part is monotone in its own interval of u.
        assert!((f64::from(below) / f64::from(n) - mass).abs() <= 2.0 / f64::from(n));
        let total = integrate(|t| mixture.pdf_distance(t), 0.0, 5.0, 1e-12).value;
        assert!((total - 1.0).abs() < 1e-10);
    }
}
