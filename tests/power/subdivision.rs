//! Whole paths with subdivision next-event estimation, and an analog light tracer to compare them with:
//! both the test's own. Where a path ends in two scatterings and an exit, `connection`'s four techniques
//! share it; the rest has interface and light samples alone. Survival at every medium vertex is albedo,
//! so that the throughput on arrival at a vertex is albedo times what came in through the surface.

use std::sync::Arc;

use scatterproof::estimators::{Anomaly, Cost, Estimator, History, Scores};
use scatterproof::geometry::{FaceId, Hit, Ray, Side};
use scatterproof::math::{DVec3, Frame};
use scatterproof::sampling::distance::sample_exponential;
use scatterproof::sampling::stream::{PassKey, Purpose, Stream};
use scatterproof::sampling::warp::square_to_disc;
use scatterproof::scene::sensor::BodyFlux;
use scatterproof::scene::{Scene, Sensor};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::alone::{Technique, TwoEnds};
use super::connection::{Model, Vertex};
use super::defects::Defect;
use super::surface::{Meeting, meet, meet_value};

/// Options of both estimators.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FluxOptions {
    /// Of the paths that leave by two scatterings, seen from the sensor, only those are scored whose
    /// flight between them is longer than this, mm: see `last_two`.
    pub beyond_mm: f64,
}

/// The estimator, for one scene.
pub struct Subdivision {
    pub scene: Arc<Scene>,
    pub options: FluxOptions,
    pub defect: Defect,
}

impl Estimator for Subdivision {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        for &band in bands {
            for index in 0..self.scene.sensor.rays_per_pass() {
                self.trace(band, index, key, scores);
            }
        }
    }
}

/// State of a path.
struct Path<'a> {
    ends: TwoEnds<'a>,
    ray: Ray,
    from: Option<FaceId>,
    /// Throughput, and density of the last direction where lights were sampled too.
    throughput: f64,
    competing: Option<f64>,
    /// The last two medium vertices since the surface, the newer one last.
    vertices: [Option<Vertex>; 2],
    history: History,
}

impl Subdivision {
    fn trace(&self, band: usize, index: usize, key: &PassKey, scores: &mut Scores) {
        let mut sensor = key.stream(index as u64, Purpose::Sensor);
        let ([a, b], [c, d]) = (sensor.draw2(), sensor.draw2());
        let seen = self.scene.sensor.ray(index, [a, b, c, d]);
        scores.count(Cost::Paths);
        let history = History::default();
        let path = Path {
            ends: TwoEnds {
                model: Model::of(&self.scene, band, self.defect),
                technique: Technique::All,
                beyond: self.options.beyond_mm,
                start: Vertex { point: seen.ray.origin, travel: seen.ray.dir },
                walk: key.stream(index as u64, Purpose::Walk),
                lights: key.stream(index as u64, Purpose::Light),
                slot: seen.slot,
                weight: 0.0,
                class: history.class(),
                scores,
            },
            ray: seen.ray,
            from: None,
            throughput: seen.weight,
            competing: None,
            vertices: [None; 2],
            history,
        };
        path.run();
    }
}

impl Path<'_> {
    fn run(mut self) -> Option<()> {
        let shape = &self.ends.model.scene.shape;
        let mut side = Side::Outside;
        let mut hit = shape.intersect(&self.ray, side, None, f64::INFINITY)?;
        loop {
            let is_end = side == Side::Inside && self.vertices[0].is_some();
            let meeting = self.cross(&hit, side, is_end)?;
            (self.ray, self.from) = (Ray { origin: hit.point, dir: meeting.dir }, Some(hit.face));
            if meeting.crosses {
                side = if side == Side::Inside { Side::Outside } else { Side::Inside };
            }
            let left = (is_end && side == Side::Outside).then_some(self.vertices);
            self.vertices = [None; 2];
            hit = match side {
                Side::Inside => self.wander()?,
                Side::Outside => match shape.intersect(&self.ray, side, self.from, f64::INFINITY) {
                    Some(again) => again,
                    None => {
                        self.reach_lights(&hit, left);
                        return None;
                    }
                },
            };
        }
    }

    /// Meets the surface: samples a light, then continues.
    fn cross(&mut self, hit: &Hit, side: Side, is_end: bool) -> Option<Meeting> {
        let model = self.ends.model;
        let wo = -self.ray.dir;
        self.ends.scores.count(Cost::BoundaryEvents);
        self.ends.class = self.history.class();
        if is_end {
            self.aim();
            if let Some(x_j) = self.vertices[1]
                && model.can_draw(super::connection::LIGHT)
            {
                self.ends.join_a_light(x_j.point, hit);
            }
        } else if super::connection::interface(model.boundary).1.is_some() {
            let (light, to_light, radiance, p_light) = self.ends.light();
            if let Some((value, pdf)) = meet_value(model.boundary, hit, wo, to_light)
                && model.is_lit(hit, to_light, self.ends.scores)
            {
                let own = if model.scene.lights[light].is_directional() { 0.0 } else { pdf };
                self.add(light, value * radiance / (p_light + own));
            }
        }
        let Some(meeting) = meet(model.boundary, hit, wo, self.ends.walk.draw3()) else {
            self.ends.scores.note(Anomaly::WrongSide);
            return None;
        };
        if !meeting.crosses && side == Side::Inside {
            self.history.reflect_internally();
        }
        self.throughput *= meeting.weight;
        self.competing = meeting.pdf;
        Some(meeting)
    }

    /// Points `ends` at the last but one vertex.
    fn aim(&mut self) {
        if let Some(start) = self.vertices[0] {
            self.ends.start = start;
            self.ends.weight = self.throughput * self.ends.model.medium.albedo;
        }
    }

    /// Flies and scatters in the medium until it meets the surface.
    fn wander(&mut self) -> Option<Hit> {
        let medium = self.ends.model.medium;
        loop {
            let t = sample_exponential(medium.sigma_t, self.ends.walk.draw());
            self.ends.scores.count(Cost::Rays);
            let shape = &self.ends.model.scene.shape;
            if let Some(hit) = shape.intersect(&self.ray, Side::Inside, self.from, t) {
                return Some(hit);
            }
            self.ends.scores.count(Cost::MediumEvents);
            (self.ray.origin, self.from) = (self.ray.at(t), None);
            self.history.scatter();
            let vertex = Vertex { point: self.ray.origin, travel: self.ray.dir };
            self.vertices = [self.vertices[1], Some(vertex)];
            // What the call finds has one more vertex than the path so far.
            let mut found = self.history;
            found.scatter();
            (self.ends.start, self.ends.class) = (vertex, found.class());
            self.ends.weight = self.throughput * medium.albedo;
            self.ends.call();
            if self.ends.walk.draw() >= medium.albedo {
                return None;
            }
            self.ray.dir = medium.phase.sample(self.ray.dir, self.ends.walk.draw2());
        }
    }

    /// The path left by `exit`, after two vertices where there are such, and meets nothing more.
    fn reach_lights(&mut self, exit: &Hit, left: Option<[Option<Vertex>; 2]>) {
        self.ends.class = self.history.class();
        if let Some([Some(start), Some(x_j)]) = left {
            // The walk's throughput has the interface's weight on top of what came before.
            self.ends.start = start;
            self.ends.join_every_light(x_j.point, exit, self.ray.dir, false);
            return;
        }
        let model = self.ends.model;
        for (light, source) in model.scene.lights.iter().enumerate() {
            let (radiance, pdf) = source.eval(model.band, self.ray.dir);
            if radiance > 0.0 {
                let weight = self.competing.map_or(1.0, |own| own / (own + model.choice() * pdf));
                self.add(light, weight * radiance);
            }
        }
    }

    fn add(&mut self, light: usize, value: f64) {
        let ends = &mut self.ends;
        let value = self.throughput * value;
        ends.scores.add(ends.slot, ends.model.band, ends.class, light, value);
    }
}

/// Photons from the lights: everything is drawn as nature draws it, except the facets' shadowing, which
/// weighs (light has no eta^2: that is radiance's).
pub struct Photons {
    pub scene: Arc<Scene>,
    pub options: FluxOptions,
}

impl Estimator for Photons {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        for &band in bands {
            for index in 0..self.scene.sensor.rays_per_pass() {
                let mut stream = key.stream(index as u64, Purpose::Walk);
                scores.count(Cost::Paths);
                self.trace(band, &mut stream, scores);
            }
        }
    }
}

impl Photons {
    /// One photon: power = radiance / density times the disc of the body's sphere across the direction.
    fn trace(&self, band: usize, stream: &mut Stream, scores: &mut Scores) -> Option<()> {
        let scene = &*self.scene;
        let Sensor::BodyFlux(BodyFlux { bounds, frame, bins, paths }) = &scene.sensor else {
            return None;
        };
        let [u, v, w] = stream.draw3();
        let light = ((u * scene.lights.len() as f64) as usize).min(scene.lights.len() - 1);
        let sample = scene.lights[light].sample(band, [v, w]);
        let disc = std::f64::consts::PI * bounds.radius * bounds.radius;
        let choice = 1.0 / scene.lights.len() as f64;
        let mut power = sample.radiance * disc / (choice * sample.pdf.unwrap_or(1.0));
        power /= (bins * paths) as f64;
        let across = Frame::about(sample.wi);
        let [x, y] = square_to_disc(stream.draw2());
        let origin = bounds.center + bounds.radius * (2.0 * sample.wi + x * across.s + y * across.t);
        let mut ray = Ray { origin, dir: -sample.wi };
        let mut history = History::default();
        // Events since the entry, and whether the first was a scattering: with the second it makes the
        // two by which a path from the sensor leaves.
        let (mut events, mut begins_in_medium) = (0, false);
        let mut side = Side::Outside;
        let mut hit = scene.shape.intersect(&ray, side, None, f64::INFINITY)?;
        loop {
            let meeting = meet(scene.boundary[band], &hit, -ray.dir, stream.draw3())?;
            (ray, power) = (Ray { origin: hit.point, dir: meeting.dir }, power * meeting.photon_weight);
            match (side, meeting.crosses) {
                (_, true) => side = if side == Side::Inside { Side::Outside } else { Side::Inside },
                (Side::Inside, false) => {
                    history.reflect_internally();
                    events += 1;
                }
                (Side::Outside, false) => {}
            }
            let mut from = Some(hit.face);
            hit = match side {
                Side::Outside => match scene.shape.intersect(&ray, side, from, f64::INFINITY) {
                    Some(again) => again,
                    None => break,
                },
                Side::Inside => loop {
                    let medium = &scene.medium[band];
                    let t = sample_exponential(medium.sigma_t, stream.draw());
                    if let Some(hit) = scene.shape.intersect(&ray, side, from, t) {
                        break hit;
                    }
                    if stream.draw() >= medium.albedo {
                        return None;
                    }
                    history.scatter();
                    events += 1;
                    begins_in_medium |= events == 1;
                    if events == 2 && begins_in_medium && t <= self.options.beyond_mm {
                        return None;
                    }
                    ray = Ray { origin: ray.at(t), dir: medium.phase.sample(ray.dir, stream.draw2()) };
                    from = None;
                },
            };
        }
        let mu: DVec3 = frame.to_local(ray.dir);
        let bin = ((0.5 * (mu.z + 1.0) * *bins as f64) as usize).min(bins - 1);
        scores.add(bin, band, history.class(), light, power);
        Some(())
    }
}
