//! Efficiencies by CPU time in two records: whether the second's ratios are those of the first.
//!
//! Times are never the same twice, but their ratios should be: the log ratios of one pair of estimators in
//! both records differ by chance within sqrt(s_a^2 + s_b^2), s the half width of the 95 % interval over
//! 1.96. Where both records hold the same numbers the variances in the two ratios are the same as well,
//! and only the costs differ by chance: the test is then wider than it need be. Another machine may
//! truly have another ratio.

use super::comparisons::{EfficiencyRow, comparisons};
use crate::math;
use crate::results::record::CostMeasure;
use crate::results::store::Stored;
use crate::stats::multiplicity::holm;
use crate::stats::tails::normal_two_sided;

/// The probability that any ratio of a comparison is reported as different although none is.
pub(crate) const LEVEL: f64 = 1e-3;

/// Standard errors in half a 95 % interval.
const HALF_WIDTH: f64 = 1.96;

/// One pair of estimators in both records.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TimingRatio {
    /// Row of the first record.
    pub before: EfficiencyRow,
    /// Row of the second record.
    pub after: EfficiencyRow,
    /// The second's ratio over the first's.
    pub change: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// p-value of no change, adjusted for all of the comparison (Holm).
    pub adjusted_p: f64,
}

impl TimingRatio {
    /// Whether the two ratios are compatible.
    pub(crate) fn is_compatible(&self) -> bool {
        self.adjusted_p >= LEVEL
    }
}

/// Every efficiency by CPU time that both records quote.
pub(crate) fn timing_ratios(before: &Stored, after: &Stored) -> Vec<TimingRatio> {
    let name = |row: &EfficiencyRow| {
        [&row.cell, &row.band, &row.class, &row.metric, &row.baseline, &row.candidate].map(String::clone)
    };
    let after = comparisons(after);
    let after: Vec<&EfficiencyRow> = after.iter().filter(|row| row.cost == CostMeasure::Cpu).collect();
    let before = comparisons(before).into_iter().filter(|row| row.cost == CostMeasure::Cpu);
    let pairs: Vec<(EfficiencyRow, EfficiencyRow, (f64, f64))> = before
        .filter_map(|row| {
            let twin = (*after.iter().find(|other| name(other) == name(&row))?).clone();
            let change = log_change(row.quoted()?, twin.quoted()?);
            Some((row, twin, change))
        })
        .collect();
    let p: Vec<f64> =
        pairs.iter().map(|(_, _, (change, error))| normal_two_sided(change / error)).collect();
    let adjusted = holm(&p);
    let mut ratios = Vec::new();
    for ((before, after, (change, error)), adjusted_p) in pairs.into_iter().zip(adjusted) {
        let interval = [-1.0, 1.0].map(|side| math::exp(change + side * HALF_WIDTH * error));
        ratios.push(TimingRatio { before, after, change: math::exp(change), interval, adjusted_p });
    }
    ratios
}

/// Logarithm of the second ratio over the first, and its standard error.
fn log_change(a: [f64; 3], b: [f64; 3]) -> (f64, f64) {
    let error = |[_, low, high]: [f64; 3]| math::ln(high / low) / (2.0 * HALF_WIDTH);
    (math::ln(b[0] / a[0]), (error(a) * error(a) + error(b) * error(b)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample::{self, PASSES};
    use crate::results::timing::{Batches, TimeSpent, Timing};

    /// The sample with times: `snee` takes `slower` times as long as `mis`, with some noise.
    fn timed(slower: f64, seed: u64) -> Stored {
        let mut stored = sample::stored(0.1);
        let mut timing = Timing::default();
        let batches = PASSES / 4;
        for (name, factor) in [("mis", 1.0), ("snee", slower)] {
            let seconds = |i: u64| factor * 0.01 * (1.0 + 0.05 * sample::uniform(seed + i));
            let cpu_seconds: Vec<f64> = (0..batches).map(seconds).collect();
            let all: f64 = cpu_seconds.iter().sum();
            let cost = TimeSpent {
                cpu_seconds: all,
                set_up_seconds: 0.0,
                wall_seconds: all,
                passes: PASSES,
                paths: 1,
            };
            timing.add("smooth", name, cost);
            let settled = vec![true; cpu_seconds.len()];
            timing.set_batches(
                "smooth",
                name,
                Batches { processes: 1, cpu_seconds, settled, twice: vec![] },
            );
        }
        stored.timing = Some(timing);
        stored
    }

    #[test]
    fn the_same_ratio_measured_twice_is_compatible() {
        let ratios = timing_ratios(&timed(2.0, 0), &timed(2.0, 5000));
        assert_eq!(ratios.len(), 6, "two classes and the pixels, in two bands");
        assert!(ratios.iter().all(|r| r.is_compatible() && (r.change - 1.0).abs() < 0.05), "{ratios:?}");
    }

    #[test]
    fn another_ratio_is_seen() {
        let ratios = timing_ratios(&timed(2.0, 0), &timed(6.0, 5000));
        assert!(ratios.iter().any(|r| !r.is_compatible() && r.change < 0.5), "{ratios:?}");
        assert!(timing_ratios(&timed(2.0, 0), &sample::stored(0.1)).is_empty(), "no time, no ratio");
    }
}
