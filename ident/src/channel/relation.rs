//! What each channel is predicted from, and by which polynomial.
//!
//! What it is: the primary relations, the names of the contrasts of speed sensors, and the units of the channels.
//! What can go wrong: a name that is no modelled channel has no relation.
//! Units: SI, rev/min, us.
//! Reference: specification `formats.md` (primary relations).

use crate::log::SPEED;

/// What a target channel is predicted from, and by which polynomial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Relation {
    /// rpm from pulse: cubic above the starting pulse, 0 below.
    SpeedFromPulse,
    /// rpm without a command: its own mean (nothing to predict it from).
    SpeedAlone,
    /// voltage: a constant.
    Voltage,
    /// torque from rpm: quadratic.
    Torque,
    /// current from rpm: cubic.
    Current,
    /// thrust from rpm: quadratic.
    Thrust,
    /// rms of the strain from rpm: quadratic. Evidence only; no verdict speaks of it.
    ThrustRms,
    /// one speed channel less the consensus of at least three: a constant and the sensor's own gain (`GAIN_SD`). Evidence only; no
    /// verdict speaks of it.
    SpeedDifference,
}

/// Standard deviation of the gain that a healthy speed sensor has of its own: 0.3 % (specification `closing-the-loop.md`, step 2).
const GAIN_SD: f64 = 0.003;
/// Largest such gain: three standard deviations.
const MOST_GAIN: f64 = 3.0 * GAIN_SD;

impl Relation {
    /// What is known before any run of the coefficient of a power of the regressor: its standard deviation about zero, and the most that it can
    /// be; `None` where nothing is. What a sensor reads beyond that is no gain of its own.
    #[must_use]
    pub fn known(self, power: usize) -> Option<(f64, f64)> {
        // a gain is a share, its coefficient is of krpm
        (self == Self::SpeedDifference && power == 1).then_some((1000.0 * GAIN_SD, 1000.0 * MOST_GAIN))
    }

    /// Degree of the declared polynomial.
    #[must_use]
    pub fn degree(self) -> usize {
        match self {
            Self::SpeedFromPulse | Self::Current => 3,
            Self::SpeedAlone | Self::Voltage => 0,
            Self::SpeedDifference => 1,
            Self::Torque | Self::Thrust | Self::ThrustRms => 2,
        }
    }

    /// The relation of a channel.
    #[must_use]
    pub fn of(channel: &str, has_pulse: bool) -> Option<Self> {
        Some(match channel {
            c if SPEED.contains(&c) && has_pulse => Self::SpeedFromPulse,
            c if SPEED.contains(&c) => Self::SpeedAlone,
            "voltage_v" => Self::Voltage,
            "torque_nm" => Self::Torque,
            "current_a" => Self::Current,
            "thrust_n" => Self::Thrust,
            "thrust_rms_n" => Self::ThrustRms,
            c if is_contrast(c) => Self::SpeedDifference,
            _ => return None,
        })
    }

    /// Whether a channel is a load that the speed makes.
    #[must_use]
    pub fn is_of_speed(self) -> bool {
        matches!(self, Self::Thrust | Self::Torque | Self::Current | Self::ThrustRms)
    }

    /// Whether the relation only bears witness: no verdict speaks of it.
    #[must_use]
    pub fn is_evidence(self) -> bool {
        matches!(self, Self::ThrustRms | Self::SpeedDifference)
    }
}

/// Speed channels and the names of their differences from the consensus.
pub const DIFFERENCES: [(&str, &str); 4] = [
    ("rpm_beam", "rpm_beam_difference"),
    ("rpm_opto", "rpm_opto_difference"),
    ("rpm_hall", "rpm_hall_difference"),
    ("rpm_encoder", "rpm_encoder_difference"),
];

/// Whether a channel is what one speed sensor reads beyond the others.
#[must_use]
pub fn is_contrast(channel: &str) -> bool {
    DIFFERENCES.iter().any(|d| d.1 == channel)
}

/// Unit of a modelled channel.
#[must_use]
pub fn unit_of(channel: &str) -> &'static str {
    match channel {
        c if c.starts_with("rpm") => "rev/min",
        "thrust_n" | "thrust_rms_n" => "N",
        "torque_nm" => "N.m",
        "current_a" => "A",
        "voltage_v" => "V",
        "temp_c" => "degC",
        "t_s" => "s",
        "pulse_us" => "us",
        "accx_g" | "accy_g" | "accz_g" | "vibration_g" | "vibration_a_g" => "g",
        _ => "",
    }
}
