//! Flights inside the body where nothing is scored on the way: a medium vertex takes roulette and a turn alone.

use super::{CameraWalk, Rivals, Unscattered};
use crate::estimators::bands::WalkBands;
use crate::estimators::steps::{StepByStep, StepRule, Steps, StepsAhead, Weights};
use crate::estimators::{Anomaly, Cost};
use crate::geometry::{BoundingSphere, Hit, Ray};
use crate::math::DVec3;
use crate::scene::Scene;

impl<R: Rivals, B: WalkBands> CameraWalk<'_, R, B> {
    /// Flies and scatters until the path meets the boundary or ends, with the numbers and counts of flights one by one.
    pub(super) fn fly_silently(&mut self) -> Option<Hit> {
        let medium = &self.scene.medium[self.band];
        let (roulette, survival) = (self.roulette, self.bands.survival(medium));
        let rule = StepRule { medium, roulette, survival };
        if B::IS_PLAIN && StepsAhead::pay(&self.scene.shape, self.bounds, medium.sigma_t) {
            self.fly_ahead(rule)
        } else {
            self.fly_by(StepByStep::new(rule, self.stream.clone()))
        }
    }

    /// With steps that are drawn ahead: a function of its own, whose stack holds them.
    #[inline(never)]
    fn fly_ahead(&mut self, rule: StepRule<'_>) -> Option<Hit> {
        self.fly_by(StepsAhead::new(rule, self.stream.clone()))
    }

    /// Takes the stream and the weights for the time of the flights.
    #[inline(always)]
    fn fly_by(&mut self, mut steps: impl Steps<B>) -> Option<Hit> {
        let mut weights = [self.throughput, self.survival];
        let hit = self.fly_to_boundary(&mut steps, &mut weights);
        self.stream = steps.stream();
        [self.throughput, self.survival] = weights;
        hit
    }

    #[inline(always)]
    fn fly_to_boundary(&mut self, steps: &mut impl Steps<B>, weights: &mut Weights) -> Option<Hit> {
        loop {
            let t = self.fly_clear(steps, weights)?;
            if let Some(hit) = self.scene.shape.end_of_unclear(&self.ray, self.from, t) {
                self.bands.flight(&self.scene.medium, hit.t, false);
                return Some(hit);
            }
            self.go_on(steps, weights, t)?;
        }
    }

    /// Flights up to the first that may meet the boundary, and the length of that one; `None` where the path ends at a vertex.
    /// Ray and weights are local here, so that they stay in registers.
    #[inline(always)]
    fn fly_clear(&mut self, steps: &mut impl Steps<B>, weights: &mut Weights) -> Option<f64> {
        let (mut ray, mut local) = (self.ray, *weights);
        let mut vertices = 0;
        let next = loop {
            let t = steps.flight(&mut self.bands, &local);
            if !self.scene.shape.is_clear(&ray, ray.at(t), t) {
                break Some(t);
            }
            vertices += 1;
            if !step(self.scene, &mut self.bands, steps, &mut ray, &mut local, t) {
                break None;
            }
        };
        (self.ray, *weights) = (ray, local);
        self.scores.count_many(Cost::Rays, vertices + u64::from(next.is_some()));
        self.scores.count_many(Cost::MediumEvents, vertices);
        if vertices > 0 {
            (self.from, self.unscattered) = (None, Unscattered::No);
            self.history.scatter_often(vertices);
        }
        next
    }

    /// A flight of length `t` that might have met the boundary and has not, and the turn at its end; `None` where the path ends.
    #[inline(always)]
    fn go_on(&mut self, steps: &mut impl Steps<B>, weights: &mut Weights, t: f64) -> Option<()> {
        if t == f64::INFINITY || is_lost(self.bounds, self.ray.at(t)) {
            // Without extinction, a path may fly to infinity in a half-space; in a finite body the ray is lost.
            if self.bounds.is_some() {
                self.scores.note(Anomaly::LostRay);
            }
            return None;
        }
        self.scores.count(Cost::MediumEvents);
        (self.from, self.unscattered) = (None, Unscattered::No);
        self.history.scatter();
        step(self.scene, &mut self.bands, steps, &mut self.ray, weights, t).then_some(())
    }
}

/// A flight of length `t` that has met nothing, and the turn at its end; false where the path ends there.
#[inline(always)]
fn step<B: WalkBands>(
    scene: &Scene,
    bands: &mut B,
    steps: &mut impl Steps<B>,
    ray: &mut Ray,
    weights: &mut Weights,
    t: f64,
) -> bool {
    ray.origin = ray.at(t);
    bands.flight(&scene.medium, t, true);
    let Some(dir) = steps.vertex(bands, weights, ray) else { return false };
    bands.turn(&scene.medium, ray.origin, ray.dir, dir);
    ray.dir = dir;
    true
}

/// Part of a body's size by which rounding may put a medium vertex outside its bounding sphere.
const ROUNDING: f64 = 1e-9;

/// Whether a point where a flight has met nothing is not in the body, whose bounds are these.
#[inline]
pub(super) fn is_lost(bounds: Option<BoundingSphere>, point: DVec3) -> bool {
    bounds.is_some_and(|bounds| {
        let from_center = (point - bounds.center).length_squared();
        from_center > bounds.radius * bounds.radius * (1.0 + ROUNDING)
    })
}
