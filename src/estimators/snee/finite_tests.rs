//! That no score is NaN or infinite and no path is lost, on many bodies and by every technique that connects: of 300 thousand
//! medium vertices, or of a thousand million.

use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use super::testing::{Lamp, ROUGH, SMOOTH, body, medium, ring, sphere};
use super::*;
use crate::estimators::connection::{ConnectionMethod, SpecularConnection};
use crate::estimators::{Anomaly, Cost, Layout, Roulette};
use crate::geometry::{Mesh, Shape, procedural};
use crate::math::{DVec3, Frame};
use crate::sampling::stream::StreamKey;
use crate::scene::Sensor;
use crate::scene::sensor::BodyFlux;

const BANDS: [usize; 2] = [0, 1];

/// Shares of an analytic body, of a mesh with flat normals and of one with interpolated normals in all medium vertices. What takes
/// less time takes more of them: 96 % are in the sphere and the box.
const SHARES: [u64; 3] = [256, 4, 1];

/// Bodies and their shares: convex and not, with bumps of three sizes, with triangles a hundred times as long as wide, with normals
/// that turn by more than a right angle within a triangle, and far from the origin.
fn bodies() -> Vec<(&'static str, Arc<Shape>, u64)> {
    let [analytic, flat, interpolated] = SHARES;
    let mesh = |mesh: Result<Mesh>| Arc::new(Shape::Mesh(mesh.expect("closed")));
    let bumps = |wavenumber, amplitude, smooth| {
        mesh(procedural::bumpy_sphere(1.0, 4, amplitude, wavenumber, smooth))
    };
    let ball = procedural::icosphere(1.0, 2, true).expect("closed");
    let moved = ball.vertices().iter().map(|v| *v + DVec3::new(1e4, -3e3, 700.0)).collect();
    let far = Mesh::new(moved, ball.triangles().to_vec(), None, true);
    vec![
        ("sphere", sphere(), analytic),
        ("box", Arc::new(Shape::Box { half: DVec3::new(0.8, 0.6, 1.0) }), analytic),
        ("ring", ring(), flat),
        ("long triangles", mesh(procedural::torus(1.0, 0.05, [3, 100], false)), flat),
        ("bumps, 6", bumps(6.0, 0.05, false), flat),
        ("bumps, 40", bumps(40.0, 0.01, false), flat),
        ("bumps, 12, interpolated", bumps(12.0, 0.03, true), interpolated),
        ("spikes, interpolated", bumps(300.0, 0.3, true), interpolated),
        ("far, interpolated", mesh(far), interpolated),
    ]
}

/// Every technique that connects, at a smooth and at a rough boundary, under the sun and two discs of directions.
fn estimators(shape: &Arc<Shape>) -> Vec<(String, Arc<Scene>, Box<dyn Estimator>)> {
    use ConnectionMethod::{Conic, Mnee, Newton, Segments, Sms, StraightLine};
    let media = [medium(2.0, 0.9, 0.3), medium(6.0, 0.95, 0.8)];
    let scene = |boundary| {
        let scene = body(shape, boundary, &media, &[Lamp::Sun, Lamp::Disc, Lamp::WideDisc]);
        let mut scene = Arc::into_inner(scene).expect("not shared");
        let bounds = shape.bounds().expect("finite");
        let sensor = BodyFlux { bounds, frame: Frame::about(DVec3::Z), bins: 1, paths: 64 };
        scene.sensor = Sensor::BodyFlux(sensor);
        Arc::new(scene)
    };
    let [smooth, rough] = [SMOOTH, ROUGH].map(scene);
    let mut all: Vec<(String, Arc<Scene>, Box<dyn Estimator>)> = Vec::new();
    let walks = [Newton {}, Mnee {}, Sms {}];
    let of_smooth = [Conic {}, Segments {}, StraightLine {}].into_iter().chain(walks);
    let of_rough = walks.into_iter().map(|method| ("rough", &rough, method));
    for (name, scene, method) in of_smooth.map(|method| ("smooth", &smooth, method)).chain(of_rough) {
        let connection = SpecularConnection::new(scene.clone(), method, Roulette::default());
        let connection = connection.expect("a scene for it");
        all.push((format!("{method:?}, {name}"), scene.clone(), Box::new(connection)));
    }
    for preset in [SneePreset::Paper, SneePreset::Guided] {
        let choices = || SneeChoices { preset, ..Default::default() };
        let connected = Snee::connected(smooth.clone(), choices().connected().expect("options"));
        let alone = Snee::new(rough.clone(), choices().options().expect("options"));
        for (name, scene, snee) in [("smooth", &smooth, connected), ("rough", &rough, alone)] {
            let snee = snee.expect("a scene for it");
            all.push((format!("{preset:?}, {name}"), scene.clone(), Box::new(snee)));
        }
    }
    all
}

/// Medium vertices that passes of an estimator visit, `least` or more, on all cores; none of their scores is lost or not finite.
fn visit(name: &str, scene: &Scene, estimator: &dyn Estimator, least: u64) -> u64 {
    let key = StreamKey::named(name);
    let [next, vertices] = [const { AtomicU64::new(0) }; 2];
    estimator.prepare();
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                let mut scores = Scores::new(Layout::new(scene));
                while vertices.load(Ordering::Relaxed) < least {
                    let pass = next.fetch_add(1, Ordering::Relaxed);
                    let before = scores.cost[Cost::MediumEvents as usize];
                    scores.clear();
                    estimator.pass(&BANDS, &key.pass(pass), &mut scores);
                    let visited = scores.cost[Cost::MediumEvents as usize] - before;
                    vertices.fetch_add(visited, Ordering::Relaxed);
                    let anomalies = [Anomaly::NonFinite, Anomaly::LostRay];
                    let anomalies = anomalies.map(|kind| scores.anomalies[kind as usize]);
                    assert_eq!(anomalies, [0; 2], "{name}, pass {pass}");
                    assert!(scores.observables.iter().all(|score| score.is_finite()), "{name}, {pass}");
                }
            });
        }
    });
    vertices.into_inner()
}

fn audit(least: u64) {
    let bodies: Vec<_> =
        bodies().into_iter().map(|(name, shape, share)| (name, share, estimators(&shape))).collect();
    let shares: u64 = bodies.iter().map(|(_, share, all)| share * all.len() as u64).sum();
    let mut visited = 0;
    for (body, share, estimators) in &bodies {
        let mut of_body = 0;
        for (name, scene, estimator) in estimators {
            let least = (least * share).div_ceil(shares);
            of_body += visit(&format!("{body}, {name}"), scene, &**estimator, least);
        }
        println!("{body}: {} techniques, {of_body} medium vertices", estimators.len());
        visited += of_body;
    }
    println!("{visited} medium vertices, no score that is not finite, no lost ray");
    assert!(visited >= least);
}

#[test]
fn no_score_is_nan() {
    audit(300_000);
}

#[test]
#[ignore = "three quarters of an hour on two cores: 1e9 medium vertices"]
fn no_score_is_nan_of_a_thousand_millions() {
    audit(1_000_000_000);
}
