//! Configuration of the classic filter.
//!
//! What it is: gains with their units, kept apart from the state.
//! What can go wrong: gains per step instead of per second change their meaning with the sample rate; these are per second.
//! Units: 1/s, 1/s^2, rad, rad/s, s.
//! Reference: Razor AHRS v1.4.2 (gains per step at 50 Hz on counts, converted here).

use crate::rotation::Increment;

/// Proportional and integral gain of one correction loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// Correction rate for an error of one radian, 1/s.
    pub kp: f32,
    /// Growth of the bias estimate for an error of one radian, 1/s^2.
    pub ki: f32,
}

/// How far the accelerometer is believed while its norm is not that of gravity.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum AccelWeight {
    /// Always fully; the low gain averages the motion out.
    Always,
    /// 1 - 2 |1 - |a|/g|, not below 0, as in the Razor firmware.
    RazorRamp,
}

/// Everything that does not change while the filter runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassicConfig {
    /// Loop from the accelerometer.
    pub tilt: Gains,
    /// Loop from the magnetometer.
    pub yaw: Gains,
    /// Order of the rotation update.
    pub increment: Increment,
    /// Weight of the accelerometer.
    pub accel_weight: AccelWeight,
    /// Largest bias the integrator may hold on each axis, rad/s.
    pub bias_limit: f32,
    /// Magnetic declination, rad, east positive: 0 makes yaw a magnetic heading.
    pub declination: f32,
    /// A step longer than this is a gap: the tilt starts anew, s.
    pub max_dt: f32,
}

impl ClassicConfig {
    /// The Razor firmware's gains, converted: Kp 0.02 and Ki 2e-5 a step at 50 Hz on 256 counts per g; 1.2 and 2e-5 for yaw.
    pub const RAZOR: Self = Self {
        tilt: Gains { kp: 5.12, ki: 0.256 },
        yaw: Gains { kp: 1.2, ki: 1.0e-3 },
        increment: Increment::FirstOrder,
        accel_weight: AccelWeight::RazorRamp,
        bias_limit: 0.35,
        declination: 0.0,
        max_dt: 0.25,
    };

    /// The same algorithm with the best gains found for it on recorded motion: slow, and without the norm weighting. The
    /// baseline that every change is measured against.
    pub const TUNED: Self = Self {
        tilt: Gains { kp: 0.49, ki: 8.0e-4 },
        yaw: Gains { kp: 0.081, ki: 4.0e-3 },
        accel_weight: AccelWeight::Always,
        ..Self::RAZOR
    };
}

impl Default for ClassicConfig {
    /// [`ClassicConfig::TUNED`] with the exact increment.
    fn default() -> Self {
        Self { increment: Increment::Exponential, ..Self::TUNED }
    }
}
