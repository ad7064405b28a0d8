//! Shards: parts of a run that separate processes run, on any machine, and that [`super::merge`] combines.
//!
//! ```text
//! experiment, passes kept in state/ (the base)   the same for every shard
//!   -> cells in their order, a line of length 1 each; shard i of n is [(i - 1)/n, i/n] of the line
//!   -> part [from, to) of the passes of every arm of those cells, the same part of all arms
//!   -> run_all on these jobs: threads, turns, checkpoints as in a whole run
//!   -> shards/i-of-n/state/*.state: states that begin at pass `from`, and shard.json once all are complete
//! merge: base + states in the order of their passes -> Counter::append -> state/, record
//! ```
//! A node of the tree over passes is a function of its passes alone, so the merged moments have the bits of one run.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::interrupt::Interrupt;
use super::job::{Job, PassRange, Passes, Task};
use super::jobs::Plan;
use super::turns::{Lane, done_everywhere, groups};
use super::{Options, checkpoint, pilot, take_passes};
use crate::error::{Error, Result};
use crate::experiment::Experiment;
use crate::experiment::registry::Registry;
use crate::experiment::schema::Budget;
use crate::results::json::{canonical, hash_json};
use crate::results::store::RecordFolder;
use crate::results::{atomic, lock, provenance};
use crate::stats::tree::batch_level;

/// Version of `shard.json`.
const SCHEMA: u32 = 1;
/// The file that says that a shard is complete, and what it holds.
const MARKER: &str = "shard.json";
/// The folder of the shards in an experiment's results folder.
const FOLDER: &str = "shards";

/// Shard `index` of `count`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct Shard {
    /// Which of them it is.
    pub index: u64,
    /// Number of shards.
    pub count: u64,
}

/// Most shards of a run.
const MOST: u64 = 1_000_000;

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Shard, String> {
        let number = |text: &str| text.parse::<u64>().ok().filter(|n| (1..=MOST).contains(n));
        let parts =
            text.split_once('/').and_then(|(index, count)| Some((number(index)?, number(count)?)));
        match parts {
            Some((index, count)) if index <= count => Ok(Shard { index, count }),
            _ => Err(format!("I/N is needed, as 3/10: 1 <= I <= N <= {MOST}")),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// What a complete shard holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Marker {
    schema: u32,
    /// Name of the experiment.
    pub experiment: String,
    pub shard: Shard,
    /// What fixes the bits.
    pub fingerprint: String,
    /// The program that ran it.
    pub build: String,
    pub pieces: Vec<ShardPiece>,
    /// blake3 of all the rest, hex.
    sum: String,
}

impl Marker {
    fn summed(&self) -> String {
        hash_json(&Marker { sum: String::new(), ..self.clone() })
    }

    /// Is it as it was written?
    pub(super) fn is_sound(&self) -> bool {
        self.sum == self.summed()
    }
}

/// A run of passes, or all draws of a sampler, that a shard holds the state of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShardPiece {
    /// Cell and estimator, or the sampler.
    pub label: String,
    /// Job that it is of.
    pub identity: String,
    pub start: u64,
    pub end: u64,
}

/// A shard that was run.
pub(crate) struct Sharded {
    /// Where its states are.
    pub folder: PathBuf,
    /// Number of measurements of which it has a part.
    pub measurements: usize,
    /// Number of its passes and draws.
    pub passes: u64,
}

/// The folder of all shards in a results folder.
pub(super) fn all_in(root: &Path) -> PathBuf {
    root.join(FOLDER)
}

fn folder_of(root: &Path, shard: Shard) -> PathBuf {
    all_in(root).join(format!("{}-of-{}", shard.index, shard.count))
}

/// The shard that a folder's name states.
pub(super) fn named(folder: &Path) -> Option<Shard> {
    let (index, count) = folder.file_name()?.to_str()?.split_once("-of-")?;
    format!("{index}/{count}").parse().ok()
}

/// Runs one shard of an experiment, or what is left of it, into a folder of its own below `shards/`.
///
/// # Errors
/// As [`super::run`]; a budget that only a clock turns into passes; a folder that holds other passes, not merged yet.
pub(crate) fn run_shard(
    experiment: &Experiment,
    registry: &Registry,
    options: &Options,
    shard: Shard,
    interrupt: &Interrupt,
) -> Result<Sharded> {
    let mut plan = super::plan(experiment, registry, options.threads)?;
    let name = &experiment.file.name;
    if let Some(folder) = &options.passes_of {
        take_passes(&mut plan, experiment, &RecordFolder::new(folder.join(name)))?;
    }
    let root = options.folder(name);
    let folder = folder_of(&root, shard);
    let _lock = lock::lock(&folder)?;
    keep_own(&mut plan, experiment, &root, shard, interrupt)?;
    let pieces: Vec<ShardPiece> = plan.jobs.iter().map(piece).collect();
    let mut marker = Marker {
        schema: SCHEMA,
        experiment: name.clone(),
        shard,
        fingerprint: provenance::fingerprint(),
        build: provenance::build().into(),
        pieces,
        sum: String::new(),
    };
    marker.sum = marker.summed();
    give_way(&root, &folder, &marker)?;
    super::measure(experiment, &plan, &folder, options, interrupt)?;
    let path = folder.join(MARKER);
    atomic::write(&path, canonical(&marker).as_bytes(), "complete the shard")?;
    let passes = marker.pieces.iter().map(|piece| piece.end - piece.start).sum();
    Ok(Sharded { folder, measurements: marker.pieces.len(), passes })
}

fn piece(job: &Job) -> ShardPiece {
    let (start, end) = match &job.task {
        Task::Estimate(passes) => passes.part.map_or((0, 0), |part| (part.start, part.end)),
        Task::Draw(draws) => (0, draws.samples),
    };
    ShardPiece { label: job.label.clone(), identity: job.identity.clone(), start, end }
}

/// An earlier shard of this number gives way where it is the same or merged already.
fn give_way(root: &Path, folder: &Path, wanted: &Marker) -> Result<()> {
    let path = folder.join(MARKER);
    // What cannot be read is run again.
    let earlier = read(folder).ok().flatten().filter(Marker::is_sound);
    let Some(earlier) = earlier else { return remove(&path) };
    if earlier == *wanted {
        return Ok(());
    }
    let is_merged = |piece: &ShardPiece| {
        checkpoint::end(&checkpoint::path(root, &piece.identity), &piece.identity) >= Some(piece.end)
    };
    let is_kept = |piece: &ShardPiece| wanted.pieces.contains(piece) || is_merged(piece);
    if earlier.build == wanted.build && !earlier.pieces.iter().all(is_kept) {
        let words = "holds other passes, as of another budget, which are not merged yet";
        let help = "`scatterproof merge` them first, or remove the folder";
        return Err(Error::record(folder, format!("the shard {words}; {help}")));
    }
    remove(&path)
}

fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::io(path, "remove an earlier shard")(error))
        }
        _ => Ok(()),
    }
}

/// The marker of a folder; none where the shard is not complete.
///
/// # Errors
/// It cannot be read, or is not of this version.
pub(super) fn read(folder: &Path) -> Result<Option<Marker>> {
    let path = folder.join(MARKER);
    if !path.exists() {
        return Ok(None);
    }
    let text = fs::read_to_string(&path).map_err(Error::io(&path, "read the shard"))?;
    let marker: Marker = serde_json::from_str(&text).map_err(|e| {
        Error::record(&path, format!("truncated or not a shard ({e}); run the shard again"))
    })?;
    if marker.schema != SCHEMA {
        let found = marker.schema;
        return Err(Error::record(
            &path,
            format!("version {found} of shards, this program reads {SCHEMA}"),
        ));
    }
    Ok(Some(marker))
}

/// Reduces a plan to the jobs of a shard, each with its part of the passes.
fn keep_own(
    plan: &mut Plan,
    experiment: &Experiment,
    root: &Path,
    shard: Shard,
    interrupt: &Interrupt,
) -> Result<()> {
    let groups = groups(&plan.jobs, true);
    let total = groups.len() as u64;
    let mut own: Vec<bool> = vec![false; plan.jobs.len()];
    for (at, group) in groups.iter().enumerate() {
        let Some(share) = share(at as u64, total, shard) else { continue };
        if plan.jobs[group[0]].draws().is_some() {
            // The draws of a sampler are one unit.
            own[group[0]] = share[0] == 0;
            continue;
        }
        let mut lanes = Vec::new();
        for &index in group {
            let job = &plan.jobs[index];
            let Some(passes) = job.passes() else { continue };
            let count = count(experiment, passes, interrupt)?;
            let base = checkpoint::load_passes(
                &checkpoint::path(root, &job.identity),
                &job.identity,
                0,
                batch_level(count),
            );
            let next = base.map_or(0, |block| block.next_pass());
            lanes.push(Lane {
                job: index,
                passes: count,
                next: if next <= count { next } else { 0 },
                end: count,
            });
        }
        for (lane, part) in lanes.iter().zip(parts(&lanes, share, shard.count)) {
            if let (Task::Estimate(passes), true) =
                (&mut plan.jobs[lane.job].task, part.start < part.end)
            {
                passes.count = Some(lane.passes);
                passes.part = Some(part);
                own[lane.job] = true;
            }
        }
    }
    let mut own = own.into_iter();
    plan.jobs.retain(|_| own.next() == Some(true));
    Ok(())
}

/// The part of group `at` of `total` that a shard has, in units of one over the number of shards.
fn share(at: u64, total: u64, shard: Shard) -> Option<[u64; 2]> {
    let (at, total, count) = (u128::from(at), u128::from(total), u128::from(shard.count));
    let (begin, end) = (at * count, (at + 1) * count);
    let index = u128::from(shard.index);
    let part = [(index - 1) * total, index * total].map(|edge| edge.clamp(begin, end) - begin);
    (part[0] < part[1]).then_some(part.map(|edge| edge as u64))
}

/// The passes of every lane of a cell between two edges, each a number of `count`-th parts of what is not done. Edges
/// are those of batches, or of smaller powers of two where a shard has less than a batch.
fn parts(lanes: &[Lane], share: [u64; 2], count: u64) -> Vec<PassRange> {
    let longest = lanes.iter().map(|lane| lane.passes).max().unwrap_or(0);
    let from = done_everywhere(lanes);
    let left = longest - from;
    let level = batch_level(longest).min((left / count).max(1).ilog2());
    let edge = |part: u64| match part {
        0 => from,
        part if part == count => longest,
        part => {
            let pass = from + (u128::from(left) * u128::from(part) / u128::from(count)) as u64;
            (pass >> level << level).max(from)
        }
    };
    let [low, high] = share.map(edge);
    let part = |lane: &Lane| {
        let at =
            |pass: u64| (u128::from(pass) * u128::from(lane.passes) / u128::from(longest.max(1))) as u64;
        let [start, end] = [low, high].map(|pass| at(pass).max(lane.next));
        PassRange { start, end }
    };
    lanes.iter().map(part).collect()
}

/// The passes of a job: the same in every process.
///
/// # Errors
/// A budget in seconds; an interruption.
pub(super) fn count(experiment: &Experiment, passes: &Passes, interrupt: &Interrupt) -> Result<u64> {
    let budget = experiment.file.budget.as_ref();
    if let (Some(Budget::CpuSeconds(_)), None) = (budget, passes.count) {
        return Err(Error::input_help(
            "a budget in seconds is another number of passes in every process, and shards need one",
            "give `budget.passes` or `budget.relative_error`, or take the passes of a record with --passes-of DIR",
        ));
    }
    let found = budget.and_then(|budget| pilot::passes(passes, budget, &|| interrupt.raised()));
    found.ok_or_else(|| Error::Interrupted("nothing was run yet".into()))
}
