//! Draws of one sampler, counted in its bins.
//!
//! Draws come in chunks of 4096, each on a stream of its own, so that threads do not matter: counts are
//! integers, and the moments of contrasts are merged by the fixed tree over chunks.

use std::sync::atomic::{AtomicU64, Ordering};

use super::bins::{Extra, Partition};
use crate::results::sampler::OWN_DENSITY;
use crate::run::clock::thread_cpu_time;
use crate::run::interrupt::Interrupt;
use crate::run::parallel::in_parallel;
use crate::samplers::{Contrast, Draw, Sampler};
use crate::sampling::stream::{Purpose, Stream, StreamKey};
use crate::stats::moments::Moments;
use crate::stats::tree::Counter;

/// Draws per chunk.
pub(crate) const CHUNK: u64 = 4096;

/// Chunks after which the moments are merged.
const ROUND: u64 = 4096;

/// Most groups of bins for consecutive draws.
const MOST_GROUPS: usize = 16;

/// What is drawn from, and into what.
pub(crate) struct Counting<'a> {
    /// Sampler under test.
    pub sampler: &'a dyn Sampler,
    /// Contrasts whose means are known.
    pub contrasts: Vec<Contrast>,
    /// Bins that draws are counted in.
    pub partition: &'a Partition,
    /// The extras of the partition.
    pub extras: &'a [(Extra, f64)],
    /// Group of each coarse bin.
    pub groups: Vec<usize>,
    /// Number of groups; 0 for none.
    pub group_count: usize,
    /// Key of the random streams.
    pub key: StreamKey,
}

/// What the draws counted.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct DrawCounts {
    /// By leaf, then extra.
    pub leaves: Vec<u64>,
    /// Draws of each discrete outcome.
    pub deltas: Vec<u64>,
    /// Those of them that were not exact.
    pub inexact: Vec<u64>,
    /// Draws that returned no sample.
    pub nulls: u64,
    /// Draws that cannot be.
    pub outside: u64,
    /// Draws whose own density is another than the density function's.
    pub differs: u64,
    /// The largest relative difference.
    pub largest: f64,
    /// Values of contrasts that were not finite.
    pub senseless: u64,
    /// Pairs by group of the first, then of the second.
    pub pairs: Vec<u64>,
    /// CPU time of the threads that counted, seconds; no count.
    pub cpu_seconds: f64,
}

impl DrawCounts {
    fn new(counting: &Counting, deltas: usize) -> DrawCounts {
        DrawCounts {
            leaves: vec![0; counting.partition.coarse.len()],
            deltas: vec![0; deltas],
            inexact: vec![0; deltas],
            pairs: vec![0; counting.group_count * counting.group_count],
            ..DrawCounts::default()
        }
    }

    fn add(&mut self, other: &DrawCounts) {
        let sum = |a: &mut Vec<u64>, b: &Vec<u64>| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        sum(&mut self.leaves, &other.leaves);
        sum(&mut self.deltas, &other.deltas);
        sum(&mut self.inexact, &other.inexact);
        sum(&mut self.pairs, &other.pairs);
        self.nulls += other.nulls;
        self.outside += other.outside;
        self.differs += other.differs;
        self.senseless += other.senseless;
        self.largest = self.largest.max(other.largest);
        self.cpu_seconds += other.cpu_seconds;
    }
}

impl Counting<'_> {
    /// Counts `samples` draws on a number of threads; nothing where it was interrupted. Returns the
    /// counts and the moments of each contrast.
    pub(crate) fn count(
        &self,
        samples: u64,
        threads: usize,
        interrupt: &Interrupt,
    ) -> Option<(DrawCounts, Vec<Moments>)> {
        debug_assert!(self.group_count <= MOST_GROUPS);
        let deltas = self.sampler.deltas().len();
        let chunks = samples.div_ceil(CHUNK);
        let mut counts = DrawCounts::new(self, deltas);
        let mut tree = Counter::new(0, Counter::<Vec<Moments>>::MERGE_ALL);
        for start in (0..chunks).step_by(ROUND as usize) {
            let end = chunks.min(start + ROUND);
            let next = AtomicU64::new(start);
            let worker = || {
                let (mut own, mut moments) = (DrawCounts::new(self, deltas), Vec::new());
                let before = thread_cpu_time();
                loop {
                    let chunk = next.fetch_add(1, Ordering::Relaxed);
                    if chunk >= end || interrupt.raised() {
                        own.cpu_seconds = thread_cpu_time().saturating_sub(before).as_secs_f64();
                        return (own, moments);
                    }
                    let draws = CHUNK.min(samples - chunk * CHUNK);
                    moments.push((chunk, self.chunk(chunk, draws, &mut own)));
                }
            };
            // The counts of a worker that finds no chunk left are empty.
            let parts = in_parallel(threads, threads.max(1), |_| worker());
            let mut moments = Vec::new();
            for (own, part) in parts {
                counts.add(&own);
                moments.extend(part);
            }
            if interrupt.raised() {
                return None;
            }
            moments.sort_by_key(|(chunk, _)| *chunk);
            moments.into_iter().for_each(|(_, moments)| tree.push(moments));
        }
        Some((counts, tree.finish().unwrap_or_default()))
    }

    fn chunk(&self, chunk: u64, draws: u64, counts: &mut DrawCounts) -> Vec<Moments> {
        let mut stream = self.key.pass(chunk).stream(0, Purpose::Walk);
        let mut moments = vec![Moments::default(); self.contrasts.len()];
        let mut previous = None;
        for i in 0..draws {
            let group = self.draw(&mut stream, counts, &mut moments);
            if i % 2 == 0 {
                previous = group;
            } else if let (Some(a), Some(b)) = (previous, group) {
                counts.pairs[a * self.group_count + b] += 1;
            }
        }
        moments
    }

    /// One draw; the group of its bin, where it is in one.
    #[inline]
    fn draw(
        &self,
        stream: &mut Stream,
        counts: &mut DrawCounts,
        moments: &mut [Moments],
    ) -> Option<usize> {
        let (bin, point) = match self.sampler.draw(stream) {
            Draw::Null => {
                counts.nulls += 1;
                (self.extra(Extra::Null), None)
            }
            Draw::Delta { index, exact } if index < counts.deltas.len() => {
                counts.deltas[index] += 1;
                counts.inexact[index] += u64::from(!exact);
                (self.extra(Extra::Delta(index)), None)
            }
            Draw::Delta { .. } => (None, None),
            Draw::Point { piece, at, density } => {
                (self.point(piece, at, density, counts), Some((piece, at)))
            }
        };
        let point = point.filter(|_| bin.is_some());
        for (contrast, moments) in self.contrasts.iter().zip(moments) {
            let value = point.map_or(0.0, |(piece, at)| (contrast.of)(piece, at));
            if value.is_finite() {
                moments.push(value);
            } else {
                counts.senseless += 1;
            }
        }
        let Some(bin) = bin else {
            // A null that never is has its own count.
            counts.outside += 1;
            return None;
        };
        counts.leaves[bin] += 1;
        (self.group_count > 0).then(|| self.groups[self.partition.coarse[bin]])
    }

    /// The leaf of a point where the density is positive.
    #[inline]
    fn point(&self, piece: usize, at: [f64; 2], own: f64, counts: &mut DrawCounts) -> Option<usize> {
        let leaf = self.partition.leaf(piece, at)?;
        let density = self.sampler.density(piece, at);
        let difference = (own - density).abs();
        let within = |limit: f64| difference <= limit * density.abs(); // a NaN is not
        let agrees = within(OWN_DENSITY) || within(OWN_DENSITY + self.sampler.rounding(piece, at));
        counts.differs += u64::from(!agrees);
        let relative = if difference == 0.0 { 0.0 } else { difference / density.abs() };
        counts.largest = if relative <= 1e300 { counts.largest.max(relative) } else { 1e300 };
        (density > 0.0 && density.is_finite()).then_some(leaf)
    }

    fn extra(&self, wanted: Extra) -> Option<usize> {
        let index = self.extras.iter().position(|(extra, _)| *extra == wanted)?;
        Some(self.partition.leaves.len() + index)
    }
}
