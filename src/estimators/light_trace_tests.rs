//! Tests of the light tracer: energy, closed forms, scaling, and agreement with the path tracer.

use std::f64::consts::PI;

use super::super::Layout;
use super::super::path::{PathTracer, Roulette};
use super::super::testing::measure;
use super::*;
use crate::geometry::{Mesh, procedural};
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::StreamKey;
use crate::scene::sensor::{
    Accepting, BodyFlux, FaceFlux, FluxFace, Orthographic, Perspective, Probe, Screen,
};
use crate::scene::{Emission, Light, Sensor};

const SPHERE: Shape = Shape::Sphere { radius: 1.0 };
const GGX: Boundary =
    Boundary::Rough { eta: 1.4, facets: Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 } };

fn cap(radiance: f64, toward: DVec3, height: f64, name: &str) -> Light {
    let frame = Frame::about(toward.normalize());
    Light { name: name.into(), emission: Emission::Cap { frame, height, radiance: vec![radiance] } }
}

fn sun(toward: DVec3, irradiance: f64) -> Light {
    let emission = Emission::Directional { toward: toward.normalize(), irradiance: vec![irradiance] };
    Light { name: "sun".into(), emission }
}

fn medium(sigma_t: f64, albedo: f64, g: f64) -> Medium {
    Medium { sigma_t, albedo, phase: HenyeyGreenstein { g }, emission: 0.0 }
}

fn scene(shape: Shape, boundary: Boundary, medium: Medium, lights: Vec<Light>, sensor: Sensor) -> Scene {
    Scene { shape: Arc::new(shape), boundary: vec![boundary], medium: vec![medium], lights, sensor }
}

fn flux(shape: &Shape, bins: usize) -> Sensor {
    let face = |name, depth: f64, n: DVec3| FluxFace {
        name,
        point: DVec3::new(0.0, 0.0, -depth),
        reach: 1.0,
        frame: Frame::about(n),
    };
    match (shape, shape.bounds()) {
        (_, Some(bounds)) => {
            Sensor::BodyFlux(BodyFlux { bounds, frame: Frame::about(DVec3::Z), bins, paths: 512 })
        }
        (Shape::Slab { thickness }, None) => {
            let faces = vec![face("top", 0.0, DVec3::Z), face("bottom", *thickness, -DVec3::Z)];
            Sensor::FaceFlux(FaceFlux { faces, bins, paths: 512 })
        }
        _ => Sensor::FaceFlux(FaceFlux { faces: vec![face("top", 0.0, DVec3::Z)], bins, paths: 512 }),
    }
}

/// Looks down on a body of this size; the screen is inside it, 0.3 sizes above the middle.
fn image(shape: &Shape, size: f64, height: f64) -> Sensor {
    let screen = Screen {
        width: 8,
        height: 8,
        right: DVec3::X * (0.25 * size),
        down: -DVec3::Y * (0.25 * size),
        view: -DVec3::Z,
        has_tiles: true,
    };
    let center = DVec3::new(0.125, 0.0, 0.25) * size;
    let bounds = shape.bounds().expect("a finite body");
    Sensor::Accepting(Accepting::new(screen, center, height, bounds))
}

fn tracer(scene: Scene) -> LightTracer {
    LightTracer::new(Arc::new(scene), None).expect("a sensor that it serves")
}

fn traced(scene: Scene, passes: u64, test: &str) -> (Vec<(f64, f64)>, Scores) {
    let layout = Layout::new(&scene);
    measure(&tracer(scene), &layout, passes, test)
}

/// Sum over a flux's bins: totals come before their five classes and, of several, the lights.
fn total(means: &[(f64, f64)], stride: usize) -> f64 {
    means.iter().step_by(stride).map(|(mean, _)| mean).sum()
}

/// Without absorption all light that a smooth or matched body takes in comes out again, photon by
/// photon: exactly the light through the body's cross section, or on the slab's face.
#[test]
fn energy_is_conserved() {
    let lights = || vec![sun(DVec3::new(0.3, -0.2, 0.9), 2.0), cap(0.5, DVec3::X, 2.0, "sky")];
    let sun_alone = || vec![sun(DVec3::new(0.0, -0.6, -0.8), 2.0)];
    for boundary in [Boundary::Smooth { eta: 1.3 }, Boundary::Smooth { eta: 1.5 }, Boundary::Matched] {
        let slab = || Shape::Slab { thickness: 1.0 };
        for (shape, lights, stride, expected) in
            [(SPHERE, lights(), 8, (2.0 + 0.5 * 4.0 * PI) * PI), (slab(), sun_alone(), 6, 2.0 * 0.8)]
        {
            let sensor = flux(&shape, 4);
            let scene = scene(shape, boundary, medium(3.0, 1.0, 0.3), lights, sensor);
            let (means, scores) = traced(scene, 1, "energy_is_conserved");
            let sum = total(&means, stride);
            assert!((sum / expected - 1.0).abs() < 1e-12, "{boundary:?}: {sum} of {expected}");
            assert_eq!(scores.anomalies, [0; 3]);
        }
    }
    // Facets hide some of it.
    let (means, _) = {
        let sensor = flux(&SPHERE, 4);
        let scene = scene(SPHERE, GGX, medium(3.0, 1.0, 0.3), sun_alone(), sensor);
        traced(scene, 1, "energy_is_conserved")
    };
    let share = total(&means, 6) / (2.0 * PI);
    assert!(share > 0.5 && share < 0.95, "{share}");
}

/// In a sky of radiance 1, a body that absorbs nothing sends out radiance 1: 2 pi dmu * pi R^2 in
/// every bin.
#[test]
fn furnace_by_direction() {
    for boundary in [Boundary::Smooth { eta: 1.4 }, Boundary::Matched] {
        let sky = vec![cap(1.0, DVec3::Z, 2.0, "sky")];
        let sensor = flux(&SPHERE, 4);
        let scene = scene(SPHERE, boundary, medium(3.0, 1.0, 0.6), sky, sensor);
        let (means, _) = traced(scene, 60, "furnace_by_direction");
        for (mean, error) in means.iter().step_by(6) {
            let expected = PI * PI;
            assert!((mean - expected).abs() < 5.0 * error && *error < 0.02 * expected, "{means:?}");
        }
    }
}

/// Parallel light along the normal of slabs, through their smooth surfaces: total reflectance and
/// transmittance.
/// Expected: adding-doubling (rows of experiments/verify/slab.csv), five standard errors.
#[test]
fn slab_reflectance_and_transmittance() {
    // albedo, b, g, n, UR1, UT1
    let rows = [
        (0.8, 2.0, 0.0, 1.0, 0.265938894, 0.285949529),
        (0.8, 1.0, 0.0, 1.3, 0.163574817, 0.486526072),
        (0.95, 1.0, 0.0, 1.3, 0.274493619, 0.593504558),
    ];
    for (albedo, b, g, eta, reflected, transmitted) in rows {
        for toward in [DVec3::Z, -DVec3::Z] {
            let slab = Shape::Slab { thickness: 1.0 };
            let sensor = flux(&slab, 1);
            let lights = vec![sun(toward, 1.0)];
            let scene = scene(slab, Boundary::Smooth { eta }, medium(b, albedo, g), lights, sensor);
            let (means, scores) = traced(scene, 100, "slab_reflectance_and_transmittance");
            let faces = if toward.z > 0.0 { [0, 6] } else { [6, 0] };
            for (expected, face) in [reflected, transmitted].iter().zip(faces) {
                let (mean, error) = means[face];
                assert!((mean - expected).abs() < 5.0 * error && error < 3e-3, "{means:?}");
                let classes: f64 = means[face + 1..face + 6].iter().map(|m| m.0).sum();
                assert!((classes - mean).abs() < 1e-12);
            }
            assert_eq!(scores.anomalies, [0; 3]);
        }
    }
}

/// Images and fluxes are those of the path tracer, class by class, within five standard errors.
#[test]
fn agrees_with_path() {
    type Make = fn(&Shape) -> Sensor;
    let sensors: [Make; 2] = [|shape| image(shape, 1.0, 0.1), |shape| flux(shape, 3)];
    let cases = [
        (SPHERE, GGX, medium(2.0, 0.9, 0.5), vec![cap(1.0, DVec3::new(1.0, 0.5, 1.0), 0.4, "lamp")]),
        (
            Shape::Box { half: DVec3::new(0.9, 0.6, 0.7) },
            Boundary::Matched,
            medium(3.0, 0.8, 0.8),
            vec![cap(1.0, DVec3::new(1.0, 0.2, 1.0), 0.3, "lamp"), cap(0.3, DVec3::Z, 2.0, "sky")],
        ),
    ];
    let mut compared = 0;
    for (shape, boundary, medium, lights) in cases {
        let shape = Arc::new(shape);
        let mut lights = Some(lights);
        for (i, make) in sensors.into_iter().enumerate() {
            let lights: Vec<Light> = lights.iter_mut().flatten().map(copy).collect();
            let scene = Arc::new(Scene {
                sensor: make(&shape),
                shape: Arc::clone(&shape),
                boundary: vec![boundary],
                medium: vec![medium],
                lights,
            });
            let layout = Layout::new(&scene);
            let photons = if i == 0 { 4096 } else { 1536 };
            let light = LightTracer::new(Arc::clone(&scene), Some(photons)).expect("it serves");
            let path = PathTracer::new(scene, Roulette::Below(0.25)).expect("a scene that it serves");
            let (from_light, scores) = measure(&light, &layout, 150, "agrees_with_path, light");
            let (from_sensor, _) = measure(&path, &layout, 150, "agrees_with_path, path");
            assert_eq!(scores.anomalies, [0; 3]);
            for (k, ((a, ea), (b, eb))) in from_light.iter().zip(&from_sensor).enumerate() {
                let error = (ea * ea + eb * eb).sqrt();
                let name = &layout.observables()[k];
                assert!((a - b).abs() <= 5.0 * error, "{boundary:?} {name:?}: {a} {ea}, {b} {eb}");
                compared += usize::from(error > 0.0);
            }
            // The mean of the image, the first bin of the flux.
            assert!(from_light[0].1 < 0.03 * from_light[0].0, "{:?}", from_light[0]);
        }
    }
    assert!(compared > 60, "{compared}");
}

fn copy(light: &mut Light) -> Light {
    let emission = match &light.emission {
        Emission::Directional { toward, irradiance } => {
            Emission::Directional { toward: *toward, irradiance: irradiance.clone() }
        }
        Emission::Cap { frame, height, radiance } => {
            Emission::Cap { frame: *frame, height: *height, radiance: radiance.clone() }
        }
        Emission::Map(map) => Emission::Map(Arc::clone(map)),
    };
    Light { name: light.name.clone(), emission }
}

/// Parallel light straight through a matched sphere, which no path from a sensor finds: over the disc of
/// chords 2c, c = sqrt(1 - r^2), int exp(-2 s c) 2 pi r dr = 2 pi int_0^1 c exp(-2 s c) dc
/// = 2 pi (1 - (1 + 2s) exp(-2s)) / (4 s^2).
#[test]
fn unscattered_beam_through_a_matched_sphere() {
    let sigma_t = 0.7;
    let beam = vec![sun(DVec3::new(0.3, 0.4, 0.8), 3.0)];
    let sensor = flux(&SPHERE, 1);
    let scene = scene(SPHERE, Boundary::Matched, medium(sigma_t, 0.9, 0.5), beam, sensor);
    let (means, _) = traced(scene, 200, "unscattered_beam_through_a_matched_sphere");
    let (mean, error) = means[1];
    let s2 = 2.0 * sigma_t;
    let expected = 3.0 * 2.0 * PI * (1.0 - (1.0 + s2) * crate::math::exp(-s2)) / (s2 * s2);
    assert!((mean - expected).abs() < 5.0 * error && error < 0.01 * expected, "{mean} {expected}");
}

/// D10: a walk draws 1 number per flight, 1 per scattering event, 2 per phase sample, 3 per surface
/// event, whatever their outcome.
#[test]
fn draws_per_event() {
    let sky = vec![cap(1.0, DVec3::Z, 2.0, "sky")];
    let scene =
        scene(SPHERE, Boundary::Smooth { eta: 1.3 }, medium(4.0, 0.8, 0.4), sky, flux(&SPHERE, 1));
    let layout = Layout::new(&scene);
    let tracer = tracer(scene);
    let key = StreamKey::named("draws_per_event, light").pass(0);
    let (mut absorbed, mut left) = (0, 0);
    for index in 0..1000 {
        let mut scores = Scores::new(layout.clone());
        let draws = Photon::trace(&tracer, 0, index, &key, &mut scores);
        let [paths, rays, shadow_rays, medium_events, boundary_events, ..] = scores.cost;
        let out = u64::from(scores.observables[0] > 0.0);
        let survived = medium_events - (1 - out); // else the last event ended it
        let flights = rays - 1 - out;
        assert_eq!((paths, shadow_rays), (1, 0));
        assert_eq!(draws, flights + medium_events + 2 * survived + 3 * boundary_events);
        *[&mut absorbed, &mut left][out as usize] += 1;
    }
    assert!(absorbed > 100 && left > 100, "{absorbed} {left}");
}

/// D9: bands with equal coefficients, traced on one key, are equal to the last bit; on keys of their
/// own they are not.
#[test]
fn equal_bands_on_one_key_are_equal() {
    let one = scene(SPHERE, GGX, medium(3.0, 0.9, 0.5), Vec::new(), flux(&SPHERE, 2));
    let emission = Emission::Cap { frame: Frame::about(DVec3::Z), height: 0.5, radiance: vec![1.0; 2] };
    let lights = vec![Light { name: "cap".into(), emission }];
    let scene = Scene { boundary: vec![GGX; 2], medium: vec![one.medium[0]; 2], lights, ..one };
    let layout = Layout::new(&scene);
    let tracer = tracer(scene);
    let key = StreamKey::named("equal_bands_on_one_key_are_equal, light");
    let mut scores = Scores::new(layout);
    tracer.pass(&[0, 1], &key.pass(0), &mut scores);
    assert!(scores.observables[0] > 0.0);
    assert!(scores.observables.chunks(2).all(|bands| bands[0].to_bits() == bands[1].to_bits()));
    scores.clear();
    tracer.pass(&[0], &key.pass(0), &mut scores);
    tracer.pass(&[1], &key.pass(1), &mut scores);
    assert_ne!(scores.observables[0], scores.observables[1]);
}

/// A scene scaled by a power of two, with coefficients scaled to match, gives the same bits: images
/// and exitances as they are, fluxes of bodies times the area.
#[test]
fn scaled_scenes_give_the_same_bits() {
    type MakeShape = fn(f64) -> Shape;
    let shapes: [MakeShape; 4] = [
        |s| Shape::Sphere { radius: s },
        |s| Shape::Slab { thickness: s },
        |s| Shape::Box { half: DVec3::new(s, 0.7 * s, 0.9 * s) },
        |s| Shape::Mesh(procedural::bumpy_sphere(s, 3, 0.1, 7.0, true).expect("a mesh")),
    ];
    let run = |make: MakeShape, boundary, scale: f64, pictured: bool| {
        let lights = vec![sun(DVec3::Z, 1.0), cap(0.3, DVec3::X, 1.0, "half")];
        let shape = make(scale);
        let sensor = if pictured { image(&shape, scale, 0.2) } else { flux(&shape, 3) };
        let scene = scene(shape, boundary, medium(4.0 / scale, 0.9, 0.5), lights, sensor);
        let layout = Layout::new(&scene);
        let tracer = LightTracer::new(Arc::new(scene), Some(2000)).expect("it serves");
        measure(&tracer, &layout, 1, "scaled_scenes_give_the_same_bits, light")
    };
    for make in shapes {
        let finite = make(1.0).bounds().is_some();
        for (boundary, pictured) in [(GGX, false), (Boundary::Matched, false), (GGX, true)] {
            if pictured && !finite {
                continue;
            }
            let (unit, unit_scores) = run(make, boundary, 1.0, pictured);
            assert!(unit[0].0 > 0.0);
            for k in [-30, -3, 7, 40] {
                let (scaled, scores) = run(make, boundary, f64::from(k).exp2(), pictured);
                let area = if finite && !pictured { f64::from(2 * k).exp2() } else { 1.0 };
                assert_eq!(
                    scaled.iter().map(|m| m.0.to_bits()).collect::<Vec<_>>(),
                    unit.iter().map(|m| (m.0 * area).to_bits()).collect::<Vec<_>>(),
                    "2^{k} {boundary:?}"
                );
                assert_eq!(scores.cost, unit_scores.cost);
            }
        }
    }
}

/// Light from behind a half-space, or along it, does not meet it; from before it, it does.
#[test]
fn lights_behind_a_half_space_are_not_seen() {
    for (toward, is_seen) in [(-DVec3::Z, false), (DVec3::X, false), (DVec3::new(1.0, 0.0, 0.2), true)] {
        let lights = vec![sun(toward, 1.0)];
        let sensor = flux(&Shape::HalfSpace, 2);
        let scene = scene(Shape::HalfSpace, GGX, medium(1.0, 0.9, 0.0), lights, sensor);
        let (means, scores) = traced(scene, 1, "lights_behind_a_half_space_are_not_seen");
        assert_eq!(means[0].0 > 0.0, is_seen, "{toward}");
        assert_eq!((scores.anomalies, scores.cost[0]), ([0; 3], 1024));
    }
}

#[test]
fn sensors_without_extent_are_refused() {
    let refused = |shape: Shape, sensor: Sensor| {
        let scene = scene(shape, GGX, medium(1.0, 0.9, 0.0), vec![sun(DVec3::Z, 1.0)], sensor);
        let refused = LightTracer::new(Arc::new(scene), None);
        refused.err().map(|error| error.to_string())
    };
    let Sensor::FaceFlux { .. } = flux(&Shape::HalfSpace, 1) else { unreachable!() };
    let screen = Screen {
        width: 2,
        height: 2,
        right: DVec3::X,
        down: -DVec3::Y,
        view: -DVec3::Z,
        has_tiles: true,
    };
    let ray = Ray { origin: DVec3::Z * 3.0, dir: -DVec3::Z };
    for (shape, sensor) in [
        (SPHERE, Sensor::Orthographic(Orthographic { screen, center: ray.origin })),
        (SPHERE, Sensor::Perspective(Perspective { screen, pinhole: ray.origin })),
        (SPHERE, Sensor::Probe(Probe { ray, paths: 4 })),
        (SPHERE, flux(&Shape::HalfSpace, 1)),
        (Shape::HalfSpace, flux(&SPHERE, 1)),
        (Shape::HalfSpace, image(&SPHERE, 1.0, 0.1)),
    ] {
        let message = refused(shape, sensor).expect("refused");
        assert!(message.contains("`flux`") && message.contains("acceptance_sr"), "{message}");
    }
    assert_eq!(refused(SPHERE, flux(&SPHERE, 1)), None);
    assert_eq!(refused(SPHERE, image(&SPHERE, 1.0, 0.1)), None);
    assert_eq!(refused(Shape::HalfSpace, flux(&Shape::HalfSpace, 1)), None);
}

/// Only a boundary that sees interpolated normals makes another model of it.
#[test]
fn interpolated_normals_are_called_biased() {
    let mesh = |smooth| -> Mesh { procedural::icosphere(1.0, 1, smooth).expect("a mesh") };
    for (smooth, boundary, biased) in
        [(true, GGX, true), (false, GGX, false), (true, Boundary::Matched, false)]
    {
        let shape = Shape::Mesh(mesh(smooth));
        let sensor = flux(&shape, 1);
        let scene = scene(shape, boundary, medium(1.0, 0.9, 0.0), vec![sun(DVec3::Z, 1.0)], sensor);
        assert_eq!(matches!(tracer(scene).bias(), Bias::Biased(_)), biased, "{smooth} {boundary:?}");
    }
}
