//! Thinning of a cloud of points by distance: tests whether each point is accepted with its probability,
//! whether two neighbours are accepted independently, and whether the number of accepted points has the
//! distribution of independent acceptances.
//!
//! The cloud is fixed, on a sphere of diameter D. One draw is one query. Views:
//!   distance   a point j is chosen, and the query is at distance d from it, uniform in [0, D], in a
//!              uniform direction; the outcome is the chart coordinate d/D where j is accepted (density
//!              p(d) per unit), else nothing. The density that the sampler reports is 1 over the weight
//!              that it gave.
//!   pair       the query is fixed; of a random pair of neighbours in the tree neither, one or both
//!              are accepted.
//!   number     the query is fixed; how many points are accepted, whose law is Poisson-binomial.

use schemars::JsonSchema;
use serde::Deserialize;

use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Coordinate, Discrete, Draw, Null, Piece, Sampler};
use crate::math::{DVec3, exp, integrate, sin_cos_turns};
use crate::sampling::stream::Stream;
use crate::sampling::thinning::{
    Accepted, PointTree, Search, ThinningForm, ThinningRule, ThinningWork, scan,
};
use crate::sampling::warp::square_to_cap;

/// `thinning` in experiment files.
pub const KIND: SamplerKind = sampler_kind!(
    "thinning",
    "points of a cloud accepted by distance, by hierarchy or by asking all",
    ThinningOptions => |o| Ok(ThinningSampler::new(o))
);

/// Options of `thinning`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThinningOptions {
    /// The probability of acceptance by distance.
    pub rule: NumericRule,
    /// How accepted points are found.
    #[serde(default)]
    pub search: Search,
    /// Which outcome of a query is tested.
    pub view: QueryView,
    /// Points of the cloud, on a sphere.
    #[schemars(range(min = 2, max = 1048576))]
    pub points: usize,
    /// Radius, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius_mm: f64,
}

/// Rules with the coefficients in numbers.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum NumericRule {
    /// e^(-this d), 1/mm.
    Exponential(#[schemars(range(min = 0.0))] f64),
    /// The mean of e^(-s d) over these, 1/mm.
    MeanOfExponentials(Vec<f64>),
    /// max(e^(-s d), least): [s in 1/mm, least].
    Floor([f64; 2]),
    /// In proportion to e^(-s d) / (1 + d^2): [s in 1/mm, mean over a disc as wide as the sphere].
    Proportional([f64; 2]),
}

/// Which outcome of a query is tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum QueryView {
    /// A single point, by its distance.
    Distance,
    /// Which of two neighbours are accepted.
    Pair,
    /// Number of points that are accepted.
    Number,
}

impl NumericRule {
    fn rule(&self, diameter: f64) -> ThinningRule {
        ThinningRule::new(match self {
            NumericRule::Exponential(sigma) => ThinningForm::Exponential { sigma: *sigma },
            NumericRule::MeanOfExponentials(sigmas) => {
                ThinningForm::MeanOfExponentials { sigmas: sigmas.clone() }
            }
            NumericRule::Floor([sigma, least]) => ThinningForm::Floor { sigma: *sigma, least: *least },
            NumericRule::Proportional([sigma, mean]) => {
                let falloff = |d: f64| exp(-sigma * d) / (1.0 + d * d);
                ThinningForm::proportional(falloff, diameter, *mean)
            }
        })
    }
}

/// Queries of one cloud by one rule.
pub struct ThinningSampler {
    tree: PointTree,
    rule: ThinningRule,
    search: Search,
    view: QueryView,
    diameter: f64,
    /// Place of a query that does not move.
    at: DVec3,
    /// Numbers of points that are outcomes of their own; what is less or more counts as the first or
    /// last.
    numbers: (usize, usize),
    masses: Vec<f64>,
}

/// Mass below which numbers of points are not distinguished.
const RARE: f64 = 1e-5;

impl ThinningSampler {
    /// Of points on a sphere.
    pub fn new(options: ThinningOptions) -> ThinningSampler {
        let ThinningOptions { rule, search, view, points: count, radius_mm: radius } = options;
        let rule = rule.rule(2.0 * radius);
        let points: Vec<DVec3> = (0..count).map(|k| radius * golden(k, count)).collect();
        let tree = PointTree::new(&points);
        let at = radius * DVec3::new(0.36, -0.48, 0.8);
        let p: Vec<f64> =
            (0..count).map(|place| rule.probability((tree.point(place) - at).length())).collect();
        let (numbers, masses) = match view {
            QueryView::Distance => ((0, 0), Vec::new()),
            QueryView::Pair => ((0, 0), pairs(&p)),
            QueryView::Number => number(&p),
        };
        ThinningSampler { tree, rule, search, view, diameter: 2.0 * radius, at, numbers, masses }
    }

    fn query(&self, at: DVec3, stream: &mut Stream, accept: impl FnMut(Accepted)) {
        let mut work = ThinningWork::default();
        match self.search {
            Search::Hierarchy => self.tree.thin(at, &self.rule, stream, &mut work, accept),
            Search::Scan => {
                scan(self.tree.axes(), 0..self.tree.len(), at, &self.rule, stream, &mut work, accept);
            }
        }
    }
}

/// Point k of n, nearly even on the unit sphere: equal steps of height, golden angles.
fn golden(k: usize, n: usize) -> DVec3 {
    let z = 1.0 - (2 * k + 1) as f64 / n as f64;
    let (sin, cos) = sin_cos_turns((k as f64 * 0.618_033_988_749_894_9).fract());
    let across = (1.0 - z * z).sqrt();
    DVec3::new(across * cos, across * sin, z)
}

/// Masses of neither, the first, the second, both, of a uniform pair of neighbours around the ring.
fn pairs(p: &[f64]) -> Vec<f64> {
    let mut masses = vec![0.0; 4];
    for (i, &a) in p.iter().enumerate() {
        let b = p[(i + 1) % p.len()];
        for (mass, share) in
            masses.iter_mut().zip([(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b])
        {
            *mass += share / p.len() as f64;
        }
    }
    masses
}

/// Poisson-binomial masses by adding one point after the other, with rare numbers put together at both
/// ends.
fn number(p: &[f64]) -> ((usize, usize), Vec<f64>) {
    let mut masses = vec![1.0];
    for &p in p {
        masses.push(0.0);
        for k in (0..masses.len()).rev() {
            let below = if k > 0 { masses[k - 1] } else { 0.0 };
            masses[k] = masses[k] * (1.0 - p) + below * p;
        }
    }
    let first = masses.iter().position(|&mass| mass > RARE).unwrap_or(0);
    let last = masses.iter().rposition(|&mass| mass > RARE).unwrap_or(0);
    let mut kept = masses[first..=last].to_vec();
    kept[0] += masses[..first].iter().sum::<f64>();
    kept[last - first] += masses[last + 1..].iter().sum::<f64>();
    ((first, last), kept)
}

impl Sampler for ThinningSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let count = self.tree.len();
        match self.view {
            QueryView::Distance => {
                let [u, x] = stream.draw2();
                let place = (u * count as f64) as usize;
                let away = square_to_cap(2.0, stream.draw2());
                let at = self.tree.point(place) + x * self.diameter * away;
                let mut outcome = Draw::Null;
                self.query(at, stream, |accepted| {
                    if accepted.index == place {
                        let at = [accepted.distance / self.diameter, 0.5];
                        outcome = Draw::Point { piece: 0, at, density: 1.0 / accepted.weight };
                    }
                });
                outcome
            }
            QueryView::Pair => {
                let first = (stream.draw() * count as f64) as usize;
                let (mut index, mut exact) = (0, true);
                self.query(self.at, stream, |accepted| {
                    index += usize::from(accepted.index == first);
                    index += 2 * usize::from(accepted.index == (first + 1) % count);
                    let distance = (self.tree.point(accepted.index) - self.at).length();
                    exact &= (accepted.weight * self.rule.probability(distance) - 1.0).abs() < 1e-12;
                });
                Draw::Delta { index, exact }
            }
            QueryView::Number => {
                let mut number = 0;
                self.query(self.at, stream, |_| number += 1);
                let (first, last) = self.numbers;
                Draw::Delta { index: number.clamp(first, last) - first, exact: true }
            }
        }
    }

    fn pieces(&self) -> Vec<Piece> {
        match self.view {
            QueryView::Distance => vec![Piece::line("distance", Coordinate::over(0.0, 1.0))],
            QueryView::Pair | QueryView::Number => Vec::new(),
        }
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        self.rule.probability(x * self.diameter)
    }

    fn deltas(&self) -> Vec<Discrete> {
        let name = |k: usize| match self.view {
            QueryView::Pair => ["neither", "the first", "the second", "both"][k].to_string(),
            _ => format!("{} points", self.numbers.0 + k),
        };
        self.masses.iter().enumerate().map(|(k, &mass)| Discrete { name: name(k), mass }).collect()
    }

    fn null(&self) -> Null {
        match self.view {
            QueryView::Distance => {
                let accepted =
                    integrate(|x| self.rule.probability(x * self.diameter), 0.0, 1.0, 1e-10).value;
                Null::Stated(1.0 - accepted)
            }
            QueryView::Pair | QueryView::Number => Null::Never,
        }
    }
}
