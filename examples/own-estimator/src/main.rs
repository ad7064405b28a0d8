//! scatterproof with one estimator more: all of its subcommands, for experiments that name `ballistic`.

mod ballistic;

use std::process::ExitCode;

use scatterproof::experiment::estimators::builtin;

fn main() -> ExitCode {
    let mut registry = builtin();
    registry.entries.push(ballistic::BALLISTIC);
    scatterproof::cli::main(&registry)
}
