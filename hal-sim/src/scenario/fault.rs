//! Faults of the line, the supply and the pins, at an instant of the run.
//!
//! What it is: what a scenario's `[[fault]]` tables hold. A run with faults is recorded to its end whatever the board does about them.
//! What can go wrong: faults of the I2C bus concern the IMU board; in a run of the rig nothing is on that bus.
//! Units: s of the run's own time; probability.
//! Reference: specification `rig.md`, "The simulator" (faults at any time).

use super::Scenario;
use crate::imu::BusFault;
use serde::{Deserialize, Serialize};

/// A fault and its window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScheduledFault {
    /// Begin, s.
    pub from_s: f64,
    /// End, s.
    pub until_s: f64,
    /// What happens.
    #[serde(flatten)]
    pub kind: FaultKind,
}

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "id", rename_all = "snake_case", deny_unknown_fields)]
pub enum FaultKind {
    /// The host's bytes do not reach the board.
    LinkLost,
    /// Frames of the board do not reach the host.
    TelemetryDropped {
        /// Probability of each frame.
        probability: f64,
    },
    /// Bytes of the board arrive with a bit turned over.
    TelemetryCorrupted {
        /// Probability of each byte.
        probability: f64,
    },
    /// Board and ESC have no supply; the board starts again at the end of the window.
    BrownOut,
    /// An ADC pin sits at an end of its range.
    AdcStuck {
        /// 0 thrust, 1 torque, 2 current, 3 voltage, 4 temperature.
        channel: u8,
        /// At the reference; otherwise at ground.
        high: bool,
    },
    /// A chip of the IMU board does not answer.
    I2cNack {
        /// 0 gyro, 1 accelerometer, 2 magnetometer.
        chip: u8,
    },
    /// A chip of the IMU board holds SDA low.
    I2cStuck,
    /// The line of the ESC's telemetry is cut.
    EscTelemetryCut,
    /// Bytes of the ESC's telemetry come as others.
    EscTelemetryNoisy {
        /// Probability of each byte.
        probability: f64,
    },
    /// The ESC sends its telemetry at another rate.
    EscTelemetryBaud {
        /// Which.
        baud: u32,
    },
    /// The back-EMF meter is unplugged.
    BackEmfCut,
}

impl ScheduledFault {
    /// Whether it happens `run_s` into the run (negative before it).
    #[must_use]
    pub fn is_on(&self, run_s: f64) -> bool {
        (self.from_s..self.until_s).contains(&run_s)
    }
}

impl BusFault {
    /// The fault that a scenario schedules, its times counted from power-up of the board; the first one, for the board takes one a run.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self::first(&scenario.faults)
    }

    /// The first fault of the bus among `faults`.
    #[must_use]
    pub fn first(faults: &[ScheduledFault]) -> Self {
        let ns = |s: f64| (s * 1.0e9) as u64;
        let fault = faults.iter().find_map(|fault| match fault.kind {
            FaultKind::I2cNack { chip } => {
                Some(Self::LoosePlug { nth: usize::from(chip), off_ns: ns(fault.from_s), back_ns: ns(fault.until_s) })
            }
            FaultKind::I2cStuck => Some(Self::held(ns(fault.from_s))),
            _ => None,
        });
        fault.unwrap_or_default()
    }
}
