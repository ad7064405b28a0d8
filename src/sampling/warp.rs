//! Maps from the unit square, each with the density that it samples.

use std::f64::consts::PI;

use crate::math::{DVec3, sin_cos_turns};

/// A point of the unit disc, uniform per area: r = sqrt(u0), angle 2 pi u1; density 1 / pi.
#[inline]
pub fn square_to_disc(u: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = sin_cos_turns(u[1]);
    let r = u[0].sqrt();
    [r * cos, r * sin]
}

/// A direction about +z with 1 - cos theta uniform in [0, `height`): the cap of solid angle
/// 2 pi `height`. Height 2 is the whole sphere. Working with 1 - cos keeps small caps accurate:
/// sin^2 = h (2 - h).
#[inline]
pub fn square_to_cap(height: f64, u: [f64; 2]) -> DVec3 {
    let h = height * u[0];
    let (sin, cos) = sin_cos_turns(u[1]);
    let r = (h * (2.0 - h)).sqrt();
    DVec3::new(r * cos, r * sin, 1.0 - h)
}

/// Density of [`square_to_cap`] per solid angle, inside the cap.
#[inline]
pub fn pdf_cap(height: f64) -> f64 {
    1.0 / (2.0 * PI * height)
}

/// A direction with density cos theta / pi over the hemisphere of +z.
#[inline]
pub fn square_to_cosine_hemisphere(u: [f64; 2]) -> DVec3 {
    let [x, y] = square_to_disc(u);
    DVec3::new(x, y, (1.0 - u[0]).sqrt())
}

/// Barycentric coordinates of a point of a triangle, uniform per area: density 1 / area. The first is
/// 1 - sqrt(u0) (the part of the triangle beyond a parallel to the opposite side grows as the square of
/// its height), u1 divides the parallel. Their sum is 1.
#[inline]
pub fn square_to_triangle(u: [f64; 2]) -> [f64; 3] {
    let s = u[0].sqrt();
    let t = s * u[1];
    [1.0 - s, s - t, t]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> impl Iterator<Item = [f64; 2]> {
        (1..40).flat_map(|i| (1..40).map(move |j| [f64::from(i) / 40.0, f64::from(j) / 41.0]))
    }

    /// Area of the image of a unit of the square, by central differences.
    fn jacobian(map: impl Fn([f64; 2]) -> DVec3, u: [f64; 2]) -> f64 {
        let e = 1e-6;
        let a = (map([u[0] + e, u[1]]) - map([u[0] - e, u[1]])) / (2.0 * e);
        let b = (map([u[0], u[1] + e]) - map([u[0], u[1] - e])) / (2.0 * e);
        a.cross(b).length()
    }

    /// D2: every density is the inverse Jacobian of its map, and the images lie where they should.
    #[test]
    fn densities_are_inverse_jacobians() {
        for u in grid() {
            let disc = |u| {
                let [x, y] = square_to_disc(u);
                DVec3::new(x, y, 0.0)
            };
            assert!((jacobian(disc, u) / PI - 1.0).abs() < 1e-6);
            assert!(disc(u).length() < 1.0);
            for height in [1e-3, 0.5, 2.0] {
                let cap = |u| square_to_cap(height, u);
                assert!((jacobian(cap, u) * pdf_cap(height) - 1.0).abs() < 1e-6, "{height} {u:?}");
            }
            let cosine = square_to_cosine_hemisphere;
            assert!((jacobian(cosine, u) * cosine(u).z / PI - 1.0).abs() < 1e-6);
            assert!((cosine(u).length() - 1.0).abs() < 1e-15);
        }
    }

    /// D2 for the triangle: uniform over one of area 3/2 in the plane, whose corners it reaches.
    #[test]
    fn triangle_is_uniform() {
        let corners = [DVec3::ZERO, DVec3::new(3.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.0)];
        let point = |u| {
            let [a, b, c] = square_to_triangle(u);
            corners[0] * a + corners[1] * b + corners[2] * c
        };
        for u in grid() {
            assert!((jacobian(point, u) / 1.5 - 1.0).abs() < 1e-6, "{u:?}");
            let weights = square_to_triangle(u);
            assert!(
                weights.iter().all(|w| *w > 0.0) && (weights.iter().sum::<f64>() - 1.0).abs() < 1e-15
            );
        }
        assert_eq!([[0.0, 0.3], [1.0, 0.0], [1.0, 1.0]].map(point), corners);
    }
}
