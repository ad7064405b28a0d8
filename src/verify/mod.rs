//! Turns claims and records into verdicts and a list of the cases that need a second look. A verdict is a
//! pure function of records and levels.

/// Two records of one experiment: what changed.
pub(crate) mod difference;
/// Images rendered elsewhere against a record.
pub(crate) mod foreign;
/// From comparisons to verdicts.
pub(crate) mod judge;
/// The error rates of a whole verification.
pub(crate) mod levels;

/// Verdicts for continuous integration.
pub(crate) mod junit;
/// Verdicts: the outcome of every test, as it is shown.
pub(crate) mod verdict;

/// Efficiencies of all pairs of estimators.
pub(crate) mod comparisons;
/// Claims of efficiency.
pub(crate) mod efficiency;
/// Errors of models against transport.
pub(crate) mod model_errors;
/// Efficiencies by CPU time in two records.
pub(crate) mod timing_ratios;
/// Cost of counted work.
pub mod weights;

/// Evidence that adds up over nights.
pub(crate) mod nights;

/// Evidence of one test by itself.
mod evidence;
/// Tests under one family-wise level.
mod family;
/// Means against values and against each other.
pub(crate) mod means;
/// Claims that a record is reproduced.
mod reproduction;
/// Tests of samplers.
mod sampler;
/// Evidence of the comparisons of a record.
mod trial;
