//! The four channels of speed together.
//!
//! What it is: the bank of [`CaptureChannel`]s that compares them: consensus, channels that are lost, that disagree, a blade that twists.
//! What can go wrong: a channel 1 % off the median twice running is flagged `Disagrees`; a twisted blade shows as a pattern of the beam
//! that changes with the speed (`BladeTwist`). A channel that fails now and then counts as bad until it has been good for 0.3 s.
//! Units: ticks of the capture timer, rev/min.
//! Reference: specification `rig.md`, "Four RPM capture channels"; Beharie 2013, sections 5.4 and 5.7.2.

use crate::capture::CaptureChannel;
use crate::config::Config;
use crate::pattern::unevenness;
use frame::rig::{CAPTURE_CHANNELS, CaptureCode, CaptureVerdict, UNEVEN_PARTS};
use frame::units::{RevPerMin, Ticks};

/// Deviation from the median that counts as disagreement at constant speed (specification: 1 % on hardware).
const DISAGREEMENT: f32 = 0.01;
/// Speed below which the blades count as straight, and are learnt as they are, rev/min.
const STRAIGHT_BELOW: f32 = 4000.0;
/// Change of the blades' unevenness from there that counts as twist: 3.6 degrees between two blades.
const TWIST: f32 = 0.02;

/// Speed below which channels are not judged against each other, rev/min: with one mark a revolution then takes nearly as
/// long as the time-out to zero (0.25 s), so that channels read zero one after the other.
const SLOWEST_JUDGED: u64 = 300;

/// How long a channel counts as bad after it was: less than a disagreement must last (0.5 s) by more than the time between two samples, so
/// that one bad sample stops nobody. It bridges readings in which a mark that is missed now and then was there by chance.
const HELD: Ticks = Ticks::from_ms(300);

/// The four channels together.
#[derive(Debug, Clone)]
pub struct CaptureBank {
    channels: [CaptureChannel; CAPTURE_CHANNELS],
    timer_hz: u32,
    turning_since: Option<Ticks>,
    /// Two earlier medians and their times, each at least a revolution and a half after the other.
    before: [Option<(Ticks, f32)>; 2],
    flagged: u8,
    /// When each channel was last bad.
    bad: [Option<Ticks>; CAPTURE_CHANNELS],
    /// Unevenness of the blades at low speed.
    straight: Option<f32>,
    /// Median of the healthy channels in the last sample, rev/min, and the relative deviation from it that was still agreement.
    agreed: Option<(f32, f32)>,
}

impl CaptureBank {
    /// Channels of `config`.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let [a, b, c, d] = config.marks;
        let channel = |marks| CaptureChannel::new(marks, config.timer_hz, config.capture);
        let channels = [channel(a), channel(b), channel(c), channel(d)]; // made where they stay: `map` would hold two of each on the stack
        Self {
            channels,
            timer_hz: config.timer_hz,
            turning_since: None,
            before: [None; 2],
            flagged: 0,
            bad: [None; CAPTURE_CHANNELS],
            straight: None,
            agreed: None,
        }
    }

    /// Channels of `config` in the place of those so far, with nothing seen yet.
    pub(crate) fn refit(&mut self, config: &Config) {
        for (channel, marks) in self.channels.iter_mut().zip(config.marks) {
            channel.refit(marks);
        }
        (self.turning_since, self.before, self.flagged) = (None, [None; 2], 0);
        (self.straight, self.agreed) = (None, None);
        self.bad = [None; CAPTURE_CHANNELS];
    }

    /// Takes the captures since the last tick.
    pub fn take(&mut self, now: Ticks, edges: &[&[u32]; CAPTURE_CHANNELS], over_capture: &[bool; CAPTURE_CHANNELS]) {
        for ((channel, edges), over) in self.channels.iter_mut().zip(edges).zip(over_capture) {
            channel.take(now, edges, *over);
        }
        let turning = self.channels.iter().any(|c| c.is_turning(now));
        self.turning_since = turning.then(|| self.turning_since.unwrap_or(now));
        if !turning {
            (self.flagged, self.bad) = (0, [None; CAPTURE_CHANNELS]); // lost one after the other because the rotor stopped
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
        if !self.is_turning() {
            return None;
        }
        let speeds = self.channels.each_ref().map(|c| c.speed().filter(|_| c.is_turning(now)));
        median(speeds.map(|s| s.map(|v| v.0))).map(RevPerMin)
    }

    /// Channels that are fitted.
    #[must_use]
    pub fn fitted(&self) -> usize {
        self.channels.iter().filter(|c| c.marks > 0).count()
    }

    /// Speed by which overspeed is judged, over the last revolution: the second-fastest of the channels that see edges, so that one
    /// channel alone stops nobody and two are enough; the fastest where only one or two are fitted, or only one sees edges.
    #[must_use]
    pub fn judged_speed(&self, now: Ticks) -> Option<RevPerMin> {
        let (mut first, mut second) = (None, None);
        for channel in &self.channels {
            // after an over-capture the first period may not be one of two marks: a whole reading comes first
            let Some(speed) = channel.latest_speed(now).filter(|_| !channel.overwritten || channel.reading.is_some()) else {
                continue;
            };
            if first.is_none_or(|fastest| speed > fastest) {
                (first, second) = (Some(speed), first);
            } else if second.is_none_or(|next| speed > next) {
                second = Some(speed);
            }
        }
        if self.fitted() <= 2 { first } else { second.or(first) }
    }

    /// Edges that each channel took in the last call of [`CaptureBank::take`].
    pub(crate) fn taken(&self) -> [u16; CAPTURE_CHANNELS] {
        self.channels.each_ref().map(|c| c.taken)
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

    /// The same where they are fast enough to judge another by.
    pub(crate) fn turning_others(&self, now: Ticks) -> Option<(u64, Ticks)> {
        self.others(now).filter(|(revolution, _)| !self.is_slow(*revolution))
    }

    /// Median of the healthy channels in the last sample, rev/min, and the relative deviation that was still agreement.
    pub(crate) fn agreed(&self) -> Option<(f32, f32)> {
        self.agreed
    }

    fn is_slow(&self, revolution: u64) -> bool {
        revolution > 60 * u64::from(self.timer_hz) / SLOWEST_JUDGED
    }

    /// The codes of one sample.
    pub fn sample(&mut self, now: Ticks) -> [CaptureCode; CAPTURE_CHANNELS] {
        let others = self.others(now);
        let mut codes = self.channels.each_ref().map(|c| c.code(now, others));
        self.watch_marks(&mut codes);
        self.watch_blades(&mut codes);
        let healthy =
            |c: &CaptureChannel, code: &CaptureCode| c.speed().filter(|_| code.verdict == CaptureVerdict::Nominal).map(|v| v.0);
        let mut speeds = [None; CAPTURE_CHANNELS];
        for ((speed, channel), code) in speeds.iter_mut().zip(&self.channels).zip(&codes) {
            *speed = healthy(channel, code);
        }
        let middle = median(speeds);
        let tolerance = self.tolerance(now, middle);
        self.agreed = middle.map(|middle| (middle, tolerance));
        for (channel, code) in self.channels.iter_mut().zip(&mut codes) {
            // uneven marks do not change the speed over whole revolutions: one that is off is off for another reason
            let whole =
                matches!(code.verdict, CaptureVerdict::Nominal | CaptureVerdict::Alternating | CaptureVerdict::BladeTwist);
            let speed = channel.speed().filter(|_| whole).map(|v| v.0);
            let apart = match (speed, middle) {
                (Some(speed), Some(middle)) => (speed - middle).abs() > tolerance * middle,
                _ => false,
            };
            if apart && channel.deviations > 0 {
                code.verdict = CaptureVerdict::Disagrees;
            }
            channel.deviations = u8::from(apart);
            channel.told(now);
        }
        let is_bad = |code: &CaptureCode| match code.verdict {
            CaptureVerdict::Disagrees | CaptureVerdict::Doubled | CaptureVerdict::Missed => true,
            CaptureVerdict::Lost => others.is_some(), // all together: the rotor stops
            _ => false,
        };
        let slow = others.is_some_and(|(revolution, _)| self.is_slow(revolution));
        for (bad, code) in self.bad.iter_mut().zip(&codes) {
            *bad = if !slow && is_bad(code) { Some(now) } else { bad.filter(|then| !slow && now.since(*then).0 < HELD.0) };
        }
        self.flagged = self.bad.iter().flatten().count() as u8;
        codes
    }

    /// Tells how unevenly the marks of each channel stand, where the readings show it.
    fn watch_marks(&self, codes: &mut [CaptureCode; CAPTURE_CHANNELS]) {
        for (channel, code) in self.channels.iter().zip(codes) {
            if !matches!(code.verdict, CaptureVerdict::Nominal | CaptureVerdict::Alternating) {
                continue;
            }
            let edges = usize::from(code.edges).max(4 * usize::from(channel.marks));
            let uneven = unevenness(channel.marks, channel.periods().take(edges));
            code.uneven = uneven.map_or(0, |uneven| ((f32::from(UNEVEN_PARTS) * uneven + 0.5) as u16).max(1));
        }
    }

    /// Tells a blade that twists at speed from blades that were never opposite: by the change of the beam's pattern.
    fn watch_blades(&mut self, codes: &mut [CaptureCode; CAPTURE_CHANNELS]) {
        let ([beam, ..], [code, ..]) = (&self.channels, codes);
        let Some(speed) = beam.speed().filter(|_| code.uneven > 0) else { return };
        let uneven = f32::from(code.uneven) / f32::from(UNEVEN_PARTS);
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

/// Median of those present, of which none is negative or no number; the mean of the middle two when they are even in number.
fn median(values: [Option<f32>; CAPTURE_CHANNELS]) -> Option<f32> {
    let n = values.iter().flatten().count();
    // sorted by five comparisons, those that are missing at the end
    let [a, b, c, d] = values.map(|v| v.unwrap_or(f32::INFINITY));
    let (low, high) = (in_order(a, b), in_order(c, d));
    let ((first, p), (q, _)) = (in_order(low.0, high.0), in_order(low.1, high.1));
    let (second, third) = in_order(p, q);
    match n {
        0 => None,
        1 => Some(first),
        2 => Some(0.5 * (first + second)),
        3 => Some(second),
        _ => Some(0.5 * (second + third)),
    }
}

/// The lower of two first.
fn in_order(a: f32, b: f32) -> (f32, f32) {
    if b < a { (b, a) } else { (a, b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the order, and whichever are missing.
    #[test]
    fn the_median_of_none_to_four() {
        assert_eq!(median([None; 4]), None);
        for (given, middle) in [
            ([Some(7.0), None, None, None], 7.0),
            ([Some(7.0), Some(3.0), None, None], 5.0),
            ([Some(7.0), Some(3.0), Some(4.0), None], 4.0),
            ([Some(7.0), Some(3.0), Some(4.0), Some(1.0)], 3.5),
        ] {
            for turned in 0..4 {
                let mut order = given;
                order.rotate_left(turned);
                assert_eq!(median(order), Some(middle), "{order:?}");
                order.reverse();
                assert_eq!(median(order), Some(middle), "{order:?}");
                order.swap(0, 1);
                assert_eq!(median(order), Some(middle), "{order:?}");
            }
        }
    }

    /// 3000 rev/min is a revolution in 20 ms: what is compared with is at least 30 ms old, and then the one before that.
    #[test]
    fn what_still_agrees_follows_what_the_speed_changed_over_a_revolution_and_a_half() {
        let mut bank = CaptureBank::new(&Config::thesis_570kv());
        let mut change = |ms: u64, middle: f32| (bank.tolerance(Ticks::from_ms(ms), Some(middle)) - DISAGREEMENT) * middle;
        assert_eq!(change(0, 3000.0), f32::INFINITY, "nothing to compare with");
        let close = |found: f32, expected: f32| assert!((found - expected).abs() < 0.01, "{found} is not {expected}");
        close(change(10, 3010.0), 10.0);
        close(change(29, 3000.5), 0.5);
        close(change(31, 3050.0), 50.0); // kept from now on, beside the first
        close(change(50, 3020.0), 20.0);
        close(change(60, 3000.0), 0.0);
        close(change(62, 3000.0), 0.0); // the first goes with the next
        close(change(80, 3000.0), 50.0);
        bank.tolerance(Ticks::from_ms(90), None);
        assert_eq!(bank.tolerance(Ticks::from_ms(91), Some(3000.0)), f32::INFINITY, "none turned in between");
    }
}
