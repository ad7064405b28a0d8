//! Claims and records in, verdicts out. Pure: a verdict is a function of records and a level.

/// From comparisons to verdicts.
pub mod judge;
/// Verdicts for continuous integration.
pub mod junit;
/// What verification says.
pub mod verdict;

/// What one comparison shows by itself.
mod trial;
