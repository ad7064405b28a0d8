//! Chi-square tests of samplers: bins chosen by the density, their masses by quadrature, counts of
//! draws.

pub(crate) mod bins;
pub(crate) mod count;
pub(crate) mod quadrature;

use std::time::Instant;

use super::clock::thread_cpu_time;
use super::interrupt::Interrupt;
use crate::results::npy::Array;
use crate::results::sampler::{ContrastRun, Delta, NullMass, SamplerRun, bins_path};
use crate::results::store::Arrays;
use crate::results::timing::TimeSpent;
use crate::samplers::{Draw, Null, Sampler};
use crate::sampling::stream::{Purpose, StreamKey};
use crate::stats::moments::Moments;
use bins::{Extra, Partition};
use count::{Counting, DrawCounts};
use quadrature::{Mass, Quadrature, ROUNDING};

/// What one sampler gave.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sampled {
    /// Its entry in the record.
    pub run: SamplerRun,
    /// Its arrays, by the names that `run` gives.
    pub arrays: Arrays,
    /// Time spent on it.
    pub cost: TimeSpent,
}

/// A built sampler with its streams.
pub(crate) struct Draws {
    /// Its index in the experiment file.
    pub index: usize,
    /// The name that the file gives it.
    pub name: String,
    /// Kind of the sampler.
    pub kind: String,
    /// Draws, and states its density.
    pub sampler: Box<dyn Sampler>,
    /// Number of draws.
    pub samples: u64,
    /// Key of the random streams.
    pub key: StreamKey,
}

impl Draws {
    /// CPU seconds that the draws take, by the time of the first few.
    pub(crate) fn estimate_seconds(&self) -> f64 {
        let few = 20_000;
        let mut stream = self.key.pass(0).stream(0, Purpose::Walk);
        let before = thread_cpu_time();
        for _ in 0..few {
            if let Draw::Point { piece, at, .. } = self.sampler.draw(&mut stream) {
                std::hint::black_box(self.sampler.density(piece, at));
            }
        }
        thread_cpu_time().saturating_sub(before).as_secs_f64() * self.samples as f64 / f64::from(few)
    }

    /// Integrates and draws; nothing where it was interrupted.
    pub(crate) fn run(&self, threads: usize, interrupt: &Interrupt) -> Option<Sampled> {
        let (wall, cpu) = (Instant::now(), thread_cpu_time());
        let sampler = &*self.sampler;
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
        let partition = Partition::new(&mut quadrature, self.samples, &extras);
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
        let pairs = (self.samples / 2) as f64;
        let (groups, group_count) = bins::groups(&centres, &coarse, pairs);
        let counting = Counting {
            sampler,
            contrasts: sampler.contrasts(),
            partition: &partition,
            extras: &extras,
            groups,
            group_count,
            key: self.key,
        };
        let before_counting = thread_cpu_time().saturating_sub(cpu).as_secs_f64();
        let (counts, moments) = counting.count(self.samples, threads, interrupt)?;
        let cpu_seconds = before_counting + counts.cpu_seconds;
        let contrasts = contrasts(&counting, &mut quadrature, &moments);
        let (run, arrays) =
            Assembly { job: self, partition: &partition, masses: &masses, counts: &counts, total }
                .record(&counting, contrasts, &quadrature, exhausted);
        let cost = TimeSpent {
            cpu_seconds,
            set_up_seconds: 0.0,
            wall_seconds: wall.elapsed().as_secs_f64(),
            passes: self.samples,
            paths: self.samples,
        };
        Some(Sampled { run, arrays, cost })
    }
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
    job: &'a Draws,
    partition: &'a Partition,
    masses: &'a [Mass],
    counts: &'a DrawCounts,
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
