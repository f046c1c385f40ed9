//! A cascaded controller: place, velocity, attitude, rate.
//!
//! What it is: what a flight controller does every 4 ms with an attitude and a rate that it is told, a place and a velocity from a positioning
//! system, and a set point. Gains are of rates and accelerations; the powerplant's slopes about the hover turn them into pulses, so that the
//! same gains fit another vehicle.
//! What can go wrong: a vehicle that does not follow (tilted by more than [`LOST_TILT`], or far from the wanted attitude for
//! [`LOST_AFTER_S`]) has its motors stopped; the caller says when it must come down.
//! Units: SI; us. Earth NED, body FRD.
//! Reference: cascaded attitude control with the thrust vector as set point: Mellinger & Kumar 2011; Brescianini, Hehn & D'Andrea 2013
//! (quaternion error); specification `flight.md`, "Missions".

use super::{Airframe, G, Matrix, Rotation, Vector};
use nalgebra::Rotation3;
use serde::{Deserialize, Serialize};

/// Interval of the controller, s.
pub const INTERVAL_S: f64 = 0.004;
/// Tilt from which nothing is left to hold, rad.
pub const LOST_TILT: f64 = 70.0 / 180.0 * core::f64::consts::PI;
/// Angle between wanted and told attitude that is no following, rad, and for how long, s.
pub const LOST_ANGLE: f64 = 50.0 / 180.0 * core::f64::consts::PI;
/// See [`LOST_ANGLE`].
pub const LOST_AFTER_S: f64 = 0.3;

/// Gains and limits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gains {
    /// Angular acceleration for a wrong rate, roll and pitch, 1/s.
    pub rate_p: f64,
    /// The same for its integral, 1/s^2.
    pub rate_i: f64,
    /// Angular acceleration for a wrong yaw rate, 1/s.
    pub yaw_rate_p: f64,
    /// Rate for a wrong tilt, 1/s.
    pub attitude_p: f64,
    /// Rate for a wrong heading, 1/s.
    pub heading_p: f64,
    /// Acceleration for a wrong velocity, 1/s.
    pub velocity_p: f64,
    /// The same for its integral, 1/s^2.
    pub velocity_i: f64,
    /// Velocity for a wrong place, 1/s.
    pub position_p: f64,
    /// Most tilt that is asked for, deg.
    pub tilt_deg: f64,
    /// Most speed that is asked for, m/s.
    pub speed_m_s: f64,
}

impl Default for Gains {
    /// For the thesis' quadrotor, whose rotors follow within some 40 ms: each loop a third to a half of the one inside.
    fn default() -> Self {
        Self {
            rate_p: 14.0,
            rate_i: 10.0,
            yaw_rate_p: 4.0,
            attitude_p: 5.5,
            heading_p: 1.5,
            velocity_p: 1.2,
            velocity_i: 0.5,
            position_p: 0.7,
            tilt_deg: 30.0,
            speed_m_s: 3.0,
        }
    }
}

/// What the controller is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Told {
    /// Attitude, body to earth.
    pub attitude: Rotation,
    /// Rate, body axes, rad/s.
    pub rate: Vector,
    /// Place, earth, m.
    pub place: Vector,
    /// Velocity, earth, m/s.
    pub velocity: Vector,
}

/// What is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetPoint {
    /// Place, earth, m.
    pub place: Vector,
    /// Velocity with which that place moves, m/s.
    pub velocity: Vector,
    /// Heading, rad.
    pub heading: f64,
}

/// How pulses act about the hover.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixer {
    hover_us: f64,
    us_per_m_s2: f64,
    /// Pulse of each rotor for an angular acceleration of 1 rad/s^2 about each axis.
    shares: Vec<Vector>,
}

/// Lowest and highest pulse of a flying rotor, us.
const PULSES_US: (f64, f64) = (1080.0, 2000.0);
/// Most that heading may take of a pulse, us: tilt comes first.
const HEADING_US: f64 = 80.0;
/// Bounds of the integrals: angular acceleration, rad/s^2, and acceleration, m/s^2.
const TRIM: (f64, f64) = (6.0, 4.0);

impl Mixer {
    /// For `airframe` that hovers at `hover_us`, where 1 us is worth `thrust_per_us` N and `yaw_per_us` rad/s^2 of a rotor. Rotors sit
    /// symmetrically.
    #[must_use]
    pub fn new(airframe: &Airframe, hover_us: f64, thrust_per_us: f64, yaw_per_us: f64) -> Self {
        let rotors = &airframe.rotors;
        let square = |axis: usize| rotors.iter().map(|r| r.place[axis] * r.place[axis]).sum::<f64>().max(1.0e-9);
        let [ix, iy, _] = airframe.inertia_kgm2;
        let (roll, pitch) = (ix / (square(1) * thrust_per_us), iy / (square(0) * thrust_per_us));
        let yaw = 1.0 / (rotors.len() as f64 * yaw_per_us.max(1.0e-9));
        let share = |r: &super::Rotor| Vector::new(-r.place[1] * roll, r.place[0] * pitch, -r.turns * yaw);
        Self {
            hover_us,
            us_per_m_s2: airframe.mass_kg / (rotors.len() as f64 * thrust_per_us),
            shares: rotors.iter().map(share).collect(),
        }
    }

    /// Pulses for a thrust of `lift` m/s^2 per unit of mass and an angular acceleration.
    fn pulses(&self, lift: f64, turning: &Vector, into: &mut Vec<f64>) {
        into.clear();
        let base = self.hover_us + (lift - G) * self.us_per_m_s2;
        into.extend(self.shares.iter().map(|s| {
            let yaw = (s.z * turning.z).clamp(-HEADING_US, HEADING_US);
            (base + s.x * turning.x + s.y * turning.y + yaw).clamp(PULSES_US.0, PULSES_US.1)
        }));
    }
}

/// The controller's state.
#[derive(Debug, Clone, PartialEq)]
pub struct Autopilot {
    gains: Gains,
    mixer: Mixer,
    turning_trim: Vector,
    lift_trim: Vector,
    astray_s: f64,
}

impl Autopilot {
    /// At rest.
    #[must_use]
    pub fn new(gains: Gains, mixer: Mixer) -> Self {
        Self { gains, mixer, turning_trim: Vector::zeros(), lift_trim: Vector::zeros(), astray_s: 0.0 }
    }

    /// Pulses for the next [`INTERVAL_S`]; false where the vehicle does not follow, whose motors must stop.
    pub fn tick(&mut self, told: &Told, wanted: &SetPoint, pulses: &mut Vec<f64>) -> bool {
        let g = self.gains;
        let acceleration = self.acceleration(told, wanted);
        // the axis along which the rotors must push the air, and how hard
        let push = Vector::new(0.0, 0.0, G) - acceleration;
        let down = told.attitude * Vector::z();
        let attitude = pointing(&push, wanted.heading);
        let error = told.attitude.inverse() * attitude;
        let turned = 2.0 * error.imag() * error.w.signum();
        let rate = Vector::new(g.attitude_p * turned.x, g.attitude_p * turned.y, g.heading_p * turned.z);
        let wrong = rate - told.rate;
        self.turning_trim = (self.turning_trim + wrong * (g.rate_i * INTERVAL_S)).map(|v| v.clamp(-TRIM.0, TRIM.0));
        self.turning_trim.z = 0.0;
        let turning = Vector::new(g.rate_p * wrong.x, g.rate_p * wrong.y, g.yaw_rate_p * wrong.z) + self.turning_trim;
        self.mixer.pulses(push.dot(&down).clamp(0.3 * G, 1.8 * G), &turning, pulses);
        let tilt_apart = libm::acos((attitude * Vector::z()).dot(&down).clamp(-1.0, 1.0));
        self.astray_s = if tilt_apart > LOST_ANGLE { self.astray_s + INTERVAL_S } else { 0.0 };
        libm::acos(down.z.clamp(-1.0, 1.0)) < LOST_TILT && self.astray_s < LOST_AFTER_S
    }

    fn acceleration(&mut self, told: &Told, wanted: &SetPoint) -> Vector {
        let g = self.gains;
        let asked = (wanted.place - told.place) * g.position_p + wanted.velocity;
        let velocity = asked * (g.speed_m_s / asked.norm().max(g.speed_m_s));
        let wrong = velocity - told.velocity;
        self.lift_trim = (self.lift_trim + wrong * (g.velocity_i * INTERVAL_S)).map(|v| v.clamp(-TRIM.1, TRIM.1));
        let asked = wrong * g.velocity_p + self.lift_trim;
        let most = G * libm::tan(g.tilt_deg.to_radians());
        let level = most / asked.xy().norm().max(most);
        Vector::new(asked.x * level, asked.y * level, asked.z.clamp(-0.6 * G, 0.5 * G))
    }
}

/// The attitude whose down axis is along `push` and whose nose points to `heading`.
fn pointing(push: &Vector, heading: f64) -> Rotation {
    let down = push.normalize();
    let (s, c) = libm::sincos(heading);
    let right = down.cross(&Vector::new(c, s, 0.0)).normalize();
    let ahead = right.cross(&down);
    Rotation::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix::from_columns(&[ahead, right, down])))
}
