//! Tests of learned walks.

use super::*;
use crate::estimators::path::{PathOptions, PathTracer};
use crate::estimators::testing::measure;
use crate::geometry::{Shape, procedural};
use crate::math::Frame;
use crate::optics::boundary::Boundary;
use crate::optics::phase::HenyeyGreenstein;
use crate::scene::sensor::Probe;
use crate::scene::{Emission, Light, Sensor};

fn scene(shape: Shape, boundary: Boundary, g: f64, toward: DVec3, height: f64) -> Arc<Scene> {
    let ray = Ray { origin: DVec3::new(0.3, -0.4, 3.0), dir: -DVec3::Z };
    let frame = Frame::about(toward.normalize());
    let emission = Emission::Cap { frame, height, radiance: vec![1.0; 2] };
    let medium = |sigma_t| Medium { sigma_t, albedo: 0.9, phase: HenyeyGreenstein { g }, emission: 0.0 };
    Arc::new(Scene {
        shape: Arc::new(shape),
        boundary: vec![boundary; 2],
        medium: vec![medium(4.0), medium(7.0)],
        lights: vec![Light { name: "cap".into(), emission }],
        sensor: Sensor::Probe(Probe { ray, paths: 64 }),
    })
}

const LEARNED: WalkDraw = WalkDraw::Learned { share: 0.9, cells: 8, paths: 8192 };

/// In a ball under a sky, learned turns go outwards more often than inwards.
#[test]
fn walks_learn_where_the_light_is() {
    let scene = scene(Shape::Sphere { radius: 1.0 }, Boundary::Smooth { eta: 1.3 }, 0.0, DVec3::Z, 2.0);
    let taught = TaughtField::new(scene.clone(), Roulette::default(), LEARNED, Finder::Walks);
    let guidance = taught.field().guidance(0).expect("it scatters");
    let medium = &scene.medium[0];
    let mut stream =
        StreamKey::named("learned turns").pass(0).stream(0, crate::sampling::stream::Purpose::Walk);
    let at = DVec3::new(0.3, -0.4, 0.6);
    let mut outwards = 0;
    for _ in 0..4000 {
        let mut walk = GuidedBand::new(guidance, medium);
        let arrival = Ray { origin: at, dir: -DVec3::X };
        let dir = walk.draw_turn(medium, &arrival, &mut stream);
        outwards += u32::from(dir.dot(at) > 0.0);
    }
    // Of plain turns 2000 go outwards, with a standard error of 32.
    assert!(outwards > 2130, "{outwards}");
}

/// Every training round sees the whole image, of more or fewer rays than the round has paths: 64 parts of the image and 64
/// of the width of its rows have their share of the round's paths.
#[test]
fn training_rays_are_spread_over_the_image() {
    const PARTS: usize = 64;
    for width in [128, 256, 1000] {
        let rays = width * width;
        for paths in [0..2184_u64, 2184..6553, 6553..15291, 15291..32768] {
            let (mut rows, mut columns) = ([0; PARTS], [0; PARTS]);
            for path in paths.clone() {
                let ray = training_ray(path, rays);
                rows[ray * PARTS / rays] += 1;
                columns[ray % width * PARTS / width] += 1;
            }
            let share = (paths.end - paths.start) as f64 / PARTS as f64;
            for count in rows.into_iter().chain(columns) {
                let share = f64::from(count) / share;
                assert!((0.5..1.6).contains(&share), "{width} {paths:?}: {share}");
            }
        }
    }
}

/// The same lessons teach the same.
#[test]
fn lessons_are_reproducible() {
    let scene = scene(Shape::Sphere { radius: 1.0 }, Boundary::Smooth { eta: 1.3 }, 0.5, DVec3::Z, 2.0);
    let heading = |_: u32| {
        let taught = TaughtField::new(scene.clone(), Roulette::default(), LEARNED, Finder::Walks);
        let mut walk =
            GuidedBand::new(taught.field().guidance(1).expect("it scatters"), &scene.medium[1]);
        walk.turn(&scene.medium, DVec3::new(0.3, -0.4, 0.6), DVec3::X, DVec3::Z);
        walk.density().to_bits()
    };
    assert_eq!(heading(0), heading(1));
    assert_ne!(heading(0), 1f64.to_bits());
}

/// What walks have learned changes no mean, in any class: two bands, smooth, rough and matched, bodies that are convex,
/// not convex and infinite, forward and even scattering, narrow and wide light.
#[test]
fn learned_walks_are_unbiased() {
    let rough = Boundary::Rough {
        eta: 1.3,
        facets: crate::optics::microfacet::Microfacets {
            kind: crate::optics::microfacet::MicrofacetKind::Ggx,
            alpha: 0.3,
        },
    };
    let torus = |smooth| Shape::Mesh(procedural::torus(0.7, 0.3, [24, 12], smooth).expect("closed"));
    let cases = [
        (Shape::Sphere { radius: 1.0 }, Boundary::Smooth { eta: 1.3 }, 0.0, 2.0),
        (torus(false), rough, 0.8, 1.0),
        (torus(true), Boundary::Matched, -0.5, 0.2),
        (Shape::Slab { thickness: 1.0 }, rough, 0.5, 1.0),
    ];
    let mut judged = 0;
    for (index, (shape, boundary, g, height)) in cases.into_iter().enumerate() {
        let scene = scene(shape, boundary, g, DVec3::new(0.4, 0.1, 0.9), height);
        let layout = Layout::new(&scene);
        let name = format!("learned_walks_are_unbiased {index}");
        let options = |walk| PathOptions { walk, ..PathOptions::default() };
        let path = |walk| PathTracer::with_options(scene.clone(), &options(walk)).expect("a scene");
        let (plain, _) = measure(&path(WalkDraw::default()), &layout, 1500, &name);
        let (learned, scores) = measure(&path(LEARNED), &layout, 1500, &format!("{name}, learned"));
        assert_eq!(scores.anomalies[..2], [0, 0], "{index}");
        for (observable, (a, b)) in plain.iter().zip(&learned).enumerate() {
            // Rare classes have no normal means.
            if a.0 == 0.0 || a.1 > 0.1 * a.0 || b.1 > 0.1 * a.0 {
                continue;
            }
            judged += 1;
            let error = (a.1 * a.1 + b.1 * b.1).sqrt();
            assert!((a.0 - b.0).abs() < 5.5 * error, "{index} {observable}: {a:?} {b:?}");
        }
    }
    assert!(judged >= 10, "{judged}");
}
