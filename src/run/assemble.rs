//! From finished blocks to the record, its arrays, and the timing.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::comparisons::statements;
use super::job::{Finished, Job};
use super::jobs::{Plan, named};
use super::keys::Stage;
use crate::error::Result;
use crate::estimators::{self, Anomaly, Cost};
use crate::experiment::Experiment;
use crate::experiment::build::inputs;
use crate::results::json::hash_json;
use crate::results::npy::Array;
use crate::results::provenance::fingerprint;
use crate::results::record::{
    Bias, Cell, EstimatorRun, HeavyTail, Image, ObservedRegion, Record, Replay, SCHEMA_VERSION, Tile,
};
use crate::results::store::{Arrays, costs_path, observables_path, pixels_path, spread_path};
use crate::results::timing::{self, Timing};
use crate::scene::sensor::{PixelRectangle, SensorRegion};

/// A record before it is written.
pub struct Assembled {
    /// The record; checksums are filled in when it is written.
    pub record: Record,
    /// Its arrays.
    pub arrays: Arrays,
    /// What it cost.
    pub timing: Timing,
}

/// Hash of the resolved experiment without claims and of the files that it reads, hex.
pub fn experiment_hash(experiment: &Experiment) -> String {
    hash_json(&json!({"resolved": experiment.resolved(), "inputs": inputs(experiment)}))
}

/// Puts what a plan's jobs measured into a record.
pub fn assemble(
    experiment: &Experiment,
    plan: &Plan,
    finished: Vec<Finished>,
    replays: Vec<Replay>,
) -> Result<Assembled> {
    let mut arrays = Arrays::new();
    let mut timing = Timing::default();
    let empty = |(index, cell): (usize, &crate::experiment::CellSpec)| Cell {
        label: cell.label.clone(),
        axes: cell.axes.clone(),
        content_hash: hash_json(&cell.content()),
        regions: plan.jobs.iter().find(|job| job.cell == index).map_or_else(Vec::new, regions),
        runs: Vec::new(),
    };
    let mut cells: Vec<Cell> = experiment.cells.iter().enumerate().map(empty).collect();
    let mut post_hoc = BTreeSet::new();
    for (job, block) in plan.jobs.iter().zip(finished) {
        let late = (0..job.claims.len()).filter(|&i| !block.origin.claims.contains(&job.claims[i]));
        post_hoc.extend(late);
        let cost = timing::Cost {
            cpu_seconds: block.tally.cpu_seconds,
            wall_seconds: block.tally.wall_seconds,
            passes: block.tally.passes,
            paths: block.tally.cost[Cost::Paths as usize],
        };
        let label = &cells[job.cell].label;
        timing.add(label, &job.name, cost);
        timing.set_batches(label, &job.name, batches(&block));
        let kind = &plan.kinds[job.estimator_index];
        let entry = &experiment.file.estimator[job.estimator_index];
        cells[job.cell].runs.push(estimator_run(job, &entry.name, kind, block, &mut arrays));
    }
    let claims = serde_json::to_value(&experiment.file.claim).unwrap_or(Value::Null);
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
        sampler_comparisons: Vec::new(),
        replays,
        bands: plan.bands.clone(),
        cells,
        samplers: Vec::new(),
        checksums: BTreeMap::new(),
    };
    Ok(Assembled { record, arrays, timing })
}

/// The regions of the sensor of a job's cell.
fn regions(job: &Job) -> Vec<ObservedRegion> {
    let tile = |PixelRectangle { columns, rows }: PixelRectangle| Tile { columns, rows };
    let region = |region: &SensorRegion| ObservedRegion {
        name: region.name.clone(),
        tile: region.tile.map(tile),
    };
    job.layout.regions().iter().map(region).collect()
}

/// CPU time by batch.
fn batches(finished: &Finished) -> timing::Batches {
    let passes = finished.batches.iter().map(|moments| moments.first().map_or(0, |m| m.n));
    timing::Batches {
        processes: finished.tally.processes,
        cpu_seconds: finished.work.iter().map(|work| work.cpu_seconds).collect(),
        settled: finished.work.iter().zip(passes).map(|(work, n)| work.settled == n).collect(),
    }
}

fn estimator_run(
    job: &Job,
    entry: &str,
    kind: &str,
    finished: Finished,
    arrays: &mut Arrays,
) -> EstimatorRun {
    let (observables, bands) = (job.layout.observables().len(), job.layout.bands());
    let batches = &finished.batches;
    let shape = vec![batches.len(), observables, bands, 5];
    let data = batches.iter().flatten().flat_map(|moments| moments.to_array()).collect();
    let name = &job.name;
    let moments = observables_path(job.cell, name);
    arrays.insert(moments.clone(), Array::new(shape, data));

    let mut counters = Cost::ALL;
    counters.sort_by_key(|counter| counter.name());
    let counted = finished.work.iter().flat_map(|work| counters.map(|c| work.cost[c as usize] as f64));
    let costs = costs_path(job.cell, name);
    arrays
        .insert(costs.clone(), Array::new(vec![finished.work.len(), counters.len()], counted.collect()));

    let image = job.layout.image().filter(|_| job.stage == Stage::Main);
    let image = image.map(|(width, height)| {
        let errors = finished.image.std_error();
        let mut data = finished.image.mean;
        data.extend(errors);
        let pixels = pixels_path(job.cell, name);
        arrays.insert(pixels.clone(), Array::new(vec![2, height, width, bands], data));
        let spread = spread_path(job.cell, name);
        let pairs = finished.spread.iter().flatten().flat_map(|moments| moments.to_array()).collect();
        arrays.insert(spread.clone(), Array::new(vec![finished.spread.len(), bands, 5], pairs));
        Image { width, height, pixels, spread }
    });
    let counts = |names: Vec<&str>, values: &[u64]| {
        names.into_iter().map(str::to_string).zip(values.iter().copied()).collect()
    };
    EstimatorRun {
        estimator: name.clone(),
        control_of: job.is_control.then(|| entry.into()),
        kind: kind.into(),
        bias: match job.estimator.bias() {
            estimators::Bias::Unbiased => Bias::Unbiased,
            estimators::Bias::Consistent => Bias::Consistent,
            estimators::Bias::Biased(why) => Bias::Biased(why),
        },
        model: job.estimator.model(),
        heavy_tails: job.estimator.heavy_tails().into_iter().map(heavy_tail).collect(),
        notes: job.estimator.notes(),
        passes: finished.passes,
        observables: named(&job.layout),
        moments,
        costs,
        image,
        cost: counts(Cost::ALL.map(Cost::name).into(), &finished.tally.cost),
        anomalies: counts(Anomaly::ALL.map(Anomaly::name).into(), &finished.tally.anomalies),
    }
}

fn heavy_tail(tail: estimators::HeavyTail) -> HeavyTail {
    HeavyTail { band: tail.band, class: tail.class.name().into(), reason: tail.reason }
}
