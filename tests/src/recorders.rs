//! Other programs' flight recorders, written: a flight log becomes a PX4 ULog or a Betaflight Blackbox file.
//!
//! What it is: the least of each format that holds a flight, byte by byte, so that the importers can be tried on flights whose truth is known.
//! What can go wrong: nothing; these writers are for tests and know no option of either format.
//! Units: those of the recorders.
//! Reference: docs.px4.io, "ULog File Format"; betaflight.com, "Blackbox Internals".

use ident::log::Log;

const G: f64 = 9.806_65;

/// A ULog under construction.
struct ULog {
    bytes: Vec<u8>,
}

impl ULog {
    fn new() -> Self {
        let mut bytes = vec![0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35, 0x01];
        bytes.extend_from_slice(&1_000_000u64.to_le_bytes());
        let mut out = Self { bytes };
        out.message(b'B', &[0; 40]);
        out
    }

    fn message(&mut self, kind: u8, payload: &[u8]) {
        self.bytes.extend_from_slice(&(payload.len() as u16).to_le_bytes());
        self.bytes.push(kind);
        self.bytes.extend_from_slice(payload);
    }

    fn parameter(&mut self, name: &str, value: f32) {
        let key = format!("float {name}");
        let mut payload = vec![key.len() as u8];
        payload.extend_from_slice(key.as_bytes());
        payload.extend_from_slice(&value.to_le_bytes());
        self.message(b'P', &payload);
    }

    fn subscribe(&mut self, id: u16, topic: &str) {
        let mut payload = vec![0];
        payload.extend_from_slice(&id.to_le_bytes());
        payload.extend_from_slice(topic.as_bytes());
        self.message(b'A', &payload);
    }

    /// A sample: its time, us, and its fields as bytes.
    fn sample(&mut self, id: u16, t_us: u64, fields: &[u8]) {
        let mut payload = id.to_le_bytes().to_vec();
        payload.extend_from_slice(&t_us.to_le_bytes());
        payload.extend_from_slice(fields);
        self.message(b'D', &payload);
    }
}

fn floats(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect()
}

/// A flight log as PX4 would have recorded it: each topic at its own rate. Rotors sit at `places` (x, y, turns).
///
/// # Panics
/// On a log that lacks a column of a flight with four rotors.
#[must_use]
pub fn ulog(log: &Log, places: &[[f64; 3]]) -> Vec<u8> {
    let mut out = ULog::new();
    let formats = [
        "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;float[3] accelerometer_m_s2;",
        "vehicle_attitude:uint64_t timestamp;float[4] q;",
        "vehicle_local_position:uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;",
        "actuator_motors:uint64_t timestamp;float[4] control;",
        "esc_report:uint64_t timestamp;int32_t esc_rpm;float esc_voltage;uint8_t[4] _padding0;",
        "esc_status:uint64_t timestamp;esc_report[4] esc;",
        "battery_status:uint64_t timestamp;float voltage_v;float current_a;",
    ];
    formats.iter().for_each(|f| out.message(b'F', f.as_bytes()));
    for (i, [x, y, turns]) in places.iter().enumerate() {
        out.parameter(&format!("CA_ROTOR{i}_PX"), *x as f32);
        out.parameter(&format!("CA_ROTOR{i}_PY"), *y as f32);
        out.parameter(&format!("CA_ROTOR{i}_KM"), if *turns > 0.0 { -0.05 } else { 0.05 });
    }
    let topics =
        ["sensor_combined", "vehicle_attitude", "vehicle_local_position", "actuator_motors", "esc_status", "battery_status"];
    topics.iter().enumerate().for_each(|(id, t)| out.subscribe(id as u16, t));
    let column = |name: &str| log.column(name).unwrap_or_else(|| panic!("{name}"));
    let all = |names: &[&str], i: usize| -> Vec<f64> { names.iter().map(|n| column(n)[i]).collect() };
    for i in 0..log.len() {
        let t = 1_000_000 + (log.t[i] * 1e6).round() as u64;
        let mut combined = floats(&all(&["gyro_x", "gyro_y", "gyro_z"], i));
        combined.extend_from_slice(&2000u32.to_le_bytes());
        combined.extend_from_slice(&floats(&all(&["acc_x", "acc_y", "acc_z"], i)));
        out.sample(0, t, &combined);
        if i % 2 == 0 {
            out.sample(1, t + 300, &floats(&all(&["qw", "qx", "qy", "qz"], i)));
        }
        if i % 5 == 0 {
            out.sample(2, t + 700, &floats(&all(&["pos_x", "pos_y", "pos_z", "vel_x", "vel_y", "vel_z"], i)));
        }
        let pulses = all(&["pulse_us_1", "pulse_us_2", "pulse_us_3", "pulse_us_4"], i);
        out.sample(3, t, &floats(&pulses.iter().map(|p| (p - 1000.0) / 1000.0).collect::<Vec<f64>>()));
        let mut escs = Vec::new();
        for rpm in all(&["rpm_1", "rpm_2", "rpm_3", "rpm_4"], i) {
            escs.extend_from_slice(&t.to_le_bytes());
            escs.extend_from_slice(&(rpm.round() as i32).to_le_bytes());
            escs.extend_from_slice(&floats(&[11.1]));
            escs.extend_from_slice(&[0; 4]);
        }
        out.sample(4, t, &escs);
        if i % 20 == 0 {
            out.sample(5, t, &floats(&all(&["voltage_v", "current_a"], i)));
        }
    }
    out.bytes
}

/// Unsigned in groups of seven bits, the lowest first.
fn unsigned(out: &mut Vec<u8>, mut value: u32) {
    while value > 127 {
        out.push((value as u8) | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Signed, small sizes short.
fn signed(out: &mut Vec<u8>, value: i32) {
    unsigned(out, ((value << 1) ^ (value >> 31)) as u32);
}

/// A flight log as Betaflight would have recorded it, every frame by itself; 14 poles, DShot.
///
/// # Panics
/// On a log that lacks a column of a flight with four rotors.
#[must_use]
pub fn blackbox(log: &Log) -> Vec<u8> {
    const FIELDS: [&str; 18] = [
        "loopIteration",
        "time",
        "gyroADC[0]",
        "gyroADC[1]",
        "gyroADC[2]",
        "accSmooth[0]",
        "accSmooth[1]",
        "accSmooth[2]",
        "motor[0]",
        "motor[1]",
        "motor[2]",
        "motor[3]",
        "eRPM[0]",
        "eRPM[1]",
        "eRPM[2]",
        "eRPM[3]",
        "vbatLatest",
        "amperageLatest",
    ];
    let is_signed = |name: &&str| name.starts_with("gyro") || name.starts_with("acc") || name.starts_with("amp");
    let list = |of: &dyn Fn(usize, &&str) -> u32| {
        FIELDS.iter().enumerate().map(|(i, n)| of(i, n).to_string()).collect::<Vec<_>>().join(",")
    };
    let mut text = String::from("H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n");
    text += &format!("H Field I name:{}\n", FIELDS.join(","));
    text += &format!("H Field I signed:{}\n", list(&|_, n| u32::from(is_signed(n))));
    text += &format!("H Field I predictor:{}\n", list(&|_, _| 0));
    text += &format!("H Field I encoding:{}\n", list(&|_, n| u32::from(!is_signed(n))));
    text += &format!("H Field P predictor:{}\n", list(&|i, _| [6, 2].get(i).copied().unwrap_or(0)));
    text += &format!("H Field P encoding:{}\n", list(&|i, n| [9, 0].get(i).copied().unwrap_or(u32::from(!is_signed(n)))));
    text += "H Field S name:flightModeFlags\nH Field S signed:0\nH Field S predictor:0\nH Field S encoding:1\n";
    text += "H Firmware type:Cleanflight\nH Firmware revision:Betaflight 4.5.1 (77d01ba3b) STM32F405\n";
    text += "H acc_1G:2048\nH gyro_scale:0x3f800000\nH motorOutput:48,2047\nH motor_poles:14\nH motor_pwm_protocol:7\n";
    let mut out = text.into_bytes();
    let column = |name: &str| log.column(name).unwrap_or_else(|| panic!("{name}"));
    let deg = 180.0 / std::f64::consts::PI;
    for i in 0..log.len() {
        out.push(b'I');
        unsigned(&mut out, i as u32);
        unsigned(&mut out, (log.t[i] * 1e6).round() as u32);
        for (axis, sign) in [("x", 1.0), ("y", -1.0), ("z", -1.0)] {
            signed(&mut out, (sign * deg * column(&format!("gyro_{axis}"))[i]).round() as i32);
        }
        for (axis, sign) in [("x", 1.0), ("y", -1.0), ("z", -1.0)] {
            signed(&mut out, (sign * 2048.0 / G * column(&format!("acc_{axis}"))[i]).round() as i32);
        }
        for r in 1..=4 {
            let share = (column(&format!("pulse_us_{r}"))[i] - 1000.0) / 1000.0;
            unsigned(&mut out, (48.0 + share * 1999.0).round() as u32);
        }
        for r in 1..=4 {
            unsigned(&mut out, (column(&format!("rpm_{r}"))[i] * 7.0 / 100.0).round() as u32);
        }
        unsigned(&mut out, (100.0 * column("voltage_v")[i]).round() as u32);
        signed(&mut out, (100.0 * column("current_a")[i]).round() as i32);
    }
    out.extend_from_slice(b"E\xffEnd of log\0");
    out
}
