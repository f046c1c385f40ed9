//! ADC1 and the DMA stream that empties it.
//!
//! What it is: the converter draws noise for every single conversion. While it scans continuously into a circular stream, what the
//! rig's image lets it do, nothing can see a conversion before the firmware reads how far the stream is. So conversions are made up
//! by then, with the levels of their own instants, and reach the memory as one block: the same codes as one event a conversion, at a
//! small part of its cost. Any other use goes to the emulator's own models, one event a conversion.
//! What can go wrong: EOC, the data register and the stream's half and complete flags stand still in a block run; a stream that wants
//! their interrupts gets no blocks. A stream that is switched off under a running converter is an overrun, as on the part.
//! Units: counts of 12 bits; ns.
//! Reference: RM0090 sections 13.8 (DMA and overrun), 13.13 (registers), 10.5.5 (stream).

use crate::noise::{Source, Stream};
use rigless::{
    device::{Device, DeviceContext, RegisterFile, RequestChange},
    soc::{
        Width,
        stm32f427::{
            generated::{adc1::Register as AdcRegister, dma2::Register as DmaRegister},
            peripherals::{
                CONTROLLERS,
                adc::{Adc, Channel},
                dma::Dma,
            },
        },
    },
    time::{EventId, Run, VirtualNanos},
};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Clock of the converter until the clock tree says otherwise.
const RESET_CLOCK_HZ: u64 = 8_000_000;
/// Units of a converter input in one count: the model answers input x 4095 / reference, rounded down.
pub(super) const ADC_UNITS: u32 = 1000;
/// Channels whose level and noise are set from outside.
const CHANNELS: usize = 16;
/// Cycles of a conversion beside its sampling time, at twelve bits. RM0090 section 13.5.
const TWELVE_BITS: u64 = 12;
/// Sampling time by the three bits of SMPx, cycles. RM0090 section 13.13.4.
const SAMPLING: [u64; 8] = [3, 15, 28, 56, 84, 112, 144, 480];

/// CR1: a scan and nothing else. RM0090 section 13.13.2.
const SCAN: u64 = 1 << 8;
/// CR2: on, continuous, by DMA without an end. RM0090 section 13.13.3.
const CONTINUOUS: u64 = 1 | 1 << 1 | 1 << 8 | 1 << 9;
const SWSTART: u64 = 1 << 30;
/// SR: overrun. RM0090 section 13.13.1.
const OVR: u64 = 1 << 5;

/// S0CR: enabled, circular, from the peripheral, half words, incrementing memory, channel 0. RM0090 section 10.5.5.
const CIRCLE: u64 = 1 | 1 << 8 | 1 << 10 | 1 << 11 | 1 << 13;
/// What may differ: priority, and the interrupts of errors that a block never makes.
const ANY: u64 = 3 << 16 | 1 << 2 | 1 << 1;
/// S0FCR: the FIFO is in use.
const DMDIS: u64 = 1 << 2;
/// Address of ADC1's data register. RM0090 section 2.3, table 1; section 13.13.14.
const DATA_REGISTER: u64 = 0x4001_204c;
/// Controller and token of the blocks' own stores; the model counts its tokens from zero.
const DMA2: usize = 1;
const BLOCK: u64 = u64::MAX;

/// What stands at the pins, and the block run.
#[derive(Debug)]
struct Analogue {
    level: [f64; CHANNELS],
    used: [bool; CHANNELS],
    noise: f64,
    stopped: bool,
    turn: usize,
    stream: Stream,
    scan: Option<Scan>,
    /// The stream takes blocks.
    circle: bool,
    /// The stream was switched off under the scan.
    overrun: bool,
    /// Conversions that ended since the stream was asked.
    codes: Vec<u16>,
}

/// A continuous scan in its block run.
#[derive(Debug)]
struct Scan {
    /// Cycles of each conversion of the sequence, with its channel.
    sequence: Vec<(usize, u64)>,
    position: usize,
    /// Ends when the conversion in flight does.
    run: Run,
    hz: u64,
}

impl Analogue {
    /// What `channel` reads at this instant. The thresholds of an ideal converter lie half a count below each code.
    fn draw(&mut self, channel: usize) -> u16 {
        let [noise, _] = self.stream.quick_normals();
        let counts = self.level[channel] + self.noise * noise + 0.5;
        (counts.max(0.0) as u32).min(4095) as u16
    }

    /// Makes up the conversions that ended until `now`.
    fn catch_up(&mut self, now: VirtualNanos) {
        let Some(mut scan) = self.scan.take() else { return };
        while scan.run.ends <= now {
            let (channel, _) = scan.sequence[scan.position];
            let code = self.draw(channel);
            self.codes.push(code);
            scan.position = (scan.position + 1) % scan.sequence.len();
            let (_, cycles) = scan.sequence[scan.position];
            scan.run.extend(u128::from(cycles), scan.hz);
        }
        self.scan = Some(scan);
    }
}

/// ADC1.
#[derive(Debug)]
pub(super) struct NoisyAdc {
    inner: Adc,
    hz: u64,
    analogue: Arc<Mutex<Analogue>>,
}

impl NoisyAdc {
    /// In place of `inner`.
    pub(super) fn new(inner: Adc) -> Self {
        let analogue = Analogue {
            level: [0.0; CHANNELS],
            used: [false; CHANNELS],
            noise: 0.0,
            stopped: false,
            turn: 0,
            stream: Stream::new(1, Source::Adc, 99),
            scan: None,
            circle: false,
            overrun: false,
            codes: Vec::new(),
        };
        Self { inner, hz: RESET_CLOCK_HZ, analogue: Arc::new(Mutex::new(analogue)) }
    }

    /// The controller whose stream empties this converter.
    pub(super) fn controller(&self) -> BlockDma {
        BlockDma { inner: plain_controller(), analogue: Arc::clone(&self.analogue), base: 0, length: 0, index: 0 }
    }

    /// A converter as a reset leaves it, at the same pins.
    pub(super) fn restart(&mut self) {
        let mut fresh = Adc::with_clock(RESET_CLOCK_HZ);
        fresh.inherit(&self.inner);
        self.inner = fresh;
        self.hz = RESET_CLOCK_HZ;
        let mut analogue = self.analogue();
        (analogue.scan, analogue.circle, analogue.overrun) = (None, false, false);
        analogue.codes.clear();
    }

    fn analogue(&self) -> MutexGuard<'_, Analogue> {
        self.analogue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Level of a channel from `at` on, counts.
    pub(super) fn set_level(&mut self, at: VirtualNanos, channel: u8, counts: f64) {
        let mut analogue = self.analogue();
        analogue.catch_up(at);
        let Analogue { level, used, .. } = &mut *analogue;
        if let Some((level, used)) = level.get_mut(usize::from(channel)).zip(used.get_mut(usize::from(channel))) {
            (*level, *used) = (counts, true);
        }
    }

    /// Standard deviation of the noise of a conversion from `at` on, counts.
    pub(super) fn set_noise(&mut self, at: VirtualNanos, counts: f64) {
        let mut analogue = self.analogue();
        analogue.catch_up(at);
        analogue.noise = counts;
    }

    /// No conversion ends any more after `at`; or the next one that is started does.
    pub(super) fn stop(&mut self, at: VirtualNanos, stopped: bool) {
        let mut analogue = self.analogue();
        analogue.catch_up(at);
        analogue.stopped = stopped;
        if stopped {
            analogue.scan = None;
        }
    }

    /// The stream misses a conversion at `at`: an overrun, until the flag is taken down and the converter begins anew.
    pub(super) fn overrun(&mut self, at: VirtualNanos) {
        let mut analogue = self.analogue();
        analogue.catch_up(at);
        (analogue.scan, analogue.overrun) = (None, true);
    }

    /// Puts on the pin what the next conversion of the emulator's own model reads.
    fn draw(&mut self) {
        let mut analogue = self.analogue.lock().unwrap_or_else(PoisonError::into_inner);
        for _ in 0..CHANNELS {
            analogue.turn = (analogue.turn + 1) % CHANNELS;
            let turn = analogue.turn;
            if let (true, Some(channel)) = (analogue.used[turn], Channel::new(turn as u8)) {
                let code = analogue.draw(turn);
                self.inner.set_input(channel, u32::from(code) * ADC_UNITS + ADC_UNITS / 2);
                return;
            }
        }
    }

    /// The regular sequence as the registers have it; `None` where it holds an internal channel.
    fn sequence(file: &RegisterFile) -> Option<Vec<(usize, u64)>> {
        let long = (file.get(AdcRegister::Sqr1) >> 20 & 0xf) as usize + 1;
        let ranks = [(AdcRegister::Sqr3, 6), (AdcRegister::Sqr2, 6), (AdcRegister::Sqr1, 4)];
        let channels = ranks.iter().flat_map(|(r, n)| (0..*n).map(|k| (file.get(*r) >> (5 * k) & 31) as usize));
        let timed = |channel: usize| {
            let (register, nth) = if channel < 10 { (AdcRegister::Smpr2, channel) } else { (AdcRegister::Smpr1, channel - 10) };
            (channel < CHANNELS).then(|| (channel, SAMPLING[(file.get(register) >> (3 * nth) & 7) as usize] + TWELVE_BITS))
        };
        channels.take(long).map(timed).collect()
    }

    /// Begins a block run where the registers allow one.
    fn begins(&mut self, now: VirtualNanos, file: &RegisterFile) -> bool {
        let hz = self.hz;
        let mut analogue = self.analogue();
        let plain = file.get(AdcRegister::Cr1) == SCAN && file.get(AdcRegister::Cr2) == CONTINUOUS | SWSTART;
        let free = analogue.circle && !analogue.stopped && !analogue.overrun && analogue.scan.is_none();
        let Some(sequence) = Self::sequence(file).filter(|_| plain && free && hz > 0) else { return false };
        let mut run = Run::at(now);
        run.extend(u128::from(sequence[0].1), hz);
        analogue.scan = Some(Scan { sequence, position: 0, run, hz });
        true
    }
}

impl Device for NoisyAdc {
    type Register = AdcRegister;

    fn read(&mut self, register: AdcRegister, file: &mut RegisterFile, context: &mut DeviceContext<'_>) -> Option<u64> {
        let value = Device::read(&mut self.inner, register, file, context);
        if register == AdcRegister::Sr && self.analogue().overrun {
            return Some(value.unwrap_or_else(|| file.get(register)) | OVR);
        }
        value
    }

    fn write(&mut self, register: AdcRegister, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let now = context.now();
        self.analogue().catch_up(now);
        if register == AdcRegister::Sr && value & OVR == 0 {
            self.analogue().overrun = false;
        }
        let refused = self.analogue().overrun;
        if register == AdcRegister::Cr2 && (refused || self.begins(now, file)) {
            let started = file.get(AdcRegister::Cr2) & !SWSTART;
            file.set(AdcRegister::Cr2, started);
        }
        Device::write(&mut self.inner, register, value, file, context);
        let mut analogue = self.analogue.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(scan) = &mut analogue.scan {
            let goes_on = file.get(AdcRegister::Cr1) == SCAN && file.get(AdcRegister::Cr2) == CONTINUOUS;
            match Self::sequence(file).filter(|s| goes_on && s.len() == scan.sequence.len()) {
                Some(sequence) => scan.sequence = sequence,
                None => analogue.scan = None,
            }
        }
    }

    fn on_event(&mut self, event: EventId, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if !self.analogue().stopped {
            self.draw();
            Device::on_event(&mut self.inner, event, file, context);
        }
    }

    fn on_clock(&mut self, hz: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let mut analogue = self.analogue.lock().unwrap_or_else(PoisonError::into_inner);
        analogue.catch_up(context.now());
        if let Some(scan) = analogue.scan.as_mut().filter(|scan| scan.hz != hz) {
            scan.hz = hz;
            scan.run.drop_carry();
        }
        if hz == 0 {
            analogue.scan = None;
        }
        drop(analogue);
        self.hz = hz;
        Device::on_clock(&mut self.inner, hz, file, context);
    }

    fn peek(&self, register: AdcRegister, file: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        Device::peek(&self.inner, register, file, now)
    }

    fn on_request(&mut self, request: RequestChange, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_request(&mut self.inner, request, file, context);
    }

    fn reset(&mut self) {
        Device::reset(&mut self.inner);
        let mut analogue = self.analogue();
        (analogue.scan, analogue.overrun) = (None, false);
    }

    fn reset_line(&mut self, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::reset_line(&mut self.inner, file, context);
        let mut analogue = self.analogue();
        (analogue.scan, analogue.overrun) = (None, false);
    }
}

/// The emulator's own model of DMA2.
fn plain_controller() -> Dma {
    Dma::new(CONTROLLERS[DMA2].wiring, CONTROLLERS[DMA2].last_data, true)
}

/// DMA2, whose stream 0 takes the converter's codes by blocks.
#[derive(Debug)]
pub(super) struct BlockDma {
    inner: Dma,
    analogue: Arc<Mutex<Analogue>>,
    /// Address and length (half words) of the circle, and where in it the next code goes.
    base: u64,
    length: usize,
    index: usize,
}

impl BlockDma {
    /// Stores what was converted until now; how many half words are left to the end of the circle.
    fn deliver(&mut self, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let mut analogue = self.analogue.lock().unwrap_or_else(PoisonError::into_inner);
        analogue.catch_up(context.now());
        if !analogue.circle || analogue.codes.is_empty() {
            return;
        }
        let codes = std::mem::take(&mut analogue.codes);
        drop(analogue);
        let lapped = codes.len().saturating_sub(self.length);
        self.index = (self.index + lapped) % self.length;
        let mut rest = &codes[lapped..];
        while let [first, others @ ..] = rest {
            let address = self.base + 2 * self.index as u64;
            let step = match rest {
                [a, b, c, d, ..] if address.is_multiple_of(8) && self.index + 4 <= self.length => {
                    let word = [*a, *b, *c, *d].iter().rev().fold(0, |word, code| word << 16 | u64::from(*code));
                    context.write_to(address, Width::W64, word, BLOCK);
                    rest = &rest[4..];
                    4
                }
                _ => {
                    context.write_to(address, Width::W16, u64::from(*first), BLOCK);
                    rest = others;
                    1
                }
            };
            self.index = (self.index + step) % self.length;
        }
        file.set(DmaRegister::S0ndtr, (self.length - self.index) as u64);
    }

    /// Whether stream 0 takes blocks, after a write to its registers.
    fn look(&mut self, file: &RegisterFile) {
        let plain = file.get(DmaRegister::S0cr) & !ANY == CIRCLE && file.get(DmaRegister::S0fcr) & DMDIS == 0;
        let circle = plain && file.get(DmaRegister::S0par) == DATA_REGISTER && file.get(DmaRegister::S0ndtr) > 0;
        let mut analogue = self.analogue.lock().unwrap_or_else(PoisonError::into_inner);
        if circle && !analogue.circle {
            self.base = file.get(DmaRegister::S0m0ar);
            self.length = file.get(DmaRegister::S0ndtr) as usize;
            self.index = 0;
        }
        if !circle && analogue.scan.take().is_some() {
            analogue.overrun = true;
        }
        analogue.circle = circle;
    }
}

impl Device for BlockDma {
    type Register = DmaRegister;

    fn read(&mut self, register: DmaRegister, file: &mut RegisterFile, context: &mut DeviceContext<'_>) -> Option<u64> {
        if register == DmaRegister::S0ndtr {
            self.deliver(file, context);
        }
        Device::read(&mut self.inner, register, file, context)
    }

    fn write(&mut self, register: DmaRegister, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::write(&mut self.inner, register, value, file, context);
        if [DmaRegister::S0cr, DmaRegister::S0fcr].contains(&register) {
            self.deliver(file, context);
            self.look(file);
        }
    }

    fn on_event(&mut self, event: EventId, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_event(&mut self.inner, event, file, context);
    }

    fn on_access(&mut self, token: u64, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if token != BLOCK {
            Device::on_access(&mut self.inner, token, value, file, context);
        }
    }

    fn on_refused(&mut self, token: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if token != BLOCK {
            Device::on_refused(&mut self.inner, token, file, context);
        }
    }

    fn on_request(&mut self, request: RequestChange, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_request(&mut self.inner, request, file, context);
    }

    fn on_clock(&mut self, hz: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_clock(&mut self.inner, hz, file, context);
    }

    fn peek(&self, register: DmaRegister, file: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        Device::peek(&self.inner, register, file, now)
    }

    fn reset(&mut self) {
        Device::reset(&mut self.inner);
    }

    fn reset_line(&mut self, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::reset_line(&mut self.inner, file, context);
        self.look(file);
    }
}
