//! Progress on a terminal, silence elsewhere.
//!
//! What it is: one bar that takes a share from 0 to 1; of a simulation that will take long a line before it starts ([`foretell`]).
//! What can go wrong: nothing; where stderr is no terminal it draws nothing.
//! Units: share of the work; s.
//! Reference: indicatif.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;

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

/// Work that takes longer than this is announced, s.
const LONG_S: f64 = 10.0;

/// Says before a simulation how long it will take, where that is long: so many seconds of a run, at so many times real time.
pub(crate) fn foretell(run_s: f64, times: f64, quiet: bool) {
    if let Some(line) = outlook(run_s, times).filter(|_| !quiet) {
        note!("{line}");
    }
}

fn outlook(run_s: f64, times: f64) -> Option<String> {
    let takes_s = run_s / times;
    (takes_s >= LONG_S).then(|| {
        let by = if takes_s.is_finite() { format!("about {}", duration(takes_s)) } else { "without an end".to_owned() };
        format!("{} of a run, at {} times real time: {by}", duration(run_s), significant(times))
    })
}

/// Work whose length nobody knows before it begins: its first seconds tell, and one line says it.
pub(crate) struct Outlook {
    begun: Instant,
    said: bool,
}

/// Time after which the share that is done tells how long the rest takes, s.
const TELLS_S: f64 = 3.0;

impl Outlook {
    /// From now on.
    pub(crate) fn new(quiet: bool) -> Self {
        Self { begun: Instant::now(), said: quiet }
    }

    /// Says once how long the work takes, if that is long.
    pub(crate) fn say(&mut self, share: f64) {
        let past_s = self.begun.elapsed().as_secs_f64();
        if !self.said && past_s >= TELLS_S && share > 0.0 {
            self.said = true;
            rest(past_s, share).into_iter().for_each(|line| note!("{line}"));
        }
    }
}

fn rest(past_s: f64, share: f64) -> Option<String> {
    let whole_s = past_s / share.min(1.0);
    (whole_s >= LONG_S).then(|| format!("{:.0} % done: about {} in all", 100.0 * share.min(1.0), duration(whole_s)))
}

/// A time as people say it.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 6_000.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3_600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

/// Two digits are enough for a guess.
fn significant(value: f64) -> String {
    if value >= 10.0 { format!("{:.0}", (value / 10.0).round() * 10.0) } else { format!("{value:.1}") }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_work_is_announced() {
        assert_eq!(outlook(300.0, 100.0), None);
        assert_eq!(outlook(36_000.0, 204.0).as_deref(), Some("10.0 h of a run, at 200 times real time: about 3 min"));
        assert_eq!(outlook(86_400.0, 1.0).as_deref(), Some("24.0 h of a run, at 1.0 times real time: about 24.0 h"));
        assert_eq!(outlook(50.0, 2.5).as_deref(), Some("50 s of a run, at 2.5 times real time: about 20 s"));
        assert_eq!((rest(3.0, 0.5), rest(3.0, 0.02).as_deref()), (None, Some("2 % done: about 2 min in all")));
    }
}
