//! The filter's state and its step.
//!
//! What it is: the rotation body to earth and what corrects it: the gyro turns it; the specific force, averaged in the earth
//! frame, where true accelerations cancel, sets the tilt; the field turns it about the vertical only, while it is believed.
//! [`Dcm::update`] takes all sensors of one instant in the right order (gyro, accelerometer, magnetometer); sensors with
//! rates of their own use the three functions below it.
//! What can go wrong: see [`Step`] for one step, [`Flags`] and [`Quality`] for the state.
//! Units: rad/s, m/s^2, uT, s. Earth NED inside.
//! Reference: Premerlani & Bizard 2009 for the matrix; Laidig & Seel 2023 for the averaging; `docs/ahrs.md` for what each
//! part is worth.

mod bias;
mod field;
mod iron;
mod lowpass;
mod output;
mod rest;
mod state;

pub use output::{Flags, Quality, STATE_WORDS};
pub use state::StateError;

use crate::angles::start_attitude;
use crate::config::Config;
use crate::linear::square;
use crate::measurement::{Measurement, Step};
use crate::rotation::{Increment, increment, product, renormalise, rotate, unit};
use crate::{Mat3, STANDARD_GRAVITY, Vec3};
use bias::Bias;
use field::Field;
use iron::Iron;
use libm::atan2f;
use lowpass::LowPass;
use rest::Rest;
use state::{Words, flag};

/// Longest time that one accelerometer reading may stand for, s.
const LONGEST_ACCEL: f32 = 0.25;
/// Longest time that one magnetometer reading may stand for, s (the slowest sensor that is of use gives 1 Hz).
const LONGEST_MAG: f32 = 1.0;
/// Weight of the turn of the axis between two steps (Savage 1998, Eq. 47, one sample before).
const CONING: f32 = 1.0 / 12.0;
/// Largest turn in one step that the increment can express, rad. (2000 deg/s at 48 Hz is 0.73.)
const LARGEST_TURN: f32 = 1.0;
/// Horizontal part of the field below which it has no heading, as a share of the whole.
const LEAST_LEVEL: f32 = 0.02;
/// At rest the measured vertical is beyond doubt: a tilt that is off by more (sine) is set anew.
const TILT_BEYOND_DOUBT: f32 = 0.17;

/// The direction-cosine filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dcm {
    config: Config,
    matrix: Mat3,
    started: bool,
    heading_absolute: bool,
    tilt: LowPass,
    rest: Rest,
    bias: Bias,
    field: Field,
    iron: Iron,
    heading_age: f32,
    heading_error: f32,
    since_gyro: f32,
    since_accel: f32,
    since_mag: f32,
    last_mag: Vec3,
    last_angle: Vec3,
    turned: Vec3,
}

impl Dcm {
    /// A filter that knows nothing yet: identity, zero bias.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            config,
            matrix: Mat3::identity(),
            started: false,
            heading_absolute: false,
            tilt: LowPass::default(),
            rest: Rest::default(),
            bias: Bias::new(Vec3::zeros()),
            field: Field::default(),
            iron: Iron::default(),
            heading_age: 0.0,
            heading_error: 0.0,
            since_gyro: 0.0,
            since_accel: 0.0,
            since_mag: 0.0,
            last_mag: Vec3::zeros(),
            last_angle: Vec3::zeros(),
            turned: Vec3::zeros(),
        }
    }

    /// Takes the readings that arrived `dt` seconds after the last call. Missing sensors are `None`.
    pub fn update(&mut self, dt: f32, measured: &Measurement) -> Step {
        let mut step = self.pass(dt);
        if let Some(rate) = &measured.gyro {
            self.gyro(rate, &mut step);
        }
        if let Some(force) = &measured.accel {
            self.accel(force, measured.mag.as_ref(), &mut step);
        }
        if let Some(field) = &measured.mag {
            self.mag(field, &mut step);
        }
        step
    }

    /// Takes a rate, `dt` seconds after the last call of any of the three.
    pub fn update_gyro(&mut self, dt: f32, rate: &Vec3) -> Step {
        self.update(dt, &Measurement { gyro: Some(*rate), ..Measurement::default() })
    }

    /// Takes a specific force, `dt` seconds after the last call of any of the three.
    pub fn update_accel(&mut self, dt: f32, force: &Vec3) -> Step {
        self.update(dt, &Measurement { accel: Some(*force), ..Measurement::default() })
    }

    /// Takes a field, `dt` seconds after the last call of any of the three.
    pub fn update_mag(&mut self, dt: f32, field: &Vec3) -> Step {
        self.update(dt, &Measurement { mag: Some(*field), ..Measurement::default() })
    }

    /// Time passes for all three sensors.
    fn pass(&mut self, dt: f32) -> Step {
        let good = dt.is_finite() && dt > 0.0;
        let dt = if good { dt } else { 0.0 };
        if dt > self.config.max_dt && self.started {
            self.started = false; // the body may have turned by any angle meanwhile
            self.tilt = LowPass::default();
            self.rest = Rest { ever: self.rest.ever, ..Rest::default() };
        }
        self.since_gyro += dt;
        self.since_accel = (self.since_accel + dt).min(LONGEST_ACCEL);
        self.since_mag = (self.since_mag + dt).min(LONGEST_MAG);
        Step { bad_input: !good, ..Step::default() }
    }

    /// The gyro turns the matrix.
    fn gyro(&mut self, rate: &Vec3, step: &mut Step) {
        let dt = core::mem::take(&mut self.since_gyro).min(self.config.max_dt);
        if !finite(rate) {
            step.bad_input = true;
            return;
        }
        let most = self.config.gyro_range;
        let cut = rate.map(|w| w.clamp(-most, most));
        step.overrange |= rate.iter().any(|w| w.abs() >= most);
        let config = &self.config;
        let trusted = self.bias.trusted(&config.bias).then_some(&self.bias.value);
        self.rest.rate(&cut, dt, &config.rest, &config.bias, trusted);
        if !self.started {
            return;
        }
        let angle = (cut - self.bias.value) * dt;
        if square(&angle) > LARGEST_TURN * LARGEST_TURN {
            step.bad_input = true;
            return;
        }
        // the axis of turning moves within the step: the second-order term of the rotation vector
        let coned = angle + self.last_angle.cross(&angle) * CONING;
        self.last_angle = angle;
        self.matrix = rotate(&self.matrix, &coned, Increment::Exponential);
        self.bias.follow(&self.matrix, dt, &config.bias);
        self.bias.age(dt, !self.rest.now, &config.bias);
        if self.rest.now {
            self.bias.at_rest(&self.rest.rate.x, dt, &config.bias);
        }
        step.gyro_used = true;
    }

    /// The averaged specific force sets the tilt.
    fn accel(&mut self, force: &Vec3, field: Option<&Vec3>, step: &mut Step) {
        let dt = self.since_accel;
        if !usable(force) {
            step.bad_input = true;
            return;
        }
        if force.iter().any(|f| f.abs() >= self.config.accel_range) {
            step.overrange = true;
            return;
        }
        self.since_accel = 0.0;
        self.rest.force(force, dt, &self.config.rest);
        if !self.started {
            self.start(&-force, field, step);
            return;
        }
        if self.rest.now && self.settle(step) {
            return;
        }
        let down = self.matrix * -force;
        self.tilt.step(&down, dt, self.config.tilt_tau);
        let Some(seen) = unit(&self.tilt.x).filter(|_| square(&self.tilt.x) > 1.0) else { return };
        let level = Vec3::new(seen.y, -seen.x, 0.0);
        let turn = if seen.z >= 0.0 { level } else { unit(&level).unwrap_or_else(Vec3::x) };
        self.turn_earth(&turn);
        if !self.rest.now && !self.tilt.starting(self.config.tilt_tau) {
            self.bias.take_tilt(&turn, dt, &self.config.bias);
        }
        step.accel_used = true;
    }

    /// At rest: the first time, and whenever the tilt is off by more than doubt allows, the attitude is set anew.
    #[cold]
    #[inline(never)]
    fn settle(&mut self, step: &mut Step) -> bool {
        let Some(down) = unit(&-self.rest.force.x) else { return false };
        let predicted = self.matrix.row(2).transpose();
        let off = square(&down.cross(&predicted)) > TILT_BEYOND_DOUBT * TILT_BEYOND_DOUBT || down.dot(&predicted) < 0.0;
        if self.rest.ever && !off {
            return false;
        }
        self.rest.ever = true;
        let field = (self.heading_absolute && self.since_mag < LONGEST_MAG).then_some(self.last_mag);
        self.start(&down, field.as_ref(), step);
        step.started
    }

    /// The field turns the matrix about the vertical.
    fn mag(&mut self, field: &Vec3, step: &mut Step) {
        let dt = self.since_mag;
        let most = self.config.field.range;
        if !usable(field) {
            step.bad_input = true;
            return;
        }
        if field.iter().any(|m| m.abs() >= most) {
            step.overrange = true;
            return;
        }
        self.since_mag = 0.0;
        self.last_mag = *field;
        if !self.started || dt <= 0.0 {
            return;
        }
        if !self.heading_absolute {
            let down = self.matrix.row(2).transpose();
            self.start(&down, Some(field), step); // the first field of a filter that ran without one
        }
        let config = &self.config;
        let turned = core::mem::replace(&mut self.turned, Vec3::zeros());
        self.iron.turned(&turned);
        if !self.tilt.starting(config.tilt_tau) {
            self.iron.take(&self.matrix, field, dt, &config.iron);
        }
        let earth = self.matrix * (field - self.iron.applied(&config.iron));
        let spin = self.rest.rate.x - self.bias.value;
        let turning = square(&spin) > config.field.new_rate * config.field.new_rate;
        self.field.take(&earth, dt, turning, &config.field);
        let level = earth.x * earth.x + earth.y * earth.y;
        if level < LEAST_LEVEL * LEAST_LEVEL * square(&earth) {
            return;
        }
        let error = wrapped(config.declination - atan2f(earth.y, earth.x));
        self.heading_error = error;
        if !self.rest.now && !self.tilt.starting(config.tilt_tau) {
            self.bias.take_heading(error, dt, &config.bias);
        }
        self.heading_age = (self.heading_age + dt).min(config.heading_tau);
        // an unknown bias does more harm than an unknown field, and the first seconds are the average that the heading starts from
        let hold = self.bias.trusted(&config.bias) && self.heading_age >= config.heading_tau;
        let belief = self.field.belief(dt, hold, &config.field);
        let gain = (dt / self.heading_age).min(1.0);
        if belief > 0.0 {
            self.turn_earth(&Vec3::new(0.0, 0.0, error * gain * belief));
            step.mag_used = true;
        }
    }

    /// Turns the earth under the filter, with everything that is remembered in earth axes.
    #[inline(never)]
    fn turn_earth(&mut self, turn: &Vec3) {
        self.turned += turn;
        if square(turn) > 1e-4 {
            return self.turn_earth_far(&increment(turn, Increment::Exponential));
        }
        turn_rows(&mut self.matrix, turn);
        turn_rows(&mut self.bias.attitude, turn);
        self.tilt.x += turn.cross(&self.tilt.x);
        self.tilt.v += turn.cross(&self.tilt.v);
    }

    /// The same for a large turn, which first order cannot express.
    #[cold]
    #[inline(never)]
    fn turn_earth_far(&mut self, by: &Mat3) {
        self.matrix = renormalise(&product(by, &self.matrix));
        self.bias.attitude = product(by, &self.bias.attitude);
        self.tilt.x = by * self.tilt.x;
        self.tilt.v = by * self.tilt.v;
    }

    /// Sets the tilt from `down` (body axes) and the heading from `field` where there is one, from the present one where not.
    #[cold]
    #[inline(never)]
    fn start(&mut self, down: &Vec3, field: Option<&Vec3>, step: &mut Step) {
        let field = field.filter(|m| finite(m) && m.iter().all(|m| m.abs() < self.config.field.range));
        let field = field.map(|m| m - self.iron.applied(&self.config.iron));
        let Some(down) = unit(down) else { return };
        let Some((matrix, from_field)) = start_attitude(&down, field.as_ref(), self.config.declination, &self.matrix) else {
            return;
        };
        self.matrix = matrix;
        self.bias.attitude = matrix;
        self.tilt = LowPass::default();
        self.tilt.step(&Vec3::new(0.0, 0.0, STANDARD_GRAVITY), 1e-3, self.config.tilt_tau);
        self.turned = Vec3::zeros();
        self.iron.clear(); // what it saw of the attitude before is void
        self.started = true;
        if from_field {
            self.heading_absolute = true;
            self.heading_age = 0.0;
        }
        step.started = true;
    }
}

fn finite(v: &Vec3) -> bool {
    v.iter().all(|c| c.is_finite())
}

/// Finite, and not zero: a dead sensor reads zero.
fn usable(v: &Vec3) -> bool {
    let square = square(v);
    square > 1e-20 && square < f32::MAX
}

/// Into (-pi, pi].
fn wrapped(angle: f32) -> f32 {
    use core::f32::consts::PI;
    if angle > PI {
        angle - 2.0 * PI
    } else if angle <= -PI {
        angle + 2.0 * PI
    } else {
        angle
    }
}

/// (I + [turn]x) M.
fn turn_rows(m: &mut Mat3, turn: &Vec3) {
    for mut column in m.column_iter_mut() {
        let c = column.clone_owned();
        column += turn.cross(&c);
    }
}

impl Words for Dcm {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.matrix.words(visit);
        flag(&mut self.started, visit);
        flag(&mut self.heading_absolute, visit);
        self.tilt.words(visit);
        self.rest.words(visit);
        self.bias.words(visit);
        self.field.words(visit);
        self.iron.words(visit);
        visit(&mut self.heading_age);
        visit(&mut self.heading_error);
        visit(&mut self.since_gyro);
        visit(&mut self.since_accel);
        visit(&mut self.since_mag);
        self.last_mag.words(visit);
        self.last_angle.words(visit);
        self.turned.words(visit);
    }
}
