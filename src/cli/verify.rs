//! `scatterproof verify`.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::console::Console;
use super::output::{say, unwritable};
use super::{Reading, Working, files_of, listen};
use crate::error::{Error, Result};
use crate::experiment::registry::Registry;
use crate::experiment::schema::Budget;
use crate::experiment::{Experiment, LoadOptions, load};
use crate::report::undecided::{Undecided, two_digits_up, undecided};
use crate::report::{self, tables::verdict_table};
use crate::results::lock::{self, FolderLock};
use crate::results::record::{Quantity, Record};
use crate::results::store::{RecordFolder, Stored};
use crate::results::{atomic, provenance};
use crate::run::interrupt::Interrupt;
use crate::run::{Options, Remeasured, plan};
use crate::verify::judge::{Case, Judgement, Looks, Measured, judge};
use crate::verify::junit;
use crate::verify::levels::{FAMILY_LEVEL, FIRST_LOOK, RETEST_FACTOR};
use crate::verify::nights::Nights;
use crate::verify::verdict::{self, TestKind, Verdict};

/// Judge the claims of experiments; run what has no record yet.
///
/// All claims named in one call are one family: the probability that any of them fails by chance is at
/// most 1e-6. A test that fails at the first look is repeated on fresh streams with 4 times the passes.
///
/// Exit codes: 0 every claim is green; 1 a claim failed; 3 a claim is underpowered or invalid.
#[derive(clap::Args, Debug)]
pub(super) struct Args {
    /// Experiment files, folders of them, or results folders (judged as they are).
    #[arg(value_name = "FILE or DIR", default_value = "experiments/verify")]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    working: Working,
    /// Use fresh streams named by TOKEN (default: the date and the commit; the same TOKEN gives the same
    /// streams); results go to `fresh/` under the results folder.
    #[arg(long, value_name = "TOKEN", num_args = 0..=1, default_missing_value = "")]
    fresh_seed: Option<String>,
    /// With --fresh-seed: the file that accumulates evidence over nights; default: `evidence.json` in
    /// the folder of fresh results.
    #[arg(long, value_name = "FILE", requires = "fresh_seed")]
    evidence: Option<PathBuf>,
    /// Write the verdicts as JUnit XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write the verdicts as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the verdicts as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the verdicts as a Markdown table.
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Judge by the first looks alone: what only a second look could decide fails.
    #[arg(long, hide = true)]
    first_look: bool,
    /// Write no reports into the results folders; `scatterproof report DIR` makes one later.
    #[arg(long)]
    no_report: bool,
    /// Print every verdict; default: those that are not green and the summaries of tables.
    #[arg(long, short)]
    verbose: bool,
}

/// A record to judge, with the data of its second look.
struct Judged {
    folder: RecordFolder,
    main: Stored,
    retest: Option<Stored>,
    /// Absent where a results folder was named.
    experiment: Option<Experiment>,
    /// Held until the report is written; absent where none is.
    _lock: Option<Arc<FolderLock>>,
}

/// What a path names.
enum Named {
    /// A record, judged as it is.
    Record(Box<Judged>),
    /// An experiment, run where it has no record yet.
    Experiment(Box<Experiment>),
}

/// Everything that verification of one call works with.
struct Court<'a> {
    registry: &'a Registry,
    reading: LoadOptions,
    working: Options,
    /// Whether the record of another experiment may be replaced.
    replaces: bool,
    interrupt: Interrupt,
    /// Whether reports are written into the results folders.
    reports: bool,
}

/// Judges everything named as one family.
///
/// # Errors
/// Bad input, I/O, interruption. A claim that does not hold is no error: it is the exit code.
pub(super) fn run(args: &Args, registry: &Registry, out: &mut impl Write) -> Result<u8> {
    let mut court = Court {
        registry,
        reading: args.reading.options(),
        working: args.working.options(),
        replaces: args.working.replace,
        interrupt: listen()?,
        reports: !args.no_report,
    };
    let token = args.fresh_seed.as_ref().map(|token| court.refresh(token));
    let mut subjects = court.subjects(&args.paths)?;
    let mut judgement = judge_all(&subjects);
    if !args.first_look && court.look_again(&mut subjects, &judgement)? {
        judgement = judge_all(&subjects);
    }
    if judgement.verdicts.is_empty() {
        return Err(Error::input_help(
            "nothing was judged: what was named makes no claims",
            "add a [[claim]] to the experiment, or name one that has some",
        ));
    }
    write_files(args, &judgement.verdicts)?;
    tell(&judgement.verdicts, args.verbose, &subjects, &args.reading, out).map_err(unwritable)?;
    let alarmed = match &token {
        Some(token) => {
            court.add_night(args.evidence.as_deref(), token, &judgement.verdicts, &subjects, out)?
        }
        None => false,
    };
    for (index, subject) in subjects.into_iter().enumerate() {
        let of = judgement.verdicts.iter().zip(&judgement.case_of);
        let own = of.filter(|(_, case)| **case == index).map(|(v, _)| v.clone()).collect();
        if subject.experiment.is_some() && court.reports {
            report::write_judged(&subject.folder, subject.main, own)?;
        }
    }
    Ok(if alarmed { 1 } else { verdict::exit_code(&judgement.verdicts) })
}

fn judge_all(subjects: &[Judged]) -> Judgement {
    let cases: Vec<Case> =
        subjects.iter().map(|s| Case { main: &s.main, retest: s.retest.as_ref() }).collect();
    judge(&cases, Looks::Two)
}

impl Court<'_> {
    /// All streams by another name, and all results elsewhere.
    fn refresh(&mut self, token: &str) -> String {
        let token = if token.is_empty() { provenance::today_and_commit() } else { token.to_string() };
        say(format_args!("fresh streams; the same again: --fresh-seed \"{token}\""));
        self.reading.sets.push(format!("fresh={}", toml_text(&token)));
        self.working.out.push("fresh");
        token
    }

    /// Adds this night to the state file; whether the nights together raise an alarm.
    fn add_night(
        &self,
        file: Option<&Path>,
        token: &str,
        verdicts: &[Verdict],
        subjects: &[Judged],
        out: &mut impl Write,
    ) -> Result<bool> {
        let path = file.map_or_else(|| self.working.out.join("evidence.json"), Path::to_path_buf);
        let mut nights = read_nights(&path)?;
        let code = |experiment: &str| {
            let of = subjects.iter().map(|s| &s.main.record).find(|r| r.experiment == experiment);
            of.map_or_else(String::new, |r| format!("{} {}", r.fingerprint, r.claims_hash))
        };
        if nights.add(token, verdicts, code) {
            atomic::write(&path, nights.to_json().as_bytes(), "write the evidence of the nights")?;
        } else {
            writeln!(out, "these streams are counted already; the evidence stays as it is")
                .map_err(unwritable)?;
        }
        tell_alarms(&nights, out).map_err(unwritable)
    }

    /// Records that the paths name, run where there is none yet. Everything is read, and everything that
    /// is wrong with a file is told, before anything runs.
    fn subjects(&self, paths: &[PathBuf]) -> Result<Vec<Judged>> {
        let (mut named, mut wrong) = (Vec::new(), Vec::new());
        for path in paths {
            if path.join("record").join("record.json").exists() {
                named.push(Named::Record(Box::new(Self::judged(RecordFolder::new(path), None, None)?)));
                continue;
            }
            for file in files_of(path)? {
                match self.checked(&file) {
                    Ok(experiment) => named.push(Named::Experiment(Box::new(experiment))),
                    Err(Error::Input(findings)) => wrong.extend(findings),
                    Err(other) => return Err(other),
                }
            }
        }
        if !wrong.is_empty() {
            return Err(Error::Input(wrong));
        }
        let measured = |named| match named {
            Named::Record(judged) => Ok(*judged),
            Named::Experiment(experiment) => self.measured(*experiment),
        };
        named.into_iter().map(measured).collect()
    }

    /// What is judged of a folder.
    fn judged(
        folder: RecordFolder,
        experiment: Option<Experiment>,
        lock: Option<Arc<FolderLock>>,
    ) -> Result<Judged> {
        let main = folder.read()?;
        let retest = folder.retest_of(&main)?;
        Ok(Judged { folder, main, retest, experiment, _lock: lock })
    }

    fn measured(&self, experiment: Experiment) -> Result<Judged> {
        let folder = RecordFolder::new(self.working.folder(&experiment.file.name));
        let lock = if crate::run::has_record(&experiment, &self.working.out) {
            self.reports.then(|| lock::lock(folder.root())).transpose()?
        } else {
            say(format_args!("running {}", experiment.file.name));
            Some(crate::run::run(&experiment, self.registry, &self.working, &self.interrupt)?.lock)
        };
        Self::judged(folder, Some(experiment), lock)
    }

    /// An experiment, with everything found that `check` finds where it has yet to run.
    fn checked(&self, file: &Path) -> Result<Experiment> {
        let experiment = load(file, &self.reading, self.registry)?;
        if !crate::run::has_record(&experiment, &self.working.out) {
            if !self.replaces {
                crate::run::refuse_to_replace(&experiment, &self.working.out)?;
            }
            plan(&experiment, self.registry, self.working.threads)?;
        }
        Ok(experiment)
    }

    /// Runs second looks where they are needed; true where any was run.
    fn look_again(&self, subjects: &mut [Judged], judgement: &Judgement) -> Result<bool> {
        let mut looked = false;
        for (index, subject) in subjects.iter_mut().enumerate() {
            let own = judgement.wanted.iter().filter(|w| w.case == index);
            let mut wanted: Vec<Measured> = own.map(|w| w.subject.clone()).collect();
            let (false, Some(experiment)) = (wanted.is_empty(), &subject.experiment) else { continue };
            say(format_args!("second look at {}", experiment.file.name));
            // The record of an earlier second look keeps its quantities.
            wanted.extend(subject.retest.iter().flat_map(held));
            let main = &subject.main.record;
            subject.retest = Some(self.measured_again(experiment, main, &wanted)?);
            looked = true;
        }
        Ok(looked)
    }

    fn measured_again(
        &self,
        experiment: &Experiment,
        main: &Record,
        wanted: &[Measured],
    ) -> Result<Stored> {
        let (mut quantities, mut samplers) = (Vec::new(), Vec::new());
        for one in wanted {
            match one {
                Measured::Quantity(quantity) => quantities.push(quantity.clone()),
                Measured::Sampler(name) => samplers.push(name.clone()),
            }
        }
        let look = Remeasured { main, quantities, samplers, factor: RETEST_FACTOR };
        crate::run::retest(experiment, self.registry, &self.working, &self.interrupt, &look)
    }
}

/// Everything that a record holds.
fn held(stored: &Stored) -> Vec<Measured> {
    let cells = stored.record.cells.iter().enumerate();
    let quantities = cells.flat_map(|(cell, c)| {
        c.runs.iter().filter_map(move |run| {
            let (estimator, observable) = (run.estimator.clone(), run.observables.first()?.clone());
            Some(Measured::Quantity(Quantity { cell, estimator, observable, band: 0 }))
        })
    });
    let samplers = stored.record.samplers.iter().map(|run| Measured::Sampler(run.sampler.clone()));
    quantities.chain(samplers).collect()
}

/// The state that earlier nights left; empty where there is none.
fn read_nights(path: &Path) -> Result<Nights> {
    if !path.exists() {
        return Ok(Nights::default());
    }
    let text =
        std::fs::read_to_string(path).map_err(Error::io(path, "read the evidence of the nights"))?;
    Nights::from_json(&text).map_err(|e| {
        Error::record(path, format!("not a state of nights: {e}; move it away to begin again"))
    })
}

/// Prints what all nights together say; whether any of them raises an alarm.
fn tell_alarms(nights: &Nights, out: &mut impl Write) -> io::Result<bool> {
    let alarms = nights.alarms();
    let (count, limit) = (nights.tokens.len(), nights.threshold());
    writeln!(out, "evidence over {count} nights: {} alarms (log e >= {limit:.1})", alarms.len())?;
    for (name, evidence) in &alarms {
        writeln!(out, "alarm: {name}: log e = {:.1} after {} nights", evidence.log_e, evidence.nights)?;
    }
    Ok(!alarms.is_empty())
}

/// A text as a TOML string.
fn toml_text(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

fn write_files(args: &Args, verdicts: &[Verdict]) -> Result<()> {
    let files = [
        (&args.junit, "write the JUnit file", junit::to_junit(verdicts)),
        (&args.csv, "write the CSV file", verdict::to_csv(verdicts)),
        (&args.json, "write the JSON file", verdict::to_json(verdicts)),
        (&args.markdown, "write the Markdown file", verdict_table(verdicts).to_markdown()),
    ];
    for (path, doing, text) in files {
        if let Some(path) = path {
            atomic::write(path, text.as_bytes(), doing)?;
        }
    }
    Ok(())
}

fn tell(
    verdicts: &[Verdict],
    verbose: bool,
    subjects: &[Judged],
    reading: &Reading,
    out: &mut impl Write,
) -> io::Result<()> {
    let groups = undecided(verdicts);
    let is_told = |v: &Verdict| {
        groups.iter().any(|g| g.is_many() && g.verdicts.iter().any(|own| std::ptr::eq(*own, v)))
    };
    let green = verdicts.iter().filter(|v| v.is_green()).count();
    let shown: Vec<Verdict> = verdicts
        .iter()
        .filter(|v| {
            let is_summary = v.test == Some(TestKind::SumOfSquares);
            verbose || !(v.is_green() || is_told(v)) || is_summary || v.second_p.is_some()
        })
        .cloned()
        .collect();
    if !shown.is_empty() {
        let console = Console::of_output();
        let table = verdict_table(&shown);
        write!(out, "{}", console.outcomes(&console.laid_out(&table)))?;
    }
    for group in &groups {
        writeln!(out, "{}; {}", group.sentence(), next_step(group, subjects, reading))?;
    }
    let console = Console::of_output();
    let summary = format!(
        "{green} of {} verdicts are green; any of them fails by chance with probability at most \
         {FAMILY_LEVEL:e} (Holm over all; below {FIRST_LOOK:e} a second look on fresh streams decides)",
        verdicts.len()
    );
    let summary = console.wrapped(&summary, usize::MAX);
    writeln!(out, "{}", console.verdict(&summary, green == verdicts.len()))?;
    tell_power(verdicts, out)
}

/// What would decide a group of verdicts: how many passes or draws, in which time, by which command.
fn next_step(group: &Undecided, subjects: &[Judged], reading: &Reading) -> String {
    let Some(factor) = group.factor() else {
        return "no number of passes is known to decide all of them".into();
    };
    let name = &group.verdicts[0].experiment;
    let subject = subjects.iter().find(|subject| subject.main.record.experiment == *name);
    let run = |subject: &Judged| {
        let experiment = subject.experiment.as_ref()?;
        let (key, made) = match (experiment.file.samples, &experiment.file.budget) {
            (Some(samples), _) => ("samples", samples as f64),
            (None, Some(Budget::Passes(passes))) => ("budget.passes", *passes as f64),
            (None, _) => return None,
        };
        let cpu: f64 = subject
            .main
            .timing
            .iter()
            .flat_map(|timing| timing.cells.values())
            .flat_map(|cell| cell.values())
            .map(|spent| spent.all_seconds())
            .sum();
        Some(format!(
            "about {} CPU s decide them: scatterproof verify {}{} --set {key}={}",
            two_digits_up(factor * cpu),
            experiment.path.display(),
            reading.arguments_without(key),
            two_digits_up(factor * made)
        ))
    };
    subject.and_then(run).unwrap_or_else(|| format!("{factor:.1} times the passes decide them"))
}

/// The largest defects that could have gone unseen, by what they are relative to.
fn tell_power(verdicts: &[Verdict], out: &mut impl Write) -> io::Result<()> {
    let largest = |chosen: &dyn Fn(&&Verdict) -> bool| {
        let of = verdicts.iter().filter(chosen).filter_map(|v| v.detectable);
        of.filter(|d| d.is_finite()).max_by(f64::total_cmp)
    };
    let is_bins = |v: &&Verdict| matches!(v.test, Some(TestKind::Chi2Coarse | TestKind::Chi2Fine));
    let is_mean = |v: &&Verdict| {
        let is_t = matches!(v.test, Some(TestKind::T | TestKind::WelchT | TestKind::PairedT));
        is_t && v.expected != Some(0.0)
    };
    let what = [
        (largest(&is_mean), "of the value of a mean"),
        (largest(&is_bins), "of a sampler's density, everywhere"),
    ];
    for (worst, of) in what.into_iter().filter_map(|(worst, of)| worst.map(|worst| (worst, of))) {
        let percent = 100.0 * worst;
        writeln!(out, "largest defect that could have gone unseen (99 % power): {percent:.2} % {of}")?;
    }
    Ok(())
}
