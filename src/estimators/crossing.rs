//! Events at the boundary, shared by camera and light tracing.

use crate::geometry::Side;
use crate::optics::boundary::Boundary;

/// The opposite side of a boundary.
#[inline]
pub(super) fn other(side: Side) -> Side {
    match side {
        Side::Outside => Side::Inside,
        Side::Inside => Side::Outside,
    }
}

/// Undoes radiance's factor (n_o / n_i)^2 of a refraction from `side` (of wo) to `next` (of wi).
#[inline]
pub(super) fn radiance_scale(side: Side, next: Side, boundary: &Boundary) -> f64 {
    let eta = match boundary {
        Boundary::Smooth { eta } | Boundary::Rough { eta, .. } => *eta,
        Boundary::Matched => 1.0,
    };
    match (side, next) {
        (Side::Outside, Side::Inside) => eta * eta,
        (Side::Inside, Side::Outside) => 1.0 / (eta * eta),
        _ => 1.0,
    }
}
