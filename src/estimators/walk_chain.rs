//! An extra direction at a medium vertex, followed to the next scattering event.

use super::{Anomaly, CameraWalk, Hit, Rivals, Side, flights};
use crate::estimators::bands::WalkBands;
use crate::math::DVec3;
use crate::sampling::stream::Stream;

impl<R: Rivals, B: WalkBands> CameraWalk<'_, R, B> {
    /// Follows the path from its medium vertex in the direction `dir` until it scatters, ends or leaves, and scores on the way
    /// as the walk does, with numbers of `streams` in place of the walk's and its light samples'; then the path is again where it
    /// was. Emission is not scored: the walk's own flight does that.
    pub(in crate::estimators) fn follow_chain(&mut self, dir: DVec3, streams: &mut [Stream; 2]) {
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
        let mut hit = self.fly_unscattered()?;
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
        self.fly_unscattered()
    }

    /// The boundary point that a flight reaches, if it does not scatter before.
    fn fly_unscattered(&mut self) -> Option<Hit> {
        let t = self.flight();
        let Some(hit) = self.scene.shape.end_of_flight(&self.ray, self.from, t) else {
            if flights::is_lost(self.bounds, self.ray.at(t)) {
                self.scores.note(Anomaly::LostRay);
            }
            return None;
        };
        self.bands.flight(&self.scene.medium, hit.t, false);
        self.measure.fly(&self.ray, hit.t);
        Some(hit)
    }
}
