//! Runs experiments on samplers: bins and masses from the densities, counts from the draws, the record.
//!
//! A sampler is the unit of work and of resuming: what one of them gave is kept in `state/`, so that an
//! interrupted run goes on with the next one, and a run that is repeated draws nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::Options;
use super::chi_square::bins::{self, Extra, Partition};
use super::chi_square::count::{Counting, Counts};
use super::chi_square::quadrature::{Mass, Quadrature, ROUNDING};
use super::clock::thread_cpu_time;
use super::comparisons;
use super::interrupt::Interrupt;
use super::keys::{KEY_VERSION, Stage};
use super::progress::Progress;
use crate::error::{Error, Result};
use crate::experiment::SamplerExperiment;
use crate::experiment::registry::Registry;
use crate::experiment::sampler_file::SamplerEntry;
use crate::results::atomic;
use crate::results::json::{canonical, hash_bytes, hash_hex, hash_json};
use crate::results::npy::Array;
use crate::results::provenance::{self, Provenance, fingerprint};
use crate::results::record::{Record, SCHEMA_VERSION};
use crate::results::sampler::{ContrastRun, Delta, NullMass, SamplerRun, bins_path};
use crate::results::store::{Arrays, RecordFolder, Stored};
use crate::results::timing::{Cost, Timing};
use crate::samplers::{Draw, Null, Sampler};
use crate::sampling::stream::{Purpose, StreamKey};
use crate::stats::moments::Moments;

/// What one sampler gave.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Its entry in the record.
    pub run: SamplerRun,
    /// Its arrays, by the names that `run` gives.
    pub arrays: Arrays,
    /// Time spent on it; none where it was kept from an earlier run.
    pub cost: Option<Cost>,
    /// Hashes of the claims that stood when it was drawn.
    claims: Vec<String>,
}

/// A built sampler with its place in the experiment.
struct Job {
    index: usize,
    name: String,
    kind: String,
    sampler: Box<dyn Sampler>,
    samples: u64,
    key: StreamKey,
    identity: String,
}

/// Runs an experiment on samplers and writes its record, timing and provenance.
///
/// # Errors
/// Options that a sampler refuses; I/O; an interruption, after which the same call goes on.
pub fn run(
    experiment: &SamplerExperiment,
    registry: &Registry,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<(RecordFolder, Stored)> {
    let jobs = jobs(experiment, registry, Stage::Main, 1, &|_| true)?;
    let root = options.folder(&experiment.file.name);
    play(experiment, jobs, Stage::Main, &root, options, interrupt)
}

/// Draws from the samplers of these names again, on the streams of a second look and `factor` times as
/// often, and writes the record of the same form into `retest/` beside the first.
///
/// # Errors
/// As [`run`].
pub fn retest(
    experiment: &SamplerExperiment,
    registry: &Registry,
    options: &Options,
    interrupt: &Interrupt,
    names: &BTreeSet<String>,
    factor: u64,
) -> Result<Stored> {
    let jobs = jobs(experiment, registry, Stage::Retest, factor, &|name| names.contains(name))?;
    let root = RecordFolder::new(options.folder(&experiment.file.name)).retest();
    play(experiment, jobs, Stage::Retest, root.root(), options, interrupt).map(|(_, stored)| stored)
}

/// Builds every sampler, as `check` wants it.
///
/// # Errors
/// Options that a sampler refuses.
pub fn build_all(experiment: &SamplerExperiment, registry: &Registry) -> Result<()> {
    jobs(experiment, registry, Stage::Main, 1, &|_| true).map(|_| ())
}

/// CPU seconds that the draws of each sampler take, by the time of the first few; nothing where `dry`.
///
/// # Errors
/// Options that a sampler refuses.
pub fn estimate_seconds(
    experiment: &SamplerExperiment,
    registry: &Registry,
    dry: bool,
) -> Result<Vec<Option<f64>>> {
    let few = 20_000;
    let timed = |job: &Job| {
        let mut stream = job.key.pass(0).stream(0, Purpose::Walk);
        let before = thread_cpu_time();
        for _ in 0..few {
            if let Draw::Point { piece, at, .. } = job.sampler.draw(&mut stream) {
                std::hint::black_box(job.sampler.density(piece, at));
            }
        }
        thread_cpu_time().saturating_sub(before).as_secs_f64() * job.samples as f64 / f64::from(few)
    };
    let jobs = jobs(experiment, registry, Stage::Main, 1, &|_| true)?;
    Ok(jobs.iter().map(|job| (!dry).then(|| timed(job))).collect())
}

/// Whether the folder holds a record of exactly this experiment, its claims included, by this build.
pub fn has_record(experiment: &SamplerExperiment, out: &Path) -> bool {
    let folder = RecordFolder::new(out.join(&experiment.file.name));
    let same_build =
        || matches!(folder.read_provenance(), Ok(Some(p)) if p.build == provenance::build());
    folder.exists()
        && same_build()
        && folder.read().is_ok_and(|stored| {
            stored.record.experiment_hash == hash_json(&experiment.resolved())
                && stored.record.claims == json!(experiment.file.claim)
        })
}

fn jobs(
    experiment: &SamplerExperiment,
    registry: &Registry,
    stage: Stage,
    factor: u64,
    wanted: &dyn Fn(&str) -> bool,
) -> Result<Vec<Job>> {
    let entries = experiment.file.sampler.iter().enumerate();
    entries
        .filter(|(_, entry)| wanted(&entry.name))
        .map(|(index, entry)| job(experiment, registry, stage, factor, index, entry))
        .collect()
}

fn job(
    experiment: &SamplerExperiment,
    registry: &Registry,
    stage: Stage,
    factor: u64,
    index: usize,
    entry: &SamplerEntry,
) -> Result<Job> {
    let file = &experiment.file;
    let (kind, options) =
        entry.choice().ok_or_else(|| Error::input(format!("sampler `{}` has no kind", entry.name)))?;
    let registered = registry
        .samplers
        .iter()
        .find(|known| known.kind == kind)
        .ok_or_else(|| Error::input(format!("sampler `{}`: unknown kind `{kind}`", entry.name)))?;
    // Absent on purpose: the number of draws, claims, threads, the order of the file.
    let mut name = json!({
        "version": KEY_VERSION,
        "experiment": file.name,
        "sampler": entry.name,
        "content": entry.content(),
        "stage": stage.name(),
    });
    if let Some(fresh) = &file.fresh {
        name["fresh"] = json!(fresh);
    }
    let samples = file.samples.saturating_mul(factor);
    Ok(Job {
        index,
        name: entry.name.clone(),
        kind: kind.to_string(),
        sampler: (registered.build)(options)?,
        samples,
        key: StreamKey::new(hash_bytes(canonical(&name).as_bytes())),
        identity: hash_json(&json!({
            "build": provenance::build(), "streams": name, "samples": samples, "index": index,
        })),
    })
}

fn play(
    experiment: &SamplerExperiment,
    jobs: Vec<Job>,
    stage: Stage,
    root: &Path,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<(RecordFolder, Stored)> {
    atomic::create_folder(&root.join("state"), "create the results folder")?;
    let claims: Vec<String> = experiment.file.claim.iter().map(hash_json).collect();
    let drawn = draw_all(&jobs, &claims, root, options, interrupt)?;
    let file = &experiment.file;
    let (mut samplers, mut arrays, mut timing) = (Vec::new(), Arrays::new(), Timing::default());
    let mut post_hoc = BTreeSet::new();
    for one in drawn {
        post_hoc.extend((0..claims.len()).filter(|&i| !one.claims.contains(&claims[i])));
        if let Some(cost) = one.cost {
            timing.add("", &one.run.sampler, cost);
        }
        samplers.push(one.run);
        arrays.extend(one.arrays);
    }
    let stated = serde_json::to_value(&file.claim).unwrap_or(Value::Null);
    let record = Record {
        schema_version: SCHEMA_VERSION,
        experiment: file.name.clone(),
        stage: stage.name().into(),
        fingerprint: fingerprint(),
        experiment_hash: hash_json(&experiment.resolved()),
        resolved: experiment.resolved(),
        claims_hash: hash_json(&stated),
        claims: stated,
        statements: comparisons::sampler_statements(&file.claim),
        post_hoc: post_hoc.into_iter().collect(),
        comparisons: Vec::new(),
        sampler_comparisons: comparisons::expand_samplers(&file.claim, &samplers),
        replays: Vec::new(),
        bands: Vec::new(),
        cells: Vec::new(),
        samplers,
        checksums: BTreeMap::new(),
    };
    let folder = RecordFolder::new(root);
    let stored = folder.write(record, arrays)?;
    folder.write_timing(&timing)?;
    folder.write_provenance(&Provenance::collect(options.threads))?;
    Ok((folder, stored))
}

/// Samplers side by side; threads that are left over share one sampler's draws.
fn draw_all(
    jobs: &[Job],
    claims: &[String],
    root: &Path,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<Vec<Drawn>> {
    let threads = options.threads.max(1);
    let outer = threads.min(jobs.len()).max(1);
    let inner = (threads / outer).max(1);
    let (next, done) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    let progress = Progress::new(jobs.len(), options.quiet);
    let worker = || {
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(i).filter(|_| !interrupt.raised()) else { return };
            let path = state_path(root, &job.identity);
            let result = match load(&path, &job.identity) {
                Some(kept) => Ok(kept),
                None => match draw(job, inner, claims, interrupt) {
                    Some(drawn) => save(&path, &job.identity, &drawn).map(|()| drawn),
                    None => return,
                },
            };
            if result.is_err() {
                interrupt.raise(); // the others stop; the error is what is told
            }
            let mut done = done.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            done.insert(i, result);
            progress.update(done.len() as f64, job.name.clone());
        }
    };
    std::thread::scope(|scope| {
        (1..outer).for_each(|_| drop(scope.spawn(worker)));
        worker();
    });
    progress.finish();
    let done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    let count = done.len();
    let drawn = done.into_values().collect::<Result<Vec<_>>>()?;
    if count < jobs.len() {
        return Err(Error::Interrupted(format!(
            "{count} of {} samplers are complete and kept in {}; the same command goes on from there",
            jobs.len(),
            root.display()
        )));
    }
    Ok(drawn)
}

/// Integrates and draws; nothing where it was interrupted.
fn draw(job: &Job, threads: usize, claims: &[String], interrupt: &Interrupt) -> Option<Drawn> {
    let (wall, cpu) = (Instant::now(), thread_cpu_time());
    let sampler = &*job.sampler;
    let (deltas, null) = (sampler.deltas(), sampler.null());
    let mut quadrature = Quadrature::new(sampler);
    let mut extras: Vec<(Extra, f64)> =
        deltas.iter().enumerate().map(|(i, d)| (Extra::Delta(i), d.mass)).collect();
    let discrete: f64 = deltas.iter().map(|d| d.mass).sum();
    match null {
        Null::Never => {}
        Null::Stated(mass) => extras.push((Extra::Null, mass)),
        Null::Remainder => {
            let continuous: f64 = bins::shares(&mut quadrature).iter().sum();
            extras.push((Extra::Null, (1.0 - discrete - continuous).max(0.0)));
        }
    }
    let partition = Partition::new(&mut quadrature, job.samples, &extras);
    let exhausted = quadrature.refine();
    let mut masses = quadrature.masses(partition.leaves.len());
    let mut total = Mass::default();
    masses.iter().for_each(|mass| total.add(*mass));
    let known = |value: f64| Mass { value, bound: 1e-3 * ROUNDING * value };
    for (extra, mass) in &extras {
        match (extra, null) {
            (Extra::Null, Null::Remainder) => {
                let rest = (1.0 - total.value).max(0.0);
                masses.push(Mass { value: rest, bound: total.bound });
            }
            _ => {
                total.add(known(*mass));
                masses.push(known(*mass));
            }
        }
    }
    let coarse = sums(&partition.coarse, partition.coarse_count, &masses);
    let centres = centres(&partition, &quadrature);
    let pairs = (job.samples / 2) as f64;
    let (groups, group_count) = bins::groups(&centres, &coarse, pairs);
    let counting = Counting {
        sampler,
        contrasts: sampler.contrasts(),
        partition: &partition,
        extras: &extras,
        groups,
        group_count,
        key: job.key,
    };
    let before_counting = thread_cpu_time().saturating_sub(cpu).as_secs_f64();
    let (counts, moments) = counting.count(job.samples, threads, interrupt)?;
    let cpu_seconds = before_counting + counts.cpu_seconds;
    let contrasts = contrasts(&counting, &mut quadrature, &moments);
    let (run, arrays) = Assembly { job, partition: &partition, masses: &masses, counts: &counts, total }
        .record(&counting, contrasts, &quadrature, exhausted);
    let cost = Cost {
        cpu_seconds,
        wall_seconds: wall.elapsed().as_secs_f64(),
        passes: job.samples,
        paths: job.samples,
    };
    Some(Drawn { run, arrays, cost: Some(cost), claims: claims.to_vec() })
}

fn sums(bin_of: &[usize], count: usize, masses: &[Mass]) -> Vec<Mass> {
    let mut sums = vec![Mass::default(); count];
    bin_of.iter().zip(masses).for_each(|(&bin, mass)| sums[bin].add(*mass));
    sums
}

/// Centres of the coarse bins: of the first leaf of each; what is no box comes after all pieces.
fn centres(partition: &Partition, quadrature: &Quadrature) -> Vec<(usize, [f64; 2])> {
    let pieces = quadrature.pieces();
    let mut centres = vec![(pieces.len(), [0.5; 2]); partition.coarse_count];
    for (area, &bin) in partition.leaves.iter().zip(&partition.coarse).rev() {
        centres[bin] = (area.piece, bins::centre(area, &pieces[area.piece].axes));
    }
    centres
}

fn contrasts(counting: &Counting, quadrature: &mut Quadrature, moments: &[Moments]) -> Vec<ContrastRun> {
    let runs = counting.contrasts.iter().zip(moments).map(|(contrast, moments)| {
        let expected = match contrast.expected {
            Some(value) => Mass { value, bound: 0.0 },
            None => quadrature.contrast(contrast),
        };
        ContrastRun {
            name: contrast.name.into(),
            moments: moments.to_array(),
            expected: expected.value,
            bound: expected.bound,
        }
    });
    runs.collect()
}

/// What becomes a record.
struct Assembly<'a> {
    job: &'a Job,
    partition: &'a Partition,
    masses: &'a [Mass],
    counts: &'a Counts,
    total: Mass,
}

impl Assembly<'_> {
    fn record(
        &self,
        counting: &Counting,
        contrasts: Vec<ContrastRun>,
        quadrature: &Quadrature,
        exhausted: bool,
    ) -> (SamplerRun, Arrays) {
        let Assembly { job, partition, counts, .. } = self;
        let mut arrays = Arrays::new();
        let coarse = bins_path(job.index, "coarse");
        arrays.insert(coarse.clone(), self.bins(&partition.coarse, partition.coarse_count));
        let fine = (partition.fine_count > partition.coarse_count).then(|| {
            let path = bins_path(job.index, "fine");
            arrays.insert(path.clone(), self.bins(&partition.fine, partition.fine_count));
            path
        });
        let serial = (counting.group_count > 0).then(|| {
            let path = bins_path(job.index, "serial");
            arrays.insert(path.clone(), self.pairs(counting));
            path
        });
        let deltas = job.sampler.deltas().into_iter().enumerate().map(|(i, delta)| Delta {
            name: delta.name,
            mass: delta.mass,
            observed: counts.deltas[i],
            inexact: counts.inexact[i],
        });
        let run = SamplerRun {
            sampler: job.name.clone(),
            kind: job.kind.clone(),
            samples: job.samples,
            coarse,
            fine,
            serial,
            deltas: deltas.collect(),
            nulls: counts.nulls,
            null: match job.sampler.null() {
                Null::Never => NullMass::Never,
                Null::Stated(mass) => NullMass::Stated(mass),
                Null::Remainder => NullMass::Remainder,
            },
            outside: counts.outside,
            own_density_differs: counts.differs,
            own_density_largest: counts.largest,
            total: self.total.value,
            total_bound: self.total.bound,
            evaluations: quadrature.evaluations,
            senseless: quadrature.senseless,
            senseless_contrasts: counts.senseless,
            exhausted,
            contrasts,
        };
        (run, arrays)
    }

    /// Counts, masses and bounds by bin; last a bin that nothing may enter.
    fn bins(&self, bin_of: &[usize], count: usize) -> Array {
        let mut observed = vec![0.0; count + 1];
        bin_of.iter().zip(&self.counts.leaves).for_each(|(&bin, &n)| observed[bin] += n as f64);
        observed[count] = self.counts.outside as f64;
        let mut sums = sums(bin_of, count, self.masses);
        sums.push(Mass::default());
        observed.extend(sums.iter().map(|mass| mass.value));
        observed.extend(sums.iter().map(|mass| mass.bound));
        Array::new(vec![3, count + 1], observed)
    }

    fn pairs(&self, counting: &Counting) -> Array {
        let n = counting.group_count;
        let coarse = sums(&self.partition.coarse, self.partition.coarse_count, self.masses);
        let groups = sums(&counting.groups, n, &coarse);
        let mut data: Vec<f64> = self.counts.pairs.iter().map(|&pairs| pairs as f64).collect();
        let products = || groups.iter().flat_map(|a| groups.iter().map(move |b| (a, b)));
        data.extend(products().map(|(a, b)| a.value * b.value));
        data.extend(products().map(|(a, b)| a.value * b.bound + b.value * a.bound + a.bound * b.bound));
        Array::new(vec![3, n, n], data)
    }
}

/// A sampler's state on disk, followed by the blake3 of its JSON, hex.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    identity: String,
    run: SamplerRun,
    arrays: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
    claims: Vec<String>,
}

fn state_path(root: &Path, identity: &str) -> PathBuf {
    root.join("state").join(format!("{}.sampler", &identity[..32]))
}

fn save(path: &Path, identity: &str, drawn: &Drawn) -> Result<()> {
    let arrays = drawn.arrays.iter().map(|(name, a)| (name.clone(), (a.shape.clone(), a.data.clone())));
    let state = State {
        identity: identity.into(),
        run: drawn.run.clone(),
        arrays: arrays.collect(),
        claims: drawn.claims.clone(),
    };
    let text = serde_json::to_string(&state).unwrap_or_default();
    let text = format!("{}\n{text}", hash_hex(text.as_bytes()));
    atomic::write(path, text.as_bytes(), "save the state of the run")
}

/// The state of a sampler; nothing where there is none that fits: another's, truncated or damaged.
fn load(path: &Path, identity: &str) -> Option<Drawn> {
    let text = std::fs::read_to_string(path).ok()?;
    let (hash, text) = text.split_once('\n')?;
    if hash_hex(text.as_bytes()) != hash {
        return None;
    }
    let state: State = serde_json::from_str(text).ok()?;
    if state.identity != identity {
        return None;
    }
    let arrays = state.arrays.into_iter();
    let arrays = arrays.map(|(name, (shape, data))| {
        (shape.iter().product::<usize>() == data.len()).then(|| (name, Array::new(shape, data)))
    });
    let arrays = arrays.collect::<Option<Arrays>>()?;
    Some(Drawn { run: state.run, arrays, cost: None, claims: state.claims })
}
