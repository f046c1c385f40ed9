//! Speed from captured edges, over whole revolutions.
//!
//! What it is: one state for each of the four channels, and the bank that compares them. A reading is the time between two
//! edges of the same mark over the shortest whole number of revolutions of at least 50 ms.
//! What can go wrong: an edge that no rotor can give so soon after the one before (a spike, a ringing comparator) is rejected and
//! counted; edges that were overwritten restart the history (`OverCapture`); silence is `Lost` while the rotor is
//! known to turn and `Stopped` after the time-out; a channel 1 % off the median twice running is flagged `Disagrees`.
//! Within a reading the pattern of the periods is judged as well ([`crate::pattern`]); a twisted blade
//! shows as a pattern of the beam that changes with the speed (`BladeTwist`).
//!
//! Overflow: the counter has 32 bits and turns over every 51.1 s at 84 MHz. Edges are kept as raw captures and only ever
//! subtracted, modulo 2^32, so a difference is right across the turn as long as the true time between the two edges is below one
//! turn. That is held by `ceiling`: a channel forgets its edges after a silence of at most ten seconds or the range over its
//! marks, whichever is less, so that no span that is reported can reach 2^32. The board's own time is extended to 64 bits by the
//! tick, a thousand times a second.
//! Units: ticks of the capture timer; all differences of raw captures wrap at 32 bits.
//! Reference: specification `rig.md`, "Four RPM capture channels"; Beharie 2013, sections 5.4 and 5.7.2.

use crate::config::{CaptureTimes, Config};
use crate::pattern::{judge, unevenness};
use frame::rig::{CAPTURE_CHANNELS, CaptureCode, CaptureVerdict};
use frame::units::{RevPerMin, Ticks};

/// Edges kept: 50 ms and a revolution of 25 marks at 20 000 rev/min.
const DEPTH: usize = 512;
/// Longest silence that is bridged, in 32-bit captures of the whole timer range.
const LONGEST_S: u32 = 10;
/// Deviation from the median that counts as disagreement at constant speed (specification: 1 % on hardware).
const DISAGREEMENT: f32 = 0.01;

/// Speed beyond which no rotor of this rig turns, rev/min: twice the encoder's limit.
const FASTEST: u64 = 20_000;
/// An edge closer to the one before than this part of a period at that speed comes from no mark (a Schmitt trigger in time). Marks that
/// are seen twice further apart than that are told as such (`Doubled`).
const SPIKE: u64 = 16;

/// Periods that are looked at for a pattern, at the least.
const PATTERN: usize = 8;

/// Speed below which the blades count as straight, and are learnt as they are, rev/min.
const STRAIGHT_BELOW: f32 = 4000.0;
/// Change of the blades' unevenness from there that counts as twist: 3.6 degrees between two blades.
const TWIST: f32 = 0.02;

/// Speed below which channels are not judged against each other, rev/min: with one mark a revolution then takes nearly as
/// long as the time-out to zero (0.25 s), so that channels read zero one after the other.
const SLOWEST_JUDGED: u64 = 300;

/// One capture channel.
#[derive(Debug, Clone)]
pub struct CaptureChannel {
    marks: u16,
    times: CaptureTimes,
    ceiling: u64,
    floor: u64,
    rejected: u32,
    ring: [u32; DEPTH],
    next: usize,
    held: usize,
    primed: bool,
    overwritten: bool,
    last: Ticks,
    reading: Option<(u16, u32)>,
    /// Ticks a revolution of that reading, and the silence that a rotor of this speed can explain: asked for many times a tick.
    turn: Option<(u64, u64)>,
    deviations: u8,
}

impl CaptureChannel {
    /// A channel that sees `marks` equal marks a revolution; 0 where none is fitted.
    #[must_use]
    pub fn new(marks: u16, timer_hz: u32, times: CaptureTimes) -> Self {
        let ceiling = timer_hz.saturating_mul(LONGEST_S).min(u32::MAX / (u32::from(marks) + 1));
        Self {
            marks,
            times,
            ceiling: u64::from(ceiling),
            floor: (60 * u64::from(timer_hz) / FASTEST / SPIKE).checked_div(u64::from(marks)).unwrap_or(0),
            rejected: 0,
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
        }
        if let Some(edge) = newest {
            let age = (now.0 as u32).wrapping_sub(edge);
            let age = if age > u32::MAX / 2 { 0 } else { age }; // captured while `now` was read
            self.last = Ticks(now.0.saturating_sub(u64::from(age)));
            self.reading = self.measure();
            let (marks, margin) = (self.marks, self.times.lost_margin.0);
            self.turn = self.reading.and_then(|(edges, span)| {
                let revolution = (u64::from(span) * u64::from(marks)).checked_div(u64::from(edges))?;
                Some((revolution, 3 * self.expected(revolution) + margin))
            });
        } else if self.held > 0 && now.since(self.last).0 > self.stop_after() {
            self.forget();
        }
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
        self.turn.map(|(revolution, _)| revolution)
    }

    fn expected(&self, revolution: u64) -> u64 {
        revolution.checked_div(u64::from(self.marks)).unwrap_or(0)
    }

    /// Silence that a turning rotor can explain.
    fn patience(&self) -> Option<u64> {
        self.turn.map(|(_, patience)| patience)
    }

    fn stop_after(&self) -> u64 {
        match self.revolution() {
            Some(r) => (3 * self.expected(r)).max(self.times.stop.0).min(self.ceiling),
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
    pub fn speed(&self, timer_hz: u32) -> Option<RevPerMin> {
        self.revolution().filter(|r| *r > 0).map(|r| RevPerMin(60.0 * timer_hz as f32 / r as f32))
    }

    /// Silent for more than three expected periods and the margin, when the others turn with (ticks a revolution, since when).
    fn is_lost(&self, now: Ticks, (revolution, since): (u64, Ticks)) -> bool {
        let silent = now.since(self.last.max(since)).0;
        self.marks > 0 && silent > 3 * self.expected(revolution) + self.times.lost_margin.0
    }

    /// What the channel reports, when the others turn with `others` = (ticks a revolution, since when), if they do.
    fn code(&self, now: Ticks, others: Option<(u64, Ticks)>) -> CaptureCode {
        let bare = |verdict| CaptureCode { edges: 0, span: 0, verdict };
        let full = |verdict| match self.reading {
            Some((edges, span)) => CaptureCode { edges, span, verdict },
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
            return full(judge(self.marks, self.periods().take(edges)));
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

/// The four channels together.
#[derive(Debug, Clone)]
pub struct CaptureBank {
    channels: [CaptureChannel; CAPTURE_CHANNELS],
    timer_hz: u32,
    turning_since: Option<Ticks>,
    /// Two earlier medians and their times, each at least a revolution and a half after the other.
    before: [Option<(Ticks, f32)>; 2],
    flagged: u8,
    /// Unevenness of the blades at low speed.
    straight: Option<f32>,
}

impl CaptureBank {
    /// Channels of `config`.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let channels = config.marks.map(|marks| CaptureChannel::new(marks, config.timer_hz, config.capture));
        Self { channels, timer_hz: config.timer_hz, turning_since: None, before: [None; 2], flagged: 0, straight: None }
    }

    /// Takes the captures since the last tick.
    pub fn take(&mut self, now: Ticks, edges: &[&[u32]; CAPTURE_CHANNELS], over_capture: &[bool; CAPTURE_CHANNELS]) {
        for ((channel, edges), over) in self.channels.iter_mut().zip(edges).zip(over_capture) {
            channel.take(now, edges, *over);
        }
        let turning = self.channels.iter().any(|c| c.is_turning(now));
        self.turning_since = turning.then(|| self.turning_since.unwrap_or(now));
        if !turning {
            self.flagged = 0; // they were lost one after the other because the rotor stopped
        }
    }

    /// The channels.
    #[must_use]
    pub fn channels(&self) -> &[CaptureChannel; CAPTURE_CHANNELS] {
        &self.channels
    }

    /// Whether any channel sees the rotor turn.
    #[must_use]
    pub fn is_turning(&self) -> bool {
        self.turning_since.is_some()
    }

    /// Median speed of the channels that see it turn.
    #[must_use]
    pub fn consensus(&self, now: Ticks) -> Option<RevPerMin> {
        let speeds = self.channels.each_ref().map(|c| c.speed(self.timer_hz).filter(|_| c.is_turning(now)));
        median(speeds.map(|s| s.map(|v| v.0))).map(RevPerMin)
    }

    /// Channels whose speed could not be trusted in the last sample.
    #[must_use]
    pub fn flagged(&self) -> u8 {
        self.flagged
    }

    /// Channels that are silent for longer than a turning rotor can explain, while others see it turn. Judged above
    /// 300 rev/min only, and never while all of them fall silent together.
    #[must_use]
    pub fn lost(&self, now: Ticks) -> u8 {
        let Some(since) = self.turning_since else { return 0 };
        // nobody is silent for longer than the margin alone: the usual case, and the cheap one
        if self.channels.iter().all(|c| now.since(c.last.max(since)).0 <= c.times.lost_margin.0) {
            return 0;
        }
        // a rotor that runs down is slower than the last period says: what has passed since the last edge counts too
        let told = self.channels.each_ref().map(|c| {
            let revolution = c.revolution().filter(|_| c.is_turning(now))?;
            Some(revolution.max(u64::from(c.marks).saturating_mul(now.since(c.last).0)))
        });
        let lost = |(n, channel): &(usize, &CaptureChannel)| {
            let others = told.iter().enumerate().filter(|(other, _)| other != n).filter_map(|(_, revolution)| *revolution);
            others.max().is_some_and(|revolution| !self.is_slow(revolution) && channel.is_lost(now, (revolution, since)))
        };
        self.channels.iter().enumerate().filter(lost).count() as u8
    }

    /// Ticks a revolution of the channels that turn, and since when any did.
    fn others(&self, now: Ticks) -> Option<(u64, Ticks)> {
        let known = self.channels.each_ref().map(|c| c.revolution().filter(|_| c.is_turning(now)).map(|r| r as f32));
        median(known).map(|r| r as u64).zip(self.turning_since)
    }

    fn is_slow(&self, revolution: u64) -> bool {
        revolution > 60 * u64::from(self.timer_hz) / SLOWEST_JUDGED
    }

    /// The codes of one sample.
    pub fn sample(&mut self, now: Ticks) -> [CaptureCode; CAPTURE_CHANNELS] {
        let others = self.others(now);
        let mut codes = self.channels.each_ref().map(|c| c.code(now, others));
        let hz = self.timer_hz;
        self.watch_blades(&mut codes);
        let healthy =
            |c: &CaptureChannel, code: &CaptureCode| c.speed(hz).filter(|_| code.verdict == CaptureVerdict::Nominal).map(|v| v.0);
        let mut speeds = [None; CAPTURE_CHANNELS];
        for ((speed, channel), code) in speeds.iter_mut().zip(&self.channels).zip(&codes) {
            *speed = healthy(channel, code);
        }
        let middle = median(speeds);
        let tolerance = self.tolerance(now, middle);
        for ((channel, code), speed) in self.channels.iter_mut().zip(&mut codes).zip(speeds) {
            let apart = match (speed, middle) {
                (Some(speed), Some(middle)) => (speed - middle).abs() > tolerance * middle,
                _ => false,
            };
            if apart && channel.deviations > 0 {
                code.verdict = CaptureVerdict::Disagrees;
            }
            channel.deviations = u8::from(apart);
            // An over-capture is told once, and on until a whole span has been seen again or the rotor stands.
            channel.overwritten &= channel.reading.is_none() && now.since(channel.last).0 <= channel.stop_after();
        }
        let bad = |code: &&CaptureCode| match code.verdict {
            CaptureVerdict::Disagrees | CaptureVerdict::Doubled | CaptureVerdict::Missed => true,
            CaptureVerdict::Lost => others.is_some(), // all together: the rotor stops
            _ => false,
        };
        let slow = others.is_some_and(|(revolution, _)| self.is_slow(revolution));
        self.flagged = if slow { 0 } else { codes.iter().filter(bad).count() as u8 };
        codes
    }

    /// Tells a blade that twists at speed from blades that were never opposite: by the change of the beam's pattern.
    fn watch_blades(&mut self, codes: &mut [CaptureCode; CAPTURE_CHANNELS]) {
        let ([beam, ..], [code, ..]) = (&self.channels, codes);
        if !matches!(code.verdict, CaptureVerdict::Nominal | CaptureVerdict::Alternating) {
            return;
        }
        let edges = usize::from(code.edges).max(4 * usize::from(beam.marks));
        let Some(speed) = beam.speed(self.timer_hz) else { return };
        let Some(uneven) = unevenness(beam.marks, beam.periods().take(edges)) else { return };
        if speed.0 < STRAIGHT_BELOW {
            let known = self.straight.unwrap_or(uneven);
            self.straight = Some(known + 0.25 * (uneven - known));
        } else if uneven - self.straight.unwrap_or(0.0) > TWIST {
            code.verdict = CaptureVerdict::BladeTwist;
        }
    }

    /// Relative deviation that is still agreement: 1 %, and what the speed changed lately, because the channels' spans begin
    /// and end up to a revolution and a half apart.
    fn tolerance(&mut self, now: Ticks, middle: Option<f32>) -> f32 {
        let Some(middle) = middle.filter(|m| *m > 0.0) else {
            self.before = [None; 2];
            return f32::INFINITY;
        };
        let apart = (1.5 * 60.0 * self.timer_hz as f32 / middle) as u64;
        let [older, newer] = self.before;
        if newer.is_none_or(|(then, _)| now.since(then).0 >= apart) {
            self.before = [newer, Some((now, middle))];
        }
        match older.or(newer) {
            Some((_, before)) => DISAGREEMENT + (middle - before).abs() / middle,
            None => f32::INFINITY,
        }
    }
}

/// Median of those present; the mean of the middle two when they are even in number.
fn median(values: [Option<f32>; CAPTURE_CHANNELS]) -> Option<f32> {
    let mut sorted = values.map(|v| v.unwrap_or(f32::INFINITY));
    sorted.sort_unstable_by(f32::total_cmp);
    let n = values.iter().flatten().count();
    let at = |i: usize| sorted.get(i).copied();
    match n {
        0 => None,
        n if n % 2 == 1 => at(n / 2),
        n => Some(0.5 * (at(n / 2 - 1)? + at(n / 2)?)),
    }
}
