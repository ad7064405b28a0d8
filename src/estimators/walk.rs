//! A camera walk through the body, with optional techniques beside unidirectional sampling.
//!
//! The walk is that of [`super::path`]; an estimator that adds techniques implements [`Rivals`]: it is
//! called at every medium vertex, and states at every exit how densely its techniques draw the same
//! path. Weights are those of the balance heuristic over all techniques. Their densities are written
//! relative to U, the density with which the walk draws its medium vertices and the flight to the exit,
//! so that U itself, which underflows in thick media, is never formed: a light sample has density p_L, a
//! BSDF sample p_B, a rival p_R / U. Russian roulette is not part of any density: each walk divides by its
//! survival probability, and weights without roulette still sum to 1.
//!
//! Emission. No other technique samples the emission of the medium along a flight. Each flight inside
//! therefore scores, from its vertex to the boundary and independently of the distance drawn,
//!   throughput * emission (1 - e^(-sigma_t t_b)) / sigma_t,
//! where t_b is the distance of the boundary. This is the mean over the drawn distance both of the collision
//! estimator (emission / sigma_t) and of the track-length estimator (emission times length), and it is exact
//! for a ray that is not scattered. It is radiance inside; the throughput contains the factor 1 / eta^2 of
//! leaving the body.

use super::bands::{ScorePlace, WalkBands};
use super::choice::choose_light;
use super::crossing::{other, radiance_scale};
use super::field::Path;
use super::roulette::Roulette;
use super::vertices::{Unscattered, WalkExit};
use super::{Anomaly, Cost, History, Scores, TransportClass};
use crate::geometry::{BoundingSphere, FaceId, Hit, Ray, Side};
use crate::math::{DVec3, Frame};
use crate::optics::boundary::{Boundary, BoundarySample, Event, FACETS_FROM_OUTSIDE};
use crate::optics::medium::Medium;
use crate::sampling::distance::transmittance;
use crate::sampling::stream::{Purpose, Stream};
use crate::scene::Scene;
use crate::scene::sensor::PathMeasure;

#[cfg(test)]
pub(super) use lanes::may_fly_side_by_side;
pub(super) use lanes::{passes_at_once, trace_passes};
pub(super) use rivals::{DensitySum, LookingRay, Meeting, Rivals, Unrivalled};

/// How the path's current direction was drawn, as light sampling sees it.
#[derive(Clone, Copy)]
enum DirectionDraw {
    /// Only this way: by the sensor or a delta lobe.
    Alone,
    /// Also by light sampling, in competition with this density per solid angle.
    Competing(f64),
    /// The same, by a rough surface, from `wo` to `wi` in its frame. The density is asked where the path meets a light: most
    /// directions lead to another point of the surface, and theirs would be computed for nothing.
    Surface { wo: DVec3, wi: DVec3 },
}

/// A light and a direction to it, drawn by light sampling.
#[derive(Clone, Copy)]
struct LightDraw {
    /// Index of the light.
    index: usize,
    /// Probability of choosing it.
    choice: f64,
    wi: DVec3,
    /// Density of the direction per solid angle; none of parallel light.
    pdf: Option<f64>,
}

/// Where a path has met the boundary, and on which side it goes on.
#[derive(Clone, Copy)]
struct Onward {
    from: Hit,
    side: Side,
}

/// The refracted ray of a first hit, with the state of the path there: what following the reflected ray first would change.
struct Later<B> {
    at: (Hit, Frame, DVec3, BoundarySample),
    path: (Ray, Option<FaceId>, Option<WalkExit>),
    weights: [f64; 2],
    events: (History, PathMeasure),
    bands: B,
}

/// State of one path that is traced from the sensor.
pub(super) struct CameraWalk<'a, R, B> {
    pub scene: &'a Scene,
    choice: &'a [f64],
    roulette: Roulette,
    bounds: Option<BoundingSphere>,
    pub boundary: Boundary,
    pub medium: Medium,
    pub band: usize,
    slot: usize,
    pub ray: Ray,
    from: Option<FaceId>,
    pub throughput: f64,
    /// Share of the next [`Rivals::look`] in the mean over all sensor rays of this walk.
    pub look_share: f64,
    /// The throughput without radiance's eta^2, which roulette compares with its threshold.
    survival: f64,
    pub history: History,
    /// The score of a sensor of path lengths.
    measure: PathMeasure,
    drawn: DirectionDraw,
    exit: Option<WalkExit>,
    unscattered: Unscattered,
    /// The medium emits in a band that the walk scores.
    emits: bool,
    stream: Stream,
    light_stream: Stream,
    pub scores: &'a mut Scores,
    pub rivals: R,
    pub bands: B,
}

impl<'a, R: Rivals, B: WalkBands> CameraWalk<'a, R, B> {
    /// Traces a path; returns how many numbers its walk drew.
    pub(super) fn trace(path: Path<'a>, scores: &'a mut Scores, rivals: R, bands: B) -> u64 {
        let mut walk = CameraWalk::start(path, scores, rivals, bands);
        let mut later = None;
        let mut onward = walk.meet_body(path, &mut later);
        while let Some(from) = onward.or_else(|| walk.follow_refraction(&mut later)) {
            onward = walk.follow(from);
        }
        walk.stream.draws()
    }

    /// Traces the last two segments in the medium alone: the sensor's ray is the arrival at x_i, the
    /// next flight must end in the medium, the one after it at the boundary, and what leaves there must
    /// meet a light.
    pub(super) fn trace_two_bounces(
        path: Path<'a>,
        scores: &'a mut Scores,
        rivals: R,
        bands: B,
    ) -> Option<()> {
        let mut walk = CameraWalk::start(path, scores, rivals, bands);
        walk.history.scatter();
        R::call(&mut walk);
        walk.turn();
        let t = walk.flight();
        if walk.scene.shape.intersect(&walk.ray, Side::Inside, None, t).is_some() {
            return None;
        }
        walk.arrive(t)?;
        walk.turn();
        let t = walk.flight();
        let hit = walk.scene.shape.intersect(&walk.ray, Side::Inside, None, t)?;
        walk.bands.flight(&walk.scene.medium, hit.t, false);
        if walk.cross(&hit, Side::Inside)? == Side::Outside {
            walk.fly_outside();
        }
        Some(())
    }

    fn start(path: Path<'a>, scores: &'a mut Scores, rivals: R, bands: B) -> CameraWalk<'a, R, B> {
        let Path { field, band, index, key } = path;
        let scene = &*field.scene;
        let mut sensor_stream = key.stream(index as u64, Purpose::Sensor);
        let [a, b] = sensor_stream.draw2();
        let [c, d] = sensor_stream.draw2();
        let start = scene.sensor.ray(index, [a, b, c, d]);
        scores.count(Cost::Paths);
        CameraWalk {
            scene,
            choice: &field.choice[band],
            roulette: field.roulette,
            bounds: field.bounds,
            boundary: scene.boundary[band],
            medium: scene.medium[band],
            band,
            slot: start.slot,
            ray: start.ray,
            from: None,
            throughput: start.weight,
            look_share: 1.0,
            survival: 1.0,
            history: History::default(),
            measure: scene.sensor.measure(),
            drawn: DirectionDraw::Alone,
            exit: None,
            unscattered: Unscattered::No,
            emits: bands.emits(&scene.medium, band),
            stream: key.stream(index as u64, Purpose::Walk),
            light_stream: key.stream(index as u64, Purpose::Light),
            scores,
            rivals,
            bands,
        }
    }

    /// Scores lights that are seen without scattering at further rays of the sensor. This takes one or two rays, where a
    /// walk takes many, and reduces variance, because a single ray either sees a small light or misses it. All sensor
    /// rays, the first ray of the walk included, have equal shares of the mean.
    fn look_around(&mut self, path: Path<'_>) {
        let views = self.rivals.views();
        if views == 1 || self.matched() || !self.boundary.is_delta() {
            return;
        }
        let own = (self.slot, self.ray, self.throughput);
        let mut stream = path.key.stream(path.index as u64, Purpose::View);
        self.look_share = 1.0 / f64::from(views);
        for _ in 1..views {
            let [a, b] = stream.draw2();
            let [c, d] = stream.draw2();
            let start = self.scene.sensor.ray(path.index, [a, b, c, d]);
            (self.slot, self.ray, self.throughput) = (start.slot, start.ray, start.weight);
            self.scores.count(Cost::Rays);
            let Some(hit) = self.scene.shape.intersect(&self.ray, Side::Outside, None, f64::INFINITY)
            else {
                continue;
            };
            let frame = Frame::about(hit.shading_normal);
            let wo = frame.to_local(-self.ray.dir);
            if wo.z > 0.0 {
                R::look(self, LookingRay::Further, &hit, &frame, wo);
            } else {
                self.scores.note(Anomaly::WrongSide);
            }
        }
        (self.slot, self.ray, self.throughput) = own;
    }

    /// Finds where the path first meets the body; returns how it goes on there, and leaves in `later` what it goes on with once
    /// that has ended. Light that has not met the body is not scored.
    fn meet_body(&mut self, path: Path<'_>, later: &mut Option<Later<B>>) -> Option<Onward> {
        self.look_around(path);
        self.scores.count(Cost::Rays);
        let hit = self.scene.shape.intersect(&self.ray, Side::Outside, None, f64::INFINITY)?;
        match self.bands.facets().filter(|_| !self.matched()) {
            Some(facets) => self.follow_reflection(hit, facets, later),
            None => Some(Onward { side: self.cross(&hit, Side::Outside)?, from: hit }),
        }
    }

    /// Goes on from the boundary to where the path meets it again; `None` where it ends.
    #[inline]
    fn follow(&mut self, Onward { from, side }: Onward) -> Option<Onward> {
        let from = match side {
            Side::Inside => self.walk_inside(&from)?,
            Side::Outside => self.fly_outside()?,
        };
        Some(Onward { side: self.cross(&from, side)?, from })
    }

    /// At a first hit, goes on with the reflected ray, and leaves the refracted one to [`Self::follow_refraction`], each
    /// with its share of the weight. Reflection usually takes one ray, a walk inside takes many. Choosing one of the two at
    /// random would cause more variance than guided walks do.
    fn follow_reflection(
        &mut self,
        hit: Hit,
        facets: usize,
        later: &mut Option<Later<B>>,
    ) -> Option<Onward> {
        let (frame, wo) = self.meet(&hit, Side::Outside)?;
        let [reflection, refraction] =
            self.boundary.sample_both(wo, self.stream.draw3(), facets.min(FACETS_FROM_OUTSIDE));
        *later = refraction.map(|sample| Later {
            at: (hit, frame, wo, sample),
            path: (self.ray, self.from, self.exit),
            weights: [self.throughput, self.survival],
            events: (self.history, self.measure),
            bands: self.bands.clone(),
        });
        let side = self.leave(&hit, Side::Outside, (&frame, wo), reflection?)?;
        Some(Onward { from: hit, side })
    }

    /// Once the reflected ray of a first hit has been followed, goes on with the refracted one.
    fn follow_refraction(&mut self, later: &mut Option<Later<B>>) -> Option<Onward> {
        let Later { at: (hit, frame, wo, sample), path, weights, events, bands } = later.take()?;
        (self.ray, self.from, self.exit) = path;
        [self.throughput, self.survival] = weights;
        (self.history, self.measure) = events;
        self.bands = bands;
        let side = self.leave(&hit, Side::Outside, (&frame, wo), sample)?;
        Some(Onward { from: hit, side })
    }

    /// Flies and scatters in the medium until the path meets the boundary or ends.
    fn walk_inside(&mut self, entry: &Hit) -> Option<Hit> {
        self.bands.enter(entry.point, entry.normal, self.ray.dir);
        if !self.matched() {
            R::depart(self);
        }
        // A medium vertex takes roulette and a turn alone.
        if R::IS_SILENT && !self.matched() && !self.emits && self.measure.is_off() {
            return self.fly_silently();
        }
        loop {
            let t = self.flight();
            match self.end_of_flight(t) {
                Some(hit) => {
                    let drawn_before = self.bands.density();
                    self.bands.flight(&self.scene.medium, hit.t, false);
                    self.rivals.reached(hit.t);
                    if let (DirectionDraw::Competing(pdf), true) = (self.drawn, self.matched()) {
                        let through = transmittance(self.medium.sigma_t, hit.t);
                        let guided = self.bands.density() / drawn_before;
                        self.drawn = DirectionDraw::Competing(pdf * through * guided);
                    }
                    self.measure.fly(&self.ray, hit.t);
                    return Some(hit);
                }
                None if t == f64::INFINITY => {
                    // Without extinction, a path may fly to infinity in a half-space; in a finite body the ray is lost.
                    if self.bounds.is_some() {
                        self.scores.note(Anomaly::LostRay);
                    }
                    return None;
                }
                None => self.scatter(t)?,
            }
        }
    }

    /// The length of the next flight in the medium, if no boundary ends it.
    #[inline]
    fn flight(&mut self) -> f64 {
        self.scores.count(Cost::Rays);
        self.bands.draw_flight(&self.medium, self.stream.draw())
    }

    /// Where the boundary ends a flight of length `t`, if it does. Scores the emission of the medium up to the
    /// boundary; for this the boundary is found however far it is.
    #[inline]
    fn end_of_flight(&mut self, t: f64) -> Option<Hit> {
        let shape = &self.scene.shape;
        if !self.emits {
            return shape.end_of_flight(&self.ray, self.from, t);
        }
        let hit = shape.intersect(&self.ray, Side::Inside, self.from, f64::INFINITY);
        if hit.is_none() && self.bounds.is_some() {
            return None; // a lost ray, which `arrive` counts
        }
        let reach = hit.map_or(f64::INFINITY, |hit| hit.t);
        // Emission has no point of entry: it counts in no ring, but in the slot of the ray.
        let (slot, band, light) = (self.slot, self.band, self.scene.lights.len());
        let place = ScorePlace { slot, band, class: self.history.class(), light };
        let factor = self.throughput / self.bands.density();
        self.bands.score_emission(self.scores, place, &self.scene.medium, reach, factor);
        hit.filter(|hit| hit.t <= t)
    }

    /// A scattering event at distance `t`; `None` where the path ends.
    fn scatter(&mut self, t: f64) -> Option<()> {
        self.arrive(t)?;
        self.turn();
        Some(())
    }

    /// A new medium vertex at distance `t`, with the connections from it; `None` where the path ends.
    #[inline]
    fn arrive(&mut self, t: f64) -> Option<()> {
        self.measure.fly(&self.ray, t);
        self.ray.origin = self.ray.at(t);
        self.from = None;
        self.unscattered = Unscattered::No;
        if flights::is_lost(self.bounds, self.ray.origin) {
            self.scores.note(Anomaly::LostRay);
            return None;
        }
        self.scores.count(Cost::MediumEvents);
        self.bands.flight(&self.scene.medium, t, true);
        self.survive(self.bands.survival(&self.medium))?;
        self.history.scatter();
        R::call(self);
        if self.matched() {
            self.connect_from_medium();
        }
        Some(())
    }

    /// A new direction at a medium vertex.
    #[inline]
    fn turn(&mut self) {
        let arrival = self.ray.dir;
        let dir = self.bands.draw_turn(&self.medium, &self.ray, &mut self.stream);
        let drawn = self.set_out(dir);
        if self.matched() {
            self.drawn = DirectionDraw::Competing(self.medium.phase.pdf(arrival.dot(dir)) * drawn);
        }
    }

    /// Leaves the medium vertex in a direction; returns the density with which the walk draws it, over that of the phase function.
    #[inline]
    fn set_out(&mut self, dir: DVec3) -> f64 {
        let Ray { origin, dir: arrival } = self.ray;
        let drawn_before = self.bands.density();
        self.bands.turn(&self.scene.medium, origin, arrival, dir);
        R::turned(self, dir, drawn_before);
        self.ray.dir = dir;
        self.bands.density() / drawn_before
    }

    /// Multiplies the path's weight by `factor`, or ends the path by roulette.
    #[inline]
    fn survive(&mut self, factor: f64) -> Option<()> {
        let importance = || self.bands.importance(self.ray.origin);
        let weights = [&mut self.throughput, &mut self.survival];
        self.roulette.survive(weights, factor, importance, &mut self.stream)
    }

    /// Continues outside; scores the lights where nothing occludes them.
    fn fly_outside(&mut self) -> Option<Hit> {
        self.scores.count(Cost::Rays);
        let hit = self.scene.shape.intersect(&self.ray, Side::Outside, self.from, f64::INFINITY);
        match &hit {
            Some(hit) => self.rivals.reached(hit.t),
            None => self.score_escape(),
        }
        hit
    }

    /// Meets the boundary from `side`; returns the side on which the path continues, `None` where it
    /// ends.
    fn cross(&mut self, hit: &Hit, side: Side) -> Option<Side> {
        if self.matched() {
            self.arrive_at(hit, side);
            return Some(other(side)); // direction and competition stay as they are
        }
        let (frame, wo) = self.meet(hit, side)?;
        let u = self.stream.draw3();
        let sample = if let Some(facets) = self.bands.facets() {
            let gain = if side == Side::Inside { self.bands.gain_of_leaving(hit.point) } else { 1.0 };
            self.boundary.sample_of_several(wo, u, gain, facets)?
        } else {
            self.boundary.sample(wo, u)?
        };
        self.leave(hit, side, (&frame, wo), sample)
    }

    /// Moves the path to a point of the boundary.
    #[inline]
    fn arrive_at(&mut self, hit: &Hit, side: Side) {
        self.from = Some(hit.face);
        self.measure.meet(side);
        self.ray.origin = hit.point;
    }

    /// Meets a boundary that reflects or refracts: scores light samples there, and returns the path's direction in the
    /// frame of the shading normal. `None` where the path ends.
    fn meet(&mut self, hit: &Hit, side: Side) -> Option<(Frame, DVec3)> {
        self.arrive_at(hit, side);
        self.scores.count(Cost::BoundaryEvents);
        let frame = Frame::about(hit.shading_normal);
        let local = frame.to_local(-self.ray.dir);
        self.exit = (side == Side::Inside).then_some(WalkExit { hit: *hit, frame, wo: local });
        if (local.z > 0.0) != (side == Side::Outside) {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        if !self.boundary.is_delta() {
            self.connect_from_surface(hit, &frame, local);
        } else if side == Side::Outside {
            R::look(self, LookingRay::Own, hit, &frame, local);
            self.look_share = 1.0;
        }
        Some((frame, local))
    }

    /// Leaves the boundary in a direction that was sampled for `wo` in this frame; returns the side on which the path
    /// continues.
    fn leave(
        &mut self,
        hit: &Hit,
        side: Side,
        (frame, wo): (&Frame, DVec3),
        sample: BoundarySample,
    ) -> Option<Side> {
        let dir = frame.to_world(sample.wi);
        let next_side = if sample.event == Event::Refract { other(side) } else { side };
        if (dir.dot(hit.normal) > 0.0) != (next_side == Side::Outside) {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        self.unscattered = match (side, sample.event, self.unscattered) {
            _ if !self.boundary.is_delta() => Unscattered::No,
            (Side::Outside, Event::Reflect, _) => Unscattered::Reflected,
            (Side::Outside, Event::Refract, _) => Unscattered::Inside,
            (Side::Inside, Event::Refract, Unscattered::Inside) => Unscattered::Through,
            _ => Unscattered::No,
        };
        if sample.event == Event::Reflect && side == Side::Inside {
            self.history.reflect_internally();
        }
        self.throughput *= sample.weight;
        self.survival *= sample.weight * radiance_scale(side, next_side, &self.boundary);
        self.ray.dir = dir;
        self.drawn = if self.boundary.is_delta() {
            DirectionDraw::Alone
        } else {
            DirectionDraw::Surface { wo, wi: sample.wi }
        };
        Some(next_side)
    }

    /// Scores every light in the direction of a path that leaves the scene.
    fn score_escape(&mut self) {
        let class = self.history.class();
        for (index, light) in self.scene.lights.iter().enumerate() {
            let (radiance, pdf) = light.eval(self.band, self.ray.dir);
            if radiance > 0.0 && !R::is_expected(self, self.unscattered, index, self.ray.dir) {
                let rivals = self.rival_densities(index, self.ray.dir);
                let extra_turns = R::extra_turns(self);
                let walks = self.bands.density() * (1.0 + extra_turns);
                let [bsdf, by_light] = self.taking_part();
                if bsdf == 0.0 {
                    continue;
                }
                let by_light = match self.drawn {
                    DirectionDraw::Alone => 0.0,
                    _ => by_light * (self.choice[index] * pdf),
                };
                // What nothing competes with has weight 1, without its density, which costs as much as the meeting itself.
                let (own, sum) = if by_light == 0.0 && rivals == 0.0 {
                    (1.0, walks)
                } else {
                    let own = self.own_density();
                    (own, walks * (own + by_light) + rivals)
                };
                if rivals > 0.0 || extra_turns > 0.0 {
                    let extra_turns = self.bands.density() * extra_turns * (own + by_light);
                    self.rivals.weigh(&DensitySum { all: sum, rivals, extra_turns });
                }
                let value = self.throughput * (own / sum) * radiance;
                self.score(class, index, self.ray.origin, value);
            }
        }
    }

    /// The density with which the path's own sampling has drawn its direction.
    fn own_density(&self) -> f64 {
        match (self.drawn, &self.exit) {
            (DirectionDraw::Competing(pdf), _) => pdf,
            (DirectionDraw::Surface { wo, wi }, _) => self.boundary.eval(wo, wi).1,
            // The density of a delta lobe is its probability.
            (DirectionDraw::Alone, Some(exit)) => self.boundary.transmittance_smooth(exit.wo),
            (DirectionDraw::Alone, None) => 1.0,
        }
    }

    /// Densities of other techniques for the path that leaves at the last exit, if there is one.
    #[inline]
    fn rival_densities(&mut self, light: usize, wi: DVec3) -> f64 {
        match self.exit {
            Some(exit) => R::densities(self, &exit, light, wi),
            None => 0.0,
        }
    }

    /// Which of BSDF and light sampling take part at the last exit.
    #[inline]
    fn taking_part(&self) -> [f64; 2] {
        if self.exit.is_some() { self.rivals.unidirectional() } else { [1.0, 1.0] }
    }

    /// Adds a contribution of the walk to its sensor slot; its light entered the body at `entry`.
    #[inline]
    fn score(&mut self, class: TransportClass, light: usize, entry: DVec3, value: f64) {
        let slot = self.scene.sensor.slot_of(self.slot, entry);
        let place = ScorePlace { slot, band: self.band, class, light };
        for (slot, factor) in self.measure.slots(slot) {
            self.bands.score(self.scores, ScorePlace { slot, ..place }, factor * value);
        }
        self.rivals.scored(value);
    }

    /// The same for a path that has left the walk, with the changes of the bands since then. Its end is not known
    /// here: sensors that depend on it are not served by techniques that score in this way.
    #[inline]
    pub(super) fn score_with(&mut self, bands: &B, class: TransportClass, light: usize, value: f64) {
        let place = ScorePlace { slot: self.slot, band: self.band, class, light };
        bands.score(self.scores, place, value);
        self.rivals.scored(value);
    }

    /// The probability with which light sampling chooses a light.
    #[inline]
    pub(super) fn choice(&self, light: usize) -> f64 {
        self.choice[light]
    }

    /// The exit of a path that arrives along `dir`; `None` (and counted) where shading and geometric
    /// normal disagree about the side.
    pub(super) fn exit_at(&mut self, hit: Hit, dir: DVec3) -> Option<WalkExit> {
        let frame = Frame::about(hit.shading_normal);
        let wo = frame.to_local(-dir);
        if wo.z >= 0.0 {
            self.scores.note(Anomaly::WrongSide);
            return None;
        }
        Some(WalkExit { hit, frame, wo })
    }

    /// The distance from the present boundary point to the next hit of the boundary; infinite where an unbounded
    /// body has none, `None` (and counted) where a finite one has none.
    pub(super) fn reach(&mut self) -> Option<f64> {
        self.scores.count(Cost::Rays);
        let hit = self.scene.shape.intersect(&self.ray, Side::Inside, self.from, f64::INFINITY);
        if hit.is_none() && self.bounds.is_some() {
            self.scores.note(Anomaly::LostRay);
            return None;
        }
        Some(hit.map_or(f64::INFINITY, |hit| hit.t))
    }

    /// Whether a direction leads outside at an exit; counted where the normals disagree.
    pub(super) fn leads_outside(&mut self, exit: &WalkExit, dir: DVec3) -> bool {
        let [geometric, shading] = [dir.dot(exit.hit.normal) > 0.0, dir.dot(exit.frame.n) > 0.0];
        if geometric != shading {
            self.scores.note(Anomaly::WrongSide);
        }
        geometric && shading
    }

    #[inline]
    fn matched(&self) -> bool {
        matches!(self.boundary, Boundary::Matched)
    }
}

#[path = "walk_extra.rs"]
mod extra;
#[path = "walk_flights.rs"]
mod flights;
#[path = "walk_lanes.rs"]
mod lanes;
#[path = "walk_lights.rs"]
mod lights;
#[path = "walk_rivals.rs"]
mod rivals;

#[cfg(test)]
#[path = "walk_led_tests.rs"]
mod led;
