//! What holds to the last bit: skipped lights, and bands that share a walk.

use std::sync::Arc;

use super::state::Slot;
use super::*;
use crate::estimators::path::PathTracer;
use crate::estimators::vertices::WalkVertex;
use crate::estimators::walk::may_fly_side_by_side;
use crate::estimators::{Cost, Layout, Roulette, WalkDraw};
use crate::geometry::{Ray, Shape, procedural};
use crate::math::{DVec3, Frame};
use crate::optics::medium::Medium;
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::StreamKey;
use crate::scene::sensor::Probe;
use crate::scene::{Emission, LatLong, Light, Sensor};

const ROUGH: Boundary =
    Boundary::Rough { eta: 1.4, facets: Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.2 } };
const SMOOTH: Boundary = Boundary::Smooth { eta: 1.4 };

fn guided() -> SneeOptions {
    SneeOptions {
        roulette: Roulette::Below(0.25),
        walk: WalkDraw::Plain {},
        strategies: Strategies { bsdf: true, light: true, top_to_bottom: true, bottom_to_top: true },
        call: Call { most: 0.5, decay: 0.5 },
        call_alone: Call { most: 1.0, decay: 0.5 },
        truncated: false,
        probe: ProbeShares { uniform: 0.2, plane: 0.4, guided: 0.4 },
        joint: JointKind::Mixture,
        last_vertex: Some(LastVertex { most: 1.0, decay: 0.5, wide_share: 0.25, wide: 0.2 }),
        connection: None,
        expected_reflection: true,
        expected_passage: false,
        views: 1,
        least_concentration: 10.0,
        share_bands: false,
        learned_calls: None,
        photons: None,
    }
}

fn cap(solid_angle: f64, bands: usize) -> Light {
    let frame = Frame::about(DVec3::new(0.6, 0.0, 0.8));
    let height = solid_angle / (2.0 * std::f64::consts::PI);
    Light { name: "cap".into(), emission: Emission::Cap { frame, height, radiance: vec![1.0; bands] } }
}

fn scene(boundary: Boundary, media: &[(f64, f64, f64)], light: Light) -> Arc<Scene> {
    let ray = Ray { origin: DVec3::new(0.3, -0.4, 3.0), dir: -DVec3::Z };
    Arc::new(Scene {
        shape: Arc::new(Shape::Sphere { radius: 1.0 }),
        boundary: vec![boundary; media.len()],
        medium: media
            .iter()
            .map(|&(sigma_t, albedo, g)| Medium {
                sigma_t,
                albedo,
                phase: HenyeyGreenstein { g },
                emission: 0.0,
            })
            .collect(),
        lights: vec![light],
        sensor: Sensor::Probe(Probe { ray, paths: 256 }),
    })
}

fn run(scene: &Arc<Scene>, estimator: &dyn Estimator, test: &str) -> Scores {
    let mut scores = Scores::new(Layout::new(scene));
    let key = StreamKey::named(test);
    let bands: Vec<usize> = (0..scene.bands()).collect();
    for pass in 0..20 {
        estimator.pass(&bands, &key.pass(pass), &mut scores);
    }
    scores
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// A light that is not concentrated leaves only the walk: the image and the work of `path`, to
/// the last bit. A concentrated one does not.
#[test]
fn behind_the_gate_it_is_path() {
    for boundary in [ROUGH, SMOOTH, Boundary::Matched] {
        // 4 pi over the solid angle: 9.9 and 10.1, on either side of the limit.
        for (concentration, is_open) in [(1.0, false), (9.9, false), (10.1, true)] {
            let light = cap(4.0 * std::f64::consts::PI / concentration, 1);
            let scene = scene(boundary, &[(10.0, 0.95, 0.3)], light);
            let path =
                PathTracer::new(scene.clone(), Roulette::Below(0.25)).expect("a scene that it serves");
            let path = run(&scene, &path, "behind_the_gate_it_is_path");
            let snee = Snee::new(scene.clone(), guided()).expect("a scene for it");
            let snee = run(&scene, &snee, "behind_the_gate_it_is_path");
            let is_same = bits(&path.observables) == bits(&snee.observables) && path.cost == snee.cost;
            assert_eq!(
                is_same,
                !is_open || boundary == Boundary::Matched,
                "{boundary:?} {concentration}"
            );
            assert!(path.observables[0] > 0.0);
        }
    }
}

/// A map without a bright part is a sky like any other; with a sun, the walk is joined.
#[test]
fn maps_are_split() {
    for (sun, is_open) in [(1.0, false), (1e4, true)] {
        let plane = (0..16 * 32).map(|k| if k == 3 * 32 + 7 { sun } else { 1.0 }).collect();
        let map = Arc::new(LatLong::new(32, 16, vec![plane]));
        let light = Light { name: "map".into(), emission: Emission::Map(map) };
        let scene = scene(ROUGH, &[(10.0, 0.95, 0.0)], light);
        let snee = Snee::new(scene.clone(), guided()).expect("a scene for it");
        assert_eq!(snee.setups[0].guides.len(), usize::from(is_open));
    }
}

/// Bands with the same coefficients get the same bits from a shared walk; others do not.
#[test]
fn equal_bands_are_equal_to_the_last_bit() {
    for boundary in [ROUGH, SMOOTH] {
        for least_concentration in [1.0, 1e9] {
            let media = [(10.0, 0.95, 0.3), (10.0, 0.95, 0.3), (7.0, 0.9, 0.3)];
            let scene = scene(boundary, &media, cap(0.1, 3));
            let options = SneeOptions { share_bands: true, least_concentration, ..guided() };
            let snee = Snee::new(scene.clone(), options).expect("a scene for it");
            let scores = run(&scene, &snee, "equal_bands_are_equal_to_the_last_bit");
            let band = |b: usize| -> Vec<u64> {
                scores.observables.iter().skip(b).step_by(3).map(|value| value.to_bits()).collect()
            };
            assert!(scores.observables[0] > 0.0);
            assert_eq!(band(0), band(1));
            assert_ne!(band(0), band(2));
            assert_eq!(scores.cost[Cost::Paths as usize], 20 * 256, "one walk for all");
        }
    }
}

/// Bands that differ in more than their media cannot share a walk, and are told why.
#[test]
fn what_cannot_be_shared_is_refused() {
    let options = SneeOptions { share_bands: true, ..guided() };
    let refused = |scene: Arc<Scene>| match Snee::new(scene, options.clone()) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("accepted"),
    };
    let media = [(10.0, 0.95, 0.0); 2];
    let mut light = cap(0.1, 2);
    if let Emission::Cap { radiance, .. } = &mut light.emission {
        radiance[1] = 2.0;
    }
    assert!(refused(scene(ROUGH, &media, light)).contains("light `cap` differs"));
    assert!(refused(scene(Boundary::Matched, &media, cap(0.1, 2))).contains("matched"));
    assert!(refused(scene(ROUGH, &[(1.0, 0.5, 0.0); 33], cap(0.1, 33))).contains("33 bands"));
}

/// Without albedo, extinction or a boundary that refracts there is nothing to connect.
#[test]
fn bodies_without_scattering_are_the_walks() {
    for media in [[(0.0, 0.0, 0.0)], [(3.0, 0.0, 0.0)]] {
        let scene = scene(ROUGH, &media, cap(0.1, 1));
        let snee = Snee::new(scene.clone(), guided()).expect("a scene for it");
        let path =
            PathTracer::new(scene.clone(), Roulette::Below(0.25)).expect("a scene that it serves");
        let test = "bodies_without_scattering_are_the_walks";
        let [snee, path] = [run(&scene, &snee, test), run(&scene, &path, test)];
        assert_eq!(bits(&snee.observables), bits(&path.observables));
    }
}

/// Walks, guided and plain, that connect at their vertices, side by side in lanes and one after the other: scores, counters and anomalies
/// are the same, to the last bit. The sun is behind the body, a disc is not; under one light alone, walks pass most vertices.
#[test]
fn connections_side_by_side_are_connections_one_by_one() {
    let walk = WalkDraw::Guided { share: 0.9, nodes: 12, least_depth: Some(0.0), near_lights: true };
    let called = SneeOptions { walk, ..guided() };
    let connected = SneeOptions { connection: Some(ConnectionCall::default()), ..called.clone() };
    let mesh = procedural::bumpy_sphere(1.0, 3, 0.2, 5.0, true).expect("closed");
    let bodies = [Shape::Sphere { radius: 1.0 }, Shape::Slab { thickness: 1.5 }, Shape::Mesh(mesh)];
    let toward = DVec3::new(0.0, 0.6, -0.8);
    let sun = || Light {
        name: "sun".into(),
        emission: Emission::Directional { toward, irradiance: vec![1.0, 0.3] },
    };
    let mut events = 0;
    let scenes = bodies
        .iter()
        .flat_map(|body| [(body, ROUGH, &called), (body, SMOOTH, &called), (body, SMOOTH, &connected)])
        .flat_map(|scene| [0, 1, 2].map(|of_lights| (scene, of_lights)));
    for ((body, boundary, options), of_lights) in scenes {
        let lights = match of_lights {
            0 => vec![cap(0.2, 2), sun()],
            1 => vec![sun()],
            _ => vec![cap(0.2, 2)],
        };
        let disc = scene(boundary, &[(9.0, 0.9, 0.0), (6.0, 0.99, 0.7)], cap(0.2, 2));
        let sphere = Arc::into_inner(disc).expect("not shared");
        let scene = Arc::new(Scene { shape: Arc::new(body.clone()), lights, ..sphere });
        let is_mesh = matches!(body, Shape::Mesh(_));
        let plain = SneeOptions { walk: WalkDraw::Plain {}, ..options.clone() };
        for options in [options, &plain].into_iter().take(if is_mesh { 1 } else { 2 }) {
            let snee = Snee::new(scene.clone(), options.clone()).expect("a scene that it serves");
            let field = snee.walks.field();
            let key = StreamKey::named("connections_side_by_side_are_connections_one_by_one");
            let keys = [0, 1].map(|pass| key.pass(pass));
            let new = || keys.map(|_| Scores::new(Layout::new(&scene)));
            let [mut side_by_side, mut one_by_one] = [new(), new()];
            assert!(snee.passes_at_once(&[0, 1]) > 1);
            snee.passes(&[0, 1], &keys, &mut side_by_side);
            for band in [0, 1] {
                assert!(may_fly_side_by_side(field, band));
                for (key, one_by_one) in keys.iter().zip(&mut one_by_one) {
                    for index in 0..scene.sensor.rays_per_pass() {
                        snee.trace(
                            &snee.setups[band],
                            None,
                            Path { field, band, index, key },
                            one_by_one,
                        );
                    }
                }
            }
            for (side_by_side, one_by_one) in side_by_side.iter().zip(&one_by_one) {
                assert_eq!(bits(&side_by_side.observables), bits(&one_by_one.observables));
                assert_eq!(side_by_side.cost, one_by_one.cost);
                assert_eq!(side_by_side.anomalies, one_by_one.anomalies);
                assert!(one_by_one.observables.iter().any(|&score| score > 0.0));
                events += one_by_one.cost[Cost::MediumEvents as usize];
            }
        }
    }
    assert!(events > 40_000, "{events} events");
}

/// No specular guess is nearer than its lower bound, which lets calls fail before the guess is made.
#[test]
fn guesses_are_no_nearer_than_their_bound() {
    let mesh = procedural::bumpy_sphere(1.0, 3, 0.2, 5.0, true).expect("closed");
    let half = DVec3::new(0.5, 0.8, 0.4);
    let bodies =
        [Shape::Sphere { radius: 1.0 }, Shape::Box { half }, Shape::HalfSpace, Shape::Mesh(mesh)];
    let stream = &mut StreamKey::named("guesses_are_no_nearer_than_their_bound").pass(0);
    let mut stream = stream.stream(0, Purpose::Walk);
    for (body, eta) in bodies.iter().flat_map(|body| [(body, 1.4), (body, 0.8)]) {
        let sphere = scene(Boundary::Smooth { eta }, &[(9.0, 0.9, 0.0)], cap(0.2, 1));
        let sphere = Arc::into_inner(sphere).expect("not shared");
        let scene = Arc::new(Scene { shape: Arc::new(body.clone()), ..sphere });
        let snee = Snee::new(scene.clone(), guided()).expect("a scene that it serves");
        let mut scores = Scores::new(Layout::new(&scene));
        let key = StreamKey::named("guesses_are_no_nearer_than_their_bound").pass(1);
        let path = Path { field: snee.walks.field(), band: 0, index: 0, key: &key };
        let connections = Connections::of_path(&snee.setups[0], &path);
        let guide = &snee.setups[0].guides[0];
        // A mesh would be megabytes of text.
        let name = if body.is_convex() { format!("{body:?}") } else { "mesh".into() };
        let (mut guesses, mut beyond) = (0, 0);
        let mut walk = CameraWalk::led(path, &mut scores, connections, OneBand, DVec3::ZERO);
        for _ in 0..2000 {
            let [x, y] = stream.draw2().map(|u| 1.6 * u - 0.8);
            let point = DVec3::new(x, y, 1.6 * stream.draw() - 0.8);
            if !scene.shape.contains(point) {
                continue;
            }
            walk.rivals.arrive(WalkVertex { point, arrival: DVec3::Z, walks: 1.0 });
            let least = walk.least_distance(guide);
            let Some(guess) = walk.guess(Slot::Latest, guide) else { continue };
            assert!(least <= guess.distance, "{name} {eta} {point}: {least} and {}", guess.distance);
            guesses += 1;
            beyond += u32::from(least > 1.05 * scene.shape.clearance(point));
        }
        assert!(guesses > 200, "{name} {eta}: {guesses}");
        // It is worth more than the clearance where the light's side of the body is not the nearest.
        let has_other_sides = !matches!(body, Shape::HalfSpace);
        assert!(!has_other_sides || beyond > guesses / 4, "{name} {eta}: {beyond}");
    }
}
