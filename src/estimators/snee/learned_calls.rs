//! Probabilities of calls, and the number of views, chosen by a warm-up.
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
//! whose mean over paths is an unbiased estimate of the second moment, for every f at once.
//!
//! Where lights are scored by expectation at several sensor rays of a walk (`expected`), let e_i be what ray i of n sees, e_1
//! that of the walk, and X all other scores. Then the score is X + (e_1 + .. + e_v) / v with v views, and, given the pixel,
//!   E[score^2] = E[X^2] + 2 (E[X e_1] / v + (1 - 1 / v) E[X e_i]) + E[e_i^2] / v + (1 - 1 / v) E[e_i e_j],    i > 1, j != i,
//! because the rays are alike, and those from the second on are alike to the walk, too. Means over the n rays of the warm-up
//! estimate all five, for every v at once.
//!
//! The squared mean of a pixel does not depend on f and v; paths come in pairs of one pixel, and the mean product of a pair is an
//! unbiased estimate of it. The cost is
//!   cost of walks and of views + sum_t f_t cost of calls + cost of densities of subdivision, of guesses and of looking up photons,
//! the last three unless all techniques that need them are left out. It is counted work ([`Prices`]), so that no bit depends on a
//! clock. Chosen are the factors and views with the least variance times cost on fixed ladders. A choice that only one half of the
//! pairs prefers to the given options is noise; then these stay.
//! Emission along flights, which no call changes, is left out of the prediction.
//!
//! Results are unbiased for any factors above 0. A technique may also have the factor 0, where BSDF and light sampling draw all
//! its paths and others draw most of them: then what its calls have scored is dropped, x_t < 1 for all other scores,
//! and what its densities cost is saved, too. Subdivision may be left out beside the last vertex or photons, the last vertex beside
//! photons, and photons beside the last vertex ([`super::left_out`]). Without the others, the weights of what is left could be as
//! large as those of path tracing, whose rare large scores a warm-up does not see. For the same reason photons of a mesh with a sharp
//! boundary are drawn a quarter as often at the least.

use std::cell::RefCell;

use schemars::JsonSchema;
use serde::Deserialize;

use super::{BandSetup, Snee, SneeOptions};
use crate::estimators::connection::SolverWork;
use crate::estimators::field::Path;
use crate::estimators::walk::LookingRay;
use crate::estimators::{Cost, Layout, Scores};
use crate::geometry::Shape;
use crate::sampling::stream::StreamKey;

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
    Photons,
}

impl CalledTechnique {
    /// How many there are.
    pub(super) const COUNT: usize = 4;
}

/// One number per technique, in the order of [`CalledTechnique`].
pub(super) type PerTechnique = [f64; CalledTechnique::COUNT];

/// The warm-up calls so many times as often as the options ask for, at most always.
const MORE: f64 = 4.0;

/// Numbers of views to choose from, beside the given one.
const VIEWS: [u32; 6] = [1, 2, 4, 8, 16, 32];

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
    /// Of a specular guess.
    guess: f64,
    /// At a medium vertex, of asking whether the last vertex or subdivision is called.
    asking: f64,
    /// The same of photons, and of walking one by one.
    looking_up: f64,
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
        call: [1100.0, 1400.0, 400.0, 2300.0],
        density: 400.0,
        guess: 450.0,
        asking: 10.0,
        looking_up: 20.0,
        node: 0.0,
        solve: 250.0,
    };
    /// On 20,480 triangles, flat ones, which have closed solutions.
    const FLAT: Prices = Prices {
        path: 1000.0,
        view: 1500.0,
        medium_event: 170.0,
        boundary_event: 700.0,
        call: [6500.0, 6900.0, 4000.0, 3000.0],
        density: 1300.0,
        guess: 1000.0,
        asking: 50.0,
        looking_up: 120.0,
        node: 45.0,
        solve: 150.0,
    };
    /// The same with interpolated normals.
    const INTERPOLATED: Prices = Prices { solve: 3000.0, ..Prices::FLAT };

    fn of(shape: &Shape) -> &'static Prices {
        match shape {
            Shape::Mesh(mesh) if mesh.normals().is_some() => &Prices::INTERPOLATED,
            Shape::Mesh(_) => &Prices::FLAT,
            _ => &Prices::ANALYTIC,
        }
    }

    /// Of walks with one view each, without calls.
    fn walks(&self, scores: &Scores) -> f64 {
        let of = |cost: Cost, price: f64| scores.cost[cost as usize] as f64 * price;
        of(Cost::Paths, self.path)
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

/// What a path scores at its sensor rays, where there are several: e_i / n.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// By the walk's own ray.
    own: f64,
    /// By the others: the sum, and the sum of squares.
    further: f64,
    squares: f64,
}

/// Sums over paths of products of X and e_i.
#[derive(Clone, Copy, Debug, Default)]
struct Products {
    /// X X, X e_1 and X e_i.
    rest: f64,
    with_own: f64,
    with_further: f64,
}

/// Sums over half of all paths.
#[derive(Clone, Debug)]
struct HalfSums {
    /// Of each candidate.
    products: Vec<Products>,
    /// e_i e_i and e_i e_j.
    seen: [f64; 2],
    /// Products of the scores of pairs.
    squared_mean: f64,
}

impl HalfSums {
    /// Sum of second moments with the calls of a candidate and so many views.
    fn second(&self, candidate: usize, views: u32) -> f64 {
        let share = 1.0 / f64::from(views);
        let others = 1.0 - share;
        let Products { rest, with_own, with_further } = self.products[candidate];
        let [square, product] = self.seen;
        rest + 2.0 * (share * with_own + others * with_further) + (share * square + others * product)
    }
}

/// What a warm-up writes down.
#[derive(Debug)]
pub(super) struct CallNotes {
    prices: &'static Prices,
    /// Factors of the warm-up's probabilities; the first are those of the given options.
    candidates: Vec<PerTechnique>,
    /// Which candidate stays where a choice is noise; none before it is chosen.
    stays: usize,
    /// Views of the warm-up.
    views: u32,
    /// Scores of the present path.
    scores: Vec<NotedScore>,
    /// What its sensor rays see; the ray that looks, and what it has seen.
    seen: Seen,
    view: Option<LookingRay>,
    seen_now: f64,
    /// Calls of the present path.
    calls: Vec<CalledTechnique>,
    is_called: bool,
    /// Of the next score.
    parts: PerTechnique,
    halves: [HalfSums; 2],
    /// Cost of all calls, by technique.
    spent: PerTechnique,
    /// How often the density of subdivision was asked for: by calls of each technique, and by walks.
    asked: PerTechnique,
    asked_by_walks: f64,
    /// Number of specular guesses.
    guesses: f64,
    /// Boundary events of directions that photons teach, which are a part of their calls.
    events_of_photons: f64,
}

impl CallNotes {
    fn new(prices: &'static Prices, candidates: Vec<PerTechnique>, views: u32) -> CallNotes {
        let products = vec![Products::default(); candidates.len()];
        let half = HalfSums { products, seen: [0.0; 2], squared_mean: 0.0 };
        CallNotes {
            prices,
            candidates,
            stays: 0,
            views,
            scores: Vec::new(),
            seen: Seen::default(),
            view: None,
            seen_now: 0.0,
            calls: Vec::new(),
            is_called: false,
            parts: [0.0; CalledTechnique::COUNT],
            halves: [half.clone(), half],
            spent: [0.0; CalledTechnique::COUNT],
            asked: [0.0; CalledTechnique::COUNT],
            asked_by_walks: 0.0,
            guesses: 0.0,
            events_of_photons: 0.0,
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

    /// Scores are what this sensor ray sees from here on, or belong to the walk.
    pub(super) fn view(&mut self, ray: Option<LookingRay>) {
        let now = std::mem::take(&mut self.seen_now);
        let Seen { own, further, squares } = &mut self.seen;
        match std::mem::replace(&mut self.view, ray) {
            Some(LookingRay::Own) => *own += now,
            Some(LookingRay::Further) => (*further, *squares) = (*further + now, *squares + now * now),
            None => {}
        }
    }

    /// A score asks for the density of subdivision.
    pub(super) fn ask(&mut self) {
        match self.calls.last().filter(|_| self.is_called) {
            Some(technique) => self.asked[*technique as usize] += 1.0,
            None => self.asked_by_walks += 1.0,
        }
    }

    /// A specular guess was made.
    pub(super) fn guess(&mut self) {
        self.guesses += 1.0;
    }

    /// A direction that photons teach has met the boundary so often.
    pub(super) fn meet(&mut self, events: u64) {
        self.events_of_photons += events as f64;
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
        if self.view.is_some() {
            self.seen_now += if value.is_finite() { value } else { 0.0 };
        } else if value.is_finite() && value != 0.0 {
            let call = self.is_called.then(|| self.calls.len() - 1);
            self.scores.push(NotedScore { call, value, parts });
        }
    }

    /// The path has ended; it belongs to this half of all paths. Returns its score.
    fn end_path(&mut self, half: usize) -> f64 {
        let mut by_call = vec![0.0; self.calls.len()];
        // e_1, and the mean of the others.
        let Seen { own: own_part, further: further_part, squares } = std::mem::take(&mut self.seen);
        let views = f64::from(self.views);
        let others = (views - 1.0).max(1.0);
        let (own, further) = (views * own_part, views / others * further_part);
        let all_squares = own_part * own_part + squares;
        let all = own_part + further_part;
        let HalfSums { products, seen: [square, product], .. } = &mut self.halves[half];
        *square += views * all_squares;
        *product += views / others * (all * all - all_squares);
        for (factors, products) in self.candidates.iter().zip(products) {
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
            products.rest += expected * expected + spread;
            products.with_own += expected * own;
            products.with_further += expected * further;
        }
        let rest: f64 = self.scores.iter().map(|score| score.value).sum();
        self.scores.clear();
        self.calls.clear();
        rest + all
    }
}

/// The choice for one setup.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChosenCalls {
    /// Factors of the warm-up's probabilities; `None` where the given options stay.
    factors: Option<PerTechnique>,
    /// Number of views, where there was more than one to choose from.
    views: Option<u32>,
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
    let is_used = most.map(|most| most > 0.0);
    let ladders = snee.ladders(index, is_used);
    let leaves_out_guesses = snee.leaves_out_guesses(index, is_used);
    let mut candidates: Vec<PerTechnique> = vec![std::array::from_fn(of_given)];
    if leaves_out_guesses {
        let [_, _, connection, photons] = candidates[0];
        candidates.push([0.0, 0.0, connection, photons]);
    }
    for &a in ladders[0] {
        for &b in ladders[1] {
            for &c in ladders[2] {
                candidates.extend(ladders[3].iter().map(|&d| [a, b, c, d]));
            }
        }
    }
    candidates.retain(|factors| snee.may_be_left_out(index, is_used, factors));

    let field = snee.walks.field();
    let scene = &field.scene;
    let key = StreamKey::named("what calls learn from");
    let rays = scene.sensor.rays_per_pass() as u64;
    let mut notes = CallNotes::new(Prices::of(&scene.shape), candidates, setup.views);
    notes.stays = usize::from(leaves_out_guesses);
    let notes = RefCell::new(notes);
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
        notes.borrow_mut().halves[half].squared_mean += product;
    }
    let notes = notes.into_inner();
    let vertices = scores.cost[Cost::MediumEvents as usize] as f64;
    let walks = notes.prices.walks(&scores) - notes.prices.boundary_event * notes.events_of_photons;
    notes.choice(pairs, walks, vertices)
}

impl CallNotes {
    /// The best candidate and number of views, after so many pairs, in which walks without calls and with one view each had this
    /// cost and so many medium vertices.
    fn choice(&self, pairs: u64, walks: f64, vertices: f64) -> ChosenCalls {
        let sum = |factors: &PerTechnique, of_all: &PerTechnique| {
            factors.iter().zip(of_all).map(|(factor, all)| factor * all).sum::<f64>()
        };
        let cost = |factors: &PerTechnique, views: u32| {
            let looking = 2.0 * pairs as f64 * f64::from(views - 1) * self.prices.view;
            let asked = if factors[CalledTechnique::Subdivision as usize] > 0.0 {
                self.asked_by_walks + sum(factors, &self.asked)
            } else {
                0.0
            };
            let [subdivision, last_vertex, ..] = factors;
            let guesses = if *subdivision > 0.0 || *last_vertex > 0.0 {
                self.prices.guess * self.guesses + self.prices.asking * vertices
            } else {
                0.0
            };
            let looking_up = if factors[CalledTechnique::Photons as usize] > 0.0 {
                self.prices.looking_up
            } else {
                0.0
            };
            let calls = sum(factors, &self.spent) + self.prices.density * asked + guesses;
            walks + looking + looking_up * vertices + calls
        };
        // Second moments are per path, of which there are two in a pair.
        let inefficiency = |(candidate, views): (usize, u32), halves: &[HalfSums]| {
            let second: f64 = halves.iter().map(|half| half.second(candidate, views)).sum();
            let squared_mean: f64 = halves.iter().map(|half| half.squared_mean).sum();
            let variance = (0.5 * second - squared_mean).max(LEAST_VARIANCE * 0.5 * second);
            variance * cost(&self.candidates[candidate], views)
        };
        let whole = |choice| inefficiency(choice, &self.halves);
        let (given, stays) = ((0, self.views), (self.stays, self.views));
        // A warm-up with one view does not tell what further ones would see.
        let ladder = if self.views > 1 { &VIEWS[..] } else { &[] };
        let views = || std::iter::once(self.views).chain(ladder.iter().copied());
        let all = (self.stays..self.candidates.len())
            .flat_map(|candidate| views().map(move |n| (candidate, n)));
        let best = all.min_by(|a, b| whole(*a).total_cmp(&whole(*b)));
        let is_better = |half: &HalfSums, best| {
            let half = std::slice::from_ref(half);
            inefficiency(best, half) < inefficiency(stays, half)
        };
        let best =
            best.filter(|best| pairs > 0 && self.halves.iter().all(|half| is_better(half, *best)));
        let chosen @ (candidate, views) = best.unwrap_or(stays);
        if chosen == given {
            return ChosenCalls { factors: None, views: None, gain: 1.0 };
        }
        let gain = whole(given) / whole(chosen);
        let views = (self.views > 1).then_some(views);
        ChosenCalls { factors: Some(self.candidates[candidate]), views, gain }
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
            if setup.photons.is_some() {
                options.photons.map_or(0.0, |photons| photons.most)
            } else {
                0.0
            },
        ]
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
        options.last_vertex = options.last_vertex.filter(|last| last.most > 0.0);
        if let Some(photons) = &mut options.photons {
            photons.most = of(photons.most, CalledTechnique::Photons);
        }
        if let Some(call) = &mut options.connection {
            call.most = of(call.most, CalledTechnique::Connection);
        }
        options
    }
}

impl ChosenCalls {
    /// The given options with these calls and views.
    fn options(&self, given: &SneeOptions) -> SneeOptions {
        match self.factors {
            Some(factors) => {
                let views = self.views.unwrap_or(given.views);
                SneeOptions { views, ..given.with_calls(MORE, factors) }
            }
            None => given.clone(),
        }
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
    let mut add = |name: &str, number: &dyn Fn(&BandSetup) -> Option<f64>| {
        let numbers: Vec<f64> = learned.iter().filter_map(|(setup, _)| number(setup)).collect();
        if !numbers.is_empty() {
            calls.push(format!("{name} = {}", list(numbers)));
        }
    };
    let subdivides = given.strategies.subdivides();
    add("call.most", &|setup| subdivides.then_some(setup.options.call.most));
    add("call_alone.most", &|setup| subdivides.then_some(setup.options.call_alone.most));
    let has_last_vertex = given.last_vertex.is_some();
    add("last_vertex.most", &|setup| {
        has_last_vertex.then(|| setup.options.last_vertex.map_or(0.0, |last| last.most))
    });
    add("connection.most", &|setup| setup.specular.as_ref().map(|technique| technique.call.most));
    add("photons.most", &|setup| setup.options.photons.map(|photons| photons.most));
    add("views", &|setup| setup.chosen?.views.map(f64::from));
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
