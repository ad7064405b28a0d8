//! Threads that play blocks, and the one place where results are put in order.
//!
//! Workers take the next run of passes from a shared source; the collector (the calling thread) appends
//! finished blocks in the order of their passes, whatever the order in which they arrive. Blocks are
//! sized by the time they take; the fixed tree over passes makes results independent of that size.
//!
//! Jobs that are timed side by side are played by quadruples: one worker plays two batches of every arm in
//! the order A B .. B A, so that whatever drifts steadily (clock rate, temperature, other load) adds the
//! same to each arm. A worker's first quadruple of a group warms it up, and one of which an earlier process
//! had played a part is not in that order: neither counts as timed (`Work::settled`).

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError, mpsc};
use std::time::{Duration, Instant};

use super::checkpoint;
use super::interrupt::Interrupt;
use super::job::{Block, Finished, Job, Origin};
use super::live::Show;
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
    /// Shows images as they are made.
    pub show: Option<Show<'a>>,
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
    next_group: usize,
    active: Option<Active>,
}

/// The group of jobs under way: one, or the arms that are timed side by side.
struct Active {
    group: usize,
    arms: Vec<Arm>,
    /// Number of the next quadruple of batches.
    quadruple: u64,
    seconds_per_pass: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Arm {
    job: usize,
    passes: u64,
    next: u64,
}

/// A run of passes of one job.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    job: usize,
    start: u64,
    end: u64,
    keep_level: u32,
}

/// What a worker plays in one go.
struct Unit {
    group: usize,
    spans: Vec<Span>,
    /// These are whole batches of rivals in an order that cancels drift.
    is_balanced: bool,
}

struct Pool<'a> {
    jobs: &'a [Job],
    /// Indices of jobs that are played together.
    groups: Vec<Vec<usize>>,
    budget: &'a Budget,
    settings: &'a Settings<'a>,
    source: Mutex<Source>,
}

/// Plays every job and returns their blocks in the order of the jobs. Where the run is interrupted, all
/// states are saved first.
pub fn play_all(jobs: &[Job], budget: &Budget, settings: &Settings) -> Result<Vec<Finished>> {
    let source = Mutex::new(Source { next_group: 0, active: None });
    let pool = Pool { jobs, groups: groups(jobs), budget, settings, source };
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

/// Jobs that are timed side by side, together; the others one by one.
fn groups(jobs: &[Job]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (index, job) in jobs.iter().enumerate() {
        let same = |group: &&mut Vec<usize>| jobs[group[0]].side_by_side == job.side_by_side;
        match groups.iter_mut().find(same).filter(|_| job.side_by_side.is_some()) {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    groups
}

/// Two batches of every arm in the order A B .. B A, without what is played already; and whether nothing of
/// it was.
fn quadruple(arms: &[Arm], number: u64) -> (Vec<Span>, bool) {
    let span = |arm: &Arm, batch: u64| {
        let keep_level = batch_level(arm.passes);
        let at = |batch: u64| arm.passes.min(batch << keep_level);
        Span { job: arm.job, start: at(batch).max(arm.next), end: at(batch + 1), keep_level }
    };
    let there = arms.iter().map(|arm| span(arm, 2 * number));
    let back = arms.iter().rev().map(|arm| span(arm, 2 * number + 1));
    let spans: Vec<Span> = there.chain(back).collect();
    let is_whole = spans.iter().all(|span| span.end == span.start + (1 << span.keep_level));
    (spans.into_iter().filter(|span| span.start < span.end).collect(), is_whole)
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
        let mut warm = None;
        while let Some(unit) = self.next(sender) {
            let begun = Instant::now();
            let is_settled = unit.is_balanced && warm == Some(unit.group);
            warm = Some(unit.group);
            for span in &unit.spans {
                let job = &self.jobs[span.job];
                let played = job.play(job.stage, span.start, span.end, span.keep_level, &stop);
                let Some(mut block) = played else { return };
                if is_settled {
                    block.settle(span.keep_level);
                }
                // Sent before the lock is asked for, which another worker's pilot may hold for long.
                if sender.send(Message::Played { job: span.job, block: Box::new(block) }).is_err() {
                    return;
                }
            }
            let passes: u64 = unit.spans.iter().map(|span| span.end - span.start).sum();
            let seconds = begun.elapsed().as_secs_f64() / passes as f64;
            if let Some(active) = self.lock().active.as_mut().filter(|a| a.group == unit.group) {
                active.seconds_per_pass = Some(seconds);
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Source> {
        self.source.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next passes to play; begins the next group where the last one has none left.
    fn next(&self, sender: &mpsc::SyncSender<Message>) -> Option<Unit> {
        let mut source = self.lock();
        loop {
            if self.settings.interrupt.raised() {
                return None;
            }
            if let Some(unit) = source.active.as_mut().and_then(|active| self.take(active)) {
                return Some(unit);
            }
            let group = source.next_group;
            let jobs = self.groups.get(group)?;
            source.next_group += 1;
            let arms: Option<Vec<Arm>> = jobs.iter().map(|&job| self.begin(job, sender)).collect();
            let (quadruple, seconds_per_pass) = (0, None);
            source.active = Some(Active { group, arms: arms?, quadruple, seconds_per_pass });
        }
    }

    /// The next passes of a group, if it has any left.
    fn take(&self, active: &mut Active) -> Option<Unit> {
        let group = active.group;
        if let [arm] = active.arms[..] {
            let start = arm.next;
            let end = arm.passes.min(start + self.block_length(active));
            active.arms[0].next = end;
            let span = Span { job: arm.job, start, end, keep_level: batch_level(arm.passes) };
            return (start < end).then(|| Unit { group, spans: vec![span], is_balanced: false });
        }
        let most = active.arms.iter().map(|arm| arm.passes.div_ceil(1 << batch_level(arm.passes))).max();
        while 2 * active.quadruple < most? {
            let (spans, is_balanced) = quadruple(&active.arms, active.quadruple);
            active.quadruple += 1;
            if !spans.is_empty() {
                return Some(Unit { group, spans, is_balanced });
            }
        }
        None
    }

    fn block_length(&self, active: &Active) -> u64 {
        let left = active.arms[0].passes - active.arms[0].next;
        let fair = (left / (2 * self.settings.threads as u64)).max(1);
        let timed = match active.seconds_per_pass {
            Some(seconds) => (BLOCK_SECONDS / seconds.max(1e-9)) as u64,
            None => 1,
        };
        self.settings.block_passes.unwrap_or(timed.min(fair)).max(1)
    }

    /// Fixes a job's passes and finds what is done of it. Other workers wait meanwhile.
    fn begin(&self, index: usize, sender: &mpsc::SyncSender<Message>) -> Option<Arm> {
        let job = &self.jobs[index];
        let path = checkpoint::path(self.settings.root, &job.identity);
        let origin = checkpoint::origin(&path, &job.identity);
        let budget = hash_json(&(self.budget, &job.targets));
        // A pilot that times itself would find another number each time.
        let passes = match (job.passes, &origin) {
            (Some(passes), _) => passes,
            (None, Some(origin)) if origin.budget == budget => origin.passes,
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
        done.tally.processes += u64::from(next < passes);
        sender.send(Message::Begin { job: index, passes, done: Box::new(done) }).ok()?;
        Some(Arm { job: index, passes, next })
    }
}

/// Puts blocks in order.
struct Collector<'a> {
    jobs: &'a [Job],
    settings: &'a Settings<'a>,
    finished: BTreeMap<usize, Finished>,
    running: BTreeMap<usize, Running>,
    /// Jobs whose last image found no place on its way to the viewer.
    owed: Vec<usize>,
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
        let (finished, running, owed) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
        Collector { jobs, settings, finished, running, owed }
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
                    let has_grown = self.take(job, *block)?;
                    let running = self.running.get(&job).filter(|_| has_grown);
                    if let (Some(show), Some(running)) = (self.settings.show, running) {
                        show.under_way(job, &running.done);
                    }
                    job
                }
            };
            self.close_if_done(job)?;
            self.progress(job);
        }
        if self.finished.len() == self.jobs.len() {
            let finished: Vec<Finished> = self.finished.into_values().collect();
            let slow = self.settings.show.and_then(|show| show.close(&self.owed, &finished));
            let gone = self.settings.show.and_then(|show| show.live.complaint());
            slow.iter().chain(&gone).for_each(|what| self.settings.progress.say(what));
            return Ok(finished);
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

    /// Takes a block; whether passes were appended, of this or of earlier ones that waited for it.
    fn take(&mut self, job: usize, block: Block) -> Result<bool> {
        let Some(running) = self.running.get_mut(&job) else { return Ok(false) };
        let before = running.done.next_pass();
        running.early.insert(block.moments.start(), block);
        while let Some(next) = running.early.remove(&running.done.next_pass()) {
            running.done.append(next);
        }
        let has_grown = running.done.next_pass() > before;
        if running.saved.elapsed() > CHECKPOINT_EVERY {
            running.saved = Instant::now();
            let running = &self.running[&job];
            self.save(job, &running.done)?;
        }
        Ok(has_grown)
    }

    fn close_if_done(&mut self, job: usize) -> Result<()> {
        if self.running.get(&job).is_some_and(|r| r.done.next_pass() == r.passes)
            && let Some(running) = self.running.remove(&job)
        {
            if running.done.next_pass() > running.on_disk {
                self.save(job, &running.done)?;
            }
            let finished = running.done.finish();
            if self.settings.show.is_some_and(|show| !show.done(job, &finished)) {
                self.owed.push(job);
            }
            self.finished.insert(job, finished);
        }
        Ok(())
    }

    fn save(&self, job: usize, block: &Block) -> Result<()> {
        let identity = &self.jobs[job].identity;
        checkpoint::save(&checkpoint::path(self.settings.root, identity), identity, block)
    }

    fn progress(&self, job: usize) {
        if let Some(gone) = self.settings.show.and_then(|show| show.live.complaint()) {
            self.settings.progress.say(&gone);
        }
        let share = |r: &Running| r.done.next_pass() as f64 / r.passes as f64;
        let under_way: f64 = self.running.values().map(share).sum();
        let message = match self.running.get(&job) {
            Some(running) => format!("{}: {} passes", self.jobs[job].label, running.passes),
            None => self.jobs[job].label.clone(),
        };
        self.settings.progress.update(self.finished.len() as f64 + under_way, message);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (job, first pass, last) of a quadruple.
    fn order(arms: &[Arm], number: u64) -> (Vec<(usize, u64, u64)>, bool) {
        let (spans, is_whole) = quadruple(arms, number);
        (spans.iter().map(|s| (s.job, s.start, s.end)).collect(), is_whole)
    }

    #[test]
    fn rivals_are_played_in_an_order_that_cancels_drift() {
        let arm = |job, next| Arm { job, passes: 300, next };
        // 300 passes: batches of 4.
        let arms = [arm(3, 0), arm(5, 0), arm(8, 0)];
        let (spans, is_whole) = order(&arms, 1);
        assert!(is_whole);
        let expected = [(3, 8, 12), (5, 8, 12), (8, 8, 12), (8, 12, 16), (5, 12, 16), (3, 12, 16)];
        assert_eq!(spans, expected);
        // With a steady drift, the middle of the passes of every arm is at the same time.
        for job in [3, 5, 8] {
            let places = spans.iter().enumerate().filter(|(_, s)| s.0 == job).map(|(i, _)| i);
            assert_eq!(places.sum::<usize>(), 5);
        }
    }

    #[test]
    fn what_was_played_is_not_played_again() {
        let arm = |job, next| Arm { job, passes: 300, next };
        let arms = [arm(0, 10), arm(1, 16)];
        assert_eq!(order(&arms, 0), (vec![], false));
        assert_eq!(order(&arms, 1), (vec![(0, 10, 12), (0, 12, 16)], false));
        assert!(order(&arms, 2).1);
        // 75 batches: the last quadruple is a half.
        assert_eq!(order(&arms, 37), (vec![(0, 296, 300), (1, 296, 300)], false));
        assert!(order(&arms, 38).0.is_empty());
    }
}
