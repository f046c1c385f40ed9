//! What only a host can do while a segment is played.
//!
//! What it is: a [`Job`] belongs to a steered segment; [`Worker`] hears the samples of that segment and says when to move the pulse or
//! to go on.
//! What can go wrong: a channel that has no value for two seconds ends the run: nothing is steered blindly.
//! Units: each channel's own; s, us.
//! Reference: specification `rig.md`, "The operator's side".

use frame::Consensus;
use frame::calibration::Calibration;
use frame::rig::RigSample;
use frame::schedule::{Segment, Shape, Steer};
use frame::units::PulseWidth;
use std::collections::VecDeque;

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Consensus of the speed sensors, rev/min.
    Speed,
    /// Thrust, N.
    Thrust,
    /// Torque, N.m.
    Torque,
    /// Current, A.
    Current,
    /// Voltage, V.
    Voltage,
    /// Temperature, degC.
    Temperature,
}

impl Channel {
    /// Every channel and its name in a file.
    pub const NAMES: [(&'static str, Self); 6] = [
        ("rpm", Self::Speed),
        ("thrust_n", Self::Thrust),
        ("torque_nm", Self::Torque),
        ("current_a", Self::Current),
        ("voltage_v", Self::Voltage),
        ("temp_c", Self::Temperature),
    ];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, channel)| *channel == self).map_or("?", |(name, _)| name)
    }

    /// Its value in a sample.
    #[must_use]
    pub fn value(self, calibration: &Calibration, sample: &RigSample) -> Option<f64> {
        let values = calibration.convert(sample);
        let [thrust, torque, current, voltage, temperature] = values.adc;
        match self {
            Self::Speed => Consensus::of(&values.rpm, &sample.rpm.map(|code| code.verdict)).map(|c| c.rpm),
            Self::Thrust => thrust,
            Self::Torque => torque,
            Self::Current => current,
            Self::Voltage => voltage,
            Self::Temperature => temperature,
        }
    }
}

/// What follows when a channel has not settled within its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Otherwise {
    /// The next part.
    GoOn,
    /// The end of the run.
    Stop,
}

/// What the host does while a steered segment is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Job {
    /// Goes on once the means of a channel over the two halves of the last `over_s` differ by less than `within` of the value.
    Settle {
        /// Which.
        channel: Channel,
        /// Share of the value.
        within: f64,
        /// Time that is looked at, s.
        over_s: f64,
        /// What follows when it does not.
        otherwise: Otherwise,
    },
    /// Goes on once the mean of a channel over a second is below a value.
    Below {
        /// Which.
        channel: Channel,
        /// The value.
        value: f64,
    },
    /// Moves the pulse so that a channel stays at a value.
    Keep {
        /// Which: speed or thrust.
        channel: Channel,
        /// The value.
        value: f64,
    },
}

impl Job {
    const fn channel(&self) -> Channel {
        match self {
            Self::Settle { channel, .. } | Self::Below { channel, .. } | Self::Keep { channel, .. } => *channel,
        }
    }

    /// Time over which samples are kept, s.
    const fn window_s(&self) -> f64 {
        match self {
            Self::Settle { over_s, .. } => *over_s,
            Self::Below { .. } => MEAN_S,
            Self::Keep { .. } => CYCLE_S,
        }
    }
}

/// Mean that is held against a limit, s.
const MEAN_S: f64 = 1.0;
/// Cycle of the slow loop, s: several times a rotor's time constant.
const CYCLE_S: f64 = 0.5;
/// Share of the error that a cycle takes away, were the slope exact.
const GAIN: f64 = 0.5;
/// Most change of pulse in a cycle, us.
const STRIDE_US: f64 = 25.0;
/// Longest time without a value, s.
const BLIND_S: f64 = 2.0;

/// A job at work.
#[derive(Debug, Clone)]
pub(crate) struct Worker {
    job: Job,
    bounds: (PulseWidth, PulseWidth),
    pulse_us: f64,
    begun_s: Option<f64>,
    seen_s: f64,
    /// Time and value.
    window: VecDeque<(f64, f64)>,
    cycle_s: f64,
    done: bool,
}

/// What a worker wants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Wish {
    Nothing,
    Do(Steer),
    /// The channel has no value.
    Blind(Channel),
}

impl Worker {
    /// A job at the beginning of its segment.
    pub(crate) fn new(job: Job, segment: &Segment) -> Self {
        let bounds = match segment.shape {
            Shape::Steered { low, high } => (low, high),
            _ => (segment.pulse, segment.pulse),
        };
        let pulse_us = segment.pulse.as_us();
        Self { job, bounds, pulse_us, begun_s: None, seen_s: 0.0, window: VecDeque::new(), cycle_s: 0.0, done: false }
    }

    /// The job.
    pub(crate) fn job(&self) -> &Job {
        &self.job
    }

    /// It has asked to go on.
    pub(crate) fn is_done(&self) -> bool {
        self.done
    }

    /// Hears a sample.
    pub(crate) fn take(&mut self, calibration: &Calibration, sample: &RigSample) -> Wish {
        let wish = self.wish(calibration, sample);
        self.done |= wish == Wish::Do(Steer::GoOn);
        wish
    }

    fn wish(&mut self, calibration: &Calibration, sample: &RigSample) -> Wish {
        let t = sample.at.as_s();
        let channel = self.job.channel();
        if self.begun_s.is_none() {
            (self.begun_s, self.seen_s, self.cycle_s) = (Some(t), t, t);
        }
        let Some(value) = channel.value(calibration, sample) else {
            return if t - self.seen_s > BLIND_S { Wish::Blind(channel) } else { Wish::Nothing };
        };
        self.seen_s = t;
        self.window.push_back((t, value));
        let oldest = t - self.job.window_s();
        while self.window.front().is_some_and(|(at, _)| *at < oldest - 1e-9) {
            self.window.pop_front();
        }
        let whole = self.begun_s.is_some_and(|begun| t - begun >= self.job.window_s() - 1e-9);
        match self.job {
            _ if !whole => Wish::Nothing,
            Job::Settle { within, .. } if self.is_settled(oldest, within) => Wish::Do(Steer::GoOn),
            Job::Below { value, .. } if mean(self.window.iter()).is_some_and(|mean| mean < value) => Wish::Do(Steer::GoOn),
            Job::Keep { value, .. } if t - self.cycle_s >= CYCLE_S - 1e-9 => {
                self.cycle_s = t;
                self.correct(value)
            }
            _ => Wish::Nothing,
        }
    }

    /// Whether the means of the window's halves agree.
    fn is_settled(&self, oldest: f64, within: f64) -> bool {
        let middle = oldest + 0.5 * self.job.window_s();
        let early = mean(self.window.iter().filter(|(t, _)| *t < middle));
        let late = mean(self.window.iter().filter(|(t, _)| *t >= middle));
        early.zip(late).is_some_and(|(early, late)| (late - early).abs() <= within * late.abs().max(f64::MIN_POSITIVE))
    }

    /// One step of the slow loop: the slope is that of a rotor whose speed goes with the pulse above minimum, and whose thrust goes
    /// with the square of its speed.
    fn correct(&mut self, wanted: f64) -> Wish {
        let Some(is) = mean(self.window.iter()) else { return Wish::Nothing };
        let above = (self.pulse_us - PulseWidth::MIN.as_us()).max(STRIDE_US);
        let power = if self.job.channel() == Channel::Thrust { 2.0 } else { 1.0 };
        let stride = if is > 0.1 * wanted { GAIN * (wanted - is) / is * above / power } else { STRIDE_US };
        let (low, high) = self.bounds;
        let next = (self.pulse_us + stride.clamp(-STRIDE_US, STRIDE_US)).clamp(low.as_us(), high.as_us());
        let moved = crate::table::pulse(next) != crate::table::pulse(self.pulse_us);
        self.pulse_us = next;
        if moved { Wish::Do(Steer::Pulse(crate::table::pulse(next).clamp(low, high))) } else { Wish::Nothing }
    }
}

fn mean<'w>(window: impl Iterator<Item = &'w (f64, f64)>) -> Option<f64> {
    let (sum, n) = window.fold((0.0, 0usize), |(sum, n), (_, value)| (sum + value, n + 1));
    (n > 0).then(|| sum / n as f64)
}
