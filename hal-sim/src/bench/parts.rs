//! What a bench is built of, and what it gives.
//!
//! What it is: the parts before and after the effects have changed them, the truth at one instant, what a millisecond brings the board.
//! What can go wrong: nothing here fails.
//! Units: each field carries its own.
//! Reference: specification `rig.md`, "The simulator".

use crate::effect::Scheduled;
use crate::plant::{Beam, Bridge, Esc, Mount, Parts, PlantState};
use crate::sensor::{EscErrors, Geometry};
use firmware_rig::AdcBlock;
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};

/// Everything that a bench is built of. Effects may change it before the run.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchParts {
    /// The powerplant's parts.
    pub plant: Parts,
    /// The ESC's dialogue.
    pub esc: Esc,
    /// Cantilever.
    pub beam: Beam,
    /// Bridge and amplifier.
    pub bridge: Bridge,
    /// Joints of motor and torque arm.
    pub mount: Mount,
    /// Speed sensors.
    pub geometry: Geometry,
    /// The ESC's own sensors.
    pub esc_errors: EscErrors,
    /// It sends its telemetry only when it is asked.
    pub telemetry_asked: bool,
    /// Standard deviation of the mean over 0.1 s of each analogue channel, in its unit.
    pub noise: [f64; ADC_CHANNELS],
}

/// What is really there at one instant, for judging what was measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Truth {
    /// Seconds since run start; negative before.
    pub run_s: f64,
    /// Pulse that the ESC follows, us.
    pub pulse_us: f64,
    /// Powerplant.
    pub plant: PlantState,
    /// Force that the gauges see, N.
    pub beam_n: f64,
    /// What the back-EMF meter shows, rev/min; a board counts its comparator's edges itself.
    pub back_emf_rpm: Option<f64>,
}

/// What the board's peripherals gathered in one millisecond.
#[derive(Debug, Clone, Default)]
pub struct Millisecond {
    /// Rising edges of each capture channel, ticks modulo 2^32.
    pub edges: [Vec<u32>; CAPTURE_CHANNELS],
    /// Conversions of each ADC channel.
    pub adc: [AdcBlock; ADC_CHANNELS],
    /// The ADC channel of which every single conversion is to stand in `codes`.
    pub watched: Option<usize>,
    /// Those conversions, in order.
    pub codes: Vec<u16>,
    /// Bytes of the ESC's telemetry that have ended, as [`firmware_rig::Beside::esc`] has them.
    pub esc: Vec<u16>,
    /// Rising edges of the back-EMF meter, ticks modulo 2^32.
    pub back_emf: Vec<u32>,
}

/// What of the cross-checks a board listens to: the rest is not reckoned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Listens {
    /// The ESC's telemetry.
    pub esc: bool,
    /// The back-EMF meter.
    pub back_emf: bool,
}

/// Conversions of a channel in a second of a native run: eight and nine in a millisecond by turns.
pub const CONVERSION_HZ: f32 = 8_500.0;

/// Bits of the effects whose windows are open `run_s` into the run. A scenario holds at most 128 effects.
pub(super) fn open(effects: &[Scheduled], run_s: f64) -> u128 {
    effects.iter().enumerate().filter(|(_, e)| e.is_open(run_s)).fold(0, |bits, (i, _)| bits | 1 << i)
}

/// The parts with the effects of `open` fitted.
pub(super) fn fitted(base: &BenchParts, effects: &[Scheduled], open: u128) -> BenchParts {
    let mut parts = base.clone();
    for (_, effect) in effects.iter().enumerate().filter(|(i, _)| open & (1 << i) != 0) {
        effect.fit(&mut parts);
    }
    parts
}
