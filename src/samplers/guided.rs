//! Turns and flights of guided walks.

use std::f64::consts::{PI, TAU};

use schemars::JsonSchema;
use serde::Deserialize;

use super::chart::{AXIS, Charted, Directions, EvenAngle, Grade, Measure, Technique, Unbounded};
use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler};
use crate::error::Error;
use crate::math::{DVec3, Frame, cos, exp, exp_m1, ln_1p, sin, sin_cos_turns};
use crate::optics::guided::{Escape, GuidedTurns, Heading, Pull, StepGuide};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::Stream;

/// `guided_turn` in experiment files.
pub const TURN: SamplerKind = sampler_kind!(
    "guided_turn",
    "directions of a turn in a guided walk",
    TurnOptions => |o| {
        let phase = HenyeyGreenstein { g: o.g };
        let frame = Frame::about(AXIS);
        let angle = o.angle_deg.to_radians();
        let axis = frame.n * cos(angle) + frame.s * sin(angle);
        let angle = o.exit_deg.to_radians();
        let normal = frame.n * cos(angle) - frame.t * sin(angle);
        let escape = Escape { normal, least_cosine: cos(o.cone_deg.to_radians()), chance: o.escapes };
        let guide = StepGuide { pull: Pull::new(axis * o.growth), escape, bend: 0.0 };
        let turn = GuidedTurn { phase, turns: GuidedTurns::new(phase, o.albedo), share: o.share, guide };
        let scale = (1.0 - o.g.abs()) * (1.0 - o.g.abs());
        let grade = PeakGrade { scale, length: ln_1p(2.0 / scale), is_backward: o.g < 0.0 };
        Ok(Charted::new(turn, Directions::graded(grade)))
    }
);

/// Options of `guided_turn`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TurnOptions {
    /// Mean cosine of the phase function.
    #[schemars(range(min = -0.9999, max = 0.9999))]
    g: f64,
    /// Albedo of the medium.
    #[schemars(range(min = 0.0, max = 1.0))]
    albedo: f64,
    /// Growth of the importance per mean free path; rounded to one of 255 steps up to 0.96.
    #[schemars(range(min = 0.0, max = 0.96))]
    growth: f64,
    /// Between the direction of arrival and that of growth, degrees.
    #[schemars(range(min = 0.0, max = 180.0))]
    angle_deg: f64,
    /// Share of guided turns.
    #[schemars(range(min = 0.0, max = 1.0))]
    share: f64,
    /// Chance that a guided turn is an escape.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    escapes: f64,
    /// Between the direction of arrival and the axis of the cone, degrees; at right angles to the plane of growth.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 180.0))]
    exit_deg: f64,
    /// Half angle of the cone, degrees.
    #[serde(default = "right_angle")]
    #[schemars(range(max = 90.0), extend("exclusiveMinimum" = 0))]
    cone_deg: f64,
}

fn right_angle() -> f64 {
    90.0
}

struct GuidedTurn {
    phase: HenyeyGreenstein,
    turns: GuidedTurns,
    share: f64,
    guide: StepGuide,
}

/// By the cosine to the peak of the phase function, as for the phase function alone: 1 - mu = s (e^{L x} - 1), s = (1 - |g|)^2,
/// L = ln(1 + 2 / s); d omega = 2 pi L (s + 1 - mu) per unit and turn.
#[derive(Clone, Copy, Debug)]
struct PeakGrade {
    scale: f64,
    length: f64,
    is_backward: bool,
}

impl PeakGrade {
    fn solid_angle(&self, below: f64) -> Measure {
        Measure::of(TAU * self.length * (self.scale + below))
    }
}

impl Grade for PeakGrade {
    fn coordinate(&self, frame: &Frame, dir: DVec3) -> (f64, Measure) {
        let pole = if self.is_backward { -frame.n } else { frame.n };
        let below = 0.5 * (dir - pole).length_squared();
        let x = (ln_1p(below / self.scale) / self.length).clamp(0.0, 1.0);
        (x, self.solid_angle(below))
    }

    fn local(&self, x: f64, (s, c): (f64, f64)) -> (DVec3, Measure) {
        let below = (self.scale * exp_m1(self.length * x)).min(2.0);
        let cosine = if self.is_backward { below - 1.0 } else { 1.0 - below };
        let sine = (below * (2.0 - below)).sqrt();
        (DVec3::new(sine * c, sine * s, cosine), self.solid_angle(below))
    }
}

impl Technique<Directions<PeakGrade>> for GuidedTurn {
    fn sample(&self, stream: &mut Stream) -> (DVec3, Option<f64>) {
        let (dir, _) = self.turns.sample_mixed(self.share, &self.guide, AXIS, || stream.draw());
        (dir, Some(self.pdf(dir)))
    }

    fn pdf(&self, dir: DVec3) -> f64 {
        self.phase.pdf(AXIS.dot(dir)) * self.turns.heading(self.share, &self.guide, AXIS, dir).turned()
    }

    fn contrasts(&self, chart: &Directions<PeakGrade>) -> Vec<Contrast> {
        let (grade, frame, axis) = (chart.grade, chart.frame, self.guide.pull.axis);
        let along =
            move |[x, turns]: [f64; 2]| frame.to_world(grade.local(x, sin_cos_turns(turns)).0).dot(axis);
        let ahead = move |[x, _]: [f64; 2]| grade.local(x, (0.0, 1.0)).0.z;
        vec![
            Contrast::of("mean cosine to the growth", None, along),
            Contrast::of("mean cosine", None, ahead),
        ]
    }
}

/// `guided_step` in experiment files.
pub const STEP: SamplerKind = sampler_kind!(
    "guided_step",
    "direction and distance of a step in a guided walk, isotropic scattering",
    StepOptions => |o| {
        if o.growth + o.bend >= 1.0 {
            let sum = o.growth + o.bend;
            return Err(Error::input(format!("guided_step: `growth` and `bend` are {sum} together, and have to be below 1")));
        }
        let phase = HenyeyGreenstein { g: 0.0 };
        let turns = GuidedTurns::new(phase, o.albedo)
            .carrying(o.carry)
            .in_body(o.depth.unwrap_or(f64::INFINITY));
        let guide = StepGuide { bend: o.bend, ..StepGuide::inner(Pull::new(AXIS * o.growth)) };
        Ok(Step { turns, share: o.share, guide, sigma_t: o.sigma_t_per_mm })
    }
);

/// Options of `guided_step`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct StepOptions {
    /// Albedo of the medium.
    #[schemars(range(min = 0.0, max = 1.0))]
    albedo: f64,
    /// Extinction, 1/mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    sigma_t_per_mm: f64,
    /// Growth of the importance per mean free path; rounded to one of 255 steps up to 0.96.
    #[schemars(range(min = 0.0, max = 0.96))]
    growth: f64,
    /// Share of guided steps.
    #[schemars(range(min = 0.0, max = 1.0))]
    share: f64,
    /// Growth of the importance to all sides, per mean free path; with `growth` below 1.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.96))]
    bend: f64,
    /// Mean free paths by which light is carried on at the end of a flight.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    carry: f64,
    /// Mean free paths from the middle of the body to its surface, by default so many that the depth does not matter: flights against
    /// the growth have the plain rate beyond half of the depth less 1, and beyond 4.
    #[schemars(range(min = 0.0))]
    depth: Option<f64>,
}

/// Angle to the growth over pi, all azimuths together (2 pi^2 sin(theta) per unit), and the distance.
struct Step {
    turns: GuidedTurns,
    share: f64,
    guide: StepGuide,
    sigma_t: f64,
}

impl Step {
    fn heading(&self, dir: DVec3) -> Heading {
        self.turns.heading(self.share, &self.guide, DVec3::X, dir)
    }

    fn distances(&self) -> Unbounded {
        Unbounded(1.0 / self.sigma_t)
    }

    fn joint(&self, dir: DVec3, theta: f64, t: f64, slope: f64) -> f64 {
        let heading = self.heading(dir);
        let plain = self.sigma_t * exp(-self.sigma_t * t) / (4.0 * PI);
        plain * heading.flight_ratio(self.sigma_t, t) * EvenAngle::solid_angle(theta) * slope
    }
}

impl Sampler for Step {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let (dir, drawn) = self.turns.sample_mixed(self.share, &self.guide, DVec3::X, || stream.draw());
        let heading = self.heading(dir);
        let t = heading.sample_distance(self.sigma_t, drawn, stream.draw());
        let theta = EvenAngle::theta(AXIS, dir);
        let x = t / (t + 1.0 / self.sigma_t);
        let slope = self.distances().at(x).map_or(0.0, |(_, slope)| slope);
        Draw::Point { piece: 0, at: [theta / PI, x], density: self.joint(dir, theta, t, slope) }
    }

    fn pieces(&self) -> Vec<Piece> {
        let axes = [Coordinate::over(0.0, 1.0), Coordinate::over(0.0, 1.0)];
        vec![Piece::plane("angle and distance", axes)]
    }

    fn density(&self, _piece: usize, [x, y]: [f64; 2]) -> f64 {
        let theta = PI * x;
        let dir = Frame::about(AXIS).to_world(EvenAngle::dir(theta, sin_cos_turns(0.3)));
        self.distances().at(y).map_or(0.0, |(t, slope)| self.joint(dir, theta, t, slope))
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let cosine = Contrast::of("mean cosine to the growth", None, |[x, _]| cos(PI * x));
        let half = Contrast::of("mean of d / (d + mfp)", None, |[_, y]| y);
        vec![cosine, half]
    }
}
