//! The standard flight, on which effects are drawn and compared.
//!
//! What it is: a vehicle of 1 kg with 0.2 m arms for 40 s at 100 Hz: it swings in figures of eight, climbs, turns, and comes near the ground.
//! Motions are closed forms; forces, moments and speeds are those that they ask for.
//! What can go wrong: it stands for no vehicle; bounds and look-alikes of another flight are its own.
//! Units: those of the flight log.
//! Reference: specification `flight.md`, "Flight log".

use super::G;
use crate::log::{Column, Log};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

const ROWS: usize = 4000;
const STEP_S: f64 = 0.01;
const MASS: f64 = 1.0;
const ARM: f64 = 0.2;
const INERTIA: [f64; 3] = [0.012, 0.013, 0.022];
/// Thrust and torque over squared speed.
const LIFT: f64 = 1.0e-5;
const TORQUE: f64 = 1.5e-7;

/// Place at a time.
fn place(t: f64) -> Vector3<f64> {
    let low = 0.9 * (-((t - 30.0) / 3.0).powi(2)).exp();
    Vector3::new(3.0 * (0.55 * t).sin(), 2.0 * (1.1 * t).sin(), -1.3 - 0.35 * (0.8 * t).sin() + low)
}

/// First and second derivative by differences that are exact to rounding here.
fn slopes(of: impl Fn(f64) -> Vector3<f64>, t: f64) -> [Vector3<f64>; 2] {
    const H: f64 = 1e-3;
    let (a, b, c) = (of(t - H), of(t), of(t + H));
    [(c - a) / (2.0 * H), (a - 2.0 * b + c) / (H * H)]
}

fn attitude(t: f64) -> Rotation3<f64> {
    let [_, pull] = slopes(place, t);
    let down = (Vector3::z() * G - pull).normalize();
    let heading = 0.5 * (0.3 * t).sin();
    let nose = Vector3::new(heading.cos(), heading.sin(), 0.0);
    let right = down.cross(&nose).normalize();
    Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&[right.cross(&down), right, down]))
}

fn rate(t: f64) -> Vector3<f64> {
    const H: f64 = 1e-3;
    (attitude(t - H).transpose() * attitude(t + H)).scaled_axis() / (2.0 * H)
}

/// A fixed pattern that stands for noise: floors must not be nought.
fn ripple(row: usize, channel: usize) -> f64 {
    ((row * 7919 + channel * 104_729) % 1009) as f64 / 504.5 - 1.0
}

/// The flight log.
#[must_use]
pub(crate) fn standard_flight() -> Log {
    let mut log = Log { name: "standard flight".into(), t: (0..ROWS).map(|i| STEP_S * i as f64).collect(), ..Log::default() };
    let meta = "mass_kg = 1.0\narm_m = 0.2\nlayout = \"plus\"\ninertia_kgm2 = [0.012, 0.013, 0.022]";
    log.meta = meta.parse::<toml::Table>().map(|t| t.into_iter().collect()).unwrap_or_default();
    let rows: Vec<Vec<f64>> = (0..ROWS).map(row).collect();
    for (k, name) in NAMES.iter().enumerate() {
        log.columns.push(Column { name: (*name).to_owned(), values: rows.iter().map(|r| r[k]).collect() });
    }
    log
}

const NAMES: [&str; 30] = [
    "pulse_us_1",
    "pulse_us_2",
    "pulse_us_3",
    "pulse_us_4",
    "rpm_1",
    "rpm_2",
    "rpm_3",
    "rpm_4",
    "acc_x",
    "acc_y",
    "acc_z",
    "gyro_x",
    "gyro_y",
    "gyro_z",
    "vel_x",
    "vel_y",
    "vel_z",
    "pos_x",
    "pos_y",
    "pos_z",
    "qw",
    "qx",
    "qy",
    "qz",
    "voltage_v",
    "current_a",
    "temp_c",
    "mag_x",
    "mag_y",
    "mag_z",
];

fn row(i: usize) -> Vec<f64> {
    let t = STEP_S * i as f64;
    let [velocity, pull] = slopes(place, t);
    let turn = attitude(t);
    let force = turn.transpose() * (pull - Vector3::z() * G);
    let w = rate(t);
    let [turning, _] = slopes(rate, t);
    let inertia = Vector3::from(INERTIA);
    let moment = inertia.component_mul(&turning) + w.cross(&inertia.component_mul(&w));
    // thrusts of the plus layout: 1 left, 2 rear, 3 right, 4 front
    let whole = -MASS * force.z / 4.0;
    let (x, y, z) = (moment.x / (2.0 * ARM), moment.y / (2.0 * ARM), moment.z * LIFT / (4.0 * TORQUE));
    let thrusts = [whole + x - z, whole - y + z, whole - x - z, whole + y + z];
    let speeds = thrusts.map(|f| (f.max(0.1) / LIFT).sqrt());
    let cubes: f64 = speeds.iter().map(|s| s.powi(3)).sum();
    let mut out: Vec<f64> = speeds.iter().enumerate().map(|(k, s)| 1000.0 + 0.8 * s + 0.05 * ripple(i, k)).collect();
    out.extend(speeds.iter().enumerate().map(|(k, s)| s * super::RPM + 8.0 * ripple(i, 5 + k)));
    // a frame that shakes more where its rotors turn fast
    let shakes = 0.2 + 40.0 * (speeds[0] / 495.0 - 0.99).max(0.0);
    out.extend((0..3).map(|k| force[k] + shakes * ripple(i, 10 + k)));
    out.extend((0..3).map(|k| w[k] + 0.01 * ripple(i, 15 + k)));
    out.extend((0..3).map(|k| velocity[k] + 0.01 * ripple(i, 20 + k)));
    out.extend(place(t).iter());
    let q = UnitQuaternion::from_rotation_matrix(&turn);
    out.extend([q.w, q.i, q.j, q.k]);
    let current = 1.5e-8 * cubes;
    out.extend([11.1 + 0.01 * ripple(i, 25), current, 25.0 + 8.0 * (1.0 - (-t / 15.0).exp())]);
    let field = turn.transpose() * Vector3::new(20.0, 1.0, 43.0);
    out.extend((0..3).map(|k| field[k] + 0.4 * ripple(i, 30 + k)));
    out
}
