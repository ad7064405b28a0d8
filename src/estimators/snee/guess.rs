//! The specular guess: where light from a direction would enter the body to reach a point inside.
//!
//! A fixed-point iteration, deterministic and cheap, that need not converge: trace from the point along the
//! light's direction, refract the light at the normal of the hit, trace back along the refracted ray, and
//! take the normal there. The guess steers samplers whose densities are exact for any guess; its errors
//! increase only variance.

use crate::estimators::Cost;
use crate::estimators::walk::CameraWalk;
use crate::geometry::Ray;
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;

/// Steps of the fixed point after the first shot: it converges on smooth convex bodies ...
const CONVEX_STEPS: u32 = 2;

/// ... and jumps among the facets of a mesh, where each step is a ray through a tree.
const MESH_STEPS: u32 = 1;

/// Where light from one direction probably enters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guess {
    /// Outward normal of the boundary there.
    pub normal: DVec3,
    /// From the point towards it.
    pub dir: DVec3,
    /// How far it is, mm.
    pub distance: f64,
}

impl Guess {
    /// For a point in the medium and a direction towards the light; `None` where no boundary is met.
    pub(super) fn new<R, B>(
        walk: &mut CameraWalk<'_, R, B>,
        point: DVec3,
        toward: DVec3,
    ) -> Option<Guess> {
        let CameraWalk { scene, boundary, scores, .. } = walk;
        let mut shoot = |dir| {
            scores.count(Cost::Rays);
            scene.shape.leave(&Ray { origin: point, dir })
        };
        let straight = shoot(toward)?;
        let mut guess = Guess { normal: straight.shading_normal, dir: toward, distance: straight.t };
        let steps = if scene.shape.is_convex() { CONVEX_STEPS } else { MESH_STEPS };
        for _ in 0..steps {
            let Some(dir) = entering(boundary, guess.normal, toward) else { break };
            let Some(hit) = shoot(dir) else { break };
            guess = Guess { normal: hit.shading_normal, dir, distance: hit.t };
        }
        Some(guess)
    }

    /// The direction from the point, against the light that is refracted at the guessed normal; that of
    /// the guess where the normal faces away from the light.
    pub(super) fn refracted(&self, boundary: &Boundary, toward: DVec3) -> DVec3 {
        entering(boundary, self.normal, toward).unwrap_or(self.dir)
    }
}

/// Against light from `toward` after its refraction at a normal.
fn entering(boundary: &Boundary, normal: DVec3, toward: DVec3) -> Option<DVec3> {
    let frame = Frame::about(normal);
    let local = frame.to_local(toward);
    if local.z <= 0.0 {
        return None;
    }
    boundary.refract(local).map(|inward| -frame.to_world(inward))
}
