//! `scatterproof plan`.

use std::io::{self, Write};
use std::path::PathBuf;

use super::console::Console;
use super::output::unwritable;
use super::{Reading, counted};
use crate::error::Result;
use crate::experiment::registry::Registry;
use crate::experiment::schema::Budget;
use crate::experiment::{Experiment, load, titled};
use crate::report::table::Table;
use crate::run::chi_square::Draws;
use crate::run::job::{Job, Passes};
use crate::run::memory::MemoryEstimate;
use crate::run::memory_limits::{available, readable};
use crate::run::progress::Progress;
use crate::run::{self, Plan, estimate_seconds};

/// Show what would run: cells, estimated time and memory, and where each value comes from.
#[derive(clap::Args, Debug)]
pub(super) struct Args {
    /// An experiment file.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    reading: Reading,
    /// Number of threads that the estimate assumes; default: all cores.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Do not run the few passes and draws that the estimate of time is based on.
    #[arg(long)]
    dry: bool,
}

/// Prints the plan.
///
/// # Errors
/// Bad input; memory that does not suffice.
pub(super) fn run(args: &Args, registry: &Registry, out: &mut impl Write) -> Result<u8> {
    let experiment = load(&args.file, &args.reading.options(), registry)?;
    let threads = args.threads.unwrap_or_else(|| run::Options::new("").threads);
    let plan = run::plan(&experiment, registry, threads)?;
    let available = available();
    // As a run does: the estimators of a cell by turns where there is room for all of them.
    let is_interleaved = plan.memory(threads, true).fits(available);
    let memory = plan.memory(threads, is_interleaved);
    tell(args, &experiment, &plan, threads, &memory, out).map_err(unwritable)?;
    memory.check(available)?;
    Ok(0)
}

fn tell(
    args: &Args,
    experiment: &Experiment,
    plan: &Plan,
    threads: usize,
    memory: &MemoryEstimate,
    out: &mut impl Write,
) -> io::Result<()> {
    tell_origins(&experiment.origins, out)?;
    let mut total = 0.0;
    if !experiment.cells.is_empty() {
        total += tell_passes(experiment, plan, args.dry, out)?;
    }
    if !experiment.file.sampler.is_empty() {
        total += tell_draws(experiment, plan, args.dry, out)?;
    }
    if !args.dry {
        writeln!(out, "about {:.0} s on {threads} threads", total / threads as f64)?;
    }
    let free = available().map_or("unknown".into(), |available| available.words());
    let sums = format!(
        "memory: {} (shapes {}, making them {}, guides {}, results {}, working {}); available: {free}",
        readable(memory.total()),
        readable(memory.shapes),
        readable(memory.building),
        readable(memory.guides),
        readable(memory.results),
        readable(memory.working)
    );
    writeln!(out, "{}", Console::of_output().wrapped(&sums, usize::MAX))
}

fn tell_origins(origins: &[(String, String, String)], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "values and where they come from")?;
    let mut values = Table::new(&["key", "value", "from"]);
    for (key, value, origin) in origins {
        values.push([key, value, origin].map(|text| shortened(text)).into());
    }
    writeln!(out, "{}", Console::of_output().laid_out(&values))
}

/// Longest text in a table of the terminal, characters.
const LONGEST: usize = 160;

/// A text that fits into a table, with its length where it does not.
fn shortened(text: &str) -> String {
    let length = text.chars().count();
    if length <= LONGEST {
        return text.to_string();
    }
    let begin: String = text.chars().take(LONGEST / 2).collect();
    format!("{begin}.. ({length} characters)")
}

/// The plan of estimators; returns its CPU seconds, 0 where `dry`.
fn tell_passes(
    experiment: &Experiment,
    plan: &Plan,
    dry: bool,
    out: &mut impl Write,
) -> io::Result<f64> {
    let budget = experiment.file.budget.as_ref();
    let words = match budget {
        Some(Budget::Passes(n)) => format!("{n} passes"),
        Some(Budget::CpuSeconds(s)) => format!("{s} CPU seconds each"),
        Some(Budget::RelativeError(e)) => format!("relative error {}", e.at_most),
        None => "none".into(),
    };
    let jobs: Vec<&Passes> = plan.jobs.iter().filter_map(Job::passes).collect();
    let (cells, measurements) = (experiment.cells.len(), jobs.len());
    writeln!(
        out,
        "{}, {}, budget: {words}",
        counted(cells, "cell"),
        counted(measurements, "measurement")
    )?;
    let mut table =
        Table::new(&["cell", "estimator", "observables", "passes", "set-up", "CPU time", "memory"]);
    let mut total = 0.0;
    let progress = Progress::new(jobs.len(), dry);
    for (done, job) in jobs.into_iter().enumerate() {
        let title = titled(&experiment.cells[job.cell].axes, &experiment.cells[job.cell].label);
        progress.update(done as f64, format!("measuring {title} / {}", job.arm.name));
        let estimate = budget.filter(|_| !dry).and_then(|budget| estimate_seconds(job, budget));
        // After the estimate, which has prepared the estimator.
        let set_up = estimate.map(|_| job.set_up.seconds());
        total += estimate.map_or(0.0, |(_, seconds)| seconds) + set_up.unwrap_or(0.0);
        let time = |seconds: Option<f64>| seconds.map_or("-".into(), |s| format!("{s:.1} s"));
        table.push(vec![
            title,
            job.arm.name.clone(),
            job.layout.observables().len().to_string(),
            estimate.map_or("-".into(), |(passes, _)| passes.to_string()),
            time(set_up),
            time(estimate.map(|(_, seconds)| seconds)),
            readable(job.estimator.held_bytes() + job.estimator.working_bytes()),
        ]);
    }
    progress.finish();
    let console = Console::of_output();
    write!(out, "{}", console.fit(table, &[], &["memory", "observables", "set-up"]))?;
    Ok(total)
}

/// The plan of samplers; returns the CPU seconds of the draws, 0 where `dry`.
fn tell_draws(experiment: &Experiment, plan: &Plan, dry: bool, out: &mut impl Write) -> io::Result<f64> {
    let jobs: Vec<&Draws> = plan.jobs.iter().filter_map(Job::draws).collect();
    let samples = experiment.file.samples.unwrap_or_default();
    writeln!(out, "{}, {samples} draws each", counted(jobs.len(), "sampler"))?;
    let mut table = Table::new(&["sampler", "kind", "CPU time"]);
    let mut total = 0.0;
    for job in jobs {
        let seconds = (!dry).then(|| job.estimate_seconds());
        total += seconds.unwrap_or(0.0);
        let time = seconds.map_or("-".into(), |seconds| format!("{seconds:.2} s"));
        table.push(vec![job.name.clone(), job.kind.clone(), time]);
    }
    write!(out, "{}", table.to_text())?;
    if !dry {
        writeln!(out, "beside the draws, some tenths of a second a sampler for masses")?;
    }
    Ok(total)
}
