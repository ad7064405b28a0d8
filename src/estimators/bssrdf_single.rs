//! Single scattering along the refracted camera ray (Jensen, Marschner, Levoy & Hanrahan 2001, eq. 6),
//! for models that leave it out.
//!
//! Inside, the radiance that arrives at the exit along the refracted ray is
//!   L = int_0^t_max sigma_s e^(-sigma_t t) int p(w12 . wo') L'(w12) dw12 dt,
//! and the part of L' that comes straight through the boundary is T12 eta^2 L_i e^(-sigma_t s'), where s' is
//! the distance from the boundary. When L leaves the body, it loses eta^2 again. In terms of directions
//! outside, where lights are sampled, this gives
//!   dw12 = cos_i / (eta^2 cos_i') dw_i
//!   L_o / T21 = int int sigma_s e^(-sigma_t (t + s')) p T12 L_i cos_i / (eta^2 cos_i') dw_i dt.
//! (Taken over directions outside without that factor, eq. 6 is too bright by eta^2 cos_i' / cos_i.) On
//! a half-space the integral over t is
//!   f L_i cos_i,   f = albedo T12 p / (eta^2 (mu_i' + mu_o')).
//!
//! Distance t is drawn from sigma_t e^(-sigma_t t), so that the weight is the albedo. Where light enters
//! is taken as the source does: on the straight line from the vertex to the light, at distance s, from
//! which the refracted way is estimated as s' = s cos_i / cos_i'. That is exact on a plane and at a
//! matched boundary, an approximation elsewhere. A ray that leaves the body before t carries nothing,
//! and paths that are reflected inside are no part of the term. T21 is left out: the camera path was
//! refracted with that probability.

use super::emergence::{BssrdfScene, Emergence};
use super::illumination::Entrance;
use super::{Anomaly, Cost, Scores, TransportClass};
use crate::geometry::{Ray, Side};
use crate::math::DVec3;
use crate::sampling::distance::{sample_exponential, transmittance};
use crate::sampling::stream::Stream;

/// Scores the term once per emergence and band, where it is added.
pub(super) fn score_single(
    bssrdf: &BssrdfScene,
    emergence: &Emergence<'_>,
    stream: &mut Stream,
    scores: &mut Scores,
) {
    if !bssrdf.single {
        return;
    }
    let u = stream.draw();
    let u_light = stream.draw3();
    let shape = &bssrdf.scene.shape;
    let ray = Ray { origin: emergence.exit.point, dir: emergence.dir };
    scores.count(Cost::Rays);
    let far_end = shape.intersect(&ray, Side::Inside, Some(emergence.face), f64::INFINITY);
    let t_max = far_end.map_or(f64::INFINITY, |hit| hit.t);
    for (&band, throughput) in emergence.bands.iter().zip(emergence.throughput) {
        let t = sample_exponential(bssrdf.scene.medium[band].sigma_t, u);
        if t >= t_max {
            continue;
        }
        scores.count(Cost::MediumEvents);
        let vertex = ray.at(t);
        if let Some(Scattered { light, entry, value }) =
            scattered(bssrdf, emergence, band, vertex, u_light, scores)
        {
            let slot = bssrdf.scene.sensor.slot_of(emergence.slot, entry);
            scores.add(slot, band, TransportClass::Single, light, throughput * value);
        }
    }
}

/// Contribution of a vertex to the exit.
#[derive(Clone, Copy, Debug)]
struct Scattered {
    light: usize,
    /// Where its light came in, by the refracted way: exact where that is.
    entry: DVec3,
    value: f64,
}

/// Light and its part that a vertex on the refracted ray scatters along it, the way to the exit left
/// out.
fn scattered(
    bssrdf: &BssrdfScene,
    emergence: &Emergence<'_>,
    band: usize,
    vertex: DVec3,
    u: [f64; 3],
    scores: &mut Scores,
) -> Option<Scattered> {
    let scene = &*bssrdf.scene;
    let arrival = bssrdf.illumination.draw(scene, band, u)?;
    let to_light = Ray { origin: vertex, dir: arrival.wi };
    scores.count(Cost::Rays);
    let Some(hit) = scene.shape.leave(&to_light) else {
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
    let entry = vertex - entrance.dir * way;
    let value = medium.albedo * phase * through * arrival.value;
    Some(Scattered { light: arrival.light, entry, value })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::estimators::Layout;
    use crate::geometry::FaceId;
    use crate::geometry::Shape;
    use crate::math::integrate;
    use crate::optics::boundary::Boundary;
    use crate::optics::bssrdf::{Exit, Model, MomentKind, Outgoing};
    use crate::optics::fresnel::fresnel;
    use crate::optics::medium::Medium;
    use crate::optics::phase::HenyeyGreenstein;
    use crate::sampling::distance::pdf_distance_exponential;
    use crate::scene::sensor::Probe;
    use crate::scene::{Emission, Light, Scene, Sensor};

    /// The mean over t, by quadrature, is albedo T12 p cos_i / (eta^2 (mu_i' + mu_o')) on a half-space:
    /// a deterministic look at every factor of a sample.
    #[test]
    fn mean_over_distance_is_the_closed_form() {
        for eta in [1.0, 1.3, 1.5] {
            for toward in [DVec3::Z, DVec3::new(0.8, -0.1, 0.5), DVec3::new(-0.9, 0.3, 0.1)] {
                let wi = toward.normalize();
                let medium = Medium {
                    sigma_t: 3.0,
                    albedo: 0.8,
                    phase: HenyeyGreenstein { g: 0.4 },
                    emission: 0.0,
                };
                let dir = DVec3::new(0.36, 0.48, -0.8);
                let exit = Exit { point: DVec3::new(0.3, 0.2, 0.0), normal: DVec3::Z };
                let sun = Emission::Directional { toward: wi, irradiance: vec![2.0] };
                let sensor =
                    Sensor::Probe(Probe { ray: Ray { origin: DVec3::Z, dir: -DVec3::Z }, paths: 1 });
                let scene = Arc::new(Scene {
                    shape: Arc::new(Shape::HalfSpace),
                    boundary: vec![Boundary::Smooth { eta }],
                    medium: vec![medium],
                    lights: vec![Light { name: "sun".into(), emission: sun }],
                    sensor,
                });
                let mut scores = Scores::new(Layout::new(&scene));
                let model = Model::Classical { moments: MomentKind::Exact, outgoing: Outgoing::Plain };
                let bssrdf = BssrdfScene::new(scene, &model, true, None).expect("a model");
                let emergence = Emergence {
                    exit,
                    face: FaceId(0),
                    dir,
                    eta,
                    bands: &[0],
                    throughput: &[1.0],
                    slot: 0,
                };
                let mut at = |t: f64| {
                    let vertex = exit.point + dir * t;
                    let drawn = scattered(&bssrdf, &emergence, 0, vertex, [0.5; 3], &mut scores);
                    pdf_distance_exponential(3.0, t) * drawn.map_or(0.0, |drawn| drawn.value)
                };
                let mean = integrate(&mut at, 0.0, 15.0, 1e-13).value;
                let surface = fresnel(wi.z, eta);
                let inside = DVec3::new(-wi.x / eta, -wi.y / eta, -surface.cos_t);
                let phase = medium.phase.pdf(-inside.dot(dir));
                let f = medium.albedo * (1.0 - surface.reflectance) * phase
                    / (eta * eta * (surface.cos_t + 0.8));
                let expected = 2.0 * wi.z * f;
                assert!((mean / expected - 1.0).abs() < 1e-9, "{eta} {toward}: {mean} {expected}");
            }
        }
    }
}
