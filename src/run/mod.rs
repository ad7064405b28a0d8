//! Runs experiments: jobs from cells and estimators, passes on threads, checkpoints, the record.
//!
//! experiment -> jobs (scene + estimator + streams) -> blocks of passes, in any order, on any threads
//! -> moments in the order of passes -> record, timing, provenance.

pub mod checkpoint;
pub mod chi_square;
pub mod clock;
pub mod comparisons;
pub mod interrupt;
pub mod job;
pub mod keys;
pub mod live;
pub mod memory;
pub mod pilot;
pub mod progress;
pub mod samplers;
pub mod tev;
pub mod workers;

mod assemble;
mod jobs;
mod replay;
mod retest;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::experiment::picture;
use crate::experiment::registry::Registry;
use crate::experiment::{Experiment, Loaded};
use crate::results::provenance::{self, Provenance};
use crate::results::record::Replay;
use crate::results::store::{RecordFolder, Stored};
use interrupt::Interrupt;
use job::{Finished, Job};
use live::{Live, Show};
use progress::Progress;

pub use jobs::{Plan, plan};
pub use pilot::estimate_seconds;
pub use retest::retest;

/// How to run; nothing here changes a result.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder that holds a folder per experiment.
    pub out: PathBuf,
    /// Number of threads.
    pub threads: usize,
    /// Passes per block; chosen by time without it.
    pub block_passes: Option<u64>,
    /// No progress bar.
    pub quiet: bool,
    /// Folder that holds a results folder per experiment, whose records say how many passes are played; the budget does
    /// without it. A budget in seconds gives another number of passes each time that it is measured anew: this is how
    /// such a record comes again bit for bit.
    pub passes_of: Option<PathBuf>,
    /// A viewer that shows images while they are made.
    pub live: Option<Arc<Live>>,
}

impl Options {
    /// Into `out`, on all cores.
    pub fn new(out: impl Into<PathBuf>) -> Options {
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
    pub fn folder(&self, experiment: &str) -> PathBuf {
        self.out.join(experiment)
    }
}

/// Runs an experiment, or what is left of it, and writes its record, timing and provenance.
///
/// # Errors
/// Bad input found while building; a run that does not fit in memory; I/O; an interruption, after which
/// the same call goes on where this one stopped.
pub fn run(
    experiment: &Experiment,
    registry: &Registry,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<(RecordFolder, Stored)> {
    let mut plan = plan(experiment, registry)?;
    if let Some(folder) = &options.passes_of {
        take_passes(&mut plan, experiment, &RecordFolder::new(folder.join(&experiment.file.name)))?;
    }
    let (folder, stored) =
        play(experiment, &plan, &options.folder(&experiment.file.name), options, interrupt)?;
    folder.write_pictures(&picture::wanted(&experiment.file.picture))?;
    Ok((folder, stored))
}

/// Has every measurement play as many passes as the record in `from` has of it.
fn take_passes(plan: &mut Plan, experiment: &Experiment, from: &RecordFolder) -> Result<()> {
    let record = from.read()?.record;
    if record.experiment_hash != assemble::experiment_hash(experiment) {
        let words = "the record there is of another experiment than the file";
        let help = "`scatterproof compare` of the two results says what was changed; run without --passes-of to take the \
                    passes from the budget";
        return Err(Error::record(from.root(), format!("{words}; {help}")));
    }
    for job in &mut plan.jobs {
        let mut runs = record.cells.get(job.cell).into_iter().flat_map(|cell| &cell.runs);
        let run = runs.find(|run| run.estimator == job.name);
        let missing = || Error::record(from.root(), format!("the record there holds no {}", job.label));
        job.passes = Some(run.ok_or_else(missing)?.passes);
    }
    Ok(())
}

/// Runs an experiment of either sort.
///
/// # Errors
/// As [`run`] and [`samplers::run`].
pub fn run_any(
    loaded: &Loaded,
    registry: &Registry,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<(RecordFolder, Stored)> {
    match loaded {
        Loaded::Scene(experiment) => run(experiment, registry, options, interrupt),
        Loaded::Samplers(experiment) => {
            if options.passes_of.is_some() {
                let words = format!(
                    "`{}` draws from samplers: it has no passes to take from a record",
                    loaded.name()
                );
                return Err(Error::input_help(
                    words,
                    "leave --passes-of out: its file says how many draws",
                ));
            }
            if options.live.is_some() {
                eprintln!("{}", nothing_to_show(loaded.name()));
            }
            samplers::run(experiment, registry, options, interrupt)
        }
    }
}

fn nothing_to_show(experiment: &str) -> String {
    format!("note: `{experiment}` has no image: tev has nothing to show of it")
}

/// Whether the folder holds a record of exactly this experiment, its claims included, by this build.
pub fn has_record_of(loaded: &Loaded, out: &Path) -> bool {
    match loaded {
        Loaded::Scene(experiment) => has_record(experiment, out),
        Loaded::Samplers(experiment) => samplers::has_record(experiment, out),
    }
}

/// Plays a plan into the results folder `root`.
fn play(
    experiment: &Experiment,
    plan: &Plan,
    root: &Path,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<(RecordFolder, Stored)> {
    plan.memory(options.threads).check(memory::available())?;
    crate::results::atomic::create_folder(&root.join("state"), "create the results folder")?;
    let progress = Progress::new(plan.jobs.len(), options.quiet);
    let show = options.live.as_deref().map(|live| {
        let experiment = experiment.file.name.as_str();
        Show { live, experiment, bands: &plan.bands, jobs: &plan.jobs }
    });
    if show.is_some_and(|show| !show.has_images()) {
        progress.say(&nothing_to_show(&experiment.file.name));
    }
    let settings = workers::Settings {
        threads: options.threads.max(1),
        block_passes: options.block_passes,
        interrupt,
        root,
        progress: &progress,
        show,
    };
    let played = workers::play_all(&plan.jobs, &experiment.file.budget, &settings);
    progress.finish();
    let played = played?;
    let replays = replays(experiment, plan, &played, interrupt)?;
    let assembled = assemble::assemble(experiment, plan, played, replays)?;
    let folder = RecordFolder::new(root);
    let mut stored = folder.write(assembled.record, assembled.arrays)?;
    folder.write_timing(&assembled.timing)?;
    stored.timing = Some(assembled.timing);
    folder.write_provenance(&Provenance::collect(options.threads))?;
    Ok((folder, stored))
}

/// What `reproduces` claims want played again.
fn replays(
    experiment: &Experiment,
    plan: &Plan,
    played: &[Finished],
    interrupt: &Interrupt,
) -> Result<Vec<Replay>> {
    let claims = experiment.file.claim.iter().filter_map(|claim| claim.reproduces.as_ref());
    let Some(passes) = claims.map(|claim| claim.passes).max() else { return Ok(Vec::new()) };
    let again = |(job, finished): (&Job, &Finished)| {
        replay::replay(job, &job.name, finished, passes, &|| interrupt.raised())
    };
    let replays: Option<Vec<Replay>> = plan.jobs.iter().zip(played).map(again).collect();
    replays.ok_or_else(|| {
        Error::Interrupted("all passes are played and kept; the same command goes on from there".into())
    })
}

/// Whether the folder holds a record of exactly this experiment, its claims and pictures included, by this
/// build.
pub fn has_record(experiment: &Experiment, out: &Path) -> bool {
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
