//! `scatterproof compare`.

use std::io::Write;
use std::path::PathBuf;

use super::console::Console;
use super::output::unwritable;
use crate::error::{Error, Result};
use crate::report::outcome;
use crate::report::table::Table;
use crate::report::tables::verdict_table;
use crate::results::number::significant;
use crate::results::store::RecordFolder;
use crate::verify::comparisons::EfficiencyRow;
use crate::verify::difference::{Compared, Terms, WorkChange, compare};
use crate::verify::judge::FAMILY_LEVEL;
use crate::verify::junit;
use crate::verify::timing_ratios::{self, TimingRatio, timing_ratios};
use crate::verify::verdict::{TestKind, Verdict};

/// Compare two records of one experiment: what changed, and whether a mean differs.
///
/// Reports what differs between the two experiments, then compares every observable that both records
/// hold, per cell, estimator and band: `identical` where every bit is the same, else by a t test (paired
/// pass by pass where both used the same random numbers). All tests are one family at --level. If both
/// records have efficiencies by CPU time, it reports whether these are compatible. This does not affect
/// the exit code, because times depend on the machine.
///
/// --max-slowdown; 2 bad usage; 3 nothing can be compared, or the first observable of an estimator
/// cannot be judged.
#[derive(clap::Args, Debug)]
pub(super) struct Args {
    /// The reference: a results folder, such as a baseline kept in git.
    #[arg(value_name = "BEFORE")]
    before: PathBuf,
    /// The results folder that is compared with BEFORE.
    #[arg(value_name = "AFTER")]
    after: PathBuf,
    /// Probability of any false alarm in the whole comparison.
    #[arg(long, value_name = "P", default_value_t = FAMILY_LEVEL, value_parser = super::probability)]
    level: f64,
    /// Also fail (exit code 3, underpowered) where a change of this fraction of an estimator's first
    /// observable could go unseen.
    #[arg(long, value_name = "FRACTION", value_parser = super::positive)]
    detect: Option<f64>,
    /// Also fail (exit code 1) where a counter of work per pass (paths, rays, events) grew by more than
    /// this factor. Counters are exact and the same on every machine, where seconds are neither.
    #[arg(long, value_name = "FACTOR", value_parser = super::positive)]
    max_slowdown: Option<f64>,
    /// Write the verdicts as JUnit XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write what was found as a page.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print every verdict; default: only those that are not green.
    #[arg(long, short)]
    verbose: bool,
}

/// Compares the two records and prints the result.
///
/// # Errors
/// No record, a damaged one, nothing in common, I/O.
pub(super) fn run(args: &Args, out: &mut impl Write) -> Result<u8> {
    let [before, after] = [&args.before, &args.after].map(|path| RecordFolder::new(path).read());
    let (before, after) = (before?, after?);
    let terms = Terms { level: args.level, detect: args.detect, max_slowdown: args.max_slowdown };
    let compared = compare(&before, &after, &terms).ok_or_else(|| {
        let words = "nothing can be compared: the records share no cell, estimator, observable and band";
        Error::record(&args.after, words)
    })?;
    if let Some(path) = &args.junit {
        let xml = junit::to_junit(&compared.verdicts);
        crate::results::atomic::write(path, xml.as_bytes(), "write the JUnit file")?;
    }
    if let Some(path) = &args.html {
        let mut text = Vec::new();
        tell_timing(&timing_ratios(&before, &after), &mut text).map_err(unwritable)?;
        let timing = String::from_utf8_lossy(&text).into_owned();
        let identical = match before.record == after.record {
            true => "The records are byte-identical.",
            false => "The records are not byte-identical.",
        };
        let mut sentences = vec![identical.to_string()];
        sentences.extend(compared.changes.iter().map(|change| format!("Changed: {change}")));
        if let Some(worst) = coarsest(&compared) {
            sentences.push(format!(
                "A change of {} % of any first observable would have been found with 99 % probability.",
                significant(100.0 * worst, 2)
            ));
        }
        sentences
            .extend(timing.lines().map(|line| line.trim().to_string()).filter(|line| !line.is_empty()));
        let title = format!("{} against {}", args.after.display(), args.before.display());
        let page = outcome::page(&title, sentences, Vec::new(), &compared.verdicts);
        crate::results::atomic::write(path, page.as_bytes(), "write the page")?;
    }
    tell(&compared, args, out)
        .and_then(|()| match before.record == after.record {
            true => writeln!(out, "the records are byte-identical"),
            false => writeln!(out, "the records are not byte-identical"),
        })
        .and_then(|()| tell_timing(&timing_ratios(&before, &after), out))
        .map_err(unwritable)?;
    Ok(compared.exit_code())
}

fn tell(compared: &Compared, args: &Args, out: &mut impl Write) -> std::io::Result<()> {
    let console = Console::of_output();
    if !compared.changes.is_empty() {
        writeln!(out, "differences between the two records:")?;
        compared.changes.iter().try_for_each(|change| writeln!(out, "  {change}"))?;
        writeln!(out)?;
    }
    let shown = compared.verdicts.iter().filter(|v| args.verbose || !v.is_green());
    let shown: Vec<Verdict> = shown.cloned().collect();
    if !shown.is_empty() {
        // Every row is of the same claim.
        let rows: Vec<Verdict> =
            shown.into_iter().map(|v| Verdict { claim: String::new(), ..v }).collect();
        writeln!(out, "{}", console.outcomes(&console.laid_out(&verdict_table(&rows))))?;
    }
    let all = compared.verdicts.len();
    let identical = compared.verdicts.iter().filter(|v| v.test == Some(TestKind::Identical)).count();
    let green = compared.verdicts.iter().filter(|v| v.is_green()).count();
    if identical == all {
        writeln!(out, "identical: all {all} quantities, bit for bit")?;
    } else {
        let work = console.laid_out(&work_table(&compared.work));
        writeln!(
            out,
            "work and variance, after over before; counts that stayed the same are left out\n{work}"
        )?;
        let sums = format!(
            "{green} of {all} quantities are green, {identical} of them identical bit for bit; \
             family-wise level {:e} (Holm)",
            args.level
        );
        writeln!(out, "{}", console.wrapped(&sums, usize::MAX))?;
        if let Some(worst) = coarsest(compared) {
            let power = format!(
                "largest change of a first observable that could have gone unseen (99 % power): {} %",
                significant(100.0 * worst, 2)
            );
            writeln!(out, "{}", console.wrapped(&power, usize::MAX))?;
        }
    }
    for work in compared.work.iter().filter(|work| work.too_slow.is_some()) {
        let name = work.too_slow.as_deref().unwrap_or_default();
        writeln!(
            out,
            "too slow: {} {}: {name} per pass grew to {} times",
            work.cell,
            work.estimator,
            significant(work.counts[name], 4)
        )?;
    }
    Ok(())
}

/// Whether efficiencies by CPU time are compatible; nothing where there are none.
fn tell_timing(ratios: &[TimingRatio], out: &mut impl Write) -> std::io::Result<()> {
    let size = |ratio: &&TimingRatio| ratio.change.max(1.0 / ratio.change);
    let Some(largest) = ratios.iter().max_by(|a, b| size(a).total_cmp(&size(b))) else { return Ok(()) };
    let others: Vec<&TimingRatio> = ratios.iter().filter(|ratio| !ratio.is_compatible()).collect();
    let number = |x: f64| significant(x, 3);
    let interval = |low: f64, high: f64| format!("[{}, {}]", number(low), number(high));
    writeln!(
        out,
        "efficiency by CPU time: {} of {} ratios are compatible (Holm, family-wise level {:e}); the largest change is \
         {} times {}",
        ratios.len() - others.len(),
        ratios.len(),
        timing_ratios::LEVEL,
        number(largest.change),
        interval(largest.interval[0], largest.interval[1]),
    )?;
    let is_apart = |ratio: &&TimingRatio| !(ratio.before.interleaved && ratio.after.interleaved);
    let apart = ratios.iter().filter(is_apart).count();
    if apart > 0 {
        writeln!(
            out,
            "note: {apart} of them were not interleaved in both records: what the machine did between two \
             estimators is in them"
        )?;
    }
    if others.is_empty() {
        return Ok(());
    }
    let header =
        ["cell", "band", "class", "of", "candidate", "against", "before", "after", "adjusted p"];
    let mut table = Table::new(&header);
    for TimingRatio { before, after, adjusted_p, .. } in others {
        let ratio = |row: &EfficiencyRow| {
            let [ratio, low, high] = row.quoted().unwrap_or([f64::NAN; 3]);
            format!("{} {}", number(ratio), interval(low, high))
        };
        let names = [
            &before.cell,
            &before.band,
            &before.class,
            &before.metric,
            &before.candidate,
            &before.baseline,
        ];
        let mut row = names.map(String::clone).to_vec();
        row.extend([ratio(before), ratio(after), significant(*adjusted_p, 2)]);
        table.push(row);
    }
    writeln!(out, "{}", table.to_text())
}

/// The largest detectable of the runs' first observables.
fn coarsest(compared: &Compared) -> Option<f64> {
    let first = compared.verdicts.iter().filter(|v| v.expected != Some(0.0) && compared.is_first(v));
    first.filter_map(|v| v.detectable).filter(|d| d.is_finite()).max_by(f64::total_cmp)
}

/// Per run: counts per pass, variance of a pass of the first observable, and variance times rays.
fn work_table(work: &[WorkChange]) -> Table {
    let mut names: Vec<&str> = work.iter().flat_map(|w| w.counts.keys().map(String::as_str)).collect();
    names.sort_unstable();
    names.dedup();
    // A counter that neither side needs stays at 1, as one that did not change.
    let is_other =
        |name: &&str| work.iter().any(|w| w.counts.get(*name).is_none_or(|ratio| *ratio != 1.0));
    names.retain(is_other);
    let mut header = vec!["cell", "estimator"];
    header.extend(&names);
    header.extend(["variance", "variance x rays"]);
    let mut table = Table::new(&header);
    for w in work {
        let mut row = vec![w.cell.clone(), w.estimator.clone()];
        let count = |name: &&str| significant(w.counts.get(*name).copied().unwrap_or(f64::NAN), 4);
        row.extend(names.iter().map(count));
        let rays = w.counts.get("rays").copied().unwrap_or(f64::NAN);
        let list = |factor: f64| {
            let each = w.variance.iter().map(|v| significant(v * factor, 3));
            each.collect::<Vec<_>>().join(" ")
        };
        row.extend([list(1.0), list(rays)]);
        table.push(row);
    }
    table.without_empty_columns()
}
