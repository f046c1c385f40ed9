//! Messages of a board as they become a log.
//!
//! What it is: waits until the board has said who it is, how its codes are meant and what its configuration is; then a head, and from there
//! on a row for each sample and a line for each event, as they come.
//! What can go wrong: a board whose clock begins anew was reset: the log goes on and says so. What finds no room is [`crate::spool`]'s.
//! Units: as in the log.
//! Reference: specification `formats.md`, "Rig log".

use super::columns::Columns;
use super::inquiry::Inquiry;
use crate::Failure;
use crate::board::Board;
use crate::evidence;
use crate::spool::Spool;
use crate::view::Recorded;
use firmware_rig::RigConfig;
use frame::Consensus;
use frame::calibration::{Calibration, Converted};
use frame::message::{Command, Event, Hello, Message};
use frame::rig::{CAPTURE_NAMES, FaultSet, RigSample, RigState};
use frame::units::Ticks;
use ident::log::event_line;
use std::io::Write;
use std::time::Duration;

/// Samples before the head is written: they tell the rate.
const HEAD_AFTER: usize = 3;

/// Time between two samples from which on it is told, s: the longest that a board can be set to, and more.
const GAP_S: f64 = 2.0;

/// An event that waits for the sample after it, which says which channels it is about.
#[derive(Debug)]
struct Pending {
    event: Event,
    /// Faults that were latched before it.
    before: FaultSet,
    /// Time of the last row when it came, s: its time, where it does not say.
    after_s: f64,
}

/// Turns messages into rows of a log.
pub(crate) struct Recorder {
    spool: Spool,
    head: Vec<(String, toml::Value)>,
    calibration: Option<Calibration>,
    board: Option<Hello>,
    inquiry: Inquiry,
    raw: bool,
    columns: Option<Columns>,
    early: Vec<RigSample>,
    first: Option<Ticks>,
    offset_s: f64,
    last_s: f64,
    /// The sample of the last row.
    before: Option<RigSample>,
    latched: FaultSet,
    pending: Vec<Pending>,
    /// Rows so far.
    pub(crate) rows: usize,
    /// Sum of squares, worst and number of each channel's deviation from the consensus.
    deviation: [(f64, f64, u32); 4],
    /// What is to be told and was not yet.
    notes: Vec<String>,
}

impl Recorder {
    /// A recorder into `target`, with `head` in the head of the log, and the raw codes beside the readings where `raw` says so.
    pub(crate) fn new(target: &std::path::Path, head: Vec<(String, toml::Value)>, raw: bool) -> Result<Self, Failure> {
        Ok(Self {
            spool: Spool::create(target)?,
            head,
            calibration: None,
            board: None,
            inquiry: Inquiry::default(),
            raw,
            columns: None,
            early: Vec::new(),
            first: None,
            offset_s: 0.0,
            last_s: -1.0,
            before: None,
            latched: FaultSet::NONE,
            pending: Vec::new(),
            rows: 0,
            deviation: [(0.0, 0.0, 0); 4],
            notes: Vec::new(),
        })
    }

    /// Nothing worth keeping was heard: no file is left behind.
    pub(crate) fn discard(self) {
        self.spool.discard();
    }

    /// The board has told how its codes are meant.
    pub(crate) fn knows_its_board(&self) -> bool {
        self.calibration.is_some()
    }

    /// What is to be asked of the board at `now` (time of its port), for the head of the log.
    pub(crate) fn question(&mut self, now: Duration) -> Option<Command> {
        let question = self.knows_its_board().then(|| self.inquiry.question(now)).flatten();
        if self.inquiry.is_over() {
            self.begin();
        }
        question
    }

    /// Time of the last row, s.
    pub(crate) fn seconds(&self) -> f64 {
        self.last_s
    }

    /// Takes one message.
    pub(crate) fn take(&mut self, message: &Message) {
        match message {
            Message::Calibration(calibration) => self.recalibrate(calibration),
            Message::Rig(sample) if self.columns.is_some() => self.row(sample),
            Message::Rig(sample) => {
                self.early.push(*sample);
                self.begin();
            }
            Message::Hello(hello) if self.columns.is_none() => self.board = Some(*hello),
            Message::Hello(hello) => self.meet(hello),
            Message::ConfigPart(part) => {
                self.inquiry.take(part);
                self.begin();
            }
            Message::Event(event) => self.note(event),
            _ => {}
        }
    }

    /// The board says who it is in mid-log: after a reset, or because it was configured anew.
    fn meet(&mut self, hello: &Hello) {
        if self.board.replace(*hello).is_some_and(|before| before.config != hello.config) {
            self.tell(self.last_s, &format!("another configuration is in force: {:08x}", hello.config));
        }
    }

    fn recalibrate(&mut self, calibration: &Calibration) {
        let old = self.calibration.replace(*calibration);
        if self.columns.is_none() {
            self.begin();
        } else if let Some(words) = old.and_then(|old| evidence::recalibrated(&old, calibration)) {
            self.tell(self.last_s, &words);
        }
    }

    /// Keeps an event until the sample after it.
    fn note(&mut self, event: &Event) {
        let before = self.latched;
        match event {
            Event::Faults { faults, .. } => {
                self.latched = *faults;
            }
            Event::State { from: RigState::Faulted, .. } => self.latched = FaultSet::NONE,
            _ => {}
        }
        self.pending.push(Pending { event: *event, before, after_s: self.last_s.max(0.0) });
    }

    /// Writes the events that waited, now that the sample after them is known, or that none will come.
    fn tell_pending(&mut self, sample: Option<&RigSample>) {
        for Pending { event, before, after_s } in std::mem::take(&mut self.pending) {
            let Some(words) = evidence::words(&event, before, sample) else { continue };
            let at = evidence::instant(&event).zip(self.first);
            let t_s = at.map_or(after_s, |(at, first)| self.offset_s + (at.as_s() - first.as_s()));
            self.tell(t_s, &words);
        }
    }

    fn tell(&mut self, t_s: f64, words: &str) {
        self.write(&(event_line(&evidence::timed(t_s, words)) + "\n"));
    }

    fn write(&mut self, lines: &str) {
        self.notes.extend(self.spool.add(lines));
    }

    /// What is to be told since the last time.
    pub(crate) fn notes(&mut self) -> impl Iterator<Item = String> {
        std::mem::take(&mut self.notes).into_iter()
    }

    /// The recording as the view shows it.
    pub(crate) fn shown(&self) -> Recorded {
        Recorded { file: self.spool.name(), rows: self.rows, waiting: self.spool.waits() }
    }

    /// The board's configuration as the recording began, once it is known.
    pub(crate) fn config(&self) -> Option<&RigConfig> {
        self.inquiry.found()
    }

    /// Writes the head once the scales, the rate and the configuration are known, and the rows that came before.
    fn begin(&mut self) {
        if self.columns.is_some() || self.early.len() < HEAD_AFTER || !self.inquiry.is_over() {
            return;
        }
        self.begin_anyhow();
    }

    /// The same without the configuration.
    fn begin_anyhow(&mut self) {
        let Some(calibration) = self.calibration.filter(|_| self.columns.is_none() && !self.early.is_empty()) else { return };
        let columns = Columns::of(self.board.as_ref(), &calibration, self.raw);
        let early = std::mem::take(&mut self.early);
        let steps: Vec<f64> = early.windows(2).map(|w| w[1].at.since(w[0].at).as_s()).collect();
        let step = steps.iter().copied().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        let mut text = String::from("# quadrig-log 1\n");
        let told = evidence::head(self.board.as_ref(), &calibration, self.inquiry.found());
        for (key, value) in self.head.iter().chain(&told) {
            text.push_str(&evidence::line(key, value));
        }
        if step.is_finite() {
            text.push_str(&evidence::line("sample_hz", &toml::Value::Float((1.0 / step * 100.0).round() / 100.0)));
        }
        text.push_str(&columns.names());
        self.write(&text);
        self.columns = Some(columns);
        early.iter().for_each(|sample| self.row(sample));
    }

    fn row(&mut self, sample: &RigSample) {
        let (Some(calibration), Some(columns)) = (self.calibration, &self.columns) else { return };
        let first = *self.first.get_or_insert(sample.at);
        let mut news = None;
        if sample.at < first || self.offset_s + sample.at.since(first).as_s() <= self.last_s {
            // the board was reset: its clock begins anew, the log's goes on a step later
            self.first = Some(sample.at);
            self.offset_s = self.last_s + 0.1;
            news = Some("the board was reset; the log goes on");
        }
        let t_s = self.offset_s + sample.at.since(self.first.unwrap_or(first)).as_s();
        let values = calibration.convert(sample);
        let cells = columns.cells(t_s, sample, &values, self.before.replace(*sample).as_ref());
        if let Some(news) = news {
            self.notes.push(news.to_owned());
            self.latched = FaultSet::NONE;
            self.tell(t_s, "the board was reset");
        } else if self.rows > 0 && t_s - self.last_s > GAP_S {
            self.tell(t_s, &format!("no sample for {:.1} s before this one", t_s - self.last_s));
        }
        self.tell_pending(Some(sample));
        self.write(&cells);
        self.rows += 1;
        self.last_s = t_s;
        self.watch(sample, &values);
    }

    /// The account of disagreement.
    fn watch(&mut self, sample: &RigSample, values: &Converted) {
        let consensus = Consensus::of(&values.rpm, &sample.rpm.map(|c| c.verdict));
        if let Some(consensus) = &consensus {
            for ((square, worst, n), deviation) in self.deviation.iter_mut().zip(consensus.deviation) {
                if let Some(d) = deviation {
                    *square += d * d;
                    *worst = worst.max(d.abs());
                    *n += 1;
                }
            }
        }
    }

    /// Ends the log; one line of summary for people.
    pub(crate) fn finish(mut self, board: &Board, quiet: bool) -> Result<(), Failure> {
        self.begin_anyhow();
        self.tell_pending(None);
        let stats = board.stats();
        if self.rows == 0 {
            self.spool.discard();
            return Err(unheard(stats.good).into());
        }
        if !quiet {
            // to a terminal that may be gone: what was recorded is closed all the same
            let mut out = std::io::stderr().lock();
            let _ = writeln!(
                out,
                "{} rows; {} good frames, {} damaged, {} missing",
                self.rows, stats.good, stats.damaged, stats.missing
            );
            for (name, (square, worst, n)) in CAPTURE_NAMES.iter().zip(self.deviation).filter(|(_, (_, _, n))| *n > 0) {
                let rms = (square / f64::from(n)).sqrt();
                let _ = writeln!(out, "{name:>12}: {:.3} % rms from the consensus, {:.3} % at most", rms * 100.0, worst * 100.0);
            }
        }
        self.spool.finish(quiet)
    }
}

/// Why a recording holds nothing: a board that was not heard at all, or an end that came before its first sample.
fn unheard(good: u32) -> String {
    match good {
        0 => "no sample arrived; nothing was recorded; expected samples: is the board powered?".to_owned(),
        n => format!(
            "the recording ended before the first sample ({n} good frames had come); nothing was recorded; expected it to go on for longer: without a terminal a session ends with its input"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::unheard;

    #[test]
    fn a_board_that_was_heard_is_powered() {
        assert!(unheard(0).contains("is the board powered?"));
        let early = unheard(12);
        assert!(
            early.contains("before the first sample (12 good frames had come)") && early.contains("ends with its input"),
            "{early}"
        );
    }
}
