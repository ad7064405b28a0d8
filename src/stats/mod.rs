//! Moments, tests, multiplicity. The only module that uses `statrs`, and of it only survival functions.

/// Two estimators at equal cost.
pub mod efficiency;
/// E-values: evidence that multiplies.
pub(crate) mod evidence;
/// Tests of samples against known probabilities.
pub(crate) mod goodness;
/// Significance tests of means, and the smallest difference that they detect.
pub mod hypothesis;
/// What a mean is at least, without a word about its tail.
pub(crate) mod lower_bound;
/// Mergeable moments of scalars and images.
pub mod moments;
/// Many tests under one error rate.
pub(crate) mod multiplicity;
/// Sums of symmetric terms.
pub(crate) mod signs;
/// Survival functions and their inverses.
pub(crate) mod tails;
/// The fixed dyadic reduction over passes.
pub mod tree;

/// Every test under hypotheses that are true by construction.
#[cfg(test)]
pub(crate) mod calibration;
/// Whether p-values are uniform.
#[cfg(test)]
pub(crate) mod kolmogorov;
