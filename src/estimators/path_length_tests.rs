//! Mean path lengths in white light, and derivatives of a flux in any light.

use std::f64::consts::PI;
use std::sync::Arc;

use super::bssrdf_rays::BssrdfRays;
use super::light_trace::LightTracer;
use super::path::{PathTracer, Roulette};
use super::snee::Snee;
use super::{Estimator, Layout, Scores, TransportClass};
use crate::geometry::{Shape, procedural};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::optics::medium::Medium;
use crate::sampling::stream::StreamKey;
use crate::scene::sensor::{Ball, BodyFlux, PathLength};
use crate::scene::{Emission, Light, Scene, Sensor};

const PATHS: usize = 1024;
const PASSES: u64 = 256;
const SMOOTH: Boundary = Boundary::Smooth { eta: 1.3 };
const SPHERE: Shape = Shape::Sphere { radius: 0.5 };

fn body_flux(shape: &Shape) -> BodyFlux {
    let bounds = shape.bounds().expect("a finite body");
    BodyFlux { bounds, frame: Frame::about(DVec3::Z), bins: 1, paths: PATHS }
}

fn lengths(shape: &Shape, ball: Option<Ball>) -> Sensor {
    let area = shape.area().expect("a finite body");
    Sensor::PathLength(PathLength { flux: body_flux(shape), area, ball })
}

/// Radiance 2 from a cap of directions; height 2 is every direction.
fn scene(shape: Shape, boundary: Boundary, medium: Medium, height: f64, sensor: Sensor) -> Arc<Scene> {
    let emission = Emission::Cap { frame: Frame::about(DVec3::Z), height, radiance: vec![2.0] };
    let lights = vec![Light { name: "sky".into(), emission }];
    let (boundary, medium) = (vec![boundary], vec![medium]);
    Arc::new(Scene { shape: Arc::new(shape), boundary, medium, lights, sensor })
}

fn both(scene: &Arc<Scene>) -> [(&'static str, Box<dyn Estimator>); 2] {
    let path = PathTracer::new(Arc::clone(scene), Roulette::default()).expect("a scene that it serves");
    let light = LightTracer::new(Arc::clone(scene), None).expect("a scene that it serves");
    [("path", Box::new(path)), ("light_trace", Box::new(light))]
}

/// Mean and standard error of every region, all classes together.
fn measure(estimator: &dyn Estimator, scene: &Scene, test: &str) -> Vec<(f64, f64)> {
    let mut scores = Scores::new(Layout::new(scene));
    let key = StreamKey::named(test);
    let mut sums = Vec::new();
    for pass in 0..PASSES {
        scores.clear();
        estimator.pass(&[0], &key.pass(pass), &mut scores);
        let regions = scores.observables.iter().step_by(1 + TransportClass::ALL.len());
        let regions: Vec<f64> = regions.copied().collect();
        sums.resize(regions.len(), (0.0, 0.0));
        for (sum, x) in sums.iter_mut().zip(regions) {
            *sum = (sum.0 + x, sum.1 + x * x);
        }
    }
    assert!(scores.anomalies.iter().all(|&count| count == 0));
    let n = PASSES as f64;
    let estimate = |(sum, squares): (f64, f64)| {
        let mean = sum / n;
        (mean, ((squares / n - mean * mean).max(0.0) / (n - 1.0)).sqrt())
    };
    sums.into_iter().map(estimate).collect()
}

/// |z| < 5 where there is sampling error, else equal to 1e-12; 5 standard errors are below 5 %.
fn assert_mean(what: &str, (mean, error): (f64, f64), expected: f64) {
    let deviation = (mean - expected).abs();
    assert!(
        deviation < 5.0 * error + 1e-12 * expected,
        "{what}: {mean} +- {error}, expected {expected}"
    );
    assert!(5.0 * error < 0.05 * expected, "{what}: {error} of {expected}");
}

/// 4 eta^2 V / S is 4 eta^2 R / 3 in a sphere, times the sky's radiance; 4 eta^2 r^3 / (3 R^2) in a ball.
#[test]
fn lossless_means_of_a_sphere() {
    let ball = Ball { center: DVec3::new(0.1, 0.0, 0.2), radius: 0.25 };
    let medium = Medium::new(0.0, 3.0, 0.5);
    for (ball, expected) in [(None, 4.0 * 1.69 * 0.5 / 3.0), (Some(ball), 4.0 * 1.69 * 0.0625 / 3.0)] {
        let [length, incident] = scene(SPHERE, SMOOTH, medium, 2.0, lengths(&SPHERE, ball))
            .lossless_means(0)
            .expect("lengths");
        assert!(
            (length / (2.0 * expected) - 1.0).abs() < 1e-14 && incident == 2.0,
            "{length} {expected}"
        );
    }
    let flux = Sensor::BodyFlux(body_flux(&SPHERE));
    assert_eq!(scene(SPHERE, SMOOTH, medium, 2.0, flux).lossless_means(0), None);
}

/// Both estimators have these means: convex and not, matched and smooth, thin and thick, in the whole
/// body and in a ball.
#[test]
#[ignore = "10 s: claims of experiments/verify look at it with every change, this one at night"]
fn mean_path_lengths() {
    let torus = || Shape::Mesh(procedural::torus(0.6, 0.3, [16, 8], false).expect("closed"));
    let hollow = || Shape::Mesh(procedural::cavity_sphere(0.6, 0.3, 2, false).expect("closed"));
    let ball = Some(Ball { center: DVec3::new(0.1, 0.0, 0.1), radius: 0.25 });
    let cases = [
        ("sphere", SPHERE, SMOOTH, Medium::new(0.0, 10.0, 0.8), None),
        ("ball", SPHERE, SMOOTH, Medium::new(0.0, 1.0, 0.0), ball),
        ("ball, matched", SPHERE, Boundary::Matched, Medium::new(0.0, 5.0, -0.5), ball),
        ("torus", torus(), SMOOTH, Medium::new(0.0, 1.0, 0.0), None),
        ("hollow sphere", hollow(), Boundary::Matched, Medium::new(0.0, 5.0, -0.5), None),
    ];
    for (what, shape, boundary, medium, ball) in cases {
        let sensor = lengths(&shape, ball);
        let scene = scene(shape, boundary, medium, 2.0, sensor);
        let expected = scene.lossless_means(0).expect("lengths");
        for (name, estimator) in both(&scene) {
            let name = format!("mean_path_lengths, {what}, {name}");
            let found = measure(&*estimator, &scene, &name);
            found
                .into_iter()
                .zip(expected)
                .for_each(|(found, expected)| assert_mean(&name, found, expected));
        }
    }
}

/// In any light and with absorption, flux and path length are related by the derivative with respect to
/// sigma_a. Between sigma_a = 0.9 and 1.1 the flux decreases by 0.2 times the mean length at 1, up to the
/// third order, which is 0.01 / 6 of it times (l in mm)^2 < 1.
#[test]
fn path_length_is_a_derivative() {
    let shape = || Shape::Box { half: DVec3::new(0.3, 0.4, 0.5) };
    let medium = |sigma_a| Medium::new(sigma_a, 3.0, 0.3);
    let with = |sigma_a, sensor| scene(shape(), SMOOTH, medium(sigma_a), 1.0, sensor);
    let middle = with(1.0, lengths(&shape(), None));
    let power = PI * shape().area().expect("finite");
    for (index, (name, estimator)) in both(&middle).iter().enumerate() {
        let test = format!("path_length_is_a_derivative, {name}");
        let length = measure(&**estimator, &middle, &test)[0];
        let [(less, error_less), (more, error_more)] = [0.9, 1.1].map(|sigma_a| {
            let scene = with(sigma_a, Sensor::BodyFlux(body_flux(&shape())));
            measure(&*both(&scene)[index].1, &scene, &format!("{test}, {sigma_a}"))[0]
        });
        let slope = (less - more) / 0.2 / power;
        let error = error_less.hypot(error_more) / 0.2 / power;
        let z = (slope - length.0) / error.hypot(length.1);
        assert!(z.abs() < 5.0, "{test}: {slope} +- {error}, {length:?}");
        assert!(error < 0.05 * length.0, "{test}: {error} of {length:?}");
    }
}

/// Estimators that do not follow a path inside are refused.
#[test]
fn others_are_refused() {
    let scene = scene(SPHERE, SMOOTH, Medium::new(0.0, 3.0, 0.5), 2.0, lengths(&SPHERE, None));
    for kind in [Snee::KIND, BssrdfRays::KIND] {
        let message = kind.check(&scene).expect_err("refused").to_string();
        assert!(
            message.contains("does not keep how far") && message.contains("light_trace"),
            "{message}"
        );
    }
}
