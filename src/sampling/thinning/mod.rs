//! Thinning: each point x_i of a cloud is accepted independently with probability p(|x - x_i|), and accepted
//! points have weight 1/p, so that the expected sum over accepted points is the sum over all points.
//!
//! p is positive and does not increase with distance. `scan` evaluates every point; `PointTree` draws
//! acceptances from the same distribution with a hierarchy, without visiting most of the points that it
//! rejects.
//!
//! p is compared with uniform numbers of resolution 2^-106 (`Stream::draw_fine`). With 24 bits, the number 0
//! alone would accept points of p < 2^-24 with probability 2^-24 and unbounded weights e^(+sigma d), a bias
//! of orders of magnitude in large bodies; with 53 bits the same happens beyond optical depth 36.7.

mod scan;
mod tree;

pub use scan::scan;
pub use tree::PointTree;

#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::stream::Stream;
use crate::math::{Lanewise, NEAR, exp, exp_near, of_each};

/// The probability of acceptance by distance (mm), with bounds for cheap decisions.
#[derive(Clone, Debug, PartialEq)]
pub struct ThinningRule {
    form: ThinningForm,
    /// Square of the distance beyond which p is at most 2^-k, for each k; a uniform number in [2^-k,
    /// 2^(1-k)) can only accept what is nearer.
    reach_squared: [f64; LEVELS],
}

/// Halvings that have a reach of their own; smaller numbers decide without.
const LEVELS: usize = 64;

/// Forms of the acceptance probability p(d).
#[derive(Clone, Debug, PartialEq)]
pub enum ThinningForm {
    /// Every point is accepted.
    All,
    /// An exponential of the distance, e^(-sigma d).
    Exponential {
        /// Rate sigma, 1/mm; not negative.
        sigma: f64,
    },
    /// The mean of e^(-sigma d) over several sigma.
    MeanOfExponentials {
        /// Rates, 1/mm; not negative.
        sigmas: Vec<f64>,
    },
    /// max(e^(-sigma d), least).
    Floor {
        /// Rate sigma, 1/mm; not negative.
        sigma: f64,
        /// Least probability, in (0, 1].
        least: f64,
    },
    /// Linear between values at distances `reach` (k/n)^2, k = 0..=n; beyond `reach` the last value.
    Table {
        /// Not increasing, in (0, 1].
        values: Vec<f64>,
        /// Reach, mm; positive.
        reach: f64,
    },
}

impl ThinningForm {
    /// min(1, c f(d)) as a table, for a function that does not increase. What is tabulated is the
    /// probability by definition: tables coarser than `f` cost variance, not bias.
    ///
    /// c makes the mean of p over the disc of radius `reach` equal to `mean` (at most 1), so that two
    /// rules can be compared at equal numbers of accepted points.
    pub fn proportional(f: impl Fn(f64) -> f64, reach: f64, mean: f64) -> ThinningForm {
        const INTERVALS: usize = 2048;
        let at = |k: usize| reach * square(k as f64 / INTERVALS as f64);
        let values: Vec<f64> = (0..=INTERVALS).map(|k| f(at(k))).collect();
        // Simpson's rule is wasted on a kink: the trapezoidal rule on the grid itself, int p 2 d dd /
        // reach^2.
        let mean_of = |c: f64| {
            let p = |k: usize| (c * values[k]).min(1.0);
            let interval = |k: usize| (square(at(k + 1)) - square(at(k))) * 0.5 * (p(k) + p(k + 1));
            (0..INTERVALS).map(interval).sum::<f64>() / (reach * reach)
        };
        // Bisection in the exponent: from c f = 1 nowhere to everywhere.
        let [mut lo, mut hi] = [values[0], values[INTERVALS]].map(|value| -crate::math::log2(value));
        for _ in 0..60 {
            let middle = 0.5 * (lo + hi);
            if mean_of(crate::math::pow(2.0, middle)) < mean {
                lo = middle;
            } else {
                hi = middle;
            }
        }
        let c = crate::math::pow(2.0, 0.5 * (lo + hi));
        ThinningForm::Table { values: values.iter().map(|value| (c * value).min(1.0)).collect(), reach }
    }

    /// Probability of acceptance at a distance, p(d).
    #[inline]
    pub fn probability(&self, d: f64) -> f64 {
        match self {
            ThinningForm::All => 1.0,
            ThinningForm::Exponential { sigma } => exp(-sigma * d),
            ThinningForm::MeanOfExponentials { sigmas } => {
                sigmas.iter().map(|sigma| exp(-sigma * d)).sum::<f64>() / sigmas.len() as f64
            }
            ThinningForm::Floor { sigma, least } => exp(-sigma * d).max(*least),
            ThinningForm::Table { values, reach } => {
                let intervals = values.len() - 1;
                let at = intervals as f64 * (d / reach).sqrt();
                let k = at as usize;
                if k >= intervals {
                    return values[intervals];
                }
                let [from, to] = [k, k + 1].map(|k| square(k as f64 / intervals as f64));
                let share = (d / reach - from) / (to - from);
                values[k] + share.clamp(0.0, 1.0) * (values[k + 1] - values[k])
            }
        }
    }

    /// [`Self::probability`] of many distances, the same bits.
    fn probabilities(&self, distances: &[f64], values: &mut [f64]) {
        match self {
            ThinningForm::Exponential { sigma } => {
                of_each(&Exponential { sigma: *sigma }, distances, values);
            }
            ThinningForm::Floor { sigma, least } => {
                of_each(&Exponential { sigma: *sigma }, distances, values);
                values.iter_mut().for_each(|value| *value = value.max(*least));
            }
            ThinningForm::MeanOfExponentials { sigmas } => {
                let mut terms = [0.0; BATCH];
                let terms = &mut terms[..distances.len()];
                values.fill(0.0);
                for sigma in sigmas {
                    of_each(&Exponential { sigma: *sigma }, distances, terms);
                    values.iter_mut().zip(&*terms).for_each(|(value, term)| *value += term);
                }
                values.iter_mut().for_each(|value| *value /= sigmas.len() as f64);
            }
            ThinningForm::All | ThinningForm::Table { .. } => {
                values.iter_mut().zip(distances).for_each(|(value, d)| *value = self.probability(*d));
            }
        }
    }
}

/// e^(-sigma d).
struct Exponential {
    sigma: f64,
}

impl Lanewise for Exponential {
    fn at(&self, d: f64) -> f64 {
        exp(-self.sigma * d)
    }

    #[inline(always)]
    fn near(&self, d: f64) -> f64 {
        exp_near(-self.sigma * d)
    }

    fn reach(&self) -> f64 {
        NEAR / self.sigma
    }
}

impl ThinningRule {
    /// With everything that depends on p alone.
    pub fn new(form: ThinningForm) -> ThinningRule {
        let reach_squared = std::array::from_fn(|k| {
            let reach = reach(&form, crate::math::pow(2.0, -(k as f64)));
            reach * reach
        });
        ThinningRule { form, reach_squared }
    }

    /// p(d), in (0, 1] except for underflow.
    #[inline]
    pub fn probability(&self, d: f64) -> f64 {
        self.form.probability(d)
    }

    /// Whether p varies by more than a factor between two distances, with `most` at the nearer.
    #[inline]
    fn varies(&self, factor: f64, [near, far]: [f64; 2], most: f64) -> bool {
        match self.form {
            ThinningForm::All => false,
            // Without another exponential: e^x > 1 + x + x^2/2 accepts too rarely by what does not
            // matter here.
            ThinningForm::Exponential { sigma } => {
                let x = sigma * (far - near);
                1.0 + x + 0.5 * x * x > factor
            }
            _ => most > factor * self.probability(far),
        }
    }

    /// Whether the number `u` could accept at this squared distance; false only where it does not.
    #[inline]
    fn may_accept(&self, u: f64, squared_distance: f64) -> bool {
        // u = 2^(e - 1023) (1 + m): at least 2^-k with k = 1023 - e.
        let k = 1023 - (u.to_bits() >> 52) as usize;
        k >= LEVELS || squared_distance < self.reach_squared[k]
    }
}

/// A distance beyond which p is at most `least`, from above; infinite where there is none.
fn reach(form: &ThinningForm, least: f64) -> f64 {
    let (mut lo, mut hi) = (0.0, 1.0);
    while form.probability(hi) > least {
        lo = hi;
        hi *= 2.0;
        if hi > 1e30 {
            return f64::INFINITY;
        }
    }
    for _ in 0..80 {
        let middle = 0.5 * (lo + hi);
        if form.probability(middle) > least {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    hi * (1.0 + 1e-9) // rounding of p and of squares
}

fn square(x: f64) -> f64 {
    x * x
}

/// How accepted points are found; both ways have the same law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Search {
    /// By a hierarchy over the points.
    #[default]
    Hierarchy,
    /// Thins by evaluating every point.
    Scan,
}

/// An accepted point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accepted {
    /// Its index, in the order of the tree.
    pub index: usize,
    /// Distance to the query, mm.
    pub distance: f64,
    /// Its weight, one over the probability of acceptance.
    pub weight: f64,
}

/// Work of a query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ThinningWork {
    /// Nodes of the hierarchy.
    pub nodes: u64,
    /// Points that a random number was spent on.
    pub candidates: u64,
    /// Number of points accepted.
    pub accepted: u64,
}

/// Candidates that are decided about together, at most.
const BATCH: usize = 128;

/// Points that wait for a decision, each with its number and squared distance: their exponentials are evaluated together.
struct Candidates {
    count: usize,
    indices: [usize; BATCH],
    numbers: [f64; BATCH],
    /// Squared at first.
    distances: [f64; BATCH],
    probabilities: [f64; BATCH],
}

impl Candidates {
    fn none() -> Candidates {
        Candidates {
            count: 0,
            indices: [0; BATCH],
            numbers: [0.0; BATCH],
            distances: [0.0; BATCH],
            probabilities: [0.0; BATCH],
        }
    }

    /// Adds a point at a squared distance, unless its number decides without an exponential that it is not accepted.
    #[inline]
    fn add(&mut self, rule: &ThinningRule, index: usize, number: f64, squared: f64) {
        if rule.may_accept(number, squared) {
            let at = self.count;
            (self.indices[at], self.numbers[at], self.distances[at]) = (index, number, squared);
            self.count += 1;
        }
    }

    /// Whether there is room for no more.
    #[inline]
    fn is_full(&self) -> bool {
        self.count == BATCH
    }

    /// Accepts points in their order, and forgets all.
    fn decide(
        &mut self,
        rule: &ThinningRule,
        work: &mut ThinningWork,
        accept: &mut impl FnMut(Accepted),
    ) {
        let count = self.count;
        let (distances, probabilities) =
            (&mut self.distances[..count], &mut self.probabilities[..count]);
        distances.iter_mut().for_each(|squared| *squared = squared.sqrt());
        rule.form.probabilities(distances, probabilities);
        for at in 0..count {
            let p = probabilities[at];
            if self.numbers[at] < p {
                accept(Accepted { index: self.indices[at], distance: distances[at], weight: 1.0 / p });
                work.accepted += 1;
            }
        }
        self.count = 0;
    }
}

impl Stream {
    /// A uniform number in [0, 1) whose digits do not end at 2^-53: small numbers have their own 53
    /// digits, down to multiples of 2^-106, so that P(u < p) = p for every p that matters.
    #[inline]
    pub fn draw_fine(&mut self) -> f64 {
        const FEW: f64 = 1.0 / (1u64 << 20) as f64;
        let u = self.draw();
        if u < FEW { self.lengthen(u) } else { u }
    }

    #[cold]
    fn lengthen(&mut self, u: f64) -> f64 {
        u + self.draw() * (1.0 / (1u64 << 53) as f64)
    }
}
