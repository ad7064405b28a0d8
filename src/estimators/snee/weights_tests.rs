//! The weights of all techniques that can make a path sum to 1.
//!
//! A sample of technique t scores f / D_t, D_t being what that technique's code believes to be the sum of
//! all densities. The expectation over all techniques is the sum of p_t f / D_t, so it is f exactly if
//!   sum over t of p_t / D_t = 1.
//! Here D_t comes from the score that the code of technique t gives to one fixed path, and p_t from a
//! scene that has the path's light and technique t alone, times the probability with which light sampling
//! or the guides choose that light: what is right for one light and one technique then holds for all
//! together. That p_t is the density of what is drawn is the subject of `draws_tests`.

use super::connections::{score_guided, score_subdivided};
use super::end::{End, Leg, Middle};
use super::last_vertex::{self, GuidedEnd};
use super::state::{ExtraTurns, Slot};
use super::subdivision;
use super::testing::*;
use super::*;
use crate::estimators::vertices::WalkVertex;
use crate::estimators::walk::{LookingRay, Meeting, Rivals};
use crate::estimators::{Layout, TransportClass, WalkDraw};
use crate::geometry::{Ray, Shape, Side};
use crate::math::DVec3;
use crate::optics::guided::StepGuide;
use crate::optics::medium::Medium;
use crate::sampling::distance::transmittance;
use crate::sampling::stream::StreamKey;
use crate::scene::Light;

/// Ways of making the end of a path, in the order of all arrays here.
const TECHNIQUES: [&str; 5] = ["bsdf", "light", "top to bottom", "bottom to top", "last vertex"];

/// What a walk has met before the end of its path.
#[derive(Clone, Copy, Debug)]
struct Course {
    /// Medium vertices since the boundary was last met, x_j included.
    vertices: u32,
    /// Met the boundary from inside before them, after this many medium vertices.
    reflected: Option<u32>,
}

const COURSES: [(Course, TransportClass); 6] = [
    (Course { vertices: 1, reflected: None }, TransportClass::Single),
    (Course { vertices: 1, reflected: Some(0) }, TransportClass::SingleInternal),
    (Course { vertices: 1, reflected: Some(1) }, TransportClass::MultipleInternal),
    (Course { vertices: 2, reflected: None }, TransportClass::Multiple),
    (Course { vertices: 2, reflected: Some(0) }, TransportClass::MultipleInternal),
    (Course { vertices: 3, reflected: None }, TransportClass::Multiple),
];

/// In which order techniques score at a vertex, and which guide's guess its cache holds by then.
#[derive(Clone, Copy, Debug)]
struct Order {
    is_reversed: bool,
    cached: Option<usize>,
}

type Walk<'a, B> = CameraWalk<'a, Connections<'a>, B>;

/// What the techniques make of a path: the score of each, and f.
fn play<B: super::super::bands::WalkBands>(
    mut walk: Walk<'_, B>,
    path: &FixedPath,
    (course, class): (Course, TransportClass),
    order: Order,
    band: usize,
) -> ([f64; 5], f64) {
    if let Some(vertices) = course.reflected {
        (0..vertices).for_each(|_| walk.history.scatter());
        walk.history.reflect_internally();
    }
    let setup = walk.rivals.setup;
    let guide = setup.guides.iter().find(|guide| guide.light == path.light);
    let is_parallel = walk.scene.lights[path.light].is_directional();
    let radiance = is_parallel.then_some(path.radiance);
    let mut scores = [0.0; 5];
    let mut score = |technique: usize, walk: &mut Walk<'_, B>, go: &dyn Fn(&mut Walk<'_, B>)| {
        if let Some(index) = order.cached {
            let slots = if walk.rivals.count > 1 {
                &[Slot::Previous, Slot::Latest][..]
            } else {
                &[Slot::Latest]
            };
            for &slot in slots {
                walk.guess(slot, &setup.guides[index]);
            }
        }
        walk.scores.clear();
        go(walk);
        let (bands, lights) = (walk.scene.bands(), walk.scene.lights.len());
        let at = |observable: usize| walk.scores.observables[observable * bands + band];
        assert_eq!(at(0), at(1 + class as usize), "everything is in {class:?}");
        let own = if lights > 1 { 1 + TransportClass::ALL.len() + path.light } else { 0 };
        scores[technique] = at(own);
    };
    let in_order = |mut techniques: Vec<usize>| {
        if order.is_reversed {
            techniques.reverse();
        }
        techniques
    };
    for vertex in 1..course.vertices {
        walk.lead_to(path.vertex_before_last(course.vertices - vertex), vertex > 1);
    }
    let strategies = setup.options.strategies;
    if course.vertices > 1
        && let Some(guide) = guide
    {
        // A probe never finds what x_i does not see.
        if walk.sees_point(path.x_i, path.exit.hit.point) {
            for technique in in_order(vec![2, 3]) {
                let takes_part = [strategies.top_to_bottom, strategies.bottom_to_top][technique - 2];
                if takes_part {
                    let found = path.subdivided(guide, radiance);
                    score(technique, &mut walk, &|walk| score_subdivided(walk, &found));
                }
            }
        }
    }
    if course.vertices == 1 {
        walk.ray.origin = path.x_i;
    }
    walk.lead_to(path.x_j, course.vertices > 1);
    let to_k = path.exit.hit.point - path.x_j;
    let leg = Leg { dir: to_k.normalize(), length: to_k.length() };
    let [bsdf, by_light] = walk.rivals.takes_part(walk.rivals.count);
    if let (Some(guide), Some(_)) = (guide, &setup.options.last_vertex) {
        let found = GuidedEnd { guide, exit: path.exit, leg, w_l: path.w_l, radiance };
        score(4, &mut walk, &|walk| score_guided(walk, &found));
    }
    walk.lead_out(&path.exit);
    for technique in in_order(vec![0, 1]) {
        if technique == 0 && bsdf > 0.0 && !is_parallel {
            score(0, &mut walk, &|walk| walk.score_own_sample(path.w_l));
        } else if technique == 1 && by_light > 0.0 {
            score(1, &mut walk, &|walk| walk.score_light_sample(path.light, path.w_l));
        }
    }
    let mut any =
        Guide::all(&walk.scene.lights[path.light..=path.light], walk.band, 1.0, &walk.boundary);
    any[0].light = path.light;
    let f = End::new(&walk, &any[0], &path.exit, path.w_l, [1.0; 2], Some(path.radiance)).value;
    (scores, walk.throughput * f)
}

/// The densities of the techniques, each by itself in a scene that has the path's light alone.
fn alone(snee: &[Snee; 2], path: &FixedPath, course: Course) -> [f64; 5] {
    let path = FixedPath { light: 0, ..*path };
    let key = StreamKey::named("alone").pass(0);
    let mut densities = [0.0; 5];
    for (from_above, snee) in [(true, &snee[0]), (false, &snee[1])] {
        let mut scores = Scores::new(Layout::new(&snee.walks.field().scene));
        let on = Path { field: snee.walks.field(), band: 0, index: 0, key: &key };
        let start = if course.vertices == 1 { path.x_i } else { path.start };
        let connections = Connections::new(&snee.setups[0], key.stream(0, Purpose::Connection));
        let mut walk = CameraWalk::led(on, &mut scores, connections, OneBand, start);
        for vertex in 1..course.vertices {
            walk.lead_to(path.vertex_before_last(course.vertices - vertex), vertex > 1);
        }
        walk.lead_to(path.x_j, course.vertices > 1);
        walk.lead_out(&path.exit);
        let [bsdf, by_light] = walk.rivals.takes_part(course.vertices);
        let any = Guide::all(&walk.scene.lights, 0, 1.0, &walk.boundary);
        let end = |keep| End::new(&walk, &any[0], &path.exit, path.w_l, keep, None);
        densities[0] = end([bsdf, 0.0]).unidirectional;
        densities[1] = end([0.0, by_light]).unidirectional;
        let Some(guide) = snee.setups[0].guides.first() else { continue };
        let end = End::new(&walk, guide, &path.exit, path.w_l, [1.0; 2], None);
        // Vertices as the walk has them: near a specular path the last digits of x_i matter.
        let to_k = path.middle().to_k;
        densities[4] = last_vertex::density(&mut walk, Slot::Latest, &to_k, &end);
        if course.vertices > 1 && walk.sees_point(path.x_i, path.exit.hit.point) {
            let [x_i, x_j] = [Slot::Previous, Slot::Latest].map(|slot| walk.rivals.vertex(slot).point);
            let middle = Middle::new(x_i, x_j, &path.exit.hit).expect("x_k is met from inside");
            densities[if from_above { 2 } else { 3 }] =
                subdivision::density(&mut walk, Slot::Previous, &middle, &path.exit, &end);
        }
    }
    densities
}

/// One of the two ends of subdivision alone.
fn one_end(
    shape: &Arc<Shape>,
    boundary: Boundary,
    media: &[Medium],
    lamp: Lamp,
    options: &SneeOptions,
) -> [Snee; 2] {
    [true, false].map(|from_above| {
        let all = options.strategies;
        let strategies = Strategies {
            top_to_bottom: all.top_to_bottom && from_above,
            bottom_to_top: all.bottom_to_top && !from_above,
            ..all
        };
        let options = SneeOptions { strategies, ..options.clone() };
        Snee::new(body(shape, boundary, media, &[lamp]), options).expect("a scene for it")
    })
}

const LAMPS: [&[Lamp]; 5] = [
    &[Lamp::Disc],
    &[Lamp::Sun],
    &[Lamp::Disc, Lamp::WideDisc],
    &[Lamp::Sky, Lamp::Disc, Lamp::Sun],
    &[Lamp::WideDisc, Lamp::Sun, Lamp::Sky],
];

/// Per light, preset, class, boundary and body, with one to three lights, in every order in which
/// techniques score and with every guess that caches may hold.
#[test]
fn weights_sum_to_one() {
    let media = [medium(4.0, 0.9, 0.3)];
    let key = StreamKey::named("weights_sum_to_one");
    let mut stream = key.pass(0).stream(0, Purpose::Sensor);
    let mut seen = [0u32; 5];
    for (shape, paths) in [(sphere(), 2), (ring(), 3)] {
        for boundary in [ROUGH, SMOOTH] {
            for (name, options) in presets() {
                let references: Vec<(Lamp, [Snee; 2])> =
                    [Lamp::Sun, Lamp::Disc, Lamp::WideDisc, Lamp::Sky]
                        .map(|lamp| (lamp, one_end(&shape, boundary, &media, lamp, &options)))
                        .into_iter()
                        .collect();
                for lamps in LAMPS {
                    let scene = body(&shape, boundary, &media, lamps);
                    let snee = Snee::new(scene.clone(), options.clone()).expect("a scene for it");
                    let strength = |index: usize| scene.lights[index].strength(0);
                    let is_guide =
                        |&index: &usize| options.least_concentration == 1.0 || lamps[index] != Lamp::Sky;
                    let all: f64 = (0..lamps.len()).map(strength).sum();
                    let guides: f64 = (0..lamps.len()).filter(is_guide).map(strength).sum();
                    for (light, lamp) in lamps.iter().enumerate() {
                        let (_, reference) =
                            references.iter().find(|(of, _)| of == lamp).expect("every light");
                        let mut done = 0;
                        while done < paths {
                            let Some(path) = FixedPath::draw(&scene, light, &mut stream, done == 2)
                            else {
                                continue;
                            };
                            done += 1;
                            for course in COURSES {
                                let densities = alone(reference, &path, course.0);
                                let of_light = strength(light) / all;
                                let of_guide = strength(light) / guides;
                                let count = snee.setups[0].guides.len();
                                for cached in (0..count).map(Some).chain([None]) {
                                    for is_reversed in [false, true] {
                                        let order = Order { is_reversed, cached };
                                        let mut scores = Scores::new(Layout::new(&scene));
                                        let pass = key.pass(1);
                                        let walk = start(
                                            &snee,
                                            0,
                                            &pass,
                                            &mut scores,
                                            &path,
                                            course.0,
                                            OneBand,
                                        );
                                        let (scores, f) = play(walk, &path, course, order, 0);
                                        let shares = [1.0, of_light, of_guide, of_guide, of_guide];
                                        let mut sum = 0.0;
                                        for (t, share) in shares.into_iter().enumerate() {
                                            let weight = share * densities[t] * scores[t] / f;
                                            sum += weight;
                                            seen[t] += u32::from(weight > 1e-3);
                                        }
                                        let is_possible = densities.iter().any(|&p| p > 0.0);
                                        assert!(
                                            !is_possible || (sum - 1.0).abs() < 1e-12,
                                            "{boundary:?}, {name}, {lamps:?}, {lamp:?}, {course:?}, {order:?}: \
                                             weights sum to {sum}: {TECHNIQUES:?} have densities {densities:?} \
                                             and score {scores:?} of {f}"
                                        );
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
    assert!(seen.iter().all(|&count| count > 100), "{seen:?}");
}

fn start<'a, B: super::super::bands::WalkBands>(
    snee: &'a Snee,
    band: usize,
    key: &'a PassKey,
    scores: &'a mut Scores,
    path: &FixedPath,
    course: Course,
    bands: B,
) -> Walk<'a, B> {
    let on = Path { field: snee.walks.field(), band, index: 0, key };
    let start = if course.vertices == 1 { path.x_i } else { path.start };
    let mut connections = Connections::new(&snee.setups[0], key.stream(0, Purpose::Connection));
    connections.extra_turns =
        snee.setups[0].photons.as_ref().map(|_| Box::new(ExtraTurns::of_path(&on)));
    CameraWalk::led(on, scores, connections, bands, start)
}

/// Of a walk that bands share, a path scores the same in each band, whichever technique makes it and
/// whichever band has steered the walk.
#[test]
fn shared_walks_score_alike() {
    let name = "shared_walks_score_alike";
    let (pass, mut stream) =
        (StreamKey::named(name).pass(0), StreamKey::named(name).pass(1).stream(0, Purpose::Sensor));
    let media = [medium(3.0, 0.95, 0.2), medium(4.0, 0.9, 0.5), medium(6.0, 0.7, 0.0)];
    let [.., (_, options), _] = presets();
    let options = SneeOptions { share_bands: true, ..options };
    let lamps = [Lamp::WideDisc, Lamp::Sun];
    for boundary in [ROUGH, SMOOTH] {
        let scene = body(&sphere(), boundary, &media, &lamps);
        let snee = Snee::new(scene.clone(), options.clone()).expect("a scene for it");
        let mut done = 0;
        while done < 10 {
            let Some(path) = FixedPath::draw(&scene, done % 2, &mut stream, false) else { continue };
            done += 1;
            for course in COURSES {
                for band in 0..media.len() {
                    let order = Order { is_reversed: false, cached: None };
                    let scores: Vec<f64> = (0..media.len())
                        .flat_map(|hero| {
                            let mut scores = Scores::new(Layout::new(&scene));
                            let bands = SharedBands::new(&media, hero);
                            let walk = start(&snee, hero, &pass, &mut scores, &path, course.0, bands);
                            play(walk, &path, course, order, band).0
                        })
                        .filter(|&score| score > 0.0)
                        .collect();
                    for score in &scores {
                        let ratio = score / scores[0];
                        assert!(
                            (ratio - 1.0).abs() < 1e-12,
                            "{boundary:?}, light {}, {course:?}, band {band}: {scores:?}",
                            path.light
                        );
                    }
                }
            }
        }
    }
}

/// Of a guided walk, per technique the density of the walk up to where the technique takes over, over that of a plain
/// walk: at the end of the path, at x_i for subdivision, at x_j for the last vertex. From the steps' own densities. What BSDF and
/// light sampling find, they find as often again after directions that photons teach: by how much, is given beside.
fn guided_over_plain(snee: &Snee, path: &FixedPath, course: Course) -> ([f64; 5], f64) {
    let guidance = snee.walks.field().guidance(0).expect("guided");
    let sigma_t = snee.walks.field().scene.medium[0].sigma_t;
    let start = if course.vertices == 1 { path.x_i } else { path.start };
    let between = (1..course.vertices).map(|vertex| path.vertex_before_last(course.vertices - vertex));
    let points: Vec<DVec3> =
        [start].into_iter().chain(between).chain([path.x_j, path.exit.hit.point]).collect();
    let mut ratios = vec![1.0];
    let mut by_photons = 0.0;
    for step in points.windows(3) {
        let [from, at, to] = [step[0], step[1], step[2]];
        let [arrival, dir] = [(at - from).normalize(), (to - at).normalize()];
        let mut guide = StepGuide::NONE;
        guidance.at(at, DVec3::Z, &mut guide);
        let heading = guidance.turns.heading(guidance.share, &guide, arrival, dir);
        let t = (to - at).length();
        let is_last = to == path.exit.hit.point;
        let flown =
            if is_last { heading.passage_ratio(sigma_t, t) } else { heading.flight_ratio(sigma_t, t) };
        ratios.push(ratios[ratios.len() - 1] * flown);
        if let (Some(photons), true) = (&snee.setups[0].photons, is_last) {
            let phase = snee.walks.field().scene.medium[0].phase.pdf(arrival.dot(dir));
            by_photons =
                photons.density(Meeting::First, at, dir) / (phase * transmittance(sigma_t, t) * flown);
        }
    }
    let [.., at_j, at_end] = ratios[..] else { panic!("two steps at least") };
    let at_i = if course.vertices > 1 { ratios[ratios.len() - 3] } else { f64::NAN };
    let at_end = at_end * (1.0 + by_photons);
    ([at_end, at_end, at_i, at_i, at_j], by_photons)
}

/// The same of guided walks, whose densities are those of the guide, without photons and with them.
#[test]
fn weights_with_guided_walks_sum_to_one() {
    let key = StreamKey::named("weights_with_guided_walks_sum_to_one");
    let mut stream = key.pass(0).stream(0, Purpose::Sensor);
    let mut seen = [0u32; 6];
    let photons = Some(Photons { paths: 1 << 14, most: 0.9 });
    for (shape, g, photons) in [(sphere(), 0.0, None), (ring(), 0.6, None), (ring(), 0.6, photons)] {
        let media = [medium(4.0, 0.9, g)];
        for boundary in [ROUGH, SMOOTH] {
            let [.., (_, options), _] = presets();
            let walk =
                WalkDraw::Guided { share: 0.8, nodes: 16, least_depth: Some(0.0), near_lights: true };
            let guided = SneeOptions { walk, photons, ..options.clone() };
            for lamp in [Lamp::WideDisc, Lamp::Sun] {
                let reference = one_end(&shape, boundary, &media, lamp, &options);
                let scene = body(&shape, boundary, &media, &[lamp]);
                let snee = Snee::new(scene.clone(), guided.clone()).expect("a scene for it");
                let guidance = snee.walks.field().guidance(0).expect("light comes in");
                let mut done = 0;
                while done < 10 {
                    let Some(path) = FixedPath::draw(&scene, 0, &mut stream, done == 9) else {
                        continue;
                    };
                    done += 1;
                    for course in COURSES {
                        let densities = alone(&reference, &path, course.0);
                        let (over_plain, by_photons) = guided_over_plain(&snee, &path, course.0);
                        seen[5] += u32::from(by_photons > 0.1);
                        let mut scores = Scores::new(Layout::new(&scene));
                        let pass = key.pass(1);
                        let bands = GuidedBand::new(guidance, &media[0]);
                        let walk = start(&snee, 0, &pass, &mut scores, &path, course.0, bands);
                        let order = Order { is_reversed: false, cached: None };
                        let (scores, f) = play(walk, &path, course, order, 0);
                        let mut sum = 0.0;
                        for t in 0..5 {
                            if scores[t] > 0.0 {
                                sum += over_plain[t] * densities[t] * scores[t] / f;
                                seen[t] += 1;
                            }
                        }
                        assert!(
                            scores == [0.0; 5] || (sum - 1.0).abs() < 1e-11,
                            "{boundary:?}, {lamp:?}, {course:?}: weights sum to {sum}: {TECHNIQUES:?} have densities \
                             {densities:?} times {over_plain:?} and score {scores:?} of {f}"
                        );
                    }
                }
            }
        }
    }
    assert!(seen.iter().all(|&count| count > 50), "{seen:?}");
}

/// Nothing is connected through a matched boundary: light and phase sampling share its paths.
#[test]
fn weights_at_a_matched_boundary_sum_to_one() {
    let name = "weights_at_a_matched_boundary_sum_to_one";
    let (pass, mut stream) =
        (StreamKey::named(name).pass(0), StreamKey::named(name).pass(1).stream(0, Purpose::Sensor));
    let lamps = [Lamp::Disc, Lamp::WideDisc, Lamp::Sky];
    let media = [medium(2.0, 0.9, 0.3)];
    let scene = body(&sphere(), Boundary::Matched, &media, &lamps);
    let walk = WalkDraw::Guided { share: 0.8, nodes: 16, least_depth: Some(0.0), near_lights: true };
    let options = SneeOptions { walk, ..SneePreset::Guided.options() };
    let snee = Snee::new(scene.clone(), options).expect("a scene for it");
    assert!(snee.setups[0].guides.is_empty());
    let guidance = snee.walks.field().guidance(0).expect("light comes in");
    let mut done = 0;
    while done < 30 {
        let light = done % 3;
        let Some(path) = FixedPath::draw(&scene, light, &mut stream, false) else { continue };
        done += 1;
        let on = Path { field: snee.walks.field(), band: 0, index: 0, key: &pass };
        let ray = Ray { origin: path.x_i, dir: path.w_l };
        let hit = scene.shape.intersect(&ray, Side::Inside, None, f64::INFINITY).expect("a finite body");
        let mut guide = StepGuide::NONE;
        guidance.at(path.x_i, DVec3::Z, &mut guide);
        let arrival = (path.x_i - path.start).normalize();
        let heading = guidance.turns.heading(guidance.share, &guide, arrival, path.w_l);
        let of_guide = heading.passage_ratio(2.0, hit.t);
        let mut scores = Scores::new(Layout::new(&scene));
        let plain = CameraWalk::led(on, &mut scores, Unrivalled, OneBand, path.start);
        matched_weights(plain, &path, hit.t, 1.0);
        let mut scores = Scores::new(Layout::new(&scene));
        let bands = GuidedBand::new(guidance, &media[0]);
        let guided = CameraWalk::led(on, &mut scores, Unrivalled, bands, path.start);
        matched_weights(guided, &path, hit.t, of_guide);
    }
}

/// At x_i, from which the boundary is `length` away; the walk's own density is `over_plain` times that of a plain walk.
fn matched_weights<B: super::super::bands::WalkBands>(
    mut walk: CameraWalk<'_, Unrivalled, B>,
    path: &FixedPath,
    length: f64,
    over_plain: f64,
) {
    walk.lead_to(path.x_i, false);
    let scene = walk.scene;
    // The sky is even: it is found by directions alone.
    let sampled = |light: &Light| if light.concentration() < 2.0 { 0.0 } else { light.strength(0) };
    let all: f64 = scene.lights.iter().map(sampled).sum();
    let own =
        walk.medium.phase.pdf(walk.ray.dir.dot(path.w_l)) * transmittance(walk.medium.sigma_t, length);
    let light = &scene.lights[path.light];
    let by_light = sampled(light) / all * light.eval(0, path.w_l).1;
    let f = walk.throughput * own * path.radiance;
    let mut sum = 0.0;
    for (is_own, density) in [(true, own * over_plain), (false, by_light)] {
        if density == 0.0 {
            continue;
        }
        walk.scores.clear();
        if is_own {
            walk.score_own_sample(path.w_l);
        } else {
            walk.score_light_sample(path.light, path.w_l);
        }
        sum += density * walk.scores.observables[1 + TransportClass::ALL.len() + path.light] / f;
    }
    assert!((sum - 1.0).abs() < 1e-12, "{}: weights sum to {sum}", light.name);
}

/// Whatever is hidden, an edge, the last leg, or the light, scores nothing; what is free does.
#[test]
fn what_is_hidden_scores_nothing() {
    let name = "what_is_hidden_scores_nothing";
    let (pass, mut stream) =
        (StreamKey::named(name).pass(0), StreamKey::named(name).pass(1).stream(0, Purpose::Sensor));
    let [.., (_, options), _] = presets();
    let scene = body(&ring(), ROUGH, &[medium(4.0, 0.9, 0.3)], &[Lamp::WideDisc, Lamp::Sun]);
    let snee = Snee::new(scene.clone(), options).expect("a scene for it");
    let mut hidden = [0u32; 3];
    let mut free = 0;
    while free < 50 || hidden.iter().any(|&count| count < 50) {
        let light = (free % 2) as usize;
        let Some((path, sees)) = FixedPath::scattered(&scene, light, &mut stream) else { continue };
        hidden.iter_mut().zip(sees).for_each(|(count, sees)| *count += u32::from(!sees));
        let sees_all = sees == [true; 3];
        free += u32::from(sees_all);
        let mut scores = Scores::new(Layout::new(&scene));
        let course = Course { vertices: 2, reflected: None };
        let mut walk = start(&snee, 0, &pass, &mut scores, &path, course, OneBand);
        walk.rivals.arrive(WalkVertex { point: path.x_i, arrival: DVec3::X, walks: 1.0 });
        let guide = &snee.setups[0].guides[light];
        let radiance = (light == 1).then_some(path.radiance);
        score_subdivided(&mut walk, &path.subdivided(guide, radiance));
        let of_edge = walk.scores.observables[0];
        walk.scores.clear();
        walk.rivals.arrive(WalkVertex { point: path.x_j, arrival: DVec3::X, walks: 1.0 });
        let Middle { to_k: leg, .. } = path.middle();
        score_guided(&mut walk, &GuidedEnd { guide, exit: path.exit, leg, w_l: path.w_l, radiance });
        let of_last = walk.scores.observables[0];
        assert_eq!(of_edge > 0.0, sees_all, "an edge: {of_edge} where {sees:?} is seen");
        // The last vertex meets x_k first, and its walk has come to x_j.
        assert_eq!(of_last > 0.0, sees[2], "a last vertex: {of_last} where {sees:?} is seen");
    }
}

/// The expected reflection of a light by a smooth boundary: nothing where the body shadows it.
#[test]
fn shadowed_reflections_score_nothing() {
    let name = "shadowed_reflections_score_nothing";
    let (pass, mut stream) =
        (StreamKey::named(name).pass(0), StreamKey::named(name).pass(1).stream(0, Purpose::Sensor));
    let [_, (_, options), ..] = presets();
    let scene = body(&ring(), SMOOTH, &[medium(4.0, 0.9, 0.3)], &[Lamp::WideDisc, Lamp::Disc]);
    let snee = Snee::new(scene.clone(), options).expect("a scene for it");
    let mut counts = [0u32; 2];
    while counts.iter().any(|&count| count < 50) {
        let Some((path, [.., is_lit])) = FixedPath::scattered(&scene, 0, &mut stream) else { continue };
        counts[usize::from(is_lit)] += 1;
        let mut scores = Scores::new(Layout::new(&scene));
        let course = Course { vertices: 2, reflected: None };
        let mut walk = start(&snee, 0, &pass, &mut scores, &path, course, OneBand);
        let frame = path.exit.frame;
        let DVec3 { x, y, z } = frame.to_local(path.w_l);
        let from = DVec3::new(-x, -y, z);
        Connections::look(&mut walk, LookingRay::Own, &path.exit.hit, &frame, from);
        let score = walk.scores.observables[0];
        assert_eq!(score > 0.0, is_lit, "{score} is mirrored from {:?}", path.exit.hit.point);
    }
}
