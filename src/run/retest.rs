//! Second looks: quantities that failed a first test are measured again, on new streams and with more passes.

use super::interrupt::Interrupt;
use super::job::Task;
use super::jobs::plan_stage;
use super::keys::Stage;
use super::{Options, execute};
use crate::error::{Error, Result};
use crate::experiment::Experiment;
use crate::experiment::registry::Registry;
use crate::results::record::{Quantity, Record};
use crate::results::store::{RecordFolder, Stored};

/// Quantities and samplers to measure again.
pub(crate) struct Remeasured<'a> {
    /// The record of the first look.
    pub main: &'a Record,
    /// Quantities of estimators; each brings all that its run measures.
    pub quantities: Vec<Quantity>,
    /// Samplers by name.
    pub samplers: Vec<String>,
    /// Factor on the passes and draws of the first look.
    pub factor: u64,
}

/// Measures again what `look` lists, and writes the record into `retest/` beside the first. What an
/// earlier call has measured is not measured again.
///
/// # Errors
/// As [`super::run`].
pub(crate) fn retest(
    experiment: &Experiment,
    registry: &Registry,
    options: &Options,
    interrupt: &Interrupt,
    look: &Remeasured,
) -> Result<Stored> {
    let mut plan = plan_stage(experiment, registry, options.threads, Stage::Retest, None)?;
    plan.jobs.retain(|job| match &job.task {
        Task::Estimate(passes) => {
            let same = |q: &Quantity| q.cell == passes.cell && q.estimator == passes.arm.name;
            look.quantities.iter().any(same)
        }
        Task::Draw(draws) => look.samplers.contains(&draws.name),
    });
    for job in &mut plan.jobs {
        match &mut job.task {
            Task::Estimate(passes) => {
                let runs = look.main.cells.get(passes.cell).map_or(&[][..], |cell| &cell.runs);
                let first = runs.iter().find(|run| run.estimator == passes.arm.name);
                let first = first.ok_or_else(|| {
                    let (name, label) = (&look.main.experiment, &job.label);
                    Error::input(format!("the record of `{name}` holds no {label}"))
                })?;
                passes.count = Some(first.passes.saturating_mul(look.factor));
            }
            Task::Draw(draws) => draws.samples = draws.samples.saturating_mul(look.factor),
        }
    }
    let root = RecordFolder::new(options.folder(&experiment.file.name)).retest();
    execute(experiment, &plan, root.root(), options, interrupt).map(|ran| ran.stored)
}
