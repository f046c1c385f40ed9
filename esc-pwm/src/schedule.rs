//! Throttle schedules as pure functions of elapsed time.
//!
//! What it is: the thesis staircase, up-down staircase, repeated visits, ramp, step and chirp,
//! all answering "which pulse at this time?"; beside them the slew limit and the throttle curve.
//! What can go wrong: a schedule without steps, a zero step or a level out of 1000 to 2000 us is refused ([`Schedule::check`]).
//! Units: milliseconds of elapsed time, nanoseconds of pulse, millihertz.
//! Reference: Beharie 2013, section 3.2.6 (errata: 21 levels, 20 increments); specification `rig.md`.

use crate::fault::Refusals;
use crate::segment::FASTEST_MILLIHERTZ;
use crate::units::PulseWidth;

/// Levels of equal height and equal hold, from minimum throttle upwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Staircase {
    /// Height of one step.
    pub step: PulseWidth,
    /// Hold of each level, milliseconds.
    pub hold_ms: u32,
    /// Highest level.
    pub top: PulseWidth,
    /// Come down again by the same levels.
    pub down: bool,
    /// How often the whole staircase is walked (repeated visits); 0 counts as 1.
    pub visits: u16,
}

impl Staircase {
    /// 1000 to 2000 us by 50 us, 30 s a level, upwards once: 21 levels (Beharie 2013, section 3.2.6).
    pub const THESIS: Self = Self { step: PulseWidth(50_000), hold_ms: 30_000, top: PulseWidth::MAX, down: false, visits: 1 };

    /// Increments on the way up.
    #[must_use]
    pub const fn increments(&self) -> u32 {
        match self.top.0.saturating_sub(PulseWidth::MIN.0).checked_div(self.step.0) {
            Some(n) => n,
            None => 0,
        }
    }

    /// Levels of one visit, both ends included.
    #[must_use]
    pub const fn levels(&self) -> u32 {
        let up = self.increments() + 1;
        if self.down { 2 * up - 1 } else { up }
    }

    fn pulse_at(&self, ms: u64) -> Option<PulseWidth> {
        // 32 bits reach for 49 days; the board divides them itself
        let index = u64::from(u32::try_from(ms).ok()?.checked_div(self.hold_ms)?);
        let up = u64::from(self.increments());
        let levels = if self.down { 2 * up + 1 } else { up + 1 };
        if index >= levels * u64::from(self.visits.max(1)) {
            return None;
        }
        // levels are at least 1, which the compiler does not know: no panic path
        let level = if index < levels { index } else { index.checked_rem(levels)? };
        let level = if level > up { 2 * up - level } else { level };
        Some(PulseWidth(PulseWidth::MIN.0 + self.step.0 * level as u32))
    }
}

/// `from` + (`to` - `from`) * `at` / `whole`, in integers.
pub(crate) fn between(from: PulseWidth, to: PulseWidth, at: u64, whole: u64) -> PulseWidth {
    let (from, to) = (i64::from(from.0), i64::from(to.0));
    let moved = ((to - from) * at as i64).checked_div(whole as i64).unwrap_or(0);
    PulseWidth((from + moved) as u32)
}

/// A sine about a centre whose frequency rises linearly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Chirp {
    /// Middle of the sine.
    pub centre: PulseWidth,
    /// Its amplitude.
    pub amplitude: PulseWidth,
    /// Frequency at the beginning, millihertz.
    pub from_millihertz: u32,
    /// Frequency at the end, millihertz.
    pub to_millihertz: u32,
    /// Duration, milliseconds.
    pub length_ms: u32,
}

impl Chirp {
    fn pulse_at(&self, ms: u64) -> Option<PulseWidth> {
        (ms < u64::from(self.length_ms)).then(|| self.value(ms))
    }

    /// The sine `ms` milliseconds after its beginning, up to its end.
    pub(crate) fn value(&self, ms: u64) -> PulseWidth {
        let offset = self.amplitude.0 as f32 * sine(self.phase(ms));
        let rounded = if offset < 0.0 { offset - 0.5 } else { offset + 0.5 };
        let pulse = i64::from(self.centre.0) + rounded as i64;
        PulseWidth(pulse.max(i64::from(PulseWidth::MIN.0)).min(i64::from(PulseWidth::MAX.0)) as u32)
    }

    /// Phase in millionths of a turn: exact integers, so the end of a long chirp is as sharp as its beginning. The square of the time is
    /// divided by twice the length before it meets the sweep, whole and rest apart: 64 bits are enough.
    fn phase(&self, ms: u64) -> u32 {
        let length = u64::from(self.length_ms);
        let t = ms.min(length);
        let square = t * t;
        let (whole, rest) = (square.checked_div(2 * length).unwrap_or(0), square.checked_rem(2 * length).unwrap_or(0));
        let sweep = i64::from(self.to_millihertz) - i64::from(self.from_millihertz);
        let part = sweep.wrapping_mul(rest as i64).checked_div(2 * length as i64).unwrap_or(0);
        let phase = i64::from(self.from_millihertz)
            .wrapping_mul(t as i64)
            .wrapping_add(sweep.wrapping_mul(whole as i64))
            .wrapping_add(part);
        phase.rem_euclid(TURN) as u32
    }
}

/// Parts of a turn.
const TURN: i64 = 1_000_000;

/// Sine of an angle in millionths of a turn, to 1e-6: its series to the eleventh power over a quarter turn.
fn sine(millionths: u32) -> f32 {
    let half = TURN as u32 / 2;
    let (within, negative) = if millionths < half { (millionths, false) } else { (millionths - half, true) };
    let quarter = within.min(half.saturating_sub(within));
    let x = quarter as f32 * (core::f32::consts::TAU / TURN as f32);
    let square = x * x;
    let series = [-1.0 / 39_916_800.0, 1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0, 1.0];
    let value = x * series.iter().fold(0.0, |sum, term| sum * square + term);
    if negative { -value } else { value }
}

/// A law that the throttle follows while running.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Schedule {
    /// A constant setting, without end: the manual override.
    Manual(PulseWidth),
    /// Equal levels.
    Staircase(Staircase),
    /// From one pulse to another in a straight line.
    Ramp {
        /// Beginning.
        from: PulseWidth,
        /// End.
        to: PulseWidth,
        /// Duration, milliseconds.
        length_ms: u32,
    },
    /// One level, then another.
    Step {
        /// Before the step.
        before: PulseWidth,
        /// After the step.
        after: PulseWidth,
        /// Hold of each of the two, milliseconds.
        hold_ms: u32,
    },
    /// Swept sine.
    Chirp(Chirp),
}

impl Schedule {
    /// Pulse at `ms` milliseconds after the beginning; `None` when the schedule is over.
    #[must_use]
    pub fn pulse_at(&self, ms: u64) -> Option<PulseWidth> {
        match self {
            Self::Manual(pulse) => Some(*pulse),
            Self::Staircase(stairs) => stairs.pulse_at(ms),
            Self::Ramp { from, to, length_ms } => {
                (ms < u64::from(*length_ms)).then(|| between(*from, *to, ms, u64::from(*length_ms)))
            }
            Self::Step { before, after, hold_ms } => match ms.checked_div(u64::from(*hold_ms))? {
                0 => Some(*before),
                1 => Some(*after),
                _ => None,
            },
            Self::Chirp(chirp) => chirp.pulse_at(ms),
        }
    }

    /// What speaks against running this schedule: bits of [`Refusals`].
    #[must_use]
    pub fn check(&self) -> Refusals {
        let out = |pulse: &PulseWidth| *pulse != pulse.clamped();
        let bad = match self {
            Self::Manual(pulse) => out(pulse),
            Self::Staircase(s) => s.step.0 == 0 || s.hold_ms == 0 || out(&s.top) || s.increments() == 0,
            Self::Ramp { from, to, length_ms } => out(from) || out(to) || *length_ms == 0,
            Self::Step { before, after, hold_ms } => out(before) || out(after) || *hold_ms == 0,
            Self::Chirp(c) => {
                c.length_ms == 0
                    || c.from_millihertz.max(c.to_millihertz) > FASTEST_MILLIHERTZ
                    || out(&c.centre)
                    || out(&PulseWidth(c.centre.0.saturating_add(c.amplitude.0)))
                    || out(&PulseWidth(c.centre.0.saturating_sub(c.amplitude.0)))
            }
        };
        Refusals::default().with_if(Refusals::OUT_OF_RANGE, bad)
    }
}

/// Limits how fast the throttle moves. Falling to minimum is never limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Slew {
    /// Most change of pulse in a millisecond, nanoseconds; `u32::MAX` is no limit.
    pub ns_per_ms: u32,
}

impl Slew {
    /// No limit.
    pub const NONE: Self = Self { ns_per_ms: u32::MAX };

    /// The pulse `ms` milliseconds after `now`, on the way to `target`.
    #[must_use]
    pub const fn toward(self, now: PulseWidth, target: PulseWidth, ms: u32) -> PulseWidth {
        if target.0 <= PulseWidth::MIN.0 {
            return PulseWidth::MIN;
        }
        let most = self.ns_per_ms.saturating_mul(ms);
        let lowest = now.0.saturating_sub(most);
        let highest = now.0.saturating_add(most);
        PulseWidth(if target.0 > highest {
            highest
        } else if target.0 < lowest {
            lowest
        } else {
            target.0
        })
    }
}

/// Maps a setting to the pulse that is sent: a straight line, or five points as on a radio transmitter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ThrottleCurve {
    /// The setting is the pulse.
    #[default]
    Linear,
    /// Pulses at settings of 1000, 1250, 1500, 1750 and 2000 us, straight lines between.
    Points([PulseWidth; 5]),
}

impl ThrottleCurve {
    /// The pulse for `setting`. Minimum always stays minimum.
    #[must_use]
    pub fn apply(&self, setting: PulseWidth) -> PulseWidth {
        const SPACING: u32 = 250_000;
        let setting = setting.clamped();
        let Self::Points(points) = self else { return setting };
        if !setting.is_live() {
            return PulseWidth::MIN;
        }
        let above = setting.0 - PulseWidth::MIN.0;
        let segment = (above / SPACING) as usize;
        match (points.get(segment), points.get(segment + 1)) {
            (Some(a), Some(b)) => between(*a, *b, u64::from(above % SPACING), u64::from(SPACING)).clamped(),
            (Some(a), None) => a.clamped(),
            _ => PulseWidth::MIN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_sine_is_one_all_round() {
        for part in 0..TURN as u32 {
            let exact = (f64::from(part) * core::f64::consts::TAU / TURN as f64).sin();
            assert!((f64::from(sine(part)) - exact).abs() < 1e-6, "{part}");
        }
    }

    proptest! {
        /// The phase is that of exact integers of any width.
        #[test]
        fn the_phase_is_exact(from_millihertz in 0u32..=FASTEST_MILLIHERTZ, to_millihertz in 0u32..=FASTEST_MILLIHERTZ, length_ms in 1u32.., share in 0.0f64..=1.0) {
            let chirp = Chirp { centre: PulseWidth::MIN, amplitude: PulseWidth(0), from_millihertz, to_millihertz, length_ms };
            let ms = (f64::from(length_ms) * share) as u64;
            let (t, l) = (i128::from(ms), i128::from(length_ms));
            let exact = i128::from(from_millihertz) * t + (i128::from(to_millihertz) - i128::from(from_millihertz)) * t * t / (2 * l);
            prop_assert_eq!(i128::from(chirp.phase(ms)), exact.rem_euclid(1_000_000));
        }
    }
}
