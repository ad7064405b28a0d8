//! Which way the surface near a point faces.
//!
//! A ray inside sees the triangles that it would leave through, those with `dir . normal > 0`, and no others
//! ([`super::Shape::intersect`]). So a flight meets nothing if all triangles that it can reach face against it: with no more than
//! bounds of their normals, component by component, most flights into the body from its surface are seen to be clear.
//!
//! The flight is in the cube about its start whose half edge is its length. In voxels of an edge of half that length or more,
//! the cube touches no voxel but the [`REACH`] next ones on each side of the start's own. So a voxel holds the bounds of
//! all normals in these; grids of one edge, twice and four times that edge and so on serve flights of any length.

use super::triangle::PreciseNormal;
use super::voxels::Voxels;
use crate::math::DVec3;

/// As many voxels to each side of its own a flight may reach.
pub(super) const REACH: usize = 2;

/// Bounds of the components of normals are whole multiples of this part of 1.
const STEP: f64 = 1.0 / 126.0;

/// What bounds are wider than a normal on each side, steps: more than a normal, or the orientation that a ray sees, is
/// wrong by ([`PreciseNormal`]).
const SLACK: f64 = 0.05;

/// The least and the greatest component of normals along each axis, steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NormalBounds([[i8; 2]; 3]);

impl NormalBounds {
    /// Of every normal.
    pub(super) const ALL: NormalBounds = NormalBounds([[-i8::MAX, i8::MAX]; 3]);

    /// Of no normal.
    const NONE: NormalBounds = NormalBounds([[i8::MAX, -i8::MAX]; 3]);

    /// Of a triangle's normal: of every one where that is not known well.
    fn of(normal: Option<PreciseNormal>) -> NormalBounds {
        let Some(PreciseNormal(normal)) = normal else { return NormalBounds::ALL };
        let bounds = |x: f64| [(x / STEP - SLACK).floor() as i8, (x / STEP + SLACK).ceil() as i8];
        NormalBounds([bounds(normal.x), bounds(normal.y), bounds(normal.z)])
    }

    /// Of all normals of both.
    fn with(&self, other: &NormalBounds) -> NormalBounds {
        let mut all = *self;
        for ([low, high], [other_low, other_high]) in all.0.iter_mut().zip(other.0) {
            (*low, *high) = ((*low).min(other_low), (*high).max(other_high));
        }
        all
    }

    /// Whether all normals surely have a negative component along a direction.
    #[inline(always)]
    pub(super) fn are_against(&self, dir: DVec3) -> bool {
        let most = |axis: usize, d: f64| f64::from(self.0[axis][usize::from(d > 0.0)]) * d;
        most(0, dir.x) + most(1, dir.y) + most(2, dir.z) < 0.0
    }
}

/// Bounds of normals in every voxel.
#[derive(Clone, Debug)]
pub(super) struct NormalGrid {
    voxels: Voxels,
    bounds: Vec<NormalBounds>,
}

impl NormalGrid {
    /// Bounds of the normals of those triangles, in units of the frame, that may touch a voxel.
    pub(super) fn new(
        voxels: Voxels,
        triangles: impl Iterator<Item = ([DVec3; 3], Option<PreciseNormal>)>,
    ) -> NormalGrid {
        let mut bounds = vec![NormalBounds::NONE; voxels.len()];
        for (triangle, normal) in triangles {
            let its = NormalBounds::of(normal);
            voxels.touched(&triangle, normal, |index| bounds[index] = bounds[index].with(&its));
        }
        NormalGrid { voxels, bounds }
    }

    /// The same in voxels of twice the edge.
    pub(super) fn coarser(&self) -> NormalGrid {
        let voxels = self.voxels.coarser();
        let mut bounds = vec![NormalBounds::NONE; voxels.len()];
        let fine = self.bounds.iter().enumerate();
        for (index, fine) in fine.filter(|(_, fine)| **fine != NormalBounds::NONE) {
            let [i, j, k] = self.voxels.place(index);
            let coarse = voxels.index([i / 2, j / 2, k / 2]);
            let coarse = coarse.expect("it covers the same box");
            bounds[coarse] = bounds[coarse].with(fine);
        }
        NormalGrid { voxels, bounds }
    }

    /// Of all voxels that flights reach that start in a voxel and are no longer than [`REACH`] voxels.
    pub(super) fn within_reach(mut self) -> NormalGrid {
        let spread = |line: &[NormalBounds], reached: &mut [NormalBounds]| {
            // Most voxels are without triangles.
            for (i, own) in line.iter().enumerate().filter(|(_, own)| **own != NormalBounds::NONE) {
                let within = i.saturating_sub(REACH)..(i + REACH + 1).min(line.len());
                reached[within].iter_mut().for_each(|all| *all = all.with(own));
            }
        };
        (0..3).for_each(|axis| self.voxels.along(axis, &mut self.bounds, spread));
        self
    }

    /// The bounds in the voxel at a place; none beside the box.
    #[inline]
    pub(super) fn at(&self, place: [usize; 3]) -> Option<&NormalBounds> {
        self.voxels.index(place).map(|index| &self.bounds[index])
    }

    /// Memory behind the grid, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        size_of_val(&*self.bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, direction};
    use super::*;

    impl NormalBounds {
        /// Whether a normal, or one that is off by 3e-4, is in the bounds.
        pub(in super::super) fn hold(&self, normal: DVec3) -> bool {
            let steps = normal.to_array().map(|x| x / STEP);
            let is_in = |axis: usize| {
                let [low, high] = self.0[axis].map(f64::from);
                low <= steps[axis] - 3e-4 / STEP && steps[axis] + 3e-4 / STEP <= high
            };
            *self == NormalBounds::ALL || (0..3).all(is_in)
        }
    }

    #[test]
    fn normals_are_against_a_direction_if_their_bounds_tell() {
        let mut u = Uniform::named("normals_are_against_a_direction_if_their_bounds_tell");
        let (mut told, mut missed) = (0, 0);
        for i in 0..200_000 {
            // Normals within a cone, at times along an axis.
            let axis = if i % 3 == 0 { DVec3::AXES[i / 3 % 3] } else { direction(&mut u) };
            let width = u.next();
            let normals = [(); 4].map(|()| (axis + direction(&mut u) * width).normalize());
            let bounds = normals
                .map(|normal| NormalBounds::of(Some(PreciseNormal(normal))))
                .into_iter()
                .fold(NormalBounds::NONE, |all, one| all.with(&one));
            let dir = if i % 2 == 0 { direction(&mut u) } else { -axis };
            let most = normals.map(|normal| normal.dot(dir)).into_iter().fold(-1.0, f64::max);
            assert!(normals.iter().all(|normal| bounds.hold(*normal)), "{bounds:?} {normals:?}");
            if bounds.are_against(dir) {
                assert!(most < -3e-4, "{bounds:?} {normals:?} {dir}");
                told += 1;
            } else {
                missed += usize::from(most < -3e-4);
            }
            assert!(!NormalBounds::of(None).are_against(dir) && NormalBounds::NONE.are_against(dir));
        }
        assert!(told > 50_000 && missed < told / 5, "{told} {missed}");
    }
}
