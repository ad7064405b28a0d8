//! Balls without surface inside, which flights are seen to be clear by.
//!
//! A ball about a point, as large as the distance from it to the surface, is convex and has no surface inside: a flight
//! with both ends in it meets nothing. The ball about the start of a flight shows that of few flights that start near the
//! surface, where most do. A large ball that touches the surface near the start shows it of nearly all that do not go
//! outwards. So each voxel has a ball about the centre of some voxel, not of its own in general. The deeper the ball holds
//! the voxel, margin m = r - d (d from centre to centre), the farther a flight may go outwards; the larger it is, the
//! farther inwards and along the surface, where the ball curves away from a flight of length l by l^2 / (2 r). So
//! m - l^2 / (2 r) is made large, with l = 2 voxels. Voxels hand their balls on to their neighbours, forth and back
//! through the grid, and each keeps the best that it is offered, as in transforms of vector distances (Danielsson,
//! "Euclidean distance mapping", Computer Graphics and Image Processing 14, 1980): that does not find the best ball
//! always, and need not.

use super::tree::PAD;
use super::voxels::Voxels;
use crate::math::DVec3;

/// From here on not every voxel is the centre of a ball, voxels.
const DEEP: f64 = 1.0;

/// The flight that balls are chosen for, voxels.
const FLIGHT: f64 = 2.0;

/// A ball about the centre of a voxel is looked at from voxels at most so many away along each axis.
const ABOUT: usize = 2;

/// A ball without surface inside, units of the frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct EmptyBall {
    center: [f32; 3],
    /// 0 if there is none.
    radius: f32,
}

impl EmptyBall {
    /// A ball that holds no point.
    pub(super) const NONE: EmptyBall = EmptyBall { center: [0.0; 3], radius: 0.0 };

    #[inline]
    pub(super) fn center(&self) -> DVec3 {
        let [x, y, z] = self.center;
        DVec3::new(x.into(), y.into(), z.into())
    }

    #[inline]
    pub(super) fn radius(&self) -> f64 {
        self.radius.into()
    }

    /// Whether a point is in it: not if it is infinite or no number.
    #[inline]
    pub(super) fn holds(&self, point: DVec3) -> bool {
        point.distance_squared(self.center()) < self.radius() * self.radius()
    }

    /// What it is worth to flights of this length that start near a point, units of the frame.
    pub(super) fn worth(&self, point: DVec3, flight: f64) -> f32 {
        worth(self.radius, self.center().distance(point) as f32, flight as f32)
    }
}

/// What a ball is worth to flights of a length that start at a distance from its centre, all in the same unit.
fn worth(radius: f32, distance: f32, flight: f32) -> f32 {
    if radius > 0.0 { radius - distance - flight * flight / (2.0 * radius) } else { f32::NEG_INFINITY }
}

/// A ball about the centre of a voxel, as another voxel sees it.
#[derive(Clone, Copy, Debug)]
struct NearbyBall {
    /// The way to the voxel of the centre, voxels.
    offset: [i8; 3],
    /// Voxels; 0 if there is none.
    radius: f32,
}

impl NearbyBall {
    const NONE: NearbyBall = NearbyBall { offset: [0; 3], radius: 0.0 };

    /// What the ball is worth, voxels.
    fn worth(&self) -> f32 {
        // Not `map`, which is not inlined.
        let [i, j, k] = self.offset;
        let [i, j, k] = [f32::from(i), f32::from(j), f32::from(k)];
        worth(self.radius, (i * i + j * j + k * k).sqrt(), FLIGHT as f32)
    }

    /// The same ball for a neighbour of the voxel along an axis.
    fn seen_from(self, axis: usize, step: i8) -> NearbyBall {
        let mut offset = self.offset;
        match offset[axis].checked_sub(step) {
            Some(moved) => offset[axis] = moved,
            None => return NearbyBall::NONE,
        }
        NearbyBall { offset, ..self }
    }
}

/// Balls about the centres of voxels, as large as the distance from there to the surface.
pub(super) struct CenteredBalls {
    voxels: Voxels,
    /// Units of the frame; 0 where there is none.
    radii: Vec<f32>,
    /// The steps to the voxels about one from the one at their least corner, and how far these are away, units of the frame.
    steps: Vec<([usize; 3], f32)>,
}

impl CenteredBalls {
    /// In voxels that are not `outside` and whose distance from the surface has these lower `bounds`, units of the frame. Deep
    /// inside, where every ball serves many voxels and its radius takes longest to be found, only every eighth has one.
    pub(super) fn new(
        voxels: Voxels,
        bounds: &[f32],
        outside: &[bool],
        mut distance: impl FnMut(DVec3) -> f64,
    ) -> CenteredBalls {
        let has_one = |index: usize| {
            let is_even = voxels.place(index).iter().all(|at| at % 2 == 0);
            !outside[index] && (is_even || f64::from(bounds[index]) < DEEP * voxels.edge())
        };
        let mut radii = vec![0.0; voxels.len()];
        for index in (0..radii.len()).filter(|&index| has_one(index)) {
            // The padding pays for the rounding of the distance, of f32 and of points that are looked up.
            let radius = distance(voxels.center(voxels.place(index))) - 2.0 * PAD;
            radii[index] = radius.max(0.0) as f32;
        }
        let steps = |part: usize| {
            const WIDTH: usize = 2 * ABOUT + 1;
            let steps = [part % WIDTH, part / WIDTH % WIDTH, part / WIDTH / WIDTH];
            let squares: usize = steps.iter().map(|&step| step.abs_diff(ABOUT).pow(2)).sum();
            (steps, (squares as f64).sqrt() as f32 * voxels.edge() as f32)
        };
        CenteredBalls { voxels, radii, steps: (0..(2 * ABOUT + 1).pow(3)).map(steps).collect() }
    }

    fn ball(&self, place: [usize; 3], radius: f32) -> EmptyBall {
        EmptyBall { center: self.voxels.center(place).as_vec3().to_array(), radius }
    }

    /// A ball for every voxel that is not outside: the best that it is offered.
    pub(super) fn handed_on(&self, outside: &[bool]) -> Vec<EmptyBall> {
        let voxels = &self.voxels;
        let per_edge = (1.0 / voxels.edge()) as f32;
        let nearby = |radius: &f32| NearbyBall { offset: [0; 3], radius: radius * per_edge };
        let mut balls: Vec<NearbyBall> = self.radii.iter().map(nearby).collect();
        for _ in 0..2 {
            (0..balls.len()).for_each(|index| improve(voxels, index, &mut balls, outside, -1));
            (0..balls.len()).rev().for_each(|index| improve(voxels, index, &mut balls, outside, 1));
        }
        let about = |(index, ball): (usize, NearbyBall)| {
            let ([i, j, k], [x, y, z]) = (voxels.place(index), ball.offset);
            let step = |at: usize, step: i8| at.wrapping_add_signed(step.into());
            self.ball([step(i, x), step(j, y), step(k, z)], ball.radius * voxels.edge() as f32)
        };
        balls.into_iter().enumerate().map(about).collect()
    }

    /// Of the balls about the centres of voxels near one, those that may be the one worth most to flights of a length that start
    /// within `reach` of its middle, both in units of the frame.
    pub(super) fn about(&self, place: [usize; 3], flight: f64, reach: f64) -> Vec<EmptyBall> {
        let flight = flight as f32;
        let mut balls: Vec<([usize; 3], f32, f32)> = Vec::with_capacity(self.steps.len());
        let mut most = f32::NEG_INFINITY;
        let [i, j, k] = place;
        for &([di, dj, dk], distance) in &self.steps {
            // Beside the grid, or wrapped around to what is far beside it.
            let at = [
                (i + di).wrapping_sub(ABOUT),
                (j + dj).wrapping_sub(ABOUT),
                (k + dk).wrapping_sub(ABOUT),
            ];
            let Some(index) = self.voxels.index(at) else { continue };
            let radius = self.radii[index];
            if radius > 0.0 {
                let worth = worth(radius, distance, flight);
                most = most.max(worth);
                balls.push((at, radius, worth));
            }
        }
        // On the way from the middle one ball loses no more than the way is long, and another gains no more.
        let least = most - 2.0 * reach as f32;
        let near = balls.iter().filter(|ball| ball.2 >= least);
        near.map(|&(at, radius, _)| self.ball(at, radius)).collect()
    }
}

/// Gives a voxel the ball of a neighbour on one side if that is better.
fn improve(voxels: &Voxels, index: usize, balls: &mut [NearbyBall], outside: &[bool], step: i8) {
    if outside[index] {
        return;
    }
    for axis in 0..3 {
        let Some(beside) = voxels.beside(index, axis, step) else { continue };
        // The way from here is the way from there and one step more.
        let ball = balls[beside].seen_from(axis, -step);
        if ball.worth() > balls[index].worth() {
            balls[index] = ball;
        }
    }
}
