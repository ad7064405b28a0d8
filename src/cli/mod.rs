//! The command line: one file per subcommand, without logic of their own. The only module that uses `clap`.

mod check;
mod compare;
mod completions;
mod console;
mod init;
mod judge;
mod list;
mod merge;
mod output;
mod plan;
mod report;
mod run;
mod schema;
mod verify;

/// Experiments on samplers, from the experiment to verdicts.
#[cfg(test)]
mod samplers_tests;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand};

use crate::error::{Error, Result};
use crate::experiment::registry::Registry;
use crate::experiment::{LoadOptions, suggest};

use output::{StandardOutput, say};

/// A research testbed for subsurface scattering: estimators with statistical proof.
///
/// One TOML file is one experiment. `run` executes it and writes a record under results/; `verify`
/// judges the claims of the file; `report` makes tables and images from the record alone.
///
/// Exit codes: 0 success, 1 a claim failed, 2 bad input or usage, 3 underpowered or invalid claim or
/// I/O failure, 130 interrupted (completed work is kept; the same command resumes).
#[derive(Parser)]
#[command(name = "scatterproof", version, about, long_about)]
struct Command {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    Run(run::Args),
    Merge(merge::Args),
    Verify(verify::Args),
    Report(report::Args),
    Compare(compare::Args),
    Judge(judge::Args),
    Plan(plan::Args),
    Check(check::Args),
    Init(init::Args),
    List(list::Args),
    Schema(schema::Args),
    Completions(completions::Args),
}

/// How an experiment file is read.
#[derive(Args, Clone, Debug)]
pub struct Reading {
    /// Override a value: a dotted key and a TOML value, such as `object.boundary.rough.alpha=0.1`.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Use the overrides of `[setting.NAME]` in the file.
    #[arg(long, value_name = "NAME")]
    setting: Option<String>,
}

impl Reading {
    fn options(&self) -> LoadOptions {
        LoadOptions { sets: self.set.clone(), setting: self.setting.clone() }
    }

    /// The arguments again, each with a space before it, but for the value of one key.
    fn arguments_without(&self, key: &str) -> String {
        let setting = self.setting.iter().map(|name| format!(" --setting {name}"));
        let others = self.set.iter().filter(|set| set.split('=').next() != Some(key));
        setting.chain(others.map(|set| format!(" --set '{set}'"))).collect()
    }
}

/// How work is carried out; nothing here changes a result.
#[derive(Args, Clone, Debug)]
pub struct Working {
    /// Folder for the results, one subfolder per experiment.
    #[arg(long, value_name = "DIR", default_value = "results")]
    out: PathBuf,
    /// Replace the record of another experiment of the same name.
    #[arg(long)]
    replace: bool,
    /// Number of threads; default: all cores.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Do not show a progress bar.
    #[arg(long, short)]
    quiet: bool,
    /// Passes per block; by default chosen by time. For tests: results do not depend on it.
    #[arg(long, value_name = "N", hide = true, value_parser = clap::value_parser!(u64).range(1..))]
    block_passes: Option<u64>,
}

impl Working {
    fn options(&self) -> crate::run::Options {
        let mut options = crate::run::Options::new(&self.out);
        if let Some(threads) = self.threads {
            options.threads = usize::from(threads);
        }
        options.quiet = self.quiet;
        options.block_passes = self.block_passes;
        options
    }
}

/// Reads the arguments of the process, runs the subcommand with the estimators of `registry`, prints
/// errors, and returns the exit code: all that your own program needs.
pub fn main(registry: &Registry) -> ExitCode {
    main_with(registry, std::env::args_os())
}

/// [`main`] with the given arguments; the first is the name of the program.
pub fn main_with(registry: &Registry, arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    ExitCode::from(exit_code_of(registry, arguments))
}

/// [`main_with`] for callers that end the process themselves. Usage errors, `--help` and `--version` end it here.
pub fn exit_code_of(registry: &Registry, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let program = arguments.first().and_then(|path| Path::new(path).file_stem()?.to_str());
    let program = program.unwrap_or("scatterproof").to_string();
    let command = Command::try_parse_from(&arguments).unwrap_or_else(|error| usage(error));
    let out = &mut StandardOutput::new();
    let outcome = match &command.action {
        Action::Run(args) => run::run(args, registry, out),
        Action::Merge(args) => merge::run(args, registry, out),
        Action::Verify(args) => verify::run(args, registry, out),
        Action::Report(args) => report::run(args, out),
        Action::Compare(args) => compare::run(args, out),
        Action::Judge(args) => judge::run(args, out),
        Action::Plan(args) => plan::run(args, registry, out),
        Action::Check(args) => check::run(args, registry, out).map(|()| 0),
        Action::Init(args) => init::run(args, out).map(|()| 0),
        Action::List(args) => list::run(args, registry, out).map(|()| 0),
        Action::Schema(args) => schema::run(args, registry, out).map(|()| 0),
        Action::Completions(args) => {
            completions::run(args, Command::command(), &program, out).map(|()| 0)
        }
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            match console::has_coloured_errors() {
                true => say(error.to_coloured()),
                false => say(&error),
            }
            error.exit_code()
        }
    }
}

/// Tells what is wrong with the arguments, and which subcommand a misspelt one is near to; ends the
/// process with 2, or with 0 after `--help`.
fn usage(mut error: clap::Error) -> ! {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let word = match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(word)) => Some(word.clone()),
        _ => None,
    };
    if let (ErrorKind::InvalidSubcommand, Some(word)) = (error.kind(), word)
        && error.get(ContextKind::SuggestedSubcommand).is_none()
    {
        let command = Command::command();
        let known: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
        if let Some(near) = suggest::nearest(&word, &known) {
            let near = ContextValue::Strings(vec![near.into()]);
            error.insert(ContextKind::SuggestedSubcommand, near);
        }
    }
    error.exit()
}

/// The experiment files that paths name: files themselves, and those in folders, in the order of names.
fn experiment_files(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in paths {
        files.extend(files_of(path)?);
    }
    Ok(files)
}

/// A file itself, or the experiment files of a folder.
fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_path_buf()]); // `load` reports what is wrong with it
    }
    let entries = std::fs::read_dir(path).map_err(Error::io(path, "read the folder"))?;
    let paths = entries.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    let mut files: Vec<PathBuf> = paths.filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    if files.is_empty() {
        let below = std::fs::read_dir(path).into_iter().flatten().flatten();
        let mut folders: Vec<String> = below
            .filter(|entry| entry.path().is_dir())
            .map(|entry| entry.path().display().to_string())
            .collect();
        folders.sort();
        return Err(Error::input_help(
            format!("{} holds neither a record nor experiment files", path.display()),
            match folders.is_empty() {
                true => "name an experiment file, a folder of them, or a results folder".into(),
                false => format!("name one of its folders: {}", folders.join(", ")),
            },
        ));
    }
    Ok(files)
}

/// `1 cell`, `2 cells`.
fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Signals, as the error that a user sees.
fn listen() -> Result<crate::run::interrupt::Interrupt> {
    crate::run::interrupt::Interrupt::listen().map_err(|source| Error::Io {
        path: PathBuf::from("signals"),
        doing: "listen for signals".into(),
        source,
    })
}

/// For clap: a number above 0.
fn positive(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("a number above 0 is needed".into()),
    }
}

/// For clap: a number between 0 and 1, both excluded.
fn probability(text: &str) -> std::result::Result<f64, String> {
    positive(text).ok().filter(|p| *p < 1.0).ok_or_else(|| "a number between 0 and 1 is needed".into())
}
