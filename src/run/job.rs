//! Units of work: an estimator in a cell, or a sampler; and the passes of an estimator with their
//! results.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::chi_square::Draws;
use super::clock::thread_cpu_time;
use super::keys::Stage;
use crate::estimators::{Anomaly, BandUse, Cost, Estimator, Layout, Scores};
use crate::experiment::schema::Budget;
use crate::sampling::stream::StreamKey;
use crate::stats::moments::{ImageMoments, Moments};
use crate::stats::tree::{Counter, Merge};

/// One unit of work.
pub(crate) struct Job {
    /// Label in messages: cell and estimator, or the sampler.
    pub label: String,
    /// The same for progress, the cell by its place on the axes: `alpha = 0.1 / mis`.
    pub title: String,
    /// Hash of everything that the result depends on except the number of passes, hex. It names the file of
    /// the job's state.
    pub identity: String,
    /// The task.
    pub task: Task,
}

/// Task of a job.
pub(crate) enum Task {
    /// Runs passes of an estimator in a cell.
    Estimate(Box<Passes>),
    /// Draws from a sampler.
    Draw(Box<Draws>),
}

impl Job {
    /// The passes, if the job is of an estimator.
    pub(crate) fn passes(&self) -> Option<&Passes> {
        match &self.task {
            Task::Estimate(passes) => Some(passes),
            Task::Draw(_) => None,
        }
    }

    /// The draws, if the job is of a sampler.
    pub(crate) fn draws(&self) -> Option<&Draws> {
        match &self.task {
            Task::Estimate(_) => None,
            Task::Draw(draws) => Some(draws),
        }
    }
}

/// A run of an estimator in a cell.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Arm {
    /// Name of the estimator, or of its control.
    pub name: String,
    /// A second arm of the same estimator, on separate streams.
    pub is_control: bool,
}

/// A built estimator in a cell, with its streams.
pub(crate) struct Passes {
    /// Cell index.
    pub cell: usize,
    /// Estimator index in the experiment file.
    pub entry: usize,
    /// Which run of the estimator it is.
    pub arm: Arm,
    /// Stage that the passes belong to.
    pub stage: Stage,
    /// Number of passes, if the budget does not state it.
    pub count: Option<u64>,
    /// Passes that are run, if not all are.
    pub part: Option<PassRange>,
    /// Estimator that runs the passes.
    pub estimator: Arc<dyn Estimator>,
    /// CPU time of building and preparing the estimator.
    pub set_up: SetUp,
    /// Observables and bands of the scores.
    pub layout: Layout,
    /// Bands that one call runs together, with their streams.
    pub groups: Vec<Group>,
    /// The budget of this run.
    pub terms: BudgetTerms,
}

/// A run of passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PassRange {
    /// Number of the first pass.
    pub start: u64,
    /// Number of the pass after the last.
    pub end: u64,
}

/// CPU time that an estimator takes before its first pass.
#[derive(Debug, Default)]
pub(crate) struct SetUp {
    /// Of building it.
    built: Duration,
    /// Of preparing it.
    prepared: OnceLock<Duration>,
}

impl SetUp {
    /// Of an estimator that took this long to build.
    pub(crate) fn built(built: Duration) -> SetUp {
        SetUp { built, ..SetUp::default() }
    }

    /// Prepares the estimator, if no other thread has.
    fn prepare(&self, estimator: &dyn Estimator) {
        self.prepared.get_or_init(|| {
            let before = thread_cpu_time();
            estimator.prepare();
            thread_cpu_time().saturating_sub(before)
        });
    }

    /// All of it, seconds.
    pub(crate) fn seconds(&self) -> f64 {
        (self.built + self.prepared.get().copied().unwrap_or_default()).as_secs_f64()
    }
}

/// The budget of one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct BudgetTerms {
    /// Observables whose relative error a budget may bound.
    pub targets: Vec<usize>,
    /// Share of the budget's passes or seconds.
    pub share: f64,
    /// The budget itself, if the sweep sets one for the cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<Budget>,
}

/// Bands that one call runs together.
pub(crate) struct Group {
    /// Indices of the bands.
    pub bands: Vec<usize>,
    /// Key of the run, or of the second look.
    pub main: StreamKey,
    /// Key of the pilot.
    pub pilot: StreamKey,
}

/// Moments and counts of a run of passes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Block {
    /// Moments of `[observable][band]`, kept by batch.
    pub moments: Counter<Vec<Moments>>,
    /// Moments of `[pixel][band]`.
    pub pixels: Counter<ImageMoments>,
    /// Moments of `[band]` over pairs of passes, kept by batch: the variance of a pixel as passes 2i and
    /// 2i + 1 show it ([`spread`]). Pairs are counted from pass 0, so that this too is the same for
    /// every cut into blocks; empty without an image.
    pub spread: Counter<Vec<Moments>>,
    /// Number of bands; 0 where no pass was run.
    pub bands: usize,
    /// Work and time, kept by batch like the moments.
    pub work: Counter<Work>,
    /// What is counted of all passes together.
    pub tally: Tally,
}

/// What was fixed before the first pass or draw of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Start {
    /// Hashes of the claims: claims that are made later may depend on the result.
    pub claims: Vec<String>,
    /// Hash of the budget that was converted into passes.
    pub budget: String,
    /// Number of passes into which the budget was converted, fixed once.
    pub passes: u64,
}

/// Work and time of some passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Work {
    /// Work counted, indexed by [`Cost`].
    pub cost: [u64; Cost::ALL.len()],
    /// CPU time of the passes alone, seconds.
    pub cpu_seconds: f64,
    /// Number of passes that were interleaved with those of the other arms, by a worker that was warm.
    pub settled: u64,
    /// CPU time of the passes that were run twice as a control, seconds: of the run that counts, and of the
    /// other one.
    pub twice: [f64; 2],
}

impl Merge for Work {
    fn merge(mut self, later: Work) -> Work {
        self.cost.iter_mut().zip(later.cost).for_each(|(a, b)| *a += b);
        self.cpu_seconds += later.cpu_seconds;
        self.settled += later.settled;
        self.twice.iter_mut().zip(later.twice).for_each(|(a, b)| *a += b);
        self
    }
}

/// Counts and times that are not kept by batch and can be summed in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tally {
    /// Anomalies counted, indexed by [`Anomaly`].
    pub anomalies: [u64; Anomaly::ALL.len()],
    /// Wall time, seconds.
    pub wall_seconds: f64,
    /// Processes that ran some of the passes.
    pub processes: u64,
    /// The longest CPU time that one of them took before its first pass, seconds: a single process would take as long.
    pub set_up_seconds: f64,
}

impl Tally {
    /// Adds another run of passes.
    pub(crate) fn add(&mut self, other: &Tally) {
        self.anomalies.iter_mut().zip(other.anomalies).for_each(|(a, b)| *a += b);
        self.wall_seconds += other.wall_seconds;
        self.processes += other.processes;
        self.set_up_seconds = self.set_up_seconds.max(other.set_up_seconds);
    }
}

/// The groups of bands that an estimator runs together.
pub(crate) fn band_groups(band_use: BandUse, bands: usize) -> Vec<Vec<usize>> {
    match band_use {
        BandUse::EachAlone => (0..bands).map(|band| vec![band]).collect(),
        BandUse::Shared => vec![(0..bands).collect()],
    }
}

/// Half the squared difference of two images with the same expectation, averaged over the pixels, by band: its
/// expectation is the variance of a pixel, averaged over the pixels.
pub(crate) fn spread(a: &[f64], b: &[f64], bands: usize) -> Vec<Moments> {
    if a.is_empty() {
        return Vec::new();
    }
    let pixels = (a.len() / bands) as f64;
    let squares = |band: usize| {
        let values = a.iter().zip(b).skip(band).step_by(bands);
        values.map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
    };
    (0..bands).map(|band| Moments::of(0.5 * squares(band) / pixels)).collect()
}

/// The level at which pairs are kept in batches of 2^level passes.
pub(crate) fn pair_level(keep_level: u32) -> u32 {
    keep_level.saturating_sub(1)
}

/// The pass after the last one of a batch.
fn end_of_batch(pass: u64, keep_level: u32) -> u64 {
    let is_of_all = 1_u64.checked_shl(keep_level).is_none();
    if is_of_all { u64::MAX } else { ((pass >> keep_level) + 1) << keep_level }
}

impl Block {
    /// No passes yet, from pass `start` on.
    pub(crate) fn empty(start: u64, keep_level: u32) -> Block {
        Block {
            moments: Counter::new(start, keep_level),
            pixels: Counter::new(start, Counter::<ImageMoments>::MERGE_ALL),
            spread: Counter::new(start.div_ceil(2), pair_level(keep_level)),
            bands: 0,
            work: Counter::new(start, keep_level),
            tally: Tally::default(),
        }
    }

    /// CPU time of the passes alone, seconds.
    pub(crate) fn cpu_seconds(&self) -> f64 {
        self.work.nodes().iter().map(|node| node.value.cpu_seconds).sum()
    }

    /// Pairs the image of the next pass with that of the pass before it, if these two are a pair and this block
    /// holds the first of them; the node of the first is then not merged yet.
    fn pair_with(&mut self, next: &[f64]) {
        let is_second = !self.next_pass().is_multiple_of(2);
        if is_second && let Some(first) = self.pixels.nodes().last() {
            self.spread.push(spread(&first.value.mean, next, self.bands));
        }
    }

    /// The next pass.
    pub(crate) fn next_pass(&self) -> u64 {
        self.moments.next_pass()
    }

    /// Marks all passes as interleaved with those of the other arms; `keep_level` is that of the block, and
    /// `again` holds the same passes run a second time.
    pub(crate) fn settle(&mut self, keep_level: u32, again: Option<&Block>) {
        let mut settled = Counter::new(self.work.start(), keep_level);
        for (index, node) in self.work.nodes().iter().enumerate() {
            let second = again.and_then(|block| block.work.nodes().get(index));
            let twice =
                second.map_or([0.0; 2], |other| [node.value.cpu_seconds, other.value.cpu_seconds]);
            settled.push_node(node.level, Work { settled: 1 << node.level, twice, ..node.value });
        }
        self.work = settled;
    }

    /// Appends the passes that follow, at least one.
    pub(crate) fn append(&mut self, later: Block) {
        self.bands = later.bands;
        if let Some(first) = later.pixels.nodes().first() {
            self.pair_with(&first.value.mean);
        }
        self.spread.append(later.spread);
        self.moments.append(later.moments);
        self.pixels.append(later.pixels);
        self.work.append(later.work);
        self.tally.add(&later.tally);
    }
}

/// Measurement of a finished job: its batches, and one image instead of the tree's many.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Finished {
    /// Number of passes.
    pub passes: u64,
    /// Moments of `[observable][band]` by batch.
    pub batches: Vec<Vec<Moments>>,
    /// Moments of `[pixel][band]` over all passes.
    pub image: ImageMoments,
    /// Moments of `[band]` over pairs of passes, by batch.
    pub spread: Vec<Vec<Moments>>,
    /// Work and time by batch.
    pub work: Vec<Work>,
    /// What is counted of all passes together.
    pub tally: Tally,
}

impl Finished {
    /// Work and time of all passes.
    pub(crate) fn total(&self) -> Work {
        self.work.iter().fold(Work::default(), |sum, work| sum.merge(*work))
    }
}

impl Block {
    /// All passes are done: merges the nodes that the tree still keeps separate.
    pub(crate) fn finish(self) -> Finished {
        Finished {
            passes: self.next_pass(),
            batches: self.moments.batches(),
            image: self.pixels.finish().unwrap_or_default(),
            spread: self.spread.batches(),
            work: self.work.batches(),
            tally: self.tally,
        }
    }
}

impl Passes {
    /// Columns and rows of the image, where the record has one.
    pub(crate) fn image_size(&self) -> Option<(usize, usize)> {
        self.layout.image().filter(|_| self.stage == Stage::Main)
    }

    /// Runs passes `start..end`; only the run itself keeps an image. `stop` is checked between passes, or between those that
    /// run together; a stopped block is discarded whole. Passes that run together have equal parts of their time. They are of
    /// one batch, so that the times of batches are independent.
    pub(crate) fn run(
        &self,
        stage: Stage,
        start: u64,
        end: u64,
        keep_level: u32,
        stop: &dyn Fn() -> bool,
    ) -> Option<Block> {
        self.set_up.prepare(&*self.estimator);
        let mut block = Block { bands: self.layout.bands(), ..Block::empty(start, keep_level) };
        let at_once = |group: &Group| self.estimator.passes_at_once(&group.bands);
        let at_once = self.groups.iter().map(at_once).max().unwrap_or(1);
        let mut all = vec![Scores::new(self.layout.clone())];
        let at_once = held_at_once(at_once, all[0].observables.len() + all[0].pixels.len());
        let wall = Instant::now();
        let mut next = start;
        while next < end {
            if stop() {
                return None;
            }
            let together = end.min(end_of_batch(next, keep_level)).min(next + at_once) - next;
            if all.len() < together as usize {
                all.resize_with(together as usize, || Scores::new(self.layout.clone()));
            }
            let all = &mut all[..together as usize];
            all.iter_mut().for_each(Scores::clear);
            let counted: Vec<_> = all.iter().map(|scores| scores.cost).collect();
            let before = thread_cpu_time();
            for group in &self.groups {
                let key = match stage {
                    Stage::Pilot => group.pilot,
                    Stage::Main | Stage::Retest => group.main,
                };
                let keys: Vec<_> = (next..next + together).map(|pass| key.pass(pass)).collect();
                self.estimator.passes(&group.bands, &keys, all);
            }
            let spent = thread_cpu_time().saturating_sub(before).as_secs_f64() / together as f64;
            for (scores, counted) in all.iter().zip(counted) {
                block.work.push(Work {
                    cost: std::array::from_fn(|i| scores.cost[i] - counted[i]),
                    cpu_seconds: spent,
                    ..Work::default()
                });
                // Blocks are appended to each other, so that those without an image hold empty ones.
                let image = if stage == Stage::Main { scores.pixels.clone() } else { Vec::new() };
                block.pair_with(&image);
                block.moments.push(scores.observables.iter().map(|&x| Moments::of(x)).collect());
                block.pixels.push(ImageMoments::of(image));
            }
            next += together;
        }
        let mut anomalies = [0; Anomaly::ALL.len()];
        for scores in &all {
            anomalies.iter_mut().zip(scores.anomalies).for_each(|(sum, count)| *sum += count);
        }
        block.tally = Tally {
            anomalies,
            wall_seconds: wall.elapsed().as_secs_f64(),
            processes: 0,
            set_up_seconds: self.set_up.seconds(),
        };
        Some(block)
    }
}

/// The most numbers in the scores of passes that run together, 8 MB: they are to stay in the cache.
const SCORES_AT_ONCE: u64 = 1 << 20;

/// How many of the passes that might run together do, if each has so many numbers in its scores.
fn held_at_once(asked: u64, numbers: usize) -> u64 {
    asked.min(SCORES_AT_ONCE / numbers.max(1) as u64).max(1)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::time::Duration;

    use super::*;
    use crate::experiment::registry::Registry;
    use crate::experiment::{self, LoadOptions};
    use crate::run::plan;
    use crate::sampling::stream::{PassKey, Purpose};

    fn image(pass: u64) -> Vec<f64> {
        (0..6).map(|i| ((pass * 6 + i) as f64 * 0.618_033_988_749_895).fract().powi(3)).collect()
    }

    /// Passes of images of 3 pixels in 2 bands.
    fn run(start: u64, end: u64, keep_level: u32) -> Block {
        let mut block = Block { bands: 2, ..Block::empty(start, keep_level) };
        for pass in start..end {
            block.pair_with(&image(pass));
            block.moments.push(vec![Moments::of(pass as f64)]);
            block.pixels.push(ImageMoments::of(image(pass)));
            block.work.push(Work::default());
        }
        block
    }

    /// Takes 2 ms of CPU time for each band.
    struct Spinning;

    impl Estimator for Spinning {
        fn pass(&self, bands: &[usize], _: &PassKey, _: &mut Scores) {
            let until = thread_cpu_time() + Duration::from_millis(2) * bands.len() as u32;
            while thread_cpu_time() < until {}
        }
    }

    #[test]
    fn scores_of_passes_that_run_together_are_bounded() {
        for (asked, numbers, held) in
            [(2048, 100, 2048), (2048, 1 << 16, 16), (2048, 1 << 21, 1), (0, 0, 1)]
        {
            assert_eq!(held_at_once(asked, numbers), held, "{asked} of {numbers}");
        }
    }

    // The time of a pass is that of all its groups of bands: 2 ms each at least, and all passes together
    // at most what the thread's clock shows around them.
    #[test]
    fn every_group_of_bands_is_timed() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/compare/nine-cells.toml");
        let options = LoadOptions { sets: vec!["bands = { rgb = {} }".into()], setting: None };
        let registry = Registry::builtin();
        let experiment = experiment::load(file.as_ref(), &options, &registry).expect("an experiment");
        let mut plan = plan(&experiment, &registry, 1).expect("a plan");
        let Task::Estimate(passes) = &mut plan.jobs[0].task else { panic!("passes") };
        passes.estimator = Arc::new(Spinning);
        assert_eq!(passes.groups.len(), 3);
        let begun = thread_cpu_time();
        let block = passes.run(Stage::Main, 0, 4, 0, &|| false).expect("four passes");
        let all = (thread_cpu_time() - begun).as_secs_f64();
        let each: Vec<f64> = block.work.nodes().iter().map(|node| node.value.cpu_seconds).collect();
        assert!(each.len() == 4 && each.iter().all(|seconds| *seconds >= 6e-3), "{each:?}");
        assert!(block.cpu_seconds() <= all, "{each:?} of {all} s");
    }

    /// Runs passes one by one or five together, and scores the first number of each. Notes how many it was given at once.
    struct Counting {
        at_once: u64,
        given: Arc<Mutex<Vec<usize>>>,
    }

    impl Estimator for Counting {
        fn pass(&self, _: &[usize], key: &PassKey, scores: &mut Scores) {
            scores.count(Cost::Paths);
            scores.observables[0] += key.stream(0, Purpose::Walk).draw();
        }

        fn passes(&self, bands: &[usize], keys: &[PassKey], scores: &mut [Scores]) {
            self.given.lock().expect("one thread").push(keys.len());
            keys.iter().zip(scores).for_each(|(key, scores)| self.pass(bands, key, scores));
        }

        fn passes_at_once(&self, _: &[usize]) -> u64 {
            self.at_once
        }
    }

    // Batches of 8 passes, of which the first has only the last 6 here and the last only the first: 5 + 1, 5 + 3, 5 + 3, 1.
    #[test]
    fn passes_that_run_together_are_of_one_batch() {
        let run = |at_once: u64| {
            let file = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/compare/nine-cells.toml");
            let registry = Registry::builtin();
            let options = LoadOptions { sets: Vec::new(), setting: None };
            let experiment =
                experiment::load(file.as_ref(), &options, &registry).expect("an experiment");
            let mut plan = plan(&experiment, &registry, 1).expect("a plan");
            let Task::Estimate(passes) = &mut plan.jobs[0].task else { panic!("passes") };
            let given = Arc::default();
            passes.estimator = Arc::new(Counting { at_once, given: Arc::clone(&given) });
            passes.groups.truncate(1);
            let block = passes.run(Stage::Main, 2, 25, 3, &|| false).expect("23 passes");
            let given = given.lock().expect("one thread").clone();
            (given, block)
        };
        let ((one_by_one, of_one), (together, of_five)) = (run(1), run(5));
        assert_eq!((one_by_one, together), (vec![1; 23], vec![5, 1, 5, 3, 5, 3, 1]));
        assert_eq!((&of_five.moments, &of_five.pixels), (&of_one.moments, &of_one.pixels));
        let costs = |block: &Block| -> Vec<_> {
            block.work.nodes().iter().map(|node| (node.level, node.value.cost)).collect()
        };
        assert_eq!(costs(&of_five), costs(&of_one));
    }

    // (1 - 3)^2 / 2 = 2 and (0 - 1)^2 / 2 in the first band of two pixels, 0 and 8 in the second.
    #[test]
    fn spread_of_two_images() {
        let found = spread(&[1.0, 5.0, 0.0, 2.0], &[3.0, 5.0, 1.0, 6.0], 2);
        assert_eq!(found, [Moments::of(1.25), Moments::of(4.0)]);
        assert_eq!(spread(&[], &[], 2), []);
    }

    // Pairs are of passes 2i and 2i + 1, whatever blocks these were in; a last pass alone is in none.
    #[test]
    fn pairs_do_not_know_of_blocks() {
        for (cuts, keep_level) in
            [(vec![0, 1, 2, 3, 4, 5], 0), (vec![0, 3, 4, 9, 16], 1), (vec![0, 7, 8, 15, 29], 2)]
        {
            let end = cuts[cuts.len() - 1];
            let whole = run(0, end, keep_level);
            let mut joined = Block::empty(0, keep_level);
            cuts.windows(2).for_each(|cut| joined.append(run(cut[0], cut[1], keep_level)));
            assert_eq!((&joined.spread, &joined.pixels), (&whole.spread, &whole.pixels), "{cuts:?}");
            let batches = joined.spread.batches();
            let pairs: u64 = batches.iter().map(|batch| batch[0].n).sum();
            assert_eq!(pairs, end / 2);
            let largest = batches.iter().map(|batch| batch[0].n).max();
            assert_eq!(largest, Some(1 << pair_level(keep_level)));
            let mean: f64 =
                (0..end / 2).map(|i| spread(&image(2 * i), &image(2 * i + 1), 2)[1].mean).sum::<f64>()
                    / (end / 2) as f64;
            let found =
                batches.iter().map(|b| b[1].n as f64 * b[1].mean).sum::<f64>() / (end / 2) as f64;
            assert!((found - mean).abs() < 1e-14, "{found} {mean}");
        }
    }
}
