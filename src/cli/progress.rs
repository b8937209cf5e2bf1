//! Progress: a bar on a terminal, now and then a plain line elsewhere.

use crate::integrators::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Time between plain lines.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Shows how far a job is, on standard error.
pub(super) enum Reporter {
    Bar(ProgressBar),
    Lines { what: String, last: Instant },
}

impl Reporter {
    /// A reporter for the job `what`.
    pub(super) fn new(what: &str) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self::Lines { what: what.to_owned(), last: Instant::now() };
        }
        let bar = ProgressBar::new(1000).with_message(what.to_owned());
        if let Ok(style) =
            ProgressStyle::with_template("{msg:>12} [{bar:40}] {percent:>3}% {elapsed} (eta {eta}) {prefix}")
        {
            bar.set_style(style.progress_chars("=> "));
        }
        Self::Bar(bar)
    }

    /// Shows `progress`.
    pub(super) fn update(&mut self, progress: Progress) {
        let error = progress.error.map_or_else(String::new, |share| format!(", error {:.2} %", share * 100.0));
        match self {
            Self::Bar(bar) => {
                bar.set_prefix(format!("{} passes{error}", progress.passes));
                bar.set_position((progress.fraction * 1000.0) as u64);
            }
            Self::Lines { what, last } if last.elapsed() >= LINE_EVERY => {
                eprintln!("{what}: {:.0} %, {} passes{error}", progress.fraction * 100.0, progress.passes);
                *last = Instant::now();
            }
            Self::Lines { .. } => {}
        }
    }

    /// Ends the job.
    pub(super) fn finish(self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}
