//! What the instruments make of a flight, and the log's text.
//!
//! What it is: rows at the log's rate with noise, quantisation, vibration, and the sensors' hidden effects.
//! What can go wrong: nothing.
//! Units: those of the flight log.
//! Reference: specification `flight.md`, "Flight log".

use super::body::{quaternion, rotation, to_body};
use super::cause::Cause;
use super::vehicle::Vehicle;
use super::world::{STEP_S, Track};
use super::{V, add, cross, times};
use crate::blind::chance::Chance;
use std::fmt::Write;

/// The instruments of a vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruments {
    /// Rows a second.
    pub hz: usize,
    /// Noise of specific force, m/s^2, and rate, rad/s.
    pub inertial: [f64; 2],
    /// Noise of a rotor's speed, as a share.
    pub speed: f64,
    /// Noise of velocity, m/s, place, m, and attitude, rad.
    pub motion: [f64; 3],
    /// Noise of voltage, V, as a share, and current, as a share.
    pub supply: [f64; 2],
    /// Noise of the field, uT.
    pub field: f64,
    /// Vibration of each rotor at its hover speed, m/s^2.
    pub shakes: Vec<f64>,
    /// Which columns there are: field, current, temperature.
    pub has: [bool; 3],
    /// How much the board warms up, K.
    pub warms: f64,
}

/// Field of the earth, uT.
const FIELD: V = [20.0, 1.5, 43.0];

impl Instruments {
    /// Draws them; what a cause needs to show is there.
    #[must_use]
    pub fn draw(causes: &[Cause], k: &mut Chance) -> Self {
        let needs = |ids: &[&str]| causes.iter().any(|c| ids.contains(&c.id));
        let shakes = k.log_between(0.05, 1.0) * if needs(&["vibration_rectification"]) { 3.0 } else { 1.0 };
        Self {
            hz: k.of(&[200, 250, 500, 500]),
            inertial: [k.log_between(0.03, 0.2), k.log_between(0.004, 0.02)],
            speed: k.log_between(5e-4, 4e-3),
            motion: [k.log_between(0.004, 0.03), k.log_between(0.002, 0.01), k.log_between(2e-4, 2e-3)],
            supply: [k.log_between(5e-4, 2e-3), k.log_between(5e-3, 2e-2)],
            field: k.log_between(0.2, 0.8),
            shakes: (0..4).map(|_| shakes * k.between(0.5, 1.5)).collect(),
            has: [
                k.happens(0.3) || needs(&["hard_iron", "current_induced_field"]),
                k.happens(0.6) || needs(&["current_induced_field"]),
                k.happens(0.3) || needs(&["gyro_temperature"]),
            ],
            warms: k.between(4.0, 15.0),
        }
    }
}

/// One row without noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Time, s.
    pub t: f64,
    /// Specific force.
    pub force: V,
    /// Rate.
    pub rate: V,
    /// Rate as the body really turns.
    pub turns: V,
    /// Speeds as read, rad/s.
    pub speeds: Vec<f64>,
    /// Field.
    pub field: V,
    /// Position in the track.
    pub step: usize,
    /// Temperature above the first, K.
    pub warm: f64,
}

/// The rows of a track as the sensors have them, without noise, quantisation or vibration.
#[must_use]
pub fn rows(vehicle: &Vehicle, causes: &[Cause], i: &Instruments, track: &Track) -> Vec<Row> {
    let every = (1.0 / (STEP_S * i.hz as f64)).round() as usize;
    let cause = |id: &str| causes.iter().find(|c| c.id == id);
    let late = |which: usize| cause("channel_delay").filter(|c| c.which == which).map_or(0.0, |c| c.strength / STEP_S);
    let mut stuck: Option<f64> = None;
    let mut out = Vec::new();
    for step in (0..track.states.len()).step_by(every) {
        let t = step as f64 * STEP_S;
        let before = |behind: f64| -> (usize, usize, f64) {
            let at = (step as f64 - behind).max(0.0);
            (at as usize, (at as usize + 1).min(track.states.len() - 1), at.fract())
        };
        let mixed = |of: &dyn Fn(usize) -> V, behind: f64| -> V {
            let (a, b, share) = before(behind);
            add(times(1.0 - share, of(a)), times(share, of(b)))
        };
        let lever = cause("lever_arm").map_or([0.0; 3], |c| times(c.strength, c.along));
        let felt = |k: usize| -> V {
            let w = track.states[k].rate;
            let swing = add(cross(track.turning[k], lever), cross(w, cross(w, lever)));
            add(track.force[k], swing)
        };
        let mut force = mixed(&felt, late(0));
        let turns = track.states[step].rate;
        let mut rate = mixed(&|k| track.states[k].rate, late(1));
        if let Some(c) = cause("accelerometer_bias") {
            force = add(force, times(c.strength, c.along));
        }
        if let Some(c) = cause("vibration_rectification") {
            force = add(force, times(c.strength * shaking(vehicle, i, Some(c), &track.speeds[step]), c.along));
        }
        if let Some(c) = cause("gyro_bias") {
            rate = add(rate, times(c.strength, c.along));
        }
        if let Some(c) = cause("g_sensitivity") {
            // one axis feels one direction of the force
            let axis = c.which % 3;
            rate[axis] += c.strength * (force[0] * c.along[0] + force[1] * c.along[1] + force[2] * c.along[2]);
        }
        let warm = i.warms * (1.0 - (-t / 15.0).exp());
        if let Some(c) = cause("gyro_temperature") {
            rate = add(rate, times(c.strength * warm, c.along));
        }
        let (a, b, share) = before(late(2));
        let mut speeds: Vec<f64> = track.speeds[a].iter().zip(&track.speeds[b]).map(|(x, y)| x + share * (y - x)).collect();
        if let Some(c) = cause("dead_rotor_speed").filter(|c| t >= c.t0) {
            let held = *stuck.get_or_insert(speeds[c.which]);
            speeds[c.which] = if c.strength == 0.0 { held } else { speeds[c.which] * c.strength };
        }
        let mut field = to_body(&track.states[step].turn, FIELD);
        if let Some(c) = cause("hard_iron") {
            field = add(field, times(c.strength, c.along));
        }
        if let Some(c) = cause("current_induced_field") {
            field = add(field, times(c.strength * track.current[step], c.along));
        }
        out.push(Row { t, force, rate, turns, speeds, field, step, warm });
    }
    out
}

/// Mean square of the vibration, (m/s^2)^2.
fn shaking(vehicle: &Vehicle, i: &Instruments, resonant: Option<&Cause>, speeds: &[f64]) -> f64 {
    speeds.iter().zip(&i.shakes).map(|(w, size)| amplitude(vehicle, *size, resonant, *w).powi(2)).sum()
}

/// Variance that the vibration leaves in the mean of `n` rows of an axis of the specific force, (m/s^2)^2: each rotor's phase is anyone's.
pub(super) fn shaken_mean(vehicle: &Vehicle, causes: &[Cause], i: &Instruments, speeds: &[f64], axis: usize, n: usize) -> f64 {
    let resonant = causes.iter().find(|c| c.id == "vibration_rectification");
    let (share, turns) = if axis == 2 { (0.3, 2.0) } else { (1.0, 1.0) };
    let of = |(w, size): (&f64, &f64)| {
        let half = 0.5 * turns * w / i.hz as f64;
        let kept = if half.sin().abs() < 1e-6 { 1.0 } else { (n as f64 * half).sin() / (n as f64 * half.sin()) };
        0.5 * (share * kept * amplitude(vehicle, *size, resonant, *w)).powi(2)
    };
    speeds.iter().zip(&i.shakes).map(of).sum()
}

/// Amplitude of one rotor's vibration; with a resonance of the frame it grows much faster than with the square of the speed.
fn amplitude(vehicle: &Vehicle, size: f64, resonant: Option<&Cause>, w: f64) -> f64 {
    let x = w / vehicle.hover();
    let gain = resonant.map_or(1.0, |c| {
        let r = x / c.other;
        1.0 / ((1.0 - r * r).powi(2) + (0.15 * r).powi(2)).sqrt()
    });
    size * x * x * gain.min(8.0) / resonant.map_or(1.0, |_| 2.0)
}

/// The flight log's text.
#[must_use]
pub fn text(vehicle: &Vehicle, causes: &[Cause], i: &Instruments, track: &Track, seed: u64, stream: u64) -> String {
    let mut k = Chance::new(seed, stream);
    let n = vehicle.hubs.len();
    let mut out = vehicle.head();
    out.push_str("t_s");
    for name in ["pulse_us", "rpm"] {
        (1..=n).for_each(|r| out.push_str(&format!(",{name}_{r}")));
    }
    out.push_str(",acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z,vel_x,vel_y,vel_z,pos_x,pos_y,pos_z,qw,qx,qy,qz,voltage_v");
    let [field, current, temperature] = i.has;
    out.push_str(if field { ",mag_x,mag_y,mag_z" } else { "" });
    out.push_str(if current { ",current_a" } else { "" });
    out.push_str(if temperature { ",temp_c" } else { "" });
    out.push('\n');
    let resonant = causes.iter().find(|c| c.id == "vibration_rectification");
    let mut phases: Vec<f64> = (0..n).map(|_| k.between(0.0, std::f64::consts::TAU)).collect();
    for row in rows(vehicle, causes, i, track) {
        let s = &track.states[row.step];
        let mut shaken = row.force;
        for (r, phase) in phases.iter_mut().enumerate() {
            let w = track.speeds[row.step][r];
            *phase = (*phase + w / i.hz as f64) % std::f64::consts::TAU;
            let size = amplitude(vehicle, i.shakes[r], resonant, w);
            shaken = add(shaken, [size * phase.cos(), size * phase.sin(), 0.3 * size * (2.0 * *phase).cos()]);
        }
        let mut noisy = |v: V, sd: f64| -> V { v.map(|x| x + sd * k.normal()) };
        let force = noisy(shaken, i.inertial[0]);
        let rate = noisy(row.rate, i.inertial[1]);
        let velocity = noisy(s.velocity, i.motion[0]);
        let place = noisy(s.place, i.motion[1]);
        let tilt = noisy([0.0; 3], i.motion[2]);
        let magnet = noisy(row.field, i.field);
        let q = quaternion(&super::body::product(&s.turn, &rotation(tilt)));
        let _ = write!(out, "{:.4}", row.t); // a string takes everything
        for command in &track.commands[row.step] {
            let _ = write!(out, ",{:.2}", 1000.0 + 1000.0 * command);
        }
        for (r, w) in row.speeds.iter().enumerate() {
            let rpm = w * 60.0 / std::f64::consts::TAU;
            let held = |c: &Cause| c.id == "dead_rotor_speed" && c.strength == 0.0 && row.t >= c.t0 && c.which == r;
            let noise = if causes.iter().any(held) { 0.0 } else { i.speed * k.normal() };
            let _ = write!(out, ",{:.0}", rpm * (1.0 + noise));
        }
        for v in [force, rate, velocity, place] {
            let _ = write!(out, ",{:.5},{:.6},{:.5}", v[0], v[1], v[2]);
        }
        let _ = write!(out, ",{:.7},{:.7},{:.7},{:.7}", q[0], q[1], q[2], q[3]);
        let volts = track.voltage[row.step] * (1.0 + i.supply[0] * k.normal());
        let _ = write!(out, ",{volts:.3}");
        if field {
            let _ = write!(out, ",{:.2},{:.2},{:.2}", magnet[0], magnet[1], magnet[2]);
        }
        if current {
            let _ = write!(out, ",{:.3}", track.current[row.step] * (1.0 + i.supply[1] * k.normal()));
        }
        if temperature {
            let _ = write!(out, ",{:.2}", 25.0 + row.warm);
        }
        out.push('\n');
    }
    out
}
