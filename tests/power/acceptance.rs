//! Acceptance by distance a second time, with places for defects: a point at distance d is accepted with
//! p = e^(-m d) and has weight 1/p, alone or in a cloud of two nodes.
//!
//! | view | one draw | the law |
//! |---|---|---|
//! | `distance` | a point at d uniform in [0, D], accepted or not | density p(d) per d/D |
//! | `tail` | the same far away, given that the first 24 bits of the uniform number are 0 | 2^24 p(d) |
//! | `pair` | the cloud is thinned: a random pair of neighbours | products of p and 1 - p |
//! | `number` | the cloud is thinned: how many are accepted | Poisson-binomial |
//!
//! The density that a draw reports is 1 over the weight that it gave. An event of probability 2^-24
//! is not met by any affordable number of draws: `tail` begins in it, by a word of random bits whose
//! first 24 are 0. It looks where p is below 2^-24, so that a number of 24 bits (0, then) accepts
//! everything there, each with a weight above 2^24.
//!
//! The cloud is thinned as a hierarchy does it. A node of points whose nearest is at distance d_m has
//! candidates at rate p_m = p(d_m), found by gaps floor(ln(1 - u) / ln(1 - p_m)), of which each is
//! accepted with p_i / p_m.

use scatterproof::math::{exp, ln_1p};
use scatterproof::samplers::{Coordinate, Discrete, Draw, Null, Piece, Sampler};
use scatterproof::sampling::stream::Stream;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::defects::{Defect, Family, Planted, of, row};

/// What is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum View {
    Distance,
    Tail,
    Pair,
    Number,
}

/// Options of the sampler.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AcceptanceOptions {
    /// What is looked at.
    view: View,
}

/// Effective transport coefficients of skin1 (Jensen et al. 2001), 1/mm: the mean over three bands, and
/// red.
const MEAN: f64 = 0.823;
const RED: f64 = 0.272;

/// Number of points, those of the first node first.
const POINTS: usize = 16;
const NODE: usize = POINTS / 2;

/// The first 24 bits of a number that has them all 0: it is below 2^-24.
const BITS: i32 = 24;

/// Sampler of accepted points, with planted defects.
pub struct Acceptance {
    view: View,
    defect: Defect,
    /// Distances of the points, mm, in order.
    points: [f64; POINTS],
}

impl Acceptance {
    pub fn new(options: &AcceptanceOptions, defect: Defect) -> Acceptance {
        // Two nodes along a ray from the query, 0.2 to 1.8 mm and 2 to 6 mm away.
        let even = |k: usize, from: f64, to: f64| from + (to - from) * k as f64 / (NODE - 1) as f64;
        let point = |k: usize| if k < NODE { even(k, 0.2, 1.8) } else { even(k - NODE, 2.0, 6.0) };
        Acceptance { view: options.view, defect, points: std::array::from_fn(point) }
    }

    /// Distances that are looked at, mm.
    fn range(&self) -> [f64; 2] {
        match self.view {
            // p = 2^-24 at 20.2 mm.
            View::Tail => [20.3, 40.0],
            _ => [0.0, 10.0],
        }
    }

    /// By what the density of an acceptance at a given distance exceeds p there.
    fn scale(&self) -> f64 {
        if self.view == View::Tail { 2.0f64.powi(BITS) } else { 1.0 }
    }

    /// A uniform number whose digits do not end: multiples of 2^-117.
    fn uniform(&self, stream: &mut Stream) -> f64 {
        let [mut word, more] = [stream.draw_bits(), stream.draw_bits()];
        if self.view == View::Tail {
            word >>= BITS;
        }
        match self.defect {
            Defect::CoarseUniform => (word >> 40) as f64 * 2.0f64.powi(-24),
            _ => word as f64 * 2.0f64.powi(-64) + (more >> 11) as f64 * 2.0f64.powi(-117),
        }
    }

    /// The weight of a point at distance `d`, if it is accepted.
    fn decide(&self, d: f64, stream: &mut Stream) -> Option<f64> {
        let sigma = match self.defect {
            Defect::ExponentOff => 1.01 * MEAN,
            Defect::WeightOfMean => RED,
            _ => MEAN,
        };
        let weight = exp(MEAN * d);
        let weight = if self.defect == Defect::WeightClamped { weight.min(1e3) } else { weight };
        (self.uniform(stream) < exp(-sigma * d)).then_some(weight)
    }

    /// Thins the cloud.
    fn thin(&self, stream: &mut Stream) -> [bool; POINTS] {
        let mut accepted = [false; POINTS];
        if self.defect == Defect::SharedNumber {
            let u = stream.draw();
            return self.points.map(|d| u < exp(-MEAN * d));
        }
        for first in [0, NODE] {
            let end = first + NODE;
            let nearest = match self.defect {
                Defect::BoundAtCentre => 0.5 * (self.points[first] + self.points[end - 1]),
                _ => self.points[first],
            };
            let rate = exp(-MEAN * nearest);
            let mut place = first;
            loop {
                let gap = (ln_1p(-stream.draw()) / ln_1p(-rate)).floor();
                let gap = if self.defect == Defect::GapFromOne { gap + 1.0 } else { gap };
                if gap >= (end - place) as f64 {
                    break;
                }
                place += gap as usize;
                // p_i / p_m; above 1, where the bound is none, the comparison cuts it to 1.
                accepted[place] = stream.draw() < exp(-MEAN * (self.points[place] - nearest));
                place += 1;
                if place == end {
                    break;
                }
            }
        }
        accepted
    }
}

impl Sampler for Acceptance {
    fn draw(&self, stream: &mut Stream) -> Draw {
        match self.view {
            View::Distance | View::Tail => {
                let ([from, to], x) = (self.range(), stream.draw());
                match self.decide(from + x * (to - from), stream) {
                    None => Draw::Null,
                    Some(weight) => {
                        Draw::Point { piece: 0, at: [x, 0.5], density: self.scale() / weight }
                    }
                }
            }
            View::Pair => {
                let first = (stream.draw() * POINTS as f64) as usize;
                let accepted = self.thin(stream);
                let [a, b] = [first, (first + 1) % POINTS].map(|place| usize::from(accepted[place]));
                Draw::Delta { index: a + 2 * b, exact: true }
            }
            View::Number => {
                let number = self.thin(stream).into_iter().filter(|&accepted| accepted).count();
                Draw::Delta { index: number.min(MOST), exact: true }
            }
        }
    }

    fn pieces(&self) -> Vec<Piece> {
        match self.view {
            View::Distance | View::Tail => vec![Piece::line("distance", Coordinate::over(0.0, 1.0))],
            View::Pair | View::Number => Vec::new(),
        }
    }

    fn density(&self, _: usize, [x, _]: [f64; 2]) -> f64 {
        let [from, to] = self.range();
        self.scale() * exp(-MEAN * (from + x * (to - from)))
    }

    fn deltas(&self) -> Vec<Discrete> {
        let p = self.points.map(|d| exp(-MEAN * d));
        let named = |(mass, name): (f64, String)| Discrete { name, mass };
        match self.view {
            View::Distance | View::Tail => Vec::new(),
            View::Pair => {
                let names = ["neither", "first", "second", "both"].map(String::from);
                pair_masses(&p).into_iter().zip(names).map(named).collect()
            }
            View::Number => {
                let names = (0..=MOST).map(|number| format!("{number} points"));
                number_masses(&p).into_iter().zip(names).map(named).collect()
            }
        }
    }

    fn null(&self) -> Null {
        match self.view {
            View::Distance | View::Tail => {
                let [from, to] = self.range();
                let integral = (exp(-MEAN * from) - exp(-MEAN * to)) / (MEAN * (to - from));
                Null::Stated(1.0 - self.scale() * integral)
            }
            View::Pair | View::Number => Null::Never,
        }
    }
}

/// Numbers of accepted points from here on are one outcome.
const MOST: usize = 10;

/// Neither, the first, the second, both, of a uniform pair of neighbours around the ring.
fn pair_masses(p: &[f64; POINTS]) -> [f64; 4] {
    let mut masses = [0.0; 4];
    for (k, a) in p.iter().enumerate() {
        let b = p[(k + 1) % POINTS];
        for (index, mass) in masses.iter_mut().enumerate() {
            let of = |p: f64, bit: usize| if index & bit == 0 { 1.0 - p } else { p };
            *mass += of(*a, 1) * of(b, 2) / POINTS as f64;
        }
    }
    masses
}

/// The coefficients of the product of 1 - p + p x over the points, those from x^MOST on added up.
fn number_masses(p: &[f64; POINTS]) -> [f64; MOST + 1] {
    let mut masses = [0.0; MOST + 1];
    masses[0] = 1.0;
    for p in p {
        let before = masses;
        masses = std::array::from_fn(|k| {
            let below = if k > 0 { p * before[k - 1] } else { 0.0 };
            let stay = if k == MOST { 1.0 } else { 1.0 - p };
            stay * before[k] + below
        });
    }
    masses
}

const fn acceptance(
    name: &'static str,
    defect: Defect,
    what: &'static str,
    expected: &'static [&'static str],
) -> Planted {
    of(Family::Acceptance, row(name, defect, what, expected))
}

/// Defects that this sampler plants.
pub const ROWS: &[Planted] = &[
    acceptance(
        "accept-exponent",
        Defect::ExponentOff,
        "points are accepted with e^(-1.01 m d) and have weight e^(m d)",
        &["acceptance.null", "acceptance.chi2 coarse"],
    ),
    acceptance(
        "accept-weight-clamp",
        Defect::WeightClamped,
        "weights of accepted points are clamped at 1000",
        &["acceptance.identity D5"],
    ),
    acceptance(
        "accept-weight-of-mean",
        Defect::WeightOfMean,
        "points are accepted with red's coefficient and have the weight of the mean's",
        &["acceptance.null", "acceptance.chi2 coarse"],
    ),
    acceptance(
        "accept-coarse-uniform",
        Defect::CoarseUniform,
        "the number that decides has 24 bits: it cannot be below p < 2^-24, except for 0",
        &["thinning.null"],
    ),
    acceptance(
        "accept-bound-at-centre",
        Defect::BoundAtCentre,
        "a node's bound of p is that at the centre of its box: p_i / p_m above 1 is cut to 1",
        &["thinning.delta both", "thinning.chi2 coarse"],
    ),
    acceptance(
        "accept-shared-number",
        Defect::SharedNumber,
        "one uniform number decides about all points of a query",
        &["thinning.delta both", "thinning.chi2 coarse"],
    ),
    acceptance(
        "accept-gap-from-one",
        Defect::GapFromOne,
        "gaps between candidates are counted from 1, not from 0",
        &["thinning.delta both", "thinning.chi2 coarse"],
    ),
];
