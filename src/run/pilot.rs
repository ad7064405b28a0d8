//! Converts budgets into passes. Stopping by elapsed time or by the error reached would bias a mean, so a
//! pilot run on separate streams fixes an integer number of passes before the run starts.

use super::job::Passes;
use super::keys::Stage;
use crate::experiment::schema::{Budget, RelativeError};
use crate::stats::moments::Moments;
use crate::stats::tree::Counter;

/// A pilot keeps no batches.
const ALL: u32 = Counter::<Vec<Moments>>::MERGE_ALL;

/// Fewest passes of a run: every batch of its record then holds at least one.
pub(crate) const LEAST_PASSES: u64 = 128;

/// The passes that a budget pays for; `None` where `stop` was raised.
pub(crate) fn passes(job: &Passes, budget: &Budget, stop: &dyn Fn() -> bool) -> Option<u64> {
    passes_by_pilot(job, budget, f64::INFINITY, stop)
}

/// [`passes`], with a pilot of about `longest` CPU seconds at most where the budget is in seconds.
fn passes_by_pilot(job: &Passes, budget: &Budget, longest: f64, stop: &dyn Fn() -> bool) -> Option<u64> {
    if job.count.is_some() {
        return job.count;
    }
    match job.terms.budget.as_ref().unwrap_or(budget) {
        // A share of 1 leaves any number of passes as it is.
        Budget::Passes(passes) => Some(((*passes as f64 * job.terms.share).round() as u64).max(2)),
        Budget::CpuSeconds(seconds) => {
            let seconds = seconds * job.terms.share;
            for_seconds(job, seconds, (seconds / 20.0).min(longest), stop)
        }
        Budget::RelativeError(target) => for_error(job, target, stop),
    }
}

/// CPU seconds of a pilot that is long enough for an estimate.
const SHORT: f64 = 0.02;

/// Passes that a budget pays for and the CPU seconds they will take, from a short pilot; `None` where
/// the pilot saw nothing to time.
pub(crate) fn estimate_seconds(job: &Passes, budget: &Budget) -> Option<(u64, f64)> {
    let passes = passes_by_pilot(job, budget, SHORT, &|| false)?;
    let mut tried = 1;
    loop {
        let cpu = job.run(Stage::Pilot, 0, tried, ALL, &|| false)?.cpu_seconds();
        if cpu > SHORT || tried >= passes {
            return Some((passes, cpu / tried as f64 * passes as f64));
        }
        tried *= 2;
    }
}

/// Doubles the pilot until it has used these CPU seconds, then divides.
fn for_seconds(job: &Passes, seconds: f64, pilot: f64, stop: &dyn Fn() -> bool) -> Option<u64> {
    let mut passes = 1;
    loop {
        let cpu = job.run(Stage::Pilot, 0, passes, ALL, stop)?.cpu_seconds();
        if cpu > pilot || passes >= 1 << 20 {
            return Some(((seconds * passes as f64 / cpu) as u64).max(2));
        }
        passes *= 2;
    }
}

/// A pilot has at least this part of the passes that it asks for, so that its variance rests on a
/// substantial part of the run.
const PILOT_SHARE: u64 = 16;
/// Standard deviations by which both estimates below are taken to err.
const SURENESS: f64 = 2.5;
/// Batches of a record's smallest standard error: it fluctuates by 1/sqrt(2 * 64) of itself, and the
/// error that the record *shows* must keep the bound.
const FEWEST_BATCHES: f64 = 64.0;
/// A pilot longer than this would be the run.
const LONGEST_PILOT: u64 = 1 << 17;

/// Doubles the pilot until the passes that it predicts are at most [`PILOT_SHARE`] times its own.
fn for_error(job: &Passes, target: &RelativeError, stop: &dyn Fn() -> bool) -> Option<u64> {
    let mut pilot = Counter::new(0, ALL);
    let mut length = LEAST_PASSES;
    loop {
        let more = job.run(Stage::Pilot, pilot.next_pass(), length, ALL, stop)?;
        for node in more.moments.nodes() {
            pilot.push_node(node.level, node.value.clone());
        }
        let moments = pilot.clone().finish().unwrap_or_default();
        let bands = job.layout.bands();
        let wanted = job.terms.targets.iter().flat_map(|t| &moments[t * bands..(t + 1) * bands]);
        let needed = wanted.map(|m| needed_passes(m, target)).max().unwrap_or(0);
        if needed <= PILOT_SHARE * length || length >= LONGEST_PILOT {
            return Some(needed.clamp(LEAST_PASSES, PILOT_SHARE * LONGEST_PILOT));
        }
        length *= 2;
    }
}

/// Passes until standard error over |mean| is at most the target; as many as can be where nothing has
/// been seen yet. The variance of n passes is known to sqrt((kurtosis - 1) / n) of itself, and the
/// standard error of the run to 1 / sqrt(2 * batches): both get [`SURENESS`].
fn needed_passes(moments: &Moments, target: &RelativeError) -> u64 {
    let (mean, variance) = (moments.mean.abs(), moments.variance());
    if variance == 0.0 && mean == 0.0 {
        return u64::MAX / 2;
    }
    let bound = match &target.small_values {
        Some(small) if mean < small.below => small.at_most,
        _ => target.at_most,
    };
    let pilot = 1.0 + SURENESS * ((moments.kurtosis() - 1.0).max(0.0) / moments.n as f64).sqrt();
    let shown = 1.0 + SURENESS / (2.0 * FEWEST_BATCHES).sqrt();
    let needed = variance * pilot / (mean * mean * bound * bound) * shown * shown;
    needed.min(9e18).ceil() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::schema::SmallValues;

    fn moments(mean: f64, sd: f64) -> Moments {
        let mut moments = Moments::default();
        for i in 0..1000 {
            moments.push(mean + if i % 2 == 0 { sd } else { -sd });
        }
        moments
    }

    #[test]
    fn error_targets_become_passes() {
        let small_values = Some(SmallValues { below: 0.05, at_most: 0.02 });
        let target = RelativeError { at_most: 0.01, small_values };
        // Two values, kurtosis 1: the pilot's variance is exact. (sd / (mean * target))^2 = 2502.5, with
        // the margin of the error shown (1 + 2.5 / sqrt(128))^2 = 1.4907.
        assert_eq!(needed_passes(&moments(1.0, 0.5), &target), 3731);
        assert_eq!(needed_passes(&moments(0.04, 0.04), &target), 3731);
        assert_eq!(needed_passes(&moments(2.0, 0.0), &target), 0);
        assert!(needed_passes(&moments(0.0, 0.0), &target) > 1 << 60);
    }
}
