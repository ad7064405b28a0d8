//! The predictions of the warm-up against runs, and means with learned calls.

use std::sync::Arc;

use super::super::options::BandWalks;
use super::super::state::Connections;
use super::super::testing::{Lamp, ROUGH, SMOOTH, body, medium, ring, sphere};
use super::super::{EdgeTechnique, LastVertex, Photons, Snee, SneeChoices, TwoBounce};
use super::*;
use crate::error::Result;
use crate::estimators::walk::trace_passes;
use crate::estimators::{Estimator, WalkDraw};
use crate::geometry::{Shape, procedural};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::optics::medium::Medium;
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::scene::sensor::BodyFlux;
use crate::scene::{Scene, Sensor};

/// The flux out of a body; one path a pass, so that a pass's score is a path's.
fn flux(shape: &Arc<Shape>, boundary: Boundary, media: &[Medium], lamps: &[Lamp]) -> Arc<Scene> {
    let bounds = shape.bounds().expect("finite");
    let mut scene = Arc::into_inner(body(shape, boundary, media, lamps)).expect("not shared");
    scene.sensor =
        Sensor::BodyFlux(BodyFlux { bounds, frame: Frame::about(DVec3::Z), bins: 1, paths: 1 });
    Arc::new(scene)
}

fn bumps(interpolated: bool) -> Arc<Shape> {
    Arc::new(Shape::Mesh(procedural::bumpy_sphere(1.0, 3, 0.1, 4.0, interpolated).expect("closed")))
}

fn learning(paths: u64) -> SneeChoices {
    SneeChoices { learned_calls: Some(LearnedCalls { paths }), ..SneeChoices::default() }
}

fn set_up(scene: &Arc<Scene>, choices: &SneeChoices, connects: bool) -> Result<Snee> {
    if connects {
        Snee::connected(scene.clone(), choices.connected()?)
    } else {
        Snee::new(scene.clone(), choices.options()?)
    }
}

/// Mean and standard error of the flux in both bands.
fn bands_of_flux(scene: &Arc<Scene>, snee: &Snee, passes: u64, test: &str) -> [(f64, f64); 2] {
    let key = StreamKey::named(test);
    let mut scores = Scores::new(Layout::new(scene));
    let mut sums = [[0.0; 2]; 2];
    for pass in 0..passes {
        scores.clear();
        snee.pass(&[0, 1], &key.pass(pass), &mut scores);
        for (sums, score) in sums.iter_mut().zip(&scores.observables) {
            *sums = [sums[0] + score, sums[1] + score * score];
        }
    }
    let n = passes as f64;
    sums.map(|[sum, squares]| (sum / n, ((squares / n - sum * sum / (n * n)) / n).sqrt()))
}

/// Mean and standard error of equally good estimates.
fn mean_and_error(estimates: &[f64]) -> [f64; 2] {
    let n = estimates.len() as f64;
    let mean = estimates.iter().sum::<f64>() / n;
    let squares: f64 = estimates.iter().map(|estimate| (estimate - mean) * (estimate - mean)).sum();
    [mean, (squares / (n * (n - 1.0))).sqrt()]
}

/// The second moment that notes predict for rarer calls is that of a run with them; so is that of the warm-up itself.
#[test]
#[ignore = "four minutes: what is predicted has a heavy tail"]
fn predicted_second_moments_are_those_of_runs() {
    const BATCHES: u64 = 250;
    const PATHS: u64 = 4000;
    let candidates = vec![
        [1.0; 4],
        [0.25, 0.5, 0.25, 1.0],
        [0.125, 0.25, 0.5, 0.25],
        [0.0, 0.5, 1.0, 0.0625],
        [0.0, 0.0, 1.0, 1.0],
        [1.0, 1.0, 1.0, 0.0],
    ];
    let photons = Some(Photons { paths: 1 << 14, most: 1.0 });
    for (name, shape, boundary, connects, photons) in [
        ("rough", sphere(), ROUGH, false, None),
        ("smooth", ring(), SMOOTH, true, None),
        ("rough, photons", ring(), ROUGH, false, photons),
        ("smooth, photons", ring(), SMOOTH, true, photons),
    ] {
        let scene = flux(&shape, boundary, &[medium(3.0, 0.9, 0.3)], &[Lamp::WideDisc]);
        let choices = SneeChoices { photons, ..SneeChoices::default() };
        let snee = set_up(&scene, &choices, connects).expect("a scene for it");
        let key = StreamKey::named(&format!("predicted_second_moments {name}"));
        let mut scores = Scores::new(Layout::new(&scene));
        // The warm-up's predictions, candidate by candidate, and what runs with these calls have.
        let mut batch = |setup: &BandSetup, first: u64, notes: Option<&RefCell<CallNotes>>| {
            let mut sum = 0.0;
            for path in first..first + PATHS {
                let key = key.pass(path);
                let path = Path { field: snee.walks.field(), band: 0, index: 0, key: &key };
                scores.clear();
                snee.trace(setup, notes, path, &mut scores);
                sum += scores.observables[0] * scores.observables[0];
                if let Some(notes) = notes {
                    notes.borrow_mut().end_path(0);
                }
            }
            sum / PATHS as f64
        };
        let upper = snee.setups[0].calling(snee.options.with_calls(MORE, [1.0; 4]));
        assert_eq!(upper.views > 1, connects);
        let mut choices: Vec<(usize, u32)> = (0..candidates.len()).map(|i| (i, upper.views)).collect();
        if connects {
            choices.extend([1, 3, 32].into_iter().flat_map(|views| [(0, views), (1, views)]));
        }
        let predictions: Vec<Vec<f64>> = (0..BATCHES)
            .map(|index| {
                let notes = CallNotes::new(&Prices::ANALYTIC, candidates.clone(), upper.views);
                let notes = RefCell::new(notes);
                batch(&upper, index * PATHS, Some(&notes));
                let [half, _] = notes.into_inner().halves;
                choices.iter().map(|&(index, views)| half.second(index, views) / PATHS as f64).collect()
            })
            .collect();
        for (number, &(candidate, views)) in choices.iter().enumerate() {
            let factors = candidates[candidate];
            let options = SneeOptions { views, ..snee.options.with_calls(MORE, factors) };
            let setup = snee.setups[0].calling(options);
            let first = (number as u64 + 1) * BATCHES * PATHS;
            let runs: Vec<f64> =
                (0..BATCHES).map(|index| batch(&setup, first + index * PATHS, None)).collect();
            let predictions: Vec<f64> = predictions.iter().map(|all| all[number]).collect();
            let [run, of_run] = mean_and_error(&runs);
            let [predicted, of_predicted] = mean_and_error(&predictions);
            println!(
                "{name}, {factors:?}, {views} views: predicted {predicted:.3} +- {of_predicted:.3}, run {run:.3} +- {of_run:.3}"
            );
            let error = (of_run * of_run + of_predicted * of_predicted).sqrt();
            assert!(
                (predicted - run).abs() < 4.0 * error,
                "{name}, {factors:?}, {views} views: {predicted} for {run} +- {error}"
            );
            assert!(error < 0.1 * run, "{name}, {factors:?}: {run} +- {error} cannot tell");
        }
    }
}

/// What a walk itself scores where photons draw more rarely is what notes predict, path by path: photons change no number of the
/// walk. Light that is scored by expectation is among it.
#[test]
fn scores_of_walks_beside_rarer_photons_are_predicted() {
    let name = "scores_of_walks_beside_rarer_photons_are_predicted";
    let no_last = LastVertex { most: 0.0, decay: 0.0, wide_share: 0.0, wide: 0.2 };
    let alone = |last_vertex, strategies| SneeChoices {
        photons: Some(Photons { paths: 1 << 14, most: 1.0 }),
        last_vertex,
        strategies,
        ..SneeChoices::default()
    };
    let unidirectional = vec![EdgeTechnique::Bsdf, EdgeTechnique::Light];
    for (kind, boundary, choices, factors, paths) in [
        (
            "rough",
            ROUGH,
            alone(Some(no_last), Some(unidirectional.clone())),
            [1.0, 1.0, 1.0, 0.25],
            4000,
        ),
        ("smooth", SMOOTH, alone(Some(no_last), Some(unidirectional)), [1.0, 1.0, 1.0, 0.25], 40_000),
        ("rough, others", ROUGH, alone(None, None), [0.5, 0.25, 1.0, 0.125], 4000),
        ("smooth, others", SMOOTH, alone(None, None), [0.5, 0.25, 1.0, 0.125], 16_000),
    ] {
        let scene = flux(&ring(), boundary, &[medium(1.0, 0.9, 0.3)], &[Lamp::WideDisc]);
        let snee = set_up(&scene, &choices, false).expect("served");
        let key = StreamKey::named(name);
        let of_walk = |setup: &BandSetup, path: u64| -> Vec<NotedScore> {
            let mut scores = Scores::new(Layout::new(&scene));
            let notes = RefCell::new(CallNotes::new(&Prices::FLAT, vec![[1.0; 4]], setup.views));
            let key = key.pass(path);
            let path = Path { field: snee.walks.field(), band: 0, index: 0, key: &key };
            snee.trace(setup, Some(&notes), path, &mut scores);
            let all = std::mem::take(&mut notes.borrow_mut().scores);
            all.into_iter().filter(|score| score.call.is_none()).collect()
        };
        // No more calls than the options ask for, so that those of the last vertex take the same numbers.
        let upper = snee.setups[0].calling(snee.options.with_calls(1.0, [1.0; 4]));
        let rarer = snee.setups[0].calling(snee.options.with_calls(1.0, factors));
        let mut parts = [0; 2];
        for path in 0..paths {
            let [given, found] = [&upper, &rarer].map(|setup| of_walk(setup, path));
            assert_eq!(given.len(), found.len(), "{kind}, {path}");
            for (given, found) in given.iter().zip(&found) {
                let change: f64 = (0..4).map(|t| (factors[t] - 1.0) * given.parts[t]).sum();
                let expected = given.value / (1.0 + change);
                assert!(
                    (found.value - expected).abs() <= 1e-9 * expected,
                    "{kind}, {path}: {} for {expected}, {given:?}",
                    found.value
                );
                parts[0] += u32::from(given.parts[3] > 0.1);
                parts[1] += u32::from(given.parts[..2].iter().any(|part| *part > 0.1));
            }
        }
        println!("{kind}: {parts:?} scores with parts of photons and of others");
        assert!(parts[0] >= 40 && (parts[1] >= 20) == kind.ends_with("others"), "{kind}: {parts:?}");
    }
}

/// Means with learned calls are those of the given options: bodies with flat and interpolated normals, not convex, two
/// lights, two bands, forward scattering, plain, guided and shared walks. (Plain walks of `snee` are a claim of `verify`.)
#[test]
fn means_stay() {
    let media = [medium(4.0, 0.95, 0.0), medium(2.0, 0.8, 0.7)];
    let guided = WalkDraw::Guided { share: 0.8, nodes: 8, least_depth: Some(0.0), near_lights: true };
    let plain = WalkDraw::Plain {};
    let lamps = [Lamp::WideDisc, Lamp::Sky];
    let [mut count, mut without] = [0; 2];
    // As many passes as leave an error of 4 %, or less.
    for (name, shape, boundary, connects, (walk, bands), passes) in [
        ("smooth ring", ring(), SMOOTH, true, (guided, BandWalks::Alone), 12_000),
        ("rough bumps", bumps(false), ROUGH, false, (guided, BandWalks::Alone), 6_000),
        ("rough ball", sphere(), ROUGH, false, (plain, BandWalks::Alone), 6_000),
        ("smooth bumps", bumps(true), SMOOTH, true, (plain, BandWalks::Alone), 6_000),
        ("sphere", sphere(), SMOOTH, false, (plain, BandWalks::Shared), 20_000),
    ] {
        let scene = flux(&shape, boundary, &media, &lamps);
        let given = SneeChoices { walk, bands, ..SneeChoices::default() };
        let learned =
            SneeChoices { learned_calls: Some(LearnedCalls { paths: 16384 }), ..given.clone() };
        let [given, learned] =
            [given, learned].map(|choices| set_up(&scene, &choices, connects).expect("served"));
        let measure = |snee: &Snee, test: &str| {
            bands_of_flux(&scene, snee, passes, &format!("means_stay {name} {test}"))
        };
        let pairs = measure(&given, "given").into_iter().zip(measure(&learned, "learned"));
        let chosen: Vec<_> = learned.setups_in_use().iter().map(|setup| setup.chosen).collect();
        let factors = || chosen.iter().flatten().filter_map(|chosen| chosen.factors);
        count += factors().count();
        without += factors().filter(|factors| factors[0] == 0.0).count();
        for (band, ((a, of_a), (b, of_b))) in pairs.enumerate() {
            let error = (of_a * of_a + of_b * of_b).sqrt();
            println!("{name}, {band}: {a:.4} +- {of_a:.4}, learned {b:.4} +- {of_b:.4}, {chosen:?}");
            assert!((a - b).abs() < 4.0 * error, "{name}, {band}: {a} +- {of_a}, learned {b} +- {of_b}");
            assert!(error < 0.05 * a, "{name}, {band}: the error {error} of {a} is too large to tell");
        }
    }
    assert!(count >= 5, "calls of {count} setups have been changed: too few to tell");
    assert!(without > 0, "subdivision has been left out nowhere");
}

/// The same choice every time, stated in the record's notes once it is made; the warm-up's streams are no pass's.
#[test]
fn choices_are_reproducible() {
    let scene = flux(&sphere(), ROUGH, &[medium(10.0, 0.9, 0.0)], &[Lamp::Disc]);
    let learn = || set_up(&scene, &learning(4096), false).expect("served");
    let [a, b] = [learn(), learn()];
    assert!(a.notes().iter().all(|note| !note.contains("learned")), "nothing has been learned yet");
    a.prepare();
    b.prepare();
    let chosen = |snee: &Snee| snee.setups_in_use()[0].chosen.expect("learned");
    assert_eq!(chosen(&a), chosen(&b));
    let notes = a.notes();
    assert!(notes.iter().any(|note| note.contains("learned calls: call.most = ")), "{notes:?}");
}

/// In a disc's mirror image one ray sees the light and the next does not: a warm-up takes more views where this is most of the
/// variance, because next to nothing is scattered, and states the number; each is a ray.
#[test]
fn the_chosen_number_of_views_is_taken() {
    let media = [medium(4.0, 0.95, 0.0), medium(4.0, 1e-3, 0.0)];
    let scene = flux(&sphere(), SMOOTH, &media, &[Lamp::Disc]);
    let choices =
        SneeChoices { learned_calls: Some(LearnedCalls { paths: 4096 }), ..Default::default() };
    let snee = set_up(&scene, &choices, true).expect("served");
    snee.prepare();
    let views: Vec<u32> = snee.setups_in_use().iter().map(|setup| setup.views).collect();
    let chosen: Vec<Option<u32>> =
        snee.setups_in_use().iter().map(|setup| setup.chosen.expect("learned").views).collect();
    assert_eq!(chosen, views.iter().copied().map(Some).collect::<Vec<_>>());
    let rough = flux(&sphere(), ROUGH, &media, &[Lamp::Disc]);
    let eight = SneeChoices { views: Some(8), ..Default::default() };
    let rough = set_up(&rough, &eight, false).expect("served");
    assert_eq!(rough.setups[0].views, 1, "behind a rough boundary no expectation is scored");
    let given = snee.setups[0].views;
    assert!(views[0] < views[1] && views[1] != given, "{views:?}");
    let note = format!("views = {}, {};", views[0], views[1]);
    assert!(snee.notes().iter().any(|text| text.contains(&note)), "{:?}", snee.notes());
    let rays = |views: u32, band: usize| {
        let setup = BandSetup { views, ..snee.setups_in_use()[band].clone() };
        let mut scores = Scores::new(Layout::new(&scene));
        for pass in 0..100 {
            let key = StreamKey::named("the_chosen_number_of_views_is_taken").pass(pass);
            let path = Path { field: snee.walks.field(), band, index: 0, key: &key };
            snee.trace(&setup, None, path, &mut scores);
        }
        scores.cost[Cost::Rays as usize]
    };
    for (band, views) in views.into_iter().enumerate() {
        let mut scores = Scores::new(Layout::new(&scene));
        for pass in 0..100 {
            let key = StreamKey::named("the_chosen_number_of_views_is_taken").pass(pass);
            snee.pass(&[band], &key, &mut scores);
        }
        assert_eq!(scores.cost[Cost::Rays as usize], rays(views, band));
        assert!(rays(views + 1, band) >= rays(views, band) + 100);
    }
}

/// Two ways to one path, each with half of the density, each of which finds it in half of all cases: the sum is 1 in the
/// mean for any factor of the second way. Without it the variance is twice as large, so that its cost decides.
#[test]
fn calls_follow_their_cost() {
    let rarest = [0.03125, 1.0, 1.0, 1.0];
    let none = [0.0, 1.0, 1.0, 1.0];
    let candidates = vec![[1.0; 4], [0.5, 1.0, 1.0, 1.0], rarest, none];
    let mut notes = CallNotes::new(&Prices::ANALYTIC, candidates, 1);
    for path in 0..400 {
        if path % 2 == 0 {
            notes.weigh([0.5, 0.0, 0.0, 0.0]);
            notes.score(1.0);
        }
        notes.begin(Some(CalledTechnique::Subdivision));
        if path % 4 < 2 {
            notes.weigh([0.5, 0.0, 0.0, 0.0]);
            notes.score(1.0);
        }
        notes.begin(None);
        notes.end_path(path / 4 % 2);
    }
    notes.halves.iter_mut().for_each(|half| half.squared_mean = 100.0);
    for (candidate, factor) in [1.0, 0.5, rarest[0], 0.0].into_iter().enumerate() {
        // (v / 2 + f v / 2)^2 + v^2 / 4 + v^2 f / 2 (1 - f / 2), v = 2 / (1 + f): the mean is 1.
        let v = 2.0 / (1.0 + factor);
        let expected = 1.0 + v * v * (0.25 + 0.5 * factor * (1.0 - 0.5 * factor));
        let found = notes.halves[0].second(candidate, 1) / 200.0;
        assert!((found - expected).abs() < 1e-12, "{factor}: {found} for {expected}");
    }
    assert_eq!(notes.choice(200, 1e9, 0.0).factors, None, "what costs nothing stays");
    let dear = notes.choice(200, 1.0, 0.0);
    assert_eq!(dear.factors, Some(none));
    assert!(dear.gain > 10.0, "{dear:?}");
}

/// A coin at each of four sensor rays, and another score that depends on the first coin: the second moment is that of all 16
/// cases for any number of views. Few views are chosen where they cost more than they gain, and many where they do not.
#[test]
fn views_follow_their_cost() {
    const V: u32 = 4;
    let coin = |case: u32, ray: u32| f64::from(case >> ray & 1);
    let rest = |case: u32| 1.0 + 0.5 * coin(case, 0);
    let mut notes = CallNotes::new(&Prices::ANALYTIC, vec![[1.0; 4]], V);
    let mut wholes = 0.0;
    for case in 0..2 * 16 {
        for ray in (0..V).rev() {
            // Two lights are seen at once.
            notes.view(Some(if ray == 0 { LookingRay::Own } else { LookingRay::Further }));
            [0.25, 0.75].into_iter().for_each(|part| notes.score(part * coin(case, ray) / f64::from(V)));
            notes.view(None);
        }
        notes.score(rest(case));
        wholes += notes.end_path((case / 16) as usize);
    }
    assert_eq!(wholes, 32.0 * (1.25 + 0.5));
    // The means do not depend on the number of views.
    notes.halves.iter_mut().for_each(|half| half.squared_mean = 8.0 * 1.75 * 1.75);
    for views in [1, 2, 3, 4] {
        let score = |case: u32| {
            let seen: f64 = (0..views).map(|ray| coin(case, ray)).sum();
            rest(case) + seen / f64::from(views)
        };
        let expected: f64 = (0..16).map(|case| score(case) * score(case)).sum();
        let found = notes.halves[0].second(0, views);
        assert!((found - expected).abs() < 1e-12, "{views} views: {found} for {expected}");
    }
    // Var X + 2 Cov(X, e_1) / v + Var e / v: 1/16 + 1/4 v + 1/4 v.
    let variance = |views: u32| 1.0 / 16.0 + 0.5 / f64::from(views);
    let price = notes.prices.view;
    for (walk, best) in [(0.01 * price, 1), (1.5 * price, 2), (10.0 * price, 8), (1000.0 * price, 32)] {
        let cost = |views: u32| walk + f64::from(views - 1) * price;
        let chosen = notes.choice(16, 32.0 * walk, 0.0);
        assert_eq!(chosen.views, Some(best), "{walk}");
        let gain = variance(V) * cost(V) / (variance(best) * cost(best));
        assert!((chosen.gain - gain).abs() < 1e-12, "{walk}: {chosen:?} for {gain}");
    }
    let stays = notes.choice(16, 32.0 * 3.0 * price, 0.0);
    assert_eq!((stays.factors, stays.views), (None, None), "{stays:?}");
}

/// Where calls of subdivision cost little and gain little, the price of its densities decides: those that walks ask for, and
/// those that calls of other techniques ask for, as often as these are made.
#[test]
fn densities_of_subdivision_are_saved_without_it() {
    let candidates = vec![[1.0; 4], [0.03125, 1.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0]];
    let mut notes = CallNotes::new(&Prices::ANALYTIC, candidates, 1);
    let asks = |notes: &mut CallNotes, times: usize| (0..times).for_each(|_| notes.ask());
    for path in 0..400 {
        // The score alternates, so that there is variance; no technique has a part in it.
        asks(&mut notes, 2);
        notes.weigh([0.0; 4]);
        notes.score(f64::from(path % 2));
        notes.begin(Some(CalledTechnique::LastVertex));
        asks(&mut notes, 3);
        notes.begin(Some(CalledTechnique::Subdivision));
        notes.begin(None);
        notes.end_path((path / 2 % 2) as usize);
    }
    assert_eq!((notes.asked_by_walks, notes.asked), (800.0, [0.0, 1200.0, 0.0, 0.0]));
    let chosen = notes.choice(200, 1.0, 0.0);
    let Prices { call: [subdivision, last_vertex, ..], density, .. } = *notes.prices;
    let cost =
        |rate: f64, asked: f64| 1.0 + 400.0 * (rate * subdivision + last_vertex) + density * asked;
    assert_eq!(chosen.factors, Some([0.0, 1.0, 1.0, 1.0]));
    assert!((chosen.gain - cost(1.0, 2000.0) / cost(0.0, 0.0)).abs() < 1e-12, "{chosen:?}");
}

/// Paths that subdivision alone finds are not scored without it.
#[test]
fn what_only_subdivision_finds_needs_it() {
    let mut notes = CallNotes::new(&Prices::ANALYTIC, vec![[1.0; 4], [0.0, 1.0, 1.0, 1.0]], 1);
    notes.begin(Some(CalledTechnique::Subdivision));
    notes.weigh([1.0, 0.0, 0.0, 0.0]);
    notes.score(3.0);
    notes.begin(None);
    notes.end_path(0);
    assert_eq!([0, 1].map(|candidate| notes.halves[0].second(candidate, 1)), [9.0, 0.0]);
}

/// Subdivision is left out where it costs more than it gains, and only where other techniques draw all its paths: not of
/// parallel light through a smooth boundary, not without BSDF or light sampling, or the last vertex, and not behind sharp
/// boundaries of meshes.
#[test]
fn subdivision_is_left_out_where_all_paths_are_drawn_without_it() {
    let left_out = |shape: &Arc<Shape>, boundary, lamp, choices: SneeChoices| {
        let scene = flux(shape, boundary, &[medium(10.0, 0.99, 0.0)], &[lamp]);
        let snee = set_up(&scene, &choices, false).expect("served");
        let subdivides = snee.setups_in_use()[0].options.strategies.subdivides();
        (snee.may_go_without_subdivision(0), !subdivides)
    };
    let learn = || learning(16384);
    let without = |technique: EdgeTechnique| {
        let all = [EdgeTechnique::Bsdf, EdgeTechnique::Light, EdgeTechnique::TopToBottom];
        let strategies = all.into_iter().filter(|other| *other != technique).collect();
        SneeChoices { strategies: Some(strategies), least_concentration: Some(1.0), ..learn() }
    };
    let no_last = LastVertex { most: 0.0, decay: 0.0, wide_share: 0.0, wide: 0.2 };
    let alone = SneeChoices { last_vertex: Some(no_last), ..learn() };
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.04 };
    let sharp = Boundary::Rough { eta: 1.4, facets };
    let (ball, mesh) = (&sphere(), &bumps(false));
    assert_eq!(left_out(ball, ROUGH, Lamp::Disc, learn()), (true, true));
    assert_eq!(left_out(ball, ROUGH, Lamp::Disc, SneeChoices::default()), (true, false), "not learned");
    assert_eq!(left_out(ball, ROUGH, Lamp::Disc, alone), (true, false), "no last vertex");
    assert_eq!(left_out(ball, ROUGH, Lamp::Disc, without(EdgeTechnique::Bsdf)), (false, false));
    assert_eq!(left_out(ball, ROUGH, Lamp::Disc, without(EdgeTechnique::Light)), (false, false));
    assert_eq!(left_out(ball, SMOOTH, Lamp::Sun, learn()), (false, false));
    let may = |shape, boundary| left_out(shape, boundary, Lamp::Disc, SneeChoices::default()).0;
    assert_eq!([ROUGH, sharp, SMOOTH].map(|boundary| may(ball, boundary)), [true; 3]);
    assert_eq!([ROUGH, sharp, SMOOTH].map(|boundary| may(mesh, boundary)), [true, false, false]);
}

/// Where the given calls may not stay, the next candidate does, with its gain over them, although nothing prefers it.
#[test]
fn what_stays_has_its_gain_over_the_given_calls() {
    let candidates = vec![[1.0; 4], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 0.5]];
    let mut notes = CallNotes::new(&Prices::FLAT, candidates, 1);
    notes.stays = 1;
    for path in 0..400 {
        // Half of the score is lost without subdivision: the given calls are better, and the last candidate is as good as the second.
        notes.begin(Some(CalledTechnique::Subdivision));
        notes.score(f64::from(path % 2));
        notes.begin(None);
        notes.score(f64::from(path / 2 % 2));
        notes.end_path((path / 4 % 2) as usize);
    }
    let chosen = notes.choice(200, 1e9, 0.0);
    assert_eq!(chosen.factors, Some([0.0, 0.0, 1.0, 1.0]));
    let cost = (1e9 + 400.0 * notes.prices.call[0]) / 1e9;
    // Second moments 0, 1, 1, 4 of four paths, and 1 of two: 3 / 2 and 1 / 2.
    assert!((chosen.gain - 3.0 * cost).abs() < 1e-9, "{chosen:?} for {cost}");
}

/// What a guess costs at every vertex is saved where neither the last vertex nor subdivision is called, and only there.
#[test]
fn guesses_are_saved_without_calls_that_need_them() {
    let candidates = [[1.0; 4], [0.0, 1.0, 1.0, 1.0], [1.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
    for (last, saves) in [(2, false), (3, false), (4, true)] {
        let mut notes = CallNotes::new(&Prices::FLAT, candidates[..last].to_vec(), 1);
        for path in 0..400 {
            notes.guess();
            notes.score(f64::from(path % 2));
            notes.end_path((path / 2 % 2) as usize);
        }
        let chosen = notes.choice(200, 1.0, 1200.0);
        assert_eq!(chosen.factors, saves.then_some([0.0, 0.0, 1.0, 1.0]));
        let Prices { guess, asking, looking_up, .. } = *notes.prices;
        let walks = 1.0 + 1200.0 * looking_up;
        let gain = if saves { 1.0 + (400.0 * guess + 1200.0 * asking) / walks } else { 1.0 };
        assert!((chosen.gain - gain).abs() < 1e-12 * gain, "{chosen:?} for {gain}");
    }
}

/// Beside photons the last vertex and subdivision may be left out together, where BSDF and light sampling draw all paths. Photons
/// may be left out where guesses are good, and then one of the two stays.
#[test]
fn what_photons_draw_needs_them() {
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.04 };
    let sharp = Boundary::Rough { eta: 1.4, facets };
    let with = SneeChoices { photons: Some(Photons { paths: 64, most: 1.0 }), ..SneeChoices::default() };
    let partial = SneeChoices {
        strategies: Some(vec![EdgeTechnique::Light, EdgeTechnique::TopToBottom]),
        least_concentration: Some(1.0),
        ..with.clone()
    };
    let none = [
        [0.0, 1.0, 1.0, 1.0],
        [0.0, 0.0, 1.0, 1.0],
        [1.0, 1.0, 1.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [1.0, 0.0, 1.0, 0.0],
    ];
    for (name, shape, boundary, choices, least, may) in [
        ("rough mesh", bumps(false), ROUGH, &with, 0.0, [true, true, true, false, false]),
        ("sharp mesh", bumps(false), sharp, &with, 0.25, [true, true, true, false, false]),
        ("smooth mesh", bumps(true), SMOOTH, &with, 0.25, [true, true, true, false, false]),
        ("smooth ball", sphere(), SMOOTH, &with, 0.0, [true, true, true, false, false]),
        (
            "without BSDF sampling",
            bumps(false),
            ROUGH,
            &partial,
            0.0,
            [false, false, true, false, false],
        ),
    ] {
        let scene = flux(&shape, boundary, &[medium(10.0, 0.98, 0.0)], &[Lamp::WideDisc]);
        let snee = set_up(&scene, choices, false).expect("served");
        let used = used_probabilities(&snee, &snee.setups[0], 0)(&snee.options).map(|most| most > 0.0);
        assert_eq!(used, [true, true, false, true], "{name}");
        let found = none.map(|factors| snee.may_be_left_out(0, used, &factors));
        assert_eq!(found, may, "{name}");
        let ladders = snee.ladders(0, used);
        let rarest = ladders[CalledTechnique::Photons as usize].last();
        assert_eq!(rarest, Some(&least), "{name}");
        let lasts = [CalledTechnique::Subdivision, CalledTechnique::LastVertex];
        // Where guesses fail, and photons and path tracing draw all paths, there is nothing to choose, however short the warm-up.
        let short = SneeChoices { learned_calls: Some(LearnedCalls { paths: 64 }), ..choices.clone() };
        let options = set_up(&scene, &short, false).expect("served").setups_in_use()[0].options.clone();
        let calls = options.strategies.subdivides() || options.last_vertex.is_some();
        assert!(least == 0.0 || !calls, "{name}: {options:?}");
        let count = if least > 0.0 { 1 } else { 7 };
        for ladder in lasts.map(|technique| ladders[technique as usize]) {
            assert_eq!((ladder.len(), ladder.last()), (count, Some(&0.0)), "{name}");
        }
    }
}

#[test]
fn two_bounces_learn_nothing() {
    let scene = flux(&sphere(), SMOOTH, &[medium(2.0, 0.9, 0.0)], &[Lamp::Disc]);
    let options = learning(64).options().expect("options");
    let mut scene = Arc::into_inner(scene).expect("not shared");
    let ray = crate::geometry::Ray { origin: DVec3::ZERO, dir: DVec3::Z };
    scene.sensor = Sensor::Vertex(crate::scene::sensor::Vertex { ray, paths: 1 });
    let refusal = TwoBounce::new(Arc::new(scene), options).expect_err("refused").to_string();
    assert!(refusal.contains("learned_calls"), "{refusal}");
}

/// Prints what walks and calls cost, for [`Prices`]: the least of five runs, and what the prices make of it.
#[test]
#[ignore = "a measurement"]
fn what_calls_cost() {
    const PATHS: u64 = 4000;
    let mesh = |interpolated| {
        Arc::new(Shape::Mesh(procedural::bumpy_sphere(1.0, 5, 0.1, 6.0, interpolated).expect("closed")))
    };
    let bodies = [
        ("sphere", sphere()),
        ("20,480 flat triangles", mesh(false)),
        ("20,480 interpolated triangles", mesh(true)),
    ];
    for (name, shape) in bodies {
        for (kind, boundary, connects) in [("rough", ROUGH, false), ("smooth", SMOOTH, true)] {
            let scene = flux(&shape, boundary, &[medium(10.0, 0.98, 0.0)], &[Lamp::Disc]);
            let photons = Some(Photons { paths: 1 << 18, most: 1.0 });
            let choices = SneeChoices { photons, ..SneeChoices::default() };
            let snee = set_up(&scene, &choices, connects).expect("served");
            const RARE: f64 = 1e-6;
            for factors in [
                [0.0, 0.0, RARE, RARE],
                [0.0, RARE, RARE, 0.0],
                [RARE, RARE, RARE, 0.0],
                [1.0, RARE, RARE, 0.0],
                [0.0, 1.0, RARE, 0.0],
                [RARE, 1.0, RARE, 0.0],
                [RARE, RARE, 1.0, 0.0],
                [0.0, 0.0, RARE, 0.25],
                [0.0, 0.0, RARE, 1.0],
                [0.0, RARE, RARE, 1.0],
            ] {
                let setup = snee.setups[0].calling(snee.options.with_calls(MORE, factors));
                let notes = CallNotes::new(Prices::of(&shape), vec![[1.0; 4]], setup.views);
                let notes = RefCell::new(notes);
                let mut scores = Scores::new(Layout::new(&scene));
                let key = StreamKey::named("what_calls_cost");
                let keys: Vec<_> = (0..PATHS).map(|pass| key.pass(pass)).collect();
                for key in &keys {
                    let path = Path { field: snee.walks.field(), band: 0, index: 0, key };
                    snee.trace(&setup, Some(&notes), path, &mut scores);
                    notes.borrow_mut().end_path(0);
                }
                let mut all = vec![scores.clone(); keys.len()];
                let mut run = || {
                    let start = std::time::Instant::now();
                    if setup.photons.is_some() {
                        for key in &keys {
                            let path = Path { field: snee.walks.field(), band: 0, index: 0, key };
                            snee.trace(&setup, None, path, &mut all[0]);
                        }
                    } else {
                        let connections = |path: &Path| Connections::of_path(&setup, path);
                        trace_passes(snee.walks.field(), 0, &keys, &mut all, connections);
                    }
                    start.elapsed().as_secs_f64() * 1e9 / PATHS as f64
                };
                let least = (0..5).map(|_| run()).fold(f64::INFINITY, f64::min);
                let notes = notes.into_inner();
                let views = f64::from(setup.views - 1) * notes.prices.view;
                let of_photons = notes.prices.boundary_event * notes.events_of_photons;
                let walks = (notes.prices.walks(&scores) - of_photons) / PATHS as f64 + views;
                let calls = notes.spent.iter().sum::<f64>() / PATHS as f64;
                let asked = notes.asked_by_walks + notes.asked.iter().sum::<f64>();
                let vertices = scores.cost[Cost::MediumEvents as usize] as f64;
                let [subdivision, last_vertex, _, photons] = factors;
                let mut densities = if subdivision > 0.0 { asked * notes.prices.density } else { 0.0 };
                if subdivision + last_vertex > 0.0 {
                    densities += notes.guesses * notes.prices.guess + vertices * notes.prices.asking;
                }
                if photons > 0.0 {
                    densities += vertices * notes.prices.looking_up;
                }
                let densities = densities / PATHS as f64;
                println!(
                    "{name}, {kind}, {factors:?}: {least:.0} ns a path, {walks:.0} + {calls:.0} + {densities:.0} by prices"
                );
            }
        }
    }
}
