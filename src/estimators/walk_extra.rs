//! An extra direction at a medium vertex, followed to lights.

use super::{Anomaly, CameraWalk, Cost, Hit, Meeting, Rivals, Side, flights};
use crate::estimators::bands::WalkBands;
use crate::math::DVec3;
use crate::sampling::distance::sample_exponential;
use crate::sampling::stream::Stream;
use crate::scene::Light;

impl<R: Rivals, B: WalkBands> CameraWalk<'_, R, B> {
    /// Follows the path from its medium vertex in the direction `dir`, and scores lights as the walk does, with numbers of `streams`
    /// in place of the walk's and its light samples'; then the path is again where it was. It reaches the boundary for certain. It
    /// ends at its first meeting with the boundary, or goes on for later ones until it scatters, ends or leaves. Later flights are
    /// those of the medium, also where the walk is guided. Emission is not scored: the walk's own flight does that.
    pub(in crate::estimators) fn follow_extra(
        &mut self,
        dir: DVec3,
        meeting: Meeting,
        streams: &mut [Stream; 2],
    ) {
        let path = (self.ray, self.from, self.exit, self.unscattered, self.drawn);
        let weights = (self.throughput, self.survival, self.look_share);
        let events = (self.history, self.measure);
        let bands = self.bands.clone();
        let [own, own_light] = streams;
        std::mem::swap(&mut self.stream, own);
        std::mem::swap(&mut self.light_stream, own_light);
        self.set_out(dir);
        match meeting {
            Meeting::First => self.find_lights_once(),
            Meeting::Later => self.find_lights(),
        };
        std::mem::swap(&mut self.stream, own);
        std::mem::swap(&mut self.light_stream, own_light);
        (self.ray, self.from, self.exit, self.unscattered, self.drawn) = path;
        (self.throughput, self.survival, self.look_share) = weights;
        (self.history, self.measure) = events;
        self.bands = bands;
    }

    fn find_lights_once(&mut self) -> Option<()> {
        let hit = self.leave_body()?;
        let side = self.cross(&hit, Side::Inside)?;
        // Where no light lies ahead, a flight could only lead to a later meeting.
        let shines = |light: &Light| light.eval(self.band, self.ray.dir).0 > 0.0;
        if side == Side::Outside && self.scene.lights.iter().any(shines) {
            self.fly_outside();
        }
        None
    }

    fn find_lights(&mut self) -> Option<()> {
        let mut from = self.leave_body()?;
        let mut side = Side::Inside;
        loop {
            side = self.cross(&from, side)?;
            from = match side {
                Side::Inside => self.go_in(&from)?,
                Side::Outside => self.fly_outside()?,
            };
        }
    }

    /// Where a flight from the medium vertex that does not scatter meets the boundary.
    fn leave_body(&mut self) -> Option<Hit> {
        self.scores.count(Cost::Rays);
        let hit = self.scene.shape.leave(&self.ray);
        self.reach_boundary(hit, f64::INFINITY)
    }

    fn go_in(&mut self, entry: &Hit) -> Option<Hit> {
        self.bands.enter(entry.point, entry.normal, self.ray.dir);
        R::depart(self);
        self.scores.count(Cost::Rays);
        let t = sample_exponential(self.medium.sigma_t, self.stream.draw());
        let hit = self.scene.shape.end_of_flight(&self.ray, self.from, t);
        self.reach_boundary(hit, t)
    }

    /// The boundary point that a flight of length `t` meets; `None` where it scatters before.
    fn reach_boundary(&mut self, hit: Option<Hit>, t: f64) -> Option<Hit> {
        let Some(hit) = hit else {
            if t == f64::INFINITY || flights::is_lost(self.bounds, self.ray.at(t)) {
                self.scores.note(Anomaly::LostRay);
            }
            return None;
        };
        self.bands.flight(&self.scene.medium, hit.t, false);
        self.rivals.reached(hit.t);
        self.measure.fly(&self.ray, hit.t);
        Some(hit)
    }
}
