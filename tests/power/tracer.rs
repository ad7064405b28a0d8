//! A second unidirectional path tracer, written plainly and apart from `estimators::path`: lights are
//! chosen evenly, two light samples are drawn a vertex, the interface is `surface`, after three
//! scattering events a path continues with probability albedo, and emission is scored at collisions.
//! Without a defect it must agree with `path`.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use scatterproof::estimators::{Anomaly, Cost, Estimator, History, Scores, TransportClass};
use scatterproof::geometry::{FaceId, Hit, Ray, Side};
use scatterproof::math::{DVec3, Frame};
use scatterproof::optics::boundary::Boundary;
use scatterproof::optics::medium::Medium;
use scatterproof::sampling::distance::{sample_exponential, transmittance};
use scatterproof::sampling::stream::{PassKey, Purpose, Stream};
use scatterproof::scene::{Emission, Light, Scene};

use super::defects::Defect;
use super::surface::Surface;

/// Light samples a vertex.
const LIGHT_SAMPLES: u32 = 2;

/// Scattering events before roulette begins.
const SAFE_EVENTS: u32 = 3;

/// Where rays start with [`Defect::AbsoluteEpsilon`], mm off the surface.
const EPSILON_MM: f64 = 1e-4;

/// The estimator, for one scene.
pub struct Tracer {
    scene: Arc<Scene>,
    defect: Defect,
    first_pass: OnceLock<PassKey>,
}

impl Tracer {
    pub fn new(scene: Arc<Scene>, defect: Defect) -> Tracer {
        Tracer { scene, defect, first_pass: OnceLock::new() }
    }
}

impl Estimator for Tracer {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        let key = match self.defect {
            Defect::PassesShareStream => self.first_pass.get_or_init(|| *key),
            _ => key,
        };
        let count = self.scene.bands();
        let mut sums = BTreeMap::new();
        for &band in bands {
            if self.defect == Defect::BandMissing && count > 1 && band == count - 1 {
                continue;
            }
            for index in 0..self.scene.sensor.rays_per_pass() {
                let times = match self.defect {
                    Defect::ScoresScaled => 1.05,
                    Defect::PathDropped if index == 0 => 0.0,
                    Defect::PathTwice if index == 0 => 2.0,
                    _ => 1.0,
                };
                Path::trace(self, band, index, key, times, &mut sums, scores);
            }
        }
    }
}

/// f32 sums by slot, band, class and light, of [`Defect::SinglePrecision`].
type Sums = BTreeMap<(usize, usize, TransportClass, usize), f32>;

/// State of one path.
struct Path<'a> {
    scene: &'a Scene,
    defect: Defect,
    band: usize,
    slot: usize,
    medium: Medium,
    boundary: Boundary,
    ray: Ray,
    from: Option<FaceId>,
    throughput: f64,
    /// Density with which the current direction was drawn where lights were sampled too.
    competing: Option<f64>,
    events: u32,
    history: History,
    walk: Stream,
    lights: Stream,
    sums: &'a mut Sums,
    scores: &'a mut Scores,
}

impl<'a> Path<'a> {
    fn trace(
        tracer: &'a Tracer,
        band: usize,
        index: usize,
        key: &PassKey,
        times: f64,
        sums: &'a mut Sums,
        scores: &'a mut Scores,
    ) {
        let scene = &*tracer.scene;
        let defect = tracer.defect;
        let mut sensor = key.stream(index as u64, Purpose::Sensor);
        let ([a, b], [c, d]) = (sensor.draw2(), sensor.draw2());
        let start = scene.sensor.ray(index, [a, b, c, d]);
        scores.count(Cost::Paths);
        let mut medium = scene.medium[band];
        match defect {
            Defect::OtherBand => medium.albedo = scene.medium[0].albedo,
            Defect::PhaseFlipped => medium.phase.g = -medium.phase.g,
            _ => {}
        }
        let purpose = match defect {
            Defect::PurposesShareStream => Purpose::Walk,
            _ => Purpose::Light,
        };
        let path = Path {
            scene,
            defect,
            band,
            slot: start.slot,
            medium,
            boundary: scene.boundary[band],
            ray: start.ray,
            from: None,
            throughput: start.weight * times,
            competing: None,
            events: 0,
            history: History::default(),
            walk: key.stream(index as u64, Purpose::Walk),
            lights: key.stream(index as u64, purpose),
            sums,
            scores,
        };
        path.run();
    }

    /// From the sensor until nothing more can be scored.
    fn run(mut self) {
        if self.defect == Defect::NotANumber && self.walk.draw() < 1e-3 {
            self.throughput = f64::NAN;
        }
        let Some(mut hit) = self.flight(Side::Outside, f64::INFINITY) else { return };
        let mut side = Side::Outside;
        loop {
            let Some(next) = self.meet(&hit, side) else { return };
            side = next;
            let found = match side {
                Side::Outside => {
                    let found = self.flight(Side::Outside, f64::INFINITY);
                    if found.is_none() {
                        self.escape();
                    }
                    found
                }
                Side::Inside => self.wander(),
            };
            match found {
                Some(found) => hit = found,
                None => return,
            }
        }
    }

    /// The next crossing of the boundary within `t_max`.
    fn flight(&mut self, side: Side, t_max: f64) -> Option<Hit> {
        self.scores.count(Cost::Rays);
        if self.defect == Defect::AbsoluteEpsilon && self.from.is_some() {
            self.ray.origin += EPSILON_MM * self.ray.dir;
            self.from = None;
        }
        self.scene.shape.intersect(&self.ray, side, self.from, t_max)
    }

    /// Through the medium to the boundary; `None` where the path ends.
    fn wander(&mut self) -> Option<Hit> {
        loop {
            let t = sample_exponential(self.medium.sigma_t, self.walk.draw());
            if let Some(hit) = self.flight(Side::Inside, t) {
                // Light samples compete with flying here and then straight on.
                let through = transmittance(self.medium.sigma_t, hit.t);
                let through = match self.defect {
                    Defect::FlightDensity => self.medium.sigma_t * through,
                    _ => through,
                };
                if self.boundary == Boundary::Matched {
                    self.competing = self.competing.map(|pdf| pdf * through);
                }
                return Some(hit);
            }
            if t == f64::INFINITY {
                return None;
            }
            self.ray.origin = self.ray.at(t);
            self.from = None;
            self.scatter()?;
        }
    }

    /// Samples a scattering event.
    fn scatter(&mut self) -> Option<()> {
        self.scores.count(Cost::MediumEvents);
        self.events += 1;
        if self.defect == Defect::DepthCutOff && self.events > 32 {
            return None;
        }
        self.emit();
        if self.events > SAFE_EVENTS {
            if self.walk.draw() >= self.medium.albedo {
                return None;
            }
            self.throughput /= self.medium.albedo;
        }
        if self.events <= SAFE_EVENTS || self.defect != Defect::RouletteUncompensated {
            self.throughput *= self.medium.albedo;
        } else {
            self.throughput *= self.medium.albedo * self.medium.albedo;
        }
        self.history.scatter();
        let matched = self.boundary == Boundary::Matched;
        if matched {
            let (travel, position) = (self.ray.dir, self.ray.origin);
            self.sample_lights(|path, wi, _| {
                let own = path.phase(travel.dot(wi)) * path.way_out(position, wi)?;
                Some((own, own))
            });
        }
        let next = self.medium.phase.sample(self.ray.dir, self.walk.draw2());
        self.competing = matched.then(|| self.phase(self.ray.dir.dot(next)));
        self.ray.dir = next;
        Some(())
    }

    /// What the medium emits, scored at collisions: their density is sigma_t a length.
    fn emit(&mut self) {
        let Medium { sigma_t, albedo, .. } = self.medium;
        let emission = match self.defect {
            Defect::EmissionOfFirstBand => self.scene.medium[0].emission,
            _ => self.medium.emission,
        };
        let scale = match self.defect {
            Defect::EmissionAfterAlbedo => albedo,
            Defect::EmissionPerAbsorption => 1.0 / (1.0 - albedo),
            _ => 1.0,
        };
        if emission > 0.0 {
            self.score(self.scene.lights.len(), self.throughput * scale * emission / sigma_t);
        }
    }

    fn phase(&self, mu: f64) -> f64 {
        let norm = if self.defect == Defect::PhaseNormalisation { 2.0 } else { 1.0 };
        norm * self.medium.phase.pdf(mu)
    }

    /// Transmittance from a point of the medium to infinity.
    fn way_out(&mut self, origin: DVec3, dir: DVec3) -> Option<f64> {
        let (mut ray, mut from, mut side) = (Ray { origin, dir }, None, Side::Inside);
        let mut length = 0.0;
        loop {
            self.scores.count(Cost::ShadowRays);
            let Some(hit) = self.scene.shape.intersect(&ray, side, from, f64::INFINITY) else {
                return (side == Side::Outside).then(|| transmittance(self.medium.sigma_t, length));
            };
            length += if side == Side::Inside { hit.t } else { 0.0 };
            (ray.origin, from, side) = (hit.point, Some(hit.face), across(side));
        }
    }

    /// Meets the boundary from `side`; the side on which the path continues.
    fn meet(&mut self, hit: &Hit, side: Side) -> Option<Side> {
        self.scores.count(Cost::BoundaryEvents);
        self.ray.origin = hit.point;
        self.from = Some(hit.face);
        let (eta, facets) = match self.boundary {
            Boundary::Matched => return Some(across(side)),
            Boundary::Smooth { eta } => return self.meet_smooth(hit, side, eta),
            Boundary::Rough { eta, facets } => (eta, facets),
        };
        let surface = Surface { eta, facets, defect: self.defect };
        let frame = Frame::about(hit.shading_normal);
        let wo = frame.to_local(-self.ray.dir);
        if (wo.z > 0.0) != (side == Side::Outside) {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        let leaves = |path: &Path, world: DVec3, local: DVec3| match path.defect {
            Defect::ShadingNormal => local.z > 0.0,
            _ => world.dot(hit.normal) > 0.0,
        };
        self.sample_lights(|path, wi, _| {
            let local = frame.to_local(wi);
            if leaves(path, wi, local) != (local.z > 0.0) {
                path.scores.note(Anomaly::WrongSide);
                return None;
            }
            if local.z <= 0.0 {
                return None;
            }
            path.scores.count(Cost::ShadowRays);
            let shadow = Ray { origin: hit.point, dir: wi };
            let lit = path.defect == Defect::ShadowIgnored
                || !path.scene.shape.occluded(&shadow, Some(hit.face));
            lit.then(|| surface.eval(wo, local))
        });
        let mut drawn = surface.sample(wo, self.walk.draw3());
        while drawn.is_none() && self.defect == Defect::FailuresRedrawn {
            drawn = surface.sample(wo, self.walk.draw3());
        }
        let drawn = drawn?;
        let dir = frame.to_world(drawn.wi);
        let next = if drawn.wi.z * wo.z > 0.0 { side } else { across(side) };
        if leaves(self, dir, drawn.wi) != (next == Side::Outside) {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        if next == side && side == Side::Inside {
            self.history.reflect_internally();
        }
        self.throughput *= drawn.weight;
        self.competing = Some(drawn.pdf);
        self.ray.dir = dir;
        Some(next)
    }

    /// A smooth dielectric: reflection with the probability of its reflectance, else refraction.
    fn meet_smooth(&mut self, hit: &Hit, side: Side, eta: f64) -> Option<Side> {
        let normal = if side == Side::Outside { hit.normal } else { -hit.normal };
        let facets = scatterproof::optics::microfacet::Microfacets {
            kind: scatterproof::optics::microfacet::MicrofacetKind::Ggx,
            alpha: 1.0,
        };
        let surface = Surface { eta, facets, defect: self.defect };
        let frame = Frame::about(hit.normal);
        let wo = frame.to_local(-self.ray.dir);
        let cos = -self.ray.dir.dot(normal);
        let reflectance = surface.reflectance(wo, cos);
        self.competing = None;
        if reflectance == 1.0 && self.defect == Defect::TotalReflectionDropped {
            return None;
        }
        if self.walk.draw() < reflectance {
            self.ray.dir += 2.0 * cos * normal;
            if side == Side::Inside {
                self.history.reflect_internally();
            }
            return Some(side);
        }
        let ratio = if side == Side::Outside { 1.0 / eta } else { eta };
        let cos_t2 = 1.0 - ratio * ratio * (1.0 - cos * cos);
        if cos_t2 <= 0.0 {
            return None;
        }
        self.throughput *= surface.radiance(wo, -wo);
        let dir = ratio * self.ray.dir + (ratio * cos - cos_t2.sqrt()) * normal;
        self.ray.dir = dir.normalize();
        Some(across(side))
    }

    /// Samples lights [`LIGHT_SAMPLES`] times; `of` gives f |cos| (or phase times transmittance) and the
    /// density with which the path itself draws that direction.
    ///
    /// Balance heuristic (Veach & Guibas 1995) with n light samples of density c p and one other of
    /// density q: the sum over light samples of f L / (n c p + q).
    fn sample_lights(&mut self, of: impl Fn(&mut Self, DVec3, u32) -> Option<(f64, f64)>) {
        let lights = self.scene.lights.len();
        for k in 0..LIGHT_SAMPLES {
            let [u, v, w] = self.lights.draw3();
            let choosable = match self.defect {
                Defect::LightForgotten if lights > 1 => lights - 1,
                _ => lights,
            };
            let light = ((u * lights as f64) as usize).min(choosable - 1);
            let mut choice = 1.0 / lights as f64;
            if self.defect == Defect::LightChoiceMissing {
                choice = 1.0;
            }
            let sample = self.scene.lights[light].sample(self.band, [v, w]);
            if sample.radiance == 0.0 {
                continue;
            }
            let Some((value, own)) = of(self, sample.wi, k) else { continue };
            let n = match self.defect {
                Defect::SampleCountMissing => 1.0,
                _ => f64::from(LIGHT_SAMPLES),
            };
            let estimate = match sample.pdf {
                None => value / (n * choice),
                Some(pdf) => {
                    let own = if self.defect == Defect::MisOmitsInterface { 0.0 } else { own };
                    let pdf = self.light_pdf(light, sample.wi, pdf);
                    value / (n * choice * pdf + own)
                }
            };
            let value = self.throughput * estimate * sample.radiance;
            self.score(light, value);
        }
    }

    /// The density of a light sample, as the light reports it.
    fn light_pdf(&self, light: usize, wi: DVec3, pdf: f64) -> f64 {
        match (&self.scene.lights[light].emission, self.defect) {
            (Emission::Map(_), Defect::SineMissing) => pdf * (1.0 - wi.z * wi.z).max(0.0).sqrt(),
            _ => pdf,
        }
    }

    /// The path leaves the scene in its direction.
    fn escape(&mut self) {
        for light in 0..self.scene.lights.len() {
            let (radiance, pdf) = self.scene.lights[light].eval(self.band, self.ray.dir);
            if radiance == 0.0 {
                continue;
            }
            let pdf = self.light_pdf(light, self.ray.dir, pdf);
            let n = match self.defect {
                Defect::MisSampleCountWrong => 1.0,
                _ => f64::from(LIGHT_SAMPLES),
            };
            let choice = match self.defect {
                Defect::LightChoiceMissing => 1.0,
                _ => 1.0 / self.scene.lights.len() as f64,
            };
            let weight = self.competing.map_or(1.0, |own| own / (own + n * choice * pdf));
            let scale = if self.defect == Defect::EnvironmentScaled { 1.001 } else { 1.0 };
            self.score(light, self.throughput * weight * radiance * scale);
        }
    }

    fn score(&mut self, light: usize, value: f64) {
        let class = match (self.history.class(), self.defect) {
            (TransportClass::Single, Defect::ClassesSwapped) => TransportClass::Multiple,
            (TransportClass::Multiple, Defect::ClassesSwapped) => TransportClass::Single,
            (class, _) => class,
        };
        let value = match self.defect {
            Defect::ContributionClamped => {
                let paths = self.scene.sensor.rays_per_pass() as f64;
                let cap = |light: &Light| light.strength(self.band) / 3.0;
                self.scene.lights.get(light).map_or(value, |light| value.min(cap(light) / paths))
            }
            Defect::SinglePrecision => {
                let sum = self.sums.entry((self.slot, self.band, class, light)).or_default();
                let before = *sum;
                *sum += value as f32;
                f64::from(*sum) - f64::from(before)
            }
            _ => value,
        };
        self.scores.add(self.slot, self.band, class, light, value);
    }
}

fn across(side: Side) -> Side {
    match side {
        Side::Outside => Side::Inside,
        Side::Inside => Side::Outside,
    }
}
