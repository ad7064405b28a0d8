//! Light that enters through the boundary, which is the light that a walk finds that leaves the body there.

use super::rule::Finder;
use crate::geometry::{Hit, Ray};
use crate::math::{DVec3, GOLDEN};
use crate::optics::boundary::Boundary;
use crate::optics::fresnel::fresnel;
use crate::scene::Scene;

/// Directions per light of finite size.
const DIRECTIONS: u32 = 128;

/// Concentration up to which light that leaves the body finds a light in nearly whatever direction: that of a quarter of a sky.
const WIDE: f64 = 4.0;

/// A direction of a light, and its solid angle; 1 of parallel light, whose strength is irradiance.
#[derive(Clone, Copy, Debug)]
struct LightDirection {
    light: usize,
    wi: DVec3,
    solid_angle: f64,
}

/// Irradiance that goes in at a point, W/mm^2.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LetIn {
    /// Of all lights.
    pub all: f64,
    /// Of those that are wide.
    pub wide: f64,
}

/// Directions that stand for all lights of a scene.
pub(super) struct TransmittedLight<'a> {
    scene: &'a Scene,
    directions: Vec<LightDirection>,
    finder: Finder,
}

impl TransmittedLight<'_> {
    /// Directions are drawn from the lights as they are in the first band.
    pub(super) fn new(scene: &Scene, finder: Finder) -> TransmittedLight<'_> {
        let mut directions = Vec::new();
        for (light, source) in scene.lights.iter().enumerate() {
            let count = if source.is_directional() { 1 } else { DIRECTIONS };
            for index in 0..count {
                let along = (f64::from(index) + 0.5) / f64::from(count);
                let u = [along, (f64::from(index) * GOLDEN).fract()];
                let sample = source.sample(0, u);
                let solid_angle = match sample.pdf {
                    Some(pdf) if pdf > 0.0 => 1.0 / (pdf * f64::from(count)),
                    Some(_) => 0.0,
                    None => 1.0,
                };
                directions.push(LightDirection { light, wi: sample.wi, solid_angle });
            }
        }
        TransmittedLight { scene, directions, finder }
    }

    /// Irradiance that goes in at a point of the boundary, per band: the integral of radiance times cosine times smooth
    /// transmittance, the body's own shadow included. A quadrature: it guides walks and is no part of a result.
    pub(super) fn irradiance(&self, at: &Hit) -> Vec<LetIn> {
        let TransmittedLight { scene, directions, finder } = self;
        let mut sums = vec![LetIn::default(); scene.bands()];
        for LightDirection { light, wi, solid_angle } in directions {
            let cosine = wi.dot(at.normal);
            let shadow = Ray { origin: at.point, dir: *wi };
            if cosine <= 0.0 || *solid_angle == 0.0 || scene.shape.occluded(&shadow, Some(at.face)) {
                continue;
            }
            let light = &scene.lights[*light];
            for (band, sum) in sums.iter_mut().enumerate() {
                if *finder == Finder::Walks && light.is_hidden_by(&scene.boundary[band]) {
                    continue;
                }
                let through = match scene.boundary[band] {
                    Boundary::Matched => 1.0,
                    boundary => 1.0 - fresnel(cosine, boundary.eta()).reflectance,
                };
                let radiance = light.sampled_radiance(band, *wi);
                let let_in = radiance * solid_angle * cosine * through;
                sum.all += let_in;
                if light.concentration() <= WIDE {
                    sum.wide += let_in;
                }
            }
        }
        sums
    }
}
