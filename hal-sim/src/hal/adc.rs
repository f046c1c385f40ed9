//! A converter that scans five channels into a ring.
//!
//! What it is: one conversion after the other, each of the pin's voltage at its own instant, put where a circular DMA would put it.
//! What can go wrong: a ring that is not drained in time is lapped, and only its last round is left.
//! Units: codes of 12 bits; ns since power-up.
//! Reference: RM0090 sections 13.4 (12 cycles after the sampling time) and 13.8 (DMA and scan); converter clock 21 MHz.

use super::pins::RigPins;
use firmware_rig::AdcBlock;
use frame::rig::ADC_CHANNELS;
use std::collections::VecDeque;

/// Scans in the ring, as on the board.
const SCANS: usize = 1024;
/// Cycles of a conversion beyond its sampling time.
const CONVERTING: u64 = 12;
/// Converter clock, MHz.
const CLOCK_MHZ: u64 = 21;

/// What converter and DMA do by themselves.
#[derive(Debug)]
pub(super) struct Scan {
    begin_ns: u64,
    /// Scans since then.
    done: u64,
    cycles: u64,
    ring: VecDeque<[u16; ADC_CHANNELS]>,
}

impl Scan {
    /// End of the scan that runs, ns.
    pub(super) fn next_ns(&self) -> u64 {
        self.begin_ns + (self.done + 1) * ADC_CHANNELS as u64 * (self.cycles + CONVERTING) * 1000 / CLOCK_MHZ
    }

    pub(super) fn take(&mut self, convert: impl FnMut(usize) -> u16) {
        let codes: Vec<u16> = (0..ADC_CHANNELS).map(convert).collect();
        if self.ring.len() == SCANS {
            self.ring.clear(); // lapped: head and tail meet, and the board counts the ring as empty
        }
        self.ring.extend(<[u16; ADC_CHANNELS]>::try_from(codes));
        self.done += 1;
    }
}

/// The converter.
pub struct ScanConverter {
    pins: RigPins,
    life: u32,
}

impl ScanConverter {
    /// Starts the scan with `cycles` of sampling time for each channel.
    #[must_use]
    pub fn start(pins: &RigPins, cycles: u16) -> Self {
        let begin_ns = pins.clock().now_ns();
        let mut behind = pins.now();
        behind.scan = Some(Scan { begin_ns, done: 0, cycles: u64::from(cycles), ring: VecDeque::new() });
        Self { pins: pins.clone(), life: behind.life }
    }

    /// The whole scans since the last call.
    pub fn drain(&mut self) -> [AdcBlock; ADC_CHANNELS] {
        let mut blocks = [AdcBlock::default(); ADC_CHANNELS];
        let mut behind = self.pins.now();
        if behind.life == self.life
            && let Some(scan) = &mut behind.scan
        {
            for codes in scan.ring.drain(..) {
                blocks.iter_mut().zip(codes).for_each(|(block, code)| block.push(code));
            }
        }
        blocks
    }
}
