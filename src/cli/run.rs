//! `scatterproof run`.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::console::Console;
use super::output::{say, unwritable};
use super::{Reading, Working, counted, experiment_files, listen};
use crate::error::Result;
use crate::experiment::load;
use crate::experiment::registry::Registry;
use crate::report::ReportData;
use crate::report::{self, terminal};
use crate::results::number::significant;
use crate::results::store::RecordFolder;
use crate::run::live::Live;
use crate::run::shard::{Shard, Sharded, run_shard};
use crate::run::tev::Address;
use crate::verify::verdict::Verdict;

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
    /// Run part I of N only, as 3/10, into DIR/NAME/shards; `merge` joins the parts into the record. Any N, in any
    /// order, on any machine.
    #[arg(long, value_name = "I/N", conflicts_with = "tev")]
    shard: Option<Shard>,
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
        experiments.iter().try_for_each(|experiment| {
            crate::run::plan(experiment, registry, options.threads).map(drop)
        })?;
    }
    if let Some(address) = &args.tev {
        match Live::connect(address) {
            Ok(live) => options.live = Some(Arc::new(live)),
            Err(what) => say(what),
        }
    }
    for experiment in &experiments {
        if let Some(shard) = args.shard {
            let sharded = run_shard(experiment, registry, &options, shard, &interrupt)?;
            tell_shard(shard, &sharded, out).map_err(unwritable)?;
            continue;
        }
        let ran = crate::run::run(experiment, registry, &options, &interrupt)?;
        let material = report::write(&ran.folder)?;
        tell(&material, &ran.folder, &experiment.path, &args.reading, &args.working.out, out)
            .map_err(unwritable)?;
    }
    Ok(0)
}

fn tell_shard(shard: Shard, sharded: &Sharded, out: &mut impl Write) -> io::Result<()> {
    let Sharded { folder, measurements, passes } = sharded;
    let what = counted(*measurements, "measurement");
    writeln!(out, "shard {shard}: {passes} passes of {what}: {}", folder.display())
}

/// Prints the tables of a run.
pub(super) fn tell(
    material: &ReportData,
    folder: &RecordFolder,
    file: &Path,
    reading: &Reading,
    results: &Path,
    out: &mut impl Write,
) -> io::Result<()> {
    let console = Console::of_output();
    let record = &material.stored.record;
    let bands: Vec<String> = record.bands.iter().map(|band| band.name.clone()).collect();
    let mut table = terminal::run_table(material);
    for row in &mut table.rows {
        if let Some(cell) = record.cells.iter().find(|cell| cell.label == row[0]) {
            row[0] = cell.title();
        }
    }
    let less = ["observable", "paths/s/core", "CPU s"];
    write!(out, "{}", console.fit(table, &bands, &less))?;
    write!(out, "{}", console.laid_out(&terminal::sampler_table(material)))?;
    if let Some(block) = terminal::efficiency_table(material) {
        let table = console.fit_rows(&block.table, &bands);
        writeln!(out, "\n{}\n\n{table}", console.wrapped(&block.caption, 110))?;
    }
    for note in terminal::notes(material) {
        writeln!(out, "{}", console.wrapped(&format!("note: {note}"), usize::MAX))?;
    }
    writeln!(out, "\nreport: {}", folder.root().join("report.html").display())?;
    tell_claims(&material.verdicts, file, reading, results, console, out)?;
    tell_ratios(material, console, out)
}

/// How the claims fare by this run, and what decides them.
fn tell_claims(
    verdicts: &[Verdict],
    file: &Path,
    reading: &Reading,
    results: &Path,
    console: Console,
    out: &mut impl Write,
) -> io::Result<()> {
    if verdicts.is_empty() {
        return Ok(());
    }
    let mut others: Vec<(String, usize)> = Vec::new();
    for verdict in verdicts.iter().filter(|v| !v.is_green()) {
        let outcome = verdict.outcome.to_string();
        match others.iter_mut().find(|(known, _)| *known == outcome) {
            Some((_, count)) => *count += 1,
            None => others.push((outcome, 1)),
        }
    }
    let green = verdicts.iter().filter(|v| v.is_green()).count();
    let others: String = others.iter().map(|(outcome, count)| format!(", {count} {outcome}")).collect();
    let text = format!("claims: {green} of {} verdicts are green by this run{others}", verdicts.len());
    let line = console.verdict(&text, green == verdicts.len());
    let out_dir = match results.to_str() {
        Some("results") => String::new(),
        _ => format!(" --out {}", results.display()),
    };
    let command =
        format!("scatterproof verify {}{}{out_dir}", file.display(), reading.arguments_without(""));
    writeln!(out, "{line}; `verify` judges them, with second looks and an exit code:\n  {command}")
}

/// A line for each pair of estimators: between what its efficiency ratios are.
fn tell_ratios(material: &ReportData, console: Console, out: &mut impl Write) -> io::Result<()> {
    let rows = terminal::efficiency_rows(material);
    let mut pairs: Vec<(&str, &str)> = Vec::new();
    for row in &rows {
        let pair = (row.candidate.as_str(), row.baseline.as_str());
        if !pairs.contains(&pair) {
            pairs.push(pair);
        }
    }
    for (candidate, baseline) in pairs {
        let own = rows.iter().filter(|row| row.candidate == candidate && row.baseline == baseline);
        let ratios: Vec<f64> =
            own.clone().filter_map(|row| row.quoted()).map(|[ratio, ..]| ratio).collect();
        if ratios.is_empty() {
            let first = rows.iter().find(|row| row.candidate == candidate && row.baseline == baseline);
            let reason = first.map_or("", |row| terminal::reason(row));
            let line = format!("no ratio of the efficiencies of {candidate} and {baseline}: {reason}");
            writeln!(out, "{}", console.wrapped(&line, usize::MAX))?;
            continue;
        }
        // The better one first.
        let log = |x: &f64| crate::math::ln(*x);
        let is_better = ratios.iter().map(log).sum::<f64>() >= 0.0;
        let (first, second) = if is_better { (candidate, baseline) } else { (baseline, candidate) };
        let sided: Vec<f64> = ratios.iter().map(|x| if is_better { *x } else { 1.0 / x }).collect();
        let [least, most] = [
            sided.iter().copied().fold(f64::INFINITY, f64::min),
            sided.iter().copied().fold(0.0, f64::max),
        ]
        .map(|x| significant(x, 2));
        let times = if least == most { least } else { format!("{least} to {most}") };
        let line = format!("{first} is {times} times as efficient as {second}");
        let (of, open) =
            (own.clone().count(), own.filter(|row| row.quoted().is_some() && !row.resolved));
        let mut limits = String::new();
        if ratios.len() < of {
            limits += &format!("; without a ratio: {} of {of} bands and cells", of - ratios.len());
        }
        match open.count() {
            0 => {}
            open => limits += &format!("; not resolved: {open} of {}", ratios.len()),
        }
        writeln!(out, "{}{limits}", console.verdict(&line, limits.is_empty()))?;
    }
    Ok(())
}
