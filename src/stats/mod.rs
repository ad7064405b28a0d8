//! Moments, tests, multiplicity. Door for `statrs`, of which only survival functions are used.

/// Significance tests of means, and what they can detect.
pub mod hypothesis;
/// Mergeable moments of scalars and images.
pub mod moments;
/// Many tests under one error rate.
pub mod multiplicity;
/// Ratios of positive estimates.
pub mod ratio;
/// Sums of symmetric terms.
pub mod signs;
/// The fixed dyadic reduction over passes.
pub mod tree;
