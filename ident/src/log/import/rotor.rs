//! One rotor of a recorded flight as a rig log: its command, speed, current and voltage.
//!
//! What it is: of a PX4 ULog what the ESC itself reported (`esc_status`), on the ESC's own time stamps, with the command as it stood and the
//! battery's voltage; of a Betaflight Blackbox the motor's output, its speed and the battery's voltage.
//! What can go wrong: a flight without a speed of that rotor, or without a second channel, is refused. There is no thrust and no torque; the
//! air moves past a rotor in flight, so thrust(rpm) of a stand does not hold there and is not asked.
//! Units: us, rev/min, A, V, degC.
//! Reference: PX4 `esc_status` and `actuator_motors`; Betaflight, bidirectional DShot.

use super::{Report, blackbox, ulog};
use crate::log::{Column, Log, Place, ReadError};
use std::path::Path;

/// Whether a file is a flight controller's own recording: a PX4 ULog or a Betaflight Blackbox log.
#[must_use]
pub fn is_recording(path: &Path) -> bool {
    [&ulog::MAGIC[..], blackbox::MAGIC].iter().any(|magic| super::begins(path, magic).unwrap_or(false))
}

/// Imports rotor `n` (from 1) of a flight; nothing where the file is no ULog and no Blackbox log.
///
/// # Errors
/// [`ReadError`] with the file and what it lacks.
pub fn rotor(path: &Path, n: usize) -> Result<Option<(Log, Report)>, ReadError> {
    let found = match ulog::rotor(path, n)? {
        Some(found) => Some(found),
        None => blackbox::blackbox(path)?.map(|(log, report)| (of_flight(&log, n), report)),
    };
    let Some((mut log, mut report)) = found else { return Ok(None) };
    let file = path.display().to_string();
    if log.column("rpm").is_none_or(|v| v.iter().all(|v| v.is_nan() || *v == 0.0)) || log.columns.len() < 2 {
        let expected = "a flight whose ESCs tell their speed (esc_status, bidirectional DShot), or another --rotor";
        return Err(Place { file: &file, line: 1 }.refuse(None, format!("no speed of rotor {n}"), expected));
    }
    log.name = path.file_name().map_or(file, |n| n.to_string_lossy().into_owned());
    log.meta.insert("source".into(), toml::Value::String(log.name.clone()));
    log.meta.insert("rotor".into(), toml::Value::Integer(n as i64));
    report.add("rpm", format!("rotor {n} of a flight as a rig: no thrust, no torque; the air moves past it"), log.len());
    Ok(Some((log, report)))
}

/// The columns of one rotor of a flight log. The battery's current is that of all rotors: a further column.
fn of_flight(flight: &Log, n: usize) -> Log {
    let mut log = Log { t: flight.t.clone(), ..Log::default() };
    let names = [
        (format!("pulse_us_{n}"), "pulse_us"),
        (format!("rpm_{n}"), "rpm"),
        ("voltage_v".to_owned(), "voltage_v"),
        ("current_a".to_owned(), "current_of_all_a"),
    ];
    for (theirs, ours) in names {
        if let Some(values) = flight.column(&theirs) {
            log.columns.push(Column { name: ours.to_owned(), values: values.to_vec() });
        }
    }
    for key in ["firmware", "motor_poles"] {
        if let Some(value) = flight.meta.get(key) {
            log.meta.insert(key.to_owned(), value.clone());
        }
    }
    log
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rotor_of_a_flight_log_is_taken() {
        let column = |name: &str, v: f64| Column { name: name.into(), values: vec![v; 3] };
        let columns = vec![
            column("gyro_x", 0.1),
            column("pulse_us_2", 1500.0),
            column("rpm_2", 9000.0),
            column("rpm_1", 1.0),
            column("current_a", 40.0),
        ];
        let log = of_flight(&Log { t: vec![0.0, 0.1, 0.2], columns, ..Log::default() }, 2);
        let names: Vec<&str> = log.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["pulse_us", "rpm", "current_of_all_a"]);
        assert_eq!(log.column("rpm").unwrap()[0], 9000.0);
    }
}
