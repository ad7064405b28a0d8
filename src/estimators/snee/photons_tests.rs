//! Directions have their density, and means are those without photons.

use std::sync::Arc;

use super::super::state::{Connections, ExtraTurns};
use super::super::testing::{Lamp, ROUGH, SMOOTH, body, medium, point_inside, ring, sphere};
use super::super::{BandSetup, Snee, SneeChoices, TwoBounce};
use super::*;
use crate::estimators::bands::OneBand;
use crate::estimators::field::Path;
use crate::estimators::vertices::WalkExit;
use crate::estimators::walk::{CameraWalk, Rivals};
use crate::estimators::{Estimator, Layout, Scores, TransportClass, WalkDraw};
use crate::geometry::{Shape, procedural};
use crate::optics::medium::Medium;
use crate::sampling::distance::transmittance;
use crate::sampling::stream::PassKey;
use crate::scene::Sensor;
use crate::scene::sensor::BodyFlux;

fn bumps(interpolated: bool) -> Arc<Shape> {
    Arc::new(Shape::Mesh(procedural::bumpy_sphere(1.0, 3, 0.2, 5.0, interpolated).expect("closed")))
}

fn photons(paths: u64, most: f64) -> SneeChoices {
    SneeChoices { photons: Some(Photons { paths, most }), ..SneeChoices::default() }
}

/// The flux out of a body, one path a pass.
fn flux(shape: &Arc<Shape>, boundary: Boundary, lamps: &[Lamp]) -> Arc<Scene> {
    let media = [medium(1.0, 0.9, 0.0), medium(0.7, 0.8, 0.7)];
    let bounds = shape.bounds().expect("finite");
    let mut scene = Arc::into_inner(body(shape, boundary, &media, lamps)).expect("not shared");
    scene.sensor =
        Sensor::BodyFlux(BodyFlux { bounds, frame: Frame::about(DVec3::Z), bins: 1, paths: 1 });
    Arc::new(scene)
}

fn set_up(scene: &Arc<Scene>, choices: &SneeChoices, connects: bool) -> Snee {
    if connects {
        Snee::connected(scene.clone(), choices.connected().expect("options")).expect("served")
    } else {
        Snee::new(scene.clone(), choices.options().expect("options")).expect("served")
    }
}

/// Moments of sampled directions are those of the density, by as many uniform directions; and the density's integral is the
/// mean number of directions. For lights from the first meeting with the boundary and for those beyond it.
#[test]
fn directions_have_their_density() {
    const DRAWS: u32 = 40_000;
    for (name, shape, boundary) in
        [("rough ring", ring(), ROUGH), ("smooth bumps", bumps(false), SMOOTH)]
    {
        let scene = flux(&shape, boundary, &[Lamp::WideDisc, Lamp::Disc]);
        let snee = set_up(&scene, &photons(4096, 0.8), false);
        let photons = snee.setups[0].photons.as_ref().expect("photons");
        let mut stream =
            StreamKey::named("directions_have_their_density").pass(0).stream(0, Purpose::Walk);
        let mut done = 0;
        while done < 24 {
            let meeting = if done % 2 == 0 { Meeting::First } else { Meeting::Later };
            let Some(x) = point_inside(&scene, &mut stream) else { continue };
            let kind = if meeting == Meeting::First { PhotonKind::Once } else { PhotonKind::OfChains };
            let has_none = |grid: &DirectionGrid| {
                grid.voxel(x).is_none_or(|voxel| grid.lists[voxel][kind as usize].count == 0)
            };
            if photons.map.grids.iter().all(has_none) {
                continue;
            }
            done += 1;
            let axis = square_to_cap(2.0, stream.draw2());
            // 1, w . a and (w . a)^2.
            let powers = |w: DVec3| [1.0, w.dot(axis), w.dot(axis) * w.dot(axis)];
            let (mut drawn, mut expected) = ([[0.0; 3]; 2], [[0.0; 3]; 2]);
            let add = |sums: &mut [[f64; 3]; 2], values: [f64; 3]| {
                for (i, value) in values.into_iter().enumerate() {
                    sums[0][i] += value;
                    sums[1][i] += value * value;
                }
            };
            for _ in 0..DRAWS {
                let [once, on] =
                    photons.sample(x, &mut stream).map(|drawn| drawn.map_or([0.0; 3], powers));
                // What goes on has met the boundary a first time, too.
                let finding = if meeting == Meeting::First { 1.0 } else { 0.0 };
                add(&mut drawn, [0, 1, 2].map(|i| finding * once[i] + on[i]));
                let w = square_to_cap(2.0, stream.draw2());
                let density = photons.density(meeting, x, w) / pdf_cap(2.0);
                add(&mut expected, powers(w).map(|power| density * power));
            }
            for i in 0..3 {
                let n = f64::from(DRAWS);
                let [a, b] = [drawn, expected].map(|sums| sums[0][i] / n);
                let spread = |sums: [[f64; 3]; 2], mean: f64| (sums[1][i] / n - mean * mean) / n;
                let error = (spread(drawn, a) + spread(expected, b)).max(0.0).sqrt();
                assert!(
                    (a - b).abs() < 5.0 * error + 1e-12,
                    "{name} {meeting:?} {x} {i}: {a} and {b} +- {error}"
                );
            }
        }
    }
}

/// What a path scores of light that scatters once, without a reflection inside and with one, and of all that scatters, in both
/// bands.
fn scattered(snee: &Snee, key: &PassKey, scores: &mut Scores) -> [f64; 6] {
    scores.clear();
    snee.pass(&[0, 1], key, scores);
    let of = |class: TransportClass, band: usize| scores.observables[2 * (1 + class as usize) + band];
    let all = |band: usize| scores.observables[band] - of(TransportClass::Surface, band);
    let [once, inside] = [TransportClass::Single, TransportClass::SingleInternal];
    [of(once, 0), of(inside, 0), all(0), of(once, 1), of(inside, 1), all(1)]
}

/// Two unlike lights, two bands of which one scatters forwards, flat and interpolated normals, bodies that are not convex, rough
/// and smooth, plain and guided walks. Photons change no walk, so that with them and without a path differs in the ends of its
/// paths alone.
#[test]
fn means_stay() {
    let guided = WalkDraw::Guided { share: 0.8, nodes: 8, least_depth: Some(0.0), near_lights: true };
    let plain = WalkDraw::Plain {};
    let shaded = || Arc::new(Shape::Mesh(procedural::torus(0.7, 0.3, [24, 12], true).expect("closed")));
    let two = &[Lamp::WideDisc, Lamp::Sun][..];
    for (name, shape, boundary, lamps, walk, passes) in [
        ("smooth ring", ring(), SMOOTH, two, plain, 160_000),
        ("rough ring", ring(), ROUGH, two, plain, 120_000),
        ("rough ring, guided", ring(), ROUGH, two, guided, 60_000),
        ("smooth shaded ring, guided", shaded(), SMOOTH, two, guided, 60_000),
    ] {
        let connects = boundary.is_delta();
        let scene = flux(&shape, boundary, lamps);
        let given = SneeChoices { walk, ..SneeChoices::default() };
        let with = SneeChoices { walk, ..photons(1 << 14, 0.9) };
        let [given, with] = [given, with].map(|choices| set_up(&scene, &choices, connects));
        let key = StreamKey::named(&format!("photons, means_stay {name}"));
        let mut scores = Scores::new(Layout::new(&scene));
        let mut sums = [[0.0; 3]; 6];
        for pass in 0..passes {
            let key = key.pass(pass);
            let given = scattered(&given, &key, &mut scores);
            let with = scattered(&with, &key, &mut scores);
            for (sums, (a, b)) in sums.iter_mut().zip(given.into_iter().zip(with)) {
                *sums = [sums[0] + a, sums[1] + (b - a), sums[2] + (b - a) * (b - a)];
            }
        }
        let n = passes as f64;
        for (quantity, [a, change, squares]) in sums.into_iter().enumerate() {
            let (a, change) = (a / n, change / n);
            let error = ((squares / n - change * change) / n).sqrt();
            println!("{name}, {quantity}: {a:.4}, photons change it by {change:.4} +- {error:.4}");
            assert!(
                change.abs() < 4.0 * error,
                "{name}, {quantity}: {a} changes by {change} +- {error}"
            );
            assert!(
                error < 0.1 * a,
                "{name}, {quantity}: the error {error} of {a} is too large to tell"
            );
        }
    }
}

/// A path is weighed against both kinds of photons at its first meeting with the boundary, and against those of chains beyond it:
/// after a flight outside, and where a flight inside is said to have met the boundary again.
#[test]
fn light_beyond_the_first_meeting_is_left_to_chains() {
    let name = "light_beyond_the_first_meeting_is_left_to_chains";
    let scene = flux(&ring(), ROUGH, &[Lamp::WideDisc]);
    let snee = set_up(&scene, &photons(1 << 14, 0.7), false);
    let photons = snee.setups[0].photons.as_ref().expect("photons");
    let key = StreamKey::named(name).pass(0);
    let mut stream = key.stream(0, Purpose::Sensor);
    let on = Path { field: snee.walks.field(), band: 0, index: 0, key: &key };
    let (mut inside, mut outside) = (0, 0);
    while inside.min(outside) < 20 {
        let [start, x] = [(); 2].map(|()| point_inside(&scene, &mut stream));
        let (Some(start), Some(x)) = (start, x) else { continue };
        let Some(dir) = photons.sample(x, &mut stream)[inside % 2] else { continue };
        if photons.density(Meeting::First, x, dir) <= photons.density(Meeting::Later, x, dir) {
            continue;
        }
        let Some(hit) = scene.shape.leave(&Ray { origin: x, dir }) else { continue };
        let frame = Frame::about(hit.shading_normal);
        let exit = WalkExit { hit, frame, wo: frame.to_local(-dir) };
        let mut scores = Scores::new(Layout::new(&scene));
        let mut rivals = Connections::new(&snee.setups[0], key.stream(0, Purpose::Connection));
        rivals.extra_turns = Some(Box::new(ExtraTurns::of_path(&on)));
        let mut walk = CameraWalk::led(on, &mut scores, rivals, OneBand, start);
        walk.lead_to(x, false);
        walk.lead_out(&exit);
        let turns = (x - start).normalize().dot(dir);
        let Medium { phase, sigma_t, .. } = scene.medium[0];
        let drawn = phase.pdf(turns) * transmittance(sigma_t, hit.t);
        let is_weighed = |walk: &CameraWalk<'_, Connections<'_>, OneBand>, meeting: Meeting| {
            let (a, b) = (Connections::extra_turns(walk) * drawn, photons.density(meeting, x, dir));
            assert!((a - b).abs() <= 1e-9 * b, "{meeting:?} {x} {dir}: {a} and {b}");
        };
        is_weighed(&walk, Meeting::First);
        let towards = square_to_cap(2.0, stream.draw2());
        if towards.dot(hit.normal) < 0.0 {
            inside += 1;
            walk.rivals.reached(0.1);
        } else if walk.lead_on(towards) {
            outside += 1;
        } else {
            continue;
        }
        is_weighed(&walk, Meeting::Later);
    }
}

/// Bands with one boundary share a map, whatever their media; with another index they have their own.
#[test]
fn bands_share_maps() {
    let scene = flux(&ring(), SMOOTH, &[Lamp::WideDisc]);
    let shared = set_up(&scene, &photons(4096, 0.5), true);
    let map = |setup: &BandSetup| setup.photons.clone().expect("a map").map;
    let maps = |snee: &Snee| [0, 1].map(|band| map(&snee.setups[band]));
    let [a, b] = maps(&shared);
    assert!(Arc::ptr_eq(&a, &b));
    let mut scene = Arc::into_inner(flux(&ring(), SMOOTH, &[Lamp::WideDisc])).expect("not shared");
    scene.boundary[1] = Boundary::Smooth { eta: 1.45 };
    let apart = set_up(&Arc::new(scene), &photons(4096, 0.5), true);
    let [a, b] = maps(&apart);
    assert!(!Arc::ptr_eq(&a, &b) && apart.held_bytes() > shared.held_bytes() + b.heap_bytes() / 2);
}

/// Where no walk can meet the lights there is no map; what they do not serve is refused, with what to do.
#[test]
fn what_photons_do_not_serve() {
    let sun = flux(&sphere(), SMOOTH, &[Lamp::Sun]);
    let snee = set_up(&sun, &photons(4096, 1.0), true);
    assert!(snee.setups.iter().all(|setup| setup.photons.is_none()), "no walk meets parallel light");
    let refused = |choices: &str| {
        let choices: SneeChoices = toml::from_str(choices).expect("words");
        choices.options().expect_err("refused").to_string()
    };
    let shared = refused("photons = {}\nbands = \"shared\"");
    assert!(shared.contains("one band") && shared.contains("alone"), "{shared}");
    let options = photons(4096, 1.0).options().expect("options");
    let scene = flux(&sphere(), ROUGH, &[Lamp::Disc]);
    assert!(TwoBounce::new(scene, options).is_err());
    let none: SneeChoices = toml::from_str("photons = { most = 0 }").expect("words");
    assert_eq!(none.options().expect("options").photons, None);
}
