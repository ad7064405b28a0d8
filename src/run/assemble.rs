//! From the results of jobs to the record, its arrays, and the timing.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::json;

use super::comparisons::{expand_samplers, statements};
use super::job::{Finished, Job, Passes, Task};
use super::jobs::{Plan, named};
use super::workers::{Completed, Output};
use crate::error::Result;
use crate::estimators::{self, Anomaly, Cost, GuideSlice};
use crate::experiment::Experiment;
use crate::experiment::build::inputs;
use crate::results::json::hash_json;
use crate::results::npy::Array;
use crate::results::provenance::fingerprint;
use crate::results::record::{
    Cell, EstimatorRun, GuidePlane, Image, ObservedRegion, Record, Replay, SCHEMA_VERSION, StatedBias,
    StatedTail, Tile,
};
use crate::results::store::{
    Arrays, costs_path, guide_path, observables_path, pixels_path, spread_path,
};
use crate::results::timing::{self, Timing};
use crate::scene::sensor::{PixelRectangle, SensorRegion};

/// A record before it is written.
pub(super) struct Assembled {
    /// The record; checksums are filled in when it is written.
    pub record: Record,
    /// Arrays of the record.
    pub arrays: Arrays,
    /// Seconds and processes, `timing.json`.
    pub timing: Timing,
}

/// Hash of the resolved experiment without claims and of the files that it reads, hex.
pub(super) fn experiment_hash(experiment: &Experiment) -> String {
    hash_json(&json!({"resolved": experiment.resolved(), "inputs": inputs(experiment)}))
}

/// Hashes of the claims, hex.
pub(super) fn claim_hashes(experiment: &Experiment) -> Vec<String> {
    experiment.file.claim.iter().map(hash_json).collect()
}

/// Assembles the measurements of a plan's jobs into a record.
pub(super) fn assemble(
    experiment: &Experiment,
    plan: &Plan,
    completed: Vec<Completed>,
    replays: Vec<Replay>,
) -> Result<Assembled> {
    let mut arrays = Arrays::new();
    let mut timing = Timing::default();
    let empty = |(index, cell): (usize, &crate::experiment::CellSpec)| Cell {
        label: cell.label.clone(),
        axes: cell.axes.clone(),
        content_hash: hash_json(&cell.content()),
        regions: plan
            .jobs
            .iter()
            .filter_map(Job::passes)
            .find(|job| job.cell == index)
            .map_or_else(Vec::new, regions),
        runs: Vec::new(),
    };
    let mut cells: Vec<Cell> = experiment.cells.iter().enumerate().map(empty).collect();
    let mut samplers = Vec::new();
    let hashes = claim_hashes(experiment);
    let mut post_hoc = BTreeSet::new();
    for (job, Completed { start, output }) in plan.jobs.iter().zip(completed) {
        post_hoc.extend((0..hashes.len()).filter(|&i| !start.claims.contains(&hashes[i])));
        match (&job.task, output) {
            (Task::Estimate(passes), Output::Passes(finished)) => {
                let cell = &mut cells[passes.cell];
                timing.add(&cell.label, &passes.arm.name, cost(&finished));
                timing.set_batches(&cell.label, &passes.arm.name, batches(&finished));
                let run = estimator_run(experiment, passes, cell.runs.len(), *finished, &mut arrays);
                cell.runs.push(run);
            }
            (Task::Draw(_), Output::Draws(sampled)) => {
                timing.add("", &sampled.run.sampler, sampled.cost);
                samplers.push(sampled.run);
                arrays.extend(sampled.arrays);
            }
            (Task::Estimate(_), Output::Draws(_)) | (Task::Draw(_), Output::Passes(_)) => {
                unreachable!("a job gives what its task asks for")
            }
        }
    }
    let claims = json!(experiment.file.claim);
    let record = Record {
        schema_version: SCHEMA_VERSION,
        experiment: experiment.file.name.clone(),
        stage: plan.stage.name().into(),
        fingerprint: fingerprint(),
        experiment_hash: experiment_hash(experiment),
        resolved: experiment.resolved(),
        claims_hash: hash_json(&claims),
        claims,
        statements: statements(&experiment.file.claim),
        post_hoc: post_hoc.into_iter().collect(),
        comparisons: plan.comparisons.clone(),
        sampler_comparisons: expand_samplers(&experiment.file.claim, &samplers),
        replays,
        bands: plan.bands.clone(),
        cells,
        samplers,
        checksums: BTreeMap::new(),
    };
    Ok(Assembled { record, arrays, timing })
}

/// The regions of the sensor of a job's cell.
fn regions(job: &Passes) -> Vec<ObservedRegion> {
    let tile = |PixelRectangle { columns, rows }: PixelRectangle| Tile { columns, rows };
    let region = |region: &SensorRegion| ObservedRegion {
        name: region.name.clone(),
        tile: region.tile.map(tile),
    };
    job.layout.regions().iter().map(region).collect()
}

fn cost(finished: &Finished) -> timing::TimeSpent {
    let total = finished.total();
    timing::TimeSpent {
        cpu_seconds: total.cpu_seconds,
        set_up_seconds: finished.tally.set_up_seconds,
        wall_seconds: finished.tally.wall_seconds,
        passes: finished.passes,
        paths: total.cost[Cost::Paths as usize],
    }
}

/// CPU time by batch.
fn batches(finished: &Finished) -> timing::Batches {
    let passes = finished.batches.iter().map(|moments| moments.first().map_or(0, |m| m.n));
    timing::Batches {
        processes: finished.tally.processes,
        cpu_seconds: finished.work.iter().map(|work| work.cpu_seconds).collect(),
        settled: finished.work.iter().zip(passes).map(|(work, n)| work.settled == n).collect(),
        twice: finished.work.iter().map(|work| work.twice).collect(),
    }
}

/// The run of a job, number `run` of its cell, and its arrays.
fn estimator_run(
    experiment: &Experiment,
    job: &Passes,
    run: usize,
    finished: Finished,
    arrays: &mut Arrays,
) -> EstimatorRun {
    let (observables, bands) = (job.layout.observables().len(), job.layout.bands());
    let entry = experiment.estimator(job.cell, job.entry);
    let total = finished.total();
    let batches = &finished.batches;
    let shape = vec![batches.len(), observables, bands, 5];
    let data = batches.iter().flatten().flat_map(|moments| moments.to_array()).collect();
    let moments = observables_path(job.cell, run);
    arrays.insert(moments.clone(), Array::new(shape, data));

    let mut counters = Cost::ALL;
    counters.sort_by_key(|counter| counter.name());
    let counted = finished.work.iter().flat_map(|work| counters.map(|c| work.cost[c as usize] as f64));
    let costs = costs_path(job.cell, run);
    arrays
        .insert(costs.clone(), Array::new(vec![finished.work.len(), counters.len()], counted.collect()));

    let image = job.image_size().map(|(width, height)| {
        let errors = finished.image.std_error();
        let mut data = finished.image.mean;
        data.extend(errors);
        let pixels = pixels_path(job.cell, run);
        arrays.insert(pixels.clone(), Array::new(vec![2, height, width, bands], data));
        let spread = spread_path(job.cell, run);
        let pairs = finished.spread.iter().flatten().flat_map(|moments| moments.to_array()).collect();
        arrays.insert(spread.clone(), Array::new(vec![finished.spread.len(), bands, 5], pairs));
        Image { width, height, pixels, spread }
    });
    let guide = guide_plane(job, run, arrays);
    let counts = |names: Vec<&str>, values: &[u64]| {
        names.into_iter().map(str::to_string).zip(values.iter().copied()).collect()
    };
    // Merged shards have been prepared elsewhere, and notes may tell what was learned.
    job.estimator.prepare();
    EstimatorRun {
        estimator: job.arm.name.clone(),
        control_of: job.arm.is_control.then(|| entry.name.clone()),
        kind: entry.choice().map_or_else(String::new, |(kind, _)| kind.into()),
        bias: match job.estimator.bias() {
            estimators::Bias::Unbiased => StatedBias::Unbiased,
            estimators::Bias::Consistent => StatedBias::Consistent,
            estimators::Bias::Biased(why) => StatedBias::Biased(why),
        },
        model: job.estimator.model(),
        heavy_tails: job.estimator.heavy_tails().into_iter().map(heavy_tail).collect(),
        notes: job.estimator.notes(),
        passes: finished.passes,
        observables: named(&job.layout),
        moments,
        costs,
        image,
        guide,
        cost: counts(Cost::ALL.map(Cost::name).into(), &total.cost),
        anomalies: counts(Anomaly::ALL.map(Anomaly::name).into(), &finished.tally.anomalies),
    }
}

/// What guides a job's walks, and its array.
fn guide_plane(job: &Passes, run: usize, arrays: &mut Arrays) -> Option<GuidePlane> {
    let slices = if job.arm.is_control { Vec::new() } else { job.estimator.guides() };
    let first = slices.iter().flatten().next()?;
    let GuideSlice { columns, rows, x_mm, z_mm, .. } = *first;
    let nothing = vec![[0.0; 3]; rows * columns];
    let nodes = |slice: &Option<GuideSlice>| match slice {
        Some(slice) => slice.nodes.clone(),
        None => nothing.clone(),
    };
    let data = slices.iter().flat_map(nodes).flatten().collect();
    let array = guide_path(job.cell, run);
    arrays.insert(array.clone(), Array::new(vec![slices.len(), rows, columns, 3], data));
    Some(GuidePlane { x_mm, z_mm, array })
}

fn heavy_tail(tail: estimators::HeavyTail) -> StatedTail {
    StatedTail { band: tail.band, class: tail.class.name().into(), reason: tail.reason }
}
