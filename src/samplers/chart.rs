//! Charts of common domains (directions, distances along a line, points in a plane), and the sampler that
//! combines such a chart with a technique.
//!
//! A technique defines its draw and its density in the measure of the domain (per solid angle, length or
//! area); the chart defines the piece, its coordinates and its Jacobian. [`Charted`] combines both.

use std::f64::consts::{PI, TAU};

use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler, turns};
use crate::math::{DVec3, Frame, atan2, cos, sin, sin_cos_turns};
use crate::sampling::stream::Stream;

/// One way of drawing a point of a chart's domain, and its density.
pub trait Technique<C: Chart>: Send + Sync {
    /// Draws a point, with the density that the code under test claims for it. Without that density the
    /// sample has the one of its chart coordinates.
    fn sample(&self, stream: &mut Stream) -> (C::Point, Option<f64>);

    /// Density at a point, in the domain's measure.
    fn pdf(&self, point: C::Point) -> f64;

    /// Directed contrasts in the chart.
    fn contrasts(&self, chart: &C) -> Vec<Contrast>;
}

/// Coordinates of a domain of one piece.
pub trait Chart: Send + Sync {
    /// A point of the domain.
    type Point: Copy;

    /// The piece that the chart covers.
    fn piece(&self) -> Piece;

    /// The coordinates of a point, with the domain's measure per unit of them.
    fn place(&self, point: Self::Point) -> ([f64; 2], Measure);

    /// The point at coordinates, with the measure there; none at infinity.
    fn point(&self, at: [f64; 2]) -> Option<(Self::Point, Measure)>;
}

/// A measure per unit of a chart, as factors that multiply a density from left to right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measure(pub [f64; 3]);

impl Measure {
    /// A measure with one factor; the other two are 1.
    pub fn of(factor: f64) -> Measure {
        Measure([factor, 1.0, 1.0])
    }

    /// The density per unit of the chart of a density in the domain's measure.
    fn per_unit(self, pdf: f64) -> f64 {
        let Measure([a, b, c]) = self;
        pdf * a * b * c
    }
}

/// A technique in a chart.
pub struct Charted<T, C> {
    technique: T,
    chart: C,
}

impl<T: Technique<C>, C: Chart> Charted<T, C> {
    /// A technique tested in this chart.
    pub fn new(technique: T, chart: C) -> Charted<T, C> {
        Charted { technique, chart }
    }
}

impl<T: Technique<C>, C: Chart> Sampler for Charted<T, C> {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let (point, pdf) = self.technique.sample(stream);
        let (at, measure) = self.chart.place(point);
        let density = pdf.map_or_else(|| self.density(0, at), |pdf| measure.per_unit(pdf));
        Draw::Point { piece: 0, at, density }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![self.chart.piece()]
    }

    fn density(&self, _piece: usize, at: [f64; 2]) -> f64 {
        self.chart.point(at).map_or(0.0, |(point, measure)| measure.per_unit(self.technique.pdf(point)))
    }

    fn contrasts(&self) -> Vec<Contrast> {
        self.technique.contrasts(&self.chart)
    }
}

/// An axis of directions that is aligned with nothing.
pub const AXIS: DVec3 = DVec3::new(0.48, -0.6, 0.64);

/// Directions by their polar angle about an axis, graded to a coordinate over [0, 1], and their azimuth
/// in turns.
#[derive(Clone, Debug)]
pub struct Directions<G = EvenAngle> {
    /// The axis is its normal.
    pub frame: Frame,
    /// The coordinate of the polar angle.
    pub grade: G,
    /// Values of both coordinates at which the density or its slope jumps.
    pub kinks: [Vec<f64>; 2],
}

impl Directions {
    /// About [`AXIS`], by theta = pi x.
    pub fn even() -> Directions {
        Directions::graded(EvenAngle)
    }
}

impl<G> Directions<G> {
    /// About [`AXIS`], by a grade.
    pub fn graded(grade: G) -> Directions<G> {
        Directions { frame: Frame::about(AXIS), grade, kinks: [Vec::new(), Vec::new()] }
    }
}

/// How a polar angle becomes a coordinate over [0, 1] in which a density is smooth and nowhere narrow.
pub trait Grade: Send + Sync {
    /// The coordinate of a direction about a frame's normal, with the solid angle per unit of it and
    /// turn.
    fn coordinate(&self, frame: &Frame, dir: DVec3) -> (f64, Measure);

    /// The direction at a coordinate and the (sine, cosine) of an azimuth, in the frame, with the solid
    /// angle.
    fn local(&self, x: f64, azimuth: (f64, f64)) -> (DVec3, Measure);
}

impl<G: Grade> Chart for Directions<G> {
    type Point = DVec3;

    fn piece(&self) -> Piece {
        let [theta, azimuth] = self.kinks.clone();
        let theta = Coordinate { kinks: theta, ..Coordinate::over(0.0, 1.0) };
        Piece::plane("directions", [theta, Coordinate { kinks: azimuth, ..Coordinate::turns() }])
    }

    fn place(&self, dir: DVec3) -> ([f64; 2], Measure) {
        let (x, measure) = self.grade.coordinate(&self.frame, dir);
        let local = self.frame.to_local(dir);
        ([x, turns(local.x, local.y)], measure)
    }

    fn point(&self, [x, turns]: [f64; 2]) -> Option<(DVec3, Measure)> {
        let (local, measure) = self.grade.local(x, sin_cos_turns(turns));
        Some((self.frame.to_world(local), measure))
    }
}

/// theta = pi x: d omega = 2 pi^2 sin(theta) per unit of x and turn.
#[derive(Clone, Copy, Debug)]
pub struct EvenAngle;

impl EvenAngle {
    /// The angle between two unit vectors, with all its digits at both ends.
    pub fn theta(axis: DVec3, dir: DVec3) -> f64 {
        2.0 * atan2((dir - axis).length(), (dir + axis).length())
    }

    /// Solid angle per unit of x and turn.
    pub fn solid_angle(theta: f64) -> f64 {
        TAU * PI * sin(theta)
    }

    /// A direction by its polar angle and the (sine, cosine) of its azimuth.
    pub fn dir(theta: f64, (s, c): (f64, f64)) -> DVec3 {
        DVec3::new(sin(theta) * c, sin(theta) * s, cos(theta))
    }
}

impl Grade for EvenAngle {
    fn coordinate(&self, frame: &Frame, dir: DVec3) -> (f64, Measure) {
        let theta = EvenAngle::theta(frame.n, dir);
        (theta / PI, Measure::of(EvenAngle::solid_angle(theta)))
    }

    fn local(&self, x: f64, azimuth: (f64, f64)) -> (DVec3, Measure) {
        (EvenAngle::dir(PI * x, azimuth), Measure::of(EvenAngle::solid_angle(PI * x)))
    }
}

/// Lengths from 0 to infinity over [0, 1): t = l x / (1 - x), dt/dx = l / (1 - x)^2.
#[derive(Clone, Copy, Debug)]
pub struct Unbounded(pub f64);

impl Unbounded {
    /// t and dt/dx; the end itself is infinitely far and has no density.
    pub fn at(self, x: f64) -> Option<(f64, f64)> {
        let left = 1.0 - x;
        (left > 0.0).then(|| (self.0 * x / left, self.0 / (left * left)))
    }

    /// The mean of a function of the length.
    pub fn contrast(
        self,
        name: &'static str,
        expected: f64,
        of: impl Fn(f64) -> f64 + Send + Sync + 'static,
    ) -> Contrast {
        Contrast::of(name, Some(expected), move |[x, _]| self.at(x).map_or(0.0, |(t, _)| of(t)))
    }
}

impl Chart for Unbounded {
    type Point = f64;

    fn piece(&self) -> Piece {
        Piece::line("distance", Coordinate::over(0.0, 1.0))
    }

    fn place(&self, t: f64) -> ([f64; 2], Measure) {
        let x = t / (t + self.0);
        ([x, 0.5], Measure::of(self.at(x).map_or(0.0, |(_, dt)| dt)))
    }

    fn point(&self, [x, _]: [f64; 2]) -> Option<(f64, Measure)> {
        self.at(x).map(|(t, dt)| (t, Measure::of(dt)))
    }
}

/// Points of a plane by their distance r from the origin and their azimuth in turns; dA = 2 pi r dr per
/// turn.
#[derive(Clone, Copy, Debug)]
pub enum PlaneChart {
    /// The whole plane: x = l / (l + r). The far tail lies at x = 0, where numbers are dense: a profile
    /// without absorption draws r = 1e7 l once in 1e7, and 1 - x would keep half of its digits.
    Plane(f64),
    /// The disc of this radius: r = r_max x.
    Disc(f64),
}

/// A point of a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolarPoint {
    /// Distance from the origin.
    pub r: f64,
    /// Azimuth, turns.
    pub turns: f64,
}

impl PolarPoint {
    /// From Cartesian coordinates.
    pub fn of([x, y]: [f64; 2]) -> PolarPoint {
        PolarPoint { r: (x * x + y * y).sqrt(), turns: turns(x, y) }
    }
}

impl PlaneChart {
    /// r and |dr/dx|; nothing at infinity.
    pub fn at(self, x: f64) -> Option<(f64, f64)> {
        match self {
            PlaneChart::Plane(l) => (x > 0.0).then(|| (l * (1.0 - x) / x, l / (x * x))),
            PlaneChart::Disc(r_max) => Some((r_max * x, r_max)),
        }
    }
}

impl Chart for PlaneChart {
    type Point = PolarPoint;

    fn piece(&self) -> Piece {
        Piece::plane("points", [Coordinate::over(0.0, 1.0), Coordinate::turns()])
    }

    fn place(&self, PolarPoint { r, turns }: PolarPoint) -> ([f64; 2], Measure) {
        let x = match *self {
            PlaneChart::Plane(l) => l / (l + r),
            PlaneChart::Disc(r_max) => r / r_max,
        };
        ([x, turns], Measure([TAU, r, self.at(x).map_or(0.0, |(_, dr)| dr)]))
    }

    fn point(&self, [x, turns]: [f64; 2]) -> Option<(PolarPoint, Measure)> {
        self.at(x).map(|(r, dr)| (PolarPoint { r, turns }, Measure([TAU, r, dr])))
    }
}
