//! A plan's mishap at the pins of the emulated board.
//!
//! What it is: the [`Injury`] of the native board, edge by edge: edges that a sensor does not give, trains that it gives in their place,
//! levels at analogue pins, the host's bytes.
//! What can go wrong: the kinds of [`Mishap::on_image`] alone are shown; the others do nothing here.
//! Units: ns since power-up of the board; counts of 12 bits.
//! Reference: specification `rig.md`, "The simulator" (faults).

use crate::fault::{Injury, Mishap, Plan};
use crate::sensor::edge::ENCODER_PRESCALER;
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};

/// Time between two changes of a train that stands still, ns.
const RESTING_NS: u64 = 1_000_000;
const MS: u64 = 1_000_000;

/// The mishap at work.
#[derive(Debug)]
pub(super) struct Harm {
    injury: Injury,
    struck: u64,
    since: u64,
    counts: [Option<f64>; ADC_CHANNELS],
    /// The mark that stands before each sensor gives no edge.
    hidden: [bool; CAPTURE_CHANNELS],
    /// Next change of each train: when, and to which level.
    trains: [Option<(u64, bool)>; CAPTURE_CHANNELS],
}

impl Harm {
    /// The mishap of `plan`, from millisecond `ms` on.
    pub(super) fn new(plan: &Plan, ms: u64) -> Self {
        let injury = Injury::new(plan);
        let begins = |channel: usize| injury.train_rpm(channel as u8, 1000.0).map(|_| (ms * MS, true));
        Self {
            trains: core::array::from_fn(begins),
            injury,
            struck: ms,
            since: 0,
            counts: [None; ADC_CHANNELS],
            hidden: [false; CAPTURE_CHANNELS],
        }
    }

    pub(super) const fn mishap(&self) -> Mishap {
        self.injury.mishap()
    }

    /// Millisecond `ms` begins.
    pub(super) fn millisecond(&mut self, ms: u64) {
        self.since = ms.saturating_sub(self.struck);
        for channel in 0..ADC_CHANNELS {
            let code = self.injury.code(channel as u8, self.since);
            // an end of the range is well beyond it
            self.counts[channel] = code.map(|code| match code {
                0 => -400.0,
                4095 => 4600.0,
                code => f64::from(code),
            });
        }
    }

    /// Level of an analogue pin in the place of its own.
    pub(super) fn counts(&self, channel: usize) -> Option<f64> {
        self.counts[channel]
    }

    /// The converter delivers nothing any more.
    pub(super) fn converter_rests(&self) -> bool {
        self.injury.mishap() == Mishap::NoConversions
    }

    /// A stop loop that opened for a millisecond closes again.
    pub(super) fn stop_closes(&self) -> bool {
        self.injury.mishap() == Mishap::StopBlink && self.since > 1
    }

    /// Whether a sensor does not give this edge of its own.
    pub(super) fn hides(&mut self, channel: u8, rising: bool) -> bool {
        let n = usize::from(channel);
        if self.trains[n].is_some() {
            return true;
        }
        if rising {
            self.hidden[n] = self.injury.overlooks(channel);
        }
        self.hidden[n]
    }

    /// The next change of a train that is due, as (channel, level).
    pub(super) fn train_edge(&mut self, now_ns: u64, rpm: f64) -> Option<(u8, bool)> {
        for channel in 0..CAPTURE_CHANNELS {
            let Some((_, high)) = self.trains[channel].filter(|(at, _)| *at <= now_ns) else { continue };
            let steps = if channel == CAPTURE_CHANNELS - 1 { ENCODER_PRESCALER } else { 1 };
            let marks = f64::from(self.injury.marks(channel as u8)) * steps as f64;
            let speed = self.injury.train_rpm(channel as u8, rpm).unwrap_or(0.0);
            let half = if speed * marks > 1.0 { (30.0e9 / (speed * marks)) as u64 } else { RESTING_NS };
            self.trains[channel] = Some((now_ns + half, !high));
            return Some((channel as u8, high));
        }
        None
    }

    /// When the next change of a train is due.
    pub(super) fn next_train(&self) -> u64 {
        self.trains.iter().flatten().map(|(at, _)| *at).min().unwrap_or(u64::MAX)
    }

    /// What becomes of a frame of the host.
    pub(super) fn line(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        self.injury.line(bytes, &[])
    }

    /// What comes on the host's line beside its frames; `heard` is what the board has said.
    pub(super) fn noise(&mut self, heard: &[u8]) -> Vec<u8> {
        self.injury.line(Vec::new(), heard)
    }
}
