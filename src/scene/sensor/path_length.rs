//! The path length of light in a finite body, and the power that falls onto its surface.
//!
//! Light that leaves the body for good along a path of power dP scores dP l and dP n, where l is the
//! path's length in the medium and n counts how often it fell onto the surface from outside; both are
//! divided by pi S, S the area of the surface. In a sky of radiance 1 without losses the power that falls
//! onto the surface is pi S, light that comes from another part of the body included, so the second mean
//! is 1 and the first is the mean path length in mm. Both l and n are the same for a path and its
//! reverse: paths from the sensor and photons from the lights score the same integrals.
//!
//! The first is also a derivative. If the medium absorbs a little more, the light of a path decreases by
//! exp(-d sigma_a l), so the mean of dP l is -d(flux) / d(sigma_a), in any light and with absorption too.

use std::f64::consts::PI;

use super::body_flux::BodyFlux;
use super::{RegionShares, SensorClass, SensorMethods, SensorRay, SensorRegion};
use crate::geometry::{Ray, Side};
use crate::math::DVec3;

/// Path length in a finite body or in a ball within.
#[derive(Clone, Debug)]
pub struct PathLength {
    /// All light that leaves the body, in one bin.
    pub flux: BodyFlux,
    /// Area of its surface, mm^2.
    pub area: f64,
    /// Only lengths within this ball count; all without it.
    pub ball: Option<Ball>,
}

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre, mm.
    pub center: DVec3,
    /// Radius, mm.
    pub radius: f64,
}

impl Ball {
    /// Volume, mm^3.
    pub fn volume(&self) -> f64 {
        4.0 / 3.0 * PI * self.radius * self.radius * self.radius
    }

    /// Length within the ball of the flight from a ray's origin to the distance `t`, mm.
    fn chord(&self, ray: &Ray, t: f64) -> f64 {
        let to_center = self.center - ray.origin;
        let middle = to_center.dot(ray.dir);
        let miss2 = (to_center - middle * ray.dir).length_squared();
        let half = (self.radius * self.radius - miss2).max(0.0).sqrt();
        ((middle + half).min(t) - (middle - half).max(0.0)).max(0.0)
    }
}

impl PathLength {
    /// Slots, which are the regions.
    const LENGTH: usize = 0;
    const INCIDENT: usize = 1;

    /// From power to the slots' unit.
    fn per_surface(&self) -> f64 {
        1.0 / (PI * self.area)
    }
}

impl SensorMethods for PathLength {
    fn class(&self) -> SensorClass {
        SensorClass::Lengths
    }

    fn rays_per_pass(&self) -> usize {
        self.flux.paths
    }

    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        let ray = self.flux.ray(index, u);
        SensorRay { weight: ray.weight * self.per_surface(), ..ray }
    }

    fn receives(&self, is_finite: bool) -> bool {
        is_finite
    }

    #[inline]
    fn receive(&self, _: &Ray) -> Option<(usize, f64)> {
        Some((Self::LENGTH, self.per_surface()))
    }

    fn regions(&self) -> Vec<SensorRegion> {
        vec![SensorRegion::split("path_length"), SensorRegion::split("incident")]
    }

    #[inline]
    fn regions_of(&self, slot: usize) -> RegionShares {
        RegionShares::one(slot, 1.0)
    }

    fn measure(&self) -> PathMeasure {
        PathMeasure(Some(PathSoFar { ball: self.ball, length: 0.0, incidences: 0.0 }))
    }
}

/// What a path has done so far, kept for sensors that score it.
#[derive(Clone, Copy, Debug, Default)]
pub struct PathMeasure(Option<PathSoFar>);

#[derive(Clone, Copy, Debug)]
struct PathSoFar {
    ball: Option<Ball>,
    length: f64,
    incidences: f64,
}

impl PathMeasure {
    /// Nothing is measured.
    #[inline]
    pub fn is_off(&self) -> bool {
        self.0.is_none()
    }

    /// The path flies in the medium from the ray's origin to the distance `t`.
    #[inline]
    pub fn fly(&mut self, ray: &Ray, t: f64) {
        if let Some(path) = &mut self.0 {
            path.length += path.ball.map_or(t, |ball| ball.chord(ray, t));
        }
    }

    /// The path meets the surface from `side`.
    #[inline]
    pub fn meet(&mut self, side: Side) {
        if let Some(path) = self.0.as_mut().filter(|_| side == Side::Outside) {
            path.incidences += 1.0;
        }
    }

    /// The slots in which the path's light counts, each with its factor: that of its ray, or what has
    /// been measured.
    #[inline]
    pub fn slots(&self, slot: usize) -> impl Iterator<Item = (usize, f64)> + use<> {
        let [first, second] = match self.0 {
            None => [Some((slot, 1.0)), None],
            Some(path) => {
                [Some((PathLength::LENGTH, path.length)), Some((PathLength::INCIDENT, path.incidences))]
            }
        };
        first.into_iter().chain(second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From before, inside and behind the ball, through its middle and past it.
    #[test]
    fn flights_through_a_ball() {
        let ball = Ball { center: DVec3::X, radius: 0.5 };
        let chord = |x: f64, y: f64, t: f64| {
            ball.chord(&Ray { origin: DVec3::new(x, y, 0.0), dir: DVec3::X }, t)
        };
        let cases = [
            (chord(0.0, 0.0, 9.0), 1.0),
            (chord(0.0, 0.0, 1.0), 0.5),
            (chord(0.0, 0.0, 0.4), 0.0),
            (chord(0.9, 0.0, 0.2), 0.2),
            (chord(1.2, 0.0, 9.0), 0.3),
            (chord(1.6, 0.0, 9.0), 0.0),
            (chord(0.0, 0.3, 9.0), 0.8),
            (chord(0.0, 0.6, 9.0), 0.0),
        ];
        for (found, expected) in cases {
            assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        }
    }
}
