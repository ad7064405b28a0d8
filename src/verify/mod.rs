//! Claims and records in, verdicts out, and a list of what wants a second look. Pure: a verdict is a
//! function of records and levels.

/// From comparisons to verdicts.
pub mod judge;
/// The error rates of a whole verification.
pub mod levels;

/// Verdicts for continuous integration.
pub mod junit;
/// What verification says.
pub mod verdict;

/// Efficiencies of all pairs of estimators.
pub mod comparisons;
/// Claims of efficiency.
pub mod efficiency;
/// What counts of work cost.
pub mod weights;

/// Claims that a record comes out again.
mod reproduction;

/// What one comparison shows by itself.
mod trial;
