//! The catalogue as `experiments/verify/samplers.toml` lists it: what holds for every sampler
//! without statistics.

use serde_json::{Map, Value};

use super::*;
use crate::math::integrate;
use crate::sampling::stream::{Purpose, Stream, StreamKey};

/// Every sampler of the file, by name.
fn catalogue() -> Vec<(String, Box<dyn Sampler>)> {
    listed().into_iter().map(|(name, _, sampler)| (name, sampler)).collect()
}

/// With their kinds.
fn listed() -> Vec<(String, &'static str, Box<dyn Sampler>)> {
    let text = include_str!("../../experiments/verify/samplers.toml");
    let file: Value = toml::from_str(text).expect("TOML");
    let list = file["sampler"].as_array().expect("a list");
    list.iter().map(|table| build(table.as_object().expect("a table"))).collect()
}

fn build(table: &Map<String, Value>) -> (String, &'static str, Box<dyn Sampler>) {
    let name = table["name"].as_str().expect("a name").to_string();
    let (kind, options) = table.iter().find(|(key, _)| *key != "name").expect("a kind");
    let entry = KINDS.iter().find(|entry| entry.kind == kind).unwrap_or_else(|| panic!("{kind}"));
    let sampler = (entry.build)(options).unwrap_or_else(|error| panic!("{name}: {error}"));
    (name, entry.kind, sampler)
}

/// The stream of a name.
fn stream(name: &str) -> Stream {
    StreamKey::named(name).pass(0).stream(0, Purpose::Walk)
}

#[test]
fn every_kind_is_in_the_file_and_every_name_once() {
    let text = include_str!("../../experiments/verify/samplers.toml");
    for entry in KINDS {
        assert!(text.contains(&format!(" {}", entry.kind)), "{} is not in the file", entry.kind);
    }
    let mut names: Vec<String> = catalogue().into_iter().map(|(name, _)| name).collect();
    assert!(names.len() >= 60);
    names.sort();
    let count = names.len();
    names.dedup();
    assert_eq!(names.len(), count);
}

/// D5 and D10: a sample says of itself what is said of its place, lies inside its chart, is exact where
/// it is discrete, and takes as many numbers as every other, except where a query takes as many as it
/// has candidates, and where rejection or a choice decides.
#[test]
fn samples_agree_with_their_density() {
    for (name, kind, sampler) in listed() {
        let (pieces, deltas) = (sampler.pieces(), sampler.deltas());
        let mut stream = stream(&name);
        let mut draws = None;
        for _ in 0..500 {
            let before = stream.draws();
            let draw = sampler.draw(&mut stream);
            let taken = stream.draws() - before;
            let as_many = *draws.get_or_insert(taken) == taken;
            let may_differ = ["thinning", "guided_turn", "guided_step"].contains(&kind);
            assert!(as_many || may_differ, "{name}: numbers taken");
            match draw {
                Draw::Null => assert_ne!(sampler.null(), Null::Never, "{name}"),
                Draw::Delta { index, exact } => {
                    assert!(exact && deltas[index].mass > 0.0, "{name}: {}", deltas[index].name);
                }
                Draw::Point { piece, at, density } => {
                    let Piece { axes, .. } = &pieces[piece];
                    for (x, Coordinate { range: [from, to], .. }) in at.into_iter().zip(axes) {
                        assert!(*from <= x && x <= *to, "{name}: {} at {at:?}", pieces[piece].name);
                    }
                    let again = sampler.density(piece, at);
                    assert!(
                        density > 0.0 && (again / density - 1.0).abs() < 1e-9,
                        "{name}: {} at {at:?}: {density}, then {again}",
                        pieces[piece].name
                    );
                }
            }
        }
    }
}

/// The integral of a function over a piece, split at its kinks.
fn over(piece: &Piece, f: &dyn Fn([f64; 2]) -> f64, tolerance: f64) -> f64 {
    let split = |axis: &Coordinate| {
        let [from, to] = axis.range;
        let mut ends = vec![from, to];
        ends.extend(&axis.kinks);
        ends.sort_by(f64::total_cmp);
        ends
    };
    let [first, second] = [split(&piece.axes[0]), split(&piece.axes[1])];
    let along = |x: f64| -> f64 {
        if piece.dimensions == 1 {
            return f([x, 0.5]);
        }
        let part = |ends: &[f64]| integrate(|y| f([x, y]), ends[0], ends[1], 0.1 * tolerance).value;
        second.windows(2).map(part).sum()
    };
    first.windows(2).map(|ends| integrate(along, ends[0], ends[1], tolerance).value).sum()
}

/// D7: the densities over all charts, the discrete masses and the stated nulls add up to 1.
#[test]
fn masses_add_up_to_one() {
    for (name, sampler) in catalogue() {
        let pieces = sampler.pieces();
        let tolerance = 1e-7 / pieces.len().max(1) as f64;
        let piece = |(k, piece): (usize, &Piece)| over(piece, &|at| sampler.density(k, at), tolerance);
        let continuous: f64 = pieces.iter().enumerate().map(piece).sum();
        let discrete: f64 = sampler.deltas().iter().map(|delta| delta.mass).sum();
        let null = match sampler.null() {
            Null::Never => 0.0,
            Null::Stated(mass) => mass,
            Null::Remainder => continue,
        };
        let total = continuous + discrete + null;
        assert!((total - 1.0).abs() < 1e-6, "{name}: {continuous} + {discrete} + {null} = {total}");
    }
}

/// The means that are known by definition are those of the density.
#[test]
fn contrasts_have_their_means() {
    let mut known = 0;
    for (name, sampler) in catalogue() {
        let pieces = sampler.pieces();
        let tolerance = 1e-7 / pieces.len().max(1) as f64;
        for contrast in sampler.contrasts() {
            let Some(expected) = contrast.expected else { continue };
            let piece = |(k, piece): (usize, &Piece)| {
                over(piece, &|at| sampler.density(k, at) * (contrast.of)(k, at), tolerance)
            };
            let mean: f64 = pieces.iter().enumerate().map(piece).sum();
            assert!((mean - expected).abs() < 1e-6, "{name}: {}: {mean}, not {expected}", contrast.name);
            known += 1;
        }
    }
    assert!(known > 60, "{known} means are known");
}

/// A density that is off by a thousandth, a mirrored one and one of the wrong place are distinguished:
/// the tests above can fail.
#[test]
fn wrong_densities_are_seen() {
    let (_, _, right) = build(
        serde_json::json!({ "name": "hg", "henyey_greenstein": { "g": 0.5 } })
            .as_object()
            .expect("a table"),
    );
    let pieces = right.pieces();
    let mass = over(&pieces[0], &|at| 1.001 * right.density(0, at), 1e-7);
    assert!((mass - 1.0).abs() > 1e-4);
    let cosine = &right.contrasts()[0];
    let mirrored =
        over(&pieces[0], &|[x, y]| right.density(0, [1.0 - x, y]) * (cosine.of)(0, [x, y]), 1e-7);
    assert!((mirrored - 0.5).abs() > 1e-2, "{mirrored}");
}
