//! Random streams as estimators use them: no number is used for two purposes.

use std::collections::HashSet;
use std::sync::Arc;

use serde_json::json;

use super::*;
use crate::geometry::{BoundingSphere, Ray, Shape};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::optics::medium::Medium;
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::{PURPOSES, Purpose, StreamKey, opened_by};
use crate::scene::sensor::{BodyFlux, Probe};
use crate::scene::{Emission, Light, Scene, Sensor};

fn scene(sensor: Sensor) -> Arc<Scene> {
    let frame = Frame::about(DVec3::new(0.6, 0.0, 0.8));
    let cap = Emission::Cap { frame, height: 0.01, radiance: vec![1.0; 3] };
    let medium =
        |sigma_t| Medium { sigma_t, albedo: 0.9, phase: HenyeyGreenstein { g: 0.0 }, emission: 0.0 };
    Arc::new(Scene {
        shape: Arc::new(Shape::Sphere { radius: 1.0 }),
        boundary: vec![Boundary::Smooth { eta: 1.4 }; 3],
        medium: [4.0, 6.0, 9.0].map(medium).to_vec(),
        lights: vec![Light { name: "cap".into(), emission: cap }],
        sensor,
    })
}

/// Within a pass every stream is opened once: what two places draw from one stream is the same numbers.
/// Bands that are traced alone have keys of their own, bands that share a walk share its streams.
#[test]
fn no_stream_is_opened_twice() {
    let ray = Ray { origin: DVec3::new(0.3, -0.4, 3.0), dir: -DVec3::Z };
    let probe = scene(Sensor::Probe(Probe { ray, paths: 64 }));
    let bounds = BoundingSphere { center: DVec3::ZERO, radius: 1.0 };
    let flux = BodyFlux { bounds, frame: Frame::about(DVec3::Z), bins: 1, paths: 64 };
    let flux = scene(Sensor::BodyFlux(flux));
    let model = json!({ "classical": {} });
    let cases = [
        ("path", json!({}), &probe),
        ("snee", json!({ "preset": "guided" }), &probe),
        ("snee", json!({ "preset": "paper" }), &probe),
        ("snee", json!({ "bands": "shared" }), &probe),
        ("snee_connect", json!({}), &probe),
        ("bidirectional", json!({}), &probe),
        ("light_trace", json!({}), &flux),
        ("point_cloud", json!({ "model": model, "samples": 16 }), &probe),
        ("bssrdf_probe", json!({ "model": model }), &probe),
        ("bssrdf_rays", json!({ "model": model }), &probe),
    ];
    let mut used = HashSet::new();
    for (name, options, scene) in cases {
        let kind = KINDS.iter().find(|kind| kind.kind == name).expect("a kind");
        let estimator = (kind.build)(&options, scene.clone()).expect("a scene that it serves");
        let bands: Vec<usize> = match estimator.band_use() {
            BandUse::EachAlone => vec![1],
            _ => (0..3).collect(),
        };
        let mut scores = Scores::new(Layout::new(scene));
        let key = StreamKey::named(name);
        let opened = opened_by(|| {
            for pass in 0..3 {
                estimator.pass(&bands, &key.pass(pass), &mut scores);
            }
        });
        let mut names = HashSet::new();
        for (pass, index, purpose) in &opened {
            used.insert(*purpose as u64);
            let stream = (format!("{pass:?}"), *index, *purpose as u64);
            // A cloud draws each point's numbers a second time, in the order of its tree.
            let is_new = names.insert(stream) || *purpose == Purpose::Cloud;
            assert!(is_new, "{name} {options}: {purpose:?} of index {index} is opened twice");
        }
        assert!(names.len() > 3 * 64, "{name}: {} streams", names.len());
    }
    assert!(PURPOSES.iter().all(|&purpose| used.contains(&(purpose as u64))), "{used:?}");
}
