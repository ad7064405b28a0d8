//! Directions of a single bounce towards a point, in proportion to phase function and geometry together.
//!
//! Light that arrives at a vertex along `w_in`, goes on along w to x, and from there to a given point b,
//! carries phase(w_in.w) / (|x - a|^2 |x - b|^2). Over the distance along an infinite ray the geometry
//! integrates to (pi - theta) / (R sin theta) ([`crate::sampling::towards`]), so the direction's density has
//! to be in proportion to
//!   target(w) = phase(w_in.w) (pi - theta) / sin(theta),     theta the angle between w and b,
//! and the distance equiangular (joint importance sampling: Georgiev, Krivanek, Hachisuka, Nowrouzezahrai &
//! Jarosz 2013; Kulla & Fajardo 2012; the phase function of the next vertex is left out). Beside the
//! isotropic density iso(w) = (pi - theta) / (pi^3 sin theta), which its own map realises exactly, only
//! phase(w_in.w) is left to tabulate, and it is bounded: a table of it over (theta, azimuth) for each angle
//! alpha between `w_in` and b, piecewise constant, gives
//!   pdf(w) = iso(w) P(cell) / I(cell),     I(cell) = the isotropic probability of the cell,
//! which is the density of what is drawn to the last bit, however coarse the cells.
//!
//! How close: the second moment of target / pdf under pdf (normalised; 1 would be exact), the mean over 16 angles alpha
//! spread over each third of [0, pi] and over the directions (see the test `closer_than_the_mixture`).

use std::f64::consts::PI;

use super::phase::HenyeyGreenstein;
use crate::math::{DVec3, Frame, cos, sin};
use crate::sampling::discrete::{Cumulative, choose};
use crate::sampling::towards::TowardsPoint;

/// Cells in theta, in the half turn of azimuth (the target is even about the plane of `w_in`), in alpha.
const ROWS: usize = 64;
const COLUMNS: usize = 32;
const NODES: usize = 64;

/// Gauss-Legendre, three points on [0, 1].
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_31, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// Tables of the joint density for one phase function.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTable {
    /// By alpha, in equal steps over [0, pi]; empty for an isotropic phase function, whose density is exact.
    nodes: Vec<Node>,
    /// Cosines of the ends of the steps of alpha and of azimuth, falling; the last end is left out.
    alpha_ends: Vec<f64>,
    azimuth_ends: Vec<f64>,
}

/// The table for one step of alpha.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    /// The row of theta.
    rows: Cumulative,
    /// The column of azimuth, by row.
    columns: Vec<Cumulative>,
}

/// Directions of [`JointTable`] for one pair of `w_in` and point.
#[derive(Clone, Copy, Debug)]
pub struct Joint<'a> {
    table: &'a JointTable,
    node: Option<&'a Node>,
    /// Third axis towards the point, first axis in the plane of `w_in`, on its side.
    frame: Frame,
}

impl JointTable {
    /// Builds the tables: for each step of alpha and each cell the mean of the phase function over both,
    /// by three Gauss points along each of the three angles. No mean is 0.
    pub fn new(phase: HenyeyGreenstein) -> JointTable {
        let ends = |n: usize| (1..n).map(move |k| cos(PI * k as f64 / n as f64)).collect();
        let (alpha_ends, azimuth_ends) = (ends(NODES), ends(COLUMNS));
        if phase.g == 0.0 {
            return JointTable { nodes: Vec::new(), alpha_ends, azimuth_ends };
        }
        let spots = |n: usize| -> Vec<[(f64, f64, f64); 3]> {
            let at = |k: usize, (x, weight): (f64, f64)| {
                let angle = PI * (k as f64 + x) / n as f64;
                (cos(angle), sin(angle), weight)
            };
            (0..n).map(|k| GAUSS.map(|point| at(k, point))).collect()
        };
        let (alphas, azimuths) = (spots(NODES), spots(COLUMNS));
        // theta by its isotropic distribution inside the row.
        let row_spots = |row: usize| {
            GAUSS.map(|(x, weight)| {
                let w = TowardsPoint::sample_local([inside(row, x), 0.0]);
                (w.z, w.x, weight)
            })
        };
        let thetas: Vec<[(f64, f64, f64); 3]> = (0..ROWS).map(row_spots).collect();
        let cell = |alpha: &[(f64, f64, f64); 3], row: usize, column: usize| {
            let mut sum = 0.0;
            for (cos_a, sin_a, weight_a) in alpha {
                for (cos_t, sin_t, weight_t) in &thetas[row] {
                    for (cos_p, _, weight_p) in &azimuths[column] {
                        let mu = cos_a * cos_t + sin_a * sin_t * cos_p;
                        sum += weight_a * weight_t * weight_p * phase.pdf(mu);
                    }
                }
            }
            sum
        };
        let node = |alpha: &[(f64, f64, f64); 3]| {
            let (mut rows, mut columns) = (Vec::new(), Vec::new());
            for row in 0..ROWS {
                let means: Vec<f64> = (0..COLUMNS).map(|column| cell(alpha, row, column)).collect();
                rows.push(means.iter().sum::<f64>() * share(row));
                columns.push(Cumulative::new(&means)?);
            }
            Some(Node { rows: Cumulative::new(&rows)?, columns })
        };
        // Every mean is positive for |g| < 1, so that there is a table.
        let nodes: Option<Vec<Node>> = alphas.iter().map(node).collect();
        JointTable { nodes: nodes.unwrap_or_default(), alpha_ends, azimuth_ends }
    }

    /// For light that arrives along the unit vector `w_in`, towards a point in the direction of the unit
    /// vector `to`.
    #[inline]
    pub fn towards(&self, w_in: DVec3, to: DVec3) -> Joint<'_> {
        let about = Frame::about(to);
        let (x, y) = (w_in.dot(about.s), w_in.dot(about.t));
        let length = (x * x + y * y).sqrt();
        let (c, s) = if length > 0.0 { (x / length, y / length) } else { (1.0, 0.0) };
        let frame = Frame { s: about.s * c + about.t * s, t: about.t * c - about.s * s, n: to };
        let node = step(&self.alpha_ends, w_in.dot(to));
        Joint { table: self, node: self.nodes.get(node), frame }
    }
}

/// The step of an angle by its cosine, given the cosines of the steps' ends.
#[inline]
fn step(ends: &[f64], cosine: f64) -> usize {
    ends.partition_point(|end| cosine < *end)
}

/// The isotropic distribution function 1 - (1 - theta/pi)^2 at the begin of a row.
#[inline]
fn begin(row: usize) -> f64 {
    let t = row as f64 / ROWS as f64;
    t * (2.0 - t)
}

/// The isotropic probability of a row.
#[inline]
fn share(row: usize) -> f64 {
    (2 * (ROWS - row) - 1) as f64 / (ROWS * ROWS) as f64
}

/// The isotropic map's number for the place `x` in [0, 1] of a row.
#[inline]
fn inside(row: usize, x: f64) -> f64 {
    begin(row) + x * share(row)
}

impl Joint<'_> {
    /// A direction from the vertex.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        let Some(node) = self.node else {
            return self.frame.to_world(TowardsPoint::sample_local(u));
        };
        let (row, x) = node.rows.sample(u[0]);
        let (is_left, v) = choose(u[1], 0.5);
        let (column, y) = node.columns[row].sample(v);
        let half_turns = (column as f64 + y) / COLUMNS as f64;
        let turns = if is_left { 0.5 * half_turns } else { -0.5 * half_turns };
        self.frame.to_world(TowardsPoint::sample_local([inside(row, x), turns]))
    }

    /// Density of [`Self::sample`] per solid angle.
    #[inline]
    pub fn pdf(&self, dir: DVec3) -> f64 {
        let (theta, isotropic) = TowardsPoint::pdf_about(self.frame.n, dir);
        let Some(node) = self.node else { return isotropic };
        let row = ((theta * (ROWS as f64 / PI)) as usize).min(ROWS - 1);
        let (x, y) = (dir.dot(self.frame.s), dir.dot(self.frame.t));
        let length = (x * x + y * y).sqrt();
        let column = step(&self.table.azimuth_ends, if length > 0.0 { x / length } else { 1.0 });
        isotropic * node.rows.probability(row) / share(row)
            * (node.columns[row].probability(column) * COLUMNS as f64)
    }
}

/// The mixture that needs no table: half of the samples by the phase function, half towards the point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseTowards {
    phase: HenyeyGreenstein,
    w_in: DVec3,
    frame: Frame,
}

impl PhaseTowards {
    /// For light that arrives along the unit vector `w_in`, towards a point in the direction of the unit
    /// vector `to`.
    pub fn new(phase: HenyeyGreenstein, w_in: DVec3, to: DVec3) -> PhaseTowards {
        PhaseTowards { phase, w_in, frame: Frame::about(to) }
    }

    /// A direction from the vertex.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        let (is_phase, rest) = choose(u[0], 0.5);
        if is_phase {
            self.phase.sample(self.w_in, [rest, u[1]])
        } else {
            self.frame.to_world(TowardsPoint::sample_local([rest, u[1]]))
        }
    }

    /// Density of [`Self::sample`] per solid angle.
    #[inline]
    pub fn pdf(&self, dir: DVec3) -> f64 {
        let (_, isotropic) = TowardsPoint::pdf_about(self.frame.n, dir);
        0.5 * self.phase.pdf(self.w_in.dot(dir)) + 0.5 * isotropic
    }
}

/// How directions of a single bounce are drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum JointDirections {
    /// By tables of the joint density.
    Table(JointTable),
    /// By the mixture of both factors.
    Mixture(HenyeyGreenstein),
}

/// [`JointDirections`] for one pair of `w_in` and point.
#[derive(Clone, Copy, Debug)]
pub enum JointLobe<'a> {
    /// See [`JointTable`].
    Table(Joint<'a>),
    /// See [`PhaseTowards`].
    Mixture(PhaseTowards),
}

impl JointDirections {
    /// For light that arrives along the unit vector `w_in`, towards a point in the direction of the unit
    /// vector `to`.
    #[inline]
    pub fn towards(&self, w_in: DVec3, to: DVec3) -> JointLobe<'_> {
        match self {
            JointDirections::Table(table) => JointLobe::Table(table.towards(w_in, to)),
            JointDirections::Mixture(phase) => JointLobe::Mixture(PhaseTowards::new(*phase, w_in, to)),
        }
    }
}

impl JointLobe<'_> {
    /// A direction from the vertex.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        match self {
            JointLobe::Table(joint) => joint.sample(u),
            JointLobe::Mixture(mixture) => mixture.sample(u),
        }
    }

    /// Density of [`Self::sample`] per solid angle.
    #[inline]
    pub fn pdf(&self, dir: DVec3) -> f64 {
        match self {
            JointLobe::Table(joint) => joint.pdf(dir),
            JointLobe::Mixture(mixture) => mixture.pdf(dir),
        }
    }
}
