//! Light that reaches a point of the surface, and the part of it that enters and leaves elsewhere. All
//! techniques for choosing the point share this code.

use super::choice::{choose_light, light_shares};
use super::{Anomaly, Cost, Scores};
use crate::geometry::{Hit, Ray};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::optics::fresnel::fresnel;
use crate::scene::Scene;

/// Draws one light of a scene, and a direction from it.
#[derive(Debug)]
pub(super) struct Illumination {
    /// Probability of each light, `[band][light]`.
    shares: Vec<Vec<f64>>,
}

/// A direction from one light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    pub light: usize,
    /// Unit direction towards the light.
    pub wi: DVec3,
    /// Radiance over the density of light and direction, W/mm^2.
    pub value: f64,
}

impl Illumination {
    pub(super) fn new(scene: &Scene) -> Illumination {
        Illumination { shares: light_shares(scene) }
    }

    /// One light in proportion to its strength (`u[0]`), a direction from it; `None` where no light
    /// shines.
    #[inline]
    pub(super) fn draw(&self, scene: &Scene, band: usize, u: [f64; 3]) -> Option<Arrival> {
        let (light, choice) = choose_light(&self.shares[band], u[0])?;
        let sample = scene.lights[light].sample(band, [u[1], u[2]]);
        let value = sample.radiance / (choice * sample.pdf.unwrap_or(1.0));
        Some(Arrival { light, wi: sample.wi, value })
    }
}

/// Light that goes through the boundary from outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entrance {
    /// Between the normal and the direction to the light.
    pub cos: f64,
    /// Between the normal and the direction inside, positive.
    pub cos_inside: f64,
    /// Fresnel transmittance into the body, T12.
    pub transmittance: f64,
    /// Unit direction of travel inside.
    pub dir: DVec3,
}

impl Entrance {
    /// For light from `wi`, with the cosine and the transmittance of the shading normal. `None` from
    /// below, or where the light is above one of the two normals and below the other, which is counted.
    #[inline]
    pub(super) fn at(hit: &Hit, wi: DVec3, eta: f64, scores: &mut Scores) -> Option<Entrance> {
        let frame = Frame::about(hit.shading_normal);
        let local = frame.to_local(wi);
        let [geometric, shading] = [wi.dot(hit.normal) > 0.0, local.z > 0.0];
        if geometric != shading {
            scores.note(Anomaly::WrongSide);
        }
        if !(geometric && shading) {
            return None;
        }
        let surface = fresnel(local.z, eta);
        if surface.cos_t == 0.0 {
            return None; // total reflection, of a body that is optically thinner than what is around it
        }
        let dir = frame.to_world(DVec3::new(-local.x / eta, -local.y / eta, -surface.cos_t));
        let transmittance = 1.0 - surface.reflectance;
        Some(Entrance { cos: local.z, cos_inside: surface.cos_t, transmittance, dir })
    }

    /// The same where nothing is between the point and the light.
    #[inline]
    pub(super) fn lit(
        scene: &Scene,
        hit: &Hit,
        wi: DVec3,
        eta: f64,
        scores: &mut Scores,
    ) -> Option<Entrance> {
        let entrance = Entrance::at(hit, wi, eta, scores)?;
        scores.count(Cost::ShadowRays);
        let shadow_ray = Ray { origin: hit.point, dir: wi };
        (!scene.shape.occluded(&shadow_ray, Some(hit.face))).then_some(entrance)
    }
}

/// Notes on parallel light that every walk lacks at a matched boundary.
pub(super) fn unscattered_notes(scene: &Scene) -> impl Iterator<Item = String> {
    let is_matched = scene.boundary.contains(&Boundary::Matched);
    let parallel = scene.lights.iter().filter(move |light| light.is_directional() && is_matched);
    parallel.map(|light| {
        format!(
            "no path from a sensor follows directional light `{}` straight through the matched body: unscattered \
             light (class surface) is excluded from this estimator's result",
            light.name
        )
    })
}
