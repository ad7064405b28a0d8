//! Analog tracing from the lights, and from a medium that emits, into sensors of finite extent.
//!
//! A photon draws a light, a direction from it and a place, and follows the light: it is reflected or
//! refracted at the boundary, flies distances of density sigma_t exp(-sigma_t t), is absorbed with
//! probability 1 - albedo at every scattering event or turned by the phase function, and enters again
//! where a body is not convex, until it leaves for good. Then the sensor receives it
//! ([`Sensor::receive`](crate::scene::Sensor::receive)). No connection to a light or to the sensor is
//! made, so it samples every boundary under every light, including parallel light through a smooth boundary,
//! which paths from the sensor cannot find; in exchange it needs a sensor that photons can hit. Its walk is
//! implemented independently of the path tracer, so that an error in one of them shows as a difference.
//!
//! Power of a photon. Light of radiance L(w) from directions w towards it, drawn with density p(w) from
//! a light that was chosen with probability P, carries in one of N photons
//!   finite body     L / (p P N) * pi R^2: starting points are uniform on the disc of the bounding
//!                   sphere's radius R across the direction, through which all light that can meet
//!                   the body comes
//!   planar face     L / (p P N) * |cos|: power per area of the face on which the light shines, every
//!                   point of which is alike; it comes in at the origin of the face
//! with the irradiance in place of L / p for parallel light. Photons that miss the body score nothing:
//! light that has not met the body is not scored.
//!
//! Emission. A body that emits epsilon per length, in every direction, sends out epsilon dV dw. Lines of
//! uniform direction through points that are uniform on the disc across it cover dV dw = dA dw ds, so a
//! photon of the medium draws such a line, starts uniformly on the parts of it inside the body, l mm
//! together, flies along it, and carries
//!   finite body     epsilon 4 pi * pi R^2 * l / (P N); nothing where the line misses the body
//!   slab            epsilon 4 pi * d / (P N) per area, its depth uniform over the thickness d
//! which is power inside: no index enters. P is in proportion to power: of lights that through the disc
//! of area pi R^2 (or per area of a face), of the medium 4 pi epsilon V (or 4 pi epsilon d).
//!
//! At the boundary. Power flows from direction a (towards where the photon came from) into b, drawn with
//! the density pdf(b | a) of [`Boundary::sample`] for wo = a. Its weight is f(b; a) |cos_b| / pdf(b |
//! a), f(wo; wi) being the value of radiance's BSDF, which obeys f(b; a) / n_b^2 = f(a; b) / n_a^2. The
//! weight that the boundary reports is f(a; b) |cos_b| / pdf(b | a) = G1(b) (n_a / n_b)^2, so that of
//! the photon is
//!   f(b; a) / f(a; b) * G1(b) (n_a / n_b)^2 = G1(b):
//! what facets hide is lost, and radiance's squared index is undone. At a smooth boundary it is 1.
//!
//! This holds where the boundary sees the true normal. With an interpolated normal the BSDF times the
//! cosine to that normal is no longer reciprocal (Veach 1997, 5.3): light and camera transport become
//! two different models, and this estimator's is called biased, since the camera's is what pictures
//! show.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::choice::{choose_light, source_shares};
use super::crossing::{other, radiance_scale};
use super::{
    Anomaly, Bias, Cost, Estimator, EstimatorKind, History, Scores, Sensors, Serves, read_options,
};
use crate::error::{Error, Result};
use crate::geometry::{BoundingSphere, FaceId, Hit, Ray, Shape, Side};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::{Boundary, Event};
use crate::optics::medium::Medium;
use crate::sampling::discrete::choose_share;
use crate::sampling::distance::sample_exponential;
use crate::sampling::stream::{PassKey, Purpose, Stream};
use crate::sampling::warp::{pdf_cap, square_to_cap};
use crate::scene::Scene;
use crate::scene::sensor::{PathMeasure, SensorClass};

/// Options of `light_trace`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightTraceOptions {
    /// Photons whose sum is one pass; by default as many as the sensor has rays.
    #[schemars(range(min = 1, max = 1073741824))]
    pub paths: Option<usize>,
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct LightTracer {
    scene: Arc<Scene>,
    /// Photons per band and pass.
    photons: usize,
    bounds: Option<BoundingSphere>,
    /// Per band: probability of choosing each light, and after them the medium where it emits.
    choice: Vec<Vec<f64>>,
}

impl LightTracer {
    /// `light_trace` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "light_trace",
        doc: "analog tracing from the lights, into `flux`, `rings`, `path_length` or `acceptance_sr`; unbiased at true normals",
        serves: Serves { sensors: Sensors::Receiving, emission: true, ..Serves::ALL },
        options_schema: || schemars::schema_for!(LightTraceOptions),
        build: |options, scene| {
            let LightTraceOptions { paths } = read_options(options)?;
            Ok(Box::new(LightTracer::new(scene, paths)?))
        },
    };

    /// For a scene; `photons` per band and pass, as many as the sensor has rays without it.
    ///
    /// # Errors
    /// A scene that it does not serve: photons hit no single point or direction; a sensor whose unit
    /// does not fit the body; no photons; emission of infinite power, or that never ends.
    pub fn new(scene: Arc<Scene>, photons: Option<usize>) -> Result<LightTracer> {
        LightTracer::KIND.check(&scene)?;
        let bounds = scene.shape.bounds();
        if !scene.sensor.receives(bounds.is_some()) {
            return Err(Error::input_help(
                "light_trace: the sensor and the body do not fit",
                "`rings` and the `flux` of faces need a half-space or slab; other `flux`, `path_length` and `acceptance_sr` a \
                 finite body",
            ));
        }
        let photons = photons.unwrap_or(scene.sensor.rays_per_pass());
        if photons == 0 {
            return Err(Error::input_help(
                "light_trace: `paths` is 0",
                "trace at least one photon a pass",
            ));
        }
        let emitting = if scene.emits() { Some(emitting_length(&scene, bounds)?) } else { None };
        Ok(LightTracer { bounds, photons, choice: source_shares(&scene, emitting), scene })
    }
}

impl Estimator for LightTracer {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        for &band in bands {
            for index in 0..self.photons {
                Photon::trace(self, band, index, key, scores);
            }
        }
    }

    fn bias(&self) -> Bias {
        let interpolated = matches!(&*self.scene.shape, Shape::Mesh(mesh) if mesh.normals().is_some());
        if interpolated && self.scene.boundary.iter().any(|b| *b != Boundary::Matched) {
            Bias::Biased(
                "at interpolated normals light from the lights and light traced from the sensor are two \
                 models (Veach 1997, 5.3); use flat normals to compare them"
                    .into(),
            )
        } else {
            Bias::Unbiased
        }
    }
}

/// Emitted power over emission and over the power of a sky of radiance 1: the mean length of a ray through
/// the sphere, or of one along the normal through the slab, inside the body.
fn emitting_length(scene: &Scene, bounds: Option<BoundingSphere>) -> Result<f64> {
    let is_trap = |(boundary, medium): (&Boundary, &Medium)| {
        matches!(boundary, Boundary::Smooth { eta } if *eta > 1.0) && medium.sigma_t == 0.0
    };
    if scene.boundary.iter().zip(&scene.medium).any(is_trap) {
        return Err(Error::input_help(
            "light_trace: without extinction, light that the medium emits is reflected inside a smooth boundary \
             for ever",
            "let the medium absorb a little, or use path",
        ));
    }
    match (&*scene.shape, scene.shape.volume().zip(bounds)) {
        (_, Some((volume, bounds))) => {
            Ok(volume / (std::f64::consts::PI * bounds.radius * bounds.radius))
        }
        (Shape::Slab { thickness }, None) => Ok(*thickness),
        _ => Err(Error::input_help(
            "light_trace: a half-space that emits has infinite power",
            "use path, or a slab",
        )),
    }
}

/// Part of a body's size by which rounding may put a medium vertex outside its bounding sphere.
const ROUNDING: f64 = 1e-9;

/// State of one photon.
struct Photon<'a> {
    scene: &'a Scene,
    bounds: Option<BoundingSphere>,
    boundary: Boundary,
    medium: Medium,
    band: usize,
    /// Index of its light; the number of lights stands for the medium's emission.
    light: usize,
    ray: Ray,
    from: Option<FaceId>,
    power: f64,
    history: History,
    /// The score of a sensor of path lengths.
    measure: PathMeasure,
    stream: Stream,
    scores: &'a mut Scores,
}

/// Where photons towards -`toward` start, and the factor from radiance over density to their power: `u`
/// places them. `None` where this light cannot meet the body (a planar face from behind or along it).
#[inline]
fn start(
    shape: &Shape,
    bounds: Option<BoundingSphere>,
    toward: DVec3,
    u: [f64; 2],
) -> Option<(Ray, f64)> {
    let dir = -toward;
    match (shape, bounds) {
        (_, Some(bounds)) => {
            Some((bounds.beam(toward, u), std::f64::consts::PI * bounds.radius * bounds.radius))
        }
        (Shape::Slab { thickness }, None) if toward.z < 0.0 => {
            let point = DVec3::new(0.0, 0.0, -thickness);
            Some((Ray { origin: point + *thickness * toward, dir }, -toward.z))
        }
        (Shape::Slab { .. } | Shape::HalfSpace, None) if toward.z > 0.0 => {
            let reach = if let Shape::Slab { thickness } = shape { *thickness } else { 1.0 };
            Some((Ray { origin: reach * toward, dir }, toward.z))
        }
        _ => None,
    }
}

/// Where a photon starts that the medium emits along `dir`, and the factor from emission over density to
/// its power: `place` places its line, `u` the start on the line. `None` where the line misses the body.
fn start_inside(
    shape: &Shape,
    bounds: Option<BoundingSphere>,
    dir: DVec3,
    place: [f64; 2],
    u: f64,
    scores: &mut Scores,
) -> Option<(Ray, f64)> {
    let Some(bounds) = bounds else {
        let Shape::Slab { thickness } = shape else { return None };
        return Some((Ray { origin: DVec3::new(0.0, 0.0, -thickness * u), dir }, *thickness));
    };
    let mut chords = Vec::new();
    let (mut ray, mut from) = (bounds.beam(-dir, place), None);
    scores.count(Cost::Rays);
    while let Some(enters) = shape.intersect(&ray, Side::Outside, from, f64::INFINITY) {
        ray.origin = enters.point;
        scores.count_many(Cost::Rays, 2);
        let leaves = shape.intersect(&ray, Side::Inside, Some(enters.face), f64::INFINITY);
        let Some(leaves) = leaves else {
            scores.note(Anomaly::LostRay);
            return None;
        };
        chords.push((enters.point, leaves.t));
        (ray.origin, from) = (leaves.point, Some(leaves.face));
    }
    let length: f64 = chords.iter().map(|(_, length)| length).sum();
    let (chord, _) = choose_share(chords.iter().map(|(_, own)| own / length), u)?;
    let before: f64 = chords[..chord].iter().map(|(_, length)| length).sum();
    let (point, own) = chords[chord];
    let origin = point + dir * (u * length - before).clamp(0.0, own);
    Some((Ray { origin, dir }, std::f64::consts::PI * bounds.radius * bounds.radius * length))
}

impl<'a> Photon<'a> {
    /// Traces photon `index` of a pass; returns how many numbers its walk drew.
    fn trace(
        tracer: &'a LightTracer,
        band: usize,
        index: usize,
        key: &PassKey,
        scores: &'a mut Scores,
    ) -> u64 {
        let scene = &*tracer.scene;
        let mut emission = key.stream(index as u64, Purpose::Light);
        let [u, v, w] = emission.draw3();
        let place = emission.draw2();
        scores.count(Cost::Paths);
        let Some((light, choice)) = choose_light(&tracer.choice[band], u) else { return 0 };
        let photon = |ray: Ray, power: f64, scores: &'a mut Scores| Photon {
            scene,
            bounds: tracer.bounds,
            boundary: scene.boundary[band],
            medium: scene.medium[band],
            band,
            light,
            ray,
            from: None,
            power: power / tracer.photons as f64,
            history: History::default(),
            measure: scene.sensor.measure(),
            stream: key.stream(index as u64, Purpose::Walk),
            scores,
        };
        let Some(light) = scene.lights.get(light) else {
            let dir = square_to_cap(2.0, [v, w]);
            let start = start_inside(&scene.shape, tracer.bounds, dir, place, emission.draw(), scores);
            let Some((ray, extent)) = start else { return 0 };
            let emitted = scene.medium[band].emission / pdf_cap(2.0);
            let mut photon = photon(ray, emitted / choice * extent, scores);
            return match photon.walk_inside() {
                Some(hit) => photon.run(hit, Side::Inside),
                None => photon.stream.draws(),
            };
        };
        let sample = light.sample(band, [v, w]);
        let Some((ray, extent)) = start(&scene.shape, tracer.bounds, sample.wi, place) else { return 0 };
        scores.count(Cost::Rays);
        let Some(hit) = scene.shape.intersect(&ray, Side::Outside, None, f64::INFINITY) else {
            return 0; // light that has not met the body is not scored
        };
        let emitted = sample.radiance / sample.pdf.unwrap_or(1.0);
        photon(ray, emitted / choice * extent, scores).run(hit, Side::Outside)
    }

    /// Runs from a first hit, met from `side`, until the photon is absorbed or leaves.
    fn run(mut self, hit: Hit, side: Side) -> u64 {
        let mut side = side;
        let mut hit = hit;
        loop {
            let Some(next_side) = self.cross(&hit, side) else { return self.stream.draws() };
            side = next_side;
            let next = match side {
                Side::Inside => self.walk_inside(),
                Side::Outside => self.fly_outside(),
            };
            match next {
                Some(next) => hit = next,
                None => return self.stream.draws(),
            }
        }
    }

    /// Flies and scatters in the medium until the photon meets the boundary or is absorbed.
    fn walk_inside(&mut self) -> Option<Hit> {
        loop {
            let t = sample_exponential(self.medium.sigma_t, self.stream.draw());
            self.scores.count(Cost::Rays);
            match self.scene.shape.end_of_flight(&self.ray, self.from, t) {
                Some(hit) => {
                    self.measure.fly(&self.ray, hit.t);
                    return Some(hit);
                }
                None if t == f64::INFINITY => {
                    // Without extinction a half-space swallows the photon; a finite body lets none go.
                    if self.bounds.is_some() {
                        self.scores.note(Anomaly::LostRay);
                    }
                    return None;
                }
                None => self.scatter(t)?,
            }
        }
    }

    /// A scattering event at distance `t`; `None` where the photon ends.
    fn scatter(&mut self, t: f64) -> Option<()> {
        self.measure.fly(&self.ray, t);
        self.ray.origin = self.ray.at(t);
        self.from = None;
        if let Some(bounds) = self.bounds
            && (self.ray.origin - bounds.center).length_squared()
                > bounds.radius * bounds.radius * (1.0 + ROUNDING)
        {
            self.scores.note(Anomaly::LostRay);
            return None;
        }
        self.scores.count(Cost::MediumEvents);
        if self.stream.draw() >= self.medium.albedo {
            return None;
        }
        self.history.scatter();
        self.ray.dir = self.medium.phase.sample(self.ray.dir, self.stream.draw2());
        Some(())
    }

    /// Continues outside; the sensor receives the photon where nothing occludes it.
    fn fly_outside(&mut self) -> Option<Hit> {
        self.scores.count(Cost::Rays);
        let hit = self.scene.shape.intersect(&self.ray, Side::Outside, self.from, f64::INFINITY);
        // Emission has come in nowhere: for rings it leaves as far away as can be.
        let emitted = self.light == self.scene.lights.len();
        let out = match self.scene.sensor.class() {
            SensorClass::Entries if emitted => Ray { origin: DVec3::INFINITY, ..self.ray },
            _ => self.ray,
        };
        if hit.is_none()
            && let Some((slot, factor)) = self.scene.sensor.receive(&out)
        {
            let (value, class) = (self.power * factor, self.history.class());
            for (slot, times) in self.measure.slots(slot) {
                self.scores.add(slot, self.band, class, self.light, times * value);
            }
        }
        hit
    }

    /// Meets the boundary from `side`; returns the side on which the photon continues, `None` where it
    /// ends.
    fn cross(&mut self, hit: &Hit, side: Side) -> Option<Side> {
        self.from = Some(hit.face);
        self.measure.meet(side);
        self.ray.origin = hit.point;
        if self.boundary == Boundary::Matched {
            return Some(other(side));
        }
        self.scores.count(Cost::BoundaryEvents);
        let frame = Frame::about(hit.shading_normal);
        let came_from = frame.to_local(-self.ray.dir);
        if (came_from.z > 0.0) != (side == Side::Outside) {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        let sample = self.boundary.sample(came_from, self.stream.draw3())?;
        let dir = frame.to_world(sample.wi);
        let next_side = if sample.event == Event::Refract { other(side) } else { side };
        if (dir.dot(hit.normal) > 0.0) != (next_side == Side::Outside) {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        if sample.event == Event::Reflect && side == Side::Inside {
            self.history.reflect_internally();
        }
        self.power *= sample.weight * radiance_scale(side, next_side, &self.boundary);
        self.ray.dir = dir;
        Some(next_side)
    }
}

#[cfg(test)]
#[path = "light_trace_tests.rs"]
mod tests;
