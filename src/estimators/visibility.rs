//! Visibility of a walk's connections: to other points of the body, and to the light.

use super::Cost;
use super::bands::WalkBands;
use super::walk::{CameraWalk, Rivals};
use crate::geometry::{FaceId, Ray, Side};
use crate::math::DVec3;

/// Part of a leg's length within which two ways of meeting the same point of the boundary may differ.
const LEG: f64 = 1e-7;

impl<R: Rivals, B: WalkBands> CameraWalk<'_, R, B> {
    /// Whether nothing lies between two points of the body; the second may be on the boundary.
    pub(super) fn sees_point(&mut self, from: DVec3, to: DVec3) -> bool {
        if self.scene.shape.is_convex() {
            return true;
        }
        let leg = to - from;
        let length = leg.length();
        self.scores.count(Cost::ShadowRays);
        let ray = Ray { origin: from, dir: leg / length };
        self.scene.shape.intersect(&ray, Side::Inside, None, length * (1.0 - LEG)).is_none()
    }

    /// Whether something is between a boundary point and the light.
    pub(super) fn is_shadowed(&mut self, point: DVec3, face: FaceId, w_l: DVec3) -> bool {
        self.scores.count(Cost::ShadowRays);
        self.scene.shape.occluded(&Ray { origin: point, dir: w_l }, Some(face))
    }
}
