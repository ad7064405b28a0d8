//! Probabilities of calls, chosen by a warm-up.
//!
//! How often a technique pays depends on the body: a connection costs as much as ten steps of a walk, and in a dense medium
//! most of them find little. A warm-up therefore traces paths on streams that no pass uses, with more calls than the options
//! ask for, and predicts from these paths variance and cost of fewer calls (efficiency-aware sample counts, after Rath et al.
//! 2022, "EARS", and Grittmann et al. 2022, "Efficiency-aware multiple importance sampling").
//!
//! Let f_t <= 1 be the factor by which calls of technique t become rarer. A score v of a warm-up path has a sum of densities D,
//! in which technique t has the part x_t D. With rarer calls the same sample would score
//!   v(f) = v / (1 + sum_t (f_t - 1) x_t),
//! and samples of technique t would be drawn in f_t of all cases. Given the path, the score is W + sum_c B_c S_c, where W is
//! what the walk scores, S_c what call c scores, and B_c is 1 with probability f of the call's technique, all of them
//! independent. So
//!   E[score^2 | path] = (W + sum_c f_c S_c)^2 + sum_c f_c (1 - f_c) S_c^2,
//! whose mean over paths is an unbiased estimate of the second moment, for every f at once. The squared mean of a pixel does not
//! depend on f; paths come in pairs of one pixel, and the mean product of a pair is an unbiased estimate of it. The cost is
//!   cost of walks + sum_t f_t cost of calls + cost of densities of subdivision, unless that is left out,
//! by counted work ([`Prices`]), so that no bit depends on a clock. Chosen are the factors with the least variance times cost
//! on a fixed ladder. A choice that only one half of the pairs prefers to the given options is noise; then these stay.
//! Emission along flights, which no call changes, is left out of the prediction.
//!
//! Results are unbiased for any factors above 0. Subdivision may also have the factor 0, where BSDF and light sampling draw all
//! its paths and the last vertex draws most of them: then what its calls have scored is dropped, x_t < 1 for all other scores,
//! and the cost of its densities is saved, too. Without the last vertex, the weights of what is left could be as large as those
//! of path tracing, whose rare large scores a warm-up does not see.

use std::cell::RefCell;

use schemars::JsonSchema;
use serde::Deserialize;

use super::{BandSetup, Snee, SneeOptions};
use crate::estimators::connection::SolverWork;
use crate::estimators::field::Path;
use crate::estimators::{Cost, Layout, Scores};
use crate::geometry::Shape;
use crate::optics::boundary::Boundary;
use crate::sampling::stream::StreamKey;
use crate::scene::Light;

/// Options of the warm-up.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearnedCalls {
    /// Number of paths of the warm-up, per band.
    #[serde(default = "paths")]
    #[schemars(range(min = 64, max = 16777216))]
    pub paths: u64,
}

fn paths() -> u64 {
    8192
}

/// What is called at a medium vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CalledTechnique {
    Subdivision,
    LastVertex,
    Connection,
}

impl CalledTechnique {
    /// How many there are.
    pub(super) const COUNT: usize = 3;
}

/// One number per technique, in the order of [`CalledTechnique`].
type PerTechnique = [f64; CalledTechnique::COUNT];

/// The warm-up calls so many times as often as the options ask for, at most always.
const MORE: f64 = 4.0;

/// Factors of the warm-up's probabilities to choose from; the last only for a technique that may be left out.
const LADDER: [f64; 7] = [1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.0];

/// What work costs, ns on the machine that it was measured on; only ratios matter. Printed by
///
/// ```text
/// cargo test --release --lib what_calls_cost -- --ignored --nocapture
/// ```
#[derive(Debug)]
struct Prices {
    /// Of a path, its first hit and its streams.
    path: f64,
    /// Of each further view.
    view: f64,
    medium_event: f64,
    boundary_event: f64,
    /// Of a call that has something to score.
    call: PerTechnique,
    /// Of asking for the density of subdivision.
    density: f64,
    /// Of a node and of a solve of the connection's search.
    node: f64,
    solve: f64,
}

impl Prices {
    const ANALYTIC: Prices = Prices {
        path: 300.0,
        view: 240.0,
        medium_event: 60.0,
        boundary_event: 250.0,
        call: [1100.0, 1400.0, 400.0],
        density: 400.0,
        node: 0.0,
        solve: 250.0,
    };
    /// On 20,480 triangles.
    const MESH: Prices = Prices {
        path: 1000.0,
        view: 1500.0,
        medium_event: 170.0,
        boundary_event: 700.0,
        call: [6500.0, 6900.0, 2000.0],
        density: 1300.0,
        node: 120.0,
        solve: 700.0,
    };

    fn of(shape: &Shape) -> &'static Prices {
        if matches!(shape, Shape::Mesh(_)) { &Prices::MESH } else { &Prices::ANALYTIC }
    }

    /// Of walks with this many views each, without calls.
    fn walks(&self, scores: &Scores, views: u32) -> f64 {
        let of = |cost: Cost, price: f64| scores.cost[cost as usize] as f64 * price;
        of(Cost::Paths, self.path + f64::from(views - 1) * self.view)
            + of(Cost::MediumEvents, self.medium_event)
            + of(Cost::BoundaryEvents, self.boundary_event)
    }
}

/// One score of a path.
#[derive(Clone, Copy, Debug)]
struct NotedScore {
    /// The call that it belongs to.
    call: Option<usize>,
    value: f64,
    /// The techniques' parts of its sum of densities.
    parts: PerTechnique,
}

/// What a warm-up writes down.
#[derive(Debug)]
pub(super) struct CallNotes {
    prices: &'static Prices,
    /// Factors of the warm-up's probabilities.
    candidates: Vec<PerTechnique>,
    /// Scores of the present path.
    scores: Vec<NotedScore>,
    /// Calls of the present path.
    calls: Vec<CalledTechnique>,
    is_called: bool,
    /// Of the next score.
    parts: PerTechnique,
    /// Sums of second moments of candidates, over the paths of each half.
    second: [Vec<f64>; 2],
    /// The same of products of pairs.
    squared_mean: [f64; 2],
    /// Cost of all calls, by technique.
    spent: PerTechnique,
    /// How often the density of subdivision was asked for: by calls of each technique, and by walks.
    asked: PerTechnique,
    asked_by_walks: f64,
}

impl CallNotes {
    fn new(prices: &'static Prices, candidates: Vec<PerTechnique>) -> CallNotes {
        let second = vec![0.0; candidates.len()];
        CallNotes {
            prices,
            candidates,
            scores: Vec::new(),
            calls: Vec::new(),
            is_called: false,
            parts: [0.0; CalledTechnique::COUNT],
            second: [second.clone(), second],
            squared_mean: [0.0; 2],
            spent: [0.0; CalledTechnique::COUNT],
            asked: [0.0; CalledTechnique::COUNT],
            asked_by_walks: 0.0,
        }
    }

    /// Scores belong to a call of this technique from here on, or to the walk.
    pub(super) fn begin(&mut self, technique: Option<CalledTechnique>) {
        self.is_called = technique.is_some();
        if let Some(technique) = technique {
            self.calls.push(technique);
            self.spent[technique as usize] += self.prices.call[technique as usize];
        }
    }

    /// A score asks for the density of subdivision.
    pub(super) fn ask(&mut self) {
        match self.calls.last().filter(|_| self.is_called) {
            Some(technique) => self.asked[*technique as usize] += 1.0,
            None => self.asked_by_walks += 1.0,
        }
    }

    /// A connection was searched for.
    pub(super) fn search(&mut self, work: &SolverWork) {
        self.spent[CalledTechnique::Connection as usize] +=
            self.prices.node * work.nodes as f64 + self.prices.solve * work.solves as f64;
    }

    /// The parts that techniques have in the next score's sum of densities.
    pub(super) fn weigh(&mut self, parts: PerTechnique) {
        self.parts = parts;
    }

    /// A score.
    pub(super) fn score(&mut self, value: f64) {
        let parts = std::mem::take(&mut self.parts);
        if value.is_finite() && value != 0.0 {
            let call = self.is_called.then(|| self.calls.len() - 1);
            self.scores.push(NotedScore { call, value, parts });
        }
    }

    /// The path has ended; it belongs to this half of all paths. Returns its score.
    fn end_path(&mut self, half: usize) -> f64 {
        let mut by_call = vec![0.0; self.calls.len()];
        for (factors, second) in self.candidates.iter().zip(&mut self.second[half]) {
            by_call.fill(0.0);
            let mut expected = 0.0;
            for NotedScore { call, value, parts } in &self.scores {
                // Without calls of a technique there is no such score.
                if call.is_some_and(|call| factors[self.calls[call] as usize] == 0.0) {
                    continue;
                }
                let rarer: f64 =
                    factors.iter().zip(parts).map(|(factor, part)| (factor - 1.0) * part).sum();
                let value = value / (1.0 + rarer);
                match call {
                    Some(call) => by_call[*call] += value,
                    None => expected += value,
                }
            }
            let mut spread = 0.0;
            for (score, technique) in by_call.iter().zip(&self.calls) {
                let factor = factors[*technique as usize];
                expected += factor * score;
                spread += factor * (1.0 - factor) * score * score;
            }
            *second += expected * expected + spread;
        }
        let whole = self.scores.iter().map(|score| score.value).sum();
        self.scores.clear();
        self.calls.clear();
        whole
    }
}

/// The choice for one setup.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChosenCalls {
    /// Factors of the warm-up's probabilities; `None` where the given options stay.
    factors: Option<PerTechnique>,
    /// Efficiency over that of the given options, as predicted.
    gain: f64,
}

/// Setups with learned calls, in the order of the given ones.
pub(super) fn learn(snee: &Snee, lesson: LearnedCalls) -> Vec<BandSetup> {
    let all = snee.setups.iter().enumerate();
    all.map(|(index, setup)| {
        if setup.guides.is_empty() {
            return setup.clone();
        }
        let chosen = choose(snee, index, lesson);
        BandSetup { chosen: Some(chosen), ..setup.calling(chosen.options(&snee.options)) }
    })
    .collect()
}

/// Chooses the calls of one setup.
fn choose(snee: &Snee, index: usize, LearnedCalls { paths }: LearnedCalls) -> ChosenCalls {
    let given = &snee.options;
    let upper = given.with_calls(MORE, [1.0; CalledTechnique::COUNT]);
    let setup = snee.setups[index].calling(upper.clone());
    let used = used_probabilities(snee, &setup, index);
    // The given options are the first candidate.
    let (asked, most) = (used(given), used(&upper));
    let of_given = |technique: usize| {
        if most[technique] > 0.0 { asked[technique] / most[technique] } else { 1.0 }
    };
    let mut candidates: Vec<PerTechnique> = vec![std::array::from_fn(of_given)];
    let mut ladders =
        most.map(|most| if most > 0.0 { &LADDER[..LADDER.len() - 1] } else { &LADDER[..1] });
    let [subdivision, last_vertex, _] = &most;
    if *subdivision > 0.0 && *last_vertex > 0.0 && snee.may_go_without_subdivision(index) {
        ladders[CalledTechnique::Subdivision as usize] = &LADDER;
    }
    for &a in ladders[0] {
        for &b in ladders[1] {
            candidates.extend(ladders[2].iter().map(|&c| [a, b, c]));
        }
    }

    let field = snee.walks.field();
    let scene = &field.scene;
    let key = StreamKey::named("what calls learn from");
    let rays = scene.sensor.rays_per_pass() as u64;
    let notes = RefCell::new(CallNotes::new(Prices::of(&scene.shape), candidates));
    let mut scores = Scores::new(Layout::new(scene));
    let pairs = paths / 2;
    for pair in 0..pairs {
        let (round, ray) = if pairs < rays {
            (0, (2 * pair + 1) * rays / (2 * pairs))
        } else {
            (pair / rays, pair % rays)
        };
        let half = (pair % 2) as usize;
        let mut product = 1.0;
        for twin in 0..2 {
            let number = (2 * round + twin) * snee.setups.len() as u64 + index as u64;
            let key = key.pass(number);
            let band = if given.share_bands { snee.hero(&key, ray as usize) } else { index };
            let path = Path { field, band, index: ray as usize, key: &key };
            snee.trace(&setup, Some(&notes), path, &mut scores);
            product *= notes.borrow_mut().end_path(half);
        }
        notes.borrow_mut().squared_mean[half] += product;
    }
    let notes = notes.into_inner();
    notes.choice(pairs, notes.prices.walks(&scores, setup.views))
}

impl CallNotes {
    /// The best candidate, after so many pairs, in which walks without calls had this cost.
    fn choice(&self, pairs: u64, walks: f64) -> ChosenCalls {
        let sum = |factors: &PerTechnique, of_all: &PerTechnique| {
            factors.iter().zip(of_all).map(|(factor, all)| factor * all).sum::<f64>()
        };
        let cost = |factors: &PerTechnique| {
            let asked = if factors[CalledTechnique::Subdivision as usize] > 0.0 {
                self.asked_by_walks + sum(factors, &self.asked)
            } else {
                0.0
            };
            walks + sum(factors, &self.spent) + self.prices.density * asked
        };
        // Second moments are per path, of which there are two in a pair.
        let inefficiency = |candidate: usize, halves: &[usize]| {
            let second: f64 = halves.iter().map(|half| self.second[*half][candidate]).sum();
            let squared_mean: f64 = halves.iter().map(|half| self.squared_mean[*half]).sum();
            let variance = (0.5 * second - squared_mean).max(LEAST_VARIANCE * 0.5 * second);
            variance * cost(&self.candidates[candidate])
        };
        let whole = |candidate: &usize| inefficiency(*candidate, &[0, 1]);
        let all = 1..self.candidates.len();
        let best = all.min_by(|a, b| whole(a).total_cmp(&whole(b)));
        let is_better =
            |half: usize, best: usize| inefficiency(best, &[half]) < inefficiency(0, &[half]);
        match best.filter(|best| pairs > 0 && (0..2).all(|half| is_better(half, *best))) {
            Some(best) => {
                ChosenCalls { factors: Some(self.candidates[best]), gain: whole(&0) / whole(&best) }
            }
            None => ChosenCalls { factors: None, gain: 1.0 },
        }
    }
}

/// The least part of a second moment that is taken for variance: the squared mean is noisy.
const LEAST_VARIANCE: f64 = 1e-3;

/// The probabilities of calls that a setup uses, 0 for a technique that takes no part.
fn used_probabilities(
    snee: &Snee,
    setup: &BandSetup,
    index: usize,
) -> impl Fn(&SneeOptions) -> PerTechnique {
    let boundary = snee.walks.scene().boundary[index];
    move |options: &SneeOptions| {
        let of_guide = |guide| options.call_for(&boundary, guide).most;
        let subdivision = setup.guides.iter().map(of_guide).fold(0.0, f64::max);
        [
            if options.strategies.subdivides() { subdivision } else { 0.0 },
            options.last_vertex.map_or(0.0, |last| last.most),
            if setup.specular.is_some() {
                options.connection.map_or(0.0, |call| call.most)
            } else {
                0.0
            },
        ]
    }
}

/// The least roughness of a mesh whose walks may go without subdivision.
const LEAST_ROUGHNESS: f64 = 0.1;

impl Snee {
    /// Whether subdivision of this setup may be left out: BSDF and light sampling draw all its paths, and the last vertex draws
    /// most of them. In a mesh it guesses the normal where light comes in. With a sharp boundary, paths by another normal would
    /// be left to rare scores of light sampling, as large as the density of facets: a warm-up does not see them.
    fn may_go_without_subdivision(&self, index: usize) -> bool {
        let strategies = &self.options.strategies;
        let scene = self.walks.scene();
        let roughness = match scene.boundary[index] {
            Boundary::Rough { ref facets, .. } => facets.alpha,
            Boundary::Smooth { .. } | Boundary::Matched => 0.0,
        };
        let mut lights = self.setups[index].guides.iter().map(|guide| &scene.lights[guide.light]);
        let is_found = roughness > 0.0 || !lights.any(Light::is_directional);
        let is_guessed = matches!(*scene.shape, Shape::Mesh(_));
        strategies.bsdf && strategies.light && is_found && !(is_guessed && roughness < LEAST_ROUGHNESS)
    }
}

impl SneeOptions {
    /// With calls `more` times as often, at most always, and then with these factors.
    fn with_calls(&self, more: f64, factors: PerTechnique) -> SneeOptions {
        let of =
            |most: f64, technique: CalledTechnique| (more * most).min(1.0) * factors[technique as usize];
        let mut options = self.clone();
        if factors[CalledTechnique::Subdivision as usize] == 0.0 {
            (options.strategies.top_to_bottom, options.strategies.bottom_to_top) = (false, false);
        }
        options.call.most = of(self.call.most, CalledTechnique::Subdivision);
        options.call_alone.most = of(self.call_alone.most, CalledTechnique::Subdivision);
        if let Some(last) = &mut options.last_vertex {
            last.most = of(last.most, CalledTechnique::LastVertex);
        }
        if let Some(call) = &mut options.connection {
            call.most = of(call.most, CalledTechnique::Connection);
        }
        options
    }
}

impl ChosenCalls {
    /// The given options with these calls.
    fn options(&self, given: &SneeOptions) -> SneeOptions {
        self.factors.map_or_else(|| given.clone(), |factors| given.with_calls(MORE, factors))
    }
}

/// What was learned, for the reader of a record: numbers band by band, one where all bands have the same.
pub(super) fn notes(given: &SneeOptions, setups: &[BandSetup]) -> Option<String> {
    let learned: Vec<(&BandSetup, ChosenCalls)> =
        setups.iter().filter_map(|setup| Some((setup, setup.chosen?))).collect();
    let list = |numbers: Vec<f64>| match &numbers[..] {
        [first, others @ ..] if others.iter().all(|other| other == first) => first.to_string(),
        all => all.iter().map(f64::to_string).collect::<Vec<_>>().join(", "),
    };
    let mut calls = Vec::new();
    let mut add = |name: &str, most: &dyn Fn(&BandSetup) -> Option<f64>| {
        let numbers: Vec<f64> = learned.iter().filter_map(|(setup, _)| most(setup)).collect();
        if !numbers.is_empty() {
            calls.push(format!("{name}.most = {}", list(numbers)));
        }
    };
    add("call", &|setup| given.strategies.subdivides().then_some(setup.options.call.most));
    add("call_alone", &|setup| given.strategies.subdivides().then_some(setup.options.call_alone.most));
    add("last_vertex", &|setup| setup.options.last_vertex.map(|last| last.most));
    add("connection", &|setup| setup.specular.as_ref().map(|technique| technique.call.most));
    let gains =
        learned.iter().map(|(_, ChosenCalls { gain, .. })| (100.0 * gain).round() / 100.0).collect();
    (!learned.is_empty()).then(|| {
        format!(
            "learned calls: {}; predicted to be {} times as efficient as the given calls",
            calls.join("; "),
            list(gains)
        )
    })
}

#[cfg(test)]
#[path = "learned_calls_tests.rs"]
mod tests;
