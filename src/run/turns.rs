//! Which passes of the estimators of a cell run together, and in which order.

use super::job::Job;
use crate::stats::tree::batch_level;

/// A job among those of its group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lane {
    /// Index of the job.
    pub job: usize,
    /// Number of all its passes.
    pub passes: u64,
    /// The first that is not done.
    pub next: u64,
    /// The one after the last that is run here.
    pub end: u64,
}

/// A run of passes of one job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    /// Index of the job.
    pub job: usize,
    /// Its first pass.
    pub start: u64,
    /// The one after its last.
    pub end: u64,
    /// Level of the tree over passes at which batches are kept.
    pub keep_level: u32,
    /// Whether the passes run a second time.
    pub twice: Option<Second>,
}

/// When passes run a second time as a control of CPU time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Second {
    /// Before the run that counts.
    Before,
    /// After it.
    After,
}

/// The jobs of a cell together, where they are interleaved; the others one by one.
pub(super) fn groups(jobs: &[Job], is_interleaved: bool) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let cell = |index: usize| jobs[index].passes().map(|passes| passes.cell).filter(|_| is_interleaved);
    for index in 0..jobs.len() {
        let own = cell(index);
        match groups.iter_mut().find(|group| own.is_some() && cell(group[0]) == own) {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    groups
}

/// Whole batches of the longest lane for which every lane has completed its part.
pub(super) fn done_everywhere(lanes: &[Lane]) -> u64 {
    let longest = lanes.iter().map(|lane| lane.passes).max().unwrap_or(0);
    let part =
        |lane: &Lane| u128::from(lane.next) * u128::from(longest) / u128::from(lane.passes.max(1));
    let level = batch_level(longest);
    (lanes.iter().map(part).min().unwrap_or(0) as u64 >> level) << level
}

/// The pass of the longest lane after which no lane has any left.
pub(super) fn last(lanes: &[Lane]) -> u64 {
    let longest = lanes.iter().map(|lane| lane.passes).max().unwrap_or(0);
    let end = |lane: &Lane| {
        (u128::from(lane.end) * u128::from(longest)).div_ceil(u128::from(lane.passes.max(1))) as u64
    };
    lanes.iter().map(end).max().unwrap_or(0)
}

/// The passes [from, from + length) of the longest lane and the same part of every other, in the order
/// A B .. B A, except for passes that are done already; and whether none of them was. A single last pass is not
/// split over both directions of the order.
pub(super) fn turn(lanes: &[Lane], from: u64, length: u64, runs_twice: bool) -> (Vec<Span>, bool) {
    let longest = lanes.iter().map(|lane| lane.passes).max().unwrap_or(0);
    let [middle, end] = [length.div_ceil(2), length].map(|passes| longest.min(from + passes));
    let span = |lane: &Lane, (from, to): (u64, u64), second: Second| {
        let part = u128::from(lane.passes);
        let at = |pass: u64| (u128::from(pass) * part / u128::from(longest)) as u64;
        let keep_level = batch_level(lane.passes);
        let twice = (runs_twice && lane.job == lanes[0].job).then_some(second);
        Span { job: lane.job, start: at(from), end: at(to), keep_level, twice }
    };
    let there = lanes.iter().map(|lane| (lane, span(lane, (from, middle), Second::After)));
    let back = lanes.iter().rev().map(|lane| (lane, span(lane, (middle, end), Second::Before)));
    let spans: Vec<(&Lane, Span)> = there.chain(back).collect();
    let is_whole =
        length > 1 && spans.iter().all(|(lane, span)| span.start >= lane.next && span.end <= lane.end);
    let left = |(lane, span): (&Lane, Span)| Span {
        start: span.start.max(lane.next),
        end: span.end.min(lane.end),
        ..span
    };
    (spans.into_iter().map(left).filter(|span| span.start < span.end).collect(), is_whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (job, first pass, last) of a turn.
    fn order(lanes: &[Lane], from: u64, length: u64) -> (Vec<(usize, u64, u64)>, bool) {
        let (spans, is_whole) = turn(lanes, from, length, false);
        (spans.iter().map(|s| (s.job, s.start, s.end)).collect(), is_whole)
    }

    #[test]
    fn rivals_run_in_an_order_that_cancels_drift() {
        let lane = |job| Lane { job, passes: 300, next: 0, end: 300 };
        let lanes = [lane(3), lane(5), lane(8)];
        let (spans, is_whole) = order(&lanes, 8, 8);
        assert!(is_whole);
        let expected = [(3, 8, 12), (5, 8, 12), (8, 8, 12), (8, 12, 16), (5, 12, 16), (3, 12, 16)];
        assert_eq!(spans, expected);
        // With a steady drift, the middle of the passes of every arm is at the same time.
        for job in [3, 5, 8] {
            let places = spans.iter().enumerate().filter(|(_, s)| s.0 == job).map(|(i, _)| i);
            assert_eq!(places.sum::<usize>(), 5);
        }
        // The first arm's second run stands next to its first, outwards of the others: A C B .. B C A.
        let (spans, _) = turn(&lanes, 8, 8, true);
        let twice: Vec<Option<Second>> = spans.iter().map(|span| span.twice).collect();
        assert_eq!(twice, [Some(Second::After), None, None, None, None, Some(Second::Before)]);
    }

    #[test]
    fn arms_of_different_lengths_run_the_same_part() {
        let lanes = [
            Lane { job: 0, passes: 300, next: 0, end: 300 },
            Lane { job: 1, passes: 1000, next: 0, end: 1000 },
        ];
        let turns: Vec<_> = (0..250).flat_map(|i| order(&lanes, 4 * i, 4).0).collect();
        for (job, passes) in [(0, 300), (1, 1000)] {
            let mut own: Vec<(u64, u64)> =
                turns.iter().filter(|s| s.0 == job).map(|s| (s.1, s.2)).collect();
            assert!(own.windows(2).all(|pair| pair[0].1 == pair[1].0), "no pass is missed or run twice");
            assert_eq!((own.remove(0).0, own.pop().map(|last| last.1)), (0, Some(passes)));
        }
        // 150.6 passes of the first arm end in this turn's way back.
        assert_eq!(order(&lanes, 500, 4).0, [(1, 500, 502), (1, 502, 504), (0, 150, 151)]);
    }

    #[test]
    fn what_was_run_is_not_run_again() {
        let lane = |job, next| Lane { job, passes: 300, next, end: 300 };
        let lanes = [lane(0, 10), lane(1, 16)];
        assert_eq!(done_everywhere(&lanes), 8);
        assert_eq!(order(&lanes, 0, 8), (vec![], false));
        assert_eq!(order(&lanes, 8, 8), (vec![(0, 10, 12), (0, 12, 16)], false));
        assert!(order(&lanes, 16, 8).1);
        // A last pass has no way back.
        assert_eq!(order(&lanes, 299, 1), (vec![(0, 299, 300), (1, 299, 300)], false));
        assert!(order(&lanes, 300, 8).0.is_empty());
    }
}
