//! Runs experiments: jobs from cells and estimators and from samplers, threads, checkpoints, the record.
//!
//! experiment -> jobs (scene + estimator + streams, or sampler + stream) -> blocks of passes, in any
//! order, on any threads -> moments in the order of passes -> record, timing, provenance.

pub(crate) mod checkpoint;
pub(crate) mod chi_square;
pub(crate) mod clock;
pub(crate) mod comparisons;
pub(crate) mod interrupt;
pub(crate) mod job;
pub(crate) mod keys;
pub(crate) mod live;
pub(crate) mod memory;
pub(crate) mod memory_limits;
pub(crate) mod pilot;
pub(crate) mod progress;
pub(crate) mod shard;
pub(crate) mod tev;
pub(crate) mod workers;

mod assemble;
mod decidable;
mod jobs;
mod merge;
mod parallel;
mod replay;
mod retest;
mod turns;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::experiment::Experiment;
use crate::experiment::picture;
use crate::experiment::registry::Registry;
use crate::results::lock::{self, FolderLock};
use crate::results::provenance::{self, Provenance};
use crate::results::record::Replay;
use crate::results::store::{RecordFolder, Stored};
use crate::results::timing::Timing;
use interrupt::Interrupt;
use job::{Finished, Passes, Task};
use live::{Live, Show};
use parallel::in_parallel;
use progress::Progress;
use workers::Completed;

pub(crate) use jobs::{Built, Plan, plan, plan_with};
pub(crate) use merge::merge;
pub(crate) use pilot::estimate_seconds;
pub(crate) use retest::{Remeasured, retest};

/// How to run; nothing here changes a result.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// Folder that holds a folder per experiment.
    pub out: PathBuf,
    /// Number of threads.
    pub threads: usize,
    /// Passes per block; chosen by time by default.
    pub block_passes: Option<u64>,
    /// Do not show a progress bar.
    pub quiet: bool,
    /// Folder that holds a results folder per experiment, whose records state how many passes are run;
    /// without it the budget does. A budget in seconds gives another number of passes each time that it
    /// is measured anew: this is how such a record is reproduced bit for bit.
    pub passes_of: Option<PathBuf>,
    /// Viewer that shows images while they are rendered.
    pub live: Option<Arc<Live>>,
}

impl Options {
    /// Options that write into `out` and use all cores.
    pub(crate) fn new(out: impl Into<PathBuf>) -> Options {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Options {
            out: out.into(),
            threads,
            block_passes: None,
            quiet: false,
            passes_of: None,
            live: None,
        }
    }

    /// The folder of an experiment's results.
    pub(crate) fn folder(&self, experiment: &str) -> PathBuf {
        self.out.join(experiment)
    }
}

/// What was run, in a folder that no other process writes to until this is dropped.
pub(crate) struct Ran {
    /// Folder of the results.
    pub folder: RecordFolder,
    /// Record as it was written.
    pub stored: Stored,
    /// Lock of the folder.
    pub lock: Arc<FolderLock>,
}

/// Runs an experiment, or what is left of it, and writes its record, timing and provenance.
///
/// # Errors
/// Bad input found while building; a run that does not fit in memory; I/O; an interruption, after which
/// the same call resumes where this one stopped.
pub(crate) fn run(
    experiment: &Experiment,
    registry: &Registry,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<Ran> {
    let mut plan = plan(experiment, registry, options.threads)?;
    if let Some(folder) = &options.passes_of {
        take_passes(&mut plan, experiment, &RecordFolder::new(folder.join(&experiment.file.name)))?;
    }
    let ran = execute(experiment, &plan, &options.folder(&experiment.file.name), options, interrupt)?;
    ran.folder.write_pictures(&picture::wanted(&experiment.file.picture))?;
    Ok(ran)
}

/// Sets the passes of every estimator to those of the record in `from`.
fn take_passes(plan: &mut Plan, experiment: &Experiment, from: &RecordFolder) -> Result<()> {
    if plan.jobs.iter().all(|job| job.passes().is_none()) {
        let name = &experiment.file.name;
        return Err(Error::input_help(
            format!("`{name}` draws from samplers: it has no passes to take from a record"),
            "leave --passes-of out: its file states how many draws",
        ));
    }
    let manifest = from.manifest()?;
    if manifest.experiment_hash != assemble::experiment_hash(experiment) {
        let words = "the record there is of another experiment than the file";
        let help = "`scatterproof compare` of the two results reports what was changed; run without --passes-of \
                    to take the passes from the budget";
        return Err(Error::record(from.root(), format!("{words}; {help}")));
    }
    for job in &mut plan.jobs {
        let Task::Estimate(passes) = &mut job.task else { continue };
        let missing = || Error::record(from.root(), format!("the record there holds no {}", job.label));
        passes.count = Some(manifest.passes(passes.cell, &passes.arm.name).ok_or_else(missing)?);
    }
    Ok(())
}

/// Executes a plan and writes the results folder `root`.
fn execute(
    experiment: &Experiment,
    plan: &Plan,
    root: &Path,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<Ran> {
    check_memory(plan, options)?;
    let lock = lock::lock(root)?;
    let completed = measure(experiment, plan, root, options, interrupt)?;
    conclude(experiment, plan, root, lock, completed, options, interrupt)
}

/// Whether the arms of a cell can run by turns in the memory that there is.
///
/// # Errors
/// It does not suffice for one arm after the other either.
fn check_memory(plan: &Plan, options: &Options) -> Result<bool> {
    let available = memory_limits::available();
    let is_interleaved = plan.memory(options.threads, true).fits(available);
    plan.memory(options.threads, is_interleaved).check(available)?;
    Ok(is_interleaved)
}

/// Runs all jobs of a plan that are not complete in `root`, and keeps their states there.
fn measure(
    experiment: &Experiment,
    plan: &Plan,
    root: &Path,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<Vec<Completed>> {
    let is_interleaved = check_memory(plan, options)?;
    checkpoint::prepare(root)?;
    let name = experiment.file.name.as_str();
    let progress = Progress::new(plan.jobs.len(), options.quiet);
    if !is_interleaved {
        progress.say(&format!(
            "note: `{name}` has no memory for all estimators of a cell at once: they run one after the other, and \
             ratios of their CPU times are marked as not interleaved"
        ));
    }
    let show = options.live.as_deref();
    let show = show.map(|live| Show { live, experiment: name, bands: &plan.bands, jobs: &plan.jobs });
    if show.is_some_and(|show| !show.has_images()) {
        progress.say(&format!("note: `{name}` has no image: tev cannot show it"));
    }
    let settings = workers::Settings {
        threads: options.threads.max(1),
        block_passes: options.block_passes,
        is_interleaved,
        interrupt,
        root,
        progress: &progress,
        show,
        budget: experiment.file.budget.as_ref(),
        claims: &assemble::claim_hashes(experiment),
    };
    let running = interrupt.running();
    let completed = workers::run_all(&plan.jobs, &settings);
    drop(running);
    progress.finish();
    completed
}

/// Writes record, timing and provenance of completed jobs into `root`.
fn conclude(
    experiment: &Experiment,
    plan: &Plan,
    root: &Path,
    lock: Arc<FolderLock>,
    completed: Vec<Completed>,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<Ran> {
    let replays = replays(experiment, plan, &completed, options.threads, interrupt)?;
    let assembled = assemble::assemble(experiment, plan, completed, replays)?;
    let folder = RecordFolder::new(root);
    let mut stored = folder.write(assembled.record, assembled.arrays)?;
    let timing = Timing { record: Some(stored.numbers()), ..assembled.timing };
    folder.write_timing(&timing)?;
    stored.timing = Some(timing);
    folder.write_provenance(&Provenance::collect(options.threads))?;
    checkpoint::reduce_others(root, plan.jobs.iter().map(|job| job.identity.as_str()))?;
    Ok(Ran { folder, stored, lock })
}

/// Runs the first passes again where `reproduces` claims ask for it.
fn replays(
    experiment: &Experiment,
    plan: &Plan,
    completed: &[Completed],
    threads: usize,
    interrupt: &Interrupt,
) -> Result<Vec<Replay>> {
    let claims = experiment.file.claim.iter().filter_map(|claim| claim.reproduces.as_ref());
    let Some(count) = claims.map(|claim| claim.passes).max() else { return Ok(Vec::new()) };
    let measured = plan.jobs.iter().zip(completed);
    let measured = measured.filter_map(|(job, done)| Some((job.passes()?, done.passes()?)));
    let measured: Vec<(&Passes, &Finished)> = measured.collect();
    let replay = |(job, finished): (&Passes, &Finished)| {
        replay::replay(job, finished, count, &|| interrupt.raised())
    };
    let replays = in_parallel(threads, measured.len(), |i| replay(measured[i]));
    let replays: Option<Vec<Replay>> = replays.into_iter().collect();
    replays.ok_or_else(|| {
        Error::Interrupted("all passes are done and kept; the same command resumes from there".into())
    })
}

/// Parts of an experiment that leave its measurements what they are: a record of other values of these may be
/// replaced, by more passes of the same streams for example.
const NO_OTHER_EXPERIMENT: [&str; 7] =
    ["budget", "budget_share", "description", "display", "fresh", "only_claimed", "samples"];

/// Refuses to run where the folder holds the record of another experiment.
///
/// # Errors
/// What differs between the two, and how both are kept.
pub(crate) fn refuse_to_replace(experiment: &Experiment, out: &Path) -> Result<()> {
    let folder = RecordFolder::new(out.join(&experiment.file.name));
    if !folder.exists() {
        return Ok(());
    }
    // A record that cannot be read holds nothing to lose.
    let Ok(stored) = folder.read() else { return Ok(()) };
    let differences = differences(&stored.record.resolved, &experiment.resolved());
    let Some((key, [there, here])) = differences.first() else { return Ok(()) };
    let more = match differences.len() {
        1 => String::new(),
        n => format!(", and {} more", n - 1),
    };
    let date = folder.read_provenance().ok().flatten().map(|provenance| provenance.date);
    let date = date.map_or(String::new(), |date| format!(" of {date}"));
    Err(Error::input_help(
        format!(
            "{} holds a record{date} of another experiment of this name: `{key}` is {there} there and {here} \
             here{more}",
            folder.root().display()
        ),
        "to keep both, give another `name` (`--set name=...`) or another folder (`--out DIR`); `--replace` \
         gives up the one that is there",
    ))
}

/// The dotted keys at which two experiments differ, with both values.
fn differences(there: &serde_json::Value, here: &serde_json::Value) -> Vec<(String, [String; 2])> {
    fn walk(key: &str, pair: [&serde_json::Value; 2], found: &mut Vec<(String, [String; 2])>) {
        use serde_json::Value::{Array, Null, Object};
        let inner = |word: &str| if key.is_empty() { word.into() } else { format!("{key}.{word}") };
        match pair {
            [a, b] if a == b => {}
            [Object(a), Object(b)] => {
                let keys: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
                for word in keys {
                    let value =
                        |side: &'_ serde_json::Map<_, _>| side.get(word).cloned().unwrap_or(Null);
                    walk(&inner(word), [&value(a), &value(b)], found);
                }
            }
            [Array(a), Array(b)] if a.len() == b.len() && a.iter().any(|item| item.is_object()) => {
                for (i, (a, b)) in a.iter().zip(b).enumerate() {
                    walk(&inner(&i.to_string()), [a, b], found);
                }
            }
            pair => {
                let short = |value: &serde_json::Value| match value {
                    Null => "not given".to_string(),
                    value => {
                        let text = value.to_string();
                        match text.char_indices().nth(40) {
                            Some((end, _)) => format!("{}...", &text[..end]),
                            None => text,
                        }
                    }
                };
                found.push((key.into(), pair.map(short)));
            }
        }
    }
    let mut found = Vec::new();
    walk("", [there, here], &mut found);
    let is_other = |key: &str| !NO_OTHER_EXPERIMENT.contains(&key.split('.').next().unwrap_or(key));
    found.retain(|(key, _)| is_other(key));
    found
}

/// Whether the folder holds a record of exactly this experiment, its claims and pictures included, by
/// this build.
pub(crate) fn has_record(experiment: &Experiment, out: &Path) -> bool {
    let folder = RecordFolder::new(out.join(&experiment.file.name));
    let same_build =
        || matches!(folder.read_provenance(), Ok(Some(p)) if p.build == provenance::build());
    let same_pictures =
        || folder.read_pictures().is_ok_and(|there| there == picture::wanted(&experiment.file.picture));
    folder.exists()
        && same_build()
        && same_pictures()
        && folder.read().is_ok_and(|stored| {
            stored.record.experiment_hash == assemble::experiment_hash(experiment)
                && stored.record.claims == serde_json::json!(experiment.file.claim)
        })
}
