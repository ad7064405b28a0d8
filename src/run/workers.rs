//! Threads that play blocks, and the one place where results are put in order.
//!
//! Workers take the next run of passes from a shared source; the collector (the calling thread) appends
//! finished blocks in the order of their passes, whatever the order in which they arrive. Blocks are
//! sized by the time they take; the fixed tree over passes makes results independent of that size.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError, mpsc};
use std::time::{Duration, Instant};

use super::checkpoint;
use super::interrupt::Interrupt;
use super::job::{Block, Finished, Job, Origin};
use super::pilot;
use super::progress::Progress;
use crate::error::{Error, Result};
use crate::experiment::schema::Budget;
use crate::results::json::hash_json;
use crate::stats::tree::batch_level;

/// How a run is carried out; nothing here changes a result.
pub struct Settings<'a> {
    /// Number of threads.
    pub threads: usize,
    /// Passes per block, where somebody insists.
    pub block_passes: Option<u64>,
    /// Somebody may ask to stop.
    pub interrupt: &'a Interrupt,
    /// Folder of the experiment's results.
    pub root: &'a Path,
    /// Shows how far it is.
    pub progress: &'a Progress,
}

/// Wall time that a block should take, seconds.
const BLOCK_SECONDS: f64 = 0.25;
/// Time between checkpoints of a job under way.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(5);

enum Message {
    /// A job begins: its passes in all, and what an earlier run had done of them.
    Begin { job: usize, passes: u64, done: Box<Block> },
    /// A block was played.
    Played { job: usize, block: Box<Block> },
}

struct Source {
    next_job: usize,
    active: Option<Active>,
}

struct Active {
    job: usize,
    passes: u64,
    next: u64,
    seconds_per_pass: Option<f64>,
}

struct Work {
    job: usize,
    start: u64,
    end: u64,
    keep_level: u32,
}

struct Pool<'a> {
    jobs: &'a [Job],
    budget: &'a Budget,
    settings: &'a Settings<'a>,
    source: Mutex<Source>,
}

/// Plays every job and returns their blocks in the order of the jobs. Where the run is interrupted, all
/// states are saved first.
pub fn play_all(jobs: &[Job], budget: &Budget, settings: &Settings) -> Result<Vec<Finished>> {
    let source = Mutex::new(Source { next_job: 0, active: None });
    let pool = Pool { jobs, budget, settings, source };
    // Bounded: blocks with images wait with their workers, not in memory.
    let (sender, receiver) = mpsc::sync_channel(settings.threads);
    std::thread::scope(|scope| {
        for _ in 0..settings.threads {
            let (pool, sender) = (&pool, sender.clone());
            scope.spawn(move || pool.work(&sender));
        }
        drop(sender);
        let collected = Collector::new(jobs, settings).collect(receiver);
        if collected.is_err() {
            settings.interrupt.raise(); // workers stop; the error is what is told
        }
        collected
    })
}

/// Stops the other threads where one panics: the run is lost, and they should not play it to its end.
struct StopOnPanic<'a>(&'a Interrupt);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.raise();
        }
    }
}

impl Pool<'_> {
    fn work(&self, sender: &mpsc::SyncSender<Message>) {
        let _guard = StopOnPanic(self.settings.interrupt);
        let stop = || self.settings.interrupt.raised();
        while let Some(work) = self.next(sender) {
            let begun = Instant::now();
            let job = &self.jobs[work.job];
            let Some(block) = job.play(job.stage, work.start, work.end, work.keep_level, &stop) else {
                return;
            };
            let seconds = begun.elapsed().as_secs_f64() / (work.end - work.start) as f64;
            // Sent before the lock is asked for, which another worker's pilot may hold for long.
            if sender.send(Message::Played { job: work.job, block: Box::new(block) }).is_err() {
                return;
            }
            if let Some(active) = self.lock().active.as_mut().filter(|a| a.job == work.job) {
                active.seconds_per_pass = Some(seconds);
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Source> {
        self.source.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next run of passes; begins the next job where the last one has none left.
    fn next(&self, sender: &mpsc::SyncSender<Message>) -> Option<Work> {
        let mut source = self.lock();
        loop {
            if self.settings.interrupt.raised() {
                return None;
            }
            if let Some(active) = source.active.as_mut().filter(|a| a.next < a.passes) {
                let start = active.next;
                active.next = active.passes.min(start + self.block_length(active));
                let keep_level = batch_level(active.passes);
                return Some(Work { job: active.job, start, end: active.next, keep_level });
            }
            let job = source.next_job;
            if job == self.jobs.len() {
                return None;
            }
            source.next_job += 1;
            source.active = Some(self.begin(job, sender)?);
        }
    }

    fn block_length(&self, active: &Active) -> u64 {
        let left = active.passes - active.next;
        let fair = (left / (2 * self.settings.threads as u64)).max(1);
        let timed = match active.seconds_per_pass {
            Some(seconds) => (BLOCK_SECONDS / seconds.max(1e-9)) as u64,
            None => 1,
        };
        self.settings.block_passes.unwrap_or(timed.min(fair)).max(1)
    }

    /// Fixes a job's passes and finds what is done of it. Other workers wait meanwhile.
    fn begin(&self, index: usize, sender: &mpsc::SyncSender<Message>) -> Option<Active> {
        let job = &self.jobs[index];
        let path = checkpoint::path(self.settings.root, &job.identity);
        let origin = checkpoint::origin(&path, &job.identity);
        let budget = hash_json(&(self.budget, &job.targets));
        // A pilot that times itself would find another number each time.
        let passes = match &origin {
            Some(origin) if origin.budget == budget => origin.passes,
            _ => pilot::passes(job, self.budget, &|| self.settings.interrupt.raised())?,
        };
        // Where a state goes too far or too coarsely, its passes are played again; they were seen all the
        // same, so what is claimed since then stays claimed too late.
        let claims = origin.map_or_else(|| job.claims.clone(), |origin| origin.claims);
        let keep_level = batch_level(passes);
        let mut done = checkpoint::load(&path, &job.identity, keep_level)
            .filter(|block| block.next_pass() <= passes)
            .unwrap_or_else(|| Block::empty(0, keep_level));
        done.origin = Origin { claims, budget, passes };
        let next = done.next_pass();
        sender.send(Message::Begin { job: index, passes, done: Box::new(done) }).ok()?;
        Some(Active { job: index, passes, next, seconds_per_pass: None })
    }
}

/// Puts blocks in order.
struct Collector<'a> {
    jobs: &'a [Job],
    settings: &'a Settings<'a>,
    finished: BTreeMap<usize, Finished>,
    running: BTreeMap<usize, Running>,
}

struct Running {
    passes: u64,
    done: Block,
    /// Passes that the state on disk holds.
    on_disk: u64,
    /// Blocks that came before their turn, by first pass.
    early: BTreeMap<u64, Block>,
    saved: Instant,
}

impl<'a> Collector<'a> {
    fn new(jobs: &'a [Job], settings: &'a Settings<'a>) -> Collector<'a> {
        Collector { jobs, settings, finished: BTreeMap::new(), running: BTreeMap::new() }
    }

    fn collect(mut self, receiver: mpsc::Receiver<Message>) -> Result<Vec<Finished>> {
        // Owned: where this returns early, senders that wait fail instead of waiting for ever.
        for message in receiver {
            let job = match message {
                Message::Begin { job, passes, done } => {
                    let (early, saved) = (BTreeMap::new(), Instant::now());
                    let on_disk = done.next_pass();
                    self.running.insert(job, Running { passes, done: *done, on_disk, early, saved });
                    job
                }
                Message::Played { job, block } => {
                    self.take(job, *block)?;
                    job
                }
            };
            self.close_if_done(job)?;
            self.show(job);
        }
        if self.finished.len() == self.jobs.len() {
            return Ok(self.finished.into_values().collect());
        }
        for (&job, running) in &self.running {
            self.save(job, &running.done)?;
        }
        let done = self.finished.len();
        Err(Error::Interrupted(format!(
            "{done} of {} measurements are complete and the passes done of the others are kept in {}; the \
             same command goes on from there",
            self.jobs.len(),
            self.settings.root.display()
        )))
    }

    fn take(&mut self, job: usize, block: Block) -> Result<()> {
        let Some(running) = self.running.get_mut(&job) else { return Ok(()) };
        running.early.insert(block.gates.start(), block);
        while let Some(next) = running.early.remove(&running.done.next_pass()) {
            running.done.append(next);
        }
        if running.saved.elapsed() > CHECKPOINT_EVERY {
            running.saved = Instant::now();
            let running = &self.running[&job];
            self.save(job, &running.done)?;
        }
        Ok(())
    }

    fn close_if_done(&mut self, job: usize) -> Result<()> {
        if self.running.get(&job).is_some_and(|r| r.done.next_pass() == r.passes)
            && let Some(running) = self.running.remove(&job)
        {
            if running.done.next_pass() > running.on_disk {
                self.save(job, &running.done)?;
            }
            self.finished.insert(job, running.done.finish());
        }
        Ok(())
    }

    fn save(&self, job: usize, block: &Block) -> Result<()> {
        let identity = &self.jobs[job].identity;
        checkpoint::save(&checkpoint::path(self.settings.root, identity), identity, block)
    }

    fn show(&self, job: usize) {
        let share = |r: &Running| r.done.next_pass() as f64 / r.passes as f64;
        let under_way: f64 = self.running.values().map(share).sum();
        let message = match self.running.get(&job) {
            Some(running) => format!("{}: {} passes", self.jobs[job].label, running.passes),
            None => self.jobs[job].label.clone(),
        };
        self.settings.progress.update(self.finished.len() as f64 + under_way, message);
    }
}
