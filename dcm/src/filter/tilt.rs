//! Gyro and accelerometer: the attitude's course and its tilt.
//!
//! What it is: the gyro turns the matrix by the exponential's series with a coning term; the specific force, summed and averaged in
//! earth axes, sets the tilt, and at rest the attitude is set anew when the tilt is far off.
//! What can go wrong: a rate beyond the range is cut and flagged, a force beyond it is left out; a turn of more than a radian in one
//! step is none.
//! Units: rad/s, m/s^2, s.
//! Reference: Premerlani & Bizard 2009, Eq. 17-21; Savage 1998, Eq. 47; Laidig & Seel 2023, section 3.2.

use super::{DEAD, Dcm, taken};
use crate::angles::up;
use crate::columns::{Column, ZERO, add_scaled, cross, dot, lesser, scaled, square, turn};
use crate::measurement::Step;
use crate::rotation::{exponential, inverse_sqrt, orthonormalise};
use crate::trig::root;
use crate::{Config, STANDARD_GRAVITY};
use core::borrow::Borrow;

/// Weight of the turn of the axis between two steps (Savage 1998, Eq. 47, one sample before).
const CONING: f32 = 1.0 / 12.0;
/// Largest turn in one step that the increment can express, rad. (2000 deg/s at 48 Hz is 0.73.)
const LARGEST_TURN: f32 = 1.0;
/// At rest the measured vertical is beyond doubt: a tilt that is off by more than ten degrees (cosine) is set anew.
const TILT_BEYOND_DOUBT: f32 = 0.985;

impl<C: Borrow<Config>> Dcm<C> {
    /// The gyro turns the matrix.
    #[inline(never)]
    pub(super) fn gyro(&mut self, rate: &Column, step: &mut Step) {
        let config = self.config.borrow();
        let mut rate = *rate;
        let dt = lesser(core::mem::take(&mut self.since_gyro), config.max_dt);
        taken(&mut rate, 0.0, config.gyro_range, step);
        if step.bad_input {
            return;
        }
        self.rest.rate(config, &rate, dt, &self.bias);
        if !self.started {
            return;
        }
        let rate = add_scaled(&rate, &self.bias.value, -1.0);
        let angle = scaled(&rate, dt);
        if square(&angle) > LARGEST_TURN * LARGEST_TURN {
            step.bad_input = true;
            return;
        }
        // the axis of turning moves within the step: the second-order term of the rotation vector
        let coned = add_scaled(&angle, &cross(&self.last_rate, &angle), CONING * dt);
        self.last_rate = rate;
        let mut next = exponential(&coned);
        turn(&self.matrix.data.0, &mut next);
        self.matrix.data.0 = next;
        // rounding needs it once in many steps: after each use of the force, and in every step without one
        if self.summed < self.since_accel {
            orthonormalise(&mut self.matrix.data.0);
        }
        step.gyro_used = true;
    }

    /// The averaged specific force sets the tilt.
    #[inline(never)]
    pub(super) fn accel(&mut self, force: &Column, step: &mut Step) {
        let mut up = *force;
        if !taken(&mut up, DEAD, self.config.borrow().accel_range, step) {
            return;
        }
        let dt = core::mem::take(&mut self.since_accel);
        if !self.started {
            self.start(force, None, step);
            return;
        }
        step.accel_used = true;
        turn(&self.matrix.data.0, core::slice::from_mut(&mut up));
        self.sum = add_scaled(&self.sum, &up, dt);
        self.summed += dt;
        if self.summed >= self.config.borrow().tilt_window {
            self.level(force, step);
        }
    }

    /// The sum of specific forces is used.
    fn level(&mut self, force: &Column, step: &mut Step) {
        let config = self.config.borrow();
        let dt = core::mem::take(&mut self.summed);
        let mean = scaled(&self.sum, 1.0 / dt);
        self.sum = ZERO;
        self.rest.force(&config.rest, force, dt);
        self.bias.follow(&config.bias, &self.matrix.data.0, dt);
        self.bias.age(&config.bias, dt, !self.rest.now);
        if self.rest.now {
            self.bias.at_rest(&config.bias, self.rest.rate.value(), dt);
            if self.settle(step) {
                return;
            }
        }
        let config = self.config.borrow();
        let away = (root(square(&mean)) - STANDARD_GRAVITY).abs();
        self.tilt.step(
            &mean,
            dt,
            config.tilt_tau + config.tilt_tau * (config.tilt_stretch / STANDARD_GRAVITY) * self.pushed,
            config.tilt_tau,
        );
        let turning = square(&self.last_rate) / (config.tilt_rate * config.tilt_rate);
        let pushed = away / (1.0 + turning);
        self.pushed += (pushed - self.pushed) * (dt / (dt + config.tilt_memory));
        let mean = self.tilt.value();
        let long = square(mean);
        if long < 1.0 {
            return;
        }
        let ([x, y, z], k) = (*mean, inverse_sqrt(long));
        // beyond 90 degrees the sine shrinks again: half a radian about x, whatever there is about y, leads out
        let by = [if z > 0.0 { 0.5 } else { -y * k }, x * k, 0.0];
        if !self.rest.now {
            self.bias.take_tilt(&config.bias, &by, dt);
        }
        self.turn_earth(&by);
    }

    /// At rest: the first time, and whenever the tilt is off by more than doubt allows, the attitude is set anew.
    fn settle(&mut self, step: &mut Step) -> bool {
        let force = *self.rest.force.value();
        let along = dot(&force, &up(&self.matrix.data.0));
        if self.rest.ever && along * along.abs() > TILT_BEYOND_DOUBT * TILT_BEYOND_DOUBT * square(&force) {
            return false;
        }
        // the next field sets the heading too, unless it is known for a disturbed one
        let held = self.heading_absolute && self.field.refused(&self.config.borrow().field);
        self.start(&force, None, step);
        self.heading_absolute |= held;
        self.rest.ever |= step.started;
        step.started
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::LowPass;

    /// A filter at level whose averaged force is this one, for so long that nothing moves it.
    fn averaged(force: Column) -> Dcm {
        let mut dcm = Dcm::new(Config::DEFAULT);
        dcm.started = true;
        dcm.tilt = LowPass { state: [force, ZERO], age: f32::MAX / 4.0 };
        dcm.config.tilt_tau = f32::MAX / 4.0;
        dcm.summed = 0.035;
        dcm
    }

    /// A mean that lies level is off by a right angle. The turn is about the axis at right angles to it, to where it points up.
    #[test]
    fn a_right_angle_is_turned_back() {
        for force in [[9.0, 0.0, 0.0], [0.0, -9.0, 0.0], [1.0, 0.0, 0.0]] {
            let mut dcm = averaged(force);
            dcm.level(&force, &mut Step::default());
            let [_, _, z] = dcm.tilt.value();
            let long = root(square(&force));
            assert!((z / long + 1f32.sin()).abs() < 2e-3, "{force:?}: a turn of one radian, {z}");
        }
    }

    /// Wherever beyond a right angle the mean points, a few turns bring it down: no axis is that of a mean that stays.
    #[test]
    fn every_tilt_beyond_a_right_angle_leads_out() {
        for (k, z) in (0..72).flat_map(|k| [1e-3f32, 0.05, 0.3, 0.7, 1.0].map(|z| (k, z))) {
            let (y, x) = crate::trig::sin_cos((5.0 * k as f32).to_radians());
            let level = 9.0 * (1.0 - z * z).sqrt();
            let force = [x * level, y * level, 9.0 * z];
            let mut dcm = averaged(force);
            let turned = (1..=20).find(|_| {
                dcm.summed = 0.035;
                dcm.level(&force, &mut Step::default());
                let [_, _, z] = dcm.tilt.value();
                *z < -8.9
            });
            assert!(turned.is_some(), "{force:?}: {:?}", dcm.tilt.value());
        }
    }

    #[test]
    fn a_mean_without_length_turns_nothing() {
        let mut dcm = averaged([0.9, 0.0, 0.0]);
        dcm.level(&[0.9, 0.0, 0.0], &mut Step::default());
        assert_eq!(dcm.matrix, Dcm::new(Config::DEFAULT).matrix);
    }

    /// Ten degrees: up to there, and not at it, a body at rest is set right slowly.
    #[test]
    fn a_tilt_that_is_beyond_doubt_is_set_anew() {
        let level = (1.0 / (TILT_BEYOND_DOUBT * TILT_BEYOND_DOUBT) - 1.0).sqrt();
        let set = |force: Column| {
            let mut dcm = averaged([0.0, 0.0, -9.0]);
            dcm.rest.ever = true;
            dcm.rest.force.restart(force);
            dcm.settle(&mut Step::default())
        };
        assert_eq!([0.9 * level, level, 1.1 * level].map(|level| set([level, 0.0, -1.0])), [false, true, true]);
        assert_eq!([9.0, 20.0].map(|long| set([0.1 * long, 0.0, -long])), [false; 2], "whatever the length");
        assert_eq!([9.0, 0.1].map(|long| set([0.3 * long, 0.0, -long])), [true; 2], "whatever the length");
    }
}
