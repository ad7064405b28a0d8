//! Media that emit: closed forms, energy, equilibrium, and which estimators score emission.

use std::f64::consts::PI;
use std::sync::Arc;

use super::bssrdf_probe::{BssrdfProbe, ProbeOptions};
use super::light_trace::LightTracer;
use super::path::{PathTracer, Roulette};
use super::point_cloud::{PointCloud, PointCloudOptions};
use super::snee::{Bidirectional, Snee, SneeChoices, TwoBounce};
use super::{Estimator, Layout, Scores, read_options};
use crate::geometry::{Ray, Shape, procedural};
use crate::math::{DVec3, Frame, exp};
use crate::optics::boundary::Boundary;
use crate::optics::bssrdf::{Model, MomentKind, Outgoing};
use crate::optics::fresnel::fresnel;
use crate::optics::medium::Medium;
use crate::sampling::stream::StreamKey;
use crate::scene::sensor::{BodyFlux, FaceFlux, FluxFace, Probe, Rings, Vertex};
use crate::scene::{Emission, Light, Scene, Sensor};

const SMOOTH: Boundary = Boundary::Smooth { eta: 1.5 };
const SPHERE: Shape = Shape::Sphere { radius: 1.0 };
const OFFSET: f64 = 0.4;

fn emitting(sigma_a: f64, sigma_s: f64, g: f64, emission: f64) -> Medium {
    Medium { emission, ..Medium::new(sigma_a, sigma_s, g) }
}

fn sky(radiance: &[f64]) -> Light {
    let emission =
        Emission::Cap { frame: Frame::about(DVec3::Z), height: 2.0, radiance: radiance.to_vec() };
    Light { name: "sky".into(), emission }
}

fn probe() -> Sensor {
    let ray = Ray { origin: DVec3::new(OFFSET, 0.0, 3.0), dir: -DVec3::Z };
    Sensor::Probe(Probe { ray, paths: 64 })
}

fn flux(shape: &Shape) -> Sensor {
    let bounds = shape.bounds().expect("a finite body");
    Sensor::BodyFlux(BodyFlux { bounds, frame: Frame::about(DVec3::Z), bins: 1, paths: 256 })
}

fn faces(thickness: f64) -> Sensor {
    let face = |name, depth: f64, n: DVec3| FluxFace {
        name,
        point: DVec3::new(0.0, 0.0, -depth),
        reach: 1.0,
        frame: Frame::about(n),
    };
    let faces = vec![face("top", 0.0, DVec3::Z), face("bottom", thickness, -DVec3::Z)];
    Sensor::FaceFlux(FaceFlux { faces, bins: 1, paths: 128 })
}

fn scene(
    shape: Shape,
    boundary: Boundary,
    medium: Vec<Medium>,
    lights: Vec<Light>,
    sensor: Sensor,
) -> Arc<Scene> {
    let boundary = vec![boundary; medium.len()];
    Arc::new(Scene { shape: Arc::new(shape), boundary, medium, lights, sensor })
}

/// Mean and standard error over passes, `[observable][band]`.
fn measure(scene: &Scene, estimator: &dyn Estimator, passes: u64, test: &str) -> Vec<(f64, f64)> {
    let mut scores = Scores::new(Layout::new(scene));
    let bands: Vec<usize> = (0..scene.bands()).collect();
    let key = StreamKey::named(test);
    let mut moments = vec![(0.0, 0.0); scores.observables.len()];
    for pass in 0..passes {
        scores.clear();
        estimator.pass(&bands, &key.pass(pass), &mut scores);
        for ((mean, m2), x) in moments.iter_mut().zip(&scores.observables) {
            let before = x - *mean;
            *mean += before / (pass + 1) as f64;
            *m2 += before * (x - *mean);
        }
    }
    assert_eq!(scores.anomalies, [0; 3]);
    let n = passes as f64;
    moments.into_iter().map(|(mean, m2)| (mean, (m2 / (n * (n - 1.0))).sqrt())).collect()
}

fn path(scene: &Arc<Scene>) -> PathTracer {
    PathTracer::new(Arc::clone(scene), Roulette::Below(0.25)).expect("a scene that it serves")
}

fn snee(scene: &Arc<Scene>, options: serde_json::Value) -> Snee {
    let choices: SneeChoices = read_options(&options).expect("options");
    Snee::new(Arc::clone(scene), choices.options().expect("options")).expect("a scene that it serves")
}

fn cloud(scene: &Arc<Scene>) -> crate::error::Result<PointCloud> {
    let model = Model::Classical { moments: MomentKind::Exact, outgoing: Outgoing::Plain };
    let options = PointCloudOptions {
        model,
        samples: 100,
        faces: Default::default(),
        acceptance: Default::default(),
        search: Default::default(),
        single: Some(false),
        straight: true,
    };
    PointCloud::new(Arc::clone(scene), options)
}

/// Chord of the refracted ray in the sphere, the emission that reaches its end, and e^(-sigma_t chord).
fn along_chord(medium: &Medium, eta: f64) -> (f64, f64) {
    let inside = fresnel((1.0 - OFFSET * OFFSET).sqrt(), eta).cos_t;
    let through = exp(-medium.sigma_t * 2.0 * inside);
    (medium.emission / medium.sigma_t * (1.0 - through), through)
}

/// Expected along the probe's ray through an absorbing sphere (scripts/emission.py derives it):
/// T / eta^2 S (1 - a) / (1 - R a). Paths that see it alone, connect to no light, or share their walks
/// between unlike bands all have that mean, and no light is needed.
#[test]
fn an_absorbing_sphere_has_the_radiance_of_its_closed_form() {
    let media = vec![emitting(0.5, 0.0, 0.0, 2.0), emitting(3.0, 0.0, 0.0, 5.0)];
    let scene = scene(SPHERE, SMOOTH, media.clone(), vec![], probe());
    let reflectance = fresnel((1.0 - OFFSET * OFFSET).sqrt(), 1.5).reflectance;
    let shared = serde_json::json!({ "preset": "guided", "bands": "shared" });
    let estimators: [Box<dyn Estimator>; 3] = [
        Box::new(path(&scene)),
        Box::new(snee(&scene, shared)),
        Box::new(Bidirectional::new(Arc::clone(&scene), Roulette::Analog {}).expect("served")),
    ];
    for estimator in estimators {
        let name = "an_absorbing_sphere_has_the_radiance_of_its_closed_form";
        let means = measure(&scene, &*estimator, 400, name);
        for (band, medium) in media.iter().enumerate() {
            let (gained, through) = along_chord(medium, 1.5);
            let expected = (1.0 - reflectance) / 2.25 * gained / (1.0 - reflectance * through);
            let (mean, error) = means[band];
            assert!((mean - expected).abs() < 5.0 * error && error < 0.01 * expected, "{means:?}");
        }
    }
}

/// In balance with absorption, sigma_a eta^2 B, under a sky of radiance B, a body looks like the sky,
/// also in bands that are unlike and share their walks.
#[test]
fn equilibrium_is_the_radiance_of_the_sky() {
    let media = [(1.0, 1.0, 0.8, 1.0), (0.6, 2.4, 0.5, 2.0)]
        .map(|(sigma_a, sigma_s, g, b)| emitting(sigma_a, sigma_s, g, sigma_a * 2.25 * b));
    let torus = || Shape::Mesh(procedural::torus(1.0, 0.7, [24, 12], false).expect("closed"));
    for shape in [SPHERE, torus()] {
        let scene = scene(shape, SMOOTH, media.to_vec(), vec![sky(&[1.0, 2.0])], probe());
        let means = measure(&scene, &path(&scene), 300, "equilibrium_is_the_radiance_of_the_sky");
        for (band, b) in [1.0, 2.0].into_iter().enumerate() {
            let (mean, error) = means[band];
            assert!((mean - b).abs() < 5.0 * error && error < 0.01 * b, "{means:?}");
        }
    }
    // A grey sky of radiance 1, which bands that share walks need: emission for radiance 1 in both.
    let media = media.map(|medium| {
        let sigma_a = medium.sigma_t * (1.0 - medium.albedo);
        Medium { emission: sigma_a * 2.25, ..medium }
    });
    let scene = scene(SPHERE, SMOOTH, media.to_vec(), vec![sky(&[1.0, 1.0])], probe());
    let shared = snee(&scene, serde_json::json!({ "preset": "guided", "bands": "shared" }));
    let means = measure(&scene, &shared, 300, "equilibrium_is_the_radiance_of_the_sky");
    for (mean, error) in &means[..2] {
        assert!((mean - 1.0).abs() < 5.0 * error && *error < 0.01, "{means:?}");
    }
}

/// Bands with equal coefficients and emission that share walks are equal to the last bit, and are what
/// `path` has to rounding: without a concentrated light they are the same walks.
#[test]
fn equal_bands_that_share_walks_are_equal() {
    let media = vec![emitting(0.5, 2.0, 0.3, 1.0); 3];
    let scene = scene(SPHERE, SMOOTH, media, vec![], probe());
    let shared = snee(&scene, serde_json::json!({ "preset": "guided", "bands": "shared" }));
    let shared = measure(&scene, &shared, 2, "equal_bands_that_share_walks_are_equal");
    let alone = measure(&scene, &path(&scene), 2, "equal_bands_that_share_walks_are_equal");
    for (shared, alone) in shared.chunks(3).zip(alone.chunks(3)) {
        assert!(shared.iter().all(|band| band.0.to_bits() == shared[0].0.to_bits()));
        assert!((shared[0].0 - alone[0].0).abs() <= 1e-14 * alone[0].0, "{shared:?} {alone:?}");
    }
    assert!(shared[0].0 > 0.0);
}

/// Without absorption everything that a body emits leaves it: 4 pi epsilon V, photon by photon in a
/// slab, on average where the part of a line inside the body varies: in concave and bumpy bodies.
#[test]
fn what_a_body_emits_leaves_it() {
    let name = "what_a_body_emits_leaves_it";
    let light = |scene: &Arc<Scene>| LightTracer::new(Arc::clone(scene), None).expect("served");
    let medium = || vec![emitting(0.0, 2.0, 0.4, 0.3)];
    for boundary in [SMOOTH, Boundary::Matched] {
        let slab = scene(Shape::Slab { thickness: 0.7 }, boundary, medium(), vec![], faces(0.7));
        let means = measure(&slab, &light(&slab), 4, name);
        let sum = means[0].0 + means[6].0;
        assert!((sum / (4.0 * PI * 0.3 * 0.7) - 1.0).abs() < 1e-12, "{means:?}");
    }
    let meshes = [
        procedural::torus(1.0, 0.4, [24, 12], false),
        procedural::cavity_sphere(1.0, 0.5, 3, false),
        procedural::bumpy_sphere(1.0, 3, 0.2, 6.0, false),
    ];
    let mut shapes: Vec<Shape> = meshes.map(|mesh| Shape::Mesh(mesh.expect("closed"))).into();
    shapes.extend([SPHERE, Shape::Box { half: DVec3::new(0.3, 0.5, 0.7) }]);
    for shape in shapes {
        let expected = 4.0 * PI * 0.3 * shape.volume().expect("a finite body");
        let sensor = flux(&shape);
        let scene = scene(shape, Boundary::Smooth { eta: 1.2 }, medium(), vec![], sensor);
        let (mean, error) = measure(&scene, &light(&scene), 100, name)[0];
        assert!((mean - expected).abs() < 5.0 * error && error < 0.02 * expected, "{mean} {expected}");
    }
}

/// The point cloud adds L_e along the refracted ray: T / eta^2 S (1 - a), with nothing that is scattered
/// or reflected inside.
#[test]
fn a_point_cloud_adds_emission_along_the_refracted_ray() {
    let media = vec![emitting(0.5, 0.5, 0.0, 2.0), emitting(0.5, 2.0, 0.0, 5.0)];
    let reflectance = fresnel((1.0 - OFFSET * OFFSET).sqrt(), 1.5).reflectance;
    for lights in [vec![], vec![sky(&[1.0, 1.0])]] {
        let with_sky = !lights.is_empty();
        let scene = scene(SPHERE, SMOOTH, media.clone(), lights, probe());
        let estimator = cloud(&scene).expect("a scene that it serves");
        let layout = Layout::new(&scene);
        let wanted = if with_sky { "probe@emission" } else { "probe" };
        let place = layout.observables().iter().position(|o| o.name == wanted).expect("a name");
        let name = "a_point_cloud_adds_emission_along_the_refracted_ray";
        let means = measure(&scene, &estimator, 300, name);
        for (band, medium) in media.iter().enumerate() {
            let expected = (1.0 - reflectance) / 2.25 * along_chord(medium, 1.5).0;
            let (mean, error) = means[place * 2 + band];
            assert!((mean - expected).abs() < 5.0 * error && error < 0.01 * expected, "{means:?}");
        }
    }
}

/// Emission has come in nowhere: it counts in `all` of rings, and in none of them, for both tracers.
#[test]
fn rings_hold_no_emission() {
    let sensor = Sensor::Rings(Rings { reach: 1.0, edges: vec![0.0, 1.0, 10.0], paths: 128 });
    let medium = vec![emitting(0.5, 1.0, 0.0, 1.0)];
    let scene = scene(Shape::Slab { thickness: 1.0 }, SMOOTH, medium, vec![], sensor);
    let light = LightTracer::new(Arc::clone(&scene), None).expect("served");
    let name = "rings_hold_no_emission";
    let [from_light, from_sensor] =
        [measure(&scene, &light, 1000, name), measure(&scene, &path(&scene), 400, name)];
    for means in [&from_light, &from_sensor] {
        assert!(means[0].0 > 0.0 && means[6].0 == 0.0 && means[12].0 == 0.0, "{means:?}");
    }
    // One photon in seven leaves by the top: 128,000 of them have an error of 0.7 %.
    let ((a, ea), (b, eb)) = (from_light[0], from_sensor[0]);
    assert!((a - b).abs() < 5.0 * (ea * ea + eb * eb).sqrt() && ea < 0.01 * a, "{a} {b}");
}

/// Estimators that do not count emission refuse it, and light tracing what it could not end or weigh.
#[test]
fn who_does_not_count_emission_refuses_it() {
    let medium = || vec![emitting(0.5, 2.0, 0.0, 1.0)];
    let smooth = scene(SPHERE, SMOOTH, medium(), vec![sky(&[1.0])], probe());
    let model = Model::Classical { moments: MomentKind::Exact, outgoing: Outgoing::Plain };
    let options = ProbeOptions { model, probes: 1, single: None, straight: true, reach: None };
    let refusal = BssrdfProbe::new(Arc::clone(&smooth), &options).expect_err("refused").to_string();
    assert!(refusal.contains("bssrdf_probe does not count light that the medium emits"), "{refusal}");
    assert!(cloud(&smooth).is_ok());

    let vertex = Vertex { ray: Ray { origin: DVec3::ZERO, dir: DVec3::Z }, paths: 1 };
    let inside = scene(SPHERE, SMOOTH, medium(), vec![sky(&[1.0])], Sensor::Vertex(vertex));
    let choices: SneeChoices =
        read_options(&serde_json::json!({ "preset": "guided" })).expect("options");
    let refusal = TwoBounce::new(inside, choices.options().expect("options")).expect_err("refused");
    assert!(refusal.to_string().contains("two_bounce does not count light"), "{refusal}");

    let clear = scene(SPHERE, SMOOTH, vec![emitting(0.0, 0.0, 0.0, 1.0)], vec![], flux(&SPHERE));
    let refusal = LightTracer::new(clear, None).expect_err("refused").to_string();
    assert!(refusal.contains("reflected inside a smooth boundary for ever"), "{refusal}");
    let endless = scene(Shape::HalfSpace, SMOOTH, medium(), vec![], faces(1.0));
    let refusal = LightTracer::new(endless, None).expect_err("refused").to_string();
    assert!(refusal.contains("infinite power"), "{refusal}");
}

/// The share of emission is a source beside the lights; alone it is the total.
#[test]
fn emission_is_a_source_of_its_own() {
    let medium = || vec![emitting(0.5, 2.0, 0.0, 1.0)];
    let names = |lights| {
        let layout = Layout::new(&scene(SPHERE, SMOOTH, medium(), lights, probe()));
        let names = layout.observables().iter().filter(|o| o.name.contains('@'));
        names.map(|o| o.name.clone()).collect::<Vec<_>>()
    };
    assert!(names(vec![]).is_empty());
    assert_eq!(names(vec![sky(&[1.0])]), ["probe@sky", "probe@emission"]);
}
