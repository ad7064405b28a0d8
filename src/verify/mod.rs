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

/// What a sampler's record shows.
mod sampler;
/// What one comparison shows by itself.
mod trial;
