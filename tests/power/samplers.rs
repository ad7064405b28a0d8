//! Small samplers with places for defects, one for every way in which a draw and its density may
//! disagree. Densities are per unit of the chart, as the catalogue has them.

use std::f64::consts::{PI, SQRT_2, TAU};
use std::sync::Mutex;

use scatterproof::math::{DVec3, Frame, atan, atan2, cos, exp, exp_m1, ln_1p, sin, sin_cos_turns, tan};
use scatterproof::optics::phase::HenyeyGreenstein;
use scatterproof::samplers::{
    Contrast, Coordinate, Discrete, Draw, Null, Piece, Sampler, SamplerKind, read_options,
};
use scatterproof::sampling::stream::Stream;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::defects::{Defect, planted};
use super::lobes::{Bounce, Plane, Refraction};

/// None of them has options.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoOptions {}

macro_rules! entry {
    ($kind:literal, $doc:literal, $build:expr) => {
        SamplerKind {
            kind: $kind,
            doc: $doc,
            options_schema: || schemars::schema_for!(NoOptions),
            build: |options| {
                let NoOptions {} = read_options(options)?;
                Ok(Box::new($build))
            },
        }
    };
}

/// Every sampler here, with what is planted in this process.
pub fn entries() -> Vec<SamplerKind> {
    vec![
        entry!("planted_phase", "Henyey-Greenstein", Phase::new(planted())),
        entry!("planted_flight", "truncated flight", Flight { defect: planted() }),
        entry!("planted_equiangular", "equiangular distance", Equiangular { defect: planted() }),
        entry!("planted_mixture", "two lobes of a cosine", Mixture { defect: planted() }),
        entry!("planted_partly_delta", "a delta lobe beside a cosine", Partly { defect: planted() }),
        entry!("planted_rejection", "a disc by rejection", Rejection { defect: planted() }),
        entry!("planted_sphere", "directions of a sphere", Sphere::new(planted())),
        entry!("planted_refraction", "rough refraction alone", Refraction { defect: planted() }),
        entry!("planted_plane", "directions to a plane", Plane { defect: planted() }),
        entry!("planted_bounce", "a table of a single bounce", Bounce::new(planted())),
    ]
}

/// Mean cosine of [`Phase`].
const G: f64 = 0.7;

/// Root mean square of the density's relative error under [`Defect::DensityTilted`]: what the experiment
/// claims to detect (`detect` in samplers.toml).
const TILT: f64 = 0.06;

/// Henyey-Greenstein about a direction of travel that is aligned with nothing; chart ((1 + mu)/2,
/// turns).
struct Phase {
    defect: Defect,
    drawn: HenyeyGreenstein,
    claimed: HenyeyGreenstein,
}

/// The direction of travel.
const TRAVEL: DVec3 = DVec3::new(0.48, -0.6, 0.64);

impl Phase {
    fn new(defect: Defect) -> Phase {
        let (drawn, claimed) = match defect {
            Defect::SamplerFlipped => (-G, -G),
            Defect::DrawFlipped => (-G, G),
            _ => (G, G),
        };
        let phase = |g| HenyeyGreenstein { g };
        Phase { defect, drawn: phase(drawn), claimed: phase(claimed) }
    }
}

impl Sampler for Phase {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let next = Frame::about(TRAVEL).to_local(self.drawn.sample(TRAVEL, stream.draw2()));
        let turns = (atan2(next.y, next.x) / TAU).rem_euclid(1.0);
        let at = [(0.5 * (1.0 + next.z)).clamp(0.0, 1.0), turns];
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Coordinate::over(0.0, 1.0), Coordinate::turns()])]
    }

    fn density(&self, _: usize, [x, turns]: [f64; 2]) -> f64 {
        let factor = match self.defect {
            Defect::DensityTilted => 1.0 + TILT * SQRT_2 * sin_cos_turns(turns).1,
            Defect::DensityDoubled => 2.0,
            _ => 1.0,
        };
        2.0 * TAU * factor * self.claimed.pdf(2.0 * x - 1.0)
    }

    /// The stated mean cosine, which a defect may change.
    fn contrasts(&self) -> Vec<Contrast> {
        let of = Box::new(|_, [x, _]: [f64; 2]| 2.0 * x - 1.0);
        vec![Contrast { name: "mean cosine", of, expected: Some(G) }]
    }
}

/// Optical length at which [`Flight`] ends.
const TAU_MAX: f64 = 2.0;

/// A flight of extinction 1 that ends before [`TAU_MAX`]; chart t / TAU_MAX.
struct Flight {
    defect: Defect,
}

impl Sampler for Flight {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let u = stream.draw();
        let t = match self.defect {
            Defect::Untruncated => -ln_1p(-u),
            _ => -ln_1p(u * exp_m1(-TAU_MAX)),
        };
        let at = [t / TAU_MAX, 0.5];
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::line("distance", Coordinate::over(0.0, 1.0))]
    }

    fn density(&self, _: usize, [x, _]: [f64; 2]) -> f64 {
        let share = match self.defect {
            Defect::ShareMissing => 1.0,
            _ => -exp_m1(-TAU_MAX),
        };
        TAU_MAX * exp(-TAU_MAX * x) / share
    }
}

/// Distance along a ray over [0, 3] about a point at 1 along it and 0.5 beside it (Kulla & Fajardo
/// 2012): t - 1 = D tan of an angle that is uniform between those of both ends. Chart t / 3.
struct Equiangular {
    defect: Defect,
}

impl Equiangular {
    /// Foot of the perpendicular, distance, and angles of the ends, as the sampler has them.
    fn bounds(&self) -> (f64, f64, [f64; 2]) {
        let (delta, beside) = (1.0, 0.5);
        // A direction 1.1 long puts the foot too far out, by the square where it is not divided again.
        let delta = if self.defect == Defect::Unnormalised { 1.21 * delta } else { delta };
        let start = if self.defect == Defect::BoundSign { delta } else { -delta };
        (delta, beside, [atan(start / beside), atan((3.0 - delta) / beside)])
    }
}

impl Sampler for Equiangular {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let (delta, beside, [a, b]) = self.bounds();
        let t = delta + beside * tan(a + stream.draw() * (b - a));
        let at = [t / 3.0, 0.5];
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::line("distance", Coordinate::over(0.0, 1.0))]
    }

    fn density(&self, _: usize, [x, _]: [f64; 2]) -> f64 {
        let (_, beside, [a, b]) = match self.defect {
            Defect::Unnormalised => Equiangular { defect: Defect::None }.bounds(),
            _ => self.bounds(),
        };
        let from_foot = 3.0 * x - 1.0;
        3.0 * beside / ((b - a) * (beside * beside + from_foot * from_foot))
    }
}

/// One of two lobes over the cosine of the hemisphere, mu^2 uniform or mu uniform; chart (mu, turns).
struct Mixture {
    defect: Defect,
}

/// Probability of the first lobe.
const FIRST: f64 = 0.3;

impl Sampler for Mixture {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let [u, turns] = stream.draw2();
        let first = u < FIRST;
        let rest = match self.defect {
            Defect::LobeNumberReused => u,
            _ if first => u / FIRST,
            _ => (u - FIRST) / (1.0 - FIRST),
        };
        let mu = if first { rest.sqrt() } else { rest };
        let density = match self.defect {
            Defect::ComponentDensity if first => 2.0 * mu,
            Defect::ComponentDensity => 1.0,
            _ => self.density(0, [mu, turns]),
        };
        Draw::Point { piece: 0, at: [mu, turns], density }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Coordinate::over(0.0, 1.0), Coordinate::turns()])]
    }

    fn density(&self, _: usize, [mu, _]: [f64; 2]) -> f64 {
        FIRST * 2.0 * mu + (1.0 - FIRST)
    }
}

/// Mass of the delta lobe of [`Partly`].
const MASS: f64 = 0.2;

/// A delta lobe, else a cosine-distributed direction; chart (mu, turns).
struct Partly {
    defect: Defect,
}

impl Sampler for Partly {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let mass = if self.defect == Defect::MassOff { 1.1 * MASS } else { MASS };
        if stream.draw() < mass {
            return Draw::Delta { index: 0, exact: true };
        }
        let [u, turns] = stream.draw2();
        let at = [u.sqrt(), turns];
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Coordinate::over(0.0, 1.0), Coordinate::turns()])]
    }

    fn density(&self, _: usize, [mu, _]: [f64; 2]) -> f64 {
        let share = if self.defect == Defect::DeltaLeaks { 1.0 } else { 1.0 - MASS };
        share * 2.0 * mu
    }

    fn deltas(&self) -> Vec<Discrete> {
        vec![Discrete { name: "delta".into(), mass: MASS }]
    }
}

/// A point of the square, nothing outside the disc that it holds; chart (r, turns).
struct Rejection {
    defect: Defect,
}

impl Sampler for Rejection {
    fn draw(&self, stream: &mut Stream) -> Draw {
        loop {
            let [u, v] = stream.draw2();
            let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
            let r = (x * x + y * y).sqrt();
            if r < 1.0 {
                let at = [r, (atan2(y, x) / TAU).rem_euclid(1.0)];
                return Draw::Point { piece: 0, at, density: self.density(0, at) };
            }
            if self.defect != Defect::NullsRedrawn {
                return Draw::Null;
            }
        }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("disc", [Coordinate::over(0.0, 1.0), Coordinate::turns()])]
    }

    /// 1/4 per area, area 2 pi r per (r, turns).
    fn density(&self, _: usize, [r, _]: [f64; 2]) -> f64 {
        0.25 * TAU * r
    }

    fn null(&self) -> Null {
        Null::Stated(1.0 - 0.25 * PI)
    }
}

/// A uniform direction; chart (theta / pi, turns).
struct Sphere {
    defect: Defect,
    last: Mutex<Option<[f64; 2]>>,
}

impl Sphere {
    fn new(defect: Defect) -> Sphere {
        Sphere { defect, last: Mutex::new(None) }
    }

    /// The numbers of a draw; with neighbouring streams that repeat each other, every other draw nearly
    /// has those of the one before.
    fn numbers(&self, stream: &mut Stream) -> [f64; 2] {
        let fresh = stream.draw2();
        if self.defect != Defect::NeighboursAlike {
            return fresh;
        }
        let mut last = self.last.lock().expect("one thread at a time");
        match last.take() {
            Some(old) => old.map(|u| (u + 0.01 * fresh[0]).fract()),
            None => *last.insert(fresh),
        }
    }
}

impl Sampler for Sphere {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let [u, turns] = self.numbers(stream);
        let x = match self.defect {
            Defect::SamplerSineMissing => u,
            _ => 2.0 * atan2(u.sqrt(), (1.0 - u).sqrt()) / PI,
        };
        let at = [x, turns];
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Coordinate::over(0.0, 1.0), Coordinate::turns()])]
    }

    /// 1 / (4 pi) per solid angle, which is 2 pi * pi sin theta per chart.
    fn density(&self, _: usize, [x, _]: [f64; 2]) -> f64 {
        0.5 * PI * sin(PI * x)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let of = Box::new(|_, [x, _]: [f64; 2]| cos(PI * x) * cos(PI * x));
        vec![Contrast { name: "cos^2", of, expected: Some(1.0 / 3.0) }]
    }
}
