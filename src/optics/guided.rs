//! Turns (scattered directions) and flights (distances) of guided walks, which prefer directions of growing importance.
//!
//! Let phi(x) > 0 be an importance, n = grad phi / |grad phi| and s = |grad phi| / (sigma_t phi) < 1 its growth per mean
//! free path. In a half-space with isotropic scattering and albedo a, transport has the solution phi = e^{s sigma_t x.n} /
//! (1 - s m), m = w.n, with s / tanh^-1(s) = a (Dwivedi 1982, Krivanek & d'Eon 2014). Used as the importance, this
//! solution gives the walk of least variance:
//!   turn     p(w') ~ 1 / (1 - s m')
//!   flight   rate sigma' = sigma_t (1 - s m).
//! For a phase function that is not isotropic the angular factor is multiplied by the phase function,
//!   p(w') = HG(w.w') f(m') / N(m),   f(m') = (1 + b s m') / (1 - s m'),   b = a g / (1 - a g),
//! where b is the first moment of the collision density of the growing solution in the diffusion limit, and N the integral
//! of the numerator. With f = -b + (1 + b) / (1 - s m') and
//!   1 / (1 - s m') = nu / (nu - m') = nu sum_l (2l+1) Q_l(nu) P_l(m'),   nu = 1 / s,
//! where Q_l are Legendre functions of the second kind, the convolution with HG multiplies the l-th term by g^l:
//!   N(m) = -b + (1 + b) nu sum_l (2l+1) g^l Q_l(nu) P_l(m).
//! For g = 0 only the first term remains, the logarithm of Dwivedi's density, and f has a closed form. Otherwise the series
//! of f, which falls off as (nu - sqrt(nu^2 - 1))^l, is truncated where the rest is below `REST` of the least value of f. The
//! truncated f is a polynomial that guides as well, and its N has the same few terms, without an error. Where more than
//! `TERMS` terms would be needed, the turn uses the f of a smaller s. s is rounded to one of `LEVELS` values, which are closer
//! to each other where they are small and have a series each; any s gives an exact density, so that rounding adds no error.
//!
//! A walk needs the ratio of its density to that of the plain walk: f / N for a turn; for a flight of length t with the
//! pull p = s m,
//!   (1 - p) e^{p sigma_t t} where it ends in the medium, e^{p sigma_t t} where it reaches the boundary.
//!
//! # Bends
//!
//! In a finite body phi is no exponential: it solves lap(phi) = kappa^2 phi, with a growth s below the asymptotic one kappa (both
//! per mean free path here), and grows to all sides of a point beside its gradient; in the middle of a sphere it has no
//! gradient at all. To second order about x, phi(x + t w) / phi(x) = e^{p t} cosh(c t), and the sum of the second derivatives
//! of ln phi, 3 c^2, is kappa^2 - s^2. A photon that is carried on by forward scattering finds phi + l dphi/dt at the end of a
//! flight, l = g / (1 - a g) mean free paths (3 D g of the P1 approximation), which of e^{p t} cosh(c t) is, up to a factor,
//!   (1 + w)/2 e^{(p + c) t} + (1 - w)/2 e^{(p - c) t},   w = l c / (1 + l p).
//! So a flight has one of two rates, 1 - p - c or 1 - p + c, with the density and the probability of more than t
//!   e^{-t} ((1 + w)/2 e^{(p + c) t} + (1 - w)/2 e^{(p - c) t}) / Z,   Z = (1 - p + w c) / ((1 - p)^2 - c^2),
//!   e^{-t} (S e^{(p + c) t} + (1 - S) e^{(p - c) t}),   S = (1 + w)/2 (1 - p + c) / (1 - p + w c),
//! S being the share of the smaller rate. Without c these are the flights above. A step of such a walk has the weight phi / phi'
//! that it should have, where the flight along an exponential loses the factor a at every step in the middle of a body. c is
//! at most 0.7 (1 - s) and w at most 0.95, so that all rates and densities are positive.
//!
//! Near a boundary a guided step is an *escape* with probability k: its direction is uniform in the cone, of solid angle W,
//! of directions that are refracted out, and it reaches the boundary; no distance is drawn. Relative to a plain step its
//! density is e^{sigma_t t} k / (W HG).
//!
//! Against the growth, where p < -c, importance does not fall forever: behind the middle of a body it grows again, and a plain
//! flight across has a density that e^{p sigma_t t} puts near 0. So such a flight has no c, and beyond `fall` mean free paths it
//! goes on with the plain rate: t in e^{p sigma_t t} stops there, and 1 - p becomes 1.
//!
//! The guide alone is not safe: where it is wrong, weights are unbounded. If a share q of steps is guided, turn and flight
//! together, and both are weighted by the balance heuristic, the weight of a step is at most 1 / (1 - q) times that of a plain
//! one. A step that ends in the medium, and one that reaches the boundary, have the ratios (here
//! without bends)
//!   (1 - q) + q (1 - k) (f / N) (1 - p) e^{p sigma_t t},
//!   (1 - q) + q (1 - k) (f / N) e^{p sigma_t t} + q k / (W HG) e^{sigma_t t},
//! whose parts `Heading` keeps while the direction is known and the flight is not.

mod lanes;
mod legendre;

pub use lanes::{DrawLanes, GuideLanes, StepLanes, strengths};

use std::f64::consts::TAU;

use legendre::{Polynomial, second_kind};

use super::phase::HenyeyGreenstein;
use crate::math::{DVec3, Frame, exp, exp_m1, increasing_root, ln_1p, renormalized, sin_cos_turns};
use crate::sampling::discrete::choose;
use crate::sampling::distance::sample_exponential;

/// Number of distinct values of the growth per mean free path, including 0.
pub const LEVELS: usize = 256;

/// The largest growth per mean free path.
pub const MOST: f64 = 0.96;

/// The part of f that its series may leave out.
const REST: f64 = 0.02;

/// The largest b s: f stays positive.
const MOST_BEND: f64 = 0.95;

/// The most coefficients that f has.
const TERMS: usize = 8;

/// Mean free paths after which a flight against the growth has the plain rate, at most. A compromise: fewer cost efficiency in
/// thick bodies, where importance falls that far; with more, a flight across a body of 10 keeps a large weight.
const MOST_FALL: f64 = 4.0;

/// The same in a body that is so many mean free paths deep. A flight across it has twice this length and the plain probability
/// e^{-2 depth}; with the guided rate all the way its weight would be e^{2 s depth}, and in bodies of 2 to 5 mean free paths this
/// would be most of the variance. Of 0.4, 0.5 and 0.6 of the depth less 0.5, 1 and 1.5 this was the best at albedo 0.3 to 0.95.
fn fall(depth: f64) -> f64 {
    (0.5 * depth - 1.0).clamp(0.0, MOST_FALL)
}

/// The largest exponent of a ratio.
const MOST_EXPONENT: f64 = 700.0;

/// A direction in which importance grows, and how fast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// Unit direction.
    pub axis: DVec3,
    /// Index of the growth per mean free path, below [`LEVELS`]; 0 is the plain walk.
    pub level: usize,
}

impl Pull {
    /// None.
    pub const NONE: Pull = Pull { axis: DVec3::Z, level: 0 };

    /// From the gradient of ln phi over sigma_t, its length rounded to a level.
    #[inline]
    pub fn new(growth: DVec3) -> Pull {
        let length = growth.length();
        let level = (((length / MOST).sqrt() * (LEVELS - 1) as f64 + 0.5) as usize).min(LEVELS - 1);
        if level == 0 { Pull::NONE } else { Pull { axis: growth / length, level } }
    }

    /// s, the growth per mean free path.
    #[inline]
    pub fn strength(&self) -> f64 {
        const STEP: f64 = 1.0 / (LEVELS - 1) as f64;
        let part = self.level as f64 * STEP;
        MOST * (part * part)
    }

    /// s m for the direction of a flight.
    #[inline]
    pub fn along(&self, dir: DVec3) -> f64 {
        self.strength() * self.axis.dot(dir)
    }
}

/// The escape near a boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Escape {
    /// Unit normal of the boundary, outwards: the axis of the cone.
    pub normal: DVec3,
    /// Least cosine to the axis; below 1.
    pub least_cosine: f64,
    /// Probability that a guided step is an escape.
    pub chance: f64,
}

impl Escape {
    /// None.
    pub const NONE: Escape = Escape { normal: DVec3::Z, least_cosine: 0.0, chance: 0.0 };

    /// Density of the direction of an escape, 1/sr.
    #[inline]
    fn pdf(&self, dir: DVec3) -> f64 {
        let inside = self.normal.dot(dir) > self.least_cosine;
        if inside { 1.0 / (TAU * (1.0 - self.least_cosine)) } else { 0.0 }
    }

    fn sample(&self, [u, v]: [f64; 2]) -> DVec3 {
        let below = (1.0 - self.least_cosine) * u;
        let (sin_phi, cos_phi) = sin_cos_turns(v);
        let r = (below * (2.0 - below)).sqrt();
        let local = DVec3::new(r * cos_phi, r * sin_phi, 1.0 - below);
        renormalized(Frame::about(self.normal).to_world(local))
    }
}

/// What guides a step from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepGuide {
    /// Where importance grows.
    pub pull: Pull,
    /// The way out.
    pub escape: Escape,
    /// c, by which importance grows to all sides, per mean free path: [`bend`], or 0.
    pub bend: f64,
}

impl StepGuide {
    /// None.
    pub const NONE: StepGuide = StepGuide { pull: Pull::NONE, escape: Escape::NONE, bend: 0.0 };

    /// Without a way out, for importance that is an exponential.
    pub fn inner(pull: Pull) -> StepGuide {
        StepGuide { pull, escape: Escape::NONE, bend: 0.0 }
    }
}

/// The largest c, over 1 - s: every rate is positive, with a margin.
const MOST_BENT: f64 = 0.7;

/// c of a solution of the Helmholtz equation whose asymptotic growth per mean free path is this, where it grows by s.
#[inline(always)]
pub fn bend(asymptotic: f64, s: f64) -> f64 {
    let squared = (asymptotic - s) * (asymptotic + s) * (1.0 / 3.0);
    let bend = if squared > 0.0 { squared } else { 0.0 }.sqrt();
    let most = MOST_BENT * (1.0 - s);
    if bend < most { bend } else { most }
}

/// How a step is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepDraw {
    /// As the medium has it.
    Plain,
    /// Towards where importance grows.
    Guided,
    /// To the boundary.
    Escape,
}

/// What a turn after isotropic scattering needs for one s.
#[derive(Clone, Copy, Debug)]
struct IsotropicLevel {
    s: f64,
    /// L = ln((1 + s) / (1 - s)).
    spread: f64,
    /// (1 + s) / s.
    reach: f64,
    /// N.
    norm: f64,
}

/// What a turn after scattering of another kind needs for one s.
#[derive(Clone, Copy, Debug)]
struct Level {
    /// f.
    factor: Polynomial,
    /// N.
    norm: Polynomial,
    /// Coefficient of P_1 in f.
    linear: f64,
    /// Sum of all others.
    even: f64,
}

/// Turns of a walk in a medium.
#[derive(Clone, Debug)]
pub struct GuidedTurns {
    phase: HenyeyGreenstein,
    levels: Levels,
    /// g / (1 - a g): the mean free paths by which light is carried on.
    carry: f64,
    /// Mean free paths after which a flight against the growth has the plain rate.
    fall: f64,
}

/// Every level; the first is not asked for.
#[derive(Clone, Debug)]
enum Levels {
    Isotropic(Vec<IsotropicLevel>),
    Product(Vec<Level>),
}

impl GuidedTurns {
    /// For a phase function and an albedo, both of the medium.
    pub fn new(phase: HenyeyGreenstein, albedo: f64) -> GuidedTurns {
        let strength = |level: usize| Pull { axis: DVec3::Z, level: level.max(1) }.strength();
        let spread = |s: f64| ln_1p(2.0 * s / (1.0 - s));
        let levels = 0..LEVELS;
        if phase.g == 0.0 {
            let level = |s: f64| {
                let (spread, reach) = (spread(s), (1.0 + s) / s);
                IsotropicLevel { s, spread, reach, norm: 0.5 * spread / s }
            };
            let levels = Levels::Isotropic(levels.map(strength).map(level).collect());
            return GuidedTurns { phase, levels, carry: 0.0, fall: MOST_FALL };
        }
        let b = albedo * phase.g / (1.0 - albedo * phase.g);
        let mut all: Vec<Level> = Vec::with_capacity(LEVELS);
        for s in levels.map(strength) {
            let factor = factor(s, b.min(MOST_BEND / s), spread(s));
            let level = match all.last() {
                Some(largest) if factor.len() > TERMS => *largest,
                _ => Level::new(&factor, phase.g),
            };
            all.push(level);
        }
        let carry = phase.g / (1.0 - albedo * phase.g);
        GuidedTurns { phase, levels: Levels::Product(all), carry, fall: MOST_FALL }
    }

    /// The same in a body that is nowhere more than so many mean free paths deep.
    pub fn in_body(self, depth: f64) -> GuidedTurns {
        GuidedTurns { fall: fall(depth), ..self }
    }

    /// The same where light is carried on by so many mean free paths at the end of a flight, in place of g / (1 - a g).
    pub fn carrying(self, carry: f64) -> GuidedTurns {
        GuidedTurns { carry, ..self }
    }

    /// Density of a turn from `from` to `to`, over that of the phase function.
    #[inline(always)]
    pub fn ratio(&self, pull: &Pull, from: DVec3, to: DVec3) -> f64 {
        if pull.level == 0 {
            return 1.0;
        }
        let m = pull.axis.dot(to);
        match &self.levels {
            Levels::Isotropic(levels) => {
                let IsotropicLevel { s, norm, .. } = levels[pull.level];
                1.0 / ((1.0 - s * m) * norm)
            }
            Levels::Product(levels) => {
                let Level { factor, norm, .. } = &levels[pull.level];
                factor.at(m) / norm.at(pull.axis.dot(from))
            }
        }
    }

    /// A turn that is guided with probability `share`, else as the phase function has it; and how the step is drawn.
    #[inline(always)]
    pub fn sample_mixed(
        &self,
        share: f64,
        guide: &StepGuide,
        from: DVec3,
        mut draw: impl FnMut() -> f64,
    ) -> (DVec3, StepDraw) {
        let StepGuide { pull, escape, .. } = guide;
        if draw() >= share {
            return (self.phase.sample(from, [draw(), draw()]), StepDraw::Plain);
        }
        if escape.chance > 0.0 && draw() < escape.chance {
            return (escape.sample([draw(), draw()]), StepDraw::Escape);
        }
        (self.sample(pull, from, draw), StepDraw::Guided)
    }

    /// What [`Self::sample_mixed`] says of the step that goes on along `to`.
    #[inline(always)]
    pub fn heading(&self, share: f64, guide: &StepGuide, from: DVec3, to: DVec3) -> Heading {
        let StepGuide { pull, escape, .. } = guide;
        let mut heading = Heading {
            plain: 1.0 - share,
            guided: share * self.ratio(pull, from, to),
            escape: 0.0,
            growth: self.growth(guide, to),
        };
        if escape.chance > 0.0 {
            heading.guided *= 1.0 - escape.chance;
            let pdf = escape.pdf(to);
            if pdf > 0.0 {
                heading.escape = share * escape.chance * pdf / self.phase.pdf(from.dot(to));
            }
        }
        heading
    }

    /// How importance grows along a direction.
    #[inline(always)]
    pub fn growth(&self, guide: &StepGuide, dir: DVec3) -> Growth {
        let (pull, bend) = (guide.pull.along(dir), guide.bend);
        if bend > 0.0 {
            Growth::new(pull, bend, self.carry, self.fall)
        } else {
            Growth::straight(pull, self.fall)
        }
    }

    /// A direction after light that travelled along `from`. Isotropic: with L = ln((1 + s) / (1 - s)), the distribution
    /// function of m inverts to 1 + m = (1 + s) (1 - e^{-L u}) / s.
    /// Otherwise by rejection from the phase function. A direction and that with the opposite azimuth about `from` are drawn
    /// together, since the phase function has the same value there, and one of them is taken in proportion to its f. With m and mu
    /// the cosines of `from` to the axis and to the direction, the two have m' = m mu +- c; the mean of their P_1 is m mu, and no
    /// other |P_l| exceeds 1, so that the mean of their f is at most c_1 |m| and the other coefficients, which are positive.
    #[inline(always)]
    pub fn sample(&self, pull: &Pull, from: DVec3, mut draw: impl FnMut() -> f64) -> DVec3 {
        if pull.level == 0 {
            return self.phase.sample(from, [draw(), draw()]);
        }
        match &self.levels {
            Levels::Isotropic(levels) => {
                let IsotropicLevel { spread, reach, .. } = levels[pull.level];
                let [u, v] = [draw(), draw()];
                let above = reach * (1.0 - exp(-spread * u));
                let (sin_phi, cos_phi) = sin_cos_turns(v);
                let r = (above * (2.0 - above)).max(0.0).sqrt();
                let local = DVec3::new(r * cos_phi, r * sin_phi, above - 1.0);
                renormalized(Frame::about(pull.axis).to_world(local))
            }
            Levels::Product(levels) => {
                let Level { factor, linear, even, .. } = &levels[pull.level];
                let frame = Frame::about(from);
                let axis = frame.to_local(pull.axis);
                let most = 2.0 * (linear * axis.z.abs() + even);
                let local = loop {
                    let local = self.phase.sample_local([draw(), draw()]);
                    if let Some(side) = side(factor, axis, local, draw() * most) {
                        break DVec3::new(side * local.x, side * local.y, local.z);
                    }
                };
                renormalized(frame.to_world(local))
            }
        }
    }

    /// Memory on the heap, bytes.
    pub fn heap_bytes(&self) -> usize {
        match &self.levels {
            Levels::Isotropic(levels) => size_of_val(&**levels),
            Levels::Product(levels) => size_of_val(&**levels),
        }
    }
}

/// 1 where a direction is taken, -1 where that of the opposite azimuth is, `None` where neither is ([`GuidedTurns::sample`]).
#[inline(always)]
fn side(factor: &Polynomial, axis: DVec3, local: DVec3, level: f64) -> Option<f64> {
    let across = axis.x * local.x + axis.y * local.y;
    let along = axis.z * local.z;
    let (of_first, of_opposite) = (factor.at(along + across), factor.at(along - across));
    // Either of the two is equally likely: a branch would be mispredicted half the time.
    let side = if level < of_first { 1.0 } else { -1.0 };
    (level - of_first < of_opposite).then_some(side)
}

/// A step whose direction is known: its density over that of a plain one, in parts, and the pull along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading {
    /// Of steps as the medium has them.
    pub plain: f64,
    /// Of those that are guided and no escapes.
    pub guided: f64,
    /// Of escapes.
    pub escape: f64,
    /// Along the direction.
    pub growth: Growth,
}

/// How importance grows along a direction, per mean free path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// p = s m; below 1.
    pub pull: f64,
    /// c; below 1 - p.
    pub bend: f64,
    /// S, the share of flights with the smaller rate; 1 without c.
    pub share: f64,
    /// Mean free paths after which a flight against the growth has the plain rate.
    pub fall: f64,
}

/// The largest w.
const MOST_SKEW: f64 = 0.95;

impl Growth {
    /// None.
    pub const NONE: Growth = Growth::straight(0.0, MOST_FALL);

    /// Without c.
    #[inline(always)]
    const fn straight(pull: f64, fall: f64) -> Growth {
        Growth { pull, bend: 0.0, share: 1.0, fall }
    }

    /// In a direction with this pull, from c and the distance l by which light is carried on.
    #[inline(always)]
    fn new(pull: f64, bend: f64, carry: f64, fall: f64) -> Growth {
        // Where importance only falls, it has no bend.
        let bend = if pull < -bend { 0.0 } else { bend };
        // w = carried / ahead; both are multiplied by it, which saves a division.
        let (carried, ahead) = (carry * bend, 1.0 + carry * pull);
        let is_most = carried > MOST_SKEW * ahead;
        let (carried, ahead) =
            (if is_most { MOST_SKEW } else { carried }, if is_most { 1.0 } else { ahead });
        let mean = 1.0 - pull;
        let share = 0.5 * (ahead + carried) * (mean + bend) / (mean * ahead + carried * bend);
        Growth { pull, bend, share: if bend > 0.0 { share } else { 1.0 }, fall }
    }

    /// Whether a flight has the plain rate from [`Self::fall`] on.
    #[inline(always)]
    fn falls(&self) -> bool {
        self.pull < 0.0 && self.bend == 0.0
    }

    /// The smaller and the larger rate, over that of a plain flight.
    #[inline(always)]
    fn rates(&self) -> [f64; 2] {
        let mean = 1.0 - self.pull;
        [mean - self.bend, mean + self.bend]
    }

    /// One of the two rates, and a number that is uniform again, from a uniform one.
    #[inline(always)]
    fn choose_rate(&self, u: f64) -> (f64, f64) {
        let ([small, large], share) = (self.rates(), self.share);
        let is_small = u < share;
        let part = if is_small { u } else { u - share };
        let of = if is_small { share } else { 1.0 - share };
        (if is_small { small } else { large }, part / of)
    }

    /// e^{(p + c) depth} and e^{(p - c) depth}.
    #[inline]
    fn both(&self, depth: f64) -> [f64; 2] {
        // Not `map`, which is not inlined.
        [growth(self.pull + self.bend, depth), growth(self.pull - self.bend, depth)]
    }

    /// Probability that a flight is longer than so many mean free paths, over that of a plain one.
    #[inline]
    fn passage(&self, depth: f64) -> f64 {
        if self.bend > 0.0 {
            let [up, down] = self.both(depth);
            self.share * up + (1.0 - self.share) * down
        } else {
            self.straight_passage(depth)
        }
    }

    /// The same without c.
    #[inline]
    fn straight_passage(&self, depth: f64) -> f64 {
        growth(self.pull, if self.falls() { depth.min(self.fall) } else { depth })
    }

    /// Density of flights over that of plain ones, out of e^{(p + c) t} and e^{(p - c) t}.
    #[inline(always)]
    fn density(&self, up: f64, down: f64) -> f64 {
        let [small, large] = self.rates();
        self.share * small * up + (1.0 - self.share) * large * down
    }
}

impl Heading {
    /// No step: the density is that of what has been drawn.
    pub const NONE: Heading = Heading { plain: 1.0, guided: 0.0, escape: 0.0, growth: Growth::NONE };

    /// Of a direction that is given: the flight alone is guided, with probability `share`.
    #[inline]
    pub fn given(share: f64, growth: Growth) -> Heading {
        Heading { plain: 1.0 - share, guided: share, escape: 0.0, growth }
    }

    /// Density of the direction over the plain one.
    #[inline]
    pub fn turned(&self) -> f64 {
        self.plain + self.guided + self.escape
    }

    /// How the step goes on in a given direction, and a number that is uniform again, from a uniform one.
    #[inline]
    pub fn choose(&self, u: f64) -> (StepDraw, f64) {
        let (is_guided, u) = choose(u, self.guided / self.turned());
        (if is_guided { StepDraw::Guided } else { StepDraw::Plain }, u)
    }

    /// The distance of the flight, if no boundary ends it.
    #[inline]
    pub fn sample_distance(&self, sigma_t: f64, drawn: StepDraw, u: f64) -> f64 {
        match drawn {
            StepDraw::Plain => sample_exponential(sigma_t, u),
            StepDraw::Guided => {
                let Growth { pull, bend, .. } = self.growth;
                let (rate, u) = if bend > 0.0 { self.growth.choose_rate(u) } else { (1.0 - pull, u) };
                let t = sample_exponential(sigma_t * rate, u);
                let beyond = t - self.growth.fall / sigma_t;
                // With the plain rate the rest of the optical distance takes longer, by 1 - p.
                if self.growth.falls() && beyond > 0.0 { t - pull * beyond } else { t }
            }
            StepDraw::Escape => f64::INFINITY,
        }
    }

    /// Density of direction and flight over the plain one, for a flight that ends in the medium at distance `t`.
    #[inline]
    pub fn flight_ratio(&self, sigma_t: f64, t: f64) -> f64 {
        let (growth, depth) = (self.growth, sigma_t * t);
        let flown = if growth.bend > 0.0 {
            let [up, down] = growth.both(depth);
            growth.density(up, down)
        } else {
            let rate = if growth.falls() && depth > growth.fall { 1.0 } else { 1.0 - growth.pull };
            rate * growth.straight_passage(depth)
        };
        self.plain + self.guided * flown
    }

    /// The same for a flight longer than `t`, with its probability.
    #[inline]
    pub fn passage_ratio(&self, sigma_t: f64, t: f64) -> f64 {
        let escape = if self.escape > 0.0 { self.escape * growth(1.0, sigma_t * t) } else { 0.0 };
        self.plain + self.guided * self.growth.passage(sigma_t * t) + escape
    }
}

/// e^{p depth}; finite, also where the plain flight's probability is 0 in double precision.
#[inline]
fn growth(pull: f64, depth: f64) -> f64 {
    exp((pull * depth).min(MOST_EXPONENT))
}

impl Level {
    /// From the coefficients of f in Legendre polynomials.
    fn new(factor: &[f64], g: f64) -> Level {
        assert!(factor.len() <= TERMS, "{} coefficients: the least growth has but a few", factor.len());
        let mut power = 1.0;
        let convolved: Vec<f64> = factor
            .iter()
            .map(|c| {
                let term = power * c;
                power *= g;
                term
            })
            .collect();
        let linear = factor.get(1).copied().unwrap_or(0.0);
        let even = factor.iter().sum::<f64>() - linear;
        let [factor, norm] = [factor, &convolved].map(Polynomial::of_legendre);
        Level { factor, norm, linear, even }
    }
}

/// Coefficients of f, until the rest is small beside its least value, (1 - b s) / (1 + s) at m = -1. |P_l| <= 1, so that
/// the rest is bounded by the sum of its coefficients, and f stays positive.
fn factor(s: f64, bend: f64, spread: f64) -> Vec<f64> {
    let nu = 1.0 / s;
    // Q_0 = L / 2.
    let first = -bend + (1.0 + bend) * nu * 0.5 * spread;
    let legendre_q = second_kind(nu, 0.5 * spread);
    let coefficient = |l: usize| (1.0 + bend) * nu * (2 * l + 1) as f64 * legendre_q[l];
    let mut rest: f64 = (1..legendre_q.len()).map(coefficient).sum();
    let least = (1.0 - bend * s) / (1.0 + s);
    let mut all = vec![first];
    for l in 1..legendre_q.len() {
        if rest < REST * least {
            break;
        }
        all.push(coefficient(l));
        rest -= coefficient(l);
    }
    all
}

/// The growth per mean free path of diffuse light, s in [0, 1): the root of a tanh^-1(s) = s for a medium that scatters
/// isotropically; with anisotropy g the medium of the same sigma_s (1 - g) and absorption stands for it. The isotropic root
/// is that of transport and not of diffusion: at albedo 0.8 the diffusion root is 9 % larger.
pub fn diffuse_growth(albedo: f64, g: f64) -> f64 {
    let reduced_extinction = 1.0 - albedo * g;
    let a = albedo * (1.0 - g) / reduced_extinction;
    if a >= 1.0 {
        return 0.0;
    }
    if a <= 0.0 {
        return reduced_extinction.min(1.0);
    }
    // tanh^-1(s) / s rises from 1 at s = 0; in y = tanh^-1(s), tanh(y) / y = a.
    let tanh = |y: f64| {
        let e = exp_m1(-2.0 * y);
        -e / (2.0 + e)
    };
    // a y - tanh(y) is negative between 0 and the root and rises through it.
    let value = |y: f64| {
        let t = tanh(y);
        (a * y - t, a - (1.0 - t * t))
    };
    let most = 1.0 / a;
    reduced_extinction
        * tanh(increasing_root(value, 0.0, most, (3.0 * (1.0 - a)).sqrt().max(0.5 * most)))
}

#[cfg(test)]
mod tests;
