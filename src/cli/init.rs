//! `scatterproof init`: writes an experiment to start from.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;

use super::output::unwritable;
use crate::error::{Error, Result};

/// A commented experiment with a known result: without absorption all light leaves the body.
pub(super) const EXAMPLE: &str = r#"# One file is one experiment. Keys carry units; `scatterproof schema` prints
# everything that a file may contain, `scatterproof check FILE` reports what is wrong with it.

name = "first-sphere"           # also its folder under results/
description = "A sphere without absorption in uniform light is indistinguishable from the light."
seed = 2024                     # root of all random streams

# Wavelength bands, each rendered by itself:
#   { rgb = {} }, { spectral = { from_nm = 400, to_nm = 700, count = 16 } },
#   { explicit = [{ name = "red", from_nm = 600, to_nm = 700 }] }
bands = { rgb = {} }

# The body: a shape, its boundary, the medium inside (`scatterproof list shapes`).
object.shape.sphere = { radius_mm = 1.0 }
object.boundary.smooth = { eta = 1.3 }      # refractive index inside over outside
# One number for all bands, or a list with one per band. Other pairs: sigma_a_per_mm with
# sigma_s_per_mm or reduced_sigma_s_per_mm. Measured: object.medium.preset = { name = "skin1", scale = 1 }
object.medium.coefficients = { sigma_t_per_mm = [1, 2, 4], albedo = 1.0, g = 0.0 }

# What is measured: here the radiance along one ray (`scatterproof list sensors`).
sensor.probe = { point_mm = [0.3, 0.0, 3.0], toward = [0, 0, -1] }

# Passes per estimator and cell; or cpu_seconds, or relative_error = { at_most = 0.01 }.
budget.passes = 64

# The lights, all shining at once.
[[light]]
environment = { radiance = 1.0 }

# The estimators that are compared (`scatterproof list estimators`).
[[estimator]]
name = "path"
path = {}

# Axes of the sweep; several of them multiply.
[[sweep]]
name = "eta"
key = "object.boundary.smooth.eta"
values = [1.1, 1.3, 1.5]

# What must hold; `scatterproof verify` judges it.
[[claim]]
name = "energy is conserved"
equals = { value = 1.0, source = "a medium without absorption in uniform radiance 1", detect = 0.05 }

# Named overrides: `--setting quick`. Single ones: `--set budget.passes=16`.
[setting.quick]
budget.passes = 8
"#;

/// Write a commented example experiment.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The file to write; an existing file is never overwritten.
    #[arg(default_value = "experiment.toml", value_name = "FILE")]
    pub path: PathBuf,
}

/// Writes the example and prints the next step.
///
/// # Errors
/// The file exists, or it cannot be written.
pub(super) fn run(args: &Args, out: &mut dyn Write) -> Result<()> {
    let path = &args.path;
    let mut file = match OpenOptions::new().write(true).create_new(true).open(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            let rule = format!("{} already exists", path.display());
            return Err(Error::input_help(rule, "name another file, or remove this one"));
        }
        opened => opened.map_err(Error::io(path, "create the example"))?,
    };
    file.write_all(EXAMPLE.as_bytes()).map_err(Error::io(path, "write the example"))?;
    writeln!(out, "wrote {0}; next: scatterproof run {0}", path.display()).map_err(unwritable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::tests::registry;
    use crate::experiment::{LoadOptions, load};

    #[test]
    fn the_example_validates_and_is_never_overwritten() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let args = Args { path: folder.path().join("x.toml") };
        run(&args, &mut Vec::new()).expect("the example is written");
        for setting in [None, Some("quick".to_string())] {
            let options = LoadOptions { setting, ..Default::default() };
            let experiment = load(&args.path, &options, &registry()).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(experiment.cells.len(), 3);
        }
        let error = run(&args, &mut Vec::new()).expect_err("the file is there");
        assert!(error.to_string().contains("already exists") && error.exit_code() == 2);
    }
}
