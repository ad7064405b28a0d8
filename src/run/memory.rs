//! Memory of a run, and whether it fits.

use super::job::{Job, Passes};
use super::memory_limits::{Available, readable};
use crate::error::{Error, Result};

/// Estimate of a run's largest memory, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct MemoryEstimate {
    /// Meshes and maps, bytes.
    pub shapes: usize,
    /// What estimators hold for all their passes, such as what guides walks, bytes.
    pub guides: usize,
    /// Additional memory while the largest mesh is made, before anything runs, bytes.
    pub building: usize,
    /// Moments of observables and images of everything measured, kept until the record is written.
    pub results: usize,
    /// Additional memory of the threads and the collector during the run, bytes.
    pub working: usize,
}

impl MemoryEstimate {
    /// Estimate for jobs on a number of threads, whose scenes hold `shapes` bytes, and take `building`
    /// more while they are made.
    ///
    /// An image keeps mean and M2, 16 bytes a pixel and band. A finished job holds one, and the record's
    /// array beside it; and 128 batches of 5 moments per observable, likewise twice. A job under way
    /// holds one image per bit of its passes, and as much again while its state is written. Each thread
    /// holds the images of its block (sized by time: large images have blocks of a few passes) and one
    /// more waits to be collected. Where the estimators of a cell are interleaved, they are under way
    /// together, and two blocks of each may wait for the turn of those before them. What an estimator
    /// needs for a pass it needs on each thread.
    pub(crate) fn new(
        jobs: &[Job],
        [shapes, building]: [usize; 2],
        threads: usize,
        passes: Option<u64>,
        is_interleaved: bool,
    ) -> MemoryEstimate {
        let jobs: Vec<&Passes> = jobs.iter().filter_map(Job::passes).collect();
        let image = |job: &Passes| 16 * job.layout.pixels() * job.layout.bands();
        let moments = |job: &Passes| 128 * 40 * job.layout.observables().len() * job.layout.bands();
        let largest = jobs.iter().map(|job| image(job)).max().unwrap_or(0);
        let own = jobs.iter().map(|job| job.estimator.working_bytes()).max().unwrap_or(0);
        let of_cell = |cell| jobs.iter().filter(|job| job.cell == cell).count();
        let arms =
            jobs.iter().map(|job| of_cell(job.cell)).max().filter(|_| is_interleaved).unwrap_or(1);
        let bits = passes.map_or(20, |passes| passes.max(1).ilog2() as usize + 1);
        MemoryEstimate {
            shapes,
            guides: jobs.iter().map(|job| job.estimator.held_bytes()).sum(),
            building,
            results: jobs.iter().map(|job| 2 * (image(job) + moments(job))).sum(),
            working: (2 * bits * arms + (3 + 2 * arms) * threads) * largest + threads * own,
        }
    }

    /// Total, bytes.
    pub(crate) fn total(&self) -> usize {
        self.shapes + self.building.max(self.guides + self.results + self.working)
    }

    /// Whether it fits into nine tenths of the memory that the system has to give.
    pub(crate) fn fits(&self, available: Option<Available>) -> bool {
        available.is_none_or(|available| self.total() <= available.bytes / 10 * 9)
    }

    /// Refuses what does not fit.
    ///
    /// # Errors
    /// More than nine tenths of the memory available.
    pub(crate) fn check(&self, available: Option<Available>) -> Result<()> {
        match available {
            Some(available) if !self.fits(Some(available)) => Err(Error::input_help(
                format!(
                    "the run would need {} of memory and {} are available",
                    readable(self.total()),
                    available.words()
                ),
                "lower the sensor's resolution, the number of bands or cells, or split the experiment; \
                 `scatterproof plan` shows what needs how much",
            )),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused() {
        let estimate = MemoryEstimate { results: 950, ..MemoryEstimate::default() };
        let of = |bytes| Some(Available { bytes, limit: "of the test" });
        let message = estimate.check(of(1000)).expect_err("refused").to_string();
        assert!(message.contains("1000 B (of the test) are available"), "{message}");
        assert!(estimate.check(of(2000)).is_ok());
        assert!(estimate.check(None).is_ok());
        // What makes a mesh is gone when passes run: the larger of the two counts.
        let mesh = MemoryEstimate { shapes: 300, guides: 0, building: 500, results: 200, working: 100 };
        assert_eq!(mesh.total(), 800);
        assert_eq!(MemoryEstimate { guides: 300, ..mesh }.total(), 900);
        assert_eq!(MemoryEstimate { building: 250, ..mesh }.total(), 600);
    }
}
