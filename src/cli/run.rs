//! `scatterproof run`.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;

use super::output::{say, unwritable};
use super::{Reading, Working, experiment_files, listen};
use crate::error::Result;
use crate::experiment::load;
use crate::experiment::registry::Registry;
use crate::report::ReportData;
use crate::report::{self, terminal};
use crate::results::store::RecordFolder;
use crate::run::live::Live;
use crate::run::tev::Address;

/// Run experiments; print progress, then a table and the path of the report.
///
/// An interrupted run resumes where it stopped; a complete run is not repeated.
#[derive(clap::Args, Debug)]
pub(super) struct Args {
    /// Experiment files, or folders of them.
    #[arg(required = true, value_name = "FILE or DIR")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    working: Working,
    /// Run as many passes as the record in DIR/NAME has, instead of those that the budget allows: a
    /// record whose budget is in seconds reproduces bit for bit.
    #[arg(long, value_name = "DIR")]
    passes_of: Option<PathBuf>,
    /// Show images in a running tev viewer while they are rendered; default address 127.0.0.1:14158.
    /// Results do not depend on it.
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = Address::USUAL)]
    tev: Option<Address>,
}

/// Runs the files one after the other.
///
/// # Errors
/// Bad input in any file (found before the first runs), I/O, interruption.
pub(super) fn run(args: &Args, registry: &Registry, out: &mut impl Write) -> Result<u8> {
    let interrupt = listen()?;
    let mut options = args.working.options();
    options.passes_of = args.passes_of.clone();
    let read = |file: &PathBuf| load(file, &args.reading.options(), registry);
    let experiments = experiment_files(&args.files)?.iter().map(read).collect::<Result<Vec<_>>>()?;
    if !args.working.replace {
        experiments.iter().try_for_each(|e| crate::run::refuse_to_replace(e, &options.out))?;
    }
    if let [_, _, ..] = experiments[..] {
        experiments
            .iter()
            .try_for_each(|experiment| crate::run::plan(experiment, registry).map(drop))?;
    }
    if let Some(address) = &args.tev {
        match Live::connect(address) {
            Ok(live) => options.live = Some(Arc::new(live)),
            Err(what) => say(what),
        }
    }
    for experiment in &experiments {
        let (folder, _) = crate::run::run(experiment, registry, &options, &interrupt)?;
        let material = report::write(&folder)?;
        tell(&material, &folder, out).map_err(unwritable)?;
    }
    Ok(0)
}

fn tell(material: &ReportData, folder: &RecordFolder, out: &mut impl Write) -> io::Result<()> {
    write!(out, "{}", terminal::run_table(material).to_text())?;
    write!(out, "{}", terminal::sampler_table(material).to_text())?;
    if let Some(block) = terminal::efficiency_table(material) {
        writeln!(out, "\n{}\n\n{}", terminal::wrapped(&block.caption, 110), block.table.to_text())?;
    }
    for note in terminal::notes(material) {
        writeln!(out, "note: {note}")?;
    }
    writeln!(out, "\nreport: {}", folder.root().join("report.html").display())
}
