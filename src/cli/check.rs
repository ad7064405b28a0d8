//! `scatterproof check`: validates experiment files.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::counted;
use crate::error::{Error, Result};
use crate::experiment::build::Builder;
use crate::experiment::{LoadOptions, Loaded, Registry, load_any};

/// Validate experiment files and report all errors.
///
/// Without `--setting`, every setting of a file is validated too.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Experiment files.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Override a key, such as `budget.passes=64` or `object.shape.sphere.radius_mm=2`; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Apply the overrides of `[setting.NAME]`.
    #[arg(long, value_name = "NAME")]
    pub setting: Option<String>,
}

/// Checks every file; prints one line for each valid one.
///
/// # Errors
/// The findings of all files together.
pub fn run(args: &Args, registry: &Registry, out: &mut dyn Write) -> Result<()> {
    let mut findings = Vec::new();
    for path in &args.files {
        let options = LoadOptions { sets: args.sets.clone(), setting: args.setting.clone() };
        let load_setting = |setting: &String| {
            load_any(path, &LoadOptions { setting: Some(setting.clone()), ..options.clone() }, registry)
        };
        let checked = load_any(path, &options, registry).and_then(|experiment| {
            build(&experiment, registry)?;
            let others: &[String] = if args.setting.is_some() { &[] } else { experiment.settings() };
            others.iter().try_for_each(|setting| load_setting(setting).map(|_| ()))?;
            Ok(experiment)
        });
        match checked {
            Ok(experiment) => {
                writeln!(out, "{}: ok, {}", path.display(), summary(&experiment))
                    .map_err(Error::io(Path::new("stdout"), "print"))?;
            }
            Err(Error::Input(more)) => findings.extend(more),
            Err(other) => return Err(other),
        }
    }
    if findings.is_empty() { Ok(()) } else { Err(Error::Input(findings)) }
}

/// Meshes, maps and the sensor's place show only when they are built.
fn build(experiment: &Loaded, registry: &Registry) -> Result<()> {
    match experiment {
        Loaded::Scene(experiment) => {
            let mut builder = Builder::new(experiment);
            experiment.cells.iter().try_for_each(|cell| builder.scene(cell).map(|_| ()))
        }
        Loaded::Samplers(experiment) => crate::run::samplers::build_all(experiment, registry),
    }
}

fn summary(experiment: &Loaded) -> String {
    let experiment = match experiment {
        Loaded::Scene(experiment) => experiment,
        Loaded::Samplers(experiment) => {
            let file = &experiment.file;
            return [
                counted(file.sampler.len(), "sampler"),
                format!("{} draws each", file.samples),
                counted(file.claim.len(), "claim"),
            ]
            .join(", ");
        }
    };
    let file = &experiment.file;
    [
        counted(experiment.cells.len(), "cell"),
        counted(file.estimator.len(), "estimator"),
        counted(file.bands.list().len(), "band"),
        counted(file.claim.len(), "claim"),
    ]
    .join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::tests::{GOOD, registry};

    fn check(texts: &[&str]) -> (String, Result<()>) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let files = texts.iter().enumerate().map(|(i, text)| {
            let path = folder.path().join(format!("{i}.toml"));
            std::fs::write(&path, text).expect("the file is written");
            path
        });
        let args = Args { files: files.collect(), sets: Vec::new(), setting: None };
        let mut out = Vec::new();
        let result = run(&args, &registry(), &mut out);
        (String::from_utf8(out).expect("it is text"), result)
    }

    #[test]
    fn good_files_are_summed_up() {
        let (out, result) = check(&[GOOD]);
        assert!(
            result.is_ok() && out.ends_with("0.toml: ok, 1 cell, 1 estimator, 3 bands, 0 claims\n"),
            "{out}"
        );
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
}
