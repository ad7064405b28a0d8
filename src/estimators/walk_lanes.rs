//! Guided walks side by side: several paths of a pass are inside the body at the same time, one in each lane, and fly and
//! scatter together. A path that meets the boundary goes on alone until it is inside again, or ends; then its lane takes the
//! next path.
//!
//! ```text
//! next path -> [ meets the body, is reflected, flies outside ] -> lane -> [ flights and turns of all lanes ] -> boundary
//!                      ^                                                          ^                                |
//!                      |                                                          +-> rivals, walk by walk         |
//!                      +-------------------------------------------------------------------------------------------+
//! ```

use std::collections::VecDeque;

use super::{CameraWalk, Later, Onward, Rivals, Unrivalled, Unscattered, flights};
use crate::estimators::bands::{OneBand, WalkBands};
use crate::estimators::field::{Field, Path};
use crate::estimators::guidance::{Guidance, GuidedBand, GuidedLanes, LaneVertex};
use crate::estimators::scores::Contribution;
use crate::estimators::steps::StepRule;
use crate::estimators::vertices::WalkVertex;
use crate::estimators::{Anomaly, Cost, Scores};
use crate::geometry::{Ray, Side};
use crate::optics::guided::LANES;
use crate::sampling::stream::PassKey;

/// A path.
struct LaneWalk<'a, R> {
    index: usize,
    walk: CameraWalk<'a, R, GuidedBand<'a>>,
    later: Option<Later<GuidedBand<'a>>>,
    /// Medium vertices that the rivals have passed and the history of the path does not have yet.
    passed: u64,
}

/// The paths of a pass in one band.
struct Paths<'a, 's, N> {
    /// The rivals of a path.
    rivals: N,
    field: &'a Field,
    band: usize,
    key: &'a PassKey,
    guidance: &'a Guidance,
    /// Index of the first that has not begun, and how many there are.
    next: usize,
    count: usize,
    scores: &'s mut Scores,
    /// Of the paths from this one on, what those that have ended have scored: sums are formed in the order of paths.
    first: usize,
    ended: VecDeque<Option<Vec<Contribution>>>,
    /// Without contributions, to be filled again.
    empty: Vec<Vec<Contribution>>,
}

/// Traces the paths of a pass in one band, without techniques beside unidirectional sampling.
pub(in crate::estimators) fn trace_alone(
    field: &Field,
    band: usize,
    key: &PassKey,
    scores: &mut Scores,
) {
    let guidance = field.guidance(band);
    if let Some(guidance) = guidance.filter(|_| may_fly_side_by_side(field, band)) {
        return trace_side_by_side(field, band, key, guidance, scores, |_| Unrivalled);
    }
    for index in 0..field.scene.sensor.rays_per_pass() {
        let path = Path { field, band, index, key };
        match guidance {
            Some(guidance) => {
                let guided = GuidedBand::new(guidance, &field.scene.medium[band]);
                CameraWalk::trace(path, scores, Unrivalled, guided)
            }
            None => CameraWalk::trace(path, scores, Unrivalled, OneBand),
        };
    }
}

/// Whether guided walks in this band may be traced side by side: inside they only fly, scatter and call rivals.
pub(in crate::estimators) fn may_fly_side_by_side(field: &Field, band: usize) -> bool {
    let scene = &field.scene;
    let medium = &scene.medium[band];
    let is_matched = matches!(scene.boundary[band], super::Boundary::Matched);
    medium.sigma_t > 0.0 && medium.emission == 0.0 && !is_matched && scene.sensor.measure().is_off()
}

/// Traces the paths of a pass in a band of which [`may_fly_side_by_side`] holds, with the scores and counts of
/// [`CameraWalk::trace`] of one after the other.
pub(in crate::estimators) fn trace_side_by_side<R: Rivals>(
    field: &Field,
    band: usize,
    key: &PassKey,
    guidance: &Guidance,
    scores: &mut Scores,
    rivals: impl Fn(&Path) -> R,
) {
    let mut holding: [Scores; LANES] = std::array::from_fn(|_| scores.holding());
    let count = field.scene.sensor.rays_per_pass();
    let (ended, empty) = (VecDeque::new(), Vec::new());
    let mut paths =
        Paths { rivals, field, band, key, guidance, next: 0, count, scores, first: 0, ended, empty };
    let medium = &field.scene.medium[band];
    let rule = StepRule { medium, roulette: field.roulette, survival: medium.albedo };
    let mut lanes = GuidedLanes::new(guidance, rule);
    let mut walks: [Option<LaneWalk<'_, R>>; LANES] = [const { None }; LANES];
    for (lane, holding) in holding.iter_mut().enumerate() {
        let onward = paths.begin(&mut walks[lane], holding);
        paths.go_on(&mut lanes, lane, &mut walks[lane], onward);
    }
    while walks.iter().any(Option::is_some) {
        let shape = &field.scene.shape;
        let any = walks.iter().flatten().next().filter(|_| !R::IS_SILENT);
        let bounds = any.and_then(|any| any.walk.rivals.bounds(shape, lanes.ends()));
        let survives = lanes.scatter(|lane, vertex| {
            if !R::IS_SILENT
                && let Some(walk) = &mut walks[lane]
            {
                walk.call(vertex, bounds.map(|bounds| bounds[lane]));
            }
        });
        let is_clear = shape.are_clear(lanes.flights());
        for lane in 0..LANES {
            if survives[lane] && is_clear[lane] {
                continue;
            }
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
    let Paths { scores, .. } = paths;
    holding.iter().for_each(|holding| scores.add_counts(holding));
}

impl<'a, R: Rivals> CameraWalk<'a, R, GuidedBand<'a>> {
    /// Has come to a medium vertex in a lane, and survived roulette.
    #[inline(never)]
    fn call_from_lane(&mut self, vertex: LaneVertex<'_>) {
        self.ray = vertex.ray();
        [self.throughput, self.survival] = vertex.weights();
        (self.from, self.unscattered) = (None, Unscattered::No);
        self.bands.arrive(vertex);
        self.history.scatter();
        R::call(self);
    }
}

impl<'a, R: Rivals, N: Fn(&Path) -> R> Paths<'a, '_, N> {
    /// Begins the next path, whose scores are held back; leaves nothing where none is left.
    fn begin(&mut self, slot: &mut Option<LaneWalk<'a, R>>, holding: &'a mut Scores) -> Option<Onward> {
        *slot = None;
        if self.next == self.count {
            return None;
        }
        let Paths { field, band, key, guidance, next: index, .. } = *self;
        self.next += 1;
        self.ended.push_back(None);
        let path = Path { field, band, index, key };
        let guided = GuidedBand::new(guidance, &field.scene.medium[band]);
        let walk = CameraWalk::start(path, holding, (self.rivals)(&path), guided);
        let LaneWalk { walk, later, .. } = slot.insert(LaneWalk { index, walk, later: None, passed: 0 });
        walk.meet_body(path, later)
    }

    /// Follows the path of a lane until a flight inside ends in the medium, and the next ones if it ends before; leaves
    /// nothing where no path is left.
    #[inline(never)]
    fn go_on(
        &mut self,
        lanes: &mut GuidedLanes<'a>,
        lane: usize,
        slot: &mut Option<LaneWalk<'a, R>>,
        mut onward: Option<Onward>,
    ) {
        while let Some(walk) = slot {
            if walk.enter(lanes, lane, onward) {
                if self.is_clear(lanes, lane) {
                    return;
                }
                match walk.end_flight(lanes, lane) {
                    FlightEnd::Medium => return,
                    FlightEnd::Elsewhere(next) => onward = next,
                }
            } else if let Some(LaneWalk { index, walk: CameraWalk { scores: holding, .. }, .. }) =
                slot.take()
            {
                self.end(index, holding);
                onward = self.begin(slot, holding);
            }
        }
    }

    /// Whether the flight of a lane surely meets nothing.
    #[inline(always)]
    fn is_clear(&self, lanes: &GuidedLanes<'a>, lane: usize) -> bool {
        let (ray, t, end) = lanes.flight(lane);
        self.field.scene.shape.is_clear(&ray, end, t)
    }

    /// A path has ended.
    fn end(&mut self, index: usize, holding: &mut Scores) {
        let empty = self.empty.pop().unwrap_or_default();
        self.ended[index - self.first] = Some(holding.take_held(empty));
        while let Some(held) = self.ended.front_mut().and_then(Option::take) {
            self.ended.pop_front();
            self.first += 1;
            self.add(held);
        }
    }

    fn add(&mut self, mut held: Vec<Contribution>) {
        self.scores.add_held(&mut held);
        self.empty.push(held);
    }
}

/// Where a flight has ended.
enum FlightEnd {
    Medium,
    /// At the boundary, or nowhere; and where the path goes on from there.
    Elsewhere(Option<Onward>),
}

impl<'a, R: Rivals> LaneWalk<'a, R> {
    /// Calls the rivals at a medium vertex that has survived roulette, with what they know of it. Where they pass it, the walk
    /// itself does not hear of it.
    #[inline(always)]
    fn call(&mut self, vertex: LaneVertex<'_>, bound: Option<f64>) {
        let Ray { origin: point, dir: arrival } = vertex.ray();
        if let Some(bound) = bound
            && self.walk.rivals.passes(&WalkVertex { point, arrival, walks: vertex.ratio() }, bound)
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
    fn enter(&mut self, lanes: &mut GuidedLanes<'a>, lane: usize, mut onward: Option<Onward>) -> bool {
        let LaneWalk { walk, later, .. } = self;
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
    fn end_flight(&mut self, lanes: &mut GuidedLanes<'a>, lane: usize) -> FlightEnd {
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
    fn take_out(&mut self, lanes: &mut GuidedLanes<'a>, lane: usize, flights: u64, vertices: u64) {
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
