//! The error rates of a whole verification, and how two looks share them.
//!
//! All tests of one verification, m of them, are one family; Holm's adjusted p-values bound the
//! probability of any false failure under any dependence. A test fails
//!   at once, where its adjusted p-value is below `AT_ONCE`, or
//!   at the second look: its adjusted p-value is below `FIRST_LOOK`, and the same quantity, measured again
//!   on new streams with `RETEST_FACTOR` times the passes, has a p-value, adjusted over all second looks,
//!   below `SECOND_LOOK`.
//! A correct family fails at once with probability at most 5e-7. It needs any second look with
//! probability at most 1e-3, and fails it, the streams being independent, with conditional probability
//! at most 5e-4: together at most 5e-7 + 1e-3 * 5e-4 = 1e-6 = `FAMILY_LEVEL`.
//!
//! The gain: a defect is found with 99 % probability at the first look's critical value plus 2.33
//! standard errors, and the second look sees it at twice that distance, so nothing is lost there. For
//! m = 300 the first look cuts at 4.65 standard errors where one look at 1e-6 would cut at 5.91: 6.98
//! against 8.24 standard errors to be found, 1.4 times fewer passes.
//!
//! The second look is independent of the first only as far as the two share no errors. A published value
//! has the same stated error in both. Where this error is more than `SHARED_ERROR` of the sampling error, or
//! where a test sums over many measurements, there is one look, at `AT_ONCE`.

/// The probability of any false failure in one whole verification is at most this.
pub(crate) const FAMILY_LEVEL: f64 = 1e-6;

/// Family-wise level below which a test fails without a second look.
pub(crate) const AT_ONCE: f64 = 0.5 * FAMILY_LEVEL;

/// Family-wise level below which a test is looked at again.
pub(crate) const FIRST_LOOK: f64 = 1e-3;

/// Family-wise level of the second looks.
pub(crate) const SECOND_LOOK: f64 = 5e-4;

/// Passes of a second look over those of the first.
pub(crate) const RETEST_FACTOR: u64 = 4;

/// Largest stated error, relative to the sampling error, of a reference that both looks may share: with
/// e = 0.02 s a first look at 6 s moves the second, whose error is s/2, by 0.0048 of its standard errors
/// towards failing, which raises its level by less than 2 %.
pub(crate) const SHARED_ERROR: f64 = 0.02;

/// The probability with which a difference of size `detectable` is found.
pub(crate) const POWER: f64 = 0.99;

/// How many looks a family of tests has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Looks {
    /// One look, at this family-wise level.
    One {
        /// The probability of any false failure.
        level: f64,
    },
    /// Second looks exist or can be run.
    Two,
}

impl Looks {
    /// A single record, without second looks.
    pub(crate) const ALONE: Looks = Looks::One { level: FAMILY_LEVEL };

    /// The family-wise level at which a test fails at once.
    pub(crate) fn at_once(self) -> f64 {
        match self {
            Looks::One { level } => level,
            Looks::Two => AT_ONCE,
        }
    }

    /// The family-wise level that a test's power rests on.
    pub(crate) fn first(self, one_look: bool) -> f64 {
        match self {
            Looks::Two if !one_look => FIRST_LOOK,
            looks => looks.at_once(),
        }
    }
}

const _: () = assert!(AT_ONCE + FIRST_LOOK * SECOND_LOOK <= FAMILY_LEVEL * (1.0 + 1e-12));
