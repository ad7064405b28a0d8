//! Second looks: what failed a first test is measured again, on streams of its own and with more passes.

use super::interrupt::Interrupt;
use super::jobs::plan_stage;
use super::keys::Stage;
use super::{Options, play};
use crate::error::{Error, Result};
use crate::experiment::Experiment;
use crate::experiment::registry::Registry;
use crate::results::record::{Quantity, Record};
use crate::results::store::{RecordFolder, Stored};

/// Plays the measurements behind `wanted` again, with `factor` times the passes of `main`, and writes
/// them into `retest/` beside the record. What an earlier call has played is not played again.
///
/// # Errors
/// As [`super::run`].
pub fn retest(
    experiment: &Experiment,
    registry: &Registry,
    options: &Options,
    interrupt: &Interrupt,
    main: &Record,
    wanted: &[Quantity],
    factor: u64,
) -> Result<Stored> {
    let mut plan = plan_stage(experiment, registry, Stage::Retest)?;
    plan.jobs.retain(|job| wanted.iter().any(|q| q.cell == job.cell && q.estimator == job.name));
    for job in &mut plan.jobs {
        let runs = main.cells.get(job.cell).map_or(&[][..], |cell| &cell.runs);
        let first = runs.iter().find(|run| run.estimator == job.name);
        let first = first.ok_or_else(|| {
            Error::input(format!("the record of `{}` holds no {}", main.experiment, job.label))
        })?;
        job.passes = Some(first.passes.saturating_mul(factor));
    }
    let root = RecordFolder::new(options.folder(&experiment.file.name)).retest();
    play(experiment, &plan, root.root(), options, interrupt).map(|(_, stored)| stored)
}
