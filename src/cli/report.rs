//! `scatterproof report`.

use std::io::Write;
use std::path::PathBuf;

use super::output::unwritable;
use crate::error::Result;
use crate::report;
use crate::results::store::RecordFolder;

/// Make tables, images and pages again from records alone.
#[derive(clap::Args, Debug)]
pub(super) struct Args {
    /// Results folders.
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
}

/// Writes the views of every folder.
///
/// # Errors
/// No record, a damaged one, I/O.
pub(super) fn run(args: &Args, out: &mut impl Write) -> Result<u8> {
    for folder in &args.folders {
        report::write(&RecordFolder::new(folder))?;
        for view in ["report.html", "report.md"] {
            writeln!(out, "{}", folder.join(view).display()).map_err(unwritable)?;
        }
    }
    Ok(0)
}
