//! Steps of several guided walks side by side.
//!
//! A step of a guided walk is a chain of operations of which each needs the one before, so that a processor waits for most of
//! them. Several walks need nothing of each other, and their logarithms, exponentials, sines and roots are computed together,
//! by vector instructions. Every number is that of [`Heading`] and [`GuidedTurns`], to the last bit: operations and their order
//! are the same, and where there are two cases, both are computed.
//!
//! All arrays have one element per walk. Kinds of steps are numbers, so that vectors can compare them.

use std::f64::consts::TAU;

use super::{
    Escape, Growth, GuidedTurns, Heading, IsotropicLevel, LEVELS, Level, Levels, MOST, MOST_EXPONENT,
    Polynomial, Pull, StepGuide, TERMS, side,
};
use crate::math::lanes::{LANES, Lanes, VectorLanes, set_vector, vector};
use crate::math::{
    DVec3, Frame, Vectorized, exp_near, ln_of_normal, renormalized, sin_cos_turns, vectorized,
};
use crate::optics::phase::HenyeyGreenstein;

const ZERO: Lanes = [0.0; LANES];
const NONE: VectorLanes = [ZERO; 3];

/// Kinds of steps ([`super::StepDraw`]).
const PLAIN: f64 = 0.0;
const GUIDED: f64 = 1.0;
const ESCAPE: f64 = 2.0;
/// No step: the walk has ended.
const ENDED: f64 = 3.0;

/// Flights of several walks in one medium, and the turns between them.
#[derive(Clone, Debug)]
pub struct StepLanes {
    sigma_t: f64,
    share: f64,
    /// Mean free paths by which light is carried on.
    carry: f64,
    fall: f64,
    /// Whether any flight has a bend.
    is_bent: bool,
    origins: VectorLanes,
    dirs: VectorLanes,
    /// [`Heading`], of which `plain` is the same everywhere.
    guided: Lanes,
    escape: Lanes,
    pull: Lanes,
    bend: Lanes,
    small: Lanes,
    /// Lengths, if no boundary ends the flights, and where they end then.
    lengths: Lanes,
    ends: VectorLanes,
    /// Density of each walk up to the begin of its flight, over that of a plain one.
    ratios: Lanes,
}

/// What guides steps ([`StepGuide`]).
#[derive(Clone, Debug)]
pub struct GuideLanes {
    /// Unit axes of pulls.
    pub axes: VectorLanes,
    /// Levels of pulls.
    pub levels: [i32; LANES],
    /// Unit normals of escapes.
    pub normals: VectorLanes,
    /// Least cosines of escapes.
    pub least_cosines: Lanes,
    /// Probabilities that guided steps are escapes.
    pub chances: Lanes,
    /// By which importance grows to all sides.
    pub bends: Lanes,
    /// What the levels mean under a product.
    products: ProductLanes,
}

/// How steps are drawn, and the numbers that they are drawn from.
#[derive(Clone, Debug)]
pub struct DrawLanes {
    kinds: Lanes,
    turns: [Lanes; 2],
    /// By which a direction is taken or rejected.
    levels: Lanes,
    flights: Lanes,
}

impl StepLanes {
    /// Without walks, in a medium of extinction `sigma_t` > 0 (1/mm) and with a share of guided steps.
    pub fn new(sigma_t: f64, share: f64, turns: &GuidedTurns, is_bent: bool) -> StepLanes {
        StepLanes {
            sigma_t,
            share,
            carry: turns.carry,
            fall: turns.fall,
            is_bent,
            origins: NONE,
            dirs: NONE,
            guided: ZERO,
            escape: ZERO,
            pull: ZERO,
            bend: ZERO,
            small: ZERO,
            lengths: ZERO,
            ends: NONE,
            ratios: [1.0; LANES],
        }
    }

    /// Puts in a walk that goes on from a point in a given direction, its flight drawn by `u`; `ratio` is its density so far.
    pub fn put(
        &mut self,
        lane: usize,
        [origin, dir]: [DVec3; 2],
        heading: &Heading,
        ratio: f64,
        u: f64,
    ) {
        set_vector(&mut self.origins, lane, origin);
        set_vector(&mut self.dirs, lane, dir);
        let Heading { guided, escape, growth: Growth { pull, bend, share, .. }, .. } = *heading;
        (self.guided[lane], self.escape[lane]) = (guided, escape);
        (self.pull[lane], self.bend[lane], self.small[lane]) = (pull, bend, share);
        self.ratios[lane] = ratio;
        let (drawn, u) = heading.choose(u);
        let length = heading.sample_distance(self.sigma_t, drawn, u);
        self.lengths[lane] = length;
        set_vector(&mut self.ends, lane, origin + dir * length);
    }

    /// Density of a walk up to the begin of its flight, over that of a plain one; and the step that it has begun.
    pub fn state(&self, lane: usize) -> (f64, Heading) {
        let (guided, escape) = (self.guided[lane], self.escape[lane]);
        let growth = Growth {
            pull: self.pull[lane],
            bend: self.bend[lane],
            share: self.small[lane],
            fall: self.fall,
        };
        (self.ratios[lane], Heading { plain: 1.0 - self.share, guided, escape, growth })
    }

    /// Where a walk's flight begins, and its direction.
    #[inline(always)]
    pub fn flight(&self, lane: usize) -> [DVec3; 2] {
        [vector(&self.origins, lane), vector(&self.dirs, lane)]
    }

    /// Where flights begin.
    #[inline(always)]
    pub fn origins(&self) -> &VectorLanes {
        &self.origins
    }

    /// Their directions.
    #[inline(always)]
    pub fn dirs(&self) -> &VectorLanes {
        &self.dirs
    }

    /// How far flights go if no boundary ends them.
    #[inline(always)]
    pub fn lengths(&self) -> &Lanes {
        &self.lengths
    }

    /// Where they end then.
    #[inline(always)]
    pub fn ends(&self) -> &VectorLanes {
        &self.ends
    }

    /// Ends all flights in the medium ([`Heading::flight_ratio`]); returns their densities over those of plain walks.
    #[inline(always)]
    pub fn arrive(&mut self) -> &Lanes {
        vectorized(Arrivals(self));
        &self.ratios
    }

    /// Begins the next flights, behind turns ([`GuidedTurns::sample_mixed`], [`GuidedTurns::heading`],
    /// [`Heading::sample_distance`]). `draw` is for the walks of which more numbers are needed.
    #[inline(always)]
    pub fn depart(
        &mut self,
        turns: &GuidedTurns,
        guides: &mut GuideLanes,
        draws: &mut DrawLanes,
        draw: impl FnMut(usize) -> f64,
    ) {
        match &turns.levels {
            Levels::Isotropic(levels) => {
                let levels = IsotropicLanes::new(levels, guides);
                let pdf = turns.phase.pdf(0.0);
                vectorized(IsotropicDepartures { steps: self, pdf, guides, levels: &levels, draws });
            }
            Levels::Product(levels) => {
                guides.products.set(levels, &guides.levels);
                self.depart_by_product(&turns.phase, guides, draws, draw);
            }
        }
    }

    fn depart_by_product(
        &mut self,
        phase: &HenyeyGreenstein,
        guides: &GuideLanes,
        draws: &mut DrawLanes,
        mut draw: impl FnMut(usize) -> f64,
    ) {
        let dirs = &self.dirs;
        let mut tried = vectorized(FirstTry { phase, dirs, guides, draws });
        for lane in 0..LANES {
            if tried.rejected[lane] > 0.0 {
                let local = guides.products.try_again(phase, &tried, lane, || draw(lane));
                set_vector(&mut tried.locals, lane, local);
            }
            if draws.kinds[lane] != ENDED {
                draws.flights[lane] = draw(lane);
            }
        }
        let mut dirs = vectorized(ToWorld { dirs, locals: &tried.locals });
        for lane in 0..LANES {
            if draws.kinds[lane] == ESCAPE {
                let [u, v] = [draws.turns[0][lane], draws.turns[1][lane]];
                set_vector(&mut dirs, lane, guides.escape(lane).sample([u, v]));
            }
        }
        vectorized(ProductDepartures { steps: self, phase, guides, draws, dirs: &dirs });
    }
}

impl GuideLanes {
    /// None.
    pub fn none() -> GuideLanes {
        GuideLanes {
            axes: NONE,
            levels: [0; LANES],
            normals: NONE,
            least_cosines: ZERO,
            chances: ZERO,
            bends: ZERO,
            products: ProductLanes::none(),
        }
    }

    /// Sets that of one walk.
    pub fn set(&mut self, lane: usize, StepGuide { pull, escape, bend }: &StepGuide) {
        let Pull { axis, level } = *pull;
        set_vector(&mut self.axes, lane, axis);
        self.levels[lane] = level as i32;
        set_vector(&mut self.normals, lane, escape.normal);
        (self.least_cosines[lane], self.chances[lane]) = (escape.least_cosine, escape.chance);
        self.bends[lane] = *bend;
    }

    fn escape(&self, lane: usize) -> Escape {
        let (least_cosine, chance) = (self.least_cosines[lane], self.chances[lane]);
        Escape { normal: vector(&self.normals, lane), least_cosine, chance }
    }
}

impl DrawLanes {
    /// Plain steps.
    pub fn plain() -> DrawLanes {
        DrawLanes { kinds: ZERO, turns: [ZERO; 2], levels: ZERO, flights: ZERO }
    }

    /// Draws how a walk goes on, and the numbers for it.
    #[inline(always)]
    pub fn draw(
        &mut self,
        lane: usize,
        turns: &GuidedTurns,
        share: f64,
        guides: &GuideLanes,
        mut draw: impl FnMut() -> f64,
    ) {
        let chance = guides.chances[lane];
        let kind = if draw() >= share {
            PLAIN
        } else if chance > 0.0 && draw() < chance {
            ESCAPE
        } else {
            GUIDED
        };
        self.kinds[lane] = kind;
        (self.turns[0][lane], self.turns[1][lane]) = (draw(), draw());
        match turns.levels {
            Levels::Isotropic(_) => self.flights[lane] = draw(),
            Levels::Product(_) if kind == GUIDED && guides.levels[lane] > 0 => {
                self.levels[lane] = draw()
            }
            Levels::Product(_) => {}
        }
    }

    /// A walk has ended: its next step, of no meaning, draws no numbers.
    #[inline(always)]
    pub fn end(&mut self, lane: usize) {
        self.kinds[lane] = ENDED;
    }
}

/// s of each level.
#[inline(always)]
pub fn strengths(levels: [i32; LANES]) -> Lanes {
    const STEP: f64 = 1.0 / (LEVELS - 1) as f64;
    let mut strengths = ZERO;
    for lane in 0..LANES {
        let part = f64::from(levels[lane]) * STEP;
        strengths[lane] = MOST * (part * part);
    }
    strengths
}

/// [`IsotropicLevel`]; without a pull, every direction has the ratio 1.
struct IsotropicLanes {
    spread: Lanes,
    reach: Lanes,
    norm: Lanes,
}

impl IsotropicLanes {
    #[inline(always)]
    fn new(levels: &[IsotropicLevel], guides: &GuideLanes) -> IsotropicLanes {
        let mut lanes = IsotropicLanes { spread: ZERO, reach: ZERO, norm: ZERO };
        for (lane, &level) in guides.levels.iter().enumerate() {
            let IsotropicLevel { spread, reach, norm, .. } = levels[level as usize];
            lanes.spread[lane] = spread;
            lanes.reach[lane] = reach;
            lanes.norm[lane] = if level > 0 { norm } else { 1.0 };
        }
        lanes
    }
}

/// [`Level`], coefficient by coefficient.
#[derive(Clone, Debug)]
struct ProductLanes {
    /// Which levels these are.
    numbers: [i32; LANES],
    factor: [Lanes; TERMS],
    norm: [Lanes; TERMS],
    linear: Lanes,
    even: Lanes,
}

impl ProductLanes {
    fn none() -> ProductLanes {
        let none = [ZERO; TERMS];
        ProductLanes { numbers: [-1; LANES], factor: none, norm: none, linear: ZERO, even: ZERO }
    }

    /// Sets those of all walks. A walk often keeps its level from one step to the next.
    #[inline(always)]
    fn set(&mut self, levels: &[Level], numbers: &[i32; LANES]) {
        for lane in 0..LANES {
            if self.numbers[lane] == numbers[lane] {
                continue;
            }
            self.numbers[lane] = numbers[lane];
            let Level { factor, norm, linear, even } = &levels[numbers[lane] as usize];
            for term in 0..TERMS {
                self.factor[term][lane] = factor.0[term];
                self.norm[term][lane] = norm.0[term];
            }
            (self.linear[lane], self.even[lane]) = (*linear, *even);
        }
    }

    #[inline(always)]
    fn polynomial(of_terms: &[Lanes; TERMS], lane: usize) -> Polynomial {
        let [a, b, c, d, e, f, g, h] = of_terms;
        Polynomial([a[lane], b[lane], c[lane], d[lane], e[lane], f[lane], g[lane], h[lane]])
    }

    /// A turn whose first try was rejected, in the frame of its arrival.
    #[inline(always)]
    fn try_again(
        &self,
        phase: &HenyeyGreenstein,
        tried: &Tried,
        lane: usize,
        mut draw: impl FnMut() -> f64,
    ) -> DVec3 {
        let factor = ProductLanes::polynomial(&self.factor, lane);
        let (axis, most) = (vector(&tried.axes, lane), tried.most[lane]);
        loop {
            let local = phase.sample_local([draw(), draw()]);
            if let Some(side) = side(&factor, axis, local, draw() * most) {
                return DVec3::new(side * local.x, side * local.y, local.z);
            }
        }
    }
}

struct Arrivals<'a>(&'a mut StepLanes);

impl Vectorized for Arrivals<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        if self.0.is_bent { self.arrive::<true>() } else { self.arrive::<false>() }
    }
}

impl Arrivals<'_> {
    #[inline(always)]
    fn arrive<const BENT: bool>(self) {
        let Arrivals(steps) = self;
        // Copies: what a reference leads to might be among the results, which would keep the loop from vectors.
        let StepLanes { sigma_t, share, fall, guided, pull, bend, small, lengths, mut ratios, .. } =
            *steps;
        let plain = 1.0 - share;
        for lane in 0..LANES {
            let (pull, bend) = (pull[lane], bend[lane]);
            let growth = if BENT {
                Growth { pull, bend, share: small[lane], fall }
            } else {
                Growth::straight(pull, fall)
            };
            let depth = sigma_t * lengths[lane];
            let is_far = growth.falls() && depth > fall;
            let reach = if is_far { fall } else { depth };
            let exponential = |rate: f64| exp_near((rate * reach).min(MOST_EXPONENT));
            let up = exponential(if BENT { pull + bend } else { pull });
            let down = if BENT { exponential(pull - bend) } else { up };
            let flown = if is_far { up } else { growth.density(up, down) };
            ratios[lane] = (ratios[lane] * (plain + guided[lane] * flown)).min(f64::MAX);
        }
        steps.ratios = ratios;
        steps.origins = steps.ends;
    }
}

struct IsotropicDepartures<'a> {
    steps: &'a mut StepLanes,
    /// Of the phase function.
    pdf: f64,
    guides: &'a GuideLanes,
    levels: &'a IsotropicLanes,
    draws: &'a DrawLanes,
}

impl Vectorized for IsotropicDepartures<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let IsotropicDepartures { steps, pdf, guides, levels, draws } = self;
        let DrawLanes { kinds, turns: [u, v], .. } = draws;
        let IsotropicLanes { spread, reach, norm } = levels;
        let GuideLanes { axes: [ax, ay, az], normals: [nx, ny, nz], least_cosines, levels, .. } = guides;
        let strengths = strengths(*levels);
        let (mut dirs, mut turned, mut pdfs) = (NONE, ZERO, ZERO);
        let [x, y, z] = &mut dirs;
        for lane in 0..LANES {
            let (u, s) = (u[lane], strengths[lane]);
            let is_pulled = kinds[lane] == GUIDED && s > 0.0;
            let is_escape = kinds[lane] == ESCAPE;
            let is_plain = !(is_pulled || is_escape);
            // The distances of the cosine to the two ends of its range.
            let pulled = reach[lane] * (1.0 - exp_near(-spread[lane] * u));
            let in_cone = (1.0 - least_cosines[lane]) * u;
            let (below, above) = (2.0 * (1.0 - u), 2.0 * u);
            let one = if is_pulled { pulled } else { in_cone };
            let one = if is_plain { below } else { one };
            let other = if is_plain { above } else { 2.0 - one };
            let r = (one * other).max(0.0).sqrt();
            let of_plain = if below < above { 1.0 - below } else { above - 1.0 };
            let cosine = if is_pulled { one - 1.0 } else { 1.0 - one };
            let cosine = if is_plain { of_plain } else { cosine };
            let (sin_phi, cos_phi) = sin_cos_turns(v[lane]);
            let local = DVec3::new(r * cos_phi, r * sin_phi, cosine);
            let axis = DVec3::new(ax[lane], ay[lane], az[lane]);
            let normal = DVec3::new(nx[lane], ny[lane], nz[lane]);
            let about = choose(is_escape, normal, axis);
            let world = renormalized(Frame::about(about).to_world(local));
            let to = choose(is_plain, local, world);
            (x[lane], y[lane], z[lane]) = (to.x, to.y, to.z);
            turned[lane] = 1.0 / ((1.0 - s * axis.dot(to)) * norm[lane]);
            pdfs[lane] = pdf;
        }
        steps.begin(guides, draws, &Turned { strengths, dirs, ratios: turned, pdfs });
    }
}

/// What the first try of turns has come to.
struct Tried {
    /// Of pulls, in the frames of arrivals.
    axes: VectorLanes,
    /// Bound of twice the mean factor of two opposite directions.
    most: Lanes,
    /// 1 where none of the two is taken, else 0.
    rejected: Lanes,
    locals: VectorLanes,
}

struct FirstTry<'a> {
    phase: &'a HenyeyGreenstein,
    dirs: &'a VectorLanes,
    guides: &'a GuideLanes,
    draws: &'a DrawLanes,
}

impl Vectorized for FirstTry<'_> {
    type Output = Tried;

    #[inline(always)]
    fn call(self) -> Tried {
        let FirstTry { phase, dirs: [fx, fy, fz], guides, draws } = self;
        let phase = *phase;
        let GuideLanes { axes: [ax, ay, az], levels: numbers, .. } = guides;
        let ProductLanes { factor, linear, even, .. } = &guides.products;
        let DrawLanes { kinds, turns: [u, v], levels, .. } = draws;
        let strengths = strengths(*numbers);
        let mut tried = Tried { axes: NONE, most: ZERO, rejected: ZERO, locals: NONE };
        let ([x, y, z], [bx, by, bz]) = (&mut tried.locals, &mut tried.axes);
        for lane in 0..LANES {
            let from = DVec3::new(fx[lane], fy[lane], fz[lane]);
            let axis = Frame::about(from).to_local(DVec3::new(ax[lane], ay[lane], az[lane]));
            let most = 2.0 * (linear[lane] * axis.z.abs() + even[lane]);
            let local = phase.sample_local([u[lane], v[lane]]);
            let factor = ProductLanes::polynomial(factor, lane);
            let level = levels[lane] * most;
            let across = axis.x * local.x + axis.y * local.y;
            let along = axis.z * local.z;
            let (of_first, of_opposite) = (factor.at(along + across), factor.at(along - across));
            let is_pulled = kinds[lane] == GUIDED && strengths[lane] > 0.0;
            let is_taken = level - of_first < of_opposite;
            let side = if level < of_first || !is_pulled { 1.0 } else { -1.0 };
            (x[lane], y[lane], z[lane]) = (side * local.x, side * local.y, local.z);
            (bx[lane], by[lane], bz[lane]) = (axis.x, axis.y, axis.z);
            tried.most[lane] = most;
            tried.rejected[lane] = if is_pulled && !is_taken { 1.0 } else { 0.0 };
        }
        tried
    }
}

/// Directions in the frames of arrivals.
struct ToWorld<'a> {
    dirs: &'a VectorLanes,
    locals: &'a VectorLanes,
}

impl Vectorized for ToWorld<'_> {
    type Output = VectorLanes;

    #[inline(always)]
    fn call(self) -> VectorLanes {
        let ToWorld { dirs: &[fx, fy, fz], locals: &[lx, ly, lz] } = self;
        let mut dirs = NONE;
        let [x, y, z] = &mut dirs;
        for lane in 0..LANES {
            let frame = Frame::about(DVec3::new(fx[lane], fy[lane], fz[lane]));
            let to = renormalized(frame.to_world(DVec3::new(lx[lane], ly[lane], lz[lane])));
            (x[lane], y[lane], z[lane]) = (to.x, to.y, to.z);
        }
        dirs
    }
}

struct ProductDepartures<'a> {
    steps: &'a mut StepLanes,
    phase: &'a HenyeyGreenstein,
    guides: &'a GuideLanes,
    draws: &'a DrawLanes,
    dirs: &'a VectorLanes,
}

impl Vectorized for ProductDepartures<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let ProductDepartures { steps, phase, guides, draws, dirs } = self;
        let phase = *phase;
        let ([fx, fy, fz], [x, y, z]) = (&steps.dirs, dirs);
        let GuideLanes { axes: [ax, ay, az], levels: numbers, .. } = guides;
        let ProductLanes { factor, norm, .. } = &guides.products;
        let strengths = strengths(*numbers);
        let [mut turned, mut pdfs] = [ZERO; 2];
        for lane in 0..LANES {
            let from = DVec3::new(fx[lane], fy[lane], fz[lane]);
            let to = DVec3::new(x[lane], y[lane], z[lane]);
            let axis = DVec3::new(ax[lane], ay[lane], az[lane]);
            let factor = ProductLanes::polynomial(factor, lane).at(axis.dot(to));
            let norm = ProductLanes::polynomial(norm, lane).at(axis.dot(from));
            turned[lane] = if strengths[lane] > 0.0 { factor / norm } else { 1.0 };
            pdfs[lane] = phase.pdf(from.dot(to));
        }
        steps.begin(guides, draws, &Turned { strengths, dirs: *dirs, ratios: turned, pdfs });
    }
}

/// Directions of the next flights.
struct Turned {
    /// s of the pulls by which they were drawn.
    strengths: Lanes,
    dirs: VectorLanes,
    /// Their densities over those of the phase function, and these.
    ratios: Lanes,
    pdfs: Lanes,
}

impl StepLanes {
    /// Begins flights.
    #[inline(always)]
    fn begin(&mut self, guides: &GuideLanes, draws: &DrawLanes, turned: &Turned) {
        if self.is_bent {
            self.fly::<true>(guides, draws, turned);
        } else {
            self.fly::<false>(guides, draws, turned);
        }
    }

    /// The same for flights that all are straight, or are not: the compiler leaves out what these do not need.
    #[inline(always)]
    fn fly<const BENT: bool>(&mut self, guides: &GuideLanes, draws: &DrawLanes, turned: &Turned) {
        let Turned { strengths, dirs, ratios: turned, pdfs } = turned;
        let StepLanes { sigma_t, share, carry, fall: most, origins: [ox, oy, oz], .. } = *self;
        let GuideLanes {
            axes: [ax, ay, az], normals: [nx, ny, nz], least_cosines, chances, bends, ..
        } = guides;
        let DrawLanes { kinds, flights, .. } = draws;
        let ([x, y, z], fall) = (dirs, most / sigma_t);
        let ([mut guided, mut escape, mut lengths], mut ends) = ([ZERO; 3], NONE);
        let [mut pull, mut bend, mut small] = [ZERO; 3];
        let [ex, ey, ez] = &mut ends;
        for lane in 0..LANES {
            let to = DVec3::new(x[lane], y[lane], z[lane]);
            let axis = DVec3::new(ax[lane], ay[lane], az[lane]);
            let normal = DVec3::new(nx[lane], ny[lane], nz[lane]);
            let (chance, least_cosine) = (chances[lane], least_cosines[lane]);
            let along = strengths[lane] * axis.dot(to);
            guided[lane] = share * turned[lane] * (1.0 - chance);
            let growth = if BENT {
                Growth::new(along, bends[lane], carry, most)
            } else {
                Growth::straight(along, most)
            };
            (pull[lane], bend[lane], small[lane]) = (growth.pull, growth.bend, growth.share);
            let is_inside = normal.dot(to) > least_cosine;
            let of_cone = 1.0 / (TAU * (1.0 - least_cosine));
            let of_cone = if is_inside { of_cone } else { 0.0 };
            escape[lane] = share * chance * of_cone / pdfs[lane];
            let is_guided = kinds[lane] == GUIDED;
            let steering = Growth {
                pull: if is_guided { growth.pull } else { 0.0 },
                bend: if is_guided { growth.bend } else { 0.0 },
                share: if is_guided { growth.share } else { 1.0 },
                fall: most,
            };
            let (rate, u) = steering.choose_rate(flights[lane]);
            let t = -ln_of_normal(1.0 - u) / (sigma_t * rate);
            let beyond = t - fall;
            let slowed = t - steering.pull * beyond;
            let t = if steering.falls() && beyond > 0.0 { slowed } else { t };
            let t = if kinds[lane] == ESCAPE { f64::INFINITY } else { t };
            lengths[lane] = t;
            (ex[lane], ey[lane], ez[lane]) =
                (ox[lane] + to.x * t, oy[lane] + to.y * t, oz[lane] + to.z * t);
        }
        (self.dirs, self.guided, self.escape) = (*dirs, guided, escape);
        (self.pull, self.bend, self.small) = (pull, bend, small);
        (self.lengths, self.ends) = (lengths, ends);
    }
}

#[inline(always)]
fn choose(condition: bool, a: DVec3, b: DVec3) -> DVec3 {
    let of = |a: f64, b: f64| if condition { a } else { b };
    DVec3::new(of(a.x, b.x), of(a.y, b.y), of(a.z, b.z))
}
