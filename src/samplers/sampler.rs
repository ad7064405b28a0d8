//! The trait of the samplers in the catalogue: their draws, and the distribution that they claim.

use std::f64::consts::TAU;

use crate::math::{atan2, sin_cos_turns};
use crate::sampling::stream::Stream;

/// One sampler with its parameters: what it draws, and the distribution that it claims to draw from.
pub trait Sampler: Send + Sync {
    /// Draws one outcome.
    fn draw(&self, stream: &mut Stream) -> Draw;

    /// The continuous pieces of the distribution.
    fn pieces(&self) -> Vec<Piece>;

    /// Density of piece `piece` per unit of its chart, from the code's own density function.
    fn density(&self, piece: usize, at: [f64; 2]) -> f64;

    /// How much the rounding of a draw changes this density, relative to it, where that may be more than
    /// 1e-9: near a singularity the nearest numbers have different densities.
    fn rounding(&self, _piece: usize, _at: [f64; 2]) -> f64 {
        0.0
    }

    /// The discrete outcomes of the distribution.
    fn deltas(&self) -> Vec<Discrete> {
        Vec::new()
    }

    /// Probability that it returns no sample.
    fn null(&self) -> Null {
        Null::Never
    }

    /// Directed contrasts: cheap means in which the likely defects show (mean cosine, ...).
    fn contrasts(&self) -> Vec<Contrast> {
        Vec::new()
    }
}

/// Outcome of one draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Draw {
    /// The sampler returned no sample.
    Null,
    /// Discrete outcome `index`; `exact` is false where its value is farther than 1e-12 from what it
    /// has to be.
    Delta {
        /// Index into [`Sampler::deltas`].
        index: usize,
        /// Whether its value is right.
        exact: bool,
    },
    /// A point of piece `piece`; `density` is the sampler's own density there, per unit of the chart.
    Point {
        /// Index into [`Sampler::pieces`].
        piece: usize,
        /// Chart coordinates; the second is 0.5 in pieces of one dimension.
        at: [f64; 2],
        /// The sampler's own density there.
        density: f64,
    },
}

/// A continuous piece and its chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Its name in tables.
    pub name: String,
    /// Coordinates of the piece.
    pub axes: [Coordinate; 2],
    /// 1 where the second coordinate is not used (its axis is then [0, 1]).
    pub dimensions: usize,
}

/// One coordinate of a chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// Lower and upper limit.
    pub range: [f64; 2],
    /// Values at which the density or its slope jumps, besides the ends.
    pub kinks: Vec<f64>,
    /// Both ends are the same point (an azimuth): bins may start anywhere.
    pub periodic: bool,
}

/// A discrete outcome.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrete {
    /// Its name in tables.
    pub name: String,
    /// Probability of the outcome.
    pub mass: f64,
}

/// Probability that a sampler returns no sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Null {
    /// Never; one null is an error.
    Never,
    /// With this probability, known by other means than the density.
    Stated(f64),
    /// With what the densities leave of 1: the normalisation is then not tested.
    Remainder,
}

/// The mean of a bounded function over all outcomes; 0 for `Null` and `Delta`.
pub struct Contrast {
    /// Its name in tables.
    pub name: &'static str,
    /// The function of piece and chart coordinates.
    pub of: Box<dyn Fn(usize, [f64; 2]) -> f64 + Send + Sync>,
    /// Its mean by definition (g for the mean cosine of a phase function); by quadrature of the density
    /// without it.
    pub expected: Option<f64>,
}

impl Contrast {
    /// A function of the chart coordinates, the same in all pieces.
    pub fn of(
        name: &'static str,
        expected: Option<f64>,
        of: impl Fn([f64; 2]) -> f64 + Send + Sync + 'static,
    ) -> Contrast {
        Contrast::by_piece(name, expected, move |_, at| of(at))
    }

    /// A function of piece and chart coordinates.
    pub fn by_piece(
        name: &'static str,
        expected: Option<f64>,
        of: impl Fn(usize, [f64; 2]) -> f64 + Send + Sync + 'static,
    ) -> Contrast {
        Contrast { name, of: Box::new(of), expected }
    }

    /// The cosine of an azimuth that is the second coordinate, in turns, and uniform.
    pub fn azimuth() -> Contrast {
        Contrast::of("cos azimuth", Some(0.0), |[_, turns]| sin_cos_turns(turns).1)
    }
}

/// The azimuth of (x, y), in turns, from 0 to 1.
pub fn turns(x: f64, y: f64) -> f64 {
    (atan2(y, x) / TAU).rem_euclid(1.0)
}

impl Coordinate {
    /// A coordinate over [from, to] without kinks.
    pub fn over(from: f64, to: f64) -> Coordinate {
        Coordinate { range: [from, to], kinks: Vec::new(), periodic: false }
    }

    /// An azimuth in turns.
    pub fn turns() -> Coordinate {
        Coordinate { range: [0.0, 1.0], kinks: Vec::new(), periodic: true }
    }
}

impl Piece {
    /// A piece of one dimension.
    pub fn line(name: impl Into<String>, axis: Coordinate) -> Piece {
        Piece { name: name.into(), axes: [axis, Coordinate::over(0.0, 1.0)], dimensions: 1 }
    }

    /// A piece of two.
    pub fn plane(name: impl Into<String>, axes: [Coordinate; 2]) -> Piece {
        Piece { name: name.into(), axes, dimensions: 2 }
    }
}
