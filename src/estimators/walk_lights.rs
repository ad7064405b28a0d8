//! Light samples of a camera walk: from a rough surface, and from the medium straight through a matched boundary.

use super::*;

impl<R: Rivals, B: WalkBands> CameraWalk<'_, R, B> {
    /// Samples a light from a rough surface vertex.
    pub(super) fn connect_from_surface(&mut self, hit: &Hit, frame: &Frame, wo: DVec3) {
        if self.choice.iter().all(|&share| share == 0.0) {
            return;
        }
        let u = self.light_stream.draw3();
        let Some((index, choice)) = choose_light(self.choice, u[0]) else { return };
        let sample = self.scene.lights[index].sample(self.band, [u[1], u[2]]);
        let wi = frame.to_local(sample.wi);
        let outside = sample.wi.dot(hit.normal) > 0.0;
        if outside != (wi.z > 0.0) {
            self.scores.note(Anomaly::WrongSide);
            return;
        }
        if !outside || sample.radiance == 0.0 {
            return;
        }
        let (value, pdf) = self.boundary.eval(wo, wi);
        if value == 0.0 {
            return;
        }
        self.scores.count(Cost::ShadowRays);
        let shadow = Ray { origin: hit.point, dir: sample.wi };
        if self.scene.shape.occluded(&shadow, Some(hit.face)) {
            return;
        }
        let entry = self.ray.origin;
        let value = value * sample.radiance;
        let light = LightDraw { index, choice, wi: sample.wi, pdf: sample.pdf };
        self.score_connection(light, entry, value, pdf);
    }

    /// Samples a light from a medium vertex, straight through a matched boundary.
    pub(super) fn connect_from_medium(&mut self) {
        let u = self.light_stream.draw3();
        let Some((index, choice)) = choose_light(self.choice, u[0]) else { return };
        let sample = self.scene.lights[index].sample(self.band, [u[1], u[2]]);
        if sample.radiance == 0.0 {
            return;
        }
        let phase = self.medium.phase.pdf(self.ray.dir.dot(sample.wi));
        let path = self.measure; // without the connection, which is a path of its own
        if let Some((through, guided, entry)) = self.transmittance_out(sample.wi) {
            let value = phase * through * sample.radiance;
            let own = phase * through * guided;
            let light = LightDraw { index, choice, wi: sample.wi, pdf: sample.pdf };
            self.score_connection(light, entry, value, own);
        }
        self.measure = path;
    }

    /// Transmittance from the path's medium vertex to infinity along `dir`, through every part of the
    /// body on the way; the density with which the walk goes there, over that of a plain walk; the last point of the
    /// boundary. The path's measure follows.
    pub(super) fn transmittance_out(&mut self, dir: DVec3) -> Option<(f64, f64, DVec3)> {
        let mut ray = Ray { origin: self.ray.origin, dir };
        let mut bands = self.bands.clone();
        bands.turn(&self.scene.medium, ray.origin, self.ray.dir, dir);
        let mut from = None;
        let mut inside_length = 0.0;
        let mut side = Side::Inside;
        loop {
            self.scores.count(Cost::ShadowRays);
            match self.scene.shape.intersect(&ray, side, from, f64::INFINITY) {
                Some(hit) => {
                    self.measure.meet(side);
                    if side == Side::Inside {
                        self.measure.fly(&ray, hit.t);
                        inside_length += hit.t;
                        bands.flight(&self.scene.medium, hit.t, false);
                    } else {
                        bands.enter(hit.point, hit.normal, dir);
                    }
                    ray.origin = hit.point;
                    from = Some(hit.face);
                    side = other(side);
                }
                None if side == Side::Outside => {
                    let through = transmittance(self.medium.sigma_t, inside_length);
                    let guided = (bands.density() / self.bands.density()).min(f64::MAX);
                    return Some((through, guided, ray.origin));
                }
                None => {
                    if self.bounds.is_some() {
                        self.scores.note(Anomaly::LostRay);
                    }
                    return None;
                }
            }
        }
    }

    /// Adds a light sample whose light comes in at `entry`: `value` is f |cos| (or phase times
    /// transmittance) times radiance, `own` the density with which the path's own sampling draws the
    /// direction. Against parallel light it has none.
    pub(super) fn score_connection(&mut self, light: LightDraw, entry: DVec3, value: f64, own: f64) {
        let LightDraw { index, choice, wi, pdf } = light;
        let [bsdf, by_light] = self.taking_part();
        if by_light == 0.0 {
            return;
        }
        let rivals = self.rival_densities(index, wi);
        let extra_turns = R::extra_turns(self);
        let walks = self.bands.density() * (1.0 + extra_turns);
        let (density, unidirectional) = match pdf {
            Some(pdf) => {
                let density = choice * pdf;
                (density, density + bsdf * own)
            }
            None => (choice, choice),
        };
        let sum = walks * unidirectional + rivals;
        if rivals > 0.0 || extra_turns > 0.0 {
            let extra_turns = self.bands.density() * extra_turns * unidirectional;
            self.rivals.weigh(&DensitySum { all: sum, rivals, extra_turns });
        }
        let estimate = value / density * (density / sum);
        let score = self.throughput * estimate;
        self.score(self.history.class(), index, entry, score);
    }
}
