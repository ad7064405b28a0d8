//! `scatterproof report`.

use std::path::PathBuf;

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
pub(super) fn run(args: &Args) -> Result<u8> {
    for folder in &args.folders {
        report::write(&RecordFolder::new(folder))?;
        println!("{}", folder.join("report.html").display());
        println!("{}", folder.join("report.md").display());
    }
    Ok(0)
}
