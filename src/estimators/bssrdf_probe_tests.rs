//! Closed forms for the integration of BSSRDFs by probes and by rays, and for single scattering.

use std::f64::consts::PI;

use super::super::bssrdf_rays::{BssrdfRays, RayOptions};
use super::super::path::{PathTracer, Roulette};
use super::super::{Layout, TransportClass};
use super::*;
use crate::geometry::{Mesh, procedural};
use crate::geometry::{Ray, Shape, Side};
use crate::math::DVec3;
use crate::math::integrate;
use crate::optics::boundary::Boundary;
use crate::optics::bssrdf::{Entry, Exit, MomentKind, Outgoing};
use crate::optics::fresnel::fresnel;
use crate::optics::medium::Medium;
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::StreamKey;
use crate::scene::sensor::Probe;
use crate::scene::{Emission, Light, Sensor};

const MODEL: Model = Model::Classical { moments: MomentKind::Exact, outgoing: Outgoing::Plain };

fn medium(sigma_t: f64, albedo: f64, g: f64) -> Medium {
    Medium { sigma_t, albedo, phase: HenyeyGreenstein { g }, emission: 0.0 }
}

/// Radiance 1 from 1 - cos theta < `height` about the zenith: 1 the upper half, 2 everything.
fn sky(bands: usize, height: f64) -> Light {
    let emission = Emission::Cap { frame: Frame::about(DVec3::Z), height, radiance: vec![1.0; bands] };
    Light { name: "sky".into(), emission }
}

fn sun(toward: DVec3) -> Light {
    let emission = Emission::Directional { toward: toward.normalize(), irradiance: vec![1.0] };
    Light { name: "sun".into(), emission }
}

/// Slanted rays that meet the origin's half-space or sphere off its pole.
fn ray() -> Ray {
    let dir = DVec3::new(0.3, -0.2, -0.9).normalize();
    Ray { origin: DVec3::new(0.2, 0.1, 0.0) - dir * 3.0, dir }
}

fn scene(shape: Shape, eta: &[f64], medium: &[Medium], light: Light, paths: usize) -> Arc<Scene> {
    Arc::new(Scene {
        shape: Arc::new(shape),
        boundary: eta.iter().map(|&eta| Boundary::Smooth { eta }).collect(),
        medium: medium.to_vec(),
        lights: vec![light],
        sensor: Sensor::Probe(Probe { ray: ray(), paths }),
    })
}

fn probe_options() -> ProbeOptions {
    ProbeOptions { model: MODEL, probes: 2, single: None, straight: true, reach: None }
}

fn ray_options() -> RayOptions {
    RayOptions { model: MODEL, rays: 4, depth: None, single: None, straight: true }
}

fn probe(scene: &Arc<Scene>) -> BssrdfProbe {
    BssrdfProbe::new(Arc::clone(scene), &probe_options()).expect("a scene that it serves")
}

/// Single scattering alone: no line is as near as this.
fn single(scene: &Arc<Scene>) -> BssrdfProbe {
    let options = ProbeOptions { reach: Some(0.0), ..probe_options() };
    BssrdfProbe::new(Arc::clone(scene), &options).expect("a scene that it serves")
}

fn rays(scene: &Arc<Scene>) -> BssrdfRays {
    BssrdfRays::new(Arc::clone(scene), &ray_options()).expect("a scene that it serves")
}

/// Per band, mean and standard error of one class over passes.
fn measure(
    estimator: &dyn Estimator,
    scene: &Scene,
    class: TransportClass,
    passes: u64,
    test: &str,
) -> Vec<(f64, f64)> {
    let bands: Vec<usize> = (0..scene.bands()).collect();
    let mut scores = Scores::new(Layout::new(scene));
    let key = StreamKey::named(test);
    let mut moments = vec![(0.0, 0.0); bands.len()];
    for pass in 0..passes {
        scores.clear();
        estimator.pass(&bands, &key.pass(pass), &mut scores);
        let first = (1 + class as usize) * bands.len();
        for ((mean, m2), x) in moments.iter_mut().zip(&scores.observables[first..]) {
            let before = x - *mean;
            *mean += before / (pass + 1) as f64;
            *m2 += before * (x - *mean);
        }
    }
    assert!(scores.anomalies.iter().all(|&count| count == 0));
    let n = passes as f64;
    moments.into_iter().map(|(mean, m2)| (mean, (m2 / (n * (n - 1.0))).sqrt())).collect()
}

/// |z| < 5, and 5 standard errors are less than this part of the expected value.
fn assert_mean(name: &str, (mean, error): (f64, f64), expected: f64, detectable: f64) {
    let z = (mean - expected) / error;
    assert!(z.abs() < 5.0, "{name}: {mean} +- {error} of {expected}, z = {z}");
    assert!(5.0 * error < detectable * expected, "{name}: {error} of {expected} detects too little");
}

/// Int of T12 |cos| over the upper hemisphere: pi (1 - 2 C1(1/eta)).
fn diffuse_entry(eta: f64) -> f64 {
    let flux = |mu: f64| 2.0 * PI * mu * (1.0 - fresnel(mu, eta).reflectance);
    integrate(flux, 0.0, 1.0, 1e-12).value
}

/// Int of K over distances up to `r_max` on the plane or, which is the same in chords, on a sphere.
fn kernel_within(bssrdf: &BssrdfScene, band: usize, r_max: f64) -> f64 {
    let exit = Exit { point: DVec3::ZERO, normal: DVec3::Z };
    let kernel = |r: f64| {
        let entry = Entry { point: DVec3::X * r, normal: DVec3::Z, dir: -DVec3::Z };
        2.0 * PI * r * bssrdf.models[band].kernel(&entry, &exit)
    };
    integrate(kernel, 0.0, r_max, 1e-12).value
}

fn t21(eta: f64, cos: f64) -> f64 {
    1.0 - fresnel(cos, eta).reflectance
}

/// On a half-space a probe's density is the kernel up to a factor: the radius adds zero variance.
#[test]
fn half_space_probes_follow_the_kernel() {
    let scene = scene(Shape::HalfSpace, &[1.3], &[medium(2.0, 0.98, 0.3)], sky(1, 1.0), 1);
    let estimator = probe(&scene);
    let exit = Exit { point: DVec3::new(0.3, -0.2, 0.0), normal: DVec3::Z };
    let frame = Frame::about(exit.normal);
    let weight = |r: f64| {
        let offset = DVec3::new(0.6 * r, -0.8 * r, 0.0);
        let entry = Entry { point: exit.point + offset, normal: DVec3::Z, dir: -DVec3::Z };
        let pdf_area = estimator.lines.pdf_area(&[0], &frame, offset, DVec3::Z);
        estimator.bssrdf.models[0].kernel(&entry, &exit) / pdf_area
    };
    for k in -40..=5 {
        let r = (0.5 * f64::from(k)).exp2();
        assert!((weight(r) / weight(1.0) - 1.0).abs() < 1e-12, "{r}: {}", weight(r));
    }
}

/// Under a sky of radiance 1 class multiple is T21 int T12 cos dwi int K dA. 512 passes of 1024 paths; 5
/// standard errors are below 1 %.
#[test]
fn half_space_under_a_sky() {
    let eta = 1.3;
    let scene = scene(Shape::HalfSpace, &[eta], &[medium(2.0, 0.95, 0.3)], sky(1, 1.0), 1024);
    let by_probe = probe(&scene);
    let kernel = kernel_within(&by_probe.bssrdf, 0, 1.0) + {
        // The rest with r = 1/x.
        let bssrdf = &by_probe.bssrdf;
        let exit = Exit { point: DVec3::ZERO, normal: DVec3::Z };
        let far = |x: f64| {
            let entry = Entry { point: DVec3::X / x, normal: DVec3::Z, dir: -DVec3::Z };
            2.0 * PI * bssrdf.models[0].kernel(&entry, &exit) / (x * x * x)
        };
        integrate(far, 0.0, 1.0, 1e-12).value
    };
    let expected = t21(eta, -ray().dir.z) * diffuse_entry(eta) * kernel;
    let estimators: [(&str, &dyn Estimator); 2] = [("probe", &by_probe), ("rays", &rays(&scene))];
    for (name, estimator) in estimators {
        let test = format!("half_space_under_a_sky, {name}");
        let means = measure(estimator, &scene, TransportClass::Multiple, 512, &test);
        assert_mean(name, means[0], expected, 0.01);
    }
}

/// On a sphere of radius R, dA = 2 pi d dd in the distance d between exit and entry, up to 2R. Three
/// bands, of which two share paths and probes. Expected as on the half-space. 384 passes of 2048 paths;
/// 5 standard errors are below 1 %.
#[test]
#[ignore = "10 s: claims of experiments/verify look at it with every change, this one at night"]
fn sphere_under_a_sky() {
    let eta = [1.3, 1.3, 1.5];
    let media = [medium(8.0, 0.95, 0.3), medium(3.0, 0.8, 0.0), medium(5.0, 0.99, 0.5)];
    let scene = scene(Shape::Sphere { radius: 1.0 }, &eta, &media, sky(3, 2.0), 2048);
    let by_probe = probe(&scene);
    let met = Shape::Sphere { radius: 1.0 }.intersect(&ray(), Side::Outside, None, f64::INFINITY);
    let cos = -met.expect("a hit").normal.dot(ray().dir);
    let expected: Vec<f64> = (0..3)
        .map(|b| t21(eta[b], cos) * diffuse_entry(eta[b]) * kernel_within(&by_probe.bssrdf, b, 2.0))
        .collect();
    let estimators: [(&str, &dyn Estimator); 2] = [("probe", &by_probe), ("rays", &rays(&scene))];
    for (name, estimator) in estimators {
        let test = format!("sphere_under_a_sky, {name}");
        let means = measure(estimator, &scene, TransportClass::Multiple, 384, &test);
        for (mean, expected) in means.into_iter().zip(&expected) {
            assert_mean(name, mean, *expected, 0.01);
        }
    }
}

/// Rays from another depth find the same; probes of limited reach find the part of the integral within
/// it. 384 passes of 2048 paths; 5 standard errors are below 1 %.
#[test]
fn depth_does_not_matter_and_reach_does() {
    let sphere = Shape::Sphere { radius: 1.0 };
    let scene = scene(sphere, &[1.3], &[medium(8.0, 0.95, 0.3)], sky(1, 2.0), 2048);
    let met = scene.shape.intersect(&ray(), Side::Outside, None, f64::INFINITY);
    let cos = -met.expect("a hit").normal.dot(ray().dir);
    let options = RayOptions { depth: Some(0.1), ..ray_options() };
    let shallow = BssrdfRays::new(Arc::clone(&scene), &options).expect("it serves");
    let options = ProbeOptions { reach: Some(0.4), ..probe_options() };
    let near = BssrdfProbe::new(Arc::clone(&scene), &options).expect("it serves");
    assert_eq!(near.bias(), Bias::Biased("entries farther than 0.4 mm are left out".into()));
    assert!(kernel_within(&near.bssrdf, 0, 0.4) < 0.9 * kernel_within(&near.bssrdf, 0, 2.0));
    let estimators: [(&str, &dyn Estimator, f64); 2] =
        [("shallow rays", &shallow, 2.0), ("near probes", &near, 0.4)];
    for (name, estimator, r_max) in estimators {
        let expected = t21(1.3, cos) * diffuse_entry(1.3) * kernel_within(&near.bssrdf, 0, r_max);
        let test = format!("depth_does_not_matter_and_reach_does, {name}");
        let means = measure(estimator, &scene, TransportClass::Multiple, 384, &test);
        assert_mean(name, means[0], expected, 0.01);
    }
}

/// Meshes that are known to be convex are seen whole from inside.
#[test]
fn rays_say_what_they_cannot_see() {
    let media = [medium(2.0, 0.95, 0.3)];
    let bias = |mesh: Mesh| rays(&scene(Shape::Mesh(mesh), &[1.3], &media, sky(1, 2.0), 1)).bias();
    for subdivisions in 0..5 {
        let mesh = procedural::icosphere(0.7, subdivisions, false).expect("a mesh");
        assert_eq!(bias(mesh), Bias::Unbiased, "{subdivisions}");
    }
    for mesh in [
        procedural::torus(0.7, 0.3, [24, 12], false),
        procedural::cavity_sphere(1.0, 0.5, 3, false),
        procedural::bumpy_sphere(1.0, 3, 0.05, 7.0, false),
    ] {
        assert!(matches!(bias(mesh.expect("a mesh")), Bias::Biased(_)));
    }
    let box_mesh = procedural::drilled_box(DVec3::ONE, [1, 1], 0.3).expect("a mesh");
    assert!(matches!(bias(box_mesh), Bias::Biased(_)));
}

/// albedo T12 T21 p / (eta^2 (mu_i' + mu_o')) E cos_i: single scattering of parallel light in a
/// half-space.
fn single_closed_form(eta: f64, medium: &Medium, toward: DVec3) -> f64 {
    let [wi, wo] = [toward.normalize(), -ray().dir];
    let [entry, exit] = [wi.z, wo.z].map(|mu| fresnel(mu, eta));
    let inside = |w: DVec3, cos_t: f64| DVec3::new(-w.x / eta, -w.y / eta, -cos_t);
    let mu = inside(wi, entry.cos_t).dot(-inside(wo, exit.cos_t));
    let transmitted = (1.0 - entry.reflectance) * (1.0 - exit.reflectance);
    let way = eta * eta * (entry.cos_t + exit.cos_t);
    medium.albedo * transmitted * medium.phase.pdf(mu) / way * wi.z
}

const SUNS: [DVec3; 3] = [DVec3::Z, DVec3::new(1.0, 0.5, 0.7), DVec3::new(-0.9, 0.3, 0.2)];

/// 192 passes of 1024 paths; 5 standard errors are below 1 %.
#[test]
fn single_scattering_of_a_half_space() {
    for (eta, medium) in [(1.3, medium(2.0, 0.9, 0.6)), (1.5, medium(0.5, 0.5, -0.3))] {
        for toward in SUNS {
            let scene = scene(Shape::HalfSpace, &[eta], &[medium], sun(toward), 1024);
            let estimator = single(&scene);
            let test = format!("single_scattering_of_a_half_space, {eta} {toward}");
            let means = measure(&estimator, &scene, TransportClass::Single, 192, &test);
            assert_mean("single", means[0], single_closed_form(eta, &medium, toward), 0.01);
        }
    }
}

/// The path tracer's class single, which nothing here has a part in: 512 passes of 1024 paths each, 5
/// standard errors of the difference below 6 %: a look from outside at what the closed form above holds
/// to 1 %.
#[test]
fn single_scattering_is_that_of_path_tracing() {
    let media = [medium(2.0, 0.5, 0.4)];
    let scene = scene(Shape::HalfSpace, &[1.3], &media, sky(1, 1.0), 1024);
    let path = PathTracer::new(Arc::clone(&scene), Roulette::Analog {}).expect("a scene that it serves");
    let [ours, traced] =
        [("ours", &single(&scene) as &dyn Estimator), ("path", &path)].map(|(name, e)| {
            let test = format!("single_scattering_is_that_of_path_tracing, {name}");
            measure(e, &scene, TransportClass::Single, 512, &test)[0]
        });
    let error = (ours.1 * ours.1 + traced.1 * traced.1).sqrt();
    assert_mean("single", (ours.0, error), traced.0, 0.06);
}
