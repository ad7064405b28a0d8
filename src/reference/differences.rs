//! Densities of maps between directions by central differences, with which tests compare closed forms.

use crate::math::{DVec3, Frame};

/// |d to / d from|: the solid angle of the image of a unit of solid angle about `from` (unit), under a map of unit
/// directions. `None` where the map is not defined close by.
///
/// Central differences with steps h and h/2 and one step of Richardson's extrapolation: the error is of
/// order h^4 in the map's fifth derivatives, and 1e-16 / h from rounding; with h = 1e-3, and derivatives
/// of order 1, both are below 1e-11.
pub(crate) fn solid_angle_ratio(
    map: impl Fn(DVec3) -> Option<DVec3>,
    from: DVec3,
    h: f64,
) -> Option<f64> {
    let Frame { s, t, .. } = Frame::about(from);
    let slope = |u: DVec3, h: f64| -> Option<DVec3> {
        // On a great circle, so that the step is an angle to third order.
        let at = |step: f64| map((from + u * step).normalize());
        Some((at(h)? - at(-h)?) / (2.0 * h))
    };
    let derivative = |u: DVec3| -> Option<DVec3> {
        let (coarse, fine) = (slope(u, h)?, slope(u, 0.5 * h)?);
        Some((fine * 4.0 - coarse) / 3.0)
    };
    Some(derivative(s)?.cross(derivative(t)?).length())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sin;

    /// A plane refracts with |d w_o / d w_i| = eta^2 cos_i / cos_o, i inside.
    #[test]
    fn a_plane_has_its_closed_form() {
        let eta = 1.5;
        for angle in [0.0, 0.2, 0.5, 0.7] {
            let sin_i = sin(angle);
            let from = DVec3::new(0.6 * sin_i, 0.8 * sin_i, (1.0 - sin_i * sin_i).sqrt());
            let map = |w: DVec3| {
                let z2 = 1.0 - eta * eta * (w.x * w.x + w.y * w.y);
                (z2 > 0.0).then(|| DVec3::new(eta * w.x, eta * w.y, z2.sqrt()))
            };
            let to = map(from).map_or(f64::NAN, |to| to.z);
            let got = solid_angle_ratio(map, from, 1e-3).expect("below the critical angle");
            // Near it (0.73) derivatives grow.
            let bound = if angle > 0.6 { 1e-6 } else { 1e-10 };
            assert!((got / (eta * eta * from.z / to) - 1.0).abs() < bound, "{angle}: {got}");
        }
        let blind = |_: DVec3| None;
        assert!(solid_angle_ratio(blind, DVec3::Z, 1e-3).is_none());
    }
}
