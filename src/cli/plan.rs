//! `scatterproof plan`.

use std::path::PathBuf;

use super::{Reading, counted};
use crate::error::Result;
use crate::experiment::registry::Registry;
use crate::experiment::schema::Budget;
use crate::experiment::{Loaded, SamplerExperiment, load_any};
use crate::report::table::Table;
use crate::run::memory::{available, readable};
use crate::run::{self, estimate_seconds};

/// Show what would run: cells, estimated time and memory, and where each value comes from.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// An experiment file.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    reading: Reading,
    /// Number of threads that the estimate assumes; default: all cores.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Do not run the few passes that the estimate of time is based on.
    #[arg(long)]
    dry: bool,
}

/// Prints the plan.
///
/// # Errors
/// Bad input.
pub fn run(args: &Args, registry: &Registry) -> Result<u8> {
    let experiment = match load_any(&args.file, &args.reading.options(), registry)? {
        Loaded::Scene(experiment) => experiment,
        Loaded::Samplers(experiment) => return plan_samplers(args, &experiment, registry),
    };
    let plan = run::plan(&experiment, registry)?;
    let threads = args.threads.unwrap_or_else(|| run::Options::new("").threads);

    print_origins(&experiment.origins);

    let budget = match &experiment.file.budget {
        Budget::Passes(n) => format!("{n} passes"),
        Budget::CpuSeconds(s) => format!("{s} CPU seconds each"),
        Budget::RelativeError(e) => format!("relative error {}", e.at_most),
    };
    let (cells, measurements) = (experiment.cells.len(), plan.jobs.len());
    println!("{}, {}, budget: {budget}", counted(cells, "cell"), counted(measurements, "measurement"));
    let mut table = Table::new(&["cell", "estimator", "observables", "passes", "CPU time"]);
    let mut total = 0.0;
    for job in &plan.jobs {
        let (passes, time) =
            match if args.dry { None } else { estimate_seconds(job, &experiment.file.budget) } {
                Some((passes, seconds)) => {
                    total += seconds;
                    (passes.to_string(), format!("{seconds:.1} s"))
                }
                None => ("-".into(), "-".into()),
            };
        table.push(vec![
            experiment.cells[job.cell].label.clone(),
            job.name.clone(),
            job.layout.observables().len().to_string(),
            passes,
            time,
        ]);
    }
    print!("{}", table.to_text());
    if !args.dry {
        println!("about {:.0} s on {threads} threads", total / threads as f64);
    }

    let memory = plan.memory(threads);
    let free = available().map_or("unknown".into(), readable);
    println!(
        "memory: {} (shapes {}, results {}, working {}); available: {free}",
        readable(memory.total()),
        readable(memory.shapes),
        readable(memory.results),
        readable(memory.working)
    );
    memory.check(available())?;
    Ok(0)
}

fn print_origins(origins: &[(String, String, String)]) {
    println!("values and where they come from");
    let mut values = Table::new(&["key", "value", "from"]);
    for (key, value, origin) in origins {
        values.push(vec![key.clone(), value.clone(), origin.clone()]);
    }
    println!("{}", values.to_text());
}

/// What would be drawn; without `--dry` a few chunks of each sampler are, for their time.
fn plan_samplers(args: &Args, experiment: &SamplerExperiment, registry: &Registry) -> Result<u8> {
    print_origins(&experiment.origins);
    let threads = args.threads.unwrap_or_else(|| run::Options::new("").threads);
    let file = &experiment.file;
    println!("{}, {} draws each", counted(file.sampler.len(), "sampler"), file.samples);
    let mut table = Table::new(&["sampler", "kind", "CPU time"]);
    let mut total = 0.0;
    let times = run::samplers::estimate_seconds(experiment, registry, args.dry)?;
    for (entry, seconds) in file.sampler.iter().zip(times) {
        let kind = entry.choice().map_or("", |(kind, _)| kind);
        total += seconds.unwrap_or(0.0);
        let time = seconds.map_or("-".into(), |seconds| format!("{seconds:.2} s"));
        table.push(vec![entry.name.clone(), kind.into(), time]);
    }
    print!("{}", table.to_text());
    if !args.dry {
        println!(
            "about {:.0} s on {threads} threads, and some tenths of a second a sampler for masses",
            total / threads as f64
        );
    }
    Ok(0)
}
