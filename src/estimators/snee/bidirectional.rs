//! Bidirectional path tracing with one light vertex inside the medium (Lafortune & Willems 1993; Veach &
//! Guibas 1994). Subdivision is a local form of it.
//!
//! Every walk gets one light path: a direction from a light, a point of the disc across it that covers
//! the body, the first boundary point x_k met, refraction there, a flight to x_j. Every medium vertex
//! x_i of the walk connects to that x_j. Per volume of x_j, area of x_k and solid angle of w_L its
//! density is, R being the bounding sphere's radius,
//!   p_G(w_L) (n.w_L) / (pi R^2) p(w_kj | w_L) sigma_t T(d_jk) / d_jk^2,
//! over U of [`super::connections`]:
//!   p_G (n.w_L) / (pi R^2) p_rev d_ij^2 / (phase_i T_ij phase_j cos_k).
//! Unlike for a probe from x_i, x_k need not be visible from x_i; on the other hand, x_k does not depend on x_i.

use std::f64::consts::PI;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::end::{End, Middle};
use super::guide::Guide;
use crate::error::{Error, Result};
use crate::estimators::bands::{OneBand, WalkBands};
use crate::estimators::field::{Field, Path};
use crate::estimators::vertices::WalkExit;
use crate::estimators::walk::{CameraWalk, Rivals, Unrivalled};
use crate::estimators::{
    Bodies, Cost, Estimator, EstimatorKind, Roulette, Scores, Serves, read_options,
};
use crate::geometry::{BoundingSphere, Ray, Side};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::sampling::discrete::choose_share;
use crate::sampling::distance::{sample_exponential, transmittance};
use crate::sampling::stream::{PassKey, Purpose, Stream};
use crate::scene::Scene;

/// Options of `bidirectional`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BidirectionalOptions {
    /// Russian roulette; all choices are unbiased.
    #[serde(default)]
    roulette: Roulette,
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct Bidirectional {
    field: Field,
    bounds: BoundingSphere,
    /// Per band; none where nothing can be connected.
    guides: Vec<Vec<Guide>>,
}

impl Bidirectional {
    /// `bidirectional` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "bidirectional",
        doc: "path tracing whose medium vertices connect to one light vertex inside the body; unbiased",
        serves: Serves { bodies: Bodies::Finite, emission: true, ..Serves::WITHOUT_ENTRIES },
        options_schema: || schemars::schema_for!(BidirectionalOptions),
        build: |options, scene| {
            let BidirectionalOptions { roulette } = read_options(options)?;
            Ok(Box::new(Bidirectional::new(scene, roulette)?))
        },
    };

    /// For a scene.
    ///
    /// # Errors
    /// A scene that it does not serve: light paths start from a disc that covers the body.
    pub fn new(scene: Arc<Scene>, roulette: Roulette) -> Result<Bidirectional> {
        Bidirectional::KIND.check(&scene)?;
        let bounds = scene.shape.bounds();
        let bounds = bounds.ok_or_else(|| Error::input("bidirectional needs a finite body"))?;
        let guides = (0..scene.bands())
            .map(|band| match scene.boundary[band] {
                Boundary::Matched => Vec::new(),
                _ if scene.medium[band].sigma_t == 0.0 => Vec::new(),
                _ => Guide::all(&scene.lights, band, 1.0, &scene.boundary[band]),
            })
            .collect();
        Ok(Bidirectional { field: Field::new(scene, roulette), bounds, guides })
    }
}

impl Estimator for Bidirectional {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        for &band in bands {
            for index in 0..self.field.scene.sensor.rays_per_pass() {
                let guides = &self.guides[band];
                let path = Path { field: &self.field, band, index, key };
                if guides.is_empty() {
                    CameraWalk::trace(path, scores, Unrivalled, OneBand);
                    continue;
                }
                let mut stream = key.stream(index as u64, Purpose::Connection);
                let covered = 1.0 / (PI * self.bounds.radius * self.bounds.radius);
                let light = self.light_path(guides, band, &mut stream, scores);
                let nowhere = Ray { origin: DVec3::NAN, dir: DVec3::Z };
                let rivals = OneLightVertex { guides, light, covered, vertices: [nowhere; 2], count: 0 };
                CameraWalk::trace(path, scores, rivals, OneBand);
            }
        }
    }

    fn notes(&self) -> Vec<String> {
        super::missing_notes(&self.field.scene, "a light vertex")
    }
}

/// One light path up to its medium vertex.
#[derive(Clone, Copy, Debug)]
struct LightPath<'a> {
    guide: &'a Guide,
    exit: WalkExit,
    x_j: DVec3,
    w_l: DVec3,
    radiance: f64,
}

impl Bidirectional {
    fn light_path<'a>(
        &self,
        guides: &'a [Guide],
        band: usize,
        stream: &mut Stream,
        scores: &mut Scores,
    ) -> Option<LightPath<'a>> {
        let scene = &*self.field.scene;
        let (boundary, medium) = (&scene.boundary[band], &scene.medium[band]);
        let (index, _) = choose_share(guides.iter().map(|guide| guide.choice), stream.draw())?;
        let guide = &guides[index];
        let sample = guide.sample(&scene.lights[guide.light], band, stream.draw2());
        let beam = self.bounds.beam(sample.wi, stream.draw2());
        let [u, v, w] = stream.draw3();
        scores.count(Cost::Rays);
        let hit = scene.shape.intersect(&beam, Side::Outside, None, f64::INFINITY)?;
        let frame = Frame::about(hit.shading_normal);
        let from = frame.to_local(sample.wi);
        if from.z <= 0.0 {
            return None;
        }
        let inward = match boundary {
            Boundary::Rough { .. } => boundary.sample_refraction(from, [u, v]),
            _ => boundary.refract(from),
        }?;
        let dir = frame.to_world(inward);
        if dir.dot(hit.normal) >= 0.0 {
            return None;
        }
        let t = sample_exponential(medium.sigma_t, w);
        let down = Ray { origin: hit.point, dir };
        scores.count(Cost::Rays);
        if scene.shape.intersect(&down, Side::Inside, Some(hit.face), t).is_some() {
            return None;
        }
        let exit = WalkExit { hit, frame, wo: inward };
        Some(LightPath { guide, exit, x_j: down.at(t), w_l: sample.wi, radiance: sample.radiance })
    }
}

/// State that a walk carries for connections.
struct OneLightVertex<'a> {
    guides: &'a [Guide],
    light: Option<LightPath<'a>>,
    /// Density of the points of the disc, 1/mm^2.
    covered: f64,
    /// Point and direction of arrival of the last two medium vertices, the latest last.
    vertices: [Ray; 2],
    count: u32,
}

/// The technique's density over U of a path that has arrived at x_i along `arrival`.
fn density<B: WalkBands>(
    walk: &CameraWalk<'_, OneLightVertex<'_>, B>,
    arrival: DVec3,
    middle: &Middle,
    exit: &WalkExit,
    end: &End<'_>,
) -> f64 {
    let numerator = end.by_guide * end.reverse * end.w_l.dot(exit.hit.normal) * walk.rivals.covered;
    if numerator <= 0.0 {
        return 0.0;
    }
    let Middle { to_j, to_k, cos_k } = middle;
    let phase = walk.medium.phase;
    let phases = phase.pdf(arrival.dot(to_j.dir)) * phase.pdf(to_j.dir.dot(to_k.dir));
    let through = transmittance(walk.medium.sigma_t, to_j.length);
    numerator * (to_j.length * to_j.length) / (phases * through * cos_k)
}

impl Rivals for OneLightVertex<'_> {
    fn call<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>) {
        let state = &mut walk.rivals;
        let Ray { origin: x_i, dir: arrival } = walk.ray;
        state.vertices = [state.vertices[1], walk.ray];
        state.count += 1;
        let Some(light) = state.light else { return };
        let LightPath { guide, exit, x_j, w_l, radiance } = light;
        let Some(middle) = Middle::new(x_i, x_j, &exit.hit) else { return };
        let end = End::new(walk, guide, &exit, w_l, [1.0, 1.0], Some(radiance));
        if end.value == 0.0 {
            return;
        }
        let rivals = density(walk, arrival, &middle, &exit, &end);
        let survival = walk.bands.survival(&walk.medium);
        let value = walk.throughput * survival * end.value / (end.unidirectional + rivals);
        if value == 0.0 || !walk.sees_point(x_i, x_j) {
            return;
        }
        let mut history = walk.history;
        history.scatter();
        let bands = walk.bands.clone();
        walk.score_with(&bands, history.class(), guide.light, value);
    }

    fn depart<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>) {
        walk.rivals.count = 0;
    }

    fn densities<B: WalkBands>(
        walk: &mut CameraWalk<'_, Self, B>,
        exit: &WalkExit,
        light: usize,
        wi: DVec3,
    ) -> f64 {
        if walk.rivals.count < 2 {
            return 0.0;
        }
        let guides = walk.rivals.guides;
        let Some(guide) = guides.iter().find(|guide| guide.light == light) else { return 0.0 };
        let [Ray { origin: x_i, dir: arrival }, Ray { origin: x_j, .. }] = walk.rivals.vertices;
        let Some(middle) = Middle::new(x_i, x_j, &exit.hit) else { return 0.0 };
        let end = End::new(walk, guide, exit, wi, [1.0, 1.0], None);
        density(walk, arrival, &middle, exit, &end)
    }
}
