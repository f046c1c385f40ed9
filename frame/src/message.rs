//! What travels between board and host.
//!
//! What it is: the two message sets, board to host ([`Message`]) and host to board ([`Command`]).
//! What can go wrong: a message of a newer protocol version is refused by the codec and counted.
//! Units: as in [`crate::rig`].
//! Reference: specification `formats.md`, "Telemetry"; `rig.md`, "Acquisition".

use crate::calibration::Calibration;
use crate::imu::ImuSample;
use crate::rig::{FaultSet, Refusals, RigSample, RigState};
use crate::units::{PulseWidth, Ticks};
use serde::{Deserialize, Serialize};

/// Which board speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BoardId {
    /// The motor rig.
    Rig,
    /// The IMU board.
    Ahrs,
}

/// First message after reset and the answer to `Identify`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Hello {
    /// Which board.
    pub board: BoardId,
    /// Firmware version, major.minor.patch.
    pub firmware: [u8; 3],
    /// Core clock, Hz.
    pub core_hz: u32,
    /// Reset cause: bits 31..24 of RCC_CSR (RM0090 section 7.3.21), shifted down.
    pub reset_cause: u8,
    /// IMU board: bit 0 gyro, 1 accelerometer, 2 magnetometer identified. Rig board: bit mask of fitted capture channels.
    pub present: u8,
}

/// Something happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event {
    /// The arming machine changed its state.
    State {
        /// Where it was.
        from: RigState,
        /// Where it is.
        to: RigState,
        /// When.
        at: Ticks,
    },
    /// Faults latched.
    Faults {
        /// All that are latched now.
        faults: FaultSet,
        /// When.
        at: Ticks,
    },
    /// A command was refused, with every reason.
    Refused(Refusals),
    /// A command was taken.
    Accepted,
    /// The schedule came to its end.
    ScheduleDone {
        /// When.
        at: Ticks,
    },
}

/// Board to host.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// Who speaks.
    Hello(Hello),
    /// The calibration that turns the raw codes into physical values.
    Calibration(Calibration),
    /// One instant of the rig.
    Rig(RigSample),
    /// One instant of the IMU board.
    Imu(ImuSample),
    /// Something happened.
    Event(Event),
}

/// Most steps that one uploaded schedule may hold.
pub const MAX_UPLOAD: usize = 64;

/// Host to board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Keep-alive; the link time-out counts from the last valid command of any kind.
    Ping,
    /// Say who you are.
    Identify,
    /// Start the normal arming procedure.
    Arm,
    /// Start the throttle-range calibration; `confirm` must be [`Command::CALIBRATE_CONFIRM`].
    CalibrateRange {
        /// Guards against a stray command.
        confirm: u32,
    },
    /// The operator has heard a beep pattern or pressed its key.
    Beep(Beep),
    /// Clear the upload buffer and append a first step, or append a further one.
    ScheduleStep {
        /// Position in the schedule; 0 clears what was there.
        index: u8,
        /// Pulse to go to.
        pulse: PulseWidth,
        /// How long to hold it, milliseconds.
        hold_ms: u32,
        /// Ramp linearly from the last pulse during the hold instead of stepping.
        ramp: bool,
    },
    /// Run the uploaded schedule.
    RunSchedule,
    /// Run the built-in up-down staircase or one of its relatives.
    RunStaircase {
        /// Step height.
        step: PulseWidth,
        /// Hold of each level, milliseconds.
        hold_ms: u32,
        /// Highest level.
        top: PulseWidth,
        /// Come down again by the same levels.
        down: bool,
    },
    /// Manual override.
    SetPulse(PulseWidth),
    /// Minimum throttle, now.
    Stop,
    /// Take the present strain and torque as zero.
    Tare,
    /// The operator clears the latched faults.
    ClearFaults,
}

impl Command {
    /// The word that confirms a range calibration ("CALI").
    pub const CALIBRATE_CONFIRM: u32 = 0x4341_4C49;
}

/// ESC beep patterns as events (Beharie 2013, Appendix C).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Beep {
    /// One long beep: minimum throttle recognised.
    Long,
    /// n short beeps: number of cells.
    Cells(u8),
    /// "1-2-3": ready to run.
    Ready,
    /// Two beeps: maximum throttle stored.
    Double,
    /// The special tone of the programming mode.
    Programming,
    /// Continuous beeping: no signal.
    NoSignal,
    /// Twenty short beeps: self-test failed.
    SelfTestFailed,
}
