//! Threads that run blocks of passes and draw from samplers, and the only place where results are put in
//! order.
//!
//! Workers take the next sequence of passes from a shared source; the collector (the calling thread) appends
//! finished blocks in the order of their passes, whatever the order in which they arrive. Blocks are
//! sized by the time they take; the fixed tree over passes makes results independent of that size.
//!
//! Budgets that are not in passes need a pilot of each job ([`super::pilot`]). Workers run pilots side by side, and those of
//! later cells where the cell under way has no passes left to give.
//!
//! The estimators of a cell are interleaved, so that their CPU times can be compared. In one turn of about
//! half a second, a worker runs the same part of every arm's passes in the order A B .. B A, so that a
//! steady drift (clock rate, temperature, other load) adds the same time to each arm. Arms may have different
//! numbers of passes: a turn is a part of the run, [f, f') of each arm. A worker's first turn in a cell warms
//! it up, and a turn that an earlier process had run in part is not in that order; neither is timed
//! (`Work::settled`).
//!
//! *Why half a second.* The passes that follow those of another arm find that arm's data in the caches, which costs
//! them a fixed time, whatever the length of the turn: about half a millisecond for unidirectional passes after
//! guided subdivision on a mesh. In turns of an eighth of a second the controls of such cells took 1.4 to 2.9 %
//! longer than their baselines, and widened the intervals of all cells (`experiments/verify/snee-matrix.toml`).
//!
//! Where a claim uses CPU time, its baseline has a control arm, the same estimator on streams of its own, next
//! in the order: A C B .. B C A. Elsewhere the first arm's passes run twice in every eighth turn, A C B .. B C A:
//! C is the same work as A at another place in the order. Its scores are discarded; its time is kept
//! (`Work::twice`). Either ratio of times differs from 1 only by effects of the machine. The error of an
//! efficiency ratio contains the scatter of this control: in cells of a few seconds, 1 to 3 % with every
//! eighth turn. (With both controls, A would often follow C's run of the same numbers, which is faster.)

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::checkpoint;
use super::chi_square::{Draws, Sampled};
use super::interrupt::Interrupt;
use super::job::{Block, Finished, Job, PassRange, Start};
use super::keys::Stage;
use super::live::Show;
use super::memory_limits::has_room_for_thread;
use super::pilot;
use super::progress::Progress;
use super::turns::{Lane, Second, Span, done_everywhere, groups, last, turn};
use crate::error::{Error, Result};
use crate::experiment::schema::Budget;
use crate::results::json::hash_json;
use crate::stats::tree::batch_level;

/// How a run is carried out; nothing here changes a result.
pub(crate) struct Settings<'a> {
    /// Number of threads.
    pub threads: usize,
    /// Passes per block, where the user sets them.
    pub block_passes: Option<u64>,
    /// Whether the estimators of a cell run by turns.
    pub is_interleaved: bool,
    /// Flag that asks to stop.
    pub interrupt: &'a Interrupt,
    /// Folder of the experiment's results.
    pub root: &'a Path,
    /// Progress bar.
    pub progress: &'a Progress,
    /// Viewer of images while they are rendered.
    pub show: Option<Show<'a>>,
    /// Budget of a job with an estimator; none where there is no such job.
    pub budget: Option<&'a Budget>,
    /// Hashes of the experiment's claims, hex.
    pub claims: &'a [String],
}

/// Result of a job, and the claims made before its first pass or draw.
pub(crate) struct Completed {
    /// What was fixed before the first pass.
    pub start: Start,
    /// Result of the job.
    pub output: Output,
}

/// Result of a job.
pub(crate) enum Output {
    /// Passes of an estimator.
    Passes(Box<Finished>),
    /// Counts of a sampler's draws.
    Draws(Box<Sampled>),
}

impl Completed {
    /// The measurement, where the job is of an estimator.
    pub(crate) fn passes(&self) -> Option<&Finished> {
        match &self.output {
            Output::Passes(finished) => Some(finished),
            Output::Draws(_) => None,
        }
    }
}

/// Wall time that a block should take, seconds.
const BLOCK_SECONDS: f64 = 0.25;
/// Wall time that a turn of all arms should take, seconds.
const TURN_SECONDS: f64 = 0.5;
/// One turn in so many runs passes of the first arm twice, where no claim uses CPU time.
const CONTROL_EVERY: u64 = 8;
/// Time that workers have to come to an end of their passes after a signal.
const PATIENCE: Duration = Duration::from_millis(500);
/// Longest time between looks at the interrupt.
const LOOK: Duration = Duration::from_millis(50);
/// Time between checkpoints of a job under way.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(5);

enum Message {
    /// A job begins: its fixed properties, and the passes that an earlier run had completed.
    Begin { job: usize, start: Start, done: Box<Block>, end: u64 },
    /// A block is done.
    Block { job: usize, block: Box<Block> },
    /// A sampler is done, in this run or an earlier one.
    Sampled { job: usize, start: Start, sampled: Box<Sampled>, is_new: bool },
}

struct Queue {
    next_group: usize,
    active: Option<Active>,
    /// Of every job.
    beginnings: Vec<Beginning>,
}

/// Whether it is known what is fixed before the first pass of a job.
enum Beginning {
    Unknown,
    /// A worker finds it, maybe by a pilot.
    UnderWay,
    Known(Start),
}

/// The group of jobs under way: one, or the arms of a cell.
struct Active {
    group: usize,
    lanes: Vec<Lane>,
    /// Passes of the longest lane that were given to turns.
    given: u64,
    /// Number of the next turn.
    turn: u64,
    /// Wall time of a pass; of interleaved arms, of a pass of the longest lane with its part of the
    /// others.
    seconds_per_pass: Option<f64>,
}

/// Unit of work of a worker.
enum Unit {
    /// All draws from a sampler.
    Draws(usize),
    /// What is fixed before the first pass of a job.
    Beginning(usize),
    /// Passes of estimators.
    Passes(Turn),
}

/// Passes that a worker runs in one go.
struct Turn {
    group: usize,
    spans: Vec<Span>,
    /// Passes of the longest lane.
    passes: u64,
    /// They are passes of rivals in an order that cancels drift.
    is_balanced: bool,
}

struct Pool<'a> {
    jobs: &'a [Job],
    /// Indices of jobs that run together.
    groups: Vec<Vec<usize>>,
    /// Number of samplers.
    samplers: usize,
    settings: &'a Settings<'a>,
    queue: Mutex<Queue>,
    /// A beginning has become known.
    found: Condvar,
}

/// Runs every job and returns the results in the order of the jobs. Where the run is interrupted, all
/// states are saved first.
pub(crate) fn run_all(jobs: &[Job], settings: &Settings) -> Result<Vec<Completed>> {
    let beginnings = jobs.iter().map(|_| Beginning::Unknown).collect();
    let queue = Mutex::new(Queue { next_group: 0, active: None, beginnings });
    let samplers = jobs.iter().filter(|job| job.draws().is_some()).count();
    let groups = groups(jobs, settings.is_interleaved);
    let pool = Pool { jobs, groups, samplers, settings, queue, found: Condvar::new() };
    // Bounded: workers wait with finished blocks, so that images do not accumulate in memory.
    let (sender, receiver) = mpsc::sync_channel(settings.threads);
    std::thread::scope(|scope| {
        for number in 1..=settings.threads {
            let (pool, sender) = (&pool, sender.clone());
            let spawned = match has_room_for_thread() {
                true => std::thread::Builder::new().spawn_scoped(scope, move || pool.work(&sender)),
                false => Err(ErrorKind::OutOfMemory.into()),
            };
            if let Err(source) = spawned {
                settings.interrupt.raise();
                let what = format!("thread {number} of {}", settings.threads);
                return Err(Error::io(
                    Path::new(&what),
                    "start a thread (lower --threads or raise the limit)",
                )(source));
            }
        }
        drop(sender);
        let collected = Collector::new(jobs, settings).collect(receiver);
        if collected.is_err() {
            settings.interrupt.raise(); // workers stop; the error is reported
        }
        collected
    })
}

/// Stops the other threads where one panics: the run is lost, and they should not continue to its end.
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
        let mut warm = None;
        while let Some(unit) = self.next(sender) {
            let went_on = match unit {
                Unit::Draws(job) => self.draw(job, sender),
                Unit::Beginning(job) => self.find_beginning(job),
                Unit::Passes(turn) => {
                    let was_warm = warm.replace(turn.group) == Some(turn.group);
                    self.take_turn(&turn, was_warm, sender)
                }
            };
            if went_on.is_none() {
                return;
            }
        }
    }

    /// Runs the passes of a turn; nothing where the run ends meanwhile.
    fn take_turn(&self, turn: &Turn, is_warm: bool, sender: &mpsc::SyncSender<Message>) -> Option<()> {
        let stop = || self.settings.interrupt.raised();
        let begun = Instant::now();
        for span in &turn.spans {
            let job = self.jobs[span.job].passes()?;
            let run = || job.run(job.stage, span.start, span.end, span.keep_level, &stop);
            let before = if span.twice == Some(Second::Before) { Some(run()?) } else { None };
            let mut block = run()?;
            let after = if span.twice == Some(Second::After) { Some(run()?) } else { None };
            if turn.is_balanced && is_warm {
                block.settle(span.keep_level, before.or(after).as_ref());
            }
            sender.send(Message::Block { job: span.job, block: Box::new(block) }).ok()?;
        }
        let seconds = begun.elapsed().as_secs_f64() / turn.passes as f64;
        if let Some(active) = self.lock().active.as_mut().filter(|a| a.group == turn.group) {
            active.seconds_per_pass = Some(seconds);
        }
        Some(())
    }

    /// Draws from a sampler, unless an earlier run has; threads without a sampler help.
    fn draw(&self, index: usize, sender: &mpsc::SyncSender<Message>) -> Option<()> {
        let job = &self.jobs[index];
        let draws: &Draws = job.draws()?;
        let path = checkpoint::path(self.settings.root, &job.identity);
        let start = Start {
            claims: self.claims(checkpoint::start(&path, &job.identity).as_ref()),
            budget: String::new(),
            passes: draws.samples,
        };
        let kept = checkpoint::load_draws(&path, &job.identity, draws.samples);
        let is_new = kept.is_none();
        let threads = (self.settings.threads / self.samplers).max(1);
        let sampled = kept.or_else(|| draws.run(threads, self.settings.interrupt))?;
        let sampled = Box::new(sampled);
        sender.send(Message::Sampled { job: index, start, sampled, is_new }).ok()
    }

    /// The claims made before the first pass or draw: those of an earlier state, whether or not
    /// the job resumes from it.
    fn claims(&self, earlier: Option<&Start>) -> Vec<String> {
        earlier.map_or_else(|| self.settings.claims.to_vec(), |start| start.claims.clone())
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next unit of work: passes of the group under way; else of the next group, once all its beginnings are known; else
    /// a beginning that no worker finds yet, of this group or a later one.
    fn next(&self, sender: &mpsc::SyncSender<Message>) -> Option<Unit> {
        let mut queue = self.lock();
        loop {
            if self.settings.interrupt.raised() {
                return None;
            }
            if let Some(turn) = queue.active.as_mut().and_then(|active| self.take(active)) {
                return Some(Unit::Passes(turn));
            }
            let group = queue.next_group;
            let jobs = self.groups.get(group)?;
            if let [index] = jobs[..]
                && self.jobs[index].draws().is_some()
            {
                queue.next_group += 1;
                return Some(Unit::Draws(index));
            }
            let start = |&index: &usize| match &queue.beginnings[index] {
                Beginning::Known(start) => Some((index, start.clone())),
                _ => None,
            };
            if let Some(starts) = jobs.iter().map(start).collect::<Option<Vec<_>>>() {
                queue.next_group += 1;
                let lanes = starts.into_iter().map(|(index, start)| self.begin(index, start, sender));
                let lanes: Vec<Lane> = lanes.collect::<Option<_>>()?;
                let given = done_everywhere(&lanes);
                queue.active = Some(Active { group, lanes, given, turn: 0, seconds_per_pass: None });
                continue;
            }
            let is_open = |&&index: &&usize| {
                matches!(queue.beginnings[index], Beginning::Unknown)
                    && self.jobs[index].passes().is_some()
            };
            if let Some(&index) = self.groups[group..].iter().flatten().find(is_open) {
                queue.beginnings[index] = Beginning::UnderWay;
                return Some(Unit::Beginning(index));
            }
            let waited = self.found.wait_timeout(queue, LOOK);
            queue = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// The next passes of a group, if it has any left.
    fn take(&self, active: &mut Active) -> Option<Turn> {
        let group = active.group;
        if let [lane] = active.lanes[..] {
            let start = lane.next;
            let end = lane.end.min(start + self.block_length(active));
            active.lanes[0].next = end;
            let (keep_level, twice) = (batch_level(lane.passes), None);
            let span = Span { job: lane.job, start, end, keep_level, twice };
            let passes = end.saturating_sub(start);
            return (passes > 0).then(|| Turn { group, spans: vec![span], passes, is_balanced: false });
        }
        let longest = active.lanes.iter().map(|lane| lane.passes).max()?;
        let last = last(&active.lanes);
        while active.given < last {
            let passes = self.turn_length(active, longest, last);
            let arms = || active.lanes.iter().filter_map(|lane| self.jobs[lane.job].passes());
            let is_main = arms().all(|arm| arm.stage == Stage::Main);
            let has_control_arm = arms().any(|arm| arm.arm.is_control);
            let runs_twice =
                is_main && !has_control_arm && active.turn % CONTROL_EVERY == CONTROL_EVERY - 1;
            let (spans, is_balanced) = turn(&active.lanes, active.given, passes, runs_twice);
            active.given += passes;
            if !spans.is_empty() {
                active.turn += 1;
                return Some(Turn { group, spans, passes, is_balanced });
            }
        }
        None
    }

    /// Passes of the longest lane in the next turn: a power of two, so that turns fill batches, and at
    /// most a batch of passes, so that a warm-up costs no more.
    fn turn_length(&self, active: &Active, longest: u64, last: u64) -> u64 {
        let left = last - active.given;
        if let Some(passes) = self.settings.block_passes {
            return left.min(passes.saturating_mul(2));
        }
        let fair = left / (2 * self.settings.threads as u64);
        let timed = active.seconds_per_pass.map_or(0, |s| (TURN_SECONDS / s.max(1e-9)) as u64);
        let power = timed.min(fair).max(2).ilog2().min(active.given.trailing_zeros());
        left.min(1 << power.min(batch_level(longest)).max(1))
    }

    fn block_length(&self, active: &Active) -> u64 {
        let left = active.lanes[0].end.saturating_sub(active.lanes[0].next);
        let fair = (left / (2 * self.settings.threads as u64)).max(1);
        let timed = match active.seconds_per_pass {
            Some(seconds) => (BLOCK_SECONDS / seconds.max(1e-9)) as u64,
            None => 1,
        };
        self.settings.block_passes.unwrap_or(timed.min(fair)).max(1)
    }

    /// Fixes the passes of a job, by a pilot where its budget is not in passes; nothing where the run ends meanwhile.
    fn find_beginning(&self, index: usize) -> Option<()> {
        let passes = self.jobs[index].passes()?;
        let identity = &self.jobs[index].identity;
        let earlier = checkpoint::start(&checkpoint::path(self.settings.root, identity), identity);
        let budget = hash_json(&(self.settings.budget, &passes.terms));
        // A pilot that times itself would find another number each time.
        let count = match (passes.count, &earlier) {
            (Some(count), _) => count,
            (None, Some(earlier)) if earlier.budget == budget => earlier.passes,
            _ => pilot::passes(passes, self.settings.budget?, &|| self.settings.interrupt.raised())?,
        };
        let start = Start { claims: self.claims(earlier.as_ref()), budget, passes: count };
        self.lock().beginnings[index] = Beginning::Known(start);
        self.found.notify_all();
        Some(())
    }

    /// Begins a job: finds which of its passes are done. Other workers wait meanwhile.
    fn begin(&self, index: usize, start: Start, sender: &mpsc::SyncSender<Message>) -> Option<Lane> {
        let (identity, count) = (&self.jobs[index].identity, start.passes);
        let keep_level = batch_level(count);
        // Where a state has too many passes, or keeps them too coarsely, its passes run again.
        let part = self.jobs[index].passes()?.part;
        let PassRange { start: from, end } = part.unwrap_or(PassRange { start: 0, end: count });
        let path = checkpoint::path(self.settings.root, identity);
        let mut done = checkpoint::load_passes(&path, identity, from, keep_level)
            .filter(|block| block.next_pass() <= end)
            .unwrap_or_else(|| Block::empty(from, keep_level));
        let next = done.next_pass();
        done.tally.processes += u64::from(next < end);
        sender.send(Message::Begin { job: index, start, done: Box::new(done), end }).ok()?;
        Some(Lane { job: index, passes: count, next, end })
    }
}

/// Appends blocks in the order of their passes.
struct Collector<'a> {
    jobs: &'a [Job],
    settings: &'a Settings<'a>,
    completed: BTreeMap<usize, Completed>,
    under_way: BTreeMap<usize, UnderWay>,
    /// Jobs whose last image could not be queued for the viewer.
    owed: Vec<usize>,
}

struct UnderWay {
    start: Start,
    done: Block,
    /// The pass after its last.
    end: u64,
    /// Passes that the state on disk holds.
    on_disk: u64,
    /// Blocks that came before their turn, by first pass.
    early: BTreeMap<u64, Block>,
    saved: Instant,
}

impl<'a> Collector<'a> {
    fn new(jobs: &'a [Job], settings: &'a Settings<'a>) -> Collector<'a> {
        let (completed, under_way) = (BTreeMap::new(), BTreeMap::new());
        Collector { jobs, settings, completed, under_way, owed: Vec::new() }
    }

    fn collect(mut self, receiver: mpsc::Receiver<Message>) -> Result<Vec<Completed>> {
        // Owned: where this returns early, waiting senders fail instead of blocking for ever.
        let (mut stopped, mut is_kept) = (None, false);
        loop {
            if self.settings.interrupt.raised() && !is_kept {
                let stopped = stopped.get_or_insert_with(Instant::now);
                // A pass or a set-up under way may take long, and is lost anyway.
                if stopped.elapsed() > PATIENCE {
                    self.save_all()?;
                    self.settings.interrupt.kept(self.what_is_kept());
                    is_kept = true;
                }
            }
            let message = match receiver.recv_timeout(LOOK) {
                Ok(message) => message,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let job = match message {
                Message::Begin { job, start, done, end } => {
                    let (early, saved) = (BTreeMap::new(), Instant::now());
                    let on_disk = done.next_pass();
                    self.under_way
                        .insert(job, UnderWay { start, done: *done, end, on_disk, early, saved });
                    job
                }
                Message::Block { job, block } => {
                    let has_grown = self.take(job, *block)?;
                    let running = self.under_way.get(&job).filter(|_| has_grown);
                    if let (Some(show), Some(running)) = (self.settings.show, running) {
                        show.under_way(job, &running.done);
                    }
                    job
                }
                Message::Sampled { job, start, sampled, is_new } => {
                    if is_new {
                        let identity = &self.jobs[job].identity;
                        let path = checkpoint::path(self.settings.root, identity);
                        checkpoint::save_draws(&path, identity, &start, &sampled)?;
                    }
                    self.completed.insert(job, Completed { start, output: Output::Draws(sampled) });
                    job
                }
            };
            self.close_if_done(job)?;
            self.progress(job);
        }
        if self.completed.len() == self.jobs.len() {
            let owed = self.owed.iter().filter_map(|job| Some((*job, self.completed[job].passes()?)));
            let owed: Vec<(usize, &Finished)> = owed.collect();
            let slow = self.settings.show.and_then(|show| show.close(&owed));
            let gone = self.settings.show.and_then(|show| show.live.complaint());
            slow.iter().chain(&gone).for_each(|what| self.settings.progress.say(what));
            return Ok(self.completed.into_values().collect());
        }
        self.save_all()?;
        Err(Error::Interrupted(self.what_is_kept()))
    }

    /// Saves the states of all jobs under way.
    fn save_all(&self) -> Result<()> {
        self.under_way.iter().try_for_each(|(&job, running)| self.save(job, running))
    }

    /// Message for the user who stopped the run.
    fn what_is_kept(&self) -> String {
        format!(
            "{} of {} measurements are complete and the passes done of the others are kept in {}; the same \
             command resumes from there",
            self.completed.len(),
            self.jobs.len(),
            self.settings.root.display()
        )
    }

    /// Takes a block; true where passes were appended, of this block or of others that waited for it.
    fn take(&mut self, job: usize, block: Block) -> Result<bool> {
        let Some(running) = self.under_way.get_mut(&job) else { return Ok(false) };
        let before = running.done.next_pass();
        running.early.insert(block.moments.start(), block);
        while let Some(next) = running.early.remove(&running.done.next_pass()) {
            running.done.append(next);
        }
        let has_grown = running.done.next_pass() > before;
        if running.saved.elapsed() > CHECKPOINT_EVERY {
            running.saved = Instant::now();
            self.save(job, &self.under_way[&job])?;
        }
        Ok(has_grown)
    }

    fn close_if_done(&mut self, job: usize) -> Result<()> {
        if self.under_way.get(&job).is_some_and(|r| r.done.next_pass() == r.end)
            && let Some(running) = self.under_way.remove(&job)
        {
            if running.done.next_pass() > running.on_disk {
                self.save(job, &running)?;
            }
            let finished = Box::new(running.done.finish());
            if self.settings.show.is_some_and(|show| !show.done(job, &finished)) {
                self.owed.push(job);
            }
            let output = Output::Passes(finished);
            self.completed.insert(job, Completed { start: running.start, output });
        }
        Ok(())
    }

    fn save(&self, job: usize, running: &UnderWay) -> Result<()> {
        let identity = &self.jobs[job].identity;
        let path = checkpoint::path(self.settings.root, identity);
        checkpoint::save_passes(&path, identity, &running.start, &running.done)
    }

    fn progress(&self, job: usize) {
        if let Some(gone) = self.settings.show.and_then(|show| show.live.complaint()) {
            self.settings.progress.say(&gone);
        }
        let share = |r: &UnderWay| {
            let from = r.done.moments.start();
            (r.done.next_pass() - from) as f64 / (r.end - from).max(1) as f64
        };
        let under_way: f64 = self.under_way.values().map(share).sum();
        let message = match self.under_way.get(&job) {
            Some(running) => format!("{}: {} passes", self.jobs[job].title, running.start.passes),
            None => self.jobs[job].title.clone(),
        };
        self.settings.progress.update(self.completed.len() as f64 + under_way, message);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::estimators::{Estimator, Scores};
    use crate::experiment::registry::Registry;
    use crate::experiment::{self, LoadOptions};
    use crate::run::job::Task;
    use crate::run::parallel::rendezvous::Rendezvous;
    use crate::run::plan;
    use crate::sampling::stream::PassKey;

    /// An estimator whose first pass, which is one of its pilot, waits for that of another.
    struct Meeting {
        place: Arc<Rendezvous>,
        has_begun: AtomicBool,
    }

    impl Estimator for Meeting {
        fn pass(&self, _: &[usize], _: &PassKey, scores: &mut Scores) {
            scores.observables[0] += 1.0;
            if !self.has_begun.swap(true, Ordering::Relaxed) {
                self.place.wait();
            }
        }
    }

    /// Pilots of two estimators of a cell, and of two groups.
    #[test]
    fn pilots_run_side_by_side() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/compare/nine-cells.toml");
        let sets = vec![
            "budget={ relative_error = { at_most = 0.1 } }".into(),
            "estimator=[{ name = 'a', path = {} }, { name = 'b', path = {} }]".into(),
        ];
        let registry = Registry::builtin();
        let experiment =
            experiment::load(file.as_ref(), &LoadOptions { sets, setting: None }, &registry)
                .expect("valid");
        for is_interleaved in [true, false] {
            let mut plan = plan(&experiment, &registry, 2).expect("a plan");
            plan.jobs.truncate(2);
            let place = Arc::new(Rendezvous::of(2));
            for job in &mut plan.jobs {
                let Task::Estimate(passes) = &mut job.task else { panic!("passes") };
                assert_eq!(passes.cell, 0);
                let has_begun = AtomicBool::new(false);
                passes.estimator = Arc::new(Meeting { place: Arc::clone(&place), has_begun });
                passes.groups.truncate(1);
            }
            let folder = tempfile::tempdir().expect("a folder");
            checkpoint::prepare(folder.path()).expect("a folder of states");
            let settings = Settings {
                threads: 2,
                block_passes: None,
                is_interleaved,
                interrupt: &Interrupt::default(),
                root: folder.path(),
                progress: &Progress::new(2, true),
                show: None,
                budget: experiment.file.budget.as_ref(),
                claims: &[],
            };
            let completed = run_all(&plan.jobs, &settings).expect("complete");
            let passes: Vec<u64> = completed.iter().map(|one| one.start.passes).collect();
            // Every pass gives the same.
            assert_eq!(passes, [pilot::LEAST_PASSES; 2]);
            assert_eq!(place.state(), (2, 0), "one waited in vain");
        }
    }
}
