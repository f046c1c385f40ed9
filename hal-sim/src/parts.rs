//! What a rig is built of.
//!
//! What it is: the parts of plant, beam and sensors as they are before a run. Effects change them; the bench integrates them.
//! What can go wrong: nothing here fails.
//! Units: each field carries its own.
//! Reference: specification `rig.md`, "The simulator".

use crate::plant::{Beam, Bridge, Esc, Mount, Parts};
use crate::sensor::{EscErrors, Geometry};
use frame::rig::ADC_CHANNELS;

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
