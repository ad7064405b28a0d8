//! Camera paths over a body whose inside is a BSSRDF: reflection or refraction at every hit of the
//! surface by roulette with the Fresnel reflectance, and at a refraction (point-cloud note, phase two)
//!   L_o = L_e + L_t + L_r
//! where L_e is the emission of the medium along the refracted ray, L_t the light that passes straight
//! through, and L_r the light that the estimator gathers from the surface.
//!
//! Refraction is chosen with probability T21, so that gathered light must leave T21 out. L_t follows the
//! refracted ray to the other side with transmittance exp(-sigma_t* t), leaves with the transmittance of the
//! boundary as a weight (the model accounts for light that is reflected there) and continues outside as the
//! same path.
//!
//! L_e follows the same ray: over its length t inside, radiance epsilon (1 - e^(-sigma_t* t)) / sigma_t*
//! arrives at the exit, and loses eta^2 when it leaves. Emission that is scattered or reflected inside before
//! it leaves is not included, because a BSSRDF describes transport from surface to surface only.
//!
//! Bands that refract alike share a path; with dispersion each index has its own.

use std::sync::Arc;

use super::choice::{choose_light, light_shares};
use super::illumination::unscattered_notes;
use super::illumination::{Entrance, Illumination};
use super::{Anomaly, Cost, Scores, TransportClass};
use crate::error::{Error, Result};
use crate::geometry::{FaceId, Hit, Ray, Side};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::optics::bssrdf::{Bssrdf, Entry, Exit, Model};
use crate::optics::fresnel::fresnel;
use crate::optics::medium::Medium;
use crate::sampling::distance::transmittance;
use crate::sampling::stream::{PassKey, Purpose, Stream};
use crate::scene::Scene;

/// A scene whose medium is replaced by a model.
#[derive(Debug)]
pub(super) struct BssrdfScene {
    pub scene: Arc<Scene>,
    /// The model's name.
    pub model: String,
    /// Per band.
    pub models: Vec<Bssrdf>,
    /// Per band: index inside over outside.
    pub eta: Vec<f64>,
    /// Bands that refract alike.
    pub groups: Vec<Vec<usize>>,
    /// Whether light that goes straight through is followed.
    pub straight: bool,
    /// Whether single scattering is added by sampling.
    pub single: bool,
    pub illumination: Illumination,
    /// Probability of choosing each light, the mean over the bands.
    choice: Vec<f64>,
}

/// A camera path that has been refracted into the body.
pub(super) struct Emergence<'a> {
    pub exit: Exit,
    pub face: FaceId,
    /// Unit direction of the path inside.
    pub dir: DVec3,
    /// Index inside over outside.
    pub eta: f64,
    pub bands: &'a [usize],
    /// Per band of `bands`.
    pub throughput: &'a [f64],
    pub slot: usize,
}

impl Emergence<'_> {
    /// The throughput of one of its bands.
    #[inline]
    pub(super) fn throughput_of(&self, band: usize) -> f64 {
        let place = self.bands.iter().position(|&own| own == band);
        place.map_or(0.0, |place| self.throughput[place])
    }
}

/// The streams of one camera path beside its walk.
pub(super) struct PathStreams {
    /// Random numbers of light samples at entries.
    pub lights: Stream,
    /// Random numbers of entry points.
    pub entries: Stream,
    /// Of the single-scattering term, which then shifts none of the others.
    pub single: Stream,
}

/// Sets the streams of single scattering apart from those of entries. Indices stay below it.
const SINGLE: u64 = 1 << 63;

impl PathStreams {
    /// For path `index` of a pass and a group of bands.
    fn new(bssrdf: &BssrdfScene, key: &PassKey, index: usize, bands: &[usize]) -> PathStreams {
        let lane = bssrdf.lane(index, bands);
        PathStreams {
            lights: key.stream(lane, Purpose::Light),
            entries: key.stream(lane, Purpose::Connection),
            single: key.stream(lane | SINGLE, Purpose::Light),
        }
    }
}

/// Collects light that leaves the body.
pub(super) trait Gather {
    /// Scores what arrives at the exit from the rest of the surface: the integral of K T12 L |cos|,
    /// times the path's throughput.
    fn gather(&mut self, emergence: &Emergence<'_>, streams: &mut PathStreams, scores: &mut Scores);
}

/// Weight of a straight path below which roulette decides.
const ROULETTE: f64 = 0.05;

impl BssrdfScene {
    /// For a scene with smooth or matched boundaries, as [`super::Serves::BSSRDF`] has it. Unless told
    /// otherwise, it adds single scattering where the model leaves it out.
    ///
    /// # Errors
    /// A medium that the model does not fit.
    pub(super) fn new(
        scene: Arc<Scene>,
        model: &Model,
        straight: bool,
        single: Option<bool>,
    ) -> Result<BssrdfScene> {
        let name = model.to_string();
        let eta: Vec<f64> = scene.boundary.iter().map(Boundary::eta).collect();
        let bands = eta.len();
        let models = scene.medium.iter().zip(&eta).enumerate();
        let models = models.map(|(band, (medium, &eta))| model.of(band, bands, medium, eta));
        let models =
            models.collect::<std::result::Result<Vec<Bssrdf>, String>>().map_err(Error::input)?;
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for band in 0..eta.len() {
            match groups.iter_mut().find(|group| eta[group[0]] == eta[band]) {
                Some(group) => group.push(band),
                None => groups.push(vec![band]),
            }
        }
        let shares = light_shares(&scene);
        let mean =
            |light: usize| shares.iter().map(|band| band[light]).sum::<f64>() / shares.len() as f64;
        let choice = (0..scene.lights.len()).map(mean).collect();
        let single = single.unwrap_or_else(|| models.iter().any(|model| model.leaves_out_single));
        let illumination = Illumination::new(&scene);
        Ok(BssrdfScene {
            model: name,
            models,
            eta,
            groups,
            straight,
            single,
            illumination,
            choice,
            scene,
        })
    }

    /// A light for all bands, and the probability of that choice.
    #[inline]
    pub(super) fn choose_light(&self, u: f64) -> Option<(usize, f64)> {
        choose_light(&self.choice, u)
    }

    /// The index of a path's streams: each group of bands has its own.
    #[inline]
    fn lane(&self, index: usize, bands: &[usize]) -> u64 {
        index as u64 * self.eta.len() as u64 + bands[0] as u64
    }

    /// The groups of bands, as far as they are among `bands`.
    fn groups_among(&self, bands: &[usize]) -> Vec<Vec<usize>> {
        let among = |group: &Vec<usize>| -> Vec<usize> {
            group.iter().copied().filter(|band| bands.contains(band)).collect()
        };
        self.groups.iter().map(among).filter(|group| !group.is_empty()).collect()
    }

    /// Scores, for one light sample per band, what enters at `hit` and leaves at the emergence.
    /// `pdf_area` is the density of the entry point, 1/mm^2, times the number of points that are drawn
    /// so.
    ///
    /// Bands whose light samples are the same direction share its shadow ray.
    pub(super) fn enter(
        &self,
        emergence: &Emergence<'_>,
        hit: &Hit,
        pdf_area: f64,
        u: [f64; 3],
        scores: &mut Scores,
    ) {
        let scene = &*self.scene;
        let slot = scene.sensor.slot_of(emergence.slot, hit.point);
        let mut last: Option<(DVec3, Option<Entrance>)> = None;
        for (&band, throughput) in emergence.bands.iter().zip(emergence.throughput) {
            let Some(arrival) = self.illumination.draw(scene, band, u) else { continue };
            let entrance = match last {
                Some((wi, entrance)) if wi == arrival.wi => entrance,
                _ => Entrance::lit(scene, hit, arrival.wi, emergence.eta, scores),
            };
            last = Some((arrival.wi, entrance));
            let Some(entrance) = entrance else { continue };
            let entry = Entry { point: hit.point, normal: hit.shading_normal, dir: entrance.dir };
            scores.count(Cost::Evaluations);
            let kernel = self.models[band].kernel(&entry, &emergence.exit);
            let irradiance = entrance.transmittance * entrance.cos * arrival.value;
            let value = throughput * kernel * irradiance / pdf_area;
            scores.add(slot, band, TransportClass::Multiple, arrival.light, value);
        }
    }

    /// What camera paths cannot find.
    pub(super) fn notes(&self) -> Vec<String> {
        let parallel = self.scene.lights.iter().filter(|light| light.is_directional());
        parallel
            .filter(|_| self.eta.iter().any(|&eta| eta != 1.0))
            .map(|light| {
                format!(
                    "surface reflections of directional light `{}` by the smooth boundary, and its light straight \
                     through, are excluded from this estimator's result (exactly 0)",
                    light.name
                )
            })
            .chain(unscattered_notes(&self.scene))
            .collect()
    }

    /// Traces the camera paths of a pass: all of the sensor's for each group of bands, with what
    /// `gather_in` makes for that group.
    pub(super) fn pass<G: Gather>(
        &self,
        bands: &[usize],
        key: &PassKey,
        scores: &mut Scores,
        gather_in: impl Fn(&[usize]) -> G,
    ) {
        for group in self.groups_among(bands) {
            let mut gather = gather_in(&group);
            for index in 0..self.scene.sensor.rays_per_pass() {
                self.trace(&group, index, key, scores, &mut gather);
            }
        }
    }

    /// Traces path `index` of a pass for one group of bands.
    fn trace(
        &self,
        bands: &[usize],
        index: usize,
        key: &PassKey,
        scores: &mut Scores,
        gather: &mut impl Gather,
    ) {
        let mut sensor_stream = key.stream(index as u64, Purpose::Sensor);
        let [a, b] = sensor_stream.draw2();
        let [c, d] = sensor_stream.draw2();
        let start = self.scene.sensor.ray(index, [a, b, c, d]);
        let mut path = CameraPath {
            bssrdf: self,
            bands,
            eta: self.eta[bands[0]],
            weight: start.weight,
            throughput: vec![start.weight; bands.len()],
            slot: start.slot,
            ray: start.ray,
            from: None,
            has_met: false,
            stream: key.stream(self.lane(index, bands), Purpose::Walk),
            streams: PathStreams::new(self, key, index, bands),
        };
        scores.count(Cost::Paths);
        while path.step(scores, gather).is_some() {}
    }
}

struct CameraPath<'a> {
    bssrdf: &'a BssrdfScene,
    bands: &'a [usize],
    eta: f64,
    /// Of the sensor's ray.
    weight: f64,
    throughput: Vec<f64>,
    slot: usize,
    ray: Ray,
    from: Option<FaceId>,
    has_met: bool,
    stream: Stream,
    streams: PathStreams,
}

impl CameraPath<'_> {
    /// From one hit of the surface to the next; `None` where the path ends.
    fn step(&mut self, scores: &mut Scores, gather: &mut impl Gather) -> Option<()> {
        scores.count(Cost::Rays);
        let shape = &self.bssrdf.scene.shape;
        let Some(hit) = shape.intersect(&self.ray, Side::Outside, self.from, f64::INFINITY) else {
            self.escape(scores);
            return None;
        };
        self.has_met = true;
        scores.count(Cost::BoundaryEvents);
        let frame = Frame::about(hit.shading_normal);
        let wo = frame.to_local(-self.ray.dir);
        if wo.z <= 0.0 {
            scores.note(Anomaly::WrongSide);
            return None;
        }
        let surface = fresnel(wo.z, self.eta);
        self.ray.origin = hit.point;
        self.from = Some(hit.face);
        if self.stream.draw() < surface.reflectance {
            self.ray.dir = frame.to_world(DVec3::new(-wo.x, -wo.y, wo.z));
            return self.stays(&hit, Side::Outside, scores);
        }
        self.ray.dir = frame.to_world(DVec3::new(-wo.x / self.eta, -wo.y / self.eta, -surface.cos_t));
        self.stays(&hit, Side::Inside, scores)?;
        let emergence = Emergence {
            exit: Exit { point: hit.point, normal: hit.shading_normal },
            face: hit.face,
            dir: self.ray.dir,
            eta: self.eta,
            bands: self.bands,
            throughput: &self.throughput,
            slot: self.slot,
        };
        if !self.bssrdf.scene.lights.is_empty() {
            gather.gather(&emergence, &mut self.streams, scores);
        }
        if self.bssrdf.straight || self.bssrdf.scene.emits() { self.go_through(scores) } else { None }
    }

    /// Goes straight to the other side, with what is emitted on the way there, and out.
    fn go_through(&mut self, scores: &mut Scores) -> Option<()> {
        scores.count(Cost::Rays);
        let shape = &self.bssrdf.scene.shape;
        let Some(hit) = shape.intersect(&self.ray, Side::Inside, self.from, f64::INFINITY) else {
            if shape.bounds().is_some() {
                scores.note(Anomaly::LostRay);
            }
            return None; // down a half-space for good
        };
        self.score_emission(hit.t, scores);
        if !self.bssrdf.straight {
            return None;
        }
        scores.count(Cost::BoundaryEvents);
        let frame = Frame::about(hit.shading_normal);
        let wo = frame.to_local(-self.ray.dir);
        if wo.z >= 0.0 {
            scores.note(Anomaly::WrongSide);
            return None;
        }
        let surface = fresnel(-wo.z, 1.0 / self.eta);
        for (throughput, &band) in self.throughput.iter_mut().zip(self.bands) {
            let sigma_t = self.bssrdf.models[band].straight_sigma_t;
            *throughput *= (1.0 - surface.reflectance) * transmittance(sigma_t, hit.t);
        }
        let most = self.throughput.iter().fold(0.0, |most: f64, &t| most.max(t));
        let probability = (most / (ROULETTE * self.weight)).min(1.0);
        if self.stream.draw() >= probability {
            return None; // total reflection too
        }
        self.throughput.iter_mut().for_each(|throughput| *throughput /= probability);
        self.ray.origin = hit.point;
        self.ray.dir = frame.to_world(DVec3::new(-wo.x * self.eta, -wo.y * self.eta, surface.cos_t));
        self.from = Some(hit.face);
        self.stays(&hit, Side::Outside, scores)
    }

    /// Scores L_e of a ray that runs for `t` mm inside.
    fn score_emission(&self, t: f64, scores: &mut Scores) {
        let BssrdfScene { scene, models, .. } = self.bssrdf;
        for (&band, throughput) in self.bands.iter().zip(&self.throughput) {
            let medium = Medium { sigma_t: models[band].straight_sigma_t, ..scene.medium[band] };
            if medium.emission > 0.0 {
                let value = throughput * medium.emitted(t) / (self.eta * self.eta);
                scores.add(self.slot, band, TransportClass::Surface, scene.lights.len(), value);
            }
        }
    }

    /// Whether the new direction is on the side where it should be.
    fn stays(&self, hit: &Hit, side: Side, scores: &mut Scores) -> Option<()> {
        if (self.ray.dir.dot(hit.normal) > 0.0) == (side == Side::Outside) {
            return Some(());
        }
        scores.note(Anomaly::WrongSide);
        None
    }

    /// Scores the lights in the direction of a path that has met the body and leaves the scene.
    fn escape(&mut self, scores: &mut Scores) {
        if !self.has_met {
            return;
        }
        let slot = self.bssrdf.scene.sensor.slot_of(self.slot, self.ray.origin);
        for (light, source) in self.bssrdf.scene.lights.iter().enumerate() {
            for (&band, throughput) in self.bands.iter().zip(&self.throughput) {
                let (radiance, _) = source.eval(band, self.ray.dir);
                if radiance > 0.0 {
                    scores.add(slot, band, TransportClass::Surface, light, throughput * radiance);
                }
            }
        }
    }
}
