//! Identities, closed forms and published numbers for the path tracer.

use super::super::bands::{OneBand, SharedBands, WalkBands};
use super::super::field::{Field, Path};
use super::super::guidance::GuidedBand;
use super::super::roulette::roulette;
use super::super::testing;
use super::super::vertices::WalkExit;
use super::super::walk::{CameraWalk, Rivals, Unrivalled, may_fly_side_by_side, trace_passes};
use super::super::{Cost, Layout};
use super::*;
use crate::geometry::{Ray, Shape, procedural};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::BoundarySample;
use crate::optics::medium::Medium;
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::StreamKey;
use crate::scene::sensor::{Orthographic, Probe, Screen};
use crate::scene::{Emission, Light, Sensor};

fn environment(radiance: f64, toward: DVec3, height: f64, name: &str) -> Light {
    let frame = Frame::about(toward);
    Light { name: name.into(), emission: Emission::Cap { frame, height, radiance: vec![radiance] } }
}

fn scene(shape: Shape, boundary: Boundary, medium: Medium, lights: Vec<Light>, ray: Ray) -> Scene {
    let sensor = Sensor::Probe(Probe { ray, paths: 1000 });
    Scene { shape: Arc::new(shape), boundary: vec![boundary], medium: vec![medium], lights, sensor }
}

fn medium(sigma_t: f64, albedo: f64, g: f64) -> Medium {
    Medium { sigma_t, albedo, phase: HenyeyGreenstein { g }, emission: 0.0 }
}

fn down() -> Ray {
    Ray { origin: DVec3::new(0.0, 0.0, 3.0), dir: -DVec3::Z }
}

fn measure(scene: Scene, roulette: Roulette, passes: u64, test: &str) -> (Vec<(f64, f64)>, Scores) {
    let layout = Layout::new(&scene);
    let tracer = PathTracer::new(Arc::new(scene), roulette).expect("a scene that it serves");
    testing::measure(&tracer, &layout, passes, test)
}

const SPHERE: Shape = Shape::Sphere { radius: 1.0 };
const ROULETTES: [Roulette; 2] = [Roulette::Analog {}, Roulette::Below(0.25)];

fn off_axis() -> Ray {
    Ray { origin: DVec3::new(0.3, -0.5, 3.0), dir: -DVec3::Z }
}

/// Without absorption, inside a constant environment of radiance 1, a smooth or matched body looks
/// like radiance 1 from everywhere, path by path.
#[test]
fn white_furnace_has_no_variance() {
    for boundary in [Boundary::Smooth { eta: 1.3 }, Boundary::Smooth { eta: 1.5 }] {
        for roulette in ROULETTES {
            let sky = environment(1.0, DVec3::Z, 2.0, "sky");
            let scene = scene(SPHERE, boundary, medium(5.0, 1.0, 0.3), vec![sky], off_axis());
            let (means, _) = measure(scene, roulette, 20, "white_furnace_has_no_variance");
            assert!((means[0].0 - 1.0).abs() < 1e-12 && means[0].1 < 1e-12, "{means:?}");
        }
    }
}

/// The matched body adds light samples to every vertex: the same mean, with variance.
#[test]
fn matched_furnace() {
    let sky = environment(1.0, DVec3::Z, 2.0, "sky");
    let scene = scene(SPHERE, Boundary::Matched, medium(5.0, 1.0, 0.3), vec![sky], off_axis());
    let (means, _) = measure(scene, Roulette::Analog {}, 200, "matched_furnace");
    let (mean, error) = means[0];
    assert!((mean - 1.0).abs() < 5.0 * error && error < 5e-3, "{mean} {error}");
}

/// Slabs lit on one face, seen along the normal: total reflectance and transmittance.
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
        for roulette in ROULETTES {
            let lights = vec![
                environment(1.0, DVec3::Z, 1.0, "above"),
                environment(1.0, -DVec3::Z, 1.0, "below"),
            ];
            let slab = Shape::Slab { thickness: 1.0 };
            let scene = scene(slab, Boundary::Smooth { eta }, medium(b, albedo, g), lights, down());
            let (means, scores) = measure(scene, roulette, 100, "slab_reflectance_and_transmittance");
            for (expected, (mean, error)) in [reflected, transmitted].iter().zip(&means[6..8]) {
                assert!((mean - expected).abs() < 5.0 * error && *error < 3e-3, "{means:?}");
            }
            let classes: f64 = means[1..6].iter().map(|m| m.0).sum();
            assert!((classes - means[0].0).abs() < 1e-12);
            assert_eq!(scores.anomalies, [0; 3]);
        }
    }
}

/// Matched half-space lit by parallel light: Chandrasekhar's exact radiance, w = 0.9, mu = mu0 = 1,
/// f_r from the H function (rows of experiments/verify/chandrasekhar_brdf.csv).
#[test]
fn matched_half_space_under_parallel_light() {
    let sun = Light {
        name: "sun".into(),
        emission: Emission::Directional { toward: DVec3::Z, irradiance: vec![1.0] },
    };
    let scene = scene(Shape::HalfSpace, Boundary::Matched, medium(1.0, 0.5, 0.0), vec![sun], down());
    let (means, _) =
        measure(scene, Roulette::Below(0.25), 300, "matched_half_space_under_parallel_light");
    let (total, single) = (means[0], means[2]);
    assert!((total.0 - 0.03114762692835).abs() < 5.0 * total.1 && total.1 < 1e-4, "{total:?}");
    assert!((single.0 - 0.01989436788649).abs() < 5.0 * single.1, "{single:?}");
}

/// Rough boundary: MIS agrees with light sampling's complement, a cap grown to the whole sphere.
#[test]
fn rough_furnace_is_the_same_for_one_light_or_two_halves() {
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.2 };
    let boundary = Boundary::Rough { eta: 1.3, facets };
    let whole = vec![environment(1.0, DVec3::Z, 2.0, "sky")];
    let halves =
        vec![environment(1.0, DVec3::X, 1.0, "right"), environment(1.0, -DVec3::X, 1.0, "left")];
    let mut results = Vec::new();
    for lights in [whole, halves] {
        let scene = scene(SPHERE, boundary, medium(2.0, 0.9, 0.5), lights, off_axis());
        results.push(
            measure(
                scene,
                Roulette::Below(0.25),
                200,
                "rough_furnace_is_the_same_for_one_light_or_two_halves",
            )
            .0[0],
        );
    }
    let [(a, ea), (b, eb)] = results[..] else { unreachable!() };
    assert!((a - b).abs() < 5.0 * (ea * ea + eb * eb).sqrt() && ea < 2e-3, "{results:?}");
    assert!(a < 0.9, "absorption is seen: {a}");
}

/// D6: for directions of either technique, both reported densities agree with the ones asked of the
/// other, and the two weights sum to 1.
#[test]
fn weights_of_both_techniques_sum_to_one() {
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 };
    let boundary = Boundary::Rough { eta: 1.4, facets };
    let light = environment(2.0, DVec3::new(0.6, 0.0, 0.8), 0.4, "cap");
    let choice = 0.7;
    let wo = DVec3::new(0.3, 0.2, -0.9).normalize();
    let (mut from_boundary, mut from_light) = (0, 0);
    for i in 0..40_000u32 {
        let u = [0.754_877_666, 0.569_840_291, 0.438_579_021].map(|a| (a * f64::from(i)).fract());
        let drawn = boundary.sample(wo, u).filter(|s| s.wi.z > 0.0);
        let (wi, own, pdf) = match (i % 2, drawn) {
            (0, Some(BoundarySample { wi, .. })) => (wi, boundary.eval(wo, wi).1, light.eval(0, wi).1),
            (1, _) => {
                let sample = light.sample(0, [u[0], u[1]]);
                let pdf = sample.pdf.unwrap_or(0.0);
                assert!((light.eval(0, sample.wi).1 / pdf - 1.0).abs() < 1e-10);
                (sample.wi, boundary.eval(wo, sample.wi).1, pdf)
            }
            _ => continue,
        };
        assert!((boundary.eval(wo, wi).1 - own).abs() <= 1e-10 * own);
        if own > 0.0 && pdf > 0.0 {
            let balance = |own: f64, other: f64| own / (own + other);
            let sum = balance(own, choice * pdf) + balance(choice * pdf, own);
            assert!((sum - 1.0).abs() < 1e-10);
            *[&mut from_boundary, &mut from_light][(i % 2) as usize] += 1;
        }
    }
    assert!(from_boundary > 500 && from_light > 5000, "{from_boundary} {from_light}");
}

/// D3: roulette keeps its promise, by enumeration of u over 2^16 intervals through the estimator's own
/// arithmetic: survivors times their weight is the weight that came in.
#[test]
fn roulette_is_compensated() {
    for (survival, factor, threshold) in [(0.2, 0.9, 0.25), (0.26, 0.5, 0.25), (1.0, 0.9, 0.25)] {
        let after = survival * factor;
        let n = 1u32 << 16;
        let sum: f64 = (0..n)
            .map(|k| {
                let u = (f64::from(k) + 0.5) / f64::from(n);
                roulette(after, threshold, || u).map_or(0.0, |divisor| after / divisor)
            })
            .sum();
        assert!((sum / f64::from(n) - after).abs() < 1.0 / f64::from(n), "{survival} {factor}");
    }
}

/// D10: a walk draws 1 number per flight, 1 per roulette, 2 per phase sample, 3 per surface event,
/// whatever their outcome; so paired scenes stay in step event by event.
#[test]
fn draws_per_event() {
    let sky = environment(1.0, DVec3::Z, 2.0, "sky");
    let scene =
        scene(SPHERE, Boundary::Smooth { eta: 1.3 }, medium(4.0, 0.8, 0.4), vec![sky], off_axis());
    let layout = Layout::new(&scene);
    let tracer = PathTracer::new(Arc::new(scene), Roulette::Analog {}).expect("a scene that it serves");
    let key = StreamKey::named("draws_per_event").pass(0);
    let (mut absorbed, mut escaped) = (0, 0);
    for index in 0..1000 {
        let mut scores = Scores::new(layout.clone());
        let path = Path { field: tracer.walks.field(), band: 0, index, key: &key };
        let draws = CameraWalk::trace(path, &mut scores, Unrivalled, OneBand);
        let [_, rays, _, medium_events, boundary_events, ..] = scores.cost;
        let out = u64::from(scores.observables[0] > 0.0); // it flew to the sky, and scored
        let survived = medium_events - (1 - out); // else the last event ended it
        let flights = rays - 1 - out;
        assert_eq!(draws, flights + medium_events + 2 * survived + 3 * boundary_events);
        *[&mut absorbed, &mut escaped][out as usize] += 1;
    }
    assert!(absorbed > 100 && escaped > 100, "{absorbed} {escaped}");
}

/// D9: bands with equal coefficients, traced on one key, are equal to the last bit; on keys of
/// their own they are not.
#[test]
fn equal_bands_on_one_key_are_equal() {
    let facets = Microfacets { kind: MicrofacetKind::Beckmann, alpha: 0.2 };
    let boundary = Boundary::Rough { eta: 1.3, facets };
    let light = |radiance| Light {
        name: "cap".into(),
        emission: Emission::Cap { frame: Frame::about(DVec3::Z), height: 0.5, radiance },
    };
    let one = scene(SPHERE, boundary, medium(3.0, 0.9, 0.5), vec![light(vec![1.0; 2])], off_axis());
    let scene = Scene { boundary: vec![boundary; 2], medium: vec![one.medium[0]; 2], ..one };
    let layout = Layout::new(&scene);
    let tracer =
        PathTracer::new(Arc::new(scene), Roulette::Below(0.25)).expect("a scene that it serves");
    let key = StreamKey::named("equal_bands_on_one_key_are_equal");
    let mut scores = Scores::new(layout);
    tracer.pass(&[0, 1], &key.pass(0), &mut scores);
    assert!(scores.observables[0] > 0.0);
    assert!(scores.observables.chunks(2).all(|bands| bands[0].to_bits() == bands[1].to_bits()));
    scores.clear();
    tracer.pass(&[0], &key.pass(0), &mut scores);
    tracer.pass(&[1], &key.pass(1), &mut scores);
    assert_ne!(scores.observables[0], scores.observables[1]);
}

/// A scene scaled by a power of two, with coefficients scaled to match, gives the same bits: no
/// absolute length hides anywhere.
#[test]
fn scaled_scenes_give_the_same_bits() {
    type ShapeOfScale = fn(f64) -> Shape;
    let shapes: [ShapeOfScale; 4] = [
        |s| Shape::Sphere { radius: s },
        |s| Shape::Slab { thickness: s },
        |s| Shape::Box { half: DVec3::new(s, 0.7 * s, 0.9 * s) },
        |s| Shape::Mesh(procedural::bumpy_sphere(s, 3, 0.1, 7.0, true).expect("a mesh")),
    ];
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.2 };
    let boundaries = [Boundary::Rough { eta: 1.3, facets }, Boundary::Matched];
    let run = |make: ShapeOfScale, boundary, scale: f64| {
        let sun = Light {
            name: "sun".into(),
            emission: Emission::Directional { toward: DVec3::Z, irradiance: vec![1.0] },
        };
        let lights = vec![sun, environment(0.3, DVec3::X, 1.0, "half")];
        let ray = Ray { origin: scale * DVec3::new(0.25, 0.5, 3.0), dir: -DVec3::Z };
        let scene = scene(make(scale), boundary, medium(4.0 / scale, 0.9, 0.5), lights, ray);
        measure(scene, Roulette::Below(0.25), 1, "scaled_scenes_give_the_same_bits")
    };
    for make in shapes {
        for boundary in boundaries {
            let (unit, unit_scores) = run(make, boundary, 1.0);
            assert!(unit[0].0 > 0.0);
            for k in [-30, -3, 7, 40] {
                let (scaled, scores) = run(make, boundary, (f64::from(k)).exp2());
                assert_eq!(
                    scaled.iter().map(|m| m.0.to_bits()).collect::<Vec<_>>(),
                    unit.iter().map(|m| m.0.to_bits()).collect::<Vec<_>>(),
                    "2^{k} {boundary:?}"
                );
                assert_eq!(scores.cost, unit_scores.cost);
            }
        }
    }
}

/// No technique either, but flights are traced one by one.
struct OneByOne;

impl Rivals for OneByOne {
    fn call<B: WalkBands>(_: &mut CameraWalk<'_, Self, B>) {}

    fn depart<B: WalkBands>(_: &mut CameraWalk<'_, Self, B>) {}

    fn densities<B: WalkBands>(
        _: &mut CameraWalk<'_, Self, B>,
        _: &WalkExit,
        _: usize,
        _: DVec3,
    ) -> f64 {
        0.0
    }
}

/// The same paths with flights traced together and one by one: scores, counters, anomalies and random numbers are the same, to
/// the last bit. Returns how many medium events there were.
fn assert_the_same_one_by_one<B: WalkBands>(field: &Field, bands: B) -> u64 {
    let layout = Layout::new(&field.scene);
    let key = StreamKey::named("flights_at_once_are_flights_one_by_one").pass(0);
    let mut both = [Scores::new(layout.clone()), Scores::new(layout)];
    let [at_once, one_by_one] = &mut both;
    for index in 0..300 {
        let path = Path { field, band: 0, index, key: &key };
        let draws = CameraWalk::trace(path, at_once, Unrivalled, bands.clone());
        assert_eq!(draws, CameraWalk::trace(path, one_by_one, OneByOne, bands.clone()));
    }
    let bits = |scores: &Scores| scores.observables.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(at_once), bits(one_by_one));
    assert_eq!(at_once.cost, one_by_one.cost);
    assert_eq!(at_once.anomalies, one_by_one.anomalies);
    at_once.cost[Cost::MediumEvents as usize]
}

/// Flights that surely end in the medium are traced together, of plain, guided and shared walks; those of plain and shared
/// walks are drawn ahead.
#[test]
fn flights_at_once_are_flights_one_by_one() {
    let sky = || vec![environment(1.0, DVec3::Z, 0.5, "half")];
    let rough =
        Boundary::Rough { eta: 1.4, facets: Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 } };
    let mesh = || Shape::Mesh(procedural::icosphere(1.0, 2, true).expect("closed"));
    let shapes: [fn() -> Shape; 4] = [
        || SPHERE,
        || Shape::Box { half: DVec3::new(0.5, 0.8, 0.4) },
        || Shape::Slab { thickness: 0.7 },
        || Shape::HalfSpace,
    ];
    let shapes = shapes.into_iter().map(|shape| shape()).chain([mesh()]);
    let by_solution =
        WalkDraw::Guided { share: 0.9, nodes: 16, least_depth: Some(0.0), near_lights: true };
    let walks = [WalkDraw::Dwivedi { share: 0.5 }, by_solution];
    let [mut plain, mut guided, mut shared] = [0; 3];
    for shape in shapes {
        for (boundary, g) in
            [(Boundary::Smooth { eta: 1.3 }, 0.0), (rough, 0.7), (Boundary::Matched, 0.2)]
        {
            // Dense, thin, and without extinction, where a flight has no end.
            let media = [8.0, 0.5, 0.0].map(|sigma_t| medium(sigma_t, 0.95, g));
            for (roulette, medium) in ROULETTES.into_iter().flat_map(|r| media.map(|m| (r, m))) {
                let scene = Arc::new(scene(shape.clone(), boundary, medium, sky(), off_axis()));
                let field = Field::new(scene.clone(), roulette);
                plain += assert_the_same_one_by_one(&field, OneBand);
                shared += assert_the_same_one_by_one(&field, SharedBands::new(&scene.medium, 0));
                for walk in walks {
                    let field = Field::with_walks(scene.clone(), roulette, walk, Finder::Walks);
                    if let Some(guidance) = field.guidance(0) {
                        let bands = GuidedBand::new(guidance, &scene.medium[0]);
                        guided += assert_the_same_one_by_one(&field, bands);
                    }
                }
            }
        }
    }
    assert!(plain > 50_000 && shared == plain, "{plain} and {shared} events");
    assert!(guided > 50_000, "{guided} events");
}

/// Two passes of paths traced side by side, and one path after the other: scores, counters and anomalies are the same, to the
/// last bit. Returns how many medium events there were.
fn assert_the_same_side_by_side(scene: Arc<Scene>, options: &PathOptions) -> u64 {
    let layout = Layout::new(&scene);
    let tracer = PathTracer::with_options(scene, options).expect("a scene that it serves");
    let field = tracer.walks.field();
    let key = StreamKey::named("paths_side_by_side_are_paths_one_by_one");
    let keys = [0, 1].map(|pass| key.pass(pass));
    let new = || keys.map(|_| Scores::new(layout.clone()));
    let [mut side_by_side, mut one_by_one] = [new(), new()];
    for band in 0..field.scene.bands() {
        assert!(may_fly_side_by_side(field, band));
        let guidance = field.guidance(band);
        assert_eq!(guidance.is_none(), options.walk == WalkDraw::Plain {});
        trace_passes(field, band, &keys, &mut side_by_side, |_| Unrivalled);
        for (key, one_by_one) in keys.iter().zip(&mut one_by_one) {
            for index in 0..field.scene.sensor.rays_per_pass() {
                let path = Path { field, band, index, key };
                match guidance {
                    Some(guidance) => {
                        let guided = GuidedBand::new(guidance, &field.scene.medium[band]);
                        CameraWalk::trace(path, one_by_one, Unrivalled, guided);
                    }
                    None => _ = CameraWalk::trace(path, one_by_one, Unrivalled, OneBand),
                }
            }
        }
    }
    let bits = |scores: &Scores| {
        scores.observables.iter().chain(&scores.pixels).map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    for (side_by_side, one_by_one) in side_by_side.iter().zip(&one_by_one) {
        assert_eq!(bits(side_by_side), bits(one_by_one));
        assert_eq!(side_by_side.cost, one_by_one.cost);
        assert_eq!(side_by_side.anomalies, one_by_one.anomalies);
    }
    assert!(one_by_one.iter().all(|scores| scores.observables[0] > 0.0));
    one_by_one.iter().map(|scores| scores.cost[Cost::MediumEvents as usize]).sum()
}

/// Under a sky that is brighter on one side and the sun, in two bands; plain walks, and every kind of guide; at a point, and in an
/// image larger than the finite bodies. Plain walks in meshes and in thin bodies are not traced side by side.
#[test]
fn paths_side_by_side_are_paths_one_by_one() {
    let lights = || {
        let sun = Emission::Directional { toward: DVec3::X, irradiance: vec![1.0, 0.3] };
        let sky = Emission::Cap { frame: Frame::about(DVec3::X), height: 0.9, radiance: vec![1.0, 2.0] };
        [("sun", sun), ("sky", sky)].map(|(name, emission)| Light { name: name.into(), emission }).into()
    };
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 };
    let boundaries = [Boundary::Smooth { eta: 1.3 }, Boundary::Rough { eta: 1.4, facets }];
    let bumpy =
        |smooth| Shape::Mesh(procedural::bumpy_sphere(1.0, 3, 0.2, 5.0, smooth).expect("a mesh"));
    let bodies = [
        SPHERE,
        Shape::Box { half: DVec3::new(0.5, 0.8, 0.4) },
        Shape::Slab { thickness: 0.7 },
        Shape::HalfSpace,
        bumpy(false),
        bumpy(true),
    ];
    let by_solution =
        WalkDraw::Guided { share: 0.9, nodes: 16, least_depth: Some(0.0), near_lights: true };
    let learned = WalkDraw::Learned { share: 0.5, cells: 4, paths: 512 };
    let screen = Screen {
        width: 25,
        height: 40,
        right: DVec3::X * 0.12,
        down: DVec3::Y * -0.075,
        view: -DVec3::Z,
        has_tiles: true,
    };
    let image = Sensor::Orthographic(Orthographic { screen, center: DVec3::Z * 3.0 });
    let mut events = 0;
    for body in &bodies {
        for (boundary, walk, roulette) in [
            (boundaries[0], by_solution, ROULETTES[1]),
            (boundaries[1], by_solution, ROULETTES[0]),
            (boundaries[1], WalkDraw::Dwivedi { share: 0.5 }, ROULETTES[1]),
            (boundaries[0], learned, ROULETTES[1]),
            (boundaries[0], WalkDraw::Plain {}, ROULETTES[1]),
            (boundaries[1], WalkDraw::Plain {}, ROULETTES[0]),
        ] {
            let is_plain = walk == WalkDraw::Plain {};
            if is_plain && matches!(body, Shape::Mesh(_)) {
                continue;
            }
            let second = if is_plain { 12.0 } else { 3.0 };
            for (g, sensor) in [(-0.3, None), (0.0, None), (0.8, Some(image.clone()))] {
                let one = scene(body.clone(), boundary, medium(1.0, 0.0, g), lights(), off_axis());
                let sensor = sensor.unwrap_or_else(|| one.sensor.clone());
                let medium = vec![medium(20.0, 0.9, g), medium(second, 0.999, g)];
                let scene = Scene { boundary: vec![boundary; 2], medium, sensor, ..one };
                let options = PathOptions { roulette, walk, sample_even_lights: None };
                events += assert_the_same_side_by_side(Arc::new(scene), &options);
            }
        }
    }
    assert!(events > 1_000_000, "{events} events");
}

/// Under small lights walks are guided where that was measured to pay: where walks enter away from the light, or much is absorbed.
/// A sky beside the lamp, in the band that has it, brings the guide back, and so does the option.
#[test]
fn walks_are_guided_under_small_lights_where_it_pays() {
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.2 };
    let (rough, smooth) = (Boundary::Rough { eta: 1.4, facets }, Boundary::Smooth { eta: 1.4 });
    let cap = |toward: DVec3, height: f64, radiance: [f64; 2]| {
        let emission = Emission::Cap { frame: Frame::about(toward), height, radiance: radiance.into() };
        Light { name: "cap".into(), emission }
    };
    let [side, behind] = [DVec3::new(0.9, 0.0, 0.5), DVec3::new(0.3, 0.0, -0.9)];
    let lamp = |toward| cap(toward, 0.02, [1.0; 2]);
    let mesh = Shape::Mesh(procedural::icosphere(1.0, 3, true).expect("closed"));
    for shape in [SPHERE, mesh] {
        let guided = |boundary, [albedo, g]: [f64; 2], lights: Vec<Light>, near_lights| {
            let dense = medium(10.0 / (1.0 - albedo * g), albedo, g);
            let one = scene(shape.clone(), boundary, dense, lights, off_axis());
            let scene = Scene { boundary: vec![boundary; 2], medium: vec![dense; 2], ..one };
            let walk = WalkDraw::Guided { share: 0.9, nodes: 16, least_depth: Some(0.0), near_lights };
            let options = PathOptions { walk, ..PathOptions::default() };
            let tracer = PathTracer::with_options(Arc::new(scene), &options).expect("a scene");
            [0, 1].map(|band| tracer.walks.field().guidance(band).is_some())
        };
        for (boundary, [albedo, g], toward, expected) in [
            (rough, [0.8, 0.0], side, true),
            (rough, [0.9, 0.0], side, false),
            (rough, [0.95, 0.0], side, false),
            (rough, [0.95, 0.8], side, true),
            (rough, [0.99, 0.8], side, false),
            (rough, [0.99, 0.0], behind, true),
            (smooth, [0.95, 0.0], side, true),
            (smooth, [0.99, 0.0], side, false),
            (smooth, [0.99, 0.0], behind, true),
            (Boundary::Matched, [0.8, 0.0], side, false),
            (Boundary::Matched, [0.9, 0.0], behind, false),
            (Boundary::Matched, [0.95, 0.0], behind, true),
        ] {
            let name = format!("{boundary:?} {albedo} {g} {toward}");
            let lights = || vec![lamp(toward)];
            assert_eq!(guided(boundary, [albedo, g], lights(), false), [expected; 2], "{name}");
            assert_eq!(guided(boundary, [albedo, g], lights(), true), [true; 2], "{name}");
        }
        // By strength, radiance times solid angle, the sky has shares of 0.05 and 0.5.
        let lights = vec![lamp(side), cap(DVec3::Z, 2.0, [0.0005, 0.01])];
        assert_eq!(guided(rough, [0.95, 0.0], lights, false), [false, true]);
    }
    // They lose on the lit side of a slab.
    let slab = || Shape::Slab { thickness: 1.0 };
    for (shape, toward, expected) in
        [(slab(), side, false), (slab(), behind, true), (Shape::HalfSpace, side, true)]
    {
        let name = format!("{shape:?} {toward}");
        let scene = scene(shape, rough, medium(10.0, 0.8, 0.0), vec![lamp(toward)], off_axis());
        let walk = WalkDraw::Guided { share: 0.9, nodes: 16, least_depth: None, near_lights: false };
        let options = PathOptions { walk, ..PathOptions::default() };
        let tracer = PathTracer::with_options(Arc::new(scene), &options).expect("a scene");
        assert_eq!(tracer.walks.field().guidance(0).is_some(), expected, "{name}");
    }
}
