//! What an ESC tells of itself over its serial telemetry.
//!
//! What it is: the raw figures of one frame with their age and a verdict, and the values that they stand for.
//! What can go wrong: a line that is dead is `Silent`, one on which no frame checks is `Garbled`; both carry no figures. A wrong number of
//! pole pairs scales the speed.
//! Units: as the ESC sends them; degC, V, A, mAh and rev/min after [`EscCode::values`].
//! Reference: KISS ESC telemetry protocol (also of BLHeli_32 and AM32): ten bytes at 115 200 baud 8N1.

use serde::{Deserialize, Serialize};

/// Log columns of what the ESC tells: speed, current, voltage, temperature, charge drawn since its start.
pub const ESC_NAMES: [&str; 5] = ["rpm_esc", "current_esc_a", "voltage_esc_v", "temp_esc_c", "charge_esc_mah"];
/// Units of the same.
pub const ESC_UNITS: [&str; 5] = ["rev/min", "A", "V", "degC", "mAh"];
/// Log column of the back-EMF meter's speed.
pub const BACK_EMF_NAME: &str = "rpm_bemf";

/// What the board says of the ESC's telemetry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum EscVerdict {
    /// The figures are those of a frame that checked, not older than the board takes.
    Nominal,
    /// Nothing was heard lately: the ESC has no power, or the line is dead.
    #[default]
    Silent,
    /// Something is heard, and none of it checks: noise, or another rate.
    Garbled,
}

impl EscVerdict {
    /// The verdict in words, for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Nominal => "the ESC's telemetry is heard",
            Self::Silent => "the ESC's telemetry is silent",
            Self::Garbled => "the ESC's telemetry is garbled: no frame of it checks",
        }
    }
}

/// The last good frame, raw. Figures are 0 unless the verdict is nominal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EscCode {
    /// What the board says of it.
    pub verdict: EscVerdict,
    /// Temperature, degC.
    pub temperature: u8,
    /// Voltage, 0.01 V.
    pub voltage: u16,
    /// Current, 0.01 A.
    pub current: u16,
    /// Charge drawn since the ESC's start, mAh.
    pub charge: u16,
    /// Electrical speed, 100 turns a minute.
    pub speed: u16,
    /// Time since the frame's last byte, ms.
    pub age_ms: u16,
}

impl EscCode {
    /// The figures in the order and the units of [`ESC_NAMES`]; `None` where they are no figures, or the pole pairs of the speed are not known.
    #[must_use]
    pub fn values(&self, pole_pairs: u16) -> [Option<f64>; 5] {
        if self.verdict != EscVerdict::Nominal {
            return [None; 5];
        }
        let speed = (pole_pairs > 0).then(|| 100.0 * f64::from(self.speed) / f64::from(pole_pairs));
        let hundredth = |code: u16| Some(f64::from(code) / 100.0);
        [speed, hundredth(self.current), hundredth(self.voltage), Some(f64::from(self.temperature)), Some(f64::from(self.charge))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_their_units_and_those_of_no_frame_are_none() {
        let code = EscCode {
            verdict: EscVerdict::Nominal,
            temperature: 41,
            voltage: 1148,
            current: 1234,
            charge: 77,
            speed: 451,
            age_ms: 3,
        };
        assert_eq!(code.values(11), [Some(4100.0), Some(12.34), Some(11.48), Some(41.0), Some(77.0)]);
        assert_eq!(code.values(0)[0], None, "a speed without pole pairs is none");
        for verdict in [EscVerdict::Silent, EscVerdict::Garbled] {
            assert_eq!(EscCode { verdict, ..code }.values(11), [None; 5]);
        }
    }
}
