//! Speed from captured edges, over whole revolutions.
//!
//! What it is: the state of one of the four channels ([`crate::bank`] compares them). A reading is the time between two
//! edges of the same mark over the shortest whole number of revolutions of at least 50 ms.
//! What can go wrong: an edge that no rotor can give so soon after the one before (a spike, a ringing comparator) is rejected and
//! counted; edges that were overwritten restart the history (`OverCapture`); silence is `Lost` while the rotor is
//! known to turn and `Stopped` after the time-out.
//! Within a reading the pattern of the periods is judged as well ([`crate::pattern`]).
//!
//! Overflow: the counter has 32 bits and turns over every 51.1 s at 84 MHz. Edges are kept as raw captures and only ever
//! subtracted, modulo 2^32, so a difference is right across the turn as long as the true time between the two edges is below one
//! turn. That is held by `ceiling`: a channel forgets its edges after a silence of at most ten seconds or the range over its
//! marks, whichever is less, so that no span that is reported can reach 2^32. The board's own time is extended to 64 bits by the
//! tick, a thousand times a second.
//! Units: ticks of the capture timer; all differences of raw captures wrap at 32 bits.
//! Reference: specification `rig.md`, "Four RPM capture channels"; Beharie 2013, sections 5.4 and 5.7.2.

use crate::config::CaptureTimes;
use crate::pattern::judge;
use frame::rig::{CaptureCode, CaptureVerdict};
use frame::units::{RevPerMin, Ticks};

/// Edges kept: 50 ms and a revolution of 25 marks at 20 000 rev/min.
const DEPTH: usize = 512;
/// Longest silence that is bridged, in 32-bit captures of the whole timer range.
const LONGEST_S: u32 = 10;

/// Speed beyond which no rotor of this rig turns, rev/min: twice the encoder's limit.
const FASTEST: u64 = 20_000;
/// An edge closer to the one before than this part of a period at that speed comes from no mark (a Schmitt trigger in time). Marks that
/// are seen twice further apart than that are told as such (`Doubled`).
const SPIKE: u64 = 16;

/// Periods that are looked at for a pattern, at the least.
const PATTERN: usize = 8;

/// What follows from a reading.
#[derive(Debug, Clone, Copy)]
struct Turn {
    /// Ticks a revolution.
    revolution: u64,
    /// Silence that a rotor of this speed can explain, ticks.
    patience: u64,
    /// Revolutions a minute; `None` of a revolution that takes no time.
    speed: Option<f32>,
}

/// Longest silence that is bridged, and the shortest time between two edges, ticks.
fn ends(marks: u16, timer_hz: u32) -> (u64, u64) {
    let ceiling = timer_hz.saturating_mul(LONGEST_S).min(u32::MAX / (u32::from(marks) + 1));
    let floor = (60 * u64::from(timer_hz) / FASTEST / SPIKE).checked_div(u64::from(marks)).unwrap_or(0);
    (u64::from(ceiling), floor)
}

/// One capture channel.
#[derive(Debug, Clone)]
pub struct CaptureChannel {
    pub(crate) marks: u16,
    timer_hz: u32,
    pub(crate) times: CaptureTimes,
    ceiling: u64,
    floor: u64,
    rejected: u32,
    /// Edges of the last call that a rotor can give.
    pub(crate) taken: u16,
    ring: [u32; DEPTH],
    next: usize,
    held: usize,
    primed: bool,
    pub(crate) overwritten: bool,
    pub(crate) last: Ticks,
    pub(crate) reading: Option<(u16, u32)>,
    /// What follows from that reading: asked for many times a tick.
    turn: Option<Turn>,
    pub(crate) deviations: u8,
}

impl CaptureChannel {
    /// A channel that sees `marks` equal marks a revolution; 0 where none is fitted.
    #[must_use]
    pub fn new(marks: u16, timer_hz: u32, times: CaptureTimes) -> Self {
        let (ceiling, floor) = ends(marks, timer_hz);
        Self {
            marks,
            timer_hz,
            times,
            ceiling,
            floor,
            rejected: 0,
            taken: 0,
            ring: [0; DEPTH],
            next: 0,
            held: 0,
            primed: false,
            overwritten: false,
            last: Ticks(0),
            reading: None,
            turn: None,
            deviations: 0,
        }
    }

    /// The channel with another number of marks, and nothing seen yet: as [`CaptureChannel::new`], where it stays.
    pub(crate) fn refit(&mut self, marks: u16) {
        self.marks = marks;
        (self.ceiling, self.floor) = ends(marks, self.timer_hz);
        (self.rejected, self.taken, self.deviations) = (0, 0, 0);
        (self.primed, self.overwritten) = (false, false);
        self.last = Ticks(0);
        self.forget();
    }

    /// Edge `back` places before the latest.
    fn edge(&self, back: usize) -> Option<u32> {
        (back < self.held).then(|| (self.next + DEPTH - 1 - back) % DEPTH).and_then(|i| self.ring.get(i).copied())
    }

    /// Times between successive edges, the latest first.
    pub fn periods(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.held).map_while(|i| Some(self.edge(i)?.wrapping_sub(self.edge(i + 1)?)))
    }

    fn forget(&mut self) {
        self.held = 0;
        self.reading = None;
        self.turn = None;
    }

    fn store(&mut self, edge: u32) {
        if let Some(slot) = self.ring.get_mut(self.next) {
            *slot = edge;
        }
        self.next = (self.next + 1) % DEPTH;
        self.held = (self.held + 1).min(DEPTH);
    }

    /// Takes the captures since the last tick.
    pub fn take(&mut self, now: Ticks, edges: &[u32], over_capture: bool) {
        self.taken = 0;
        if self.marks == 0 {
            return;
        }
        let mut edges = edges;
        if !self.primed {
            // The first capture after the timer started is its own compare match and no edge.
            let Some((_, rest)) = edges.split_first() else { return };
            self.primed = true;
            edges = rest;
        }
        if over_capture {
            self.forget();
            self.overwritten = true;
            self.last = now;
            edges = edges.last().map_or(&[][..], core::slice::from_ref);
        }
        let mut newest = None;
        for edge in edges {
            let gap = self.edge(0).map_or(u32::MAX, |before| edge.wrapping_sub(before));
            if u64::from(gap) < self.floor {
                self.rejected = self.rejected.wrapping_add(1);
                continue;
            }
            newest = Some(*edge);
            if self.held > 0 && self.patience().is_some_and(|most| u64::from(gap) > most) {
                self.forget();
            }
            self.store(*edge);
            self.taken = self.taken.saturating_add(1);
        }
        if let Some(edge) = newest {
            let age = (now.0 as u32).wrapping_sub(edge);
            let age = if age > u32::MAX / 2 { 0 } else { age }; // captured while `now` was read
            self.last = Ticks(now.0.saturating_sub(u64::from(age)));
            self.reading = self.measure();
            self.turn = self.reading.and_then(|(edges, span)| self.turn(edges, span));
        } else if self.held > 0 && now.since(self.last).0 > self.stop_after() {
            self.forget();
        }
    }

    fn turn(&self, edges: u16, span: u32) -> Option<Turn> {
        let all = u64::from(span) * u64::from(self.marks);
        // in 32 bits where they are enough, as they nearly always are: the board divides these itself
        let revolution = match u32::try_from(all) {
            Ok(all) => u64::from(all.checked_div(u32::from(edges))?),
            Err(_) => all.checked_div(u64::from(edges))?,
        };
        let speed = (revolution > 0).then(|| 60.0 * self.timer_hz as f32 / revolution as f32);
        Some(Turn { revolution, patience: 3 * self.expected(revolution) + self.times.lost_margin.0, speed })
    }

    /// The shortest whole number of revolutions of at least the configured span.
    fn measure(&self) -> Option<(u16, u32)> {
        let latest = self.edge(0)?;
        let mut best = None;
        let mut count = self.marks;
        while let Some(edge) = self.edge(usize::from(count)) {
            let span = latest.wrapping_sub(edge);
            best = Some((count, span));
            if u64::from(span) >= self.times.span.0 {
                return best;
            }
            count = count.checked_add(self.marks)?;
        }
        if self.held == DEPTH { best } else { None }
    }

    /// Edges that were rejected since the channel began.
    #[must_use]
    pub fn rejected(&self) -> u32 {
        self.rejected
    }

    /// Ticks of one revolution at the last reading.
    #[must_use]
    pub fn revolution(&self) -> Option<u64> {
        self.turn.map(|turn| turn.revolution)
    }

    fn expected(&self, revolution: u64) -> u64 {
        match u32::try_from(revolution) {
            Ok(revolution) => revolution.checked_div(u32::from(self.marks)).map_or(0, u64::from),
            Err(_) => revolution.checked_div(u64::from(self.marks)).unwrap_or(0),
        }
    }

    /// Silence that a turning rotor can explain.
    fn patience(&self) -> Option<u64> {
        self.turn.map(|turn| turn.patience)
    }

    pub(crate) fn stop_after(&self) -> u64 {
        match self.patience() {
            Some(most) => most.saturating_sub(self.times.lost_margin.0).max(self.times.stop.0).min(self.ceiling),
            None => self.ceiling,
        }
    }

    /// Speed is known and the edges keep coming.
    #[must_use]
    pub fn is_turning(&self, now: Ticks) -> bool {
        self.patience().is_some_and(|most| now.since(self.last).0 <= most)
    }

    /// Speed of the last reading.
    #[must_use]
    pub fn speed(&self) -> Option<RevPerMin> {
        self.turn.and_then(|turn| turn.speed).map(RevPerMin)
    }

    /// Speed over the last revolution alone: rougher than the reading, and known 50 ms before it. It is what a limit is judged by.
    /// `None` once the rotor has been silent for longer than that revolution took.
    #[must_use]
    pub fn latest_speed(&self, now: Ticks) -> Option<RevPerMin> {
        let span = self.edge(0)?.wrapping_sub(self.edge(usize::from(self.marks))?);
        let fresh = now.since(self.last).0 <= u64::from(span);
        (span > 0 && fresh).then(|| RevPerMin(60.0 * self.timer_hz as f32 / span as f32))
    }

    /// What the channel reports has been told. An over-capture is told on until a whole span has been seen again or the rotor stands.
    pub(crate) fn told(&mut self, now: Ticks) {
        self.overwritten &= self.reading.is_none() && now.since(self.last).0 <= self.stop_after();
    }

    /// Silent for more than three expected periods and the margin, when the others turn with (ticks a revolution, since when).
    pub(crate) fn is_lost(&self, now: Ticks, (revolution, since): (u64, Ticks)) -> bool {
        let silent = now.since(self.last.max(since)).0;
        self.marks > 0 && silent > 3 * self.expected(revolution) + self.times.lost_margin.0
    }

    /// What the channel reports, when the others turn with `others` = (ticks a revolution, since when), if they do.
    pub(crate) fn code(&self, now: Ticks, others: Option<(u64, Ticks)>) -> CaptureCode {
        self.code_by(now, others, DEPTH)
    }

    /// The same, with a look at so many of the latest periods at the most.
    pub(crate) fn code_by(&self, now: Ticks, others: Option<(u64, Ticks)>, most: usize) -> CaptureCode {
        let bare = |verdict| CaptureCode { verdict, ..CaptureCode::default() };
        let full = |verdict| match self.reading {
            Some((edges, span)) => CaptureCode { edges, span, verdict, uneven: 0 },
            None => bare(verdict),
        };
        if self.marks == 0 {
            return bare(CaptureVerdict::Absent);
        }
        if self.overwritten {
            return full(CaptureVerdict::OverCapture);
        }
        if self.is_turning(now) {
            // a slow reading holds too few periods to show a pattern of two: the ones before it are looked at as well
            let edges = self.reading.map_or(0, |(edges, _)| usize::from(edges)).max(PATTERN);
            return full(judge(self.marks, self.periods().take(edges.min(most))));
        }
        match others {
            Some(others) => {
                if self.is_lost(now, others) {
                    bare(CaptureVerdict::Lost)
                } else if self.reading.is_some() {
                    full(CaptureVerdict::Nominal)
                } else {
                    bare(CaptureVerdict::Stopped)
                }
            }
            None if self.reading.is_some() => bare(CaptureVerdict::Lost),
            None => bare(CaptureVerdict::Stopped),
        }
    }
}
