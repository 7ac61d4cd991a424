//! What the user sees while the command works: stages, warnings, the one error. All on standard error; nothing moves
//! when it is not a terminal.

#![expect(clippy::print_stderr, reason = "this is the place that prints")]

use std::cell::RefCell;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Collects warnings and shows the stage that is running.
pub(crate) struct Reporter {
    quiet: bool,
    bar: ProgressBar,
    warnings: RefCell<Vec<String>>,
}

impl Reporter {
    pub(crate) fn new(quiet: bool) -> Self {
        let visible = !quiet && std::io::stderr().is_terminal();
        let target = if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(None, target);
        Self { quiet, bar, warnings: RefCell::default() }
    }

    /// Prints a warning and keeps it for the report.
    pub(crate) fn warn(&self, warning: String) {
        if !self.quiet {
            self.bar.suspend(|| eprintln!("warning: {warning}"));
        }
        self.warnings.borrow_mut().push(warning);
    }

    /// Every warning so far.
    pub(crate) fn warnings(&self) -> Vec<String> {
        self.warnings.borrow().clone()
    }

    /// Prints a line of the summary.
    pub(crate) fn say(&self, line: &str) {
        if !self.quiet {
            self.bar.suspend(|| eprintln!("{line}"));
        }
    }

    /// Runs a stage with its name on show, and says how long it took in milliseconds.
    pub(crate) fn stage<T>(&self, name: &str, work: impl FnOnce() -> T) -> (T, f64) {
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {elapsed}") {
            self.bar.set_style(style);
        }
        self.bar.set_message(name.to_owned());
        self.bar.enable_steady_tick(Duration::from_millis(100));
        let start = Instant::now();
        let result = work();
        let elapsed = start.elapsed();
        self.bar.disable_steady_tick();
        (result, elapsed.as_secs_f64() * 1e3)
    }

    /// Shows what the running stage is at.
    pub(crate) fn now(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    /// Shows how far the running stage is, from 0 to 1.
    pub(crate) fn fraction(&self, done: f32) {
        show_fraction(&self.bar, done);
    }

    /// [`Self::fraction`], for any thread.
    pub(crate) fn fractions(&self) -> impl Fn(f32) + Sync + use<> {
        let bar = self.bar.clone();
        move |done| show_fraction(&bar, done)
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn show_fraction(bar: &ProgressBar, done: f32) {
    const STEPS: f32 = 1000.0;
    if bar.length().is_none() {
        bar.set_length(1000);
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} [{bar:30}] {percent}% {elapsed}") {
            bar.set_style(style.progress_chars("=> "));
        }
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 1000")]
    bar.set_position((done.clamp(0.0, 1.0) * STEPS) as u64);
}

impl Drop for Reporter {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Prints the one error that ends the command.
pub(crate) fn error(error: &anyhow::Error) {
    // Causes are part of the messages themselves; a chain would say things twice.
    eprintln!("error: {error}");
}
