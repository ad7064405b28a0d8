//! `scatterproof verify`.

use std::path::{Path, PathBuf};

use super::{Reading, Working, listen};
use crate::error::{Error, Result};
use crate::experiment::registry::Registry;
use crate::experiment::{Experiment, load};
use crate::report::table::verdict_table;
use crate::results::store::{RecordFolder, Stored};
use crate::verify::judge::{FAMILY_LEVEL, judge};
use crate::verify::junit;
use crate::verify::verdict::{self, Verdict};

/// Judge the claims of experiments; runs what has no record yet.
///
/// Exit code 0: every claim is green. 1: a claim failed. 3: a claim is underpowered or invalid.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Experiment files, folders of them, or results folders (judged as they are).
    #[arg(value_name = "FILE or DIR", default_value = "experiments/verify")]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    working: Working,
    /// Write the verdicts as JUnit XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Print every verdict; without it those that are not green and the tables' summaries.
    #[arg(long, short)]
    verbose: bool,
}

/// Judges everything named as one family.
///
/// # Errors
/// Bad input, I/O, interruption. A claim that does not hold is no error: it is the exit code.
pub fn run(args: &Args, registry: &Registry) -> Result<u8> {
    let interrupt = listen()?;
    let options = args.working.options();
    let mut stored = Vec::new();
    for path in &args.paths {
        if path.join("record").join("record.json").exists() {
            stored.push(RecordFolder::new(path).read()?);
            continue;
        }
        for file in experiment_files(path)? {
            let experiment = load(&file, &args.reading.options(), registry)?;
            stored.push(measured(&experiment, registry, &options, &interrupt)?);
        }
    }
    let records: Vec<&Stored> = stored.iter().collect();
    let verdicts = judge(&records, FAMILY_LEVEL);
    if verdicts.is_empty() {
        return Err(Error::input_help(
            "nothing was judged: what was named makes no claims",
            "add a [[claim]] to the experiment, or name one that has some",
        ));
    }
    tell(&verdicts, args.verbose);
    if let Some(path) = &args.junit {
        crate::results::atomic::write(
            path,
            junit::to_junit(&verdicts).as_bytes(),
            "write the JUnit file",
        )?;
    }
    Ok(verdict::exit_code(&verdicts))
}

fn measured(
    experiment: &Experiment,
    registry: &Registry,
    options: &crate::run::Options,
    interrupt: &crate::run::interrupt::Interrupt,
) -> Result<Stored> {
    if crate::run::has_record(experiment, &options.out) {
        return RecordFolder::new(options.folder(&experiment.file.name)).read();
    }
    eprintln!("running {}", experiment.file.name);
    let (folder, stored) = crate::run::run(experiment, registry, options, interrupt)?;
    crate::report::write(&folder, FAMILY_LEVEL)?;
    Ok(stored)
}

fn tell(verdicts: &[Verdict], verbose: bool) {
    let green = verdicts.iter().filter(|v| v.is_green()).count();
    let shown: Vec<Verdict> = verdicts
        .iter()
        .filter(|v| verbose || !v.is_green() || v.test == "sum of z^2")
        .cloned()
        .collect();
    if !shown.is_empty() {
        print!("{}", verdict_table(&shown).to_text());
    }
    println!(
        "{green} of {} verdicts are green; family-wise level {FAMILY_LEVEL:e} over all of them (Holm)",
        verdicts.len()
    );
    if let Some(worst) = verdicts
        .iter()
        .filter(|v| v.expected != 0.0 && v.detectable.is_finite())
        .map(|v| v.detectable)
        .max_by(f64::total_cmp)
    {
        println!(
            "largest defect that could have gone unseen (99 % power): {:.2} % of the value",
            100.0 * worst
        );
    }
}

/// A file itself, or the experiment files of a folder in the order of their names.
fn experiment_files(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_path_buf()]); // `load` says what is wrong with it
    }
    let entries = std::fs::read_dir(path).map_err(Error::io(path, "read the folder"))?;
    let paths = entries.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    let mut files: Vec<PathBuf> = paths.filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    if files.is_empty() {
        return Err(Error::input_help(
            format!("{} holds neither a record nor experiment files", path.display()),
            "name an experiment file, a folder of them, or a results folder",
        ));
    }
    Ok(files)
}
