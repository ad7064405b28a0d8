//! Two bounces from one medium vertex, by each technique of `connection` alone: the mean of f / p must
//! be the same whichever draws, so a technique whose draws and density differ is found.

use std::sync::Arc;

use scatterproof::estimators::{Anomaly, Cost, Estimator, Scores, TransportClass};
use scatterproof::geometry::{Hit, Ray, Side};
use scatterproof::math::DVec3;
use scatterproof::sampling::distance::{Equiangular, sample_exponential, sample_truncated_exponential};
use scatterproof::sampling::stream::{PassKey, Purpose, Stream};
use scatterproof::sampling::towards::TowardsPoint;
use scatterproof::sampling::warp::square_to_cap;
use scatterproof::scene::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::connection::{BOTTOM_TO_TOP, BSDF, CALL, Ends, LIGHT, Model, TOP_TO_BOTTOM, Vertex};
use super::defects::Defect;

/// Techniques that draw the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Technique {
    Bsdf,
    Light,
    TopToBottom,
    BottomToTop,
    /// One sample of each, weighted by the balance heuristic.
    All,
}

impl Technique {
    /// Whether it draws by this one of [`super::connection`]'s techniques.
    pub fn uses(self, technique: usize, model: &Model) -> bool {
        (self == Technique::All || self as usize == technique) && model.can_draw(technique)
    }

    /// Divisor of a sample of f: its own density, or the sum of all (Veach & Guibas 1995).
    pub fn density(self, densities: [f64; 4], defect: Defect) -> f64 {
        match self {
            Technique::All if defect == Defect::MisOmitsBottom => densities[..3].iter().sum(),
            Technique::All => densities.iter().sum(),
            alone => densities[alone as usize],
        }
    }
}

/// Options of `last_two`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TwoBounceOptions {
    /// Techniques that draw the samples.
    pub technique: Technique,
    /// How far beyond the first surface that the probe meets x_i lies along the probe's ray, mm.
    pub depth_mm: f64,
    /// Only connections whose first flight is longer than this are scored, mm: a part of the integral,
    /// the same for all. Where a ray from x_k passes x_i at the distance D, the weight of
    /// `top_to_bottom` grows as 1 / D next to x_i: its variance diverges as a logarithm, and no t test
    /// is valid for such a mean.
    pub beyond_mm: f64,
}

/// The estimator, for one scene.
pub struct TwoBounce {
    pub scene: Arc<Scene>,
    pub options: TwoBounceOptions,
    pub defect: Defect,
}

impl Estimator for TwoBounce {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        let seen = self.scene.sensor.ray(0, [0.5; 4]);
        let Some(start) = behind(&self.scene, &seen.ray, self.options.depth_mm) else {
            scores.note(Anomaly::LostRay);
            return;
        };
        for &band in bands {
            for index in 0..self.scene.sensor.rays_per_pass() {
                scores.count(Cost::Paths);
                let mut ends = TwoEnds {
                    model: Model::of(&self.scene, band, self.defect),
                    technique: self.options.technique,
                    beyond: self.options.beyond_mm,
                    start,
                    walk: key.stream(index as u64, Purpose::Walk),
                    lights: key.stream(index as u64, Purpose::Light),
                    slot: seen.slot,
                    weight: seen.weight,
                    class: TransportClass::Multiple,
                    scores,
                };
                ends.unidirectional();
                ends.call();
            }
        }
    }
}

/// The vertex `depth` behind the first surface that a ray from outside meets.
fn behind(scene: &Scene, ray: &Ray, depth: f64) -> Option<Vertex> {
    let hit = scene.shape.intersect(ray, Side::Outside, None, f64::INFINITY)?;
    let inwards = Ray { origin: hit.point, dir: ray.dir };
    let reach = scene.shape.intersect(&inwards, Side::Inside, Some(hit.face), depth);
    reach.is_none().then(|| Vertex { point: inwards.at(depth), travel: ray.dir })
}

/// The ends that are drawn from one vertex.
pub struct TwoEnds<'a> {
    pub model: Model<'a>,
    pub technique: Technique,
    /// Only first flights longer than this count.
    pub beyond: f64,
    pub start: Vertex,
    pub walk: Stream,
    pub lights: Stream,
    pub slot: usize,
    /// What has come before.
    pub weight: f64,
    pub class: TransportClass,
    pub scores: &'a mut Scores,
}

impl TwoEnds<'_> {
    /// Walks on to the boundary, then out of it by chance and to a light.
    fn unidirectional(&mut self) {
        if !self.technique.uses(BSDF, &self.model) && !self.technique.uses(LIGHT, &self.model) {
            return;
        }
        let Some((x_j, exit)) = self.flight() else { return };
        if self.technique.uses(LIGHT, &self.model) {
            self.join_a_light(x_j, &exit);
        }
        if self.technique.uses(BSDF, &self.model) {
            let w_kj = (x_j - exit.point).normalize();
            if let Some(to_light) = self.model.draw_exit(&exit, w_kj, self.walk.draw3())
                && self.model.is_lit(&exit, to_light, self.scores)
            {
                self.join_every_light(x_j, &exit, to_light, false);
            }
        }
    }

    /// Roulette at x_i and x_j with survival albedo, two flights, of which the second leaves.
    fn flight(&mut self) -> Option<(DVec3, Hit)> {
        let medium = self.model.medium;
        let shape = &self.model.scene.shape;
        let [u, v] = self.walk.draw2();
        if u >= medium.albedo {
            return None;
        }
        let dir = medium.phase.sample(self.start.travel, self.walk.draw2());
        let first = Ray { origin: self.start.point, dir };
        let t = sample_exponential(medium.sigma_t, v);
        self.scores.count(Cost::Rays);
        if shape.intersect(&first, Side::Inside, None, t).is_some() {
            return None;
        }
        let [u, v] = self.walk.draw2();
        if u >= medium.albedo {
            return None;
        }
        let dir = medium.phase.sample(dir, self.walk.draw2());
        let second = Ray { origin: first.at(t), dir };
        self.scores.count(Cost::Rays);
        let end = sample_exponential(medium.sigma_t, v);
        Some((second.origin, shape.intersect(&second, Side::Inside, None, end)?))
    }

    /// A light is sampled from x_k.
    pub fn join_a_light(&mut self, x_j: DVec3, exit: &Hit) {
        let (light, to_light, radiance, p_light) = self.light();
        let ends = Ends { start: self.start, x_j, exit: *exit, to_light, light };
        if let Some((value, densities)) =
            self.model.evaluate(&ends, p_light, false, self.technique, self.scores)
            && densities[LIGHT] > 0.0
            && self.model.is_lit(exit, to_light, self.scores)
        {
            self.score(x_j, light, value * radiance, densities);
        }
    }

    /// The finite lights that shine from a drawn direction. Parallel light is in none.
    pub fn join_every_light(&mut self, x_j: DVec3, exit: &Hit, to_light: DVec3, is_first_hit: bool) {
        for (light, source) in self.model.scene.lights.iter().enumerate() {
            let (radiance, pdf) = source.eval(self.model.band, to_light);
            if radiance == 0.0 {
                continue;
            }
            let ends = Ends { start: self.start, x_j, exit: *exit, to_light, light };
            let p_light = self.model.choice() * pdf;
            if let Some((value, densities)) =
                self.model.evaluate(&ends, p_light, is_first_hit, self.technique, self.scores)
            {
                self.score(x_j, light, value * radiance, densities);
            }
        }
    }

    /// One of the lights, a direction to it, its radiance there (irradiance), and its density.
    pub fn light(&mut self) -> (usize, DVec3, f64, f64) {
        let [u, v, w] = self.lights.draw3();
        let lights = &self.model.scene.lights;
        let light = ((u * lights.len() as f64) as usize).min(lights.len() - 1);
        let sample = lights[light].sample(self.model.band, [v, w]);
        (light, sample.wi, sample.radiance, self.model.choice() * sample.pdf.unwrap_or(1.0))
    }

    /// The call: x_k is the first hit along a uniform direction, and both techniques start from it.
    pub fn call(&mut self) {
        if !self.technique.uses(TOP_TO_BOTTOM, &self.model)
            && !self.technique.uses(BOTTOM_TO_TOP, &self.model)
        {
            return;
        }
        if self.walk.draw() >= CALL {
            return;
        }
        let ray = Ray { origin: self.start.point, dir: square_to_cap(2.0, self.walk.draw2()) };
        self.scores.count(Cost::Rays);
        let hit = self.model.scene.shape.intersect(&ray, Side::Inside, None, f64::INFINITY);
        let Some(exit) = hit else {
            self.scores.note(Anomaly::LostRay);
            return;
        };
        if self.technique.uses(TOP_TO_BOTTOM, &self.model) {
            self.top_to_bottom(&exit);
        }
        if self.technique.uses(BOTTOM_TO_TOP, &self.model) {
            let tries = if self.model.defect == Defect::FailedEndsRedrawn { 100 } else { 1 };
            let drawn = (0..tries).find_map(|_| self.bottom_to_top(&exit));
            if let Some((x_j, to_light)) = drawn
                && self.model.is_lit(&exit, to_light, self.scores)
            {
                self.join_every_light(x_j, &exit, to_light, true);
            }
        }
    }

    /// A light, refraction into the medium, a distance; then x_i.
    fn top_to_bottom(&mut self, exit: &Hit) {
        let (light, to_light, radiance, p_light) = self.light();
        let u = self.walk.draw2();
        let [way, v] = self.walk.draw2();
        if to_light.dot(exit.normal) <= 0.0 {
            return;
        }
        let Some(dir) = self.model.draw_through(exit, to_light, u) else { return };
        let down = Ray { origin: exit.point, dir };
        let scene = self.model.scene;
        self.scores.count(Cost::Rays);
        let end = scene.shape.intersect(&down, Side::Inside, Some(exit.face), f64::INFINITY);
        let Some(end) = end else { return };
        let t_max = if self.model.defect == Defect::TruncatedTop { end.t } else { f64::INFINITY };
        let t = if way < 0.5 {
            sample_truncated_exponential(self.model.medium.sigma_t, t_max, v)
        } else {
            let along = Equiangular::towards(self.start.point - exit.point, dir, t_max);
            let Some(along) = along else { return };
            along.sample(v)
        };
        let x_j = down.at(t);
        let ends = Ends { start: self.start, x_j, exit: *exit, to_light, light };
        if t < end.t
            && self.model.is_clear(self.start.point, x_j, None, self.scores)
            && self.model.is_lit(exit, to_light, self.scores)
            && let Some((value, densities)) =
                self.model.evaluate(&ends, p_light, true, self.technique, self.scores)
        {
            self.score(x_j, light, value * radiance, densities);
        }
    }

    /// x_j about x_i, then refraction out of the medium; `None` where that fails.
    fn bottom_to_top(&mut self, exit: &Hit) -> Option<(DVec3, DVec3)> {
        let start = self.start;
        let offset = exit.point - start.point;
        let ([way, v], u) = (self.walk.draw2(), self.walk.draw2());
        let facet = self.walk.draw2();
        let dir = match way < 0.5 {
            true => self.model.medium.phase.sample(start.travel, u),
            false => TowardsPoint::new(offset)?.sample(u),
        };
        let ray = Ray { origin: start.point, dir };
        let mut t_max = f64::INFINITY;
        if self.model.defect == Defect::TruncatedBottom {
            t_max = self.model.scene.shape.intersect(&ray, Side::Inside, None, t_max)?.t;
        }
        let x_j = ray.at(Equiangular::towards(offset, dir, t_max)?.sample(v));
        let w_kj = (x_j - exit.point).normalize();
        let is_inside = self.model.is_clear(start.point, x_j, None, self.scores)
            && w_kj.dot(exit.normal) < 0.0
            && self.model.is_clear(exit.point, x_j, Some(exit), self.scores);
        if !is_inside {
            return None;
        }
        Some((x_j, self.model.draw_through(exit, w_kj, facet)?))
    }

    fn score(&mut self, x_j: DVec3, light: usize, value: f64, densities: [f64; 4]) {
        if value == 0.0 || (x_j - self.start.point).length() <= self.beyond {
            return;
        }
        let density = self.technique.density(densities, self.model.defect);
        self.scores.add(self.slot, self.model.band, self.class, light, self.weight * value / density);
    }
}
