//! Claims and records in, verdicts out, and a list of what wants a second look. Pure: a verdict is a
//! function of records and levels.

/// Two records of one experiment: what changed.
pub mod difference;
/// Images rendered elsewhere against a record.
pub mod foreign;
/// From comparisons to verdicts.
pub mod judge;
/// The error rates of a whole verification.
pub mod levels;

/// Verdicts for continuous integration.
pub mod junit;
/// Verdicts: the outcome of every test, as it is shown.
pub mod verdict;

/// Efficiencies of all pairs of estimators.
pub mod comparisons;
/// Claims of efficiency.
pub mod efficiency;
/// What models are off by.
pub mod model_errors;
/// Efficiencies by CPU time, measured twice.
pub mod timing_ratios;
/// What counts of work cost.
pub mod weights;

/// Evidence that adds up over nights.
pub mod nights;

/// What one test shows by itself.
mod evidence;
/// Tests under one family-wise level.
mod family;
/// Means against values and against each other.
mod means;
/// Claims that a record comes out again.
mod reproduction;
/// What a sampler's record shows.
mod sampler;
/// What the comparisons of a record show.
mod trial;
