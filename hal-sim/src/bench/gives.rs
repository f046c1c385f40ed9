//! What a bench gives.
//!
//! What it is: the truth at one instant, what a millisecond brings the board.
//! What can go wrong: nothing here fails.
//! Units: each field carries its own.
//! Reference: specification `rig.md`, "The simulator".

use crate::plant::PlantState;
use firmware_rig::AdcBlock;
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};

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
