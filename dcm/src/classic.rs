//! The classic filter: the baseline that every change is measured against.
//!
//! What it is: the rotation body to earth, the gyro bias, and one function that takes a measurement and the time since
//! the last one; the gyro turns the matrix, accelerometer and magnetometer pull it back through a proportional-integral loop.
//! What can go wrong: see [`Step`], which says for each step what was used and what was ignored. The error functions do
//! not vanish at 180 degrees, so no attitude is a resting place except the right one.
//! Units: rad/s, m/s^2, s; the field in any unit.
//! Reference: Premerlani & Bizard 2009, Eq. 22-28; Beharie 2013 Eq. 4.3 corrected: f = a - g, at rest and level f = (0, 0, -g).

mod config;

use crate::angles::{about_down, start_attitude};
use crate::measurement::{Measurement, Step};
use crate::rotation::{rotate, unit};
use crate::trig::root;
use crate::{Euler, Mat3, STANDARD_GRAVITY, Vec3, euler_of, quaternion_of};
pub use config::{AccelWeight, ClassicConfig, Gains};
use libm::atan2f;

/// Longest time that one reading of a slow sensor may stand for, s.
const LONGEST_HOLD: f32 = 0.2;
/// Largest turn in one step that the increment can express, rad. (2000 deg/s at 200 Hz is 0.17.)
const LARGEST_TURN: f32 = 1.0;

/// The direction-cosine filter of the thesis.
#[derive(Debug, Clone, PartialEq)]
pub struct Classic {
    config: ClassicConfig,
    north: Vec3,
    matrix: Mat3,
    bias: Vec3,
    tilt_known: bool,
    yaw_known: bool,
    since_accel: f32,
    since_mag: f32,
}

impl Classic {
    /// A filter that knows nothing yet: identity, zero bias.
    #[must_use]
    pub fn new(config: ClassicConfig) -> Self {
        Self {
            north: about_down(config.declination).column(0).clone_owned(),
            config,
            matrix: Mat3::identity(),
            bias: Vec3::zeros(),
            tilt_known: false,
            yaw_known: false,
            since_accel: 0.0,
            since_mag: 0.0,
        }
    }

    /// Takes the readings that arrived `dt` seconds after the last call. Missing sensors are `None`.
    pub fn update(&mut self, dt: f32, measured: &Measurement) -> Step {
        let mut step = Step::default();
        let dt = if dt.is_finite() && dt > 0.0 {
            dt
        } else {
            step.bad_input = true;
            0.0
        };
        if dt > self.config.max_dt {
            self.tilt_known = false; // the body may have turned by any angle meanwhile
        }
        self.since_accel = (self.since_accel + dt).min(LONGEST_HOLD);
        self.since_mag = (self.since_mag + dt).min(LONGEST_HOLD);

        let rate = measured.gyro.filter(|w| w.iter().all(|c| c.is_finite()));
        let down = measured.accel.and_then(|f| unit(&-f));
        let field = measured.mag.and_then(|m| unit(&m));
        step.bad_input |= rate.is_none() && measured.gyro.is_some();
        step.bad_input |= down.is_none() && measured.accel.is_some();
        step.bad_input |= field.is_none() && measured.mag.is_some();

        if !self.tilt_known {
            let Some(down) = down else { return step };
            step.started = self.start(&down, field.as_ref());
            return step;
        }
        if let (false, Some(field)) = (self.yaw_known, field.as_ref()) {
            let down = self.matrix.row(2).transpose();
            step.started = self.start(&down, Some(field)); // the first field of a filter that ran without one
        }

        // first the gyro, then the corrections: a measurement belongs to the end of its step, so it is compared there
        if let Some(rate) = rate {
            step.gyro_used = self.turn(&((rate - self.bias) * dt));
            step.bad_input |= !step.gyro_used;
        }
        let mut correction = Vec3::zeros();
        let axis = self.matrix.row(2).transpose();
        if let (Some(down), Some(f)) = (down, measured.accel) {
            let held = self.since_accel * self.weight(&f);
            correction += self.correct(direction_error(&down, &axis), self.config.tilt, held);
            self.since_accel = 0.0;
            step.accel_used = true;
        }
        if let Some(error) = field.and_then(|field| self.heading_error(&field)) {
            correction += self.correct(axis * error, self.config.yaw, self.since_mag);
            self.since_mag = 0.0;
            step.mag_used = true;
        }
        self.turn(&correction);
        step
    }

    /// Turns the matrix; an absurd angle leaves the last good attitude and says `false`.
    fn turn(&mut self, angle: &Vec3) -> bool {
        let square = angle.dot(angle);
        if !square.is_finite() || square > LARGEST_TURN * LARGEST_TURN {
            return false;
        }
        let turned = rotate(&self.matrix, angle, self.config.increment);
        let good = turned.iter().all(|c| c.is_finite());
        if good {
            self.matrix = turned;
        }
        good
    }

    /// Proportional turn for `error` over `held` seconds; the integral goes to the bias.
    fn correct(&mut self, error: Vec3, gains: Gains, held: f32) -> Vec3 {
        let limit = self.config.bias_limit;
        self.bias = (self.bias - error * (gains.ki * held)).map(|b| within(b, limit));
        error * (gains.kp * held).min(1.0)
    }

    fn weight(&self, f: &Vec3) -> f32 {
        match self.config.accel_weight {
            AccelWeight::Always => 1.0,
            AccelWeight::RazorRamp => (1.0 - 2.0 * (1.0 - root(f.dot(f)) / STANDARD_GRAVITY).abs()).clamp(0.0, 1.0),
        }
    }

    /// Angle about earth down that brings the horizontal field onto magnetic north; `None` when the field is vertical.
    fn heading_error(&self, field: &Vec3) -> Option<f32> {
        let mut seen = self.matrix * field;
        seen.z = 0.0;
        let seen = unit(&seen).filter(|_| seen.dot(&seen) > 1e-4)?;
        let sine = seen.x * self.north.y - seen.y * self.north.x;
        let cosine = seen.dot(&self.north);
        Some(if cosine >= 0.0 { sine } else { 1.0f32.copysign(sine) })
    }

    /// Sets the tilt from `down`, the heading from `field` where there is one and from the present matrix where not.
    fn start(&mut self, down: &Vec3, field: Option<&Vec3>) -> bool {
        let (up, field) = ([-down.x, -down.y, -down.z], field.map(|m| [m.x, m.y, m.z]));
        let from_field = start_attitude(&mut self.matrix.data.0, &up, field.as_ref());
        if from_field {
            self.matrix = about_down(self.config.declination) * self.matrix;
        }
        self.tilt_known = true;
        self.yaw_known |= from_field;
        self.since_accel = 0.0;
        self.since_mag = 0.0;
        true
    }

    /// Whether roll and pitch have been set by an accelerometer reading.
    #[must_use]
    pub fn is_started(&self) -> bool {
        self.tilt_known
    }

    /// Whether the heading refers to the magnetic field; without a magnetometer it is relative to the start.
    #[must_use]
    pub fn heading_is_absolute(&self) -> bool {
        self.yaw_known
    }

    /// Rotation body to earth (NED).
    #[must_use]
    pub fn matrix(&self) -> &Mat3 {
        &self.matrix
    }

    /// Unit quaternion body to earth, Hamilton, scalar first and not negative.
    #[must_use]
    pub fn quaternion(&self) -> [f32; 4] {
        quaternion_of(&self.matrix)
    }

    /// Roll, pitch and yaw; at the pole roll is 0.
    #[must_use]
    pub fn euler(&self) -> Euler {
        euler_of(&self.matrix)
    }

    /// Estimated gyro bias, rad/s: what is subtracted from the gyro.
    #[must_use]
    pub fn bias(&self) -> Vec3 {
        self.bias
    }

    /// Sets the bias, for instance from a stored calibration; what is not finite or beyond the limit is limited.
    pub fn set_bias(&mut self, bias: Vec3) {
        let limit = self.config.bias_limit;
        self.bias = bias.map(|b| if b.is_finite() { within(b, limit) } else { 0.0 });
    }

    /// Difference of this heading to another attitude's, rad in (-pi, pi].
    #[must_use]
    pub fn heading_against(&self, other: &Mat3) -> f32 {
        let relative = self.matrix * other.transpose();
        atan2f(relative.m21 - relative.m12, relative.m11 + relative.m22)
    }
}

/// Cut to `limit` on both sides of zero. (The library's `clamp` panics at a limit that is none.)
fn within(value: f32, limit: f32) -> f32 {
    if value > limit {
        limit
    } else if value < -limit {
        -limit
    } else {
        value
    }
}

/// Rotation error from the predicted axis to the measured one: its cross product, of unit length beyond 90 degrees.
fn direction_error(measured: &Vec3, predicted: &Vec3) -> Vec3 {
    let cross = measured.cross(predicted);
    if measured.dot(predicted) >= 0.0 {
        return cross;
    }
    unit(&cross)
        .or_else(|| unit(&predicted.cross(&Vec3::x())))
        .or_else(|| unit(&predicted.cross(&Vec3::y())))
        .unwrap_or_else(Vec3::x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a field of length 1 a hundredth that is level is not enough.
    #[test]
    fn a_field_that_is_nearly_vertical_has_no_heading() {
        let classic = Classic::new(ClassicConfig::TUNED);
        assert_eq!(classic.heading_error(&Vec3::new(0.01, 0.0, 1.0)), None);
        assert!(classic.heading_error(&Vec3::new(0.0, 0.0101, 1.0)).is_some_and(|error| (error + 1.0).abs() < 1e-6));
    }
}
