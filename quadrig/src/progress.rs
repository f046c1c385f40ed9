//! Progress on a terminal, silence elsewhere.
//!
//! What it is: one bar that takes a share from 0 to 1.
//! What can go wrong: nothing; where stderr is no terminal it draws nothing.
//! Units: share of the work.
//! Reference: indicatif.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;

/// A bar for work that may take longer than a second.
pub(crate) struct Bar(Option<ProgressBar>);

impl Bar {
    /// A bar with a word in front of it; silent when `quiet` or where stderr is no terminal.
    pub(crate) fn new(what: &str, quiet: bool) -> Self {
        if quiet || !std::io::stderr().is_terminal() {
            return Self(None);
        }
        let bar = ProgressBar::new(1000).with_message(what.to_owned());
        if let Ok(style) = ProgressStyle::with_template("{msg:<12} [{bar:40}] {percent:>3} % {elapsed}") {
            bar.set_style(style.progress_chars("=> "));
        }
        Self(Some(bar))
    }

    /// Moves the bar.
    pub(crate) fn set(&self, share: f64) {
        if let Some(bar) = &self.0 {
            bar.set_position((share.clamp(0.0, 1.0) * 1000.0) as u64);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
