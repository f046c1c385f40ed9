//! What a foreign column is: name and unit to the contract's column and factor.
//!
//! What it is: the dictionary of headers, `Thrust (gf)` and `thrust_n` alike.
//! What can go wrong: a known quantity in an unknown unit is refused, never guessed.
//! Units: value in the log = value in the file times the factor.
//! Reference: RCbenchmark / Tyto exports; 1 gf = 9.80665e-3 N, 1 lbf = 4.4482216 N, 1 lbf.in = 0.1129848 N.m.

/// Where a column goes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Target {
    /// Into this column, times this factor.
    Keep(&'static str, f64),
    /// A further numeric column under its own cleaned name.
    Covariate(String),
    /// Not numeric or derived from others: left out.
    Skip,
    /// Date and time of day.
    Stamp,
    /// A command as a fraction of this full scale: 1000 us and 1000 us more at full scale.
    Command(f64),
    /// A known quantity in a unit that we do not know.
    UnknownUnit(&'static str),
}

const DERIVED: [&str; 7] = [
    "electrical power",
    "mechanical power",
    "motor efficiency",
    "propeller mech. efficiency",
    "overall efficiency",
    "app message",
    "servo",
];

/// Sorts one header cell.
pub(crate) fn sort(header: &str) -> Target {
    let text = header.trim().trim_start_matches('\u{feff}');
    if text.is_empty() {
        return Target::Skip;
    }
    let (name, unit) = split_unit(text);
    let (name, unit) = (name.to_lowercase(), unit.map(|u| u.to_lowercase().replace(['\u{b7}', '*', '.', ' '], "")));
    if DERIVED.iter().any(|d| name.starts_with(d)) {
        return Target::Skip;
    }
    let unit = unit.as_deref();
    let factor = |right: &'static str, table: &[(&str, f64)]| match unit {
        Some(u) => table.iter().find(|(n, _)| *n == u).map_or(Target::UnknownUnit(right), |(_, f)| Target::Keep(right, *f)),
        None => Target::UnknownUnit(right),
    };
    match name.as_str() {
        "t_s" => Target::Keep("t_s", 1.0),
        // a date and time of day becomes seconds since the first row
        "timestamp" => Target::Stamp,
        "command_us" | "pulse_us" => Target::Keep("pulse_us", 1.0),
        n if TIDY.contains(&n) => Target::Keep(TIDY.iter().find(|t| **t == n).copied().unwrap_or("rpm"), 1.0),
        "time" => factor("t_s", &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("\u{b5}s", 1e-6)]),
        "esc signal" | "esc" | "throttle" => factor("pulse_us", &[("\u{b5}s", 1.0), ("\u{3bc}s", 1.0), ("us", 1.0), ("ms", 1e3)]),
        "thrust" | "weight" => factor(
            "thrust_n",
            &[("gf", 9.80665e-3), ("g", 9.80665e-3), ("kgf", 9.80665), ("n", 1.0), ("lbf", 4.448_221_6), ("ozf", 0.278_013_9)],
        ),
        "torque" => {
            factor("torque_nm", &[("nm", 1.0), ("nmm", 1e-3), ("ncm", 1e-2), ("lbfin", 0.112_984_8), ("lbfft", 1.355_818)])
        }
        // Crazyflie: 16 bits; ESC32: duty in per cent. Taken as linear over 1000 to 2000 us, as the tidy sets do
        "pwm" if unit.is_none() => Target::Command(65535.0),
        "duty" => Target::Command(100.0),
        // the ESC32 log names its units by its words
        "amps" => Target::Keep("current_a", 1.0),
        n if n.starts_with("batt") && n.ends_with("volts") => Target::Keep("voltage_v", 1.0),
        // the Crazyflie's power deck beside its own battery reading
        "i" if unit == Some("a") => Target::Keep("current_a", 1.0),
        "v" if unit == Some("v") => Target::Covariate("voltage_deck_v".to_owned()),
        "p" if unit == Some("w") => Target::Covariate("power_deck_w".to_owned()),
        "voltage" | "vbat" => factor("voltage_v", &[("v", 1.0), ("mv", 1e-3)]),
        "current" => factor("current_a", &[("a", 1.0), ("ma", 1e-3)]),
        "motor electrical speed" | "motor optical speed" | "rotation speed" => {
            let column = if name.contains("optical") { "rpm_optical_probe" } else { "rpm" };
            match unit {
                Some("rpm") => Target::Keep(column, 1.0),
                Some("hz" | "rev/s") => Target::Keep(column, 60.0),
                Some("rad/s") => Target::Keep(column, 60.0 / std::f64::consts::TAU),
                _ => Target::UnknownUnit(column),
            }
        }
        _ => Target::Covariate(clean(text)),
    }
}

/// Columns of the contract that are taken under their own name.
const TIDY: [&str; 11] = [
    "rpm",
    "rpm_beam",
    "rpm_opto",
    "rpm_hall",
    "rpm_encoder",
    "thrust_n",
    "torque_nm",
    "current_a",
    "voltage_v",
    "temp_c",
    "thrust_rms_n",
];

fn split_unit(text: &str) -> (&str, Option<&str>) {
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let (Some(a), Some(b)) = (text.rfind(open), text.rfind(close))
            && a < b
        {
            return (text[..a].trim(), Some(text[a + 1..b].trim()));
        }
    }
    (text, None)
}

fn clean(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        if c.is_ascii_alphanumeric() {
            out.push(c.to_ascii_lowercase());
        } else if !out.ends_with('_') && !out.is_empty() {
            out.push('_');
        }
    }
    out.trim_end_matches('_').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_the_field_find_their_column() {
        assert_eq!(sort("Thrust (gf)"), Target::Keep("thrust_n", 9.80665e-3));
        assert_eq!(sort("\u{feff}Time (s)"), Target::Keep("t_s", 1.0));
        assert_eq!(sort("ESC signal (\u{b5}s)"), Target::Keep("pulse_us", 1.0));
        assert_eq!(sort("Torque (N\u{b7}m)"), Target::Keep("torque_nm", 1.0));
        assert_eq!(sort("weight[g]"), Target::Keep("thrust_n", 9.80665e-3));
        assert_eq!(sort("command_us"), Target::Keep("pulse_us", 1.0));
        assert_eq!(sort("Vibration (g)"), Target::Covariate("vibration_g".into()));
        assert_eq!(sort("Thrust (stone)"), Target::UnknownUnit("thrust_n"));
        assert_eq!(sort("Motor Efficiency (%)"), Target::Skip);
        assert_eq!(sort("App message"), Target::Skip);
    }
}
