//! Signals. The only module that uses `signal-hook`.
//!
//! Ctrl-C (SIGINT), SIGTERM, SIGHUP (a terminal that was closed) and SIGXCPU (a limit of CPU time) request the end of the
//! process. While passes run, completed passes are saved first. Everywhere else, as in loading a mesh or writing a report,
//! the process ends at once: its files appear whole or not at all, and even a killed run loses nothing. A second signal ends
//! the process at once everywhere, except SIGXCPU, which arrives every second. SIGXFSZ, which a file-size limit sends, is
//! caught so that the write itself fails with an error that can be reported.

use std::fs;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, sleep};
use std::time::Duration;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::{flag, low_level};

/// Exit code of an interrupted process.
const INTERRUPTED: i32 = 130;
/// Time in which a stopped run may end by itself, and say more than this module knows.
const GRACE: Duration = Duration::from_secs(1);
/// Time between looks at how far a run has come.
const LOOK: Duration = Duration::from_millis(20);

/// Whether a stop was requested, and what must be done first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interrupt {
    raised: Arc<AtomicBool>,
    duty: Arc<Mutex<Duty>>,
}

/// What must be done before the process ends.
#[derive(Clone, Debug, Default)]
enum Duty {
    /// Nothing.
    #[default]
    None,
    /// Passes under way must be kept.
    Passes,
    /// They are kept; what there is to say.
    Kept(String),
}

/// Passes run while this lives.
pub(crate) struct DutyGuard<'a>(&'a Interrupt);

impl Drop for DutyGuard<'_> {
    fn drop(&mut self) {
        let mut duty = self.0.duty();
        if matches!(*duty, Duty::Passes) {
            *duty = if self.0.raised() { Duty::Kept(GENERAL.into()) } else { Duty::None };
        }
    }
}

/// What is true wherever a process ends at once.
const GENERAL: &str = "what was complete is kept; the same command resumes from there";

impl Interrupt {
    /// Listens to the process's signals from now on.
    pub(crate) fn listen() -> io::Result<Interrupt> {
        let interrupt = Interrupt::default();
        let mut heard = vec![SIGINT, SIGTERM, SIGXCPU];
        // `nohup` ignores SIGHUP, and so does the program then.
        if !is_ignored(SIGHUP) {
            heard.push(SIGHUP);
        }
        for &signal in &heard {
            // Order matters: the first signal finds the flag down and only raises it.
            if signal != SIGXCPU {
                flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(&interrupt.raised))?;
            }
            flag::register(signal, Arc::clone(&interrupt.raised))?;
        }
        flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
        let mut signals = Signals::new(&heard)?;
        let watched = interrupt.clone();
        Builder::new().name("signals".into()).spawn(move || {
            if signals.forever().next().is_some() {
                watched.end();
            }
        })?;
        Ok(interrupt)
    }

    /// Has the signal come?
    pub(crate) fn raised(&self) -> bool {
        self.raised.load(Ordering::Relaxed)
    }

    /// Raises the flag, as a signal would.
    pub(crate) fn raise(&self) {
        self.raised.store(true, Ordering::Relaxed);
    }

    /// Passes run from now on, and have to be kept before the process may end.
    pub(crate) fn running(&self) -> DutyGuard<'_> {
        *self.duty() = Duty::Passes;
        DutyGuard(self)
    }

    /// Everything that was run is kept: the process may end, even where a pass is still under way.
    pub(crate) fn kept(&self, message: String) {
        *self.duty() = Duty::Kept(message);
    }

    fn duty(&self) -> MutexGuard<'_, Duty> {
        self.duty.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the process as soon as nothing is lost by it.
    fn end(&self) -> ! {
        let message = loop {
            let duty = self.duty().clone();
            match duty {
                Duty::None => break GENERAL.to_string(),
                Duty::Kept(message) => {
                    sleep(GRACE);
                    break message;
                }
                Duty::Passes => {}
            }
            sleep(LOOK);
        };
        // Nobody is left to tell where it cannot be written.
        let _ = writeln!(io::stderr(), "interrupted: {message}");
        low_level::exit(INTERRUPTED)
    }
}

/// Whether the process was started with the signal ignored.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
