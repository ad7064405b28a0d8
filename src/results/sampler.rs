//! Samplers in a record: counts, and the masses of the same bins under their densities.

use serde::{Deserialize, Serialize};

/// One sampler's draws, held beside its density.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SamplerRun {
    /// The name the experiment gives it.
    pub sampler: String,
    /// Kind of the sampler.
    pub kind: String,
    /// Number of draws.
    pub samples: u64,
    /// Path of the coarse bins, `[3][bins]` f64: draws counted, mass, bound of the mass's error.
    pub coarse: String,
    /// The same for the fine bins, where there are more of them.
    pub fine: Option<String>,
    /// The same for pairs of consecutive draws by groups of coarse bins, `[3][groups][groups]`; a pair
    /// with a draw that is in no bin is not counted. None where there are not draws enough.
    pub serial: Option<String>,
    /// Discrete outcomes.
    pub deltas: Vec<Delta>,
    /// Draws that returned nothing.
    pub nulls: u64,
    /// How often that should be.
    pub null: NullMass,
    /// Draws where the density is 0 or not finite, or outside the chart: none can be right.
    pub outside: u64,
    /// Draws whose own density differs from the density function's there by more than [`OWN_DENSITY`], and by more than the
    /// rounding that the sampler states there.
    pub own_density_differs: u64,
    /// The largest such relative difference; at most 1e300.
    pub own_density_largest: f64,
    /// Integral of the density over all pieces, plus the discrete masses and a stated null.
    pub total: f64,
    /// Bound of its quadrature error.
    pub total_bound: f64,
    /// Evaluations of the density that the masses took.
    pub evaluations: u64,
    /// Evaluations of the density that were negative or not finite; they count as 0.
    pub senseless: u64,
    /// Values of contrasts of draws that were not finite; they are not in the moments.
    pub senseless_contrasts: u64,
    /// Whether the budget of evaluations ended before the masses were as exact as was wanted.
    pub exhausted: bool,
    /// Directed contrasts.
    pub contrasts: Vec<ContrastRun>,
}

/// Relative difference between a draw's own density and the density function's that counts.
pub const OWN_DENSITY: f64 = 1e-9;

/// A discrete outcome.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delta {
    /// Name.
    pub name: String,
    /// Probability of the outcome.
    pub mass: f64,
    /// Number of draws with this outcome.
    pub observed: u64,
    /// Draws whose value was not the stated one.
    pub inexact: u64,
}

/// Probability that a sampler returns no sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NullMass {
    /// The event has probability zero.
    Never,
    /// The event has this probability.
    Stated(f64),
    /// With what the densities leave of 1.
    Remainder,
}

/// The mean of a bounded function over all draws.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContrastRun {
    /// Name.
    pub name: String,
    /// Count, mean, and the sums of second, third and fourth powers of deviations from the mean.
    pub moments: [f64; 5],
    /// Its mean by definition or by quadrature.
    pub expected: f64,
    /// Bound of the quadrature's error; 0 where it is known by definition.
    pub bound: f64,
}

/// Path of the bins of sampler number `index`, relative to the record's folder.
pub fn bins_path(index: usize, which: &str) -> String {
    format!("samplers/{index:03}.{which}.npy")
}
