//! A walk that a test leads along a path of its choice: the test makes the decisions that random numbers make
//! otherwise; all other code is that of the walk.

use super::*;

impl<'a, R: Rivals, B: WalkBands> CameraWalk<'a, R, B> {
    /// A walk of weight 1 that stands at a point inside the body.
    pub(in crate::estimators) fn led(
        path: Path<'a>,
        scores: &'a mut Scores,
        rivals: R,
        bands: B,
        point: DVec3,
    ) -> CameraWalk<'a, R, B> {
        let mut walk = CameraWalk::start(path, scores, rivals, bands);
        walk.ray.origin = point;
        walk.throughput = 1.0;
        walk
    }

    /// Flies to a medium vertex and does there what a walk does; `turns`: the flight begins at another.
    pub(in crate::estimators) fn lead_to(&mut self, point: DVec3, turns: bool) {
        let length = self.head_for(point, turns);
        self.arrive(length).expect("no roulette");
    }

    /// Flies from a medium vertex to an exit.
    pub(in crate::estimators) fn lead_out(&mut self, exit: &WalkExit) {
        let length = self.head_for(exit.hit.point, true);
        self.bands.flight(&self.scene.medium, length, false);
        self.rivals.reached(length);
        self.ray.origin = exit.hit.point;
        self.from = Some(exit.hit.face);
        self.exit = Some(*exit);
    }

    /// Flies on from an exit, outside; whether it meets the body again.
    pub(in crate::estimators) fn lead_on(&mut self, dir: DVec3) -> bool {
        self.ray.dir = dir;
        self.fly_outside().is_some()
    }

    fn head_for(&mut self, point: DVec3, turns: bool) -> f64 {
        let leg = point - self.ray.origin;
        let dir = leg.normalize();
        if turns {
            self.set_out(dir);
        }
        self.ray.dir = dir;
        leg.length()
    }

    /// Scores what light sampling does at the exit, or at a medium vertex of a matched body, if it
    /// draws `wi` from a light.
    pub(in crate::estimators) fn score_light_sample(&mut self, index: usize, wi: DVec3) {
        let light = &self.scene.lights[index];
        let radiance = light.sampled_radiance(self.band, wi);
        let pdf = (!light.is_directional()).then(|| light.eval(self.band, wi).1);
        let choice = self.choice[index];
        let (f_cos, own) = match self.exit {
            Some(exit) => self.boundary.eval(exit.wo, exit.frame.to_local(wi)),
            None => {
                let (through, guided) = self
                    .transmittance_out(wi)
                    .map_or((0.0, 1.0), |(through, guided, _)| (through, guided));
                let value = self.medium.phase.pdf(self.ray.dir.dot(wi)) * through;
                (value, value * guided)
            }
        };
        let light = LightDraw { index, choice, wi, pdf };
        self.score_connection(light, self.ray.origin, f_cos * radiance, own);
    }

    /// Scores what the walk does if the boundary at the exit, or the phase function at a vertex of a
    /// matched body, draws `wi`.
    pub(in crate::estimators) fn score_own_sample(&mut self, wi: DVec3) {
        let (ray, throughput) = (self.ray, self.throughput);
        let (weight, drawn) = match (self.exit, self.boundary) {
            (Some(exit), Boundary::Rough { .. }) => {
                let (wo, wi) = (exit.wo, exit.frame.to_local(wi));
                let (f_cos, pdf) = self.boundary.eval(wo, wi);
                (f_cos / pdf, DirectionDraw::Surface { wo, wi })
            }
            (Some(_), boundary) => (boundary.eta() * boundary.eta(), DirectionDraw::Alone),
            (None, _) => {
                let (through, guided) = self
                    .transmittance_out(wi)
                    .map_or((0.0, 1.0), |(through, guided, _)| (through, guided));
                let phase = self.medium.phase.pdf(self.ray.dir.dot(wi));
                // The walk's density has not followed the step out, which the test leaves out.
                (1.0 / guided, DirectionDraw::Competing(phase * through * guided))
            }
        };
        (self.ray.dir, self.drawn) = (wi, drawn);
        self.throughput *= weight;
        self.score_escape();
        (self.ray, self.throughput) = (ray, throughput);
    }
}
