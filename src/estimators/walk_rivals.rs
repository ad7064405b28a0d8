//! Techniques beside unidirectional sampling, as a camera walk calls them.

use super::CameraWalk;
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::{Unscattered, WalkExit, WalkVertex};
use crate::geometry::{Hit, Shape};
use crate::math::lanes::{Lanes, VectorLanes};
use crate::math::{DVec3, Frame};

/// Whose meeting with the boundary is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::estimators) enum LookingRay {
    /// Of the walk.
    Own,
    /// Of the sensor, followed no further.
    Further,
}

/// After a turn at a medium vertex, which meeting with the boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::estimators) enum Meeting {
    /// The next.
    First,
    /// One after that.
    Later,
}

/// Densities that make a path, as weights see them.
#[derive(Clone, Copy, Debug)]
pub(in crate::estimators) struct DensitySum {
    /// Of all techniques.
    pub all: f64,
    /// The part of [`Rivals::densities`].
    pub rivals: f64,
    /// The part of the rivals' [`Rivals::extra_turns`].
    pub extra_turns: f64,
}

/// Techniques beside unidirectional sampling.
pub(in crate::estimators) trait Rivals: Sized {
    /// Nothing happens at a medium vertex.
    const IS_SILENT: bool = false;

    /// Called at a medium vertex that survived roulette, before its direction is drawn; the walk's ray holds
    /// the vertex and the direction of arrival. Draws samples and scores them.
    fn call<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>);

    /// For medium vertices of several walks: what [`Self::passes`] has to know of each; `None` where it cannot be asked.
    #[inline(always)]
    fn bounds(&self, _shape: &Shape, _vertices: &VectorLanes) -> Option<Lanes> {
        None
    }

    /// Whether nothing will happen at a medium vertex that survived roulette and has this bound. If so, this is in place of
    /// [`Self::call`]; if not, [`Self::call`] comes next.
    #[inline(always)]
    fn passes(&mut self, _vertex: &WalkVertex, _bound: f64) -> bool {
        false
    }

    /// Called after the walk was refracted or reflected into the body; its ray is the next flight.
    fn depart<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>);

    /// Called when the walk, or a rival by [`CameraWalk::follow_extra`], leaves a medium vertex towards `dir`, before the
    /// walk's ray follows; `walks` is the density of the walk up to the vertex, as [`WalkBands::density`].
    #[inline(always)]
    fn turned<B: WalkBands>(_: &mut CameraWalk<'_, Self, B>, _dir: DVec3, _walks: f64) {}

    /// Called where a flight meets the boundary, inside or outside, `t` mm from where it began.
    #[inline(always)]
    fn reached(&mut self, _t: f64) {}

    /// Density, over the walk's own, with which rivals leave the latest medium vertex in the path's direction and follow it to
    /// where the path is now.
    #[inline(always)]
    fn extra_turns<B: WalkBands>(_: &CameraWalk<'_, Self, B>) -> f64 {
        0.0
    }

    /// Number of sensor rays per walk at which [`Self::look`] scores lights; the walk continues with one of them.
    fn views(&self) -> u32 {
        1
    }

    /// A ray has met a smooth boundary from outside, from the direction `wo` in the frame of the shading normal:
    /// scores lights that are seen without scattering by their expectation.
    fn look<B: WalkBands>(
        _: &mut CameraWalk<'_, Self, B>,
        _: LookingRay,
        _: &Hit,
        _: &Frame,
        _wo: DVec3,
    ) {
    }

    /// Whether [`Self::look`] scores a light that is seen in this way.
    fn is_expected<B: WalkBands>(
        _: &CameraWalk<'_, Self, B>,
        _: Unscattered,
        _light: usize,
        _wi: DVec3,
    ) -> bool {
        false
    }

    /// Which of BSDF and light sampling take part at the end of a path that leaves from the walk's
    /// latest medium vertex: 1 or 0 each.
    fn unidirectional(&self) -> [f64; 2] {
        [1.0, 1.0]
    }

    /// What the walk has scored, once for each score, also by [`CameraWalk::score_with`].
    #[inline]
    fn scored(&mut self, _value: f64) {}

    /// The next score is divided by a sum of densities.
    #[inline]
    fn weigh(&mut self, _sum: &DensitySum) {}

    /// Sum over the rivals of their densities of the path that ends at `exit` and continues towards
    /// `wi`, light `light`, relative to the density of the walk's medium vertices.
    fn densities<B: WalkBands>(
        walk: &mut CameraWalk<'_, Self, B>,
        exit: &WalkExit,
        light: usize,
        wi: DVec3,
    ) -> f64;
}

/// No additional techniques.
#[derive(Clone, Copy, Debug)]
pub(in crate::estimators) struct Unrivalled;

impl Rivals for Unrivalled {
    const IS_SILENT: bool = true;

    #[inline]
    fn call<B: WalkBands>(_: &mut CameraWalk<'_, Self, B>) {}

    #[inline]
    fn depart<B: WalkBands>(_: &mut CameraWalk<'_, Self, B>) {}

    #[inline]
    fn densities<B: WalkBands>(
        _: &mut CameraWalk<'_, Self, B>,
        _: &WalkExit,
        _: usize,
        _: DVec3,
    ) -> f64 {
        0.0
    }
}
