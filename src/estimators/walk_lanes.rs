//! Walks side by side: several paths are inside the body at the same time, one in each lane, and fly and scatter
//! together. A path that meets the boundary goes on alone until it is inside again, or ends; then its lane takes the next path,
//! of the same pass or of the next one: only after the last path of the last pass do lanes run empty.
//!
//! ```text
//! next path -> [ meets the body, is reflected, flies outside ] -> lane -> [ flights and turns of all lanes ] -> boundary
//!                      ^                                                          ^                                |
//!                      |                                                          +-> rivals, walk by walk         |
//!                      +-------------------------------------------------------------------------------------------+
//! ```

use std::collections::VecDeque;

use super::{CameraWalk, Later, Onward, Rivals, Unscattered, flights};
use crate::estimators::bands::{OneBand, WalkBands};
use crate::estimators::field::{Field, Path};
use crate::estimators::guidance::{GuidedBand, GuidedLanes};
use crate::estimators::lanes::{LaneVertex, WalkLanes};
use crate::estimators::plain_lanes::PlainLanes;
use crate::estimators::scores::Contribution;
use crate::estimators::steps::StepRule;
use crate::estimators::vertices::WalkVertex;
use crate::estimators::{Anomaly, Cost, Scores};
use crate::geometry::{Ray, Side};
use crate::math::lanes::LANES;
use crate::sampling::stream::PassKey;

/// A path.
struct LaneWalk<'a, R, B> {
    /// Its number among those of all passes.
    number: usize,
    walk: CameraWalk<'a, R, B>,
    /// Medium vertices that the rivals have passed and the history of the path does not have yet.
    passed: u64,
}

/// The paths of some passes in one band, pass after pass.
struct Paths<'a, 's, N, B> {
    /// The rivals of a path.
    rivals: N,
    field: &'a Field,
    band: usize,
    keys: &'a [PassKey],
    /// Of a path at the sensor.
    bands: B,
    /// Number of the first that has not begun, and how many a pass has.
    next: usize,
    per_pass: usize,
    /// Of each pass.
    scores: &'s mut [Scores],
    /// Of the paths from this one on, what those that have ended have scored: sums are formed in the order of paths.
    first: usize,
    ended: VecDeque<Option<Vec<Contribution>>>,
    /// The refracted ray of the first hit of each lane's path, until it is followed: apart from the walk, which moves.
    later: [Option<Later<B>>; LANES],
    /// Without contributions, to be filled again.
    empty: Vec<Vec<Contribution>>,
}

/// Traces the paths of passes in one band, each with the rivals that it is given.
pub(in crate::estimators) fn trace_passes<R: Rivals>(
    field: &Field,
    band: usize,
    keys: &[PassKey],
    scores: &mut [Scores],
    rivals: impl Fn(&Path) -> R,
) {
    let medium = &field.scene.medium[band];
    let rule = StepRule { medium, roulette: field.roulette, survival: medium.albedo };
    match (field.guidance(band), may_fly_side_by_side(field, band)) {
        (Some(guidance), true) => {
            let guided = (GuidedLanes::new(guidance, rule), GuidedBand::new(guidance, medium));
            trace_side_by_side(field, band, keys, scores, rivals, guided);
        }
        (None, true) => {
            trace_side_by_side(field, band, keys, scores, rivals, (PlainLanes::new(rule), OneBand));
        }
        (Some(guidance), false) => {
            trace_one_by_one(field, band, keys, scores, rivals, &GuidedBand::new(guidance, medium));
        }
        (None, false) => trace_one_by_one(field, band, keys, scores, rivals, &OneBand),
    }
}

fn trace_one_by_one<R: Rivals, B: WalkBands>(
    field: &Field,
    band: usize,
    keys: &[PassKey],
    scores: &mut [Scores],
    rivals: impl Fn(&Path) -> R,
    bands: &B,
) {
    for (key, scores) in keys.iter().zip(scores) {
        for index in 0..field.scene.sensor.rays_per_pass() {
            let path = Path { field, band, index, key };
            CameraWalk::trace(path, scores, rivals(&path), bands.clone());
        }
    }
}

/// Whether walks in this band are traced side by side: where inside they only fly, scatter and call rivals, and where it pays.
pub(in crate::estimators) fn may_fly_side_by_side(field: &Field, band: usize) -> bool {
    let scene = &field.scene;
    let medium = &scene.medium[band];
    let is_matched = matches!(scene.boundary[band], super::Boundary::Matched);
    let may =
        medium.sigma_t > 0.0 && medium.emission == 0.0 && !is_matched && scene.sensor.measure().is_off();
    may && (field.guidance(band).is_some()
        || PlainLanes::pay(&scene.shape, field.bounds, medium.sigma_t))
}

/// So many paths keep lanes full for nearly all of the time.
const MANY_PATHS: usize = 2048;

/// How many passes of these bands are traced together, so that walks that fly side by side fill their lanes.
pub(in crate::estimators) fn passes_at_once(field: &Field, bands: &[usize]) -> u64 {
    if bands.iter().any(|&band| may_fly_side_by_side(field, band)) {
        MANY_PATHS.div_ceil(field.scene.sensor.rays_per_pass()) as u64
    } else {
        1
    }
}

/// Traces the paths of passes in a band in lanes, which are still empty, with the scores and counts of [`CameraWalk::trace`] of
/// one after the other.
fn trace_side_by_side<R: Rivals, L: WalkLanes>(
    field: &Field,
    band: usize,
    keys: &[PassKey],
    scores: &mut [Scores],
    rivals: impl Fn(&Path) -> R,
    (mut lanes, bands): (L, L::Bands),
) {
    let Some(first) = scores.first() else { return };
    let mut holding: [Scores; LANES] = std::array::from_fn(|_| first.holding());
    let per_pass = field.scene.sensor.rays_per_pass();
    let mut paths = Paths {
        rivals,
        field,
        band,
        keys,
        bands,
        next: 0,
        per_pass,
        scores,
        first: 0,
        ended: VecDeque::new(),
        later: [const { None }; LANES],
        empty: Vec::new(),
    };
    let mut walks: [Option<LaneWalk<'_, R, L::Bands>>; LANES] = [const { None }; LANES];
    for (lane, holding) in holding.iter_mut().enumerate() {
        let onward = paths.begin(lane, &mut walks[lane], holding);
        paths.go_on(&mut lanes, lane, &mut walks[lane], onward);
    }
    while walks.iter().any(Option::is_some) {
        let shape = &field.scene.shape;
        let any = walks.iter().flatten().next().filter(|_| !R::IS_SILENT);
        let bounds = any.and_then(|any| any.walk.rivals.bounds(shape, lanes.flights().ends));
        let survives = lanes.scatter(|lane, vertex| {
            if !R::IS_SILENT
                && let Some(walk) = &mut walks[lane]
            {
                walk.call(vertex, bounds.map(|bounds| bounds[lane]));
            }
        });
        let is_clear = shape.are_clear(lanes.flights());
        let mut others = lanes_that(|lane| !(survives[lane] && is_clear[lane]));
        while others != 0 {
            let lane = others.trailing_zeros() as usize;
            others &= others - 1;
            let Some(walk) = &mut walks[lane] else { continue };
            let onward = if survives[lane] {
                match walk.end_flight(&mut lanes, lane) {
                    FlightEnd::Medium => continue,
                    FlightEnd::Elsewhere(onward) => onward,
                }
            } else {
                let vertices = lanes.begun(lane) - 1;
                walk.take_out(&mut lanes, lane, vertices, vertices);
                None
            };
            paths.go_on(&mut lanes, lane, &mut walks[lane], onward);
        }
    }
}

/// A bit of each lane.
#[inline(always)]
fn lanes_that(is_one: impl Fn(usize) -> bool) -> u32 {
    (0..LANES).fold(0, |all, lane| all | u32::from(is_one(lane)) << lane)
}

impl<R: Rivals, B: WalkBands> CameraWalk<'_, R, B> {
    /// Has come to a medium vertex in a lane, and survived roulette.
    #[inline(never)]
    fn call_from_lane(&mut self, vertex: LaneVertex<'_>) {
        self.ray = vertex.ray();
        [self.throughput, self.survival] = *vertex.weights;
        (self.from, self.unscattered) = (None, Unscattered::No);
        self.bands.arrive(vertex.ratio);
        self.history.scatter();
        R::call(self);
    }
}

impl<'a, R: Rivals, N: Fn(&Path) -> R, B: WalkBands> Paths<'a, '_, N, B> {
    /// Begins the next path, whose scores are held back; leaves nothing where none is left.
    fn begin(
        &mut self,
        lane: usize,
        slot: &mut Option<LaneWalk<'a, R, B>>,
        holding: &'a mut Scores,
    ) -> Option<Onward> {
        *slot = None;
        let Paths { field, band, keys, next: number, per_pass, .. } = *self;
        let key = keys.get(number / per_pass)?;
        self.next += 1;
        self.ended.push_back(None);
        let path = Path { field, band, index: number % per_pass, key };
        let walk = CameraWalk::start(path, holding, (self.rivals)(&path), self.bands.clone());
        let LaneWalk { walk, .. } = slot.insert(LaneWalk { number, walk, passed: 0 });
        walk.meet_body(path, &mut self.later[lane])
    }

    /// Follows the path of a lane until a flight inside ends in the medium, and the next ones if it ends before; leaves
    /// nothing where no path is left.
    #[inline(never)]
    fn go_on(
        &mut self,
        lanes: &mut impl WalkLanes<Bands = B>,
        lane: usize,
        slot: &mut Option<LaneWalk<'a, R, B>>,
        mut onward: Option<Onward>,
    ) {
        while let Some(walk) = slot {
            if walk.enter(lanes, lane, &mut self.later[lane], onward) {
                if self.is_clear(lanes, lane) {
                    return;
                }
                match walk.end_flight(lanes, lane) {
                    FlightEnd::Medium => return,
                    FlightEnd::Elsewhere(next) => onward = next,
                }
            } else if let Some(LaneWalk { number, walk: CameraWalk { scores: holding, .. }, .. }) =
                slot.take()
            {
                self.end(number, holding);
                onward = self.begin(lane, slot, holding);
            }
        }
    }

    /// Whether the flight of a lane surely meets nothing.
    #[inline(always)]
    fn is_clear(&self, lanes: &impl WalkLanes<Bands = B>, lane: usize) -> bool {
        let (ray, t, end) = lanes.flight(lane);
        self.field.scene.shape.is_clear(&ray, end, t)
    }

    /// A path has ended.
    fn end(&mut self, number: usize, holding: &mut Scores) {
        let empty = self.empty.pop().unwrap_or_default();
        self.scores[number / self.per_pass].take_counts(holding);
        self.ended[number - self.first] = Some(holding.take_held(empty));
        while let Some(mut held) = self.ended.front_mut().and_then(Option::take) {
            self.ended.pop_front();
            self.scores[self.first / self.per_pass].add_held(&mut held);
            self.first += 1;
            self.empty.push(held);
        }
    }
}

/// Where a flight has ended.
enum FlightEnd {
    Medium,
    /// At the boundary, or nowhere; and where the path goes on from there.
    Elsewhere(Option<Onward>),
}

impl<R: Rivals, B: WalkBands> LaneWalk<'_, R, B> {
    /// Calls the rivals at a medium vertex that has survived roulette, with what they know of it. Where they pass it, the walk
    /// itself does not hear of it.
    #[inline(always)]
    fn call(&mut self, vertex: LaneVertex<'_>, bound: Option<f64>) {
        let Ray { origin: point, dir: arrival } = vertex.ray();
        if let Some(bound) = bound
            && self.walk.rivals.passes(&WalkVertex { point, arrival, walks: vertex.ratio }, bound)
        {
            self.passed += 1;
        } else {
            self.catch_up();
            self.walk.call_from_lane(vertex);
        }
    }

    /// Tells the history of the vertices that were passed.
    #[inline]
    fn catch_up(&mut self) {
        self.walk.history.scatter_often(std::mem::take(&mut self.passed));
    }

    /// Follows the path outside until it is inside, and puts it into its lane; false where it has ended.
    fn enter(
        &mut self,
        lanes: &mut impl WalkLanes<Bands = B>,
        lane: usize,
        later: &mut Option<Later<B>>,
        mut onward: Option<Onward>,
    ) -> bool {
        let walk = &mut self.walk;
        while let Some(Onward { from, side }) = onward.or_else(|| walk.follow_refraction(later)) {
            if side == Side::Inside {
                walk.bands.enter(from.point, from.normal, walk.ray.dir);
                R::depart(walk);
                let weights = [walk.throughput, walk.survival];
                lanes.put(lane, &walk.bands, &walk.ray, weights, &walk.stream);
                return true;
            }
            onward = walk.follow(Onward { from, side });
        }
        false
    }

    /// Ends a flight that may have met the boundary. Where it has, the path leaves its lane, and meets the boundary.
    #[inline(never)]
    fn end_flight(&mut self, lanes: &mut impl WalkLanes<Bands = B>, lane: usize) -> FlightEnd {
        let walk = &mut self.walk;
        let (ray, t, _) = lanes.flight(lane);
        let from = walk.from.filter(|_| lanes.begun(lane) == 1);
        let hit = walk.scene.shape.end_of_unclear(&ray, from, t);
        if hit.is_none() && t < f64::INFINITY && !flights::is_lost(walk.bounds, ray.at(t)) {
            return FlightEnd::Medium;
        }
        let begun = lanes.begun(lane);
        self.take_out(lanes, lane, begun, begun - 1);
        let walk = &mut self.walk;
        let Some(hit) = hit else {
            // A path may fly to infinity in a half-space; in a finite body the ray is lost.
            if walk.bounds.is_some() {
                walk.scores.note(Anomaly::LostRay);
            }
            return FlightEnd::Elsewhere(None);
        };
        [walk.throughput, walk.survival] = lanes.state(lane, &mut walk.bands);
        walk.ray = ray;
        walk.bands.flight(&walk.scene.medium, hit.t, false);
        let side = walk.cross(&hit, Side::Inside);
        FlightEnd::Elsewhere(side.map(|side| Onward { from: hit, side }))
    }

    /// Takes the path out of its lane, where it has made so many flights, of which these have ended in the medium.
    fn take_out(
        &mut self,
        lanes: &mut impl WalkLanes<Bands = B>,
        lane: usize,
        flights: u64,
        vertices: u64,
    ) {
        let walk = &mut self.walk;
        walk.stream = lanes.take(lane);
        walk.scores.count_many(Cost::Rays, flights);
        walk.scores.count_many(Cost::MediumEvents, vertices);
        if vertices > 0 {
            (walk.from, walk.unscattered) = (None, Unscattered::No);
            // Rivals are called with the history of each vertex.
            if R::IS_SILENT {
                walk.history.scatter_often(vertices);
            }
        }
        self.catch_up();
    }
}
