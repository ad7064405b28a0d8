//! Walks of one band side by side, each in a lane.

use super::bands::WalkBands;
use super::steps::Weights;
use crate::geometry::{Flights, Ray};
use crate::math::DVec3;
use crate::math::lanes::{LANES, VectorLanes, vector};
use crate::sampling::stream::Stream;

/// A medium vertex of a walk that has survived roulette, before its direction is drawn. Each number is read where it is used:
/// a copy of them that is written and read at once would stall.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneVertex<'a> {
    /// Of all lanes.
    pub points: &'a VectorLanes,
    /// Directions of arrival.
    pub arrivals: &'a VectorLanes,
    pub weights: &'a Weights,
    /// Density of the walk up to here over that of a plain one.
    pub ratio: f64,
    pub lane: usize,
}

impl LaneVertex<'_> {
    /// The vertex and the direction of arrival.
    #[inline(always)]
    pub(super) fn ray(&self) -> Ray {
        Ray { origin: vector(self.points, self.lane), dir: vector(self.arrivals, self.lane) }
    }
}

/// Walks inside a body, each of which has begun a flight.
pub(super) trait WalkLanes {
    /// How the walks are drawn.
    type Bands: WalkBands;

    /// A walk that has come in goes on along its ray.
    fn put(&mut self, lane: usize, bands: &Self::Bands, ray: &Ray, weights: Weights, stream: &Stream);

    /// Empties a lane; returns the stream of its walk, behind all numbers that it has drawn.
    fn take(&mut self, lane: usize) -> Stream;

    /// The state of a walk at the begin of its flight.
    fn state(&self, lane: usize, bands: &mut Self::Bands) -> Weights;

    /// All flights, if no boundary ends them.
    fn flights(&self) -> Flights<'_, LANES>;

    /// The ray of a walk's flight, its length if no boundary ends it, and where it ends then.
    fn flight(&self, lane: usize) -> (Ray, f64, DVec3);

    /// How many flights a walk has begun since it was put in.
    fn begun(&self, lane: usize) -> u64;

    /// Ends all flights in the medium, and begins the next ones; returns which walks survive roulette. Each of these is told
    /// of its vertex, before its direction is drawn.
    fn scatter(&mut self, arrive: impl FnMut(usize, LaneVertex<'_>)) -> [bool; LANES];
}
