//! Single scattering along the refracted camera ray (Jensen, Marschner, Levoy & Hanrahan 2001, eq. 6), for models that
//! leave it out.
//!
//! Inside, the radiance that arrives at the exit along the refracted ray is
//!   L = int_0^t_max sigma_s e^(-sigma_t t) int p(w12 . wo') L'(w12) dw12 dt,
//! and of L' the part that comes straight through the boundary is T12 eta^2 L_i e^(-sigma_t s'), s' being the way from
//! the boundary. On its own way out L loses eta^2 again. So, in directions outside, where lights are sampled,
//!   dw12 = cos_i / (eta^2 cos_i') dw_i
//!   L_o / T21 = int int sigma_s e^(-sigma_t (t + s')) p T12 L_i cos_i / (eta^2 cos_i') dw_i dt.
//! (Taken over directions outside without that factor, eq. 6 is too bright by eta^2 cos_i' / cos_i.) On a half-space
//! the integral over t is
//!   f L_i cos_i,   f = albedo T12 p / (eta^2 (mu_i' + mu_o')).
//!
//! Distance t is drawn from sigma_t e^(-sigma_t t), so that the weight is the albedo. Where light enters is taken as the
//! source does: on the straight line from the vertex to the light, at distance s, from which the refracted way is
//! estimated as s' = s cos_i / cos_i'. That is exact on a plane and at a matched boundary, an approximation elsewhere. A ray
//! that leaves the body before t carries nothing, and paths that are reflected inside are no part of the term. T21 is left
//! out: the camera path was refracted with that probability.

use super::emergence::{Emergence, Skin};
use super::illumination::{Entrance, Illumination};
use super::{Anomaly, Cost, Scores, TransportClass};
use crate::geometry::{Ray, Side};
use crate::math::DVec3;
use crate::sampling::distance::{sample_exponential, transmittance};
use crate::sampling::stream::Stream;

/// Scores the term once per emergence and band.
pub(super) fn score_single(
    skin: &Skin,
    illumination: &Illumination,
    emergence: &Emergence<'_>,
    stream: &mut Stream,
    scores: &mut Scores,
) {
    let u = stream.draw();
    let u_light = stream.draw3();
    let shape = &skin.scene.shape;
    let ray = Ray { origin: emergence.exit.point, dir: emergence.dir };
    scores.count(Cost::Rays);
    let far_end = shape.intersect(&ray, Side::Inside, Some(emergence.face), f64::INFINITY);
    let t_max = far_end.map_or(f64::INFINITY, |hit| hit.t);
    for (&band, throughput) in emergence.bands.iter().zip(emergence.throughput) {
        let t = sample_exponential(skin.scene.medium[band].sigma_t, u);
        if t >= t_max {
            continue;
        }
        scores.count(Cost::MediumEvents);
        let vertex = ray.at(t);
        if let Some((light, value)) = scattered(skin, illumination, emergence, band, vertex, u_light, scores) {
            scores.add(emergence.slot, band, TransportClass::Single, light, throughput * value);
        }
    }
}

/// Light and its part that a vertex on the refracted ray scatters along it, the way to the exit left out.
fn scattered(
    skin: &Skin,
    illumination: &Illumination,
    emergence: &Emergence<'_>,
    band: usize,
    vertex: DVec3,
    u: [f64; 3],
    scores: &mut Scores,
) -> Option<(usize, f64)> {
    let scene = &*skin.scene;
    let arrival = illumination.draw(scene, band, u)?;
    let to_light = Ray { origin: vertex, dir: arrival.wi };
    scores.count(Cost::Rays);
    let Some(hit) = scene.shape.intersect(&to_light, Side::Inside, None, f64::INFINITY) else {
        if scene.shape.bounds().is_some() {
            scores.note(Anomaly::LostRay);
        }
        return None; // deeper and deeper into a half-space
    };
    let entrance = Entrance::lit(scene, &hit, arrival.wi, emergence.eta, scores)?;
    let medium = &scene.medium[band];
    let way = hit.t * entrance.cos / entrance.cos_inside;
    let solid_angle = entrance.cos / (emergence.eta * emergence.eta * entrance.cos_inside);
    let phase = medium.phase.pdf(-entrance.dir.dot(emergence.dir));
    let through = entrance.transmittance * transmittance(medium.sigma_t, way) * solid_angle;
    Some((arrival.light, medium.albedo * phase * through * arrival.value))
}
