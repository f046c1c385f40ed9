//! What an ESC tells of itself over its serial telemetry.
//!
//! What it is: the raw figures of one frame with their age and a verdict, and the values that they stand for.
//! What can go wrong: a line that is dead is `Silent`, one on which no frame checks is `Garbled`; both carry no figures. A wrong number of
//! pole pairs scales the speed.
//! Units: as the ESC sends them; degC, V, A, mAh and rev/min after [`EscCode::values`].
//! Reference: KISS ESC telemetry protocol (also of BLHeli_32 and AM32): ten bytes at 115 200 baud 8N1.

use crate::rig::RigSample;
use crate::units::Ticks;
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

/// Two frames are further apart than that, ms; the same frame's age is known to one.
const APART_MS: u64 = 2;

impl RigSample {
    /// Whether the ESC has sent a frame since the sample `before`: between its frames nothing is known, and what is told again is no new reading.
    #[must_use]
    pub fn esc_is_new(&self, before: Option<&Self>) -> bool {
        let came = |sample: &Self| {
            let code = sample.esc.filter(|code| code.verdict == EscVerdict::Nominal)?;
            Some(Ticks(sample.at.0.saturating_sub(Ticks::from_ms(u64::from(code.age_ms)).0)))
        };
        match (came(self), before.filter(|before| before.at <= self.at).and_then(came)) {
            (Some(now), Some(then)) => now.since(then) > Ticks::from_ms(APART_MS),
            (now, None) => now.is_some(),
            (None, _) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_new_once() {
        let sample = |at_ms: u64, age_ms: u16, verdict| {
            let esc = Some(EscCode { verdict, age_ms, ..EscCode::default() });
            RigSample { at: Ticks::from_ms(at_ms), esc, ..RigSample::default() }
        };
        let nominal = |at_ms, age_ms| sample(at_ms, age_ms, EscVerdict::Nominal);
        assert!(nominal(100, 2).esc_is_new(None));
        assert!(!nominal(101, 3).esc_is_new(Some(&nominal(100, 2))));
        assert!(!nominal(130, 31).esc_is_new(Some(&nominal(100, 2))), "the same, known to a millisecond");
        assert!(!nominal(130, 30).esc_is_new(Some(&nominal(100, 2))), "two frames are further apart than that");
        assert!(nominal(130, 29).esc_is_new(Some(&nominal(100, 2))));
        assert!(nominal(133, 4).esc_is_new(Some(&nominal(100, 2))));
        assert!(nominal(10, 4).esc_is_new(Some(&nominal(5_000, 2))), "after a reset");
        assert!(nominal(700, 2).esc_is_new(Some(&sample(600, 400, EscVerdict::Silent))));
        assert!(!sample(700, 400, EscVerdict::Silent).esc_is_new(Some(&nominal(600, 300))));
        assert!(!RigSample::default().esc_is_new(None));
    }

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
