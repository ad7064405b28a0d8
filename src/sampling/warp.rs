//! Maps from the unit square, each beside the density that it realises.

use std::f64::consts::{FRAC_1_PI, PI};

use crate::math::{DVec3, sin_cos_turns};

/// A point of the unit disc, uniform per area: r = sqrt(u0), angle 2 pi u1.
#[inline]
pub fn square_to_disc(u: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = sin_cos_turns(u[1]);
    let r = u[0].sqrt();
    [r * cos, r * sin]
}

/// Density of [`square_to_disc`] per area.
pub const PDF_AREA_DISC: f64 = FRAC_1_PI;

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

/// Density of [`square_to_cosine_hemisphere`] per solid angle.
#[inline]
pub fn pdf_cosine_hemisphere(cos: f64) -> f64 {
    cos.max(0.0) * FRAC_1_PI
}
