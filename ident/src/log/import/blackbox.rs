//! Betaflight flights (Blackbox) become flight logs.
//!
//! What it is: the main frames of the longest flight in a file: gyro, accelerometer, motor commands, their speeds (bidirectional DShot), battery.
//! Betaflight's body axes are forward, left, up; half a turn about x makes them ours.
//! What can go wrong: a file that is no Blackbox log is left to the other importers; one of another firmware than Betaflight 4.2 to 4.5 (or INAV 5
//! to 8), or without a readable flight, is refused. Damaged frames are skipped by the parser. There is no velocity, place or attitude in such a log.
//! Units: us to s, deg/s and g to rad/s and m/s^2, centivolts and centiamperes to V and A, motor outputs to 1000..2000 us, hundreds of electrical
//! turns a minute to rev/min.
//! Reference: betaflight.com, "Blackbox Internals"; parser: crate blackbox-log.

use super::{Report, begins};
use crate::log::{Column, Log, Place, ReadError};
use blackbox_log::frame::{FieldDef, FrameDef, MainValue};
use blackbox_log::prelude::*;
use blackbox_log::units::si::acceleration::meter_per_second_squared;
use blackbox_log::units::si::angular_velocity::radian_per_second;
use blackbox_log::units::si::electric_current::ampere;
use blackbox_log::units::si::electric_potential::volt;
use std::path::Path;

/// First bytes of a Blackbox log.
pub(super) const MAGIC: &[u8] = b"H Product:Blackbox flight data recorder by Nicholas Sherlock";
/// Poles of a motor where the log does not say.
const POLES: f64 = 14.0;

/// Name of ours, and the factor, for a field of theirs.
fn ours(field: &str) -> Option<(String, f64)> {
    let (head, index) = field.strip_suffix(']').and_then(|f| f.split_once('[')).unwrap_or((field, ""));
    let number: usize = index.parse().unwrap_or(0);
    let axis = |name: &str| {
        // forward, left, up to forward, right, down
        let (letter, sign) = [("x", 1.0), ("y", -1.0), ("z", -1.0)].get(number).copied()?;
        Some((format!("{name}_{letter}"), sign))
    };
    match head {
        "gyroADC" => axis("gyro"),
        "accSmooth" => axis("acc"),
        "magADC" => axis("raw_mag"),
        "motor" => Some((format!("pulse_us_{}", number + 1), 1.0)),
        "eRPM" => Some((format!("rpm_{}", number + 1), 1.0)),
        "vbatLatest" => Some(("voltage_v".to_owned(), 1.0)),
        "amperageLatest" => Some(("current_a".to_owned(), 1.0)),
        _ => None,
    }
}

/// Imports a Betaflight flight; nothing where the file is no Blackbox log.
///
/// # Errors
/// [`ReadError`] with the file and what it lacks.
pub(super) fn blackbox(path: &Path) -> Result<Option<(Log, Report)>, ReadError> {
    let file = path.display().to_string();
    let failed = |source| ReadError::Io { file: file.clone(), source };
    if !begins(path, MAGIC).map_err(failed)? {
        return Ok(None);
    }
    let bytes = std::fs::read(path).map_err(failed)?;
    let place = Place { file: &file, line: 1 };
    if header(&bytes, "gyro_scale").or_else(|| header(&bytes, "gyro.scale")).is_none() {
        return Err(place.refuse(None, "a Blackbox log without its gyro's scale", "a header gyro_scale"));
    }
    let all = blackbox_log::File::new(&bytes);
    let mut report = Report::default();
    let mut best: Option<Log> = None;
    let mut refused = None;
    for headers in all.iter() {
        match headers {
            Ok(headers) => {
                let log = flight(&headers, outputs(&bytes), &mut report);
                if best.as_ref().is_none_or(|b| log.len() > b.len()) {
                    best = Some(log);
                }
            }
            Err(e) => refused = Some(e.to_string()),
        }
    }
    let Some(mut log) = best.filter(|l| l.len() > 1) else {
        let why = refused.unwrap_or_else(|| "no frame can be read".to_owned());
        return Err(place.refuse(
            None,
            format!("a Blackbox log of which {why}"),
            "a flight of Betaflight 4.2 to 4.5 or INAV 5 to 8",
        ));
    };
    report.add("(file)", "flights in the file; the longest is taken", all.log_count());
    log.name = path.file_name().map_or(file, |n| n.to_string_lossy().into_owned());
    say(&mut log, &mut report);
    Ok(Some((log, report)))
}

/// Value of a header of the file's first flight.
fn header<'b>(bytes: &'b [u8], name: &str) -> Option<&'b str> {
    let lines = bytes.split(|b| *b == b'\n').take_while(|l| l.starts_with(b"H "));
    lines.filter_map(|l| std::str::from_utf8(&l[2..]).ok()?.split_once(':')).find(|(n, _)| *n == name).map(|(_, v)| v)
}

/// Range of the motors' outputs: DShot's 48 to 2047, or pulses in us.
fn outputs(bytes: &[u8]) -> [f64; 2] {
    let range: Vec<f64> =
        header(bytes, "motorOutput").map_or_else(Vec::new, |v| v.split(',').filter_map(|n| n.trim().parse().ok()).collect());
    if let [low, high] = range[..] { [low, high] } else { [1000.0, 2000.0] }
}

fn flight(headers: &Headers<'_>, [low, high]: [f64; 2], report: &mut Report) -> Log {
    let known = |key: &str| headers.unknown().get(key).and_then(|v| v.parse::<f64>().ok());
    let poles = known("motor_poles").filter(|p| *p >= 2.0).unwrap_or(POLES);
    let names: Vec<Option<(String, f64)>> = headers.main_frame_def().iter().map(|FieldDef { name, .. }| ours(name)).collect();
    let columns = names.iter().flatten().map(|(name, _)| Column { name: name.clone(), values: Vec::new() }).collect();
    let mut log = Log { columns, ..Log::default() };
    let mut stepped = 0;
    let mut parser = headers.data_parser();
    while let Some(event) = parser.next() {
        let ParserEvent::Main(frame) = event else { continue };
        let t = frame.time_raw() as f64 * 1e-6;
        if log.t.last().is_some_and(|last| t <= *last) {
            stepped += 1;
            continue;
        }
        log.t.push(t);
        let mut columns = log.columns.iter_mut();
        for (value, name) in frame.iter().zip(&names) {
            let Some((name, factor)) = name else { continue };
            let number = match value {
                MainValue::Amperage(i) => i.get::<ampere>(),
                MainValue::Voltage(v) => v.get::<volt>(),
                MainValue::Acceleration(a) => a.get::<meter_per_second_squared>(),
                MainValue::Rotation(w) => w.get::<radian_per_second>(),
                MainValue::Unsigned(v) => f64::from(v),
                MainValue::Signed(v) => f64::from(v),
            };
            let scaled = match name.split('_').next() {
                Some("pulse") => 1000.0 + 1000.0 * ((number - low) / (high - low)).clamp(0.0, 1.0),
                Some("rpm") => number * 200.0 / poles,
                _ => factor * number,
            };
            if let Some(column) = columns.next() {
                column.values.push(scaled);
            }
        }
    }
    report.add("t_s", "a time that repeats or steps back: frame left out", stepped);
    log.meta.insert("firmware".into(), toml::Value::String(headers.firmware_revision().to_owned()));
    log.meta.insert("motor_poles".into(), toml::Value::Float(poles));
    log.columns.retain(|c| !c.name.starts_with("raw_"));
    log
}

/// What was turned and scaled.
fn say(log: &mut Log, report: &mut Report) {
    let count = |prefix: &str| log.columns.iter().filter(|c| c.name.starts_with(prefix)).count();
    report.add(
        "gyro, acc",
        "deg/s and g, body forward-left-up, to rad/s and m/s^2, forward-right-down",
        count("gyro_") + count("acc_"),
    );
    report.add("pulse_us", "motor outputs over their range as 1000 to 2000 us", count("pulse_us_"));
    report.add("rpm", "hundreds of electrical turns a minute over the pole pairs", count("rpm_"));
    let text = |s: &str| toml::Value::String(s.to_owned());
    log.meta.insert("source".into(), text(&log.name.clone()));
    log.meta.insert("frames".into(), text("Betaflight: from forward-left-up; no velocity, place or attitude"));
    if count("pulse_us_") == 4 {
        let layout = "x: 1 rear right, 2 front right, 3 rear left, 4 front left; 1 and 4 clockwise";
        log.meta.insert("layout".into(), text(layout));
        report.add("layout", "Betaflight's quad x with propellers turning in, taken for granted", 1);
    }
}
