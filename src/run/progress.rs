//! Progress with an estimate of the time left, on terminals only. The only module that uses `indicatif`.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Steps of the bar per job: jobs count alike, passes are fractions of them.
const STEPS: u64 = 1000;

/// A bar on standard error, or nothing where that is no terminal.
pub(crate) struct Progress {
    bar: ProgressBar,
    jobs: usize,
}

impl Progress {
    /// For a number of jobs.
    pub(crate) fn new(jobs: usize, quiet: bool) -> Progress {
        let shown = !quiet && std::io::stderr().is_terminal();
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(jobs as u64 * STEPS), target);
        let style = "{prefix}: {wide_msg} [{bar:16}] {percent:>3}%  {elapsed}, {eta} left";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(250));
        let progress = Progress { bar, jobs };
        progress.update(0.0, String::new());
        progress
    }

    /// Jobs finished, the fraction of those under way, and what is being done.
    pub(crate) fn update(&self, jobs_done: f64, message: String) {
        self.bar.set_prefix(format!("job {} of {}", (jobs_done as usize + 1).min(self.jobs), self.jobs));
        self.bar.set_message(message);
        self.bar.set_position((jobs_done * STEPS as f64) as u64);
    }

    /// Tells something on standard error, bar or not.
    pub(crate) fn say(&self, what: &str) {
        // Nobody is left to tell where it cannot be written.
        self.bar.suspend(|| drop(writeln!(io::stderr(), "{what}")));
    }

    /// Removes the progress bar.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
