//! Memory of a run, and whether it fits.

use super::job::{Job, Passes};
use crate::error::{Error, Result};

/// Estimate of a run's largest memory, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct MemoryEstimate {
    /// Meshes and maps, bytes.
    pub shapes: usize,
    /// Moments of observables and images of everything measured, kept until the record is written.
    pub results: usize,
    /// Additional memory of the threads and the collector during the run, bytes.
    pub working: usize,
}

impl MemoryEstimate {
    /// Estimate for jobs on a number of threads, whose scenes hold `shapes` bytes.
    ///
    /// An image keeps mean and M2, 16 bytes a pixel and band. A finished job holds one, and the record's
    /// array beside it; and 128 batches of 5 moments per observable, likewise twice. A job under way
    /// holds one image per bit of its passes, and as much again while its state is written. Each thread
    /// holds the images of its block (sized by time: large images have blocks of a few passes) and one
    /// more waits to be collected. Jobs that are timed side by side are under way together, and two
    /// batches of each may wait for the turn of those before them. What an estimator needs for a pass it
    /// needs on each thread.
    pub(crate) fn new(
        jobs: &[Job],
        shapes: usize,
        threads: usize,
        passes: Option<u64>,
    ) -> MemoryEstimate {
        let jobs: Vec<&Passes> = jobs.iter().filter_map(Job::passes).collect();
        let image = |job: &Passes| 16 * job.layout.pixels() * job.layout.bands();
        let moments = |job: &Passes| 128 * 40 * job.layout.observables().len() * job.layout.bands();
        let largest = jobs.iter().map(|job| image(job)).max().unwrap_or(0);
        let own = jobs.iter().map(|job| job.estimator.working_bytes()).max().unwrap_or(0);
        let side_by_side = |group| jobs.iter().filter(|job| job.side_by_side() == Some(group)).count();
        let arms = jobs.iter().filter_map(|job| job.side_by_side()).map(side_by_side).max().unwrap_or(1);
        let bits = passes.map_or(20, |passes| passes.max(1).ilog2() as usize + 1);
        MemoryEstimate {
            shapes,
            results: jobs.iter().map(|job| 2 * (image(job) + moments(job))).sum(),
            working: (2 * bits * arms + (3 + 2 * arms) * threads) * largest + threads * own,
        }
    }

    /// Total, bytes.
    pub(crate) fn total(&self) -> usize {
        self.shapes + self.results + self.working
    }

    /// Refuses what does not fit into the memory that the system has to give.
    ///
    /// # Errors
    /// More than nine tenths of the memory available.
    pub(crate) fn check(&self, available: Option<usize>) -> Result<()> {
        match available {
            Some(available) if self.total() > available / 10 * 9 => Err(Error::input_help(
                format!(
                    "the run would need {} of memory and {} are available",
                    readable(self.total()),
                    readable(available)
                ),
                "lower the sensor's resolution, the number of bands or cells, or split the experiment; \
                 `scatterproof plan` shows what needs how much",
            )),
            _ => Ok(()),
        }
    }
}

/// Memory that the system can give without swapping, bytes; `None` where it does not report it.
pub(crate) fn available() -> Option<usize> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: usize = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// A number of bytes for people.
pub(crate) fn readable(bytes: usize) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB", "PiB"];
    let mut value = bytes as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < units.len() {
        value /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{bytes} B") } else { format!("{value:.1} {}", units[unit]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused() {
        let estimate = MemoryEstimate { shapes: 0, results: 950, working: 0 };
        assert!(estimate.check(Some(1000)).is_err());
        assert!(estimate.check(Some(2000)).is_ok());
        assert!(estimate.check(None).is_ok());
    }

    #[test]
    fn bytes_for_people() {
        assert_eq!(readable(999), "999 B");
        assert_eq!(readable(3 << 20), "3.0 MiB");
    }
}
