//! PX4 flights (ULog) become flight logs.
//!
//! What it is: the topics of a flight on the clock of its inertial sensors. PX4's frames are ours (body FRD, earth NED, quaternion body to
//! earth), so nothing is turned. A log's own geometry (`CA_ROTOR*` parameters) becomes the layout.
//! What can go wrong: a file that is no ULog is left to the other importers; one without inertial sensors is refused; a log that breaks off
//! keeps what came before, and this is said.
//! Units: us to s, gauss to uT, motor commands 0..1 to 1000..2000 us.
//! Reference: docs.px4.io, "ULog File Format" and "uORB Message Reference"; parser: crate px4-ulog.

use super::streams::{Between, Stream};
use super::{Report, begins};
use crate::log::{Column, Log, Place, ReadError};
use px4_ulog::stream_parser::model::{DataMessage, FlattenedFieldType, ParameterMessage};
use px4_ulog::stream_parser::{LittleEndianParser, LogParser};
use std::collections::BTreeMap;
use std::path::Path;

/// First bytes of a ULog file.
pub(super) const MAGIC: [u8; 7] = [0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35];
/// Most rotors.
const ROTORS: usize = 12;

/// One column of ours, and where it may come from, the better source first: topic, field, factor, offset.
struct Source {
    ours: &'static str,
    between: Between,
    theirs: &'static [(&'static str, &'static str, f64)],
}

const fn source(ours: &'static str, between: Between, theirs: &'static [(&'static str, &'static str, f64)]) -> Source {
    Source { ours, between, theirs }
}

/// Field of the earth of one gauss, uT.
const GAUSS_UT: f64 = 100.0;

const SOURCES: [Source; 23] = [
    source("acc_x", Between::Line, &[("sensor_combined", "accelerometer_m_s2[0]", 1.0), ("vehicle_acceleration", "xyz[0]", 1.0)]),
    source("acc_y", Between::Line, &[("sensor_combined", "accelerometer_m_s2[1]", 1.0), ("vehicle_acceleration", "xyz[1]", 1.0)]),
    source("acc_z", Between::Line, &[("sensor_combined", "accelerometer_m_s2[2]", 1.0), ("vehicle_acceleration", "xyz[2]", 1.0)]),
    source("gyro_x", Between::Line, &[("sensor_combined", "gyro_rad[0]", 1.0), ("vehicle_angular_velocity", "xyz[0]", 1.0)]),
    source("gyro_y", Between::Line, &[("sensor_combined", "gyro_rad[1]", 1.0), ("vehicle_angular_velocity", "xyz[1]", 1.0)]),
    source("gyro_z", Between::Line, &[("sensor_combined", "gyro_rad[2]", 1.0), ("vehicle_angular_velocity", "xyz[2]", 1.0)]),
    source("vel_x", Between::Line, &[("vehicle_local_position", "vx", 1.0)]),
    source("vel_y", Between::Line, &[("vehicle_local_position", "vy", 1.0)]),
    source("vel_z", Between::Line, &[("vehicle_local_position", "vz", 1.0)]),
    source("pos_x", Between::Line, &[("vehicle_local_position", "x", 1.0)]),
    source("pos_y", Between::Line, &[("vehicle_local_position", "y", 1.0)]),
    source("pos_z", Between::Line, &[("vehicle_local_position", "z", 1.0)]),
    source("qw", Between::Line, &[("vehicle_attitude", "q[0]", 1.0)]),
    source("qx", Between::Line, &[("vehicle_attitude", "q[1]", 1.0)]),
    source("qy", Between::Line, &[("vehicle_attitude", "q[2]", 1.0)]),
    source("qz", Between::Line, &[("vehicle_attitude", "q[3]", 1.0)]),
    source("voltage_v", Between::Hold, &[("battery_status", "voltage_v", 1.0)]),
    source("current_a", Between::Hold, &[("battery_status", "current_a", 1.0)]),
    source("mag_x", Between::Line, &[("vehicle_magnetometer", "magnetometer_ga[0]", GAUSS_UT)]),
    source("mag_y", Between::Line, &[("vehicle_magnetometer", "magnetometer_ga[1]", GAUSS_UT)]),
    source("mag_z", Between::Line, &[("vehicle_magnetometer", "magnetometer_ga[2]", GAUSS_UT)]),
    source("temp_c", Between::Hold, &[("sensor_gyro", "temperature", 1.0)]),
    source("pressure_pa", Between::Hold, &[("vehicle_air_data", "baro_pressure_pa", 1.0)]),
];

/// Samples of every field, by topic and field; of several instances of a topic the first.
#[derive(Default)]
struct Topics {
    streams: BTreeMap<(String, String), Stream>,
    parameters: BTreeMap<String, f64>,
}

impl Topics {
    fn get(&self, topic: &str, field: &str) -> Option<&Stream> {
        self.streams.get(&(topic.to_owned(), field.to_owned())).filter(|s| s.v.iter().any(|v| v.is_finite()))
    }

    fn add(&mut self, message: &DataMessage<'_>) {
        let format = message.flattened_format;
        if message.multi_id.value() != 0 || !wanted(format.message_name()) {
            return;
        }
        let Some(stamp) = &format.timestamp_field else { return };
        let t = stamp.parse_timestamp(message.data) as f64 * 1e-6;
        for field in format.field_iter() {
            let bytes = message.data.get(usize::from(field.offset)..).unwrap_or_default();
            let Some(value) = number(&field.field_type, bytes) else { continue };
            let key = (format.message_name().to_owned(), field.flattened_field_name.clone());
            let stream = self.streams.entry(key).or_default();
            // a clock that stands still or steps back costs the sample
            if stream.t.last().is_none_or(|last| t > *last) {
                stream.t.push(t);
                stream.v.push(value);
            }
        }
    }
}

fn wanted(topic: &str) -> bool {
    SOURCES.iter().any(|s| s.theirs.iter().any(|t| t.0 == topic))
        || matches!(topic, "esc_status" | "actuator_motors" | "actuator_outputs")
}

fn number(kind: &FlattenedFieldType, bytes: &[u8]) -> Option<f64> {
    let whole = |n: usize| bytes.len() >= n;
    Some(match kind {
        FlattenedFieldType::Float if whole(4) => f64::from(f32::parse(bytes)),
        FlattenedFieldType::Double if whole(8) => f64::parse(bytes),
        FlattenedFieldType::Int32 if whole(4) => f64::from(i32::parse(bytes)),
        FlattenedFieldType::UInt32 if whole(4) => f64::from(u32::parse(bytes)),
        FlattenedFieldType::Int16 if whole(2) => f64::from(i16::parse(bytes)),
        FlattenedFieldType::UInt16 if whole(2) => f64::from(u16::parse(bytes)),
        FlattenedFieldType::UInt8 if whole(1) => f64::from(u8::parse(bytes)),
        FlattenedFieldType::Int8 if whole(1) => f64::from(i8::parse(bytes)),
        _ => return None,
    })
}

/// Imports a PX4 flight; nothing where the file is no ULog.
///
/// # Errors
/// [`ReadError`] with the file and what it lacks.
pub(super) fn ulog(path: &Path) -> Result<Option<(Log, Report)>, ReadError> {
    let file = path.display().to_string();
    let failed = |source| ReadError::Io { file: file.clone(), source };
    if !begins(path, &MAGIC).map_err(failed)? {
        return Ok(None);
    }
    let bytes = std::fs::read(path).map_err(failed)?;
    let (topics, broken) = parse(&file, &bytes)?;
    let mut report = Report::default();
    if let Some(why) = broken {
        report.add("(file)", format!("breaks off: {why}; what came before is kept"), 1);
    }
    let log = flight(&file, &topics, &mut report)?;
    Ok(Some((log, report)))
}

/// One rotor's ESC (from 1) on its own time stamps; nothing where the file is no ULog.
///
/// # Errors
/// [`ReadError`] with the file and what it lacks.
pub(super) fn rotor(path: &Path, n: usize) -> Result<Option<(Log, Report)>, ReadError> {
    let file = path.display().to_string();
    let failed = |source| ReadError::Io { file: file.clone(), source };
    if !begins(path, &MAGIC).map_err(failed)? {
        return Ok(None);
    }
    let (topics, broken) = parse(&file, &std::fs::read(path).map_err(failed)?)?;
    let (mut log, mut report) = (Log::default(), Report::default());
    report.add(
        "(file)",
        format!("breaks off: {}; what came before is kept", broken.clone().unwrap_or_default()),
        usize::from(broken.is_some()),
    );
    let esc = |field: &str| topics.get("esc_status", &format!("esc[{}].{field}", n.wrapping_sub(1)));
    let Some(speed) = esc("esc_rpm") else { return Ok(Some((log, report))) };
    log.t.clone_from(&speed.t);
    if let Some(pulse) = pulse(&topics, n.wrapping_sub(1), &log.t) {
        log.columns.push(Column { name: "pulse_us".into(), values: pulse });
        report.add("pulse_us", "motor command 0..1 as 1000..2000 us, or the output in us, as it stood", 1);
    }
    log.columns.push(Column { name: "rpm".into(), values: speed.v.iter().map(|v| v.abs()).collect() });
    for (field, name) in [("esc_current", "current_a"), ("esc_voltage", "voltage_v"), ("esc_temperature", "temp_c")] {
        if let Some(stream) = esc(field).filter(|s| s.v.iter().any(|v| *v != 0.0)) {
            log.columns.push(Column { name: name.into(), values: stream.onto(&log.t, Between::Hold) });
        }
    }
    if let (None, Some(battery)) = (log.column("voltage_v"), topics.get("battery_status", "voltage_v")) {
        log.columns.push(Column { name: "voltage_v".into(), values: battery.onto(&log.t, Between::Hold) });
        report.add("voltage_v", "the ESC tells none: the battery's, as it stood", 1);
    }
    report.add("t_s", "the ESC's own time stamps (esc_status), s since the board started", 1);
    Ok(Some((log, report)))
}

/// Command of a rotor (from 0) as it stood, us.
fn pulse(topics: &Topics, i: usize, t: &[f64]) -> Option<Vec<f64>> {
    let motor = topics.get("actuator_motors", &format!("control[{i}]")).map(|s| (s, 1000.0, 1000.0));
    let output = topics.get("actuator_outputs", &format!("output[{i}]")).map(|s| (s, 0.0, 1.0));
    let (stream, offset, factor) = motor.or_else(|| output.filter(|o| o.0.v.iter().any(|v| *v > 0.0)))?;
    let held = stream.onto(t, Between::Hold).into_iter();
    Some(held.map(|v| offset + factor * v).map(|v| if (500.0..=2500.0).contains(&v) { v } else { f64::NAN }).collect())
}

fn parse(file: &str, bytes: &[u8]) -> Result<(Topics, Option<String>), ReadError> {
    let (mut topics, mut parameters) = (Topics::default(), BTreeMap::new());
    let mut add = |m: &DataMessage<'_>| topics.add(m);
    let mut set = |m: &ParameterMessage<'_>| {
        let (name, value) = match m {
            ParameterMessage::Float(name, value, _) => (name, f64::from(*value)),
            ParameterMessage::Int32(name, value, _) => (name, f64::from(*value)),
        };
        parameters.insert((*name).to_owned(), value);
    };
    let mut parser = LogParser::default();
    parser.set_data_message_callback(&mut add);
    parser.set_parameter_message_callback(&mut set);
    let outcome = parser.consume_bytes(bytes);
    let broken = match outcome {
        Err(e) if !parser.in_data() => {
            return Err(Place { file, line: 1 }.refuse(
                None,
                format!("a ULog whose head cannot be read ({e})"),
                "a complete ULog file",
            ));
        }
        Err(e) => Some(e.to_string()),
        Ok(()) if parser.has_leftover() => Some("in the middle of a record".to_owned()),
        Ok(()) => None,
    };
    drop(parser);
    topics.parameters = parameters;
    Ok((topics, broken))
}

fn flight(file: &str, topics: &Topics, report: &mut Report) -> Result<Log, ReadError> {
    let clock = [("sensor_combined", "gyro_rad[0]"), ("vehicle_angular_velocity", "xyz[0]")];
    let Some((topic, base)) = clock.iter().find_map(|(topic, field)| Some((*topic, topics.get(topic, field)?))) else {
        let expected = "the topic sensor_combined or vehicle_angular_velocity (logging profile with inertial sensors)";
        return Err(Place { file, line: 1 }.refuse(None, "a ULog without a gyro", expected));
    };
    let name = Path::new(file).file_name().map_or_else(|| file.to_owned(), |n| n.to_string_lossy().into_owned());
    let mut log = Log { name: name.clone(), t: base.t.clone(), ..Log::default() };
    report.add(
        "t_s",
        format!("the clock of {topic}, s since the board started; other topics on straight lines, commands held"),
        1,
    );
    rotors(topics, &mut log, report);
    for s in &SOURCES {
        let found = s.theirs.iter().find_map(|(topic, field, factor)| Some((topics.get(topic, field)?, *factor)));
        if let Some((stream, factor)) = found {
            let values = stream.onto(&log.t, s.between).into_iter().map(|v| factor * v).collect();
            log.columns.push(Column { name: s.ours.to_owned(), values });
        }
    }
    unit_length(&mut log);
    report.add("acc, gyro, vel, pos, q", "body forward-right-down and north-east-down already: not turned", 1);
    let text = |s: &str| toml::Value::String(s.to_owned());
    log.meta.insert("source".into(), text(&name));
    log.meta.insert("frames".into(), text("PX4: forward-right-down, north-east-down, as ours"));
    Ok(log)
}

/// Pulses, speeds and the places of the rotors.
fn rotors(topics: &Topics, log: &mut Log, report: &mut Report) {
    let mut count = 0;
    for i in 0..ROTORS {
        let pulse = pulse(topics, i, &log.t);
        let speed = topics.get("esc_status", &format!("esc[{i}].esc_rpm")).filter(|s| s.v.iter().any(|v| *v != 0.0));
        let has_pulse = pulse.is_some();
        if let Some(values) = pulse {
            log.columns.push(Column { name: format!("pulse_us_{}", i + 1), values });
        }
        if let Some(stream) = speed {
            let values = stream.onto(&log.t, Between::Line).into_iter().map(f64::abs).collect();
            log.columns.push(Column { name: format!("rpm_{}", i + 1), values });
        }
        count += usize::from(has_pulse || speed.is_some());
    }
    report.add("pulse_us", "motor command 0..1 as 1000..2000 us, or the output in us", count);
    let place = |i: usize| -> Option<toml::Value> {
        let of = |what: &str| topics.parameters.get(&format!("CA_ROTOR{i}_{what}")).copied();
        // a positive moment coefficient is a rotor that turns counter-clockwise
        let turns = if of("KM")? > 0.0 { -1.0 } else { 1.0 };
        Some(toml::Value::Array([of("PX")?, of("PY")?, turns].map(toml::Value::Float).to_vec()))
    };
    let places: Option<Vec<toml::Value>> = (0..count).map(place).collect();
    if let Some(places) = places.filter(|p| !p.is_empty()) {
        let arm = |v: &toml::Value| {
            let of = |k: usize| v.get(k).and_then(toml::Value::as_float).unwrap_or(0.0);
            of(0).hypot(of(1))
        };
        let arms: Vec<f64> = places.iter().map(arm).collect();
        log.meta.insert("rotors_m".into(), toml::Value::Array(places));
        if arms.iter().all(|a| *a > 0.0 && (a - arms[0]).abs() < 0.05 * arms[0]) {
            log.meta.insert("arm_m".into(), toml::Value::Float(arms[0]));
        }
        report.add("rotors_m", "places and turns from the log's parameters CA_ROTOR*", count);
    } else if count == 4 {
        let layout = "x: 1 front right, 2 rear left, 3 front left, 4 rear right; 3 and 4 clockwise";
        log.meta.insert("layout".into(), toml::Value::String(layout.into()));
        report.add("layout", "PX4's quadrotor x taken for granted: the log has no CA_ROTOR* parameters", 1);
    }
}

/// Quaternions on straight lines are shorter than one.
fn unit_length(log: &mut Log) {
    let at: Vec<usize> = ["qw", "qx", "qy", "qz"].iter().filter_map(|n| log.columns.iter().position(|c| c.name == *n)).collect();
    if at.len() < 4 {
        return;
    }
    for row in 0..log.t.len() {
        let norm = at.iter().map(|k| log.columns[*k].values[row].powi(2)).sum::<f64>().sqrt();
        at.iter().for_each(|k| log.columns[*k].values[row] /= norm);
    }
}
