//! An extra direction at a medium vertex, followed to the next scattering event.

use super::{Anomaly, CameraWalk, Cost, Hit, Rivals, Side, flights};
use crate::estimators::bands::WalkBands;
use crate::math::DVec3;
use crate::sampling::distance::sample_exponential;
use crate::sampling::stream::Stream;

impl<R: Rivals, B: WalkBands> CameraWalk<'_, R, B> {
    /// Follows the path from its medium vertex in the direction `dir` until it scatters, ends or leaves, and scores on the way
    /// as the walk does, with numbers of `streams` in place of the walk's and its light samples'; then the path is again where it
    /// was. It reaches the boundary with probability 1; later flights are those of the medium, also where the walk is guided.
    /// Emission is not scored: the walk's own flight does that.
    pub(in crate::estimators) fn follow_extra(&mut self, dir: DVec3, streams: &mut [Stream; 2]) {
        let path = (self.ray, self.from, self.exit, self.unscattered, self.drawn);
        let weights = (self.throughput, self.survival, self.look_share);
        let events = (self.history, self.measure);
        let bands = self.bands.clone();
        let [own, own_light] = streams;
        std::mem::swap(&mut self.stream, own);
        std::mem::swap(&mut self.light_stream, own_light);
        self.set_out(dir);
        self.follow_to_event();
        std::mem::swap(&mut self.stream, own);
        std::mem::swap(&mut self.light_stream, own_light);
        (self.ray, self.from, self.exit, self.unscattered, self.drawn) = path;
        (self.throughput, self.survival, self.look_share) = weights;
        (self.history, self.measure) = events;
        self.bands = bands;
    }

    fn follow_to_event(&mut self) -> Option<()> {
        self.scores.count(Cost::Rays);
        let hit = self.scene.shape.leave(&self.ray);
        let mut hit = self.reach_boundary(hit, f64::INFINITY)?;
        loop {
            let side = self.cross(&hit, Side::Inside)?;
            hit = match side {
                Side::Inside => self.go_in(&hit)?,
                Side::Outside => {
                    let mut outer = self.fly_outside()?;
                    while self.cross(&outer, Side::Outside)? == Side::Outside {
                        outer = self.fly_outside()?;
                    }
                    self.go_in(&outer)?
                }
            };
        }
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
