//! The second log's channels on the stand's rows.
//!
//! What it is: each of its columns at the times of the stand's rows, commands, codes and states as they stood and everything else on a straight
//! line, under a name that tells the logger; a channel that the stand lacks altogether takes the contract's name.
//! What can go wrong: outside the second log and across its gaps nothing is known, and nothing is filled in.
//! Units: the channels'.
//! Reference: specification `formats.md`, "Rig log": names of further channels.

use super::Joint;
use crate::log::import::Report;
use crate::log::{Column, Log, SPEED};
use crate::numeric::order::median;

/// What a logger may be called: an ESC, a flight controller, a board of the rig, a second stand.
pub const LABELS: [&str; 4] = ["esc", "fc", "board", "stand2"];

/// Longest gap that a straight line bridges: so many usual steps, and not under this, s.
const GAP: (f64, f64) = (5.0, 0.25);

/// Words in a name that speak of a state or of a code: half of one and half of another is none.
const STATES: [&str; 15] = [
    "status", "state", "states", "error", "errors", "err", "fault", "faults", "flag", "flags", "code", "codes", "mode", "armed",
    "alarm",
];
/// Words with which the name of a quantity begins that carries no unit.
const QUANTITIES: [&str; 11] =
    ["rpm", "erpm", "duty", "throttle", "command", "thrust", "torque", "current", "voltage", "temp", "power"];
/// Units at the end of a quantity's name.
const UNITS: [&str; 23] = [
    "a", "ma", "v", "mv", "n", "nm", "c", "k", "us", "ms", "s", "mah", "ah", "w", "wh", "hz", "deg", "pct", "percent", "hpa",
    "g", "kg", "rpm",
];
/// Most different whole numbers of a column without unit or known name that are codes.
const CODES: usize = 16;

/// Whether a column holds codes or states: whole numbers that are no quantity.
fn is_state(column: &Column) -> bool {
    let mut values: Vec<f64> = column.values.iter().copied().filter(|v| v.is_finite()).collect();
    if values.is_empty() || values.iter().any(|v| v.fract() != 0.0) {
        return false;
    }
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    let name = column.name.to_lowercase();
    let mut words = name.split('_');
    let (first, last) = (words.next().unwrap_or_default(), words.next_back().unwrap_or_default());
    let says = name.split('_').any(|word| STATES.contains(&word));
    !UNITS.contains(&last) && (says || !QUANTITIES.contains(&first) && values.len() <= CODES)
}

/// The name of another logger's column.
fn named(name: &str, label: &str) -> String {
    match name {
        "temp_c" => format!("temp_{label}_c"),
        "current_a" => format!("current_{label}_a"),
        "voltage_v" => format!("voltage_{label}_v"),
        "thrust_n" => format!("thrust_{label}_n"),
        "torque_nm" => format!("torque_{label}_nm"),
        "pulse_us" => format!("pulse_{label}_us"),
        n if SPEED.contains(&n) => {
            if n == "rpm" {
                format!("rpm_{label}")
            } else {
                format!("{n}_{label}")
            }
        }
        n if n.contains(&format!("_{label}")) => n.to_owned(),
        n => format!("{n}_{label}"),
    }
}

/// Whether a name is that of another logger's reading of what a rig measures.
pub(crate) fn is_second_reading(column: &str) -> bool {
    LABELS.iter().any(|label| {
        ["rpm", "current_a", "voltage_v", "thrust_n", "torque_nm", "pulse_us"].iter().any(|n| named(n, label) == column)
            || SPEED.iter().any(|n| named(n, label) == column)
    })
}

/// Adds another logger's channels to a stand's log.
pub fn merge(stand: &mut Log, other: &Log, joint: &Joint, label: &str) -> Report {
    let mut report = Report::default();
    let t: Vec<f64> = other.t.iter().map(|t| joint.to_stand(*t)).collect();
    let has_speed = SPEED.iter().any(|s| stand.column(s).is_some());
    for column in &other.columns {
        let hold = column.name.starts_with("pulse_us") || is_state(column);
        let values = onto(&stand.t, &t, &column.values, hold);
        let known = values.iter().filter(|v| v.is_finite()).count();
        if known == 0 {
            continue;
        }
        let lacking = match column.name.as_str() {
            n if SPEED.contains(&n) => !has_speed,
            n => {
                ["pulse_us", "current_a", "voltage_v", "thrust_n", "torque_nm", "temp_c"].contains(&n)
                    && stand.column(n).is_none()
            }
        };
        let name = if lacking { column.name.clone() } else { named(&column.name, label) };
        if stand.column(&name).is_some() {
            report.add(&name, format!("the stand's log holds a column of this name: {}'s is left out", other.name), known);
            continue;
        }
        let how = if hold { "as it stood" } else { "on straight lines" };
        let whose = if lacking { ", which the stand lacks" } else { "" };
        report.add(&name, format!("{} of {}{whose}, {how}, in {known} of {} rows", column.name, other.name, stand.len()), 1);
        stand.columns.push(Column { name, values });
    }
    report.add("t_s", format!("clock of {}: {}", other.name, joint.sentence()), 1);
    let text = |s: String| toml::Value::String(s);
    stand.meta.insert(format!("joint_{label}"), text(format!("{}: {}", other.name, joint.sentence())));
    for key in ["motor", "propeller", "pole_pairs"] {
        if let (None, Some(value)) = (stand.meta.get(key), other.meta.get(key)) {
            stand.meta.insert(key.to_owned(), value.clone());
        }
    }
    report
}

/// Values over `from` at the times `to`.
fn onto(to: &[f64], from: &[f64], values: &[f64], hold: bool) -> Vec<f64> {
    let kept: Vec<(f64, f64)> = from.iter().copied().zip(values.iter().copied()).filter(|(_, v)| v.is_finite()).collect();
    let mut steps: Vec<f64> = kept.windows(2).map(|w| w[1].0 - w[0].0).collect();
    if steps.is_empty() {
        return vec![f64::NAN; to.len()];
    }
    let gap = (GAP.0 * median(&mut steps)).max(GAP.1);
    let mut k = 0;
    let mut at = |t: f64| {
        while k + 1 < kept.len() && kept[k + 1].0 <= t {
            k += 1;
        }
        let (a, va) = kept[k];
        match kept.get(k + 1) {
            _ if t < a => f64::NAN,
            Some((b, vb)) if b - a <= gap => {
                if hold {
                    va
                } else {
                    va + (vb - va) * (t - a) / (b - a)
                }
            }
            _ if t - a <= gap && (hold || t == a) => va,
            _ => f64::NAN,
        }
    };
    to.iter().map(|t| at(*t)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_logger() {
        let of = |name| named(name, "esc");
        assert_eq!(
            ["rpm", "current_a", "voltage_v", "temp_c", "charge_esc_mah", "duty"].map(of),
            ["rpm_esc", "current_esc_a", "voltage_esc_v", "temp_esc_c", "charge_esc_mah", "duty_esc"]
        );
        assert!(is_second_reading("rpm_fc") && is_second_reading("current_esc_a"));
        assert!(!is_second_reading("rpm_electrical") && !is_second_reading("rpm") && !is_second_reading("temp_esc_c"));
    }

    /// What counts states or bits is taken from the row before; what measures is not, whole numbers or not.
    #[test]
    fn codes_are_taken_as_they_stood() {
        let of = |name: &str, values: &[f64]| is_state(&Column { name: name.into(), values: values.to_vec() });
        let codes = [0.0, 4.0, f64::NAN, 64.0];
        for name in ["status", "error_code", "esc_flags", "fault_esc", "x7"] {
            assert!(of(name, &codes), "{name}");
        }
        for name in ["rpm", "rpm_electrical", "voltage_v", "charge_esc_mah", "duty", "state_of_charge_pct", "temp_c"] {
            assert!(!of(name, &codes), "{name}");
        }
        let many: Vec<f64> = (0..100).map(f64::from).collect();
        assert!(!of("x7", &many) && !of("status", &[0.5, 1.0]) && of("status", &many) && !of("status", &[f64::NAN]));
    }

    /// Between a row without a fault and one with code 4 there is no code 2.
    #[test]
    fn a_joined_log_has_no_codes_that_nobody_wrote() {
        let column = |name: &str, values: Vec<f64>| Column { name: name.to_owned(), values };
        let mut stand = Log { t: (0..40).map(|i| 0.05 * f64::from(i)).collect(), ..Log::default() };
        let of = |f: &dyn Fn(i32) -> f64| (0..20).map(f).collect::<Vec<f64>>();
        let columns =
            vec![column("status", of(&|i| f64::from(4 * (i / 10)))), column("temp_c", of(&|i| 20.0 + f64::from(2 * i)))];
        let other = Log { t: of(&|i| 0.1 * f64::from(i)), columns, ..Log::default() };
        let joint = Joint {
            offset_s: (0.0, 0.0),
            drift_ppm: (0.0, 0.0),
            pivot_s: 0.0,
            worst_s: 0.0,
            overlap_s: (0.0, 2.0),
            seen: Vec::new(),
            pieces: Vec::new(),
        };
        let report = merge(&mut stand, &other, &joint, "esc");
        let codes = stand.column("status_esc").expect("the codes");
        assert!(codes.iter().all(|v| [0.0, 4.0].contains(v) || v.is_nan()) && codes[19] == 0.0 && codes[20] == 4.0, "{codes:?}");
        assert_eq!(stand.column("temp_c").map(|t| (t[1] * 1e6).round() / 1e6), Some(21.0), "a temperature lies between");
        let how = |name: &str| report.notes.iter().find(|n| n.column == name).map(|n| n.what.clone()).unwrap_or_default();
        assert!(how("status_esc").contains("as it stood") && how("temp_c").contains("on straight lines"));
    }

    #[test]
    fn straight_lines_holds_and_gaps() {
        let from = [0.0, 0.1, 0.2, 2.0];
        let line = onto(&[-0.1, 0.05, 0.2, 1.0, 2.0], &from, &[0.0, 1.0, 3.0, 9.0], false);
        assert_eq!(line.iter().map(|v| v.is_finite()).collect::<Vec<_>>(), [false, true, true, false, true]);
        assert!((line[1] - 0.5).abs() < 1e-12);
        assert_eq!(onto(&[0.15, 0.3], &from, &[0.0, 1.0, 3.0, 9.0], true), [1.0, 3.0]);
    }
}
