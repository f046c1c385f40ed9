//! What the IMU board is asked for and what it answers.
//!
//! What it is: the user commands of the thesis' Appendix E as [`ImuCommand`], and [`ImuReport`]: what became of a calibration, and
//! the counted errors.
//! What can go wrong: a calibration that is refused says why, with the figure that speaks against it.
//! Units: rad/s, m/s^2, uT, rad in reports; ticks of the board's timestamp clock.
//! Reference: specification `ahrs.md`, "Board"; Beharie 2013 Appendix E.

use crate::units::Ticks;
use serde::{Deserialize, Serialize};

/// How telemetry and answers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ImuFormat {
    /// Frames of [`crate::wire`].
    #[default]
    Binary,
    /// Lines of text.
    Text,
}

/// Which readings the stream carries; the attitude is in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ImuContent {
    /// Words as read, in body axes.
    #[default]
    Raw,
    /// Physical values with the calibration applied.
    Calibrated,
    /// One after the other.
    Both,
}

/// What can be calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ImuSensor {
    /// Zero at rest.
    Gyro,
    /// Offset and gain from rest with each axis up and down.
    Accel,
    /// Hard and soft iron from readings in all directions.
    Mag,
    /// Magnetometer axes against the accelerometer's, from rest in many attitudes.
    Alignment,
}

/// User commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ImuCommand {
    /// Output mode.
    Format(ImuFormat),
    /// Raw, calibrated or both.
    Content(ImuContent),
    /// Stream on or off.
    Stream(bool),
    /// One sample, whether the stream is on or not.
    Once,
    /// Begin a calibration; gyro and accelerometer end by themselves.
    Calibrate(ImuSensor),
    /// End of the turning: fit what was collected.
    Finish,
    /// Give a calibration up.
    Cancel,
    /// Store calibration and output mode in flash.
    Save,
    /// Put what is stored in force.
    Load,
    /// Put the factory's calibration and output mode in force; what is stored stays until the next save.
    Factory,
    /// Report the counted errors.
    Errors,
}

/// Why a calibration was refused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ImuRefusal {
    /// Fewer readings than are needed.
    TooFew {
        /// Readings that were there.
        found: u32,
        /// Readings that are needed.
        needed: u32,
    },
    /// The board was not at rest.
    Moving {
        /// Scatter of the rate, rad/s.
        scatter: f32,
    },
    /// Directions are missing.
    Coverage {
        /// Share of what is needed that was seen.
        found: f32,
    },
    /// A position is missing or is not what it should be: +x, -x, +y, -y, +z, -z up, from 0.
    Position {
        /// Which.
        index: u8,
    },
    /// The readings determine nothing.
    NoFit,
}

/// A calibration that is in force now.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ImuCalibrated {
    /// Of what.
    pub sensor: ImuSensor,
    /// Offset in the sensor's unit; for the alignment the rotation vector, rad.
    pub offset: [f32; 3],
    /// Its standard errors.
    pub sigma: [f32; 3],
    /// Gain of each axis; 1 where it is not asked.
    pub gain: [f32; 3],
    /// Root mean square of what is left, in the sensor's unit (alignment: rad); for the gyro its noise.
    pub residual: f32,
    /// Share of what is needed that was seen.
    pub coverage: f32,
    /// Readings, positions or attitudes used.
    pub readings: u16,
}

/// Errors since reset; each count rests at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ImuErrors {
    /// Sensors that are alive now: bits as in [`crate::ImuSample::alive`], bit 3 the test accelerometer.
    pub alive: u8,
    /// Failed reads of gyro, accelerometer, magnetometer and test accelerometer.
    pub lost: [u16; 4],
    /// Readings at the end of the range of gyro, accelerometer and magnetometer.
    pub saturated: [u16; 3],
    /// Sensors that now give the same words for ever: bits as in [`crate::ImuSample::fresh`].
    pub stuck: u8,
    /// Readings that the filter could not use.
    pub unusable: u16,
    /// Command frames that were damaged or of another version.
    pub damaged: u16,
    /// Text lines that are no command.
    pub unknown: u16,
    /// Shortest and longest time between two ticks, timer ticks.
    pub tick_span: [u32; 2],
    /// Most core cycles from a tick's entry to its end.
    pub tick_cycles: u32,
}

/// What the IMU board reports.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ImuReport {
    /// A position or an attitude was taken; go on to the next.
    Taken {
        /// Of which calibration.
        sensor: ImuSensor,
        /// Position (+x, -x, +y, -y, +z, -z up, from 0) or number of the attitude.
        index: u8,
        /// How many there are now.
        count: u8,
    },
    /// A calibration is in force; it is stored by [`ImuCommand::Save`] only.
    Calibrated(ImuCalibrated),
    /// A calibration was refused; the one before stays in force.
    Refused {
        /// Of what.
        sensor: ImuSensor,
        /// Why.
        why: ImuRefusal,
    },
    /// The counted errors.
    Errors(ImuErrors),
}

/// Physical values of one instant, calibrated, body axes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ImuValues {
    /// When the gyro was read.
    pub at: Ticks,
    /// Rates, rad/s.
    pub gyro: [f32; 3],
    /// Specific force, m/s^2.
    pub accel: [f32; 3],
    /// Field, uT.
    pub mag: [f32; 3],
    /// Fresh in this sample: bits as in [`crate::ImuSample::fresh`].
    pub fresh: u8,
    /// Attitude as in [`crate::ImuSample::quaternion_q30`].
    pub quaternion_q30: [i32; 4],
}

/// A reading of the test accelerometer (LIS3DH), where one is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TestAccel {
    /// When it was read.
    pub at: Ticks,
    /// Words in body axes, 12 mg each.
    pub words: [i16; 3],
}
