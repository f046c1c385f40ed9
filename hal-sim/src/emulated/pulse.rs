//! TIM3, the DMA request that feeds it, and the line on its first channel.
//!
//! What it is: the emulator's own timer with an ear at the pin: every change of the output's level with its instant, and from these
//! what an ESC reads, bit by bit ([`SeenFrame`]). The emulator leaves the timers out of its table of DMA requests; [`controller`] is its
//! DMA1 with the one that is used here.
//! What can go wrong: a high level that is neither a bit nor a pulse, and a frame of another length, are told as a frame without a word.
//! Units: ns since power-up.
//! Reference: RM0090 sections 18.3.9 (PWM), 18.4.18 (DMA burst), 10.3.3 (TIM3_UP is channel 5 of DMA1 stream 2); Betaflight, "DSHOT ESC
//! Protocol".

use super::part::pass_on_the_rest;
use rigless::{
    device::{Device, DeviceContext, Level, RegisterFile, RequestChange},
    soc::stm32f427::{
        generated::tim2::Register,
        peripherals::{
            CONTROLLERS,
            dma::{Dma, Wire},
            tim::{Channel, Counter, General, Tim, UPDATE_REQUEST},
        },
    },
    time::{EventId, VirtualNanos},
};
use std::sync::OnceLock;

/// Clock of the timer until the clock tree says otherwise: the internal oscillator.
const RESET_CLOCK_HZ: u64 = 16_000_000;
/// The channel that the ESC hears.
const CHANNEL: Channel = Channel::new(1).unwrap();
/// Bits of a frame.
const BITS: usize = 16;
/// Bit lengths of DShot300 and DShot600, ns, and what they may be off by.
const BIT_NS: [u64; 2] = [3_333, 1_667];
const TOLERANCE: f64 = 0.03;
/// High part of a 0 and of a 1, of a bit, and what an ESC still takes for it.
const HIGH: [f64; 2] = [0.375, 0.75];
const HIGH_TOLERANCE: f64 = 0.08;
/// A low level that lasts longer ends a frame, ns: two of the longer bits.
const PAUSE_NS: u64 = 6_667;
/// Pulses of the other form, ns: whole ones, and no ear is needed for them.
const PULSE_NS: std::ops::RangeInclusive<u64> = 990_000..=2_010_000;

/// DMA1 with the timer's request: TIM3_UP on channel 5 of stream 2.
pub(super) fn controller() -> Dma {
    static WIRING: OnceLock<Vec<Wire>> = OnceLock::new();
    let [dma1, _] = &CONTROLLERS;
    let wiring = WIRING.get_or_init(|| {
        let timer = Wire { instance: "TIM3", request: UPDATE_REQUEST, channel: 5, streams: &[2] };
        dma1.wiring.iter().copied().chain([timer]).collect()
    });
    Dma::new(wiring, dma1.last_data, false)
}

/// What the ESC's line carried from one pause to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SeenFrame {
    /// When its first bit began, ns.
    pub at_ns: u64,
    /// When its last bit went low, ns.
    pub ended_ns: u64,
    /// Its sixteen bits; `None` where the line carried something else.
    pub word: Option<u16>,
    /// Length of a bit, ns: between the first two rising edges.
    pub bit_ns: u64,
}

/// The ear.
#[derive(Debug, Default)]
struct Line {
    high: bool,
    /// Rising and falling edge of each high level since the last pause.
    highs: Vec<(u64, u64)>,
    rose: u64,
    seen: Vec<SeenFrame>,
}

impl Line {
    fn level(&mut self, now: u64, high: bool) {
        if high == self.high {
            return;
        }
        self.high = high;
        if high {
            self.pause(now);
            self.rose = now;
        } else {
            self.highs.push((self.rose, now));
        }
    }

    /// The line is low until `now`: ends what was heard before, where it was low for long enough.
    fn pause(&mut self, now: u64) {
        if self.highs.last().is_none_or(|(_, fell)| now.saturating_sub(*fell) < PAUSE_NS) {
            return;
        }
        let highs = std::mem::take(&mut self.highs);
        if !matches!(highs[..], [(rose, fell)] if PULSE_NS.contains(&(fell - rose))) {
            self.seen.push(read(&highs));
        }
    }
}

/// What an ESC makes of these high levels.
fn read(highs: &[(u64, u64)]) -> SeenFrame {
    let ([(first, _), ..], [.., (_, last)]) = (highs, highs) else { unreachable!("something was heard") };
    let bit_ns = highs.get(1).map_or(0, |(rose, _)| rose - first);
    let near = |value: f64, wanted: f64, by: f64| (value - wanted).abs() <= by;
    let nominal = BIT_NS.into_iter().map(|ns| ns as f64).find(|ns| near(bit_ns as f64, *ns, TOLERANCE * ns));
    let word = nominal.filter(|_| highs.len() == BITS).and_then(|nominal| {
        let even = highs.windows(2).all(|pair| near((pair[1].0 - pair[0].0) as f64, nominal, TOLERANCE * nominal));
        let bit = |(rose, fell): &(u64, u64)| {
            let high = (fell - rose) as f64 / nominal;
            HIGH.into_iter().position(|wanted| near(high, wanted, HIGH_TOLERANCE))
        };
        let bits = highs.iter().try_fold(0u16, |word, high| bit(high).map(|bit| word << 1 | bit as u16));
        bits.filter(|_| even)
    });
    SeenFrame { at_ns: *first, ended_ns: *last, word, bit_ns }
}

/// TIM3.
#[derive(Debug)]
pub(super) struct HeardTimer {
    pub(super) inner: Tim<General>,
    line: Line,
}

impl HeardTimer {
    /// In place of `timer`, which is left without a clock of its own.
    pub(super) fn new(timer: &mut Tim<General>) -> Self {
        Self { inner: std::mem::replace(timer, Tim::with_clock(RESET_CLOCK_HZ, Counter::Narrow)), line: Line::default() }
    }

    /// Goes on with the timer that a reset has made; the pin falls at `at`.
    pub(super) fn restart(&mut self, at: VirtualNanos, timer: &mut Tim<General>) {
        self.line.level(at.0, false);
        self.inner = std::mem::replace(timer, Tim::with_clock(RESET_CLOCK_HZ, Counter::Narrow));
    }

    /// What the line carried and has ended before `now`.
    pub(super) fn frames(&mut self, now: VirtualNanos) -> Vec<SeenFrame> {
        if !self.line.high {
            self.line.pause(now.0);
        }
        std::mem::take(&mut self.line.seen)
    }

    fn listen(&mut self, file: &RegisterFile, now: VirtualNanos) {
        self.line.level(now.0, self.inner.output(CHANNEL, file) == Some(Level::High));
    }
}

impl Device for HeardTimer {
    type Register = Register;

    fn layout(&self) -> &'static [rigless::soc::RegisterSpec] {
        Device::layout(&self.inner)
    }

    fn read(&mut self, register: Register, file: &mut RegisterFile, context: &mut DeviceContext<'_>) -> Option<u64> {
        let value = Device::read(&mut self.inner, register, file, context);
        self.listen(file, context.now());
        value
    }

    fn write(&mut self, register: Register, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::write(&mut self.inner, register, value, file, context);
        self.listen(file, context.now());
    }

    fn on_event(&mut self, event: EventId, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_event(&mut self.inner, event, file, context);
        self.listen(file, context.now());
    }

    pass_on_the_rest!();
}
