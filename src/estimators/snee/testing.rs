//! Paths that every technique may make, held fixed: scenes with lights of unlike direction, size and
//! strength, and the end of a path in them.

use std::sync::Arc;

use super::end::Middle;
use super::subdivision::Subdivided;
use super::*;
use crate::estimators::Roulette;
use crate::estimators::vertices::WalkExit;
use crate::geometry::{Hit, Ray, Shape, Side, procedural};
use crate::math::{DVec3, Frame};
use crate::optics::medium::Medium;
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::distance::sample_exponential;
use crate::sampling::stream::Stream;
use crate::sampling::warp::square_to_cap;
use crate::scene::sensor::Probe;
use crate::scene::{Emission, Light, LightSample, Sensor};

pub(super) const ROUGH: Boundary =
    Boundary::Rough { eta: 1.4, facets: Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.2 } };
pub(super) const SMOOTH: Boundary = Boundary::Smooth { eta: 1.4 };

/// The lights, by what they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lamp {
    Sun,
    Disc,
    /// Another direction, another strength, thirty times as wide; it overlaps with the sky alone.
    WideDisc,
    Sky,
}

pub(super) fn light(lamp: Lamp) -> Light {
    let cap = |toward: DVec3, height, radiance| Emission::Cap {
        frame: Frame::about(toward.normalize()),
        height,
        radiance: vec![radiance],
    };
    let emission = match lamp {
        Lamp::Sun => {
            let toward = DVec3::new(0.6, -0.3, 0.7).normalize();
            Emission::Directional { toward, irradiance: vec![2.0] }
        }
        Lamp::Disc => cap(DVec3::new(-0.5, 0.4, 0.6), 1e-3, 300.0),
        Lamp::WideDisc => cap(DVec3::new(0.2, 0.8, -0.5), 0.03, 20.0),
        Lamp::Sky => cap(DVec3::Z, 2.0, 0.3),
    };
    Light { name: format!("{lamp:?}"), emission }
}

/// A torus of flat triangles: a body whose parts hide each other.
pub(super) fn ring() -> Arc<Shape> {
    Arc::new(Shape::Mesh(procedural::torus(0.7, 0.3, [24, 12], false).expect("closed")))
}

pub(super) fn sphere() -> Arc<Shape> {
    Arc::new(Shape::Sphere { radius: 1.0 })
}

/// A body under these lights; one band for each medium.
pub(super) fn body(
    shape: &Arc<Shape>,
    boundary: Boundary,
    media: &[Medium],
    lamps: &[Lamp],
) -> Arc<Scene> {
    let ray = Ray { origin: DVec3::new(0.3, -0.4, 3.0), dir: -DVec3::Z };
    let mut lights: Vec<Light> = lamps.iter().map(|&lamp| light(lamp)).collect();
    for light in &mut lights {
        match &mut light.emission {
            Emission::Directional { irradiance: per_band, .. }
            | Emission::Cap { radiance: per_band, .. } => *per_band = vec![per_band[0]; media.len()],
            Emission::Map(_) => {}
        }
    }
    Arc::new(Scene {
        shape: shape.clone(),
        boundary: vec![boundary; media.len()],
        medium: media.to_vec(),
        lights,
        sensor: Sensor::Probe(Probe { ray, paths: 1 }),
    })
}

pub(super) fn medium(sigma_t: f64, albedo: f64, g: f64) -> Medium {
    Medium { sigma_t, albedo, phase: HenyeyGreenstein { g }, emission: 0.0 }
}

/// No vertex of a led walk may fall to roulette.
const NO_ROULETTE: Roulette = Roulette::Below(1e-12);

/// The presets, and all techniques together, each of them in every light.
pub(super) fn presets() -> [(&'static str, SneeOptions); 4] {
    let everything = SneeOptions {
        call: Call { most: 0.8, decay: 0.3 },
        call_alone: Call { most: 0.9, decay: 0.1 },
        joint: JointKind::Mixture,
        least_concentration: 1.0,
        strategies: SneePreset::Paper.options().strategies,
        ..SneePreset::Guided.options()
    };
    let alone = SneeOptions {
        strategies: Strategies { bsdf: false, light: false, top_to_bottom: true, bottom_to_top: false },
        ..SneePreset::Paper.options()
    };
    let named = [
        ("paper", SneePreset::Paper.options()),
        ("guided", SneePreset::Guided.options()),
        ("everything", everything),
        ("top to bottom", alone),
    ];
    named.map(|(name, options)| (name, SneeOptions { roulette: NO_ROULETTE, ..options }))
}

/// The end of a path: x_i -> x_j -> x_k -> light.
#[derive(Clone, Copy, Debug)]
pub(super) struct FixedPath {
    /// Where the flight to x_i begins.
    pub start: DVec3,
    pub x_i: DVec3,
    pub x_j: DVec3,
    pub exit: WalkExit,
    pub w_l: DVec3,
    /// Radiance, or irradiance of parallel light.
    pub radiance: f64,
    pub light: usize,
}

impl FixedPath {
    /// A path to a light of a scene, by band 0. x_k is a point that x_i sees, or, `hidden`, any.
    pub(super) fn draw(
        scene: &Scene,
        light: usize,
        stream: &mut Stream,
        is_hidden: bool,
    ) -> Option<FixedPath> {
        let [start, x_i, other] = [(); 3].map(|()| point_inside(scene, stream));
        let (start, x_i, other) = (start?, x_i?, other?);
        let from = if is_hidden { other } else { x_i };
        let dir = square_to_cap(2.0, stream.draw2());
        let hit = inside(scene, from, dir, f64::INFINITY)?;
        let sample = scene.lights[light].sample(0, stream.draw2());
        let frame = Frame::about(hit.shading_normal);
        let shadow = Ray { origin: hit.point, dir: sample.wi };
        if sample.wi.dot(hit.normal) <= 0.0 || scene.shape.occluded(&shadow, Some(hit.face)) {
            return None;
        }
        let inward = scene.boundary[0].sample_refraction(frame.to_local(sample.wi), stream.draw2())?;
        let down = Ray { origin: hit.point, dir: frame.to_world(inward) };
        if down.dir.dot(hit.normal) >= 0.0 {
            return None;
        }
        let t = sample_exponential(scene.medium[0].sigma_t, stream.draw());
        if scene.shape.intersect(&down, Side::Inside, Some(hit.face), t).is_some() {
            return None;
        }
        let x_j = down.at(t);
        if !is_free(scene, x_i, x_j) || !is_free(scene, start, x_i) {
            return None;
        }
        let wo = frame.to_local((x_j - hit.point).normalize());
        let exit = WalkExit { hit, frame, wo };
        let LightSample { wi: w_l, radiance, .. } = sample;
        Some(FixedPath { start, x_i, x_j, exit, w_l, radiance, light })
    }

    /// A path through a rough boundary to a light of a scene whose vertices need not see each other, and
    /// whether x_i sees x_j, x_j sees x_k, x_k sees the light. x_i always sees x_k.
    pub(super) fn scattered(
        scene: &Scene,
        light: usize,
        stream: &mut Stream,
    ) -> Option<(FixedPath, [bool; 3])> {
        let (x_i, x_j) = (point_inside(scene, stream)?, point_inside(scene, stream)?);
        let hit = inside(scene, x_i, square_to_cap(2.0, stream.draw2()), f64::INFINITY)?;
        let LightSample { wi: w_l, radiance, .. } = scene.lights[light].sample(0, stream.draw2());
        let frame = Frame::about(hit.shading_normal);
        let wo = frame.to_local((x_j - hit.point).normalize());
        if w_l.dot(hit.normal) <= 0.0 || wo.z >= 0.0 || ROUGH.eval(wo, frame.to_local(w_l)).0 == 0.0 {
            return None;
        }
        let exit = WalkExit { hit, frame, wo };
        let shadow = Ray { origin: hit.point, dir: w_l };
        let is_lit = !scene.shape.occluded(&shadow, Some(hit.face));
        let sees = [is_free(scene, x_i, x_j), is_free(scene, x_j, hit.point), is_lit];
        Some((FixedPath { start: x_i, x_i, x_j, exit, w_l, radiance, light }, sees))
    }

    /// x_i, or the vertex that a longer walk meets before it.
    pub(super) fn vertex_before_last(&self, back: u32) -> DVec3 {
        if back == 1 { self.x_i } else { 0.5 * (self.start + self.x_i) }
    }

    pub(super) fn middle(&self) -> Middle {
        Middle::new(self.x_i, self.x_j, &self.exit.hit).expect("x_k is met from inside")
    }

    /// As subdivision hands it over.
    pub(super) fn subdivided<'a>(&self, guide: &'a Guide, radiance: Option<f64>) -> Subdivided<'a> {
        let FixedPath { x_j, exit, w_l, .. } = *self;
        Subdivided { guide, x_j, middle: self.middle(), exit, w_l, radiance }
    }
}

fn inside(scene: &Scene, origin: DVec3, dir: DVec3, t_max: f64) -> Option<Hit> {
    scene.shape.intersect(&Ray { origin, dir }, Side::Inside, None, t_max)
}

/// Whether nothing lies between two points inside; the second may be on the boundary.
fn is_free(scene: &Scene, from: DVec3, to: DVec3) -> bool {
    let leg = to - from;
    inside(scene, from, leg.normalize(), leg.length() * (1.0 - 1e-7)).is_none()
}

/// A point on a random chord of the body.
pub(super) fn point_inside(scene: &Scene, stream: &mut Stream) -> Option<DVec3> {
    let out = square_to_cap(2.0, stream.draw2());
    let beam = scene.shape.bounds()?.beam(out, stream.draw2());
    let entry = scene.shape.intersect(&beam, Side::Outside, None, f64::INFINITY)?;
    let chord = Ray { origin: entry.point, dir: beam.dir };
    let exit = scene.shape.intersect(&chord, Side::Inside, Some(entry.face), f64::INFINITY)?;
    Some(chord.at(stream.draw() * exit.t))
}
