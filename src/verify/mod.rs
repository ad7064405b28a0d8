//! Claims and records in, verdicts out. Pure: a verdict is a function of records and a level.

/// Two records of one experiment: what changed.
pub mod difference;
/// Images rendered elsewhere against a record.
pub mod foreign;
/// From comparisons to verdicts.
pub mod judge;
/// Verdicts for continuous integration.
pub mod junit;
/// What verification says.
pub mod verdict;

/// Tests under one family-wise level.
mod family;
/// What one comparison shows by itself.
mod trial;
