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
use crate::columns::{Column, ZERO, cross, cut_all, dot, least, plus, square, turn};
use crate::config::Config;
use crate::measurement::{Measurement, Step};
use crate::rotation::{direction, exponential, inverse_sqrt, turn_body};
use crate::trig::{angle, root};
use crate::{Mat3, STANDARD_GRAVITY, Vec3};
use bias::Bias;
use field::{Field, Shape};
use iron::Iron;
use lowpass::LowPass;
use rest::Rest;
use state::{Words, flag};

/// Time over which the specific force is summed in earth axes before it is used, s (five readings of 200 Hz, one of 48): its average
/// is one of seconds.
const ENOUGH: f32 = 0.0205;
/// Time over which fields are summed in earth axes before their average is used, s.
const ENOUGH_MAG: f32 = 0.035;
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
/// At rest the measured vertical is beyond doubt: a tilt that is off by more than ten degrees (cosine) is set anew.
const TILT_BEYOND_DOUBT: f32 = 0.985;

/// The direction-cosine filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dcm {
    tilt_tau: f32,
    heading_tau: f32,
    gyro_range: f32,
    accel_range: f32,
    declination: f32,
    max_dt: f32,
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
    last_angle: Column,
    sum: Column,
    summed: f32,
    field_sum: Column,
    fields: f32,
}

impl Dcm {
    /// A filter that knows nothing yet: identity, zero bias.
    #[must_use]
    #[inline(never)]
    pub fn new(config: Config) -> Self {
        let Config { tilt_tau, heading_tau, gyro_range, accel_range, declination, max_dt, .. } = config;
        Self {
            tilt_tau,
            heading_tau,
            gyro_range,
            accel_range,
            declination,
            max_dt,
            matrix: const { Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) },
            started: false,
            heading_absolute: false,
            tilt: LowPass::default(),
            rest: Rest::new(config.rest),
            bias: Bias::new(config.bias),
            field: Field::new(config.field),
            iron: Iron::new(config.iron),
            heading_age: 0.0,
            heading_error: 0.0,
            since_gyro: 0.0,
            since_accel: 0.0,
            since_mag: 0.0,
            last_angle: ZERO,
            sum: ZERO,
            summed: 0.0,
            field_sum: ZERO,
            fields: 0.0,
        }
    }

    /// Takes the readings that arrived `dt` seconds after the last call. Missing sensors are `None`.
    #[inline(never)]
    pub fn update(&mut self, dt: f32, measured: &Measurement) -> Step {
        let mut step = self.pass(dt);
        if let Some(rate) = column(&measured.gyro) {
            self.gyro(rate, &mut step);
        }
        if let Some(force) = column(&measured.accel) {
            self.accel(force, &mut step);
        }
        let mut due = self.since_mag > ENOUGH_MAG;
        if let Some(field) = column(&measured.mag) {
            due |= self.mag(field, &mut step);
        }
        if due && self.fields > 0.0 {
            self.heading(&mut step);
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
        let good = dt > 0.0 && dt < f32::MAX;
        let dt = if good { dt } else { 0.0 };
        if dt > self.max_dt && self.started {
            self.started = false; // the body may have turned by any angle meanwhile
            self.tilt.age = 0.0;
            self.rest.restart();
        }
        self.since_gyro += dt;
        self.since_accel = least(self.since_accel + dt, LONGEST_ACCEL);
        self.since_mag = least(self.since_mag + dt, LONGEST_MAG);
        Step { bad_input: !good, ..Step::default() }
    }

    /// The gyro turns the matrix.
    #[inline(never)]
    fn gyro(&mut self, rate: &Column, step: &mut Step) {
        let mut rate = *rate;
        let dt = least(core::mem::take(&mut self.since_gyro), self.max_dt);
        for w in &mut rate {
            step.bad_input |= !w.is_finite();
            step.overrange |= w.abs() >= self.gyro_range;
        }
        if step.bad_input {
            return;
        }
        cut_all(&mut rate, self.gyro_range);
        self.rest.rate(&rate, dt, &self.bias);
        if !self.started {
            return;
        }
        let rate = plus(&rate, &self.bias.value, -1.0);
        let angle = plus(&ZERO, &rate, dt);
        if square(&angle) > LARGEST_TURN * LARGEST_TURN {
            step.bad_input = true;
            return;
        }
        // the axis of turning moves within the step: the second-order term of the rotation vector
        let coned = plus(&angle, &cross(&self.last_angle, &angle), CONING);
        self.last_angle = angle;
        turn_body(&mut self.matrix.data.0, &coned);
        step.gyro_used = true;
    }

    /// The averaged specific force sets the tilt.
    #[inline(never)]
    fn accel(&mut self, force: &Column, step: &mut Step) {
        if !taken(force, self.accel_range, step) {
            return;
        }
        let dt = core::mem::take(&mut self.since_accel);
        if !self.started {
            self.start(force, None, step);
            return;
        }
        step.accel_used = true;
        let mut up = *force;
        turn(&self.matrix.data.0, core::slice::from_mut(&mut up));
        self.sum = plus(&self.sum, &up, dt);
        self.summed += dt;
        let dt = self.summed;
        if dt < ENOUGH {
            return;
        }
        let up = plus(&ZERO, &self.sum, 1.0 / dt);
        self.sum = ZERO;
        self.summed = 0.0;
        self.rest.force(force, dt);
        self.bias.follow(&self.matrix.data.0, dt);
        self.bias.age(dt, !self.rest.now);
        if self.rest.now {
            self.bias.at_rest(self.rest.rate.value(), dt);
            if self.settle(step) {
                return;
            }
        }
        self.tilt.step(&up, dt, self.tilt_tau);
        let mean = self.tilt.value();
        let long = square(mean);
        if long < 1.0 {
            return;
        }
        let ([x, y, z], k) = (*mean, inverse_sqrt(long));
        // beyond 90 degrees the sine shrinks again: any turn leads out
        let by = if z < 0.0 { [-y * k, x * k, 0.0] } else { [0.5, 0.0, 0.0] };
        if !self.rest.now && !self.tilt.starting(self.tilt_tau) {
            self.bias.take_tilt(&by, dt);
        }
        self.turn_earth(&by);
    }

    /// Up in body axes.
    fn up(&self) -> Column {
        let [[.., x], [.., y], [.., z]] = self.matrix.data.0;
        [-x, -y, -z]
    }

    /// At rest: the first time, and whenever the tilt is off by more than doubt allows, the attitude is set anew.
    fn settle(&mut self, step: &mut Step) -> bool {
        let Some(up) = direction(self.rest.force.value()) else { return false };
        if self.rest.ever && dot(&up, &self.up()) > TILT_BEYOND_DOUBT {
            return false;
        }
        self.rest.ever = true;
        self.start(&up, None, step);
        step.started
    }

    /// A field is summed in earth axes. Says whether it is the first after a start, which is used at once.
    fn mag(&mut self, field: &Column, step: &mut Step) -> bool {
        if !taken(field, self.field.config.range, step) || self.since_mag <= 0.0 {
            return false;
        }
        if !self.started {
            self.since_mag = 0.0;
            return false;
        }
        let first = !self.heading_absolute;
        if first {
            self.start(&self.up(), Some(field), step);
        }
        let mut seen = *field;
        turn(&self.matrix.data.0, core::slice::from_mut(&mut seen));
        self.field_sum = plus(&self.field_sum, &seen, 1.0);
        self.fields += 1.0;
        first
    }

    /// The averaged field turns the matrix about the vertical. Its time comes whether or not there is a reading in this step, so that
    /// one that is missing changes no other.
    #[inline(never)]
    fn heading(&mut self, step: &mut Step) {
        let dt = core::mem::take(&mut self.since_mag);
        let settled = !self.tilt.starting(self.tilt_tau);
        let whole = &plus(&ZERO, &self.field_sum, 1.0 / self.fields);
        self.field_sum = ZERO;
        self.fields = 0.0;
        let mut free = self.iron.taken_from(&ZERO);
        turn(&self.matrix.data.0, core::slice::from_mut(&mut free));
        let [x, y, down] = &plus(whole, &free, 1.0);
        if settled {
            self.iron.take(&self.matrix.data.0, whole, dt);
        }
        let level = root(x * x + y * y);
        let spin = plus(self.rest.rate.value(), &self.bias.value, -1.0);
        let turning = square(&spin) > self.field.config.new_rate * self.field.config.new_rate;
        self.field.take(&Shape { level, down: *down }, dt, turning);
        if level < LEAST_LEVEL * down.abs() {
            return;
        }
        let error = wrapped(self.declination - angle(*y, *x, level));
        self.heading_error = error;
        if !self.rest.now && settled {
            self.bias.take_heading(error, dt);
        }
        self.heading_age = least(self.heading_age + dt, self.heading_tau);
        // an unknown bias does more harm than an unknown field, and the first seconds are the average that the heading starts from
        let hold = self.bias.trusted() && self.heading_age >= self.heading_tau;
        let belief = self.field.belief(dt, hold);
        let gain = least(dt / self.heading_age, 1.0);
        if belief > 0.0 {
            self.turn_earth(&[0.0, 0.0, error * gain * belief]);
            step.mag_used = true;
        }
    }

    /// Turns the earth under the filter, with everything that is remembered in earth axes.
    #[inline(never)]
    fn turn_earth(&mut self, angle: &Column) {
        // a large turn in pieces that the series can express
        let pieces = if square(angle) > 0.1 { 10 } else { 1 };
        let by = exponential(&plus(&ZERO, angle, 1.0 / pieces as f32));
        for _ in 0..pieces {
            for columns in [&mut self.matrix.data.0[..], &mut self.bias.attitude, &mut self.iron.average, &mut self.tilt.state] {
                turn(&by, columns);
            }
        }
    }

    /// Sets the tilt from `up` (body axes) and the heading from `field` where there is one, from the present one where not.
    #[cold]
    #[inline(never)]
    fn start(&mut self, up: &Column, field: Option<&Column>, step: &mut Step) {
        let field = field.map(|m| self.iron.taken_from(m));
        let Some(up) = direction(up) else { return };
        let from_field = start_attitude(&mut self.matrix.data.0, &up, field.as_ref());
        self.bias.attitude = self.matrix.data.0;
        self.tilt = LowPass::at(&[0.0, 0.0, -STANDARD_GRAVITY]);
        self.sum = ZERO;
        self.summed = 0.0;
        self.field_sum = ZERO;
        self.fields = 0.0;
        self.iron.clear(); // what it saw of the attitude before is void
        self.started = true;
        self.heading_absolute = from_field;
        if from_field {
            self.turn_earth(&[0.0, 0.0, self.declination]);
            self.heading_age = 0.0;
        }
        step.started = true;
    }
}

/// A reading as a column.
fn column(reading: &Option<Vec3>) -> Option<&Column> {
    reading.as_ref().map(|v| {
        let [column] = &v.data.0;
        column
    })
}

/// Whether a reading can be used: finite, not zero (a dead sensor reads zero), within its range. Says in `step` what it is not.
#[inline(never)]
fn taken(reading: &Column, range: f32, step: &mut Step) -> bool {
    let square = square(reading);
    if square < 1e-20 || square.is_nan() || square >= f32::MAX {
        step.bad_input = true;
        return false;
    }
    for c in reading {
        if c.abs() >= range {
            step.overrange = true;
            return false;
        }
    }
    true
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
        self.last_angle.words(visit);
        self.sum.words(visit);
        visit(&mut self.summed);
        self.field_sum.words(visit);
        visit(&mut self.fields);
    }
}
