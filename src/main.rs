//! The command line over the library, with the library's own estimators.

use std::process::ExitCode;

fn main() -> ExitCode {
    scatterproof::cli::main(&scatterproof::experiment::Registry::builtin())
}
