//! One instant of the rig: raw codes with their verdicts.
//!
//! What it is: what the rig board measures and commands at one tick, before any conversion.
//! What can go wrong: each code carries a verdict (`Missed`, `Saturated`, ...); the host decides what to do with it.
//! Units: capture-timer ticks, ADC counts, nanoseconds of pulse.
//! Reference: specification `rig.md`, "Four RPM capture channels" and "Acquisition".

use crate::esc::EscCode;
use crate::units::{PulseWidth, Ticks};
pub use esc_pwm::{Fault, FaultSet, Refusals, State as RigState};
use serde::{Deserialize, Serialize};

/// Number of RPM capture channels: beam, reflective opto, hall, encoder, in this order.
pub const CAPTURE_CHANNELS: usize = 4;
/// Number of ADC channels: strain, torque, current, voltage, temperature, in this order.
pub const ADC_CHANNELS: usize = 5;
/// Log column of each capture channel.
pub const CAPTURE_NAMES: [&str; CAPTURE_CHANNELS] = ["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder"];
/// Parts of a period in which a channel's unevenness is told.
pub const UNEVEN_PARTS: u16 = 10_000;
/// Log column of what each capture channel tells of its marks.
pub const UNEVEN_NAMES: [&str; CAPTURE_CHANNELS] =
    ["uneven_beam_deg", "uneven_opto_deg", "uneven_hall_deg", "uneven_encoder_deg"];
/// Log column of each ADC channel.
pub const ADC_NAMES: [&str; ADC_CHANNELS] = ["thrust_n", "torque_nm", "current_a", "voltage_v", "temp_c"];

/// What a capture channel says of its own reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum CaptureVerdict {
    /// Whole revolutions between two edges of the same mark.
    Nominal,
    /// No edge within the time-out: the rotor stands.
    #[default]
    Stopped,
    /// Edges have stopped coming although the speed was known.
    Lost,
    /// The timer's over-capture flag was set: an edge was overwritten.
    OverCapture,
    /// Edges are missing from the pattern.
    Missed,
    /// Edges too many in the pattern.
    Doubled,
    /// Periods alternate (two marks not opposite, or a wrong polarity).
    Alternating,
    /// Disagrees with the other channels.
    Disagrees,
    /// This channel is not fitted.
    Absent,
    /// A twisted blade breaks the beam early: the time from blade to blade over-reads at high speed (Beharie 2013, Fig. 5.54).
    BladeTwist,
}

/// Raw reading of one capture channel: `edges` equal marks passed in `span` timer ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CaptureCode {
    /// Edges in the span, a whole number of revolutions' worth; 0 when stopped.
    pub edges: u16,
    /// Span in ticks of the capture timer.
    pub span: u32,
    /// What the channel says of it.
    pub verdict: CaptureVerdict,
    /// How unevenly two to four marks stand: half the spread of the periods of one revolution about their neighbours' mean, over their mean, in
    /// 1/[`UNEVEN_PARTS`]; of two marks that is the difference of their periods. A span over whole revolutions does not show it. 0 where it is
    /// not known: another number of marks, or too few periods.
    pub uneven: u16,
}

/// What an ADC channel says of its own reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum AdcVerdict {
    /// Within range.
    Nominal,
    /// Some conversion touched either end of the range.
    Saturated,
    /// Every conversion sat at the low end of a channel whose zero is alive: the wire is open (inputs are pulled down) or lies on ground.
    Open,
    /// No conversion in this interval.
    #[default]
    Missing,
    /// Every conversion sat at the high end: a short to the supply, or an amplifier that its wire drives there.
    Short,
    /// This channel is not fitted.
    Absent,
}

impl AdcVerdict {
    /// Every conversion sat at one end: the channel reads nothing.
    #[must_use]
    pub const fn is_stuck(self) -> bool {
        matches!(self, Self::Open | Self::Short)
    }
}

/// Raw reading of one ADC channel over one logging interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdcCode {
    /// Sum of the conversions, counts.
    pub sum: u32,
    /// Number of conversions; 0 means missing.
    pub count: u16,
    /// Root mean square about the mean, 1/256 counts.
    pub rms_q8: u32,
    /// What the channel says of it.
    pub verdict: AdcVerdict,
}

/// Everything that the rig board knows at one logging instant, raw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RigSample {
    /// End of the logging interval.
    pub at: Ticks,
    /// Pulse that the timer was told to give.
    pub pulse: PulseWidth,
    /// State of the arming machine.
    pub state: RigState,
    /// Latched faults.
    pub faults: FaultSet,
    /// Capture channels: beam, reflective, hall, encoder.
    pub rpm: [CaptureCode; CAPTURE_CHANNELS],
    /// ADC channels: strain, torque, current, voltage, temperature.
    pub adc: [AdcCode; ADC_CHANNELS],
    /// What the ESC tells of itself; `None` where its telemetry is not fitted.
    pub esc: Option<EscCode>,
    /// Back-EMF meter: `edges` electrical turns passed in `span`. A cross-check: no consensus has it in. `None` where it is not fitted.
    pub back_emf: Option<CaptureCode>,
}
