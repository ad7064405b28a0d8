//! `scatterproof merge`.

use std::io::Write;
use std::path::PathBuf;

use super::output::unwritable;
use super::{Reading, listen, run};
use crate::error::Result;
use crate::experiment::load;
use crate::experiment::registry::Registry;
use crate::report;

/// Join the shards of a run (`run --shard`) into its record: the same bytes as those of one run.
///
/// Shards that were merged before are kept, and need not be there again when more are added for a larger budget.
#[derive(clap::Args, Debug)]
pub(super) struct Args {
    /// The experiment file of the shards.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Folders of shards; default: all in DIR/NAME/shards.
    #[arg(value_name = "SHARD")]
    shards: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    /// Folder for the results, one subfolder per experiment.
    #[arg(long, value_name = "DIR", default_value = "results")]
    out: PathBuf,
    /// As in `run`: as many passes as the record in DIR/NAME has.
    #[arg(long, value_name = "DIR")]
    passes_of: Option<PathBuf>,
    /// Write no report; `scatterproof report DIR` makes one later.
    #[arg(long)]
    no_report: bool,
}

/// Merges, and reports as `run` does.
///
/// # Errors
/// Bad input; a shard that is missing, doubled, foreign or damaged; I/O, interruption.
pub(super) fn run(args: &Args, registry: &Registry, out: &mut impl Write) -> Result<u8> {
    let interrupt = listen()?;
    let mut options = crate::run::Options::new(&args.out);
    options.passes_of = args.passes_of.clone();
    let experiment = load(&args.file, &args.reading.options(), registry)?;
    let ran = crate::run::merge(&experiment, registry, &options, &args.shards, &interrupt)?;
    if args.no_report {
        writeln!(out, "record: {}", ran.folder.root().join("record").display()).map_err(unwritable)?;
        return Ok(0);
    }
    let material = report::write(&ran.folder)?;
    run::tell(&material, &ran.folder, &args.file, &args.reading, &args.out, out).map_err(unwritable)?;
    Ok(0)
}
