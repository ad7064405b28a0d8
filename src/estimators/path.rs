//! Unidirectional path tracing with MIS between BSDF sampling and light sampling at every exit.
//!
//! A path starts at the sensor and runs against the light. Flights in the medium have the density
//! sigma_t exp(-sigma_t t), so a scattering event weighs albedo; directions follow the phase function;
//! at the boundary the interface draws reflection or refraction. Wherever the path could go straight to
//! a light, a light is also sampled, and both samples of the same direction are weighed by the balance
//! heuristic:
//!   rough boundary    at every surface vertex: interface pdf against light pdf
//!   matched boundary  at every medium vertex: phase pdf times the transmittance to the outside (the
//!                     probability of flying there) against light pdf
//!   smooth boundary   nothing to sample: only the interface can find the refracted direction, so light
//!                     from a single direction is out of its reach (a note says so)
//! One light is chosen per vertex, with probability proportional to its strength; that probability is
//! part of the light pdf, so every pair of (lobe, light) is a MIS class of its own.
//!
//! Unbiased: no cut-off in depth. Roulette, at medium vertices only, divides by its own survival
//! probability, which depends on the albedo and roughness losses alone (never on the eta^2 of radiance,
//! which cancels on the way out).

use std::sync::Arc;

use super::choice::{choose_light, light_shares};
use super::crossing::{other, radiance_scale};
use super::{Anomaly, Cost, Estimator, History, Scores};
use crate::geometry::{BoundingSphere, FaceId, Hit, Ray, Side};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::{Boundary, Density, Event};
use crate::optics::medium::Medium;
use crate::sampling::balance;
use crate::sampling::distance::{sample_exponential, transmittance};
use crate::sampling::stream::{PassKey, Purpose, Stream};
use crate::scene::Scene;

/// When a path is ended by chance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Roulette {
    /// At every scattering event with probability 1 - albedo: the weight never changes.
    Analog,
    /// Only where the path's weight has fallen below this: it survives with probability weight over
    /// threshold and continues with the threshold as weight.
    Below(f64),
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct PathTracer {
    scene: Arc<Scene>,
    roulette: Roulette,
    bounds: Option<BoundingSphere>,
    /// Per band: probability of choosing each light.
    choice: Vec<Vec<f64>>,
}

impl PathTracer {
    /// For a scene.
    pub fn new(scene: Arc<Scene>, roulette: Roulette) -> PathTracer {
        let choice = light_shares(&scene);
        PathTracer { bounds: scene.shape.bounds(), roulette, choice, scene }
    }
}

impl Estimator for PathTracer {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        for &band in bands {
            for index in 0..self.scene.sensor.rays_per_pass() {
                Walk::play(self, band, index, key, scores);
            }
        }
    }

    fn notes(&self) -> Vec<String> {
        let smooth = self.scene.boundary.iter().any(|b| matches!(b, Boundary::Smooth { .. }));
        let parallel = self.scene.lights.iter().filter(|light| light.is_directional());
        parallel
            .filter(|_| smooth)
            .map(|light| {
                format!(
                    "path cannot sample directional light `{}` through a smooth boundary: its share is \
                     missing (exactly 0), not dark",
                    light.name
                )
            })
            .collect()
    }
}

/// Part of a body's size by which rounding may put a medium vertex outside its bounding sphere.
const ROUNDING: f64 = 1e-9;

/// How the path's current direction was drawn, as light sampling sees it.
#[derive(Clone, Copy)]
enum Drawn {
    /// Only this way: by the sensor or a delta lobe.
    Alone,
    /// Also by light sampling, in competition with this density per solid angle.
    Competing(f64),
}

/// One path.
struct Walk<'a> {
    scene: &'a Scene,
    choice: &'a [f64],
    roulette: Roulette,
    bounds: Option<BoundingSphere>,
    boundary: Boundary,
    medium: Medium,
    band: usize,
    slot: usize,
    ray: Ray,
    from: Option<FaceId>,
    throughput: f64,
    /// The throughput without radiance's eta^2: what roulette looks at.
    survival: f64,
    history: History,
    drawn: Drawn,
    stream: Stream,
    light_stream: Stream,
    scores: &'a mut Scores,
}

impl<'a> Walk<'a> {
    /// Plays path `index` of a pass; returns how many numbers its walk drew.
    fn play(
        tracer: &'a PathTracer,
        band: usize,
        index: usize,
        key: &PassKey,
        scores: &'a mut Scores,
    ) -> u64 {
        let scene = &*tracer.scene;
        let mut sensor_stream = key.stream(index as u64, Purpose::Sensor);
        let [a, b] = sensor_stream.draw2();
        let [c, d] = sensor_stream.draw2();
        let start = scene.sensor.ray(index, [a, b, c, d]);
        scores.count(Cost::Paths);
        scores.count(Cost::Rays);
        let Some(hit) = scene.shape.intersect(&start.ray, Side::Outside, None, f64::INFINITY) else {
            return 0; // light that has not met the body is not scored
        };
        let walk = Walk {
            scene,
            choice: &tracer.choice[band],
            roulette: tracer.roulette,
            bounds: tracer.bounds,
            boundary: scene.boundary[band],
            medium: scene.medium[band],
            band,
            slot: start.slot,
            ray: start.ray,
            from: None,
            throughput: start.weight,
            survival: 1.0,
            history: History::default(),
            drawn: Drawn::Alone,
            stream: key.stream(index as u64, Purpose::Walk),
            light_stream: key.stream(index as u64, Purpose::Light),
            scores,
        };
        walk.run(hit)
    }

    /// Runs from a first hit until the path ends.
    fn run(mut self, hit: Hit) -> u64 {
        let mut side = Side::Outside;
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

    /// Flies and scatters in the medium until the path meets the boundary or ends.
    fn walk_inside(&mut self) -> Option<Hit> {
        loop {
            let t = sample_exponential(self.medium.sigma_t, self.stream.draw());
            self.scores.count(Cost::Rays);
            match self.scene.shape.intersect(&self.ray, Side::Inside, self.from, t) {
                Some(hit) => {
                    self.drawn = match self.drawn {
                        Drawn::Competing(pdf) if self.matched() => {
                            Drawn::Competing(pdf * transmittance(self.medium.sigma_t, hit.t))
                        }
                        drawn => drawn,
                    };
                    return Some(hit);
                }
                None if t == f64::INFINITY => {
                    // Without extinction a half-space swallows the path; a finite body lets none go.
                    if self.bounds.is_some() {
                        self.scores.note(Anomaly::LostRay);
                    }
                    return None;
                }
                None => self.scatter(t)?,
            }
        }
    }

    /// A scattering event at distance `t`; `None` where the path ends.
    fn scatter(&mut self, t: f64) -> Option<()> {
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
        self.survive(self.medium.albedo)?;
        self.history.scatter();
        if self.matched() {
            self.connect_from_medium();
        }
        let dir = self.medium.phase.sample(self.ray.dir, self.stream.draw2());
        if self.matched() {
            let pdf = self.medium.phase.pdf(self.ray.dir.dot(dir));
            self.drawn = Drawn::Competing(pdf);
        }
        self.ray.dir = dir;
        Some(())
    }

    /// Multiplies the path's weight by `factor`, or ends the path by roulette.
    #[inline]
    fn survive(&mut self, factor: f64) -> Option<()> {
        match self.roulette {
            Roulette::Analog => (self.stream.draw() < factor).then_some(()),
            Roulette::Below(threshold) => {
                self.throughput *= factor;
                self.survival *= factor;
                let probability = roulette(self.survival, threshold, || self.stream.draw())?;
                self.throughput /= probability;
                self.survival /= probability;
                Some(())
            }
        }
    }

    /// Flies on outside; scores the lights where nothing is in the way.
    fn fly_outside(&mut self) -> Option<Hit> {
        self.scores.count(Cost::Rays);
        let hit = self.scene.shape.intersect(&self.ray, Side::Outside, self.from, f64::INFINITY);
        if hit.is_none() {
            self.score_escape();
        }
        hit
    }

    /// Meets the boundary from `side`; the side the path goes on to, `None` where it ends.
    fn cross(&mut self, hit: &Hit, side: Side) -> Option<Side> {
        self.from = Some(hit.face);
        let wo = -self.ray.dir;
        self.ray.origin = hit.point;
        if self.matched() {
            return Some(other(side)); // direction and competition stay as they are
        }
        self.scores.count(Cost::BoundaryEvents);
        let frame = Frame::about(hit.shading_normal);
        let local = frame.to_local(wo);
        if (local.z > 0.0) != (side == Side::Outside) {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        if !self.boundary.is_delta() {
            self.connect_from_surface(hit, &frame, local);
        }
        let sample = self.boundary.sample(local, self.stream.draw3())?;
        let dir = frame.to_world(sample.wi);
        let next_side = if sample.event == Event::Refract { other(side) } else { side };
        if (dir.dot(hit.normal) > 0.0) != (next_side == Side::Outside) {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        if sample.event == Event::Reflect && side == Side::Inside {
            self.history.reflect_internally();
        }
        self.throughput *= sample.weight;
        self.survival *= sample.weight * radiance_scale(side, next_side, &self.boundary);
        self.ray.dir = dir;
        self.drawn = match sample.density {
            Density::Delta => Drawn::Alone,
            Density::Finite(pdf) => Drawn::Competing(pdf),
        };
        Some(next_side)
    }

    /// Scores every light in the direction of a path that leaves the scene.
    fn score_escape(&mut self) {
        let class = self.history.class();
        for (index, light) in self.scene.lights.iter().enumerate() {
            let (radiance, pdf) = light.eval(self.band, self.ray.dir);
            if radiance > 0.0 {
                let weight = match self.drawn {
                    Drawn::Alone => 1.0,
                    Drawn::Competing(own) => balance(own, self.choice[index] * pdf),
                };
                let value = self.throughput * weight * radiance;
                self.scores.add(self.slot, self.band, class, index, value);
            }
        }
    }

    /// Samples a light from a rough surface vertex.
    fn connect_from_surface(&mut self, hit: &Hit, frame: &Frame, wo: DVec3) {
        let u = self.light_stream.draw3();
        let Some((index, choice)) = choose_light(self.choice, u[0]) else { return };
        let sample = self.scene.lights[index].sample(self.band, [u[1], u[2]]);
        let wi = frame.to_local(sample.wi);
        let outside = sample.wi.dot(hit.normal) > 0.0;
        if outside != (wi.z > 0.0) {
            self.scores.note(Anomaly::WrongSide);
            return;
        }
        if !outside || sample.radiance == 0.0 {
            return;
        }
        let (value, pdf) = self.boundary.eval(wo, wi);
        if value == 0.0 {
            return;
        }
        self.scores.count(Cost::ShadowRays);
        let shadow = Ray { origin: hit.point, dir: sample.wi };
        if self.scene.shape.occluded(&shadow, Some(hit.face)) {
            return;
        }
        self.score_connection(index, choice, sample.pdf, value * sample.radiance, pdf);
    }

    /// Samples a light from a medium vertex, straight through a matched boundary.
    fn connect_from_medium(&mut self) {
        let u = self.light_stream.draw3();
        let Some((index, choice)) = choose_light(self.choice, u[0]) else { return };
        let sample = self.scene.lights[index].sample(self.band, [u[1], u[2]]);
        if sample.radiance == 0.0 {
            return;
        }
        let phase = self.medium.phase.pdf(self.ray.dir.dot(sample.wi));
        let Some(through) = self.transmittance_out(sample.wi) else { return };
        let own = phase * through;
        self.score_connection(index, choice, sample.pdf, own * sample.radiance, own);
    }

    /// Transmittance from the path's medium vertex to infinity along `dir`, through every part of the
    /// body on the way.
    fn transmittance_out(&mut self, dir: DVec3) -> Option<f64> {
        let mut ray = Ray { origin: self.ray.origin, dir };
        let mut from = None;
        let mut inside_length = 0.0;
        let mut side = Side::Inside;
        loop {
            self.scores.count(Cost::ShadowRays);
            match self.scene.shape.intersect(&ray, side, from, f64::INFINITY) {
                Some(hit) => {
                    if side == Side::Inside {
                        inside_length += hit.t;
                    }
                    ray.origin = hit.point;
                    from = Some(hit.face);
                    side = other(side);
                }
                None if side == Side::Outside => {
                    return Some(transmittance(self.medium.sigma_t, inside_length));
                }
                None => {
                    if self.bounds.is_some() {
                        self.scores.note(Anomaly::LostRay);
                    }
                    return None;
                }
            }
        }
    }

    /// Adds a light sample: `value` is f |cos| (or phase times transmittance) times radiance, `own` the
    /// density with which the path's own sampling draws the direction. Parallel light has no competitor.
    fn score_connection(&mut self, light: usize, choice: f64, pdf: Option<f64>, value: f64, own: f64) {
        let estimate = match pdf {
            Some(pdf) => value / (choice * pdf) * balance(choice * pdf, own),
            None => value / choice,
        };
        let score = self.throughput * estimate;
        self.scores.add(self.slot, self.band, self.history.class(), light, score);
    }

    #[inline]
    fn matched(&self) -> bool {
        self.boundary == Boundary::Matched
    }
}

/// Russian roulette on a weight: above the threshold it goes on as it is, below it survives with
/// probability weight / threshold. Returns the probability to divide by.
#[inline]
fn roulette(weight: f64, threshold: f64, u: impl FnOnce() -> f64) -> Option<f64> {
    if weight >= threshold {
        return Some(1.0);
    }
    let probability = weight / threshold;
    (u() < probability).then_some(probability)
}

#[cfg(test)]
#[path = "path_tests.rs"]
mod tests;
