//! The connection among the other techniques: weights that sum to 1, the density that it states, and what bounds it at
//! a caustic.

use super::connections::{score_guided, score_subdivided};
use super::end::{End, Leg, Middle};
use super::last_vertex::{self, GuidedEnd};
use super::specular::{self, LitVertex};
use super::state::Slot;
use super::subdivision::{self, Subdivided};
use super::testing::*;
use super::*;
use crate::estimators::Layout;
use crate::estimators::bands::{OneBand, WalkBands};
use crate::estimators::connection::{Query, Root, SolverWork};
use crate::estimators::vertices::WalkExit;
use crate::estimators::walk::Rivals;
use crate::geometry::{Hit, Ray, Shape, Side, procedural};
use crate::math::{DVec3, Frame, exp};
use crate::optics::medium::Medium;
use crate::sampling::distance::transmittance;
use crate::sampling::stream::{Stream, StreamKey};
use crate::scene::Emission;

/// Ways of making the end of a path, in the order of all arrays here.
const TECHNIQUES: [&str; 5] = ["bsdf", "top to bottom", "bottom to top", "last vertex", "connection"];

/// What a walk has met before the last medium vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Before {
    /// The boundary.
    Nothing,
    /// A medium vertex.
    Vertex,
    /// A medium vertex, and the boundary from inside.
    Reflection,
}

type Walk<'a, B> = CameraWalk<'a, Connections<'a>, B>;

/// Everything together, with two shares of probes; the kind's defaults; connections alone.
fn options() -> [(&'static str, SneeOptions); 4] {
    let preset = |preset| SneeChoices { preset, ..Default::default() }.connected().expect("options");
    let all = Strategies { bsdf: true, light: true, top_to_bottom: true, bottom_to_top: true };
    let everything = SneeOptions {
        strategies: all,
        call: Call { most: 0.8, decay: 0.3 },
        connection: Some(ConnectionCall { most: 0.7, decay: 0.2, later: 0.4 }),
        last_vertex: SneePreset::Guided.options().last_vertex,
        joint: JointKind::Mixture,
        ..preset(SneePreset::Guided)
    };
    let none = Strategies { bsdf: false, light: false, top_to_bottom: false, bottom_to_top: false };
    let alone = SneeOptions { strategies: none, ..preset(SneePreset::Paper) };
    let named = [
        ("paper", preset(SneePreset::Paper)),
        ("guided", preset(SneePreset::Guided)),
        ("everything", everything),
        ("alone", alone),
    ];
    let roulette = crate::estimators::Roulette::Below(1e-12);
    named.map(|(name, options)| (name, SneeOptions { roulette, ..options }))
}

/// Convex and not, flat and with interpolated normals.
fn bodies() -> [(&'static str, Arc<Shape>); 4] {
    let mesh = |mesh: Result<crate::geometry::Mesh>| Arc::new(Shape::Mesh(mesh.expect("closed")));
    [
        ("sphere", sphere()),
        ("torus", ring()),
        ("interpolated torus", mesh(procedural::torus(0.7, 0.3, [24, 12], true))),
        ("bumpy", mesh(procedural::bumpy_sphere(1.0, 3, 0.05, 6.0, true))),
    ]
}

/// Leads a new walk to x_j; `stop` is called where it stands at x_i, if that is a medium vertex of the end.
fn led<'a, B: WalkBands>(
    (snee, key, hero, bands): (&'a Snee, &'a PassKey, usize, B),
    scores: &'a mut Scores,
    path: &FixedPath,
    before: Before,
    mut stop: impl FnMut(&mut Walk<'a, B>),
) -> Walk<'a, B> {
    let on = Path { field: snee.walks.field(), band: hero, index: 0, key };
    let start = if before == Before::Nothing { path.x_i } else { path.start };
    let connections = Connections::new(&snee.setups[0], key.stream(0, Purpose::Connection));
    let mut walk = CameraWalk::led(on, scores, connections, bands, start);
    if before != Before::Nothing {
        walk.lead_to(path.x_i, false);
    }
    match before {
        Before::Vertex => stop(&mut walk),
        Before::Reflection => <Connections<'_> as Rivals>::depart(&mut walk),
        Before::Nothing => {}
    }
    walk.lead_to(path.x_j, before != Before::Nothing);
    walk
}

/// The root of a path's light that is its x_k, as the technique hands it over.
fn connected<'a, B: WalkBands>(walk: &mut Walk<'a, B>, path: &FixedPath) -> GuidedEnd<'a> {
    let setup = walk.rivals.setup;
    let guide = setup.guides.iter().find(|guide| guide.light == path.light).expect("a guide");
    let x = walk.rivals.vertex(Slot::Latest).point;
    let query = Query::new(x, path.w_l, walk.boundary.eta());
    let mut roots: Vec<Root> = Vec::new();
    let technique = setup.specular.as_ref().expect("takes part");
    technique
        .solver
        .roots(&walk.scene.shape, &query, &mut SolverWork::default(), &mut |r| roots.push(r));
    let apart = |root: &Root| root.point.distance(path.exit.hit.point);
    let root = roots.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).copied().expect("a root");
    assert!(apart(&root) < 1e-6, "the nearest root is off by {}", apart(&root));
    let lit = LitVertex { guide, w_l: path.w_l, radiance: path.radiance, roots };
    lit.end(walk, &root).expect("x_j sees x_k")
}

/// Densities of the techniques, each in a scene that has the path's light alone.
fn alone(snee: &[Snee; 2], path: &FixedPath, before: Before, end: &GuidedEnd<'_>) -> [f64; 5] {
    let key = StreamKey::named("alone").pass(0);
    let mut densities = [0.0; 5];
    for (from_above, snee) in [(true, &snee[0]), (false, &snee[1])] {
        let mut scores = Scores::new(Layout::new(&snee.walks.field().scene));
        let mut walk = led((snee, &key, 0, OneBand), &mut scores, path, before, |_| {});
        let GuidedEnd { exit, leg, w_l, .. } = end;
        let guide = &walk.rivals.setup.guides[0];
        let keep = walk.rivals.unidirectional();
        let of = End::new(&walk, guide, exit, *w_l, keep, None);
        densities[0] = of.unidirectional;
        densities[3] = last_vertex::density(&mut walk, Slot::Latest, leg, &of);
        densities[4] = specular::density(&walk, Slot::Latest, leg, exit, &of);
        let [x_i, x_j] = [Slot::Previous, Slot::Latest].map(|slot| walk.rivals.vertex(slot).point);
        if before == Before::Vertex && walk.sees_point(x_i, exit.hit.point) {
            let middle = Middle::new(x_i, x_j, &exit.hit).expect("x_k is met from inside");
            densities[if from_above { 1 } else { 2 }] =
                subdivision::density(&mut walk, Slot::Previous, &middle, exit, &of);
        }
    }
    densities
}

/// See the head of `weights_tests`: the sum of p_t / D_t is 1, D_t from the score that technique t gives to a path, p_t from a
/// scene with its light and that technique.
#[test]
fn weights_with_connections_sum_to_one() {
    let media = [medium(4.0, 0.9, 0.3)];
    let key = StreamKey::named("weights_with_connections_sum_to_one");
    let mut stream = key.pass(0).stream(0, Purpose::Sensor);
    let sets: [&[Lamp]; 4] = [
        &[Lamp::Disc],
        &[Lamp::Sun],
        &[Lamp::Disc, Lamp::WideDisc],
        &[Lamp::WideDisc, Lamp::Sun, Lamp::Disc],
    ];
    // How often a technique takes part: by what is before x_j, and whether x_i sees x_k.
    let mut seen = [[0u32; 5]; 4];
    for (name, shape) in bodies() {
        for (which, options) in options() {
            let end = |from_above: bool, lamp: Lamp| {
                let all = options.strategies;
                let strategies = Strategies {
                    top_to_bottom: all.top_to_bottom && from_above,
                    bottom_to_top: all.bottom_to_top && !from_above,
                    ..all
                };
                let scene = body(&shape, SMOOTH, &media, &[lamp]);
                let options = SneeOptions { strategies, ..options.clone() };
                Snee::connected(scene, options).expect("a scene for it")
            };
            for lamps in sets {
                let scene = body(&shape, SMOOTH, &media, lamps);
                let snee = Snee::connected(scene.clone(), options.clone()).expect("a scene for it");
                let all: f64 = scene.lights.iter().map(|light| light.strength(0)).sum();
                for (light, &lamp) in lamps.iter().enumerate() {
                    let reference = [true, false].map(|from_above| end(from_above, lamp));
                    let is_parallel = lamp == Lamp::Sun;
                    let mut done = 0;
                    while done < 36 {
                        // Of paths to points that another vertex sees x_i sees most.
                        let Some(path) = FixedPath::draw(&scene, light, &mut stream, done % 4 > 0)
                        else {
                            continue;
                        };
                        done += 1;
                        for before in [Before::Nothing, Before::Vertex, Before::Reflection] {
                            let pass = key.pass(1);
                            let mut scores = Scores::new(Layout::new(&scene));
                            let mut scout =
                                led((&snee, &pass, 0, OneBand), &mut scores, &path, before, |_| {});
                            let end = connected(&mut scout, &path);
                            let [x_i, x_j] =
                                [Slot::Previous, Slot::Latest].map(|s| scout.rivals.vertex(s).point);
                            let sees =
                                before == Before::Vertex && scout.sees_point(x_i, end.exit.hit.point);
                            let &GuidedEnd { guide, exit, w_l, .. } = &end;
                            let f = scout.throughput
                                * End::new(&scout, guide, &exit, w_l, [1.0; 2], Some(path.radiance))
                                    .value;
                            let observed = if lamps.len() > 1 {
                                1 + crate::estimators::TransportClass::ALL.len() + light
                            } else {
                                0
                            };
                            let mut by = [0.0; 5];
                            let mut scores = Scores::new(Layout::new(&scene));
                            let strategies = options.strategies;
                            let mut walk =
                                led((&snee, &pass, 0, OneBand), &mut scores, &path, before, |walk| {
                                    if !sees {
                                        return;
                                    }
                                    let middle = Middle::new(x_i, x_j, &exit.hit).expect("from inside");
                                    let radiance = Some(path.radiance);
                                    let found = Subdivided { guide, x_j, middle, exit, w_l, radiance };
                                    for (t, takes_part) in
                                        [(1, strategies.top_to_bottom), (2, strategies.bottom_to_top)]
                                    {
                                        if takes_part {
                                            walk.scores.clear();
                                            score_subdivided(walk, &found);
                                            by[t] = walk.scores.observables[observed];
                                        }
                                    }
                                });
                            walk.scores.clear();
                            score_guided(&mut walk, &end);
                            // One score for both: whichever technique has drawn the end.
                            [by[3], by[4]] = [walk.scores.observables[observed]; 2];
                            walk.lead_out(&exit);
                            if walk.rivals.unidirectional()[0] > 0.0 && !is_parallel {
                                walk.scores.clear();
                                walk.score_own_sample(w_l);
                                by[0] = walk.scores.observables[observed];
                            }
                            let densities = alone(&reference, &path, before, &end);
                            let share = scene.lights[light].strength(0) / all;
                            let shares = [1.0, share, share, share, share];
                            let row = match before {
                                Before::Nothing => 0,
                                Before::Vertex => 1 + usize::from(!sees),
                                Before::Reflection => 3,
                            };
                            let mut sum = 0.0;
                            for (t, share) in shares.into_iter().enumerate() {
                                let weight = share * densities[t] * by[t] / f;
                                sum += weight;
                                seen[row][t] += u32::from(weight > 0.0);
                            }
                            assert!(
                                (sum - 1.0).abs() < 1e-12,
                                "{name}, {which}, {lamps:?}, {lamp:?}, {before:?}: weights sum to {sum}: \
                                 {TECHNIQUES:?} have densities {densities:?} and score {by:?} of {f}"
                            );
                        }
                    }
                }
            }
        }
    }
    println!("{TECHNIQUES:?}: {seen:?}");
    for (row, counts) in seen.into_iter().enumerate() {
        let expected = [true, row == 1, row == 1, true, true];
        for (count, expected) in counts.into_iter().zip(expected) {
            assert_eq!(count > 20, expected, "{row}: {counts:?}");
        }
    }
}

/// What the technique draws from these numbers: call, guide, light 2.
fn drawn(
    snee: &Snee,
    at: &FixedPath,
    before: Before,
    numbers: &[f64],
) -> Option<(usize, DVec3, Vec<Root>)> {
    let key = StreamKey::named("drawn").pass(0);
    let mut scores = Scores::new(Layout::new(&snee.walks.field().scene));
    let mut walk = led((snee, &key, 0, OneBand), &mut scores, at, before, |_| {});
    walk.rivals.stream = Stream::scripted(numbers);
    let technique = walk.rivals.setup.specular.as_ref().expect("takes part");
    let LitVertex { guide, w_l, roots, .. } = specular::draw(&mut walk, technique)?;
    Some((guide.light, w_l, roots))
}

/// The share of the first number with which the technique is called.
fn share_of_calls(snee: &Snee, at: &FixedPath, before: Before, numbers: [f64; 4]) -> f64 {
    let [mut called, mut silent] = [0.0, 1.0];
    for _ in 0..50 {
        let middle = 0.5 * (called + silent);
        let [_, rest @ ..] = numbers;
        let is_called = drawn(snee, at, before, &[&[middle], &rest[..]].concat()).is_some();
        *(if is_called { &mut called } else { &mut silent }) = middle;
    }
    called
}

/// Two numbers of a disc move x_k on its facet: the inverse Jacobian of that, measured, is the density per area, times the
/// probabilities of the light and of the call, which is the share of the first number that draws anything.
#[test]
fn connections_are_as_dense_as_they_state() {
    let key = StreamKey::named("connections_are_as_dense_as_they_state");
    let mut stream = key.pass(0).stream(0, Purpose::Sensor);
    let lamps = [Lamp::WideDisc, Lamp::Disc];
    let media = [medium(3.0, 0.9, 0.3)];
    let [.., (_, options), _] = options();
    for (name, shape) in bodies() {
        let scene = body(&shape, SMOOTH, &media, &lamps);
        let snee = Snee::connected(scene.clone(), options.clone()).expect("a scene for it");
        let total: f64 = scene.lights.iter().map(|light| light.strength(0)).sum();
        let mut done = [[0; 3]; 2];
        for turn in 0.. {
            if done.as_flattened().iter().all(|&count| count >= 8) {
                break;
            }
            let which = turn % 3;
            let before = [Before::Nothing, Before::Vertex, Before::Reflection][which];
            let Some(path) = FixedPath::draw(&scene, 0, &mut stream, false) else { continue };
            let numbers = [1e-9, stream.draw(), stream.draw(), stream.draw()];
            let Some((light, w_l, roots)) = drawn(&snee, &path, before, &numbers) else { continue };
            let Some(root) = roots.first().copied() else { continue };
            let frame = Frame::about(root.normal);
            let shift = |place: usize, h: f64| {
                let mut moved = numbers;
                moved[place] += h;
                let (_, _, roots) = drawn(&snee, &path, before, &moved)?;
                let on_facet = roots.into_iter().filter(|other| other.face == root.face);
                let apart = |other: &Root| other.point.distance(root.point);
                let near = on_facet.min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
                let local = frame.to_local(near.point - root.point);
                Some([local.x, local.y])
            };
            let column = |place: usize| {
                let difference = |h: f64| {
                    let (above, below) = (shift(place, h)?, shift(place, -h)?);
                    Some([0, 1].map(|i| (above[i] - below[i]) / (2.0 * h)))
                };
                let (wide, narrow) = (difference(2e-4)?, difference(1e-4)?);
                let size = narrow[0].hypot(narrow[1]);
                // Next to a fold, where two roots merge, differences do not settle.
                let is_settled = (0..2).all(|i| (wide[i] - narrow[i]).abs() < 1e-3 * size);
                is_settled.then(|| [0, 1].map(|i| (4.0 * narrow[i] - wide[i]) / 3.0))
            };
            let (Some([a, b]), Some([c, d])) = (column(2), column(3)) else { continue };
            let choice = scene.lights[light].strength(0) / total;
            let call = share_of_calls(&snee, &path, before, numbers);
            let later = if before == Before::Vertex { 0.4 } else { 1.0 };
            let depth = shape.clearance(path.x_j).max(0.0);
            let asked = 0.7 * later * exp(-0.2 * 3.0 * depth);
            assert!(
                (call / asked - 1.0).abs() < 1e-9,
                "{name}, {before:?}: called {call}, asked {asked}"
            );
            let measured = call * choice / (a * d - b * c).abs();
            let mut scores = Scores::new(Layout::new(&scene));
            let pass = key.pass(1);
            let walk = led((&snee, &pass, 0, OneBand), &mut scores, &path, before, |_| {});
            let Root { point, face, normal, shading, dir, distance, .. } = root;
            let hit = Hit { t: distance, point, normal, shading_normal: shading, face };
            let frame = Frame::about(shading);
            let exit = WalkExit { hit, frame, wo: frame.to_local(-dir) };
            let guide = walk.rivals.setup.guides.iter().find(|g| g.light == light).expect("a guide");
            let end = End::new(&walk, guide, &exit, w_l, [1.0; 2], None);
            let leg = Leg { dir, length: distance };
            let over = specular::density(&walk, Slot::Latest, &leg, &exit, &end);
            let walked = walk.medium.phase.pdf(walk.rivals.vertex(Slot::Latest).arrival.dot(dir))
                * transmittance(3.0, distance)
                * dir.dot(normal)
                / (distance * distance);
            let stated = over * walked;
            assert!(
                (measured / stated - 1.0).abs() < 1e-5,
                "{name}, {:?}, {before:?}: draws with density {measured}, states {stated}, ratio {}",
                lamps[light],
                measured / stated
            );
            done[light][which] += 1;
        }
    }
}

/// Towards the caustic of a sphere the connection alone scores without bound, and with subdivision no more than
/// subdivision alone, which has a limit.
#[test]
fn subdivision_bounds_the_weights_at_a_caustic() {
    let eta = 1.5;
    let media: [Medium; 1] = [medium(1.0, 0.9, 0.0)];
    let scene = body(&sphere(), Boundary::Smooth { eta }, &media, &[Lamp::Sun]);
    let Emission::Directional { toward, irradiance } = &scene.lights[0].emission else { panic!() };
    let (cl, key) = (0.5f64, StreamKey::named("subdivision_bounds").pass(0));
    let across = Frame::about(*toward).s;
    let normal = *toward * cl + across * (1.0 - cl * cl).sqrt();
    let ct = (1.0 - (1.0 - cl * cl) / (eta * eta)).sqrt();
    let w = (*toward + normal * (eta * ct - cl)) / eta;
    // The rays of a plane of incidence meet where 1 = s (eta cos_T - cos_L) / (eta R cos_T^2).
    let fold = ct * ct * eta / (eta * ct - cl);
    assert!(fold < 2.0 * ct, "inside");
    let frame = Frame::about(normal);
    let face = crate::geometry::FaceId(0);
    const TOP_TO_BOTTOM: usize = 0;
    const CONNECTION: usize = 1;
    const BOTH: usize = 2;
    let scores_at = |off: f64| {
        let distance = fold * (1.0 - off);
        let x_j = normal - w * distance;
        let hit = Hit { t: distance, point: normal, normal, shading_normal: normal, face };
        let exit = WalkExit { hit, frame, wo: frame.to_local(-w) };
        let x_i = DVec3::new(0.2, -0.3, 0.1);
        let path = FixedPath {
            start: DVec3::new(-0.1, -0.2, 0.6),
            x_i,
            x_j,
            exit,
            w_l: *toward,
            radiance: irradiance[0],
            light: 0,
        };
        let full = |top_to_bottom: bool, connection: bool| {
            let strategies = Strategies { bsdf: true, light: true, top_to_bottom, bottom_to_top: false };
            let call = Call { most: 1.0, decay: 0.0 };
            let connection = connection.then_some(ConnectionCall { most: 1.0, decay: 0.0, later: 1.0 });
            let guided = SneePreset::Guided.options();
            let options = SneeOptions {
                strategies,
                call,
                call_alone: call,
                connection,
                last_vertex: None,
                ..guided
            };
            let snee = Snee::new(scene.clone(), options).expect("a scene for it");
            let mut scores = Scores::new(Layout::new(&scene));
            let mut walk = led((&snee, &key, 0, OneBand), &mut scores, &path, Before::Vertex, |_| {});
            walk.scores.clear();
            let guide = &walk.rivals.setup.guides[0];
            let (leg, radiance) = (Leg { dir: w, length: distance }, Some(irradiance[0]));
            score_guided(&mut walk, &GuidedEnd { guide, exit, leg, w_l: *toward, radiance });
            walk.scores.observables[0]
        };
        [full(true, false), full(false, true), full(true, true)]
    };
    let far = scores_at(1e-2);
    let mut last = far;
    for off in [1e-4, 1e-6, 1e-8, 1e-10] {
        let near = scores_at(off);
        println!("{off:e}: top to bottom, connection, both score {near:?}");
        assert!(near[CONNECTION] > 50.0 * last[CONNECTION], "{off}: {near:?}");
        assert!(
            near[BOTH] <= near[TOP_TO_BOTTOM] && near[BOTH] < 2.0 * far[TOP_TO_BOTTOM],
            "{off}: {near:?}"
        );
        last = near;
    }
}

/// Of a walk that bands share, an end scores the same in each band, whichever technique makes it and whichever band has
/// steered the walk.
#[test]
fn shared_walks_score_connections_alike() {
    let name = "shared_walks_score_connections_alike";
    let pass = StreamKey::named(name).pass(0);
    let mut stream = StreamKey::named(name).pass(1).stream(0, Purpose::Sensor);
    let media = [medium(3.0, 0.95, 0.2), medium(4.0, 0.9, 0.5), medium(6.0, 0.7, 0.0)];
    let [.., (_, everything), _] = options();
    let scene = body(&sphere(), SMOOTH, &media, &[Lamp::WideDisc, Lamp::Sun]);
    let shared = SneeOptions { share_bands: true, ..everything };
    let snee = Snee::connected(scene.clone(), shared).expect("a scene for it");
    let mut done = 0;
    while done < 10 {
        let Some(path) = FixedPath::draw(&scene, done % 2, &mut stream, false) else { continue };
        done += 1;
        for before in [Before::Nothing, Before::Vertex, Before::Reflection] {
            let mut of_bands = [const { Vec::<f64>::new() }; 3];
            for hero in 0..media.len() {
                let on = || (&snee, &pass, hero, SharedBands::new(&media, hero));
                let mut scores = Scores::new(Layout::new(&scene));
                let mut scout = led(on(), &mut scores, &path, before, |_| {});
                let end = connected(&mut scout, &path);
                let [x_i, x_j] = [Slot::Previous, Slot::Latest].map(|s| scout.rivals.vertex(s).point);
                let GuidedEnd { guide, exit, w_l, .. } = end;
                let mut keep = |walk: &Walk<'_, SharedBands>| {
                    for (band, kept) in of_bands.iter_mut().enumerate() {
                        kept.push(walk.scores.observables[band]);
                    }
                };
                let mut scores = Scores::new(Layout::new(&scene));
                let mut walk = led(on(), &mut scores, &path, before, |walk| {
                    let middle = Middle::new(x_i, x_j, &exit.hit).expect("from inside");
                    let radiance = Some(path.radiance);
                    walk.scores.clear();
                    score_subdivided(walk, &Subdivided { guide, x_j, middle, exit, w_l, radiance });
                    keep(walk);
                });
                walk.scores.clear();
                score_guided(&mut walk, &end);
                keep(&walk);
                walk.lead_out(&exit);
                if path.light == 0 {
                    walk.scores.clear();
                    walk.score_own_sample(w_l);
                    keep(&walk);
                }
            }
            for scores in of_bands {
                let is_alike = |score: &f64| (score / scores[0] - 1.0).abs() < 1e-12;
                assert!(scores.iter().all(is_alike), "light {}, {before:?}: {scores:?}", path.light);
            }
        }
    }
}

/// A ring lit along its plane: many roots lie on the far side of the hole. A root counts exactly where the first
/// surface along its direction is at the root.
#[test]
fn roots_behind_another_part_of_the_body_do_not_count() {
    let mut scene = body(&ring(), SMOOTH, &[medium(3.0, 0.9, 0.3)], &[Lamp::Sun]);
    let toward = DVec3::new(0.97, 0.2, 0.1).normalize();
    let lights = &mut Arc::get_mut(&mut scene).expect("not shared").lights;
    lights[0].emission = Emission::Directional { toward, irradiance: vec![1.0] };
    let [.., (_, options)] = options();
    let snee = Snee::connected(scene.clone(), options).expect("a scene for it");
    let key = StreamKey::named("roots_behind_another_part").pass(0);
    let mut stream = key.stream(0, Purpose::Sensor);
    let mut counts = [0u32; 2];
    for _ in 0..400 {
        let Some(x) = point_inside(&scene, &mut stream) else { continue };
        let on = Path { field: snee.walks.field(), band: 0, index: 0, key: &key };
        let mut scores = Scores::new(Layout::new(&scene));
        // The first number decides that the technique is called, whatever the distance to the boundary.
        let connections = Connections::new(&snee.setups[0], Stream::scripted(&[1e-9, 0.5, 0.5, 0.5]));
        let start = x + DVec3::new(0.01, 0.02, -0.01);
        let mut walk = CameraWalk::led(on, &mut scores, connections, OneBand, start);
        walk.lead_to(x, false);
        let technique = walk.rivals.setup.specular.as_ref().expect("takes part");
        let Some(lit) = specular::draw(&mut walk, technique) else { continue };
        for root in &lit.roots {
            let ray = Ray { origin: x, dir: root.dir };
            let first = scene.shape.intersect(&ray, Side::Inside, None, f64::INFINITY);
            let is_first = first.is_some_and(|hit| hit.t > 0.999 * root.distance);
            assert_eq!(lit.end(&mut walk, root).is_some(), is_first, "{x} {root:?} {first:?}");
            counts[usize::from(is_first)] += 1;
        }
    }
    assert!(counts.iter().all(|count| *count > 20), "{counts:?}");
}
