//! `judge` on artificial images: error rates without a defect, and defects that are found.

use std::collections::BTreeMap;

use super::images::planes;
use super::*;
use crate::results::exr_file::ExrImage;
use crate::results::npy::Array;
use crate::results::record::{Image, StatedBias, Tile};
use crate::results::sample;
use crate::results::store::{Arrays, costs_path, observables_path, pixels_path, spread_path};
use crate::stats::moments::{ImageMoments, Moments};
use crate::stats::tree::{Counter, Merge, batch_level};

const SIDE: usize = 16;
const PASSES: u64 = 256;

/// What a pixel's mean is: brighter to the right and to the bottom.
fn truth(pixel: usize) -> f64 {
    0.5 + (pixel % SIDE) as f64 / 16.0 + (pixel / SIDE) as f64 / 32.0
}

/// An exponential of mean 1, hashed from `i`: skewed, as radiance is.
fn exponential(i: u64) -> f64 {
    let u = 0.5 + sample::uniform(i) / 12f64.sqrt();
    -(1.0 - u).max(1e-300).ln()
}

/// A seed that a name gives.
fn base(name: &str) -> u64 {
    let hash = crate::results::json::hash_bytes(name.as_bytes());
    u64::from_le_bytes([hash[0], hash[1], hash[2], hash[3], hash[4], hash[5], hash[6], hash[7]])
}

/// A tile of 4 x 4.
fn tile(row: usize, column: usize) -> ObservedRegion {
    let ends = |tile: usize| [tile * SIDE / 4, (tile + 1) * SIDE / 4];
    let tile = Some(Tile { columns: ends(column), rows: ends(row) });
    ObservedRegion { name: format!("tile_{row}_{column}"), tile }
}

/// A record of exponential scores; with `noise` 0 of the truth itself.
fn stored(seed: u64, noise: f64) -> Stored {
    let observed: Vec<ObservedRegion> =
        std::iter::once(ObservedRegion { name: "mean".into(), tile: None })
            .chain((0..16).map(|k| tile(k / 4, k % 4)))
            .collect();
    let names: Vec<String> = observed.iter().map(|region| region.name.clone()).collect();
    let regions: Vec<Vec<usize>> = observed.iter().map(|region| region.pixels(SIDE, SIDE)).collect();
    let mut moments = Counter::new(0, batch_level(PASSES));
    let mut pixels: Option<ImageMoments> = None;
    for pass in 0..PASSES {
        let score = |i: usize| {
            let x = exponential(seed.wrapping_add((pass * 256 + i as u64) * 0x1_0001));
            truth(i) * (1.0 + noise * (x - 1.0))
        };
        let image: Vec<f64> = (0..SIDE * SIDE).map(score).collect();
        moments.push(regions.iter().map(|r| Moments::of(mean_of(&image, r))).collect::<Vec<_>>());
        let own = ImageMoments::of(image);
        pixels = Some(match pixels {
            None => own,
            Some(before) => before.merge(own),
        });
    }
    let pixels = pixels.expect("passes");
    let both = pixels.mean.iter().copied().chain(pixels.std_error()).collect();
    let batches = moments.batches();
    let data = batches.iter().flatten().flat_map(Moments::to_array).collect();
    let mut arrays = Arrays::new();
    arrays.insert(observables_path(0, 0), Array::new(vec![batches.len(), names.len(), 1, 5], data));
    arrays.insert(pixels_path(0, 0), Array::new(vec![2, SIDE, SIDE, 1], both));
    arrays.insert(spread_path(0, 0), Array::new(vec![0, 1, 5], vec![]));
    arrays.insert(costs_path(0, 0), Array::new(vec![batches.len(), 0], vec![]));
    let mut stored = sample::stored(0.1);
    stored.record.bands.truncate(1);
    stored.record.cells[0].regions = observed;
    stored.record.cells[0].runs = vec![EstimatorRun {
        estimator: "mis".into(),
        control_of: None,
        kind: "path".into(),
        bias: StatedBias::Unbiased,
        model: None,
        heavy_tails: vec![],
        notes: vec![],
        passes: PASSES,
        observables: names.into_iter().map(|name| Observable { name, class: "all".into() }).collect(),
        moments: observables_path(0, 0),
        costs: costs_path(0, 0),
        guide: None,
        image: Some(Image {
            width: SIDE,
            height: SIDE,
            pixels: pixels_path(0, 0),
            spread: spread_path(0, 0),
        }),
        cost: BTreeMap::new(),
        anomalies: BTreeMap::new(),
    }];
    stored.arrays = arrays;
    stored
}

/// An image of 32 exponentials a pixel, times what a defect does to it.
fn image(seed: u64, noise: f64, defect: impl Fn(usize) -> f64) -> ExrImage {
    let value = |i: usize| {
        let scores = (0..32).map(|k| exponential(seed.wrapping_add((k * 256 + i as u64) * 0x1_0003)));
        let mean = scores.sum::<f64>() / 32.0;
        (truth(i) * defect(i) * (1.0 + noise * (mean - 1.0))) as f32
    };
    let plane = (0..SIDE * SIDE).map(value).collect();
    ExrImage {
        width: SIDE,
        height: SIDE,
        channels: BTreeMap::from([("Y".to_string(), plane)]),
        has_half: false,
    }
}

fn images(seed: u64, count: u64, noise: f64, defect: impl Fn(usize) -> f64) -> Vec<(String, ExrImage)> {
    let one = |k: u64| (format!("{k}.exr"), image(seed.wrapping_add((k + 1) << 40), noise, &defect));
    (0..count).map(one).collect()
}

fn answer(stored: &Stored, images: &[(String, ExrImage)], independent_pixels: bool) -> Answer {
    let planes = planes(images, &stored.record.bands, (SIDE, SIDE), &[], 1.0).expect("planes");
    let question = Question {
        stored,
        cell: 0,
        estimator: "mis",
        class: "all",
        level: LEVEL,
        detect: 0.1,
        independent_pixels,
    };
    judge(&question, &planes).expect("an answer")
}

fn of<'a>(answer: &'a Answer, observable: &str) -> &'a Verdict {
    answer.verdicts.iter().find(|v| v.observable == observable).expect("a verdict")
}

// Without a defect the p-values of 200 calls fall below p at most as often as 200 p, and 4.5 standard
// deviations of the binomial (one-sided 3e-6): the tests may be conservative, and with few seeds are.
#[test]
fn false_alarms_stay_below_their_level() {
    const CALLS: u64 = 200;
    let start = base("false_alarms_stay_below_their_level");
    for (seeds, independent) in [(2, false), (2, true), (6, false), (6, true)] {
        let mut p_values: BTreeMap<&str, Vec<Option<f64>>> = BTreeMap::new();
        for call in 0..CALLS {
            let seed = start.wrapping_add((call * 100 + seeds * 10 + u64::from(independent)) << 45);
            let answer = answer(&stored(seed, 1.0), &images(!seed, seeds, 1.0, |_| 1.0), independent);
            for observable in ["mean", "tile_0_0", "tile_2_3", "pixels"] {
                p_values.entry(observable).or_default().push(of(&answer, observable).p_value);
            }
        }
        for (observable, p_values) in p_values {
            for level in [0.2, 0.05, 0.01] {
                let found = p_values.iter().filter(|p| p.is_none_or(|p| p < level)).count() as f64;
                let n = CALLS as f64;
                let most = n * level + 4.5 * (n * level * (1.0 - level)).sqrt();
                assert!(
                    found <= most,
                    "{observable}, {seeds} seeds, {independent}: {found} below {level}"
                );
            }
            let half = p_values.iter().filter(|p| p.is_some_and(|p| p < 0.5)).count();
            let least = if observable == "pixels" { 0 } else { 20 };
            assert!(half > least, "{observable}, {seeds} seeds: the test sees nothing, {half}");
        }
    }
}

#[test]
fn a_bias_is_found_and_its_size_is_what_was_promised() {
    let seed = base("a_bias_is_found");
    let stored = stored(seed, 1.0);
    let clean = answer(&stored, &images(!seed, 8, 1.0, |_| 1.0), true);
    assert_eq!(crate::verify::verdict::exit_code(&clean.verdicts), 0, "{:?}", of(&clean, "mean"));
    let promised = of(&clean, "mean").detectable.expect("a size");
    assert!((0.005..0.1).contains(&promised), "{promised}");
    let biased = |by: f64, pixels: bool| {
        let images = images(!seed, 8, 1.0, |_| 1.0 + by);
        of(&answer(&stored, &images, pixels), "mean").outcome.clone()
    };
    assert_eq!(biased(1.3 * promised, true), Outcome::Fail);
    assert_eq!(biased(-1.3 * promised, true), Outcome::Fail);
    assert_eq!(biased(0.2 * promised, true), Outcome::Pass);
    assert_eq!(biased(0.3, false), Outcome::Fail, "eight seeds as blocks");
    let few = answer(&stored, &images(!seed, 2, 1.0, |_| 1.0), false);
    assert_eq!(of(&few, "mean").outcome, Outcome::Underpowered);

    // One tile, and a pattern whose mean is 1 in every tile.
    let tile = tile(3, 0).pixels(SIDE, SIDE);
    let in_tile =
        answer(&stored, &images(!seed, 8, 1.0, |i| if tile.contains(&i) { 1.4 } else { 1.0 }), true);
    assert_eq!(of(&in_tile, "tile_3_0").outcome, Outcome::Fail);
    assert_eq!(of(&in_tile, "tile_0_0").outcome, Outcome::Pass);
    let board = |i: usize| if (i / SIDE + i % SIDE).is_multiple_of(2) { 1.3 } else { 0.7 };
    let pattern = answer(&stored, &images(!seed, 2, 1.0, board), true);
    assert_eq!(of(&pattern, "pixels").outcome, Outcome::Fail, "{:?}", of(&pattern, "pixels"));
    assert_eq!(of(&pattern, "mean").outcome, Outcome::Pass);
}

#[test]
fn pictures_and_hints() {
    let seed = base("pictures_and_hints");
    let stored = stored(seed, 1.0);
    let mirrored = |i: usize| truth(i - i % SIDE + SIDE - 1 - i % SIDE) / truth(i);
    let answer = answer(&stored, &images(!seed, 8, 1.0, mirrored), true);
    assert!(answer.notes.iter().any(|n| n.contains("mirrored left to right")), "{:?}", answer.notes);
    let map = &answer.maps[0];
    let left: f64 = map.z.iter().step_by(SIDE).sum();
    let right: f64 = map.z.iter().skip(SIDE - 1).step_by(SIDE).sum();
    assert!(left > 10.0 && right < -10.0, "{left} {right}");
    assert!(map.relative.iter().step_by(SIDE).all(|r| *r > 0.0));
}

#[test]
fn without_noise_only_rounding_is_forgiven() {
    let stored = stored(1, 0.0);
    // Not the same bits: a renderer's rounding differs from seed to seed.
    let near = |seed: u64, factor: f64| images(seed, 2, 1e-7, move |_| factor);
    for (factor, outcome) in [(1.0, Outcome::Pass), (1.000_005, Outcome::Pass), (1.001, Outcome::Fail)] {
        let answer = answer(&stored, &near(base("rounding"), factor), true);
        for observable in ["mean", "tile_1_1", "pixels"] {
            assert_eq!(of(&answer, observable).outcome, outcome, "{observable} {factor}");
        }
    }
}

#[test]
fn what_cannot_be_judged() {
    let seed = base("what_cannot_be_judged");
    let good = stored(seed, 1.0);
    let invalid = |stored: &Stored, images: &[(String, ExrImage)], words: &str| {
        let answer = answer(stored, images, true);
        let mean = of(&answer, "mean");
        assert!(matches!(&mean.outcome, Outcome::Invalid(why) if why.said.contains(words)), "{mean:?}");
    };
    let mut bad = images(!seed, 3, 1.0, |_| 1.0);
    bad[1].1.channels.get_mut("Y").expect("a plane")[SIDE + 2] = f32::INFINITY;
    invalid(&good, &bad, "image 2 holds 1 values that are not finite, the first at row 1, column 2");
    let firefly = images(!seed, 3, 1.0, |_| 1.0);
    let mut firefly = firefly;
    firefly[0].1.channels.get_mut("Y").expect("a plane")[40] = 1000.0;
    invalid(&good, &firefly, "heavy tail: one pixel holds");
    // A common factor in each seed: the pixels are anything but independent.
    let mut common = images(!seed, 3, 1.0, |_| 1.0);
    for (k, (_, image)) in common.iter_mut().enumerate() {
        image.channels.values_mut().flatten().for_each(|x| *x *= 0.7 + 0.3 * k as f32);
    }
    invalid(&good, &common, "judge without --independent-pixels");
    let clean = images(!seed, 3, 1.0, |_| 1.0);
    let mut lost = good.clone();
    lost.record.cells[0].runs[0].anomalies.insert("lost_ray".into(), 1);
    invalid(&lost, &clean, "lost_ray");
    let mut moved = good.clone();
    let pixels = moved.arrays.get_mut(&pixels_path(0, 0)).expect("pixels");
    pixels.data[3] += 1.0;
    invalid(&moved, &clean, "do not add up");
}
