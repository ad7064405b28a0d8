//! The distribution of thinning, and its cost.

use super::*;
use crate::math::DVec3;
use crate::sampling::stream::{Purpose, StreamKey};

fn stream(name: &str) -> Stream {
    StreamKey::named(name).pass(0).stream(0, Purpose::Walk)
}

/// Coefficients of a skin (Jensen et al. 2001): effective transport of red, green, blue, and their mean.
const SKIN: [f64; 3] = [0.27224, 0.73178, 1.46479];
const MEAN: f64 = 0.82293;

fn rules() -> Vec<(&'static str, ThinningRule)> {
    let falloff = |d: f64| exp(-0.5 * d) / (1.0 + d * d);
    [
        ("all", ThinningForm::All),
        ("exponential", ThinningForm::Exponential { sigma: MEAN }),
        ("mean of exponentials", ThinningForm::MeanOfExponentials { sigmas: SKIN.to_vec() }),
        ("floor", ThinningForm::Floor { sigma: MEAN, least: 1e-3 }),
        ("proportional", ThinningForm::proportional(falloff, 40.0, 0.02)),
    ]
    .map(|(name, form)| (name, ThinningRule::new(form)))
    .into()
}

/// Points of a sphere of radius `r` by the golden angle.
fn sphere(count: usize, r: f64) -> Vec<DVec3> {
    (0..count)
        .map(|k| {
            let z = 1.0 - (2 * k + 1) as f64 / count as f64;
            let (sin, cos) = crate::math::sin_cos_turns((k as f64 * 0.618_033_988_749_894_9).fract());
            let across = (1.0 - z * z).sqrt();
            r * DVec3::new(across * cos, across * sin, z)
        })
        .collect()
}

/// Distance and weight of one point, if its number accepts it.
fn decide(rule: &ThinningRule, u: f64, squared: f64) -> Option<(f64, f64)> {
    let mut candidates = Candidates::none();
    candidates.add(rule, 0, u, squared);
    let mut outcome = None;
    let mut accept = |accepted: Accepted| outcome = Some((accepted.distance, accepted.weight));
    candidates.decide(rule, &mut ThinningWork::default(), &mut accept);
    outcome
}

/// Probabilities that are evaluated together have the bits of those evaluated one by one, also where they underflow.
#[test]
fn probabilities_together_as_one_by_one() {
    for (name, rule) in rules() {
        for reach in [1.0, 30.0, 1000.0, 4000.0] {
            for count in [1, 3, 64, BATCH] {
                let distances: Vec<f64> =
                    (0..count).map(|k| reach * (k + 1) as f64 / count as f64).collect();
                let mut together = vec![0.0; count];
                rule.form.probabilities(&distances, &mut together);
                for (p, &d) in together.iter().zip(&distances) {
                    assert_eq!(p.to_bits(), rule.probability(d).to_bits(), "{name} at {d}");
                }
            }
        }
    }
}

/// The decision is u < p, wherever u is: the cheap answer never rejects what p accepts.
#[test]
fn decisions_by_enumeration() {
    for (name, rule) in rules() {
        for k in 0..4000 {
            let d = 0.02 * f64::from(k);
            let p = rule.probability(d);
            assert!(p > 0.0 && p <= 1.0, "{name} {d}: {p}");
            for u in [0.0, 1e-30, 0.3 * p, p * (1.0 - 1e-15), p, p * (1.0 + 1e-15), 0.5, 0.999_999] {
                let accepted = decide(&rule, u, d * d).is_some();
                // The distance is a rounded root: p itself is known to a few last digits.
                let clear = (u / p - 1.0).abs() > 1e-12;
                assert!(!clear || accepted == (u < p), "{name} {d} {u}: {p}");
            }
        }
    }
}

#[test]
fn probability_does_not_increase() {
    for (name, rule) in rules() {
        let mut last = 1.0;
        for k in 0..100_000 {
            let p = rule.probability(1e-3 * f64::from(k));
            assert!(p <= last, "{name} at {k}");
            last = p;
        }
    }
}

/// Effective transport of skin1, marble, ketchup and whole milk (Jensen et al. 2001), red, green, blue
/// each, 1/mm.
const BANDS: [f64; 12] = [
    0.27224, 0.73178, 1.46479, 0.11752, 0.17966, 0.25308, 0.21001, 1.73966, 2.53732, 0.09175, 0.15208,
    0.39866,
];

#[test]
fn accepted_points_weigh_one_over_their_probability() {
    let bands = BANDS.map(|sigma| ("a band", ThinningRule::new(ThinningForm::Exponential { sigma })));
    for (name, rule) in rules().into_iter().chain(bands) {
        for k in 0..2000 {
            let d = 0.05 * f64::from(k);
            let u = 0.5 * rule.probability(d);
            let (distance, weight) = decide(&rule, u, d * d).expect("half of its probability");
            let one = rule.probability(distance) * weight;
            assert!((one - 1.0).abs() <= 4.0 * f64::EPSILON, "{name} at {d}: {one}");
        }
    }
}

/// Rarely accepted points keep their weight, through the hierarchy and through the scan: N points at one
/// distance from the query, where p = 4e-7. Accepted are N times the queries times p = 40 and 8 expected,
/// each sum of weights over N times the queries is 1, within five of its standard deviations.
#[test]
fn rare_acceptances_weigh_as_much_as_they_have_to() {
    let p = 4e-7;
    let rule = ThinningRule::new(ThinningForm::Exponential { sigma: -crate::math::ln(p) });
    let tree = PointTree::new(&sphere(200_000, 1.0));
    let mut stream = stream("rare_acceptances_weigh_as_much_as_they_have_to");
    for (search, queries) in [(Search::Hierarchy, 500), (Search::Scan, 100)] {
        let (mut work, mut sum) = (ThinningWork::default(), 0.0);
        for _ in 0..queries {
            let add = |accepted: Accepted| {
                let weight = accepted.weight * rule.probability(accepted.distance);
                assert!((weight - 1.0).abs() < 1e-12, "{accepted:?}");
                sum += accepted.weight;
            };
            match search {
                Search::Hierarchy => tree.thin(DVec3::ZERO, &rule, &mut stream, &mut work, add),
                Search::Scan => {
                    scan(tree.axes(), 0..tree.len(), DVec3::ZERO, &rule, &mut stream, &mut work, add);
                }
            }
        }
        let asked = 200_000.0 * f64::from(queries);
        assert!(work.accepted > 0, "{search:?}");
        let error = 1.0 / (asked * p).sqrt();
        assert!((sum / asked - 1.0).abs() < 5.0 * error, "{search:?}: {} +- {error}", sum / asked);
    }
}

/// The probability in proportion to a function has the mean that was asked for.
#[test]
fn proportional_rule_accepts_as_many_as_asked() {
    let rule = ThinningRule::new(ThinningForm::proportional(|d| exp(-0.7 * d), 12.0, 0.05));
    let mean = crate::math::integrate(|d| rule.probability(d) * 2.0 * d / 144.0, 0.0, 12.0, 1e-9);
    assert!((mean.value - 0.05).abs() < 1e-6, "{mean:?}");
}

/// Numbers below 2^-53 exist, and about as often as they should: of 2^-20 one in a million draws is
/// lengthened.
#[test]
fn small_numbers_have_digits_of_their_own() {
    let mut stream = stream("small_numbers_have_digits_of_their_own");
    let fine = |stream: &mut Stream, u: f64| (stream.lengthen(u) - u) * (1u64 << 53) as f64;
    let mean = (0..4000).map(|_| fine(&mut stream, 0.0)).sum::<f64>() / 4000.0;
    assert!((mean - 0.5).abs() < 5.0 * (1.0f64 / 12.0 / 4000.0).sqrt(), "{mean}");
    assert!((0..1000).all(|_| (0.0..1.0).contains(&fine(&mut stream, 0.0))));
}

/// Every point is asked exactly once.
#[test]
fn the_tree_partitions_the_points() {
    let mut points = sphere(5000, 20.0);
    points.extend([points[17]; 100]); // coincident points share a code
    let tree = PointTree::new(&points);
    let mut seen = vec![0; points.len()];
    let (mut work, mut stream) = (ThinningWork::default(), stream("the_tree_partitions_the_points"));
    tree.thin(points[40], &ThinningRule::new(ThinningForm::All), &mut stream, &mut work, |accepted| {
        let point = points[tree.order()[accepted.index] as usize];
        assert_eq!(point, tree.point(accepted.index));
        assert!((accepted.distance - (point - points[40]).length()).abs() < 1e-12);
        assert_eq!(accepted.weight, 1.0);
        seen[accepted.index] += 1;
    });
    assert!(seen.iter().all(|&count| count == 1));
    assert_eq!((work.accepted, work.candidates), (5100, 5100));
    let none = PointTree::new(&[]);
    none.thin(
        DVec3::ZERO,
        &ThinningRule::new(ThinningForm::All),
        &mut stream,
        &mut work,
        |_| unreachable!(),
    );
    assert!(none.is_empty());
}

/// How often the tree or the scan accepts: per point, in pairs of neighbours, and in number.
struct AcceptanceCounts {
    single: Vec<u32>,
    pair: Vec<u32>,
    number: Vec<f64>,
}

fn count(
    name: &str,
    rule: &ThinningRule,
    queries: usize,
    by_tree: bool,
) -> (PointTree, DVec3, AcceptanceCounts) {
    let points = sphere(2000, 10.0);
    let tree = PointTree::new(&points);
    let at = DVec3::new(0.0, 6.0, 8.0);
    let mut counts = AcceptanceCounts {
        single: vec![0; points.len()],
        pair: vec![0; points.len()],
        number: Vec::new(),
    };
    let (mut stream, mut work) = (stream(name), ThinningWork::default());
    let mut is_in = vec![false; points.len()];
    for _ in 0..queries {
        is_in.fill(false);
        let accept = |accepted: Accepted| is_in[accepted.index] = true;
        if by_tree {
            tree.thin(at, rule, &mut stream, &mut work, accept);
        } else {
            scan(tree.axes(), 0..tree.len(), at, rule, &mut stream, &mut work, accept);
        }
        counts.number.push(is_in.iter().filter(|&&is_in| is_in).count() as f64);
        for i in 0..is_in.len() {
            counts.single[i] += u32::from(is_in[i]);
            counts.pair[i] += u32::from(is_in[i] && is_in[(i + 1) % is_in.len()]);
        }
    }
    (tree, at, counts)
}

/// Sum of squared z over points whose count is expected to be at least 5, and their number.
fn chi2(counts: &[u32], p: impl Fn(usize) -> f64, queries: usize) -> (f64, f64) {
    let n = queries as f64;
    let terms = counts.iter().enumerate().filter(|(i, _)| n * p(*i) >= 5.0).map(|(i, &count)| {
        let p = p(i);
        if p == 1.0 { 0.0 } else { square(f64::from(count) - n * p) / (n * p * (1.0 - p)) }
    });
    terms.fold((0.0, 0.0), |(sum, bins), z2| (sum + z2, bins + 1.0))
}

/// The law of independent Bernoulli(p_i), for hierarchy and scan: per point, in pairs of neighbours, and
/// the mean and variance of the number. Levels: 5 standard deviations each, 50 of them in all (a false
/// alarm in 35,000 runs).
#[test]
fn acceptances_are_independent_with_their_probability() {
    let queries = 20_000;
    for (name, rule) in rules().into_iter().filter(|(name, _)| *name != "all") {
        for by_tree in [true, false] {
            let key = format!("law of {name} {by_tree}");
            let (tree, at, counts) = count(&key, &rule, queries, by_tree);
            let p: Vec<f64> =
                (0..tree.len()).map(|i| rule.probability((tree.point(i) - at).length())).collect();
            let pair = |i: usize| p[i] * p[(i + 1) % p.len()];
            // The variance of a squared z is 2 + excess kurtosis 1/(n p): at most 2.2.
            for (sum, bins) in
                [chi2(&counts.single, |i| p[i], queries), chi2(&counts.pair, pair, queries)]
            {
                assert!((sum - bins).abs() < 5.0 * (2.2 * bins).sqrt(), "{key}: {sum} of {bins}");
            }
            let n = queries as f64;
            let mean = p.iter().sum::<f64>();
            let variance = p.iter().map(|p| p * (1.0 - p)).sum::<f64>();
            let found = counts.number.iter().sum::<f64>() / n;
            assert!((found - mean).abs() < 5.0 * (variance / n).sqrt(), "{key}: {found} of {mean}");
            let spread = counts.number.iter().map(|x| square(x - mean)).sum::<f64>() / n;
            // A sum of many Bernoullis is close to normal: the variance of its square is 2 variance^2.
            assert!(
                (spread / variance - 1.0).abs() < 5.0 * (2.5 / n).sqrt(),
                "{key}: {spread} of {variance}"
            );
        }
    }
}

/// A million points of a sphere of radius 20 mm: at most 4 visits an accepted point and 300 nodes more.
#[test]
fn visits_follow_acceptances() {
    let points = sphere(1_000_000, 20.0);
    let tree = PointTree::new(&points);
    for (name, sigma) in [("skin", 0.82293), ("ketchup", 1.49566)] {
        let rule = ThinningRule::new(ThinningForm::Exponential { sigma });
        let (mut work, mut stream) = (ThinningWork::default(), stream(name));
        let at = sphere(50, 20.0);
        at.iter().for_each(|&at| tree.thin(at, &rule, &mut stream, &mut work, |_| {}));
        let [nodes, candidates, accepted] =
            [work.nodes, work.candidates, work.accepted].map(|count| count as f64 / at.len() as f64);
        let a = 2.0 * 20.0 * sigma;
        let expected = 1e6 * 2.0 * (1.0 - (1.0 + a) * exp(-a)) / (a * a);
        println!(
            "{name}: {nodes} nodes, {candidates} candidates, {accepted} accepted, {expected} expected"
        );
        assert!((accepted / expected - 1.0).abs() < 0.05);
        assert!(nodes + candidates <= 4.0 * accepted + 300.0, "{name}: {work:?}");
    }
}

/// Times, for people: cargo test --release --lib thinning -- --ignored --nocapture
#[test]
#[ignore = "times, for people"]
fn cost() {
    for (radius, name, sigma) in [
        (5.0, "marble", 0.18342),
        (20.0, "marble", 0.18342),
        (5.0, "skin1", 0.82293),
        (20.0, "skin1", 0.82293),
        (5.0, "ketchup", 1.49566),
        (20.0, "ketchup", 1.49566),
    ] {
        for count in [10_000, 100_000, 1_000_000] {
            let points = sphere(count, radius);
            let start = std::time::Instant::now();
            let tree = PointTree::new(&points);
            let build = start.elapsed().as_secs_f64();
            let rule = ThinningRule::new(ThinningForm::Exponential { sigma });
            let at = sphere(20.max(2_000_000 / count), radius);
            let mut sum = 0.0;
            let mut time = |by_tree: bool| {
                let (mut work, mut stream) = (ThinningWork::default(), stream(name));
                let start = std::time::Instant::now();
                for &at in &at {
                    let accept = |accepted: Accepted| sum += accepted.weight;
                    if by_tree {
                        tree.thin(at, &rule, &mut stream, &mut work, accept);
                    } else {
                        scan(tree.axes(), 0..count, at, &rule, &mut stream, &mut work, accept);
                    }
                }
                (start.elapsed().as_secs_f64() * 1e9 / at.len() as f64, work)
            };
            let (tree_ns, work) = time(true);
            let (scan_ns, _) = time(false);
            let n = at.len() as f64;
            let visits = (work.nodes + work.candidates) as f64 / n;
            let accepted = work.accepted as f64 / n;
            println!(
                "{name:8} R {radius:2} M {count:8}: built {build:.3} s; accepted {accepted:8.0} visits {visits:8.0}; \
                 tree {tree_ns:9.0} ns = {:5.1} a visit; scan {scan_ns:9.0} ns = {:4.1} a point; ratio {:5.2}",
                tree_ns / visits,
                scan_ns / count as f64,
                scan_ns / tree_ns
            );
        }
    }
}
