//! scatterproof with one estimator more: all of its subcommands, for experiments that name `ballistic`.

mod ballistic;

use std::process::ExitCode;

use scatterproof::experiment::Registry;

fn main() -> ExitCode {
    let mut registry = Registry::builtin();
    registry.estimators.push(ballistic::BALLISTIC);
    scatterproof::cli::main(&registry)
}
