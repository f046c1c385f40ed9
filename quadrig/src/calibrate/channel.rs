//! A rig's analogue channel and the known values that calibrate it.
//!
//! What it is: place, names and units of each channel, and the values that people say: masses, amperes, volts.
//! What can go wrong: a unit that is none of the channel's is refused.
//! Units: N, N.m, A, V, degC. A mass on the load cell pulls down as the motor's weight does: negative thrust.
//! Reference: Beharie 2013, Eq. 5.36 with the errata (F = y g / 1000), Eq. 5.57 (torque by a lever arm).

/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;

/// Which channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Channel {
    /// Load cell.
    Thrust,
    /// Torque arm.
    Torque,
    /// Shunt.
    Current,
    /// Supply.
    Voltage,
    /// Temperature.
    Temperature,
}

impl Channel {
    /// Its place among the analogue channels.
    pub(super) fn place(self) -> usize {
        self as usize
    }

    /// Its name in a log.
    pub(super) fn column(self) -> &'static str {
        frame::rig::ADC_NAMES[self.place()]
    }

    /// Its name in a configuration.
    pub(super) fn section(self) -> &'static str {
        crate::rig::file::ANALOGUE[self.place()]
    }

    /// The unit of its values.
    pub(super) fn unit(self) -> &'static str {
        ["N", "N.m", "A", "V", "degC"][self.place()]
    }

    /// The unit in which people say them, and how many of it one of [`Channel::unit`] is, whatever the sign.
    pub(super) fn spoken(self, arm_m: f64) -> (&'static str, f64) {
        match self {
            Self::Thrust => ("g", 1000.0 / G),
            Self::Torque => ("g", 1000.0 / G / arm_m),
            Self::Current => ("A", 1.0),
            Self::Voltage => ("V", 1.0),
            Self::Temperature => ("degC", 1.0),
        }
    }

    /// A value as it is said: a number, and a unit or the channel's usual one.
    pub(super) fn value(self, text: &str, arm_m: f64) -> Result<f64, String> {
        let text = text.trim();
        let end = text.find(|c: char| !matches!(c, '0'..='9' | '.' | '-' | '+' | 'e' | 'E')).unwrap_or(text.len());
        let (number, unit) = text.split_at(end);
        let units = "0 g, 200 g, 1.5 kg, -2 N; 0.1 N.m; 5 A; 11.8 V; 25 C";
        let number: f64 = number
            .parse()
            .ok()
            .filter(|n: &f64| n.is_finite())
            .ok_or_else(|| format!("{text:?}: expected a value such as {units}"))?;
        let unit = match (unit.trim(), self) {
            ("", _) => self.spoken(arm_m).0,
            (unit, _) => unit,
        };
        let factor = match (self, unit) {
            (Self::Thrust, "g") => -G / 1000.0,
            (Self::Thrust, "kg") => -G,
            (Self::Torque, "g") => G / 1000.0 * arm_m,
            (Self::Torque, "kg") => G * arm_m,
            (Self::Torque, "N") => arm_m,
            (Self::Current, "mA") | (Self::Voltage, "mV") => 1e-3,
            (Self::Thrust, "N")
            | (Self::Torque, "N.m" | "Nm")
            | (Self::Current, "A")
            | (Self::Voltage, "V")
            | (Self::Temperature, "C" | "degC") => 1.0,
            _ => return Err(format!("{text:?}: {unit} is no unit of {}; expected a value such as {units}", self.column())),
        };
        Ok(number * factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_as_people_say_them() {
        let close = |said: Result<f64, String>, wanted: f64| {
            let value = said.expect("a value");
            assert!((value - wanted).abs() < 1e-12, "{value} is not {wanted}");
        };
        close(Channel::Thrust.value("200 g", 0.1), -1.961_33);
        close(Channel::Thrust.value("0.2kg", 0.1), -1.961_33);
        close(Channel::Thrust.value(" 200", 0.1), -1.961_33);
        close(Channel::Thrust.value("1.5 N", 0.1), 1.5);
        close(Channel::Torque.value("100 g", 0.15), 0.147_099_75);
        close(Channel::Torque.value("-0.02 N.m", 0.15), -0.02);
        close(Channel::Torque.value("2 N", 0.15), 0.3);
        close(Channel::Current.value("1.5e1 A", 0.1), 15.0);
        close(Channel::Current.value("250 mA", 0.1), 0.25);
        close(Channel::Voltage.value("11.83", 0.1), 11.83);
        close(Channel::Temperature.value("21.5 C", 0.1), 21.5);
        for (channel, text) in
            [(Channel::Thrust, "200 A"), (Channel::Voltage, "g"), (Channel::Current, ""), (Channel::Thrust, "1e999")]
        {
            assert!(channel.value(text, 0.1).is_err(), "{text}");
        }
    }
}
