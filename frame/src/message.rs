//! What travels between board and host.
//!
//! What it is: the two message sets, board to host ([`Message`]) and host to board ([`Command`]).
//! What can go wrong: a message of a newer protocol version is refused by the codec and counted.
//! Units: as in [`crate::rig`].
//! Reference: specification `formats.md`, "Telemetry"; `rig.md`, "Acquisition".

use crate::calibration::Calibration;
use crate::esc::EscVerdict;
use crate::imu::ImuSample;
use crate::imu_command::{ImuCommand, ImuReport, ImuValues, TestAccel};
use crate::rig::{FaultSet, Refusals, RigSample, RigState};
use crate::schedule::{ScheduleNews, SegmentBatch, Steer};
use crate::units::{PulseWidth, Ticks};
use esc_pwm::ArmingEvent;
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

impl BoardId {
    /// Its name for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Rig => "rig",
            Self::Ahrs => "IMU",
        }
    }
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
    /// IMU board: bit 0 gyro, 1 accelerometer, 2 magnetometer, 3 test accelerometer identified. Rig board: bit mask of
    /// fitted capture channels; bit 4 the ESC's telemetry, bit 5 the back-EMF meter.
    pub present: u8,
    /// Rig board: bit mask of fitted analogue channels.
    pub analogue: u8,
    /// Rig board: CRC-32 of the configuration in force.
    pub config: u32,
}

/// Something happened.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
    /// What became of the settings in flash.
    Settings(SettingsNews),
    /// The program panicked before the last reset; told once after it.
    Panicked {
        /// Line of the source file.
        line: u32,
        /// End of the file's path, padded with zeros.
        file: [u8; 24],
    },
    /// The processor took an exception from which there is no way back, before the last reset; told once after it.
    Crashed(Crash),
    /// What the board's clock runs from; told once after a reset.
    Clock(ClockNews),
    /// The stop loop was opened or closed; after a reset told only when it is open.
    StopLoop {
        /// Open: no pulse above minimum.
        open: bool,
        /// When.
        at: Ticks,
    },
    /// How the host's schedule stands: the answer to [`Command::Segments`] and [`Command::Steer`], in the place of `Accepted` and
    /// `Refused`.
    Schedule(ScheduleNews),
    /// The ESC's telemetry is heard, or is heard no more.
    EscTelemetry {
        /// What is to be said of it now.
        verdict: EscVerdict,
        /// When.
        at: Ticks,
    },
}

/// What ended the program before the last reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Crash {
    /// Which exception.
    pub cause: CrashCause,
    /// Address of the instruction that was interrupted: look it up in the ELF file (`addr2line`).
    pub pc: u32,
    /// Link register at that moment: the caller's address, mostly.
    pub lr: u32,
    /// Configurable fault status register (ARMv7-M B3.2.15): why a hard fault came.
    pub status: u32,
}

/// An exception from which there is no way back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CrashCause {
    /// A hard fault.
    HardFault,
    /// The clock security system saw the crystal fail (RM0090 section 7.2.7).
    ClockFailed,
    /// A non-maskable interrupt that the clock security system did not raise.
    NonMaskable,
    /// An exception or interrupt that the firmware does not use: its number, negative for an exception of the core.
    Unexpected(i8),
}

impl CrashCause {
    /// What it was, for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::HardFault => "hard fault",
            Self::ClockFailed => "failure of the crystal",
            Self::NonMaskable => "non-maskable interrupt",
            Self::Unexpected(_) => "interrupt that nobody expected",
        }
    }
}

/// What the board's clock runs from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ClockNews {
    /// Frequency of the crystal in use, Hz; 0: the internal oscillator, because no crystal could be trusted.
    pub crystal_hz: u32,
    /// Frequency of the crystal as measured against the internal oscillator (known to 10 %), Hz; 0: it did not start.
    pub measured_hz: u32,
}

/// What became of the settings in flash.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SettingsNews {
    /// Nothing was stored: factory settings are in force.
    Absent,
    /// Stored settings are in force.
    Loaded,
    /// What was stored is damaged or of another version: refused, factory settings are in force.
    Damaged,
    /// Written, and read back the same.
    Saved,
    /// Could not be written; the settings in force stay until the reset.
    Failed,
}

impl SettingsNews {
    /// What came of them, for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Absent => "none were stored, the factory's are in force",
            Self::Loaded => "the stored ones are in force",
            Self::Damaged => "the stored ones are damaged, the factory's are in force",
            Self::Saved => "stored",
            Self::Failed => "could not be stored",
        }
    }
}

/// How the board is, once a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Health {
    /// Most core cycles from one tick's entry to its end, since reset.
    pub tick_cycles: u32,
    /// Most core cycles of one capture interrupt, since reset.
    pub capture_cycles: u32,
    /// Bytes of stack that were never used, since reset.
    pub stack_free: u32,
    /// Bytes of stack in all.
    pub stack_size: u32,
    /// Shortest and longest time between two ticks in the last second, timer ticks: the sampling jitter.
    pub tick_span: [u32; 2],
    /// Command frames that were good, damaged and replayed, since reset.
    pub frames: [u16; 3],
    /// Encoder steps forwards and backwards in the last second, by channel B at the edge of A; both 0 when B is not wired.
    pub steps: [u16; 2],
    /// Index marks of the encoder since reset, modulo 65 536.
    pub index: u16,
    /// Frames of the ESC's telemetry that checked, those that did not, and bytes that came with a framing, noise or overrun error, since reset,
    /// modulo 65 536.
    pub esc: [u16; 3],
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
    /// How the board is.
    Health(Health),
    /// Calibrated values of the IMU board.
    ImuValues(ImuValues),
    /// Its test accelerometer.
    TestAccel(TestAccel),
    /// What became of its calibration, and its errors.
    ImuReport(ImuReport),
    /// A part of the rig's configuration.
    ConfigPart(ConfigPart),
    /// A part of a burst of conversions.
    BurstPart(BurstPart),
}

/// Codes of a burst in one frame, in rows of 32.
pub const BURST_PART: usize = 96;

/// A part of a burst: every conversion of one analogue channel, in order and without a gap.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BurstPart {
    /// Which channel: its place among the analogue channels.
    pub channel: u8,
    /// Instant of the first conversion of the burst, to a millisecond.
    pub from: Ticks,
    /// Conversions of the channel in a second.
    pub rate_hz: f32,
    /// Conversions of the whole burst.
    pub length: u16,
    /// Which conversion this part begins with.
    pub at: u16,
    /// Codes, filled up with zeros at the end of the whole.
    pub codes: [[u16; 32]; BURST_PART / 32],
}

/// Bytes of a configuration in one frame.
pub const CONFIG_PART: usize = 32;

/// A part of the rig's configuration (postcard form of `firmware_rig::RigConfig`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConfigPart {
    /// Where it begins, bytes.
    pub at: u16,
    /// Length of the whole, bytes.
    pub length: u16,
    /// The bytes, filled up with zeros at the end of the whole.
    pub bytes: [u8; CONFIG_PART],
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
    /// Append a step to a short schedule, step by step; longer ones and other shapes: [`Command::Segments`].
    ScheduleStep {
        /// Position in the schedule; 0 begins a new one.
        index: u8,
        /// Pulse to go to.
        pulse: PulseWidth,
        /// How long to hold it, milliseconds.
        hold_ms: u32,
        /// Ramp linearly from the last pulse during the hold instead of stepping.
        ramp: bool,
    },
    /// Run the schedule that was sent, from its beginning.
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
    /// Run a staircase several times over (repeated visits).
    RunVisits {
        /// Step height.
        step: PulseWidth,
        /// Hold of each level, milliseconds.
        hold_ms: u32,
        /// Highest level.
        top: PulseWidth,
        /// Come down again by the same levels.
        down: bool,
        /// How often.
        visits: u16,
    },
    /// Run a straight line from one pulse to another.
    RunRamp {
        /// Beginning.
        from: PulseWidth,
        /// End.
        to: PulseWidth,
        /// Duration, milliseconds.
        length_ms: u32,
    },
    /// Run one level, then another.
    RunStep {
        /// Before the step.
        before: PulseWidth,
        /// After it.
        after: PulseWidth,
        /// Hold of each, milliseconds.
        hold_ms: u32,
    },
    /// Run a swept sine.
    RunChirp {
        /// Middle.
        centre: PulseWidth,
        /// Amplitude.
        amplitude: PulseWidth,
        /// Frequency at the beginning, millihertz.
        from_millihertz: u32,
        /// Frequency at the end, millihertz.
        to_millihertz: u32,
        /// Duration, milliseconds.
        length_ms: u32,
    },
    /// Change one setting; only while disarmed.
    Configure(Setting),
    /// Store the configuration in force, its calibrated scales included, in flash; only while disarmed.
    SaveSettings,
    /// Try the last resort on purpose; `confirm` must be [`Command::SELF_TEST_CONFIRM`]; only while disarmed. Ends in
    /// minimum throttle and a reset, a late tick in a fault.
    SelfTest {
        /// Guards against a stray command.
        confirm: u32,
        /// What to try.
        trial: Trial,
    },
    /// A user command of the IMU board.
    Imu(ImuCommand),
    /// A part of a new configuration; the first one clears what was there.
    ConfigPart(ConfigPart),
    /// Put the configuration that was sent in force, if it is whole and every value possible; only while disarmed.
    ConfigApply {
        /// Its length, bytes.
        length: u16,
        /// CRC-32 of it.
        crc: u32,
    },
    /// Send the part of the configuration in force that begins at this byte.
    ConfigRead {
        /// From 0.
        at: u16,
    },
    /// Segments of a schedule, ahead of their playing; [`Command::RunSchedule`] starts it.
    Segments(SegmentBatch),
    /// Do something to the segment that is being played.
    Steer {
        /// Its number; another one than is being played is refused.
        segment: u32,
        /// What.
        how: Steer,
    },
    /// Record every conversion of one analogue channel for as long as the board has memory, and send them; in any state.
    Burst {
        /// Its place among the analogue channels.
        channel: u8,
    },
}

impl Command {
    /// What is asked for, for people.
    #[must_use]
    pub const fn words(&self) -> &'static str {
        match self {
            Self::Ping => "a sign of life",
            Self::Identify => "who are you",
            Self::Arm => "arm",
            Self::CalibrateRange { .. } => "calibrate the throttle range",
            Self::Beep(_) => "a beep",
            Self::ScheduleStep { .. } | Self::Segments(_) => "a part of a schedule",
            Self::RunSchedule
            | Self::RunStaircase { .. }
            | Self::RunVisits { .. }
            | Self::RunRamp { .. }
            | Self::RunStep { .. }
            | Self::RunChirp { .. } => "run",
            Self::SetPulse(_) => "set the pulse",
            Self::Stop => "stop",
            Self::Tare => "tare",
            Self::ClearFaults => "clear the faults",
            Self::Configure(_) => "change a setting",
            Self::SaveSettings => "store the configuration",
            Self::SelfTest { .. } => "test yourself",
            Self::Imu(_) => "a command of the IMU board",
            Self::ConfigPart(_) | Self::ConfigApply { .. } => "a configuration",
            Self::ConfigRead { .. } => "what is your configuration",
            Self::Steer { .. } => "go on with the schedule",
            Self::Burst { .. } => "record a burst",
        }
    }
}

/// What the self-test provokes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Trial {
    /// A panic outside the control loop.
    Panic,
    /// A program that hangs with interrupts off, for the watchdog.
    Hang,
    /// Interrupts off for 8 ms: the next control tick comes late.
    Late,
}

/// One setting of the board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Setting {
    /// Time between two samples, 1 to 1000 ms.
    LogPeriodMs(u16),
    /// Marks a revolution of the four capture channels after their prescalers; 0 where none is fitted.
    Marks([u16; 4]),
    /// Throttle curve by five points, or `None` for the straight line.
    Curve(Option<[PulseWidth; 5]>),
    /// Most change of pulse in a millisecond, nanoseconds.
    SlewNsPerMs(u32),
    /// Highest rotor speed, rev/min.
    SpeedLimit(f32),
    /// Highest current, A.
    CurrentLimit(f32),
    /// Lowest supply while armed, V.
    VoltageLimit(f32),
    /// Longest silence of the host while armed, 200 to 5000 ms.
    LinkMs(u16),
    /// Everything as it left the factory.
    Factory,
}

impl Command {
    /// The word that confirms a range calibration ("CALI").
    pub const CALIBRATE_CONFIRM: u32 = 0x4341_4C49;
    /// The word that confirms a self-test ("TEST").
    pub const SELF_TEST_CONFIRM: u32 = 0x5445_5354;
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

impl From<Beep> for ArmingEvent {
    fn from(beep: Beep) -> Self {
        match beep {
            Beep::Long => Self::Long,
            Beep::Cells(_) => Self::Cells,
            Beep::Ready => Self::Ready,
            Beep::Double => Self::Double,
            Beep::Programming => Self::Programming,
            Beep::NoSignal => Self::NoSignal,
            Beep::SelfTestFailed => Self::SelfTestFailed,
        }
    }
}
