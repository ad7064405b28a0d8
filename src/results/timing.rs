//! Times of a run: measured, kept apart from the record, and never byte-identical.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// `timing.json`: by cell label, then estimator name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// [`Stored::numbers`](super::store::Stored::numbers) of the record that was timed. A crash between record and
    /// timing leaves the timing of another record, which is not read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record: Option<String>,
    /// Cell label -> estimator -> cost.
    pub cells: BTreeMap<String, BTreeMap<String, TimeSpent>>,
    /// Cell label -> estimator -> CPU time by batch of the record.
    #[serde(default)]
    pub batches: BTreeMap<String, BTreeMap<String, Batches>>,
}

/// CPU time by batch of the record, in the order of the batches.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Batches {
    /// Number of processes that ran them: more than one where a run was stopped and resumed.
    pub processes: u64,
    /// CPU seconds of a batch.
    pub cpu_seconds: Vec<f64>,
    /// Was the whole batch interleaved with its rivals, by a worker that was warm? A ratio of CPU times
    /// that is called interleaved rests on such batches alone.
    pub settled: Vec<bool>,
    /// Of the batch's passes that were run twice, the CPU seconds of the run that counts and of the
    /// other: the same work at another place in the order, so that their ratio is the machine's alone.
    /// Zeros where there are none.
    #[serde(default)]
    pub twice: Vec<[f64; 2]>,
}

/// Time spent on one estimator in one cell, all bands together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeSpent {
    /// CPU seconds of the passes, summed over threads.
    pub cpu_seconds: f64,
    /// CPU seconds before the first pass: building the estimator, and what its walks had to learn.
    #[serde(default)]
    pub set_up_seconds: f64,
    /// Wall-clock seconds of its blocks, summed; with several threads they overlap.
    pub wall_seconds: f64,
    /// Passes that took that time; fewer than the record's where a resumed run lost its timing.
    pub passes: u64,
    /// Paths traced.
    pub paths: u64,
}

impl Timing {
    /// Adds a block's cost.
    pub fn add(&mut self, cell: &str, estimator: &str, cost: TimeSpent) {
        let sum = self.cells.entry(cell.into()).or_default().entry(estimator.into()).or_default();
        sum.cpu_seconds += cost.cpu_seconds;
        sum.set_up_seconds += cost.set_up_seconds;
        sum.wall_seconds += cost.wall_seconds;
        sum.passes += cost.passes;
        sum.paths += cost.paths;
    }

    /// Puts down the batches of one estimator in one cell.
    pub fn set_batches(&mut self, cell: &str, estimator: &str, batches: Batches) {
        self.batches.entry(cell.into()).or_default().insert(estimator.into(), batches);
    }

    /// CPU time by batch of one estimator in one cell.
    pub fn batches_of(&self, cell: &str, estimator: &str) -> Option<&Batches> {
        self.batches.get(cell)?.get(estimator)
    }

    /// What was measured of one estimator in one cell.
    pub fn of(&self, cell: &str, estimator: &str) -> Option<&TimeSpent> {
        self.cells.get(cell)?.get(estimator)
    }
}

impl TimeSpent {
    /// CPU seconds of everything.
    pub fn all_seconds(&self) -> f64 {
        self.cpu_seconds + self.set_up_seconds
    }

    /// CPU seconds per pass, each with its part of the set-up; nothing where no pass was timed.
    pub fn cpu_seconds_per_pass(&self) -> Option<f64> {
        (self.passes > 0).then(|| self.all_seconds() / self.passes as f64)
    }

    /// Paths per CPU second.
    pub fn paths_per_second(&self) -> Option<f64> {
        (self.cpu_seconds > 0.0).then(|| self.paths as f64 / self.cpu_seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_add_up() {
        let mut timing = Timing::default();
        let block = TimeSpent {
            cpu_seconds: 0.5,
            set_up_seconds: 0.25,
            wall_seconds: 0.75,
            passes: 4,
            paths: 100,
        };
        timing.add("a", "mis", block);
        timing.add("a", "mis", block);
        let cost = timing.of("a", "mis").expect("a cost");
        assert_eq!((cost.cpu_seconds_per_pass(), cost.paths_per_second()), (Some(0.1875), Some(200.0)));
        assert!(timing.of("a", "snee").is_none());
        assert!(TimeSpent::default().cpu_seconds_per_pass().is_none());
    }
}
