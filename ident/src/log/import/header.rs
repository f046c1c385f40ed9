//! What a foreign column is: name and unit to the contract's column and factor.
//!
//! What it is: the dictionary of headers, `Thrust (gf)`, `Schub [N]`, `Powertrain 1 - thrust (kgf)` and `thrust_n` alike.
//! What can go wrong: a known quantity in an unknown unit is refused, never guessed; one without a unit is left to what its values allow.
//! Units: value in the log = value in the file times the factor plus the offset.
//! Reference: RCbenchmark 1520, 1580, 1585 and 1780, Tyto Flight Stand, VESC Tool ("RT data" log), KISS, BLHeli and AM32 telemetry.

use super::unit::{Quantity, plain};

/// Where a column goes.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Target {
    /// Into this column, times a factor plus an offset.
    Keep(&'static str, f64, f64),
    /// Electrical turns: the same, over the pole pairs.
    Electrical(f64),
    /// A further numeric column under its own cleaned name.
    Covariate(String),
    /// Not numeric or derived from others: left out.
    Skip,
    /// Date, time of day or a count since 1970.
    Stamp,
    /// A command as a fraction of this full scale: 1000 us and 1000 us more at full scale.
    Command(f64),
    /// A known quantity without a unit.
    Unitless(&'static str),
    /// A known quantity in a unit that we do not know.
    UnknownUnit(&'static str),
}

/// What a channel of the contract measures.
pub(super) fn quantity_of(channel: &str) -> Option<Quantity> {
    if channel.starts_with("rpm") && TIDY.contains(&channel) {
        return Some(Quantity::Speed);
    }
    NAMES.iter().find(|(_, _, column)| *column == channel).map(|(_, quantity, _)| *quantity)
}

/// A header cell, sorted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sorted {
    /// Where it goes.
    pub(super) target: Target,
    /// Which of several powertrains it belongs to, where the header names one.
    pub(super) side: Option<u32>,
}

/// Speed of an optical probe, before one of the speeds is chosen.
pub(super) const OPTICAL: &str = "rpm_optical";
/// Speed by the motor's electrical turns, the same.
pub(super) const ELECTRICAL: &str = "rpm_electrical";

const DERIVED: [&str; 7] = [
    "electrical power",
    "mechanical power",
    "motor efficiency",
    "propeller mech. efficiency",
    "overall efficiency",
    "app message",
    "servo",
];

/// Columns of the contract that are taken under their own name.
const TIDY: [&str; 13] = [
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
    "t_s",
    "pulse_us",
];

type Names = &'static [&'static str];

/// Names of each quantity as lower-case words, and the column that it goes to.
const NAMES: [(Names, Quantity, &str); 11] = [
    (&["time", "t", "elapsed time", "time elapsed", "elapsed", "zeit", "temps", "tiempo", "uptime"], Quantity::Time, "t_s"),
    (
        &[
            "esc signal",
            "esc",
            "esc throttle",
            "esc pulse",
            "esc pwm",
            "throttle",
            "throttle signal",
            "control signal",
            "pulse",
            "pulse width",
            "pulsbreite",
            "signal",
            "pwm",
            "pwm signal",
            "command",
            "motor command",
        ],
        Quantity::Pulse,
        "pulse_us",
    ),
    (
        &["thrust", "weight", "force", "schub", "schubkraft", "kraft", "poussee", "pouss\u{e9}e", "empuje"],
        Quantity::Force,
        "thrust_n",
    ),
    (&["torque", "drehmoment", "moment", "couple", "par"], Quantity::Torque, "torque_nm"),
    (
        &[
            "current",
            "curr",
            "input current",
            "current in",
            "dc current",
            "battery current",
            "esc current",
            "supply current",
            "strom",
            "stromst\u{e4}rke",
            "courant",
            "corriente",
            "amps",
            "amperage",
        ],
        Quantity::Current,
        "current_a",
    ),
    (
        &[
            "voltage",
            "volt",
            "vbat",
            "input voltage",
            "voltage in",
            "dc voltage",
            "battery voltage",
            "bus voltage",
            "esc voltage",
            "supply voltage",
            "spannung",
            "tension",
            "voltaje",
        ],
        Quantity::Voltage,
        "voltage_v",
    ),
    (
        &["motor optical speed", "optical speed", "optical rpm", "rpm optical", "optical", "optical rotation speed"],
        Quantity::Speed,
        OPTICAL,
    ),
    (&["motor electrical speed", "electrical speed", "electrical rotation speed"], Quantity::Speed, ELECTRICAL),
    (
        &[
            "rotation speed",
            "rotational speed",
            "speed",
            "rpm",
            "motor speed",
            "motor rpm",
            "propeller speed",
            "shaft speed",
            "mechanical rpm",
            "drehzahl",
            "omega",
            "angular speed",
            "angular velocity",
            "regime",
            "r\u{e9}gime",
            "n",
        ],
        Quantity::Speed,
        "rpm",
    ),
    (
        &["temp", "temperature", "temperatur", "esc temp", "esc temperature", "temperature esc", "temp mos max", "temp mosfet"],
        Quantity::Temperature,
        "temp_c",
    ),
    (&["consumption", "mah", "consumed", "used charge", "capacity used"], Quantity::Charge, "charge_esc_mah"),
];

/// Names that carry their unit: column and factor.
const WITH_UNIT: [(&str, &str, f64); 7] = [
    ("amps", "current_a", 1.0),
    ("amp", "current_a", 1.0),
    ("amperes", "current_a", 1.0),
    ("volts", "voltage_v", 1.0),
    ("batt. volts", "voltage_v", 1.0),
    ("batt volts", "voltage_v", 1.0),
    ("mah", "charge_esc_mah", 1.0),
];

/// Names of electrical turns a minute.
const ERPM: [&str; 8] = ["erpm", "e rpm", "electrical rpm", "erpm x100", "erpm/100", "erpm*100", "erpmx100", "rpm electrical"];

/// Sorts one header cell.
pub(super) fn sort(header: &str) -> Sorted {
    let text = header.trim();
    let (text, side) = side(text);
    let target = target(&text, header.trim());
    // a letter or number at the end tells a side only of what is known
    match (&target, trailing_side(&text)) {
        (Target::Covariate(..), Some((rest, own))) => match target_of(rest) {
            Target::Covariate(..) => Sorted { target, side },
            known => Sorted { target: known, side: Some(own) },
        },
        _ => Sorted { target, side },
    }
}

fn target_of(text: String) -> Target {
    target(&text, &text)
}

/// The side that a prefix names, and the rest.
fn side(text: &str) -> (String, Option<u32>) {
    let lower = text.to_lowercase();
    for word in ["powertrain ", "test stand ", "stand ", "board ", "motor ", "rotor "] {
        let Some(rest) = lower.strip_prefix(word) else { continue };
        let digits = rest.chars().take_while(char::is_ascii_alphanumeric).collect::<String>();
        let after = rest[digits.len()..].trim_start();
        if let (Some(n), Some(tail)) = (number_of(&digits), after.strip_prefix(['-', ':', '/', '_', '\u{2013}'])) {
            let tail = tail.trim_start();
            return (text.get(text.len() - tail.len()..).unwrap_or(tail).to_owned(), Some(n));
        }
    }
    (text.to_owned(), None)
}

/// 1 for `1` and `a`, 2 for `2` and `b`.
fn number_of(word: &str) -> Option<u32> {
    match word.to_lowercase().as_bytes() {
        [d @ b'1'..=b'8'] => Some(u32::from(d - b'0')),
        [c @ b'a'..=b'd'] => Some(u32::from(c - b'a') + 1),
        _ => None,
    }
}

/// `Thrust A (kgf)` as `Thrust (kgf)` of side 1.
fn trailing_side(text: &str) -> Option<(String, u32)> {
    let (name, unit) = split_unit(text);
    let (rest, last) = name.rsplit_once(' ')?;
    let unit = unit.map(|u| format!(" ({u})")).unwrap_or_default();
    Some((format!("{rest}{unit}"), number_of(last)?))
}

fn target(text: &str, whole: &str) -> Target {
    if text.is_empty() || text.starts_with("Unnamed:") {
        return Target::Skip;
    }
    if let Some(tidy) = TIDY.iter().find(|t| **t == text) {
        return Target::Keep(tidy, 1.0, 0.0);
    }
    if text == "command_us" {
        return Target::Keep("pulse_us", 1.0, 0.0);
    }
    let (name, unit) = split_unit(text);
    let name = name.to_lowercase();
    if DERIVED.iter().any(|d| name.starts_with(d)) || name.contains("efficiency") || name.ends_with(" power") {
        return Target::Skip;
    }
    if ["timestamp", "time stamp", "datetime", "date time", "date/time", "date", "uhrzeit", "systemtime", "system time"]
        .contains(&name.as_str())
    {
        return unit.filter(|u| !u.is_empty()).map_or(Target::Stamp, |u| with_unit(Quantity::Time, "t_s", u));
    }
    // the Crazyflie's power deck beside its own battery reading
    match (name.as_str(), unit) {
        ("i", Some("A")) => return Target::Keep("current_a", 1.0, 0.0),
        ("v", Some("V")) => return Target::Covariate("voltage_deck_v".to_owned()),
        ("p", Some("W")) => return Target::Covariate("power_deck_w".to_owned()),
        // ESC32: duty in per cent; VESC: of one. Taken as linear over 1000 to 2000 us, as the tidy sets do
        ("duty" | "duty cycle", Some(_)) => return Target::Command(100.0),
        ("duty" | "duty cycle", None) => return Target::Unitless("duty"),
        ("throttle" | "esc throttle" | "control signal" | "command", Some("%")) => return Target::Command(100.0),
        _ => {}
    }
    if ERPM.contains(&name.as_str()) || unit.is_some_and(|u| plain(u).contains("erpm")) {
        let hundred = name.contains("100") || unit.is_some_and(|u| u.contains("100"));
        return Target::Electrical(if hundred { 100.0 } else { 1.0 });
    }
    if let (Some((_, column, factor)), None) = (WITH_UNIT.iter().find(|(n, ..)| *n == name), unit) {
        return Target::Keep(column, *factor, 0.0);
    }
    let words = name.replace('_', " ");
    for (names, quantity, column) in NAMES {
        if !names.contains(&words.as_str()) {
            continue;
        }
        return match (unit, quantity) {
            (Some(unit), _) => with_unit(quantity, column, unit),
            // a speed without a unit is what its name says
            (None, Quantity::Speed) if words.contains("rpm") => Target::Keep(column, 1.0, 0.0),
            (None, Quantity::Pulse) if words == "pwm" => Target::Unitless("pwm"),
            (None, _) if ["t", "n", "par", "speed", "omega"].contains(&words.as_str()) && quantity != Quantity::Time => {
                Target::Covariate(clean(whole))
            }
            (None, _) => Target::Unitless(column),
        };
    }
    // `thrust_gf`, `time_ms`: the last word is the unit
    if let (Some((head, last)), None) = (words.rsplit_once(' '), unit) {
        for (names, quantity, column) in NAMES {
            if names.contains(&head) && quantity.of_unit(last).is_some() {
                return with_unit(quantity, column, last);
            }
        }
    }
    Target::Covariate(clean(whole))
}

fn with_unit(quantity: Quantity, column: &'static str, unit: &str) -> Target {
    match quantity.of_unit(unit) {
        Some((factor, offset)) => Target::Keep(column, factor, offset),
        None => Target::UnknownUnit(column),
    }
}

/// The columns of a VESC Tool log that are taken; the others are derived, or of the vehicle around it.
const VESC: [(&str, Target); 7] = [
    ("ms_today", Target::Keep("t_s", 1e-3, 0.0)),
    ("input_voltage", Target::Keep("voltage_v", 1.0, 0.0)),
    ("current_in", Target::Keep("current_a", 1.0, 0.0)),
    ("temp_mos_max", Target::Keep("temp_c", 1.0, 0.0)),
    ("erpm", Target::Electrical(1.0)),
    ("duty_cycle", Target::Command(1.0)),
    ("amp_hours_used", Target::Keep("charge_esc_mah", 1e3, 0.0)),
];

/// Sorts a whole header; that of a VESC Tool log is known by two of its columns.
pub(super) fn sort_all(cells: &[String]) -> Vec<Sorted> {
    let holds = |name: &str| cells.iter().any(|c| c == name);
    if holds("ms_today") && holds("current_in") {
        let of = |cell: &String| {
            let known = VESC.iter().find(|(name, _)| name == cell).map(|(_, target)| target.clone());
            let further = ["current_motor", "temp_motor"].contains(&cell.as_str());
            let target = known.unwrap_or(if further { Target::Covariate(cell.clone()) } else { Target::Skip });
            Sorted { target, side: None }
        };
        return cells.iter().map(of).collect();
    }
    cells.iter().map(|c| sort(c)).collect()
}

/// How many cells of a line are known quantities.
pub(super) fn known(cells: &[String]) -> usize {
    sort_all(cells).iter().filter(|s| !matches!(s.target, Target::Covariate(..) | Target::Skip)).count()
}

/// Name and unit: the unit stands in brackets, or after a comma or a slash in the German manner (`Zeit in s`).
pub(super) fn split_unit(text: &str) -> (&str, Option<&str>) {
    for (open, close) in [('(', ')'), ('[', ']'), ('{', '}')] {
        if let (Some(a), Some(b)) = (text.rfind(open), text.rfind(close))
            && a < b
        {
            return (text[..a].trim(), Some(text[a + 1..b].trim()));
        }
    }
    for between in [", ", " in ", " / "] {
        if let Some((name, unit)) = text.rsplit_once(between)
            && Quantity::any_unit(unit)
        {
            return (name.trim(), Some(unit.trim()));
        }
    }
    (text, None)
}

/// A header as the name of a column.
pub(super) fn clean(text: &str) -> String {
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
        let keep = |column, factor| Target::Keep(column, factor, 0.0);
        for (header, wanted, side) in [
            ("Thrust (gf)", keep("thrust_n", 9.806_65e-3), None),
            ("Time (s)", keep("t_s", 1.0), None),
            ("ESC signal (\u{b5}s)", keep("pulse_us", 1.0), None),
            ("ESC signal", Target::Unitless("pulse_us"), None),
            ("Torque (N\u{b7}m)", keep("torque_nm", 1.0), None),
            ("weight[g]", keep("thrust_n", 9.806_65e-3), None),
            ("command_us", keep("pulse_us", 1.0), None),
            ("Thrust B (kgf)", keep("thrust_n", 9.806_65), Some(2)),
            ("Motor Optical Speed A (RPM)", keep(OPTICAL, 1.0), Some(1)),
            ("Powertrain 2 - rotation speed (rpm)", keep("rpm", 1.0), Some(2)),
            ("Powertrain 1 - ESC throttle (\u{3bc}s)", keep("pulse_us", 1.0), Some(1)),
            ("Schub [N]", keep("thrust_n", 1.0), None),
            ("Zeit in s", keep("t_s", 1.0), None),
            ("Drehzahl, 1/min", keep("rpm", 1.0), None),
            ("time_ms", keep("t_s", 1e-3), None),
            ("eRPM (x100)", Target::Electrical(100.0), None),
            ("Speed (ERPM)", Target::Electrical(1.0), None),
            ("Throttle (%)", Target::Command(100.0), None),
            ("Voltage", Target::Unitless("voltage_v"), None),
            ("Timestamp", Target::Stamp, None),
            ("Timestamp (ms)", keep("t_s", 1e-3), None),
            ("Consumption (mAh)", keep("charge_esc_mah", 1.0), None),
            ("Vibration (g)", Target::Covariate("vibration_g".into()), None),
            ("Vibration A (g)", Target::Covariate("vibration_a_g".into()), None),
            ("Thrust (stone)", Target::UnknownUnit("thrust_n"), None),
            ("Motor Efficiency (%)", Target::Skip, None),
            ("App message", Target::Skip, None),
        ] {
            assert_eq!(sort(header), Sorted { target: wanted, side }, "{header}");
        }
    }
}
