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
mod heading;
mod iron;
mod lowpass;
mod output;
mod rest;
mod state;
mod tilt;

pub use output::{Flags, Quality, STATE_WORDS};
pub use state::StateError;

use crate::angles::start_attitude;
use crate::columns::{Column, ZERO, clamp, dot, lesser, scaled, square, turn};
use crate::config::Config;
use crate::measurement::{Measurement, Step};
use crate::rotation::{direction, exponential};
use crate::{Mat3, STANDARD_GRAVITY, Vec3};
use bias::Bias;
use core::borrow::Borrow;
use field::Field;
use iron::Iron;
use lowpass::LowPass;
use rest::Rest;
use state::{Words, flag};

/// Longest time that one accelerometer reading may stand for, s.
const LONGEST_ACCEL: f32 = 0.25;
/// Longest time that one magnetometer reading may stand for, s (the slowest sensor that is of use gives 1 Hz).
const LONGEST_MAG: f32 = 1.0;
/// Squared length below which a reading is that of a dead sensor, which gives zero.
const DEAD: f32 = 1e-20;

/// The direction-cosine filter.
///
/// Its configuration is held by value, borrowed, or a type that knows it when the program is compiled, as
/// [`Standard`](crate::Standard) does: the smallest and the fastest, for a microcontroller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dcm<C = Config> {
    config: C,
    matrix: Mat3,
    started: bool,
    heading_absolute: bool,
    /// A magnet was there.
    magnet: bool,
    tilt: LowPass<3>,
    rest: Rest,
    bias: Bias,
    field: Field,
    iron: Iron,
    heading_age: f32,
    heading_error: f32,
    since_gyro: f32,
    since_accel: f32,
    since_mag: f32,
    last_rate: Column,
    /// Mean size of true accelerations, m/s^2, less while the body turns fast.
    pushed: f32,
    sum: Column,
    summed: f32,
    field_sum: Column,
    fields: f32,
}

impl<C: Borrow<Config>> Dcm<C> {
    /// A filter that knows nothing yet: identity, zero bias.
    #[must_use]
    #[inline(never)]
    pub fn new(config: C) -> Self {
        Self {
            config,
            matrix: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
            started: false,
            heading_absolute: false,
            magnet: false,
            tilt: LowPass::new(),
            rest: Rest::new(),
            bias: Bias::new(),
            field: Field::new(),
            iron: Iron::default(),
            heading_age: 0.0,
            heading_error: 0.0,
            since_gyro: 0.0,
            since_accel: 0.0,
            since_mag: 0.0,
            last_rate: ZERO,
            pushed: 0.0,
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
        let mut due = self.since_mag > self.config.borrow().field.window;
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
        if dt > self.config.borrow().max_dt && self.started {
            self.started = false; // the body may have turned by any angle meanwhile
            self.tilt.age = 0.0;
            self.rest.restart();
        }
        self.since_gyro += dt;
        self.since_accel = lesser(self.since_accel + dt, LONGEST_ACCEL);
        self.since_mag = lesser(self.since_mag + dt, LONGEST_MAG);
        Step { bad_input: !good, ..Step::default() }
    }

    /// Turns the earth under the filter, with everything that is remembered in earth axes.
    #[inline(never)]
    fn turn_earth(&mut self, angle: &Column) {
        // a large turn in pieces that the series can express
        let pieces = if square(angle) > 0.1 { 10 } else { 1 };
        let by = exponential(&scaled(angle, 1.0 / pieces as f32));
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
        let config = self.config.borrow();
        let field = field.map(|m| self.iron.taken_from(m, config.iron.dead_zone, config.iron.limit));
        let Some(up) = direction(up) else { return };
        let from_field = start_attitude(&mut self.matrix.data.0, &up, field.as_ref());
        self.bias.attitude = self.matrix.data.0;
        self.tilt.restart([0.0, 0.0, -STANDARD_GRAVITY]);
        self.sum = ZERO;
        self.summed = 0.0;
        self.field_sum = ZERO;
        self.fields = 0.0;
        self.iron.clear(); // what it saw of the attitude before is void
        self.started = true;
        self.heading_absolute = from_field;
        if from_field {
            let declination = self.config.borrow().declination;
            if declination != 0.0 {
                self.turn_earth(&[0.0, 0.0, declination]);
            }
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

/// Whether a reading is finite, no shorter than `shortest` (squared) and within its range, to which it is cut. Says in `step` what
/// it is not.
#[inline(never)]
fn taken(reading: &mut Column, shortest: f32, range: f32, step: &mut Step) -> bool {
    let square = square(reading);
    // a square may overflow; zero times what is not finite is none
    let good = square >= shortest && (square < f32::MAX || dot(reading, &ZERO) == 0.0);
    if !good {
        step.bad_input = true;
        return false;
    }
    // a length within the range has no component beyond
    if square < range * range {
        return true;
    }
    let over = clamp(reading, range);
    step.overrange |= over;
    !over
}

impl<C> Words for Dcm<C> {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.matrix.words(visit);
        flag(&mut self.started, visit);
        flag(&mut self.heading_absolute, visit);
        flag(&mut self.magnet, visit);
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
        self.last_rate.words(visit);
        visit(&mut self.pushed);
        self.sum.words(visit);
        visit(&mut self.summed);
        self.field_sum.words(visit);
        visit(&mut self.fields);
    }
}
