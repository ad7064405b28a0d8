//! From an experiment to jobs: every cell's scene, every estimator on it, the streams of both.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::json;

use super::comparisons;
use super::job::{Group, Job, band_groups};
use super::keys::{Stage, StreamName};
use super::memory::Estimate;
use crate::error::{Error, Result};
use crate::estimators::Layout;
use crate::experiment::build::{self, Builder};
use crate::experiment::registry::Registry;
use crate::experiment::schema::{Budget, CONTROL, ClaimEntry, CostMeasure};
use crate::experiment::{CellSpec, Experiment};
use crate::results::json::hash_json;
use crate::results::provenance;
use crate::results::record::{Band, Comparison, Observable};

/// What a run will do.
pub struct Plan {
    /// The bands.
    pub bands: Vec<Band>,
    /// One job per cell and estimator, cells outermost.
    pub jobs: Vec<Job>,
    /// The claims, expanded.
    pub comparisons: Vec<Comparison>,
    /// Kind of each estimator.
    pub kinds: Vec<String>,
    /// What the passes are for.
    pub stage: Stage,
    scene_bytes: usize,
    /// Passes per job, where the budget says them.
    passes: Option<u64>,
}

impl Plan {
    /// Estimate of the memory it takes.
    pub fn memory(&self, threads: usize) -> Estimate {
        Estimate::new(&self.jobs, self.scene_bytes, threads, self.passes)
    }
}

/// Gate observables per cell that a record holds at most.
const MOST_OBSERVABLES: usize = 4096;

/// Builds everything an experiment needs; what cannot be built is found here, before any work.
///
/// # Errors
/// Everything that only shows when it is built: meshes, maps, sensors inside bodies, claims on
/// observables that do not exist.
pub fn plan(experiment: &Experiment, registry: &Registry) -> Result<Plan> {
    plan_stage(experiment, registry, Stage::Main)
}

/// The same for the passes of `stage`.
pub(super) fn plan_stage(experiment: &Experiment, registry: &Registry, stage: Stage) -> Result<Plan> {
    let mut builder = Builder::new(experiment);
    let bands = builder.bands().to_vec();
    let inputs = build::inputs(experiment);
    let claims: Vec<String> = experiment.file.claim.iter().map(hash_json).collect();
    let mut jobs = Vec::new();
    let mut observables = Vec::new();
    let mut kinds = Vec::new();
    let mut known: BTreeMap<String, &str> = BTreeMap::new();
    let timed = Timed::new(experiment);
    for (index, cell) in experiment.cells.iter().enumerate() {
        if let Some(twin) = known.insert(hash_json(&cell.content()), &cell.label) {
            return Err(Error::input_help(
                format!("cells `{twin}` and `{}` are the same scene", cell.label),
                "equal scenes are played on equal streams, so one says nothing about the other: drop one",
            ));
        }
        let scene = Arc::new(builder.scene(cell)?);
        let layout = Layout::new(&scene);
        observables.push(named(&layout));
        if layout.observables().len() > MOST_OBSERVABLES {
            return Err(Error::input_help(
                format!("cell `{}` has {} observables", cell.label, layout.observables().len()),
                format!("a record holds at most {MOST_OBSERVABLES}; lower the number of bins"),
            ));
        }
        for (estimator_index, entry) in experiment.file.estimator.iter().enumerate() {
            let (kind, options) = entry
                .kind
                .iter()
                .next()
                .ok_or_else(|| Error::input(format!("estimator `{}` has no kind", entry.name)))?;
            let registered = registry.get(kind).ok_or_else(|| {
                Error::input(format!("estimator `{}`: unknown kind `{kind}`", entry.name))
            })?;
            if index == 0 {
                kinds.push(kind.clone());
            }
            for arm in timed.arms(cell, &entry.name) {
                let estimator = (registered.build)(options, Arc::clone(&scene))?;
                let groups = band_groups(estimator.band_use(), bands.len());
                let groups = groups
                    .into_iter()
                    .map(|group| streams(experiment, cell, &bands, &arm.name, group, stage))
                    .collect();
                let label = match cell.label.as_str() {
                    "" => arm.name.clone(),
                    cell => format!("{cell} / {}", arm.name),
                };
                let identity = json!({
                    "build": provenance::build(),
                    "experiment": experiment.file.name,
                    "seed": experiment.file.seed,
                    "fresh": experiment.file.fresh,
                    "stage": stage.name(),
                    "bands": bands,
                    "content": cell.content(),
                    "pair": experiment.file.pair,
                    "inputs": inputs,
                    "estimator": entry,
                    "control": arm.is_control,
                });
                jobs.push(Job {
                    cell: index,
                    estimator_index,
                    name: arm.name,
                    is_control: arm.is_control,
                    side_by_side: arm.is_timed.then_some(index),
                    label,
                    identity: hash_json(&identity),
                    stage,
                    passes: None,
                    groups,
                    estimator,
                    layout: layout.clone(),
                    targets: vec![0],
                    claims: claims.clone(),
                });
            }
        }
    }
    let passes = match experiment.file.budget {
        Budget::Passes(passes) => Some(passes),
        Budget::CpuSeconds(_) | Budget::RelativeError(_) => None,
    };
    let comparisons = comparisons::expand(experiment, &bands, &observables)?;
    for job in &mut jobs {
        job.targets = targets(experiment, job, &comparisons, &observables[job.cell]);
    }
    Ok(Plan { bands, jobs, comparisons, kinds, stage, scene_bytes: builder.memory_bytes(), passes })
}

/// A run of an estimator in a cell.
struct Arm {
    name: String,
    is_control: bool,
    is_timed: bool,
}

/// What claims compare by CPU time: estimators that are played side by side, and baselines that are played
/// twice, because the same estimator against itself shows what the machine adds.
struct Timed<'a> {
    /// Where, candidate, baseline.
    duels: Vec<(&'a BTreeMap<String, String>, &'a str, &'a str)>,
}

impl<'a> Timed<'a> {
    fn new(experiment: &'a Experiment) -> Timed<'a> {
        let duels = experiment.file.claim.iter().filter_map(ClaimEntry::duel);
        let by_time = duels.filter(|duel| duel.cost == CostMeasure::Cpu);
        Timed { duels: by_time.map(|duel| (duel.only, duel.candidate, duel.baseline)).collect() }
    }

    /// The runs of an estimator in a cell.
    fn arms(&self, cell: &CellSpec, name: &str) -> Vec<Arm> {
        let here = || {
            self.duels
                .iter()
                .filter(|(only, ..)| comparisons::is_in(cell, only))
                .map(|(_, a, b)| (*a, *b))
        };
        let is_timed = here().any(|(candidate, baseline)| candidate == name || baseline == name);
        let mut arms = vec![Arm { name: name.into(), is_control: false, is_timed }];
        if here().any(|(_, baseline)| baseline == name) {
            arms.push(Arm { name: format!("{name}{CONTROL}"), is_control: true, is_timed });
        }
        arms
    }
}

fn streams(
    experiment: &Experiment,
    cell: &CellSpec,
    bands: &[Band],
    estimator: &str,
    group: Vec<usize>,
    main: Stage,
) -> Group {
    let content = match &experiment.file.pair {
        Some(pair) => cell.content_without(&pair.over),
        None => cell.content(),
    };
    let names: Vec<&str> = group.iter().map(|&band| bands[band].name.as_str()).collect();
    let fresh = experiment.file.fresh.as_deref();
    let key = |stage| {
        let (experiment, seed) = (experiment.file.name.as_str(), experiment.file.seed);
        StreamName { experiment, seed, fresh, content: &content, bands: &names, estimator, stage }.key()
    };
    Group { main: key(main), pilot: key(Stage::Pilot), bands: group }
}

/// A layout's observables as the record names them.
pub fn named(layout: &Layout) -> Vec<Observable> {
    let name = |o: &crate::estimators::ObservableName| Observable {
        name: o.name.clone(),
        class: o.class.to_string(),
    };
    layout.observables().iter().map(name).collect()
}

/// The observables that claims name of a job; the sensor's first where none does.
fn targets(
    experiment: &Experiment,
    job: &Job,
    comparisons: &[Comparison],
    observables: &[Observable],
) -> Vec<usize> {
    let estimator = &experiment.file.estimator[job.estimator_index].name;
    let claimed = comparisons.iter().map(|comparison| &comparison.quantity);
    let mine = claimed.filter(|q| q.cell == job.cell && q.estimator == *estimator);
    let mut indices: Vec<usize> =
        mine.filter_map(|q| observables.iter().position(|o| *o == q.observable)).collect();
    indices.sort_unstable();
    indices.dedup();
    if indices.is_empty() { vec![0] } else { indices }
}
