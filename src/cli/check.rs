//! `scatterproof check`: validates experiment files.

use std::io::Write;
use std::path::PathBuf;

use super::console::Console;
use super::output::unwritable;
use super::{Reading, counted, experiment_files};
use crate::error::{Diagnostic, Error, Result};
use crate::experiment::{Experiment, LoadOptions, Registry, load};
use crate::run::job::{Job, Passes};
use crate::run::memory_limits::available;
use crate::run::{Built, Options, Plan, plan_with};

/// Validate experiment files and report all errors.
///
/// Without `--setting`, every setting of a file is validated too.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Experiment files, or folders of them.
    #[arg(required = true, value_name = "FILE or DIR")]
    pub files: Vec<PathBuf>,
    /// How the files are read.
    #[command(flatten)]
    pub reading: Reading,
}

/// Checks every file; prints one line for each valid one.
///
/// # Errors
/// The findings of all files together.
pub(super) fn run(args: &Args, registry: &Registry, out: &mut dyn Write) -> Result<()> {
    let (mut findings, threads) = (Vec::new(), Options::new("").threads);
    for path in &experiment_files(&args.files)? {
        let options = args.reading.options();
        let load_setting = |setting: &String| {
            load(path, &LoadOptions { setting: Some(setting.clone()), ..options.clone() }, registry)
        };
        let checked = load(path, &options, registry).and_then(|experiment| {
            let others: &[String] = if options.setting.is_some() { &[] } else { &experiment.settings };
            let mut built = Built::default();
            let own = plan_with(&experiment, registry, threads, &mut built);
            let planned = |setting| plan_with(&load_setting(setting)?, registry, threads, &mut built);
            let mut wrong: Vec<Diagnostic> = Vec::new();
            let remarks = own.as_ref().map_or(String::new(), |plan| notes(plan) + &too_large(plan));
            for planned in std::iter::once(own).chain(others.iter().map(planned)) {
                match planned {
                    Err(Error::Input(more)) => {
                        let new = |one: &Diagnostic| !wrong.contains(one);
                        let more: Vec<Diagnostic> = more.into_iter().filter(new).collect();
                        wrong.extend(more);
                    }
                    planned => drop(planned?),
                }
            }
            if wrong.is_empty() { Ok((experiment, remarks)) } else { Err(Error::Input(wrong)) }
        });
        match checked {
            Ok((experiment, remarks)) => {
                let ok = Console::of_output().verdict("ok", true);
                writeln!(out, "{}: {ok}, {}{remarks}", path.display(), summary(&experiment))
                    .map_err(unwritable)?;
            }
            Err(error) => match error.of_input("everything that an experiment reads must be there") {
                Error::Input(more) => findings.extend(more),
                other => return Err(other),
            },
        }
    }
    if findings.is_empty() { Ok(()) } else { Err(Error::Input(findings)) }
}

/// What estimators say of their results before they have any, such as light that they cannot sample.
fn notes(plan: &Plan) -> String {
    let console = Console::of_output();
    let passes = plan.jobs.iter().filter_map(Job::passes);
    let of_job = |job: &Passes| {
        let name = job.arm.name.clone();
        job.estimator
            .notes()
            .into_iter()
            .map(move |note| console.wrapped(&format!("note: {name}: {note}"), usize::MAX))
    };
    let mut notes: Vec<String> = Vec::new();
    for note in passes.flat_map(of_job) {
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    notes.iter().map(|note| format!("\n{note}")).collect()
}

/// That a run would be refused for its memory, which is no mistake of the file but a limit of this machine.
fn too_large(plan: &Plan) -> String {
    // A run takes the estimators of a cell one after the other where there is no room for all of them.
    let memory = plan.memory(Options::new("").threads, false);
    let words = memory.check(available()).err().map(|error| error.to_string());
    words.map_or(String::new(), |words| format!("\n{}", words.replacen("error", "on this machine", 1)))
}

fn summary(experiment: &Experiment) -> String {
    let file = &experiment.file;
    let mut parts = Vec::new();
    if !experiment.cells.is_empty() {
        parts.push(counted(experiment.cells.len(), "cell"));
        parts.push(counted(file.estimator.len(), "estimator"));
        parts.push(counted(file.band_list().len(), "band"));
    }
    if let Some(samples) = file.samples {
        parts.push(counted(file.sampler.len(), "sampler"));
        parts.push(format!("{samples} draws each"));
    }
    parts.push(counted(file.claim.len(), "claim"));
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::tests::GOOD;

    fn check(texts: &[&str]) -> (String, Result<()>) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let files = texts.iter().enumerate().map(|(i, text)| {
            let path = folder.path().join(format!("{i}.toml"));
            std::fs::write(&path, text).expect("the file is written");
            path
        });
        let reading = Reading { set: Vec::new(), setting: None };
        let args = Args { files: files.collect(), reading };
        let mut out = Vec::new();
        let result = run(&args, &Registry::builtin(), &mut out);
        (String::from_utf8(out).expect("it is text"), result)
    }

    #[test]
    fn good_files_are_summed_up() {
        let (out, result) = check(&[GOOD]);
        assert!(
            result.is_ok() && out.contains("0.toml: ok, 1 cell, 1 estimator, 3 bands, 0 claims\n"),
            "{out}"
        );
        assert!(
            out.ends_with("its share is excluded from this estimator's result (exactly 0)\n"),
            "{out}"
        );
        assert_eq!(out.matches("note: mis: path cannot sample directional light").count(), 1, "{out}");
    }

    #[test]
    fn what_no_machine_holds_is_told() {
        let image = "{ orthographic = { resolution = [16000, 16000], center_mm = [0, 0, 5], toward = [0, 0, -1], \
                     up = [0, 1, 0], width_mm = 2.5 } }";
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("large.toml");
        std::fs::write(&path, format!("{GOOD}[setting.large]\nsensor = {image}\n"))
            .expect("it is written");
        let reading = Reading { set: Vec::new(), setting: Some("large".into()) };
        let mut out = Vec::new();
        run(&Args { files: vec![path], reading }, &Registry::builtin(), &mut out).expect("it is sound");
        let out = String::from_utf8(out).expect("it is text");
        assert!(out.contains("on this machine: the run would need") || available().is_none(), "{out}");
    }

    #[test]
    fn findings_of_all_files_and_settings_come_together() {
        let setting = format!("{GOOD}[setting.bad]\nseed = -1\n");
        let (out, result) = check(&[&GOOD.replace("seed", "sed"), GOOD, &setting]);
        let message = result.expect_err("two files are bad").to_string();
        assert!(
            message.contains("unknown key `sed`") && message.contains("must be at least 0, is -1"),
            "{message}"
        );
        assert!(out.contains("1.toml: ok") && !out.contains("2.toml"), "{out}");
    }

    /// What shows only when it is built is found in the file and in each of its settings.
    #[test]
    fn estimators_are_built_in_every_setting() {
        let vertex = "{ vertex = { point_mm = [0, 0, 0.8], toward = [0, 0, 1] } }";
        let inside = format!("{GOOD}[setting.inside]\nsensor = {vertex}\n");
        let (out, result) = check(&[GOOD, &inside]);
        let message = result.expect_err("`path` starts outside").to_string();
        assert!(message.contains("path starts its paths outside the body"), "{message}");
        assert!(out.contains("0.toml: ok") && !out.contains("1.toml"), "{out}");
    }
}
