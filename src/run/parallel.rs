//! Independent work on several threads, with results in a fixed order.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{Builder, scope};

use super::memory_limits::has_room_for_thread;

/// `work(0)`, `work(1)`, .., `work(count - 1)`, in this order. The calling thread works, and others beside it, up to `threads` in
/// all: a thread that the system refuses is done without.
///
/// # Panics
/// Where `work` does.
pub(crate) fn in_parallel<R: Send>(
    threads: usize,
    count: usize,
    work: impl Fn(usize) -> R + Sync,
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return done;
            }
            done.push((index, work(index)));
        }
    };
    let mut done = scope(|scope| {
        let spawn = |_| match has_room_for_thread() {
            true => Builder::new().spawn_scoped(scope, worker).ok(),
            false => None,
        };
        let others: Vec<_> = (1..threads.min(count)).filter_map(spawn).collect();
        let mut done = worker();
        for other in others {
            match other.join() {
                Ok(more) => done.extend(more),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        done
    });
    done.sort_unstable_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Where threads of tests wait for each other.
#[cfg(test)]
pub(super) mod rendezvous {
    use std::sync::{Condvar, Mutex};
    use std::time::Duration;

    /// Groups of so many threads meet in it, one group after the other. Unlike at a barrier, nobody waits for ever.
    pub(in crate::run) struct Rendezvous {
        size: usize,
        /// How many have come, and how many of them waited in vain.
        state: Mutex<(usize, usize)>,
        comes: Condvar,
    }

    impl Rendezvous {
        pub(in crate::run) fn of(size: usize) -> Rendezvous {
            Rendezvous { size, state: Mutex::default(), comes: Condvar::new() }
        }

        /// Waits, 10 s at most, until the others of the group have come.
        pub(in crate::run) fn wait(&self) {
            let mut state = self.state.lock().expect("no panic");
            let all = (state.0 / self.size + 1) * self.size;
            state.0 += 1;
            self.comes.notify_all();
            let is_missed = |state: &mut (usize, usize)| state.0 < all;
            let waited = self.comes.wait_timeout_while(state, Duration::from_secs(10), is_missed);
            let (mut state, timeout) = waited.expect("no panic");
            state.1 += usize::from(timeout.timed_out());
        }

        /// How many have come, and how many of them waited in vain.
        pub(in crate::run) fn state(&self) -> (usize, usize) {
            *self.state.lock().expect("no panic")
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Mutex;
    use std::thread;

    use super::rendezvous::Rendezvous;
    use super::*;

    #[test]
    fn results_are_in_order_for_any_number_of_threads() {
        for (threads, count) in [(0, 3), (1, 5), (2, 1), (3, 100), (8, 3), (4, 0)] {
            let squares: Vec<usize> = (0..count).map(|i| i * i).collect();
            assert_eq!(in_parallel(threads, count, |i| i * i), squares, "{threads} threads");
        }
        // Two threads that wait for each other take turns: each has one of the first two pieces and one of the last two.
        let together = Rendezvous::of(2);
        let pieces = in_parallel(2, 4, |i| {
            together.wait();
            i
        });
        assert_eq!((pieces, together.state()), (vec![0, 1, 2, 3], (4, 0)));
    }

    #[test]
    fn as_many_threads_work_as_are_asked_for() {
        // Three pieces of work that wait for each other.
        let (together, seen) = (Rendezvous::of(3), Mutex::new(BTreeSet::new()));
        in_parallel(3, 3, |_| {
            together.wait();
            let is_new = seen.lock().expect("no panic").insert(format!("{:?}", thread::current().id()));
            assert!(is_new, "one thread did two pieces");
        });
        assert_eq!(together.state(), (3, 0));
        let own = format!("{:?}", thread::current().id());
        let of_one = in_parallel(1, 3, |_| format!("{:?}", thread::current().id()));
        assert_eq!(of_one, vec![own; 3]);
    }

    #[test]
    fn panics_are_passed_on() {
        let caught = std::panic::catch_unwind(|| in_parallel(2, 4, |i| assert!(i != 3, "piece {i}")));
        caught.expect_err("the fourth piece panics");
    }
}
