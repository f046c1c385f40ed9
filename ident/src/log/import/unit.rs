//! Units as exports write them.
//!
//! What it is: the factor and the offset from a unit's text to the contract's unit of a quantity.
//! What can go wrong: a unit that is not in the table is no unit of that quantity; nothing is guessed.
//! Units: value in the log = value in the file times the factor plus the offset.
//! Reference: 1 gf = 9.80665e-3 N, 1 lbf = 4.4482216 N, 1 ozf = 0.2780139 N, 1 lbf.in = 0.1129848 N.m (NIST SP 811).

use std::f64::consts::TAU;

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    /// To s.
    Time,
    /// Pulse width, to us.
    Pulse,
    /// To N.
    Force,
    /// To N.m.
    Torque,
    /// To A.
    Current,
    /// To V.
    Voltage,
    /// To rev/min.
    Speed,
    /// To degC.
    Temperature,
    /// To mAh.
    Charge,
}

type Units = &'static [(&'static str, f64)];

const TIME: Units = &[
    ("s", 1.0),
    ("sec", 1.0),
    ("secs", 1.0),
    ("second", 1.0),
    ("seconds", 1.0),
    ("sek", 1.0),
    ("ms", 1e-3),
    ("msec", 1e-3),
    ("millis", 1e-3),
    ("milliseconds", 1e-3),
    ("us", 1e-6),
    ("usec", 1e-6),
    ("micros", 1e-6),
    ("microseconds", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
];
const PULSE: Units = &[("us", 1.0), ("usec", 1.0), ("microseconds", 1.0), ("ms", 1e3), ("s", 1e6)];
const FORCE: Units = &[
    ("n", 1.0),
    ("newton", 1.0),
    ("mn", 1e-3),
    ("kn", 1e3),
    ("gf", 9.806_65e-3),
    ("g", 9.806_65e-3),
    ("gram", 9.806_65e-3),
    ("grams", 9.806_65e-3),
    ("gramm", 9.806_65e-3),
    ("kgf", 9.806_65),
    ("kg", 9.806_65),
    ("kp", 9.806_65),
    ("lbf", 4.448_221_6),
    ("lb", 4.448_221_6),
    ("lbs", 4.448_221_6),
    ("ozf", 0.278_013_9),
    ("oz", 0.278_013_9),
];
const TORQUE: Units = &[
    ("nm", 1.0),
    ("mnm", 1e-3),
    ("nmm", 1e-3),
    ("ncm", 1e-2),
    ("gcm", 9.806_65e-5),
    ("gfcm", 9.806_65e-5),
    ("kgcm", 9.806_65e-2),
    ("kgfcm", 9.806_65e-2),
    ("kgm", 9.806_65),
    ("kgfm", 9.806_65),
    ("lbfin", 0.112_984_8),
    ("lbin", 0.112_984_8),
    ("inlbf", 0.112_984_8),
    ("inlb", 0.112_984_8),
    ("lbfft", 1.355_818),
    ("lbft", 1.355_818),
    ("ftlbf", 1.355_818),
    ("ftlb", 1.355_818),
    ("ozfin", 7.061_552e-3),
    ("ozin", 7.061_552e-3),
    ("inoz", 7.061_552e-3),
];
const CURRENT: Units =
    &[("a", 1.0), ("amp", 1.0), ("amps", 1.0), ("ampere", 1.0), ("ma", 1e-3), ("ca", 1e-2), ("da", 0.1), ("ka", 1e3)];
const VOLTAGE: Units = &[("v", 1.0), ("volt", 1.0), ("volts", 1.0), ("mv", 1e-3), ("cv", 1e-2), ("dv", 0.1)];
const SPEED: Units = &[
    ("rpm", 1.0),
    ("rev/min", 1.0),
    ("r/min", 1.0),
    ("1/min", 1.0),
    ("min1", 1.0),
    ("u/min", 1.0),
    ("tr/min", 1.0),
    ("krpm", 1e3),
    ("hz", 60.0),
    ("rev/s", 60.0),
    ("rps", 60.0),
    ("1/s", 60.0),
    ("rad/s", 60.0 / TAU),
    ("rads", 60.0 / TAU),
    ("deg/s", 1.0 / 6.0),
    // electrical turns: what the pole pairs make of them is the caller's
    ("erpm", 1.0),
    ("erpmx100", 100.0),
    ("erpm/100", 100.0),
    ("100erpm", 100.0),
    ("x100", 100.0),
    ("/100", 100.0),
];
const TEMPERATURE: Units = &[("c", 1.0), ("degc", 1.0), ("celsius", 1.0), ("degrees c", 1.0), ("k", 1.0), ("kelvin", 1.0)];
const CHARGE: Units = &[("mah", 1.0), ("ah", 1e3)];

/// Text of a unit without what does not tell it apart.
pub(super) fn plain(unit: &str) -> String {
    let mut out = String::new();
    for c in unit.to_lowercase().chars() {
        match c {
            '\u{b5}' | '\u{3bc}' => out.push('u'),
            '\u{b0}' | '\u{ba}' => out.push_str("deg"),
            '\u{b9}' => out.push('1'),
            // a point between two units, in any of its forms; a minus before a power
            '\u{b7}' | '\u{22c5}' | '\u{2022}' | '\u{2219}' | '*' | '.' | ' ' | '-' | '\u{207b}' | '^' | '_' => {}
            c => out.push(c),
        }
    }
    out
}

impl Quantity {
    /// Factor and offset of a unit.
    pub(super) fn of_unit(self, unit: &str) -> Option<(f64, f64)> {
        let unit = plain(unit);
        let table = match self {
            Self::Time => TIME,
            Self::Pulse => PULSE,
            Self::Force => FORCE,
            Self::Torque => TORQUE,
            Self::Current => CURRENT,
            Self::Voltage => VOLTAGE,
            Self::Speed => SPEED,
            Self::Temperature => {
                if ["f", "degf", "fahrenheit"].contains(&unit.as_str()) {
                    return Some((5.0 / 9.0, -32.0 * 5.0 / 9.0));
                }
                TEMPERATURE
            }
            Self::Charge => CHARGE,
        };
        let factor = table.iter().find(|(name, _)| *name == unit)?.1;
        Some((factor, if self == Self::Temperature && unit.starts_with('k') { -273.15 } else { 0.0 }))
    }

    /// Whether a text is a unit of any quantity.
    pub(super) fn any_unit(unit: &str) -> bool {
        let all = [
            Self::Time,
            Self::Pulse,
            Self::Force,
            Self::Torque,
            Self::Current,
            Self::Voltage,
            Self::Speed,
            Self::Temperature,
            Self::Charge,
        ];
        let other = ["%", "w", "gf/w", "n/w", "g/w", "m/s", "deg", "pa", "hpa", "m/s2", "wh"];
        all.iter().any(|q| q.of_unit(unit).is_some()) || other.contains(&plain(unit).as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_in_their_many_forms() {
        let near = |q: Quantity, unit: &str, value: f64, wanted: f64| {
            let (factor, offset) = q.of_unit(unit).unwrap_or_else(|| panic!("{unit}"));
            assert!((value * factor + offset - wanted).abs() < 1e-6 * wanted.abs().max(1.0), "{unit}");
        };
        near(Quantity::Time, "\u{b5}s", 5e6, 5.0);
        near(Quantity::Torque, "N\u{b7}m", 0.2, 0.2);
        near(Quantity::Torque, "N\u{22c5}m", 0.2, 0.2);
        near(Quantity::Torque, "in-lbf", 1.0, 0.112_984_8);
        near(Quantity::Force, "kg", 1.0, 9.806_65);
        near(Quantity::Speed, "min\u{207b}\u{b9}", 5000.0, 5000.0);
        near(Quantity::Speed, "rad/s", 100.0, 954.929_658_6);
        near(Quantity::Temperature, "\u{b0}F", 212.0, 100.0);
        near(Quantity::Temperature, "K", 300.0, 26.85);
        assert_eq!(Quantity::Force.of_unit("stone"), None);
        assert!(Quantity::any_unit("gf/W") && !Quantity::any_unit("thrust"));
    }
}
