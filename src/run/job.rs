//! One estimator in one cell: what a worker needs to play any run of passes, and what comes back.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::clock::thread_cpu_time;
use super::keys::Stage;
use crate::estimators::{Anomaly, BandUse, Cost, Estimator, Layout, Scores};
use crate::sampling::stream::StreamKey;
use crate::stats::moments::{ImageMoments, Moments};
use crate::stats::tree::{Counter, Merge};

/// A built estimator with its streams.
pub struct Job {
    /// Cell index.
    pub cell: usize,
    /// Estimator index in the experiment file.
    pub estimator_index: usize,
    /// Name of the run: the estimator's, or that of its control.
    pub name: String,
    /// A second arm of the same estimator, on streams of its own.
    pub is_control: bool,
    /// Number of the group of jobs that are timed side by side.
    pub side_by_side: Option<usize>,
    /// What people call it: cell and estimator.
    pub label: String,
    /// Hash of all that its result depends on but the number of passes, hex.
    pub identity: String,
    /// What its passes are for.
    pub stage: Stage,
    /// Their number, where it is not the budget's to say.
    pub passes: Option<u64>,
    /// Plays passes.
    pub estimator: Box<dyn Estimator>,
    /// Its observables.
    pub layout: Layout,
    /// Bands that one call plays together, with their streams.
    pub groups: Vec<Group>,
    /// Observables whose relative error a budget may bound.
    pub targets: Vec<usize>,
    /// Hashes of the experiment's claims, hex.
    pub claims: Vec<String>,
}

/// Bands that one call plays together.
pub struct Group {
    /// Their indices.
    pub bands: Vec<usize>,
    /// Key of the run, or of the second look.
    pub main: StreamKey,
    /// Key of the pilot.
    pub pilot: StreamKey,
}

/// What a run of passes left behind.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Moments of `[observable][band]`, kept by batch.
    pub gates: Counter<Vec<Moments>>,
    /// Moments of `[pixel][band]`.
    pub pixels: Counter<ImageMoments>,
    /// Work and time, kept by batch like the gates.
    pub work: Counter<Work>,
    /// Work and time.
    pub tally: Tally,
    /// What stood before the first of these passes was played.
    pub origin: Origin,
}

/// What was fixed before the first pass of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Hashes of the claims: what is claimed later is claimed with the result in sight.
    pub claims: Vec<String>,
    /// Hash of the budget that was turned into passes.
    pub budget: String,
    /// Those passes: the same budget is not turned into others.
    pub passes: u64,
}

/// Work and time of some passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Work {
    /// By [`Cost`].
    pub cost: [u64; Cost::ALL.len()],
    /// CPU time of the passes alone, seconds.
    pub cpu_seconds: f64,
    /// How many of them were timed side by side with their rivals, by a worker that was warm.
    pub settled: u64,
}

impl Merge for Work {
    fn merge(mut self, later: Work) -> Work {
        self.cost.iter_mut().zip(later.cost).for_each(|(a, b)| *a += b);
        self.cpu_seconds += later.cpu_seconds;
        self.settled += later.settled;
        self
    }
}

/// Counts and time, which add up in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// By [`Cost`].
    pub cost: [u64; Cost::ALL.len()],
    /// By [`Anomaly`].
    pub anomalies: [u64; Anomaly::ALL.len()],
    /// Passes.
    pub passes: u64,
    /// CPU time of the passes alone, seconds.
    pub cpu_seconds: f64,
    /// Wall time, seconds.
    pub wall_seconds: f64,
    /// Processes that played some of the passes.
    pub processes: u64,
}

impl Tally {
    /// Adds another run of passes.
    pub fn add(&mut self, other: &Tally) {
        self.cost.iter_mut().zip(other.cost).for_each(|(a, b)| *a += b);
        self.anomalies.iter_mut().zip(other.anomalies).for_each(|(a, b)| *a += b);
        self.passes += other.passes;
        self.cpu_seconds += other.cpu_seconds;
        self.wall_seconds += other.wall_seconds;
        self.processes += other.processes;
    }
}

/// The groups of bands that an estimator plays together.
pub fn band_groups(band_use: BandUse, bands: usize) -> Vec<Vec<usize>> {
    match band_use {
        BandUse::EachAlone => (0..bands).map(|band| vec![band]).collect(),
        BandUse::Shared => vec![(0..bands).collect()],
    }
}

impl Block {
    /// No passes yet, from pass `start` on.
    pub fn empty(start: u64, keep_level: u32) -> Block {
        Block {
            gates: Counter::new(start, keep_level),
            pixels: Counter::new(start, Counter::<ImageMoments>::MERGE_ALL),
            work: Counter::new(start, keep_level),
            tally: Tally::default(),
            origin: Origin::default(),
        }
    }

    /// The pass that comes next.
    pub fn next_pass(&self) -> u64 {
        self.gates.next_pass()
    }

    /// Marks all passes as timed side by side with their rivals; `keep_level` is the block's own.
    pub fn settle(&mut self, keep_level: u32) {
        let mut settled = Counter::new(self.work.start(), keep_level);
        for node in self.work.nodes() {
            settled.push_node(node.level, Work { settled: 1 << node.level, ..node.value });
        }
        self.work = settled;
    }

    /// Appends the passes that follow.
    pub fn append(&mut self, later: Block) {
        self.gates.append(later.gates);
        self.pixels.append(later.pixels);
        self.work.append(later.work);
        self.tally.add(&later.tally);
    }
}

/// What a finished job has measured: its batches, and one image instead of the tree's many.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// Number of passes.
    pub passes: u64,
    /// Moments of `[observable][band]` by batch.
    pub batches: Vec<Vec<Moments>>,
    /// Moments of `[pixel][band]` over all passes.
    pub image: ImageMoments,
    /// Work and time by batch.
    pub work: Vec<Work>,
    /// Work and time.
    pub tally: Tally,
    /// What stood before the first pass.
    pub origin: Origin,
}

impl Block {
    /// All passes are played: folds what the tree still holds apart.
    pub fn finish(self) -> Finished {
        Finished {
            passes: self.next_pass(),
            batches: self.gates.batches(),
            image: self.pixels.finish().unwrap_or_default(),
            work: self.work.batches(),
            tally: self.tally,
            origin: self.origin,
        }
    }
}

impl Job {
    /// Plays passes `start..end`; only the run itself keeps an image. `stop` is asked between passes; a stopped block is dropped whole.
    pub fn play(
        &self,
        stage: Stage,
        start: u64,
        end: u64,
        keep_level: u32,
        stop: &dyn Fn() -> bool,
    ) -> Option<Block> {
        let mut block = Block::empty(start, keep_level);
        let mut scores = Scores::new(self.layout.clone());
        let mut cpu = Duration::ZERO;
        let wall = Instant::now();
        for pass in start..end {
            if stop() {
                return None;
            }
            scores.clear();
            let counted = scores.cost;
            let before = thread_cpu_time();
            for group in &self.groups {
                let key = match stage {
                    Stage::Pilot => group.pilot,
                    Stage::Main | Stage::Retest => group.main,
                };
                self.estimator.pass(&group.bands, &key.pass(pass), &mut scores);
            }
            let spent = thread_cpu_time().saturating_sub(before);
            cpu += spent;
            block.work.push(Work {
                cost: std::array::from_fn(|i| scores.cost[i] - counted[i]),
                cpu_seconds: spent.as_secs_f64(),
                settled: 0,
            });
            block.gates.push(scores.gates.iter().map(|&x| Moments::of(x)).collect());
            // Blocks are appended to each other, so that those without an image hold empty ones.
            let image = if stage == Stage::Main { scores.pixels.clone() } else { Vec::new() };
            block.pixels.push(ImageMoments::of(image));
        }
        block.tally = Tally {
            cost: scores.cost,
            anomalies: scores.anomalies,
            passes: end - start,
            cpu_seconds: cpu.as_secs_f64(),
            wall_seconds: wall.elapsed().as_secs_f64(),
            processes: 0,
        };
        Some(block)
    }
}
