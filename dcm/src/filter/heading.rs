//! Magnetometer: the heading.
//!
//! What it is: fields are averaged in earth axes over a short time, the hard iron that was found is taken off, and the matrix turns
//! about the vertical by a share of what is left, while the field is believed.
//! What can go wrong: a vertical field, or one whose readings cancel, has no heading and changes nothing; one beyond the range is left out.
//! Units: uT, rad, s.
//! Reference: Laidig & Seel 2023, sections 3.2 and 3.5.

use super::field::Shape;
use super::{DEAD, Dcm, taken};
use crate::Config;
use crate::angles::up;
use crate::columns::{Column, ZERO, add_scaled, lesser, scaled, square, turn};
use crate::measurement::Step;
use crate::trig::{angle, root};
use core::borrow::Borrow;

/// Horizontal part of the field below which it has no heading, as a share of the whole.
const LEAST_LEVEL: f32 = 0.02;

impl<C: Borrow<Config>> Dcm<C> {
    /// A field is summed in earth axes. Says whether it is the first after a start, which is used at once.
    pub(super) fn mag(&mut self, field: &Column, step: &mut Step) -> bool {
        let mut seen = *field;
        if !taken(&mut seen, DEAD, self.config.borrow().field.range, step) || !self.started {
            return false;
        }
        let first = !self.heading_absolute;
        if first {
            self.start(&up(&self.matrix.data.0), Some(field), step);
        }
        turn(&self.matrix.data.0, core::slice::from_mut(&mut seen));
        self.field_sum = add_scaled(&self.field_sum, &seen, 1.0);
        self.fields += 1.0;
        first
    }

    /// The averaged field turns the matrix about the vertical. Its time comes whether or not there is a reading in this step, so that
    /// one that is missing changes no other.
    #[inline(never)]
    pub(super) fn heading(&mut self, step: &mut Step) {
        let config = self.config.borrow();
        let dt = core::mem::take(&mut self.since_mag);
        let settled = !self.tilt.starting(config.tilt_tau);
        let whole = &scaled(&self.field_sum, 1.0 / self.fields);
        self.field_sum = ZERO;
        self.fields = 0.0;
        let mut free = self.iron.taken_from(&ZERO, config.iron.dead_zone, config.iron.limit);
        turn(&self.matrix.data.0, core::slice::from_mut(&mut free));
        let seen = &add_scaled(whole, &free, 1.0);
        if square(seen) > config.field.strongest * config.field.strongest {
            self.magnet = true;
            self.field.doubt();
            return;
        }
        // what a magnet in the room adds is neither on the sensor nor a drift of the gyro
        let learns = settled && !self.field.refused(&config.field);
        if learns {
            self.iron.take(&config.iron, &self.matrix.data.0, whole, dt);
        }
        let [x, y, down] = seen;
        let level = root(x * x + y * y);
        let spin = add_scaled(self.rest.rate.value(), &self.bias.value, -1.0);
        let turning = square(&spin) > config.field.new_rate * config.field.new_rate;
        let other = self.field.take(&config.field, &Shape { level, down: *down }, dt, turning, self.magnet);
        if other {
            self.iron.clear(); // what differs between two places is not on the sensor
        }
        // nothing at all, where readings cancel, has no heading either
        if level <= LEAST_LEVEL * down.abs() {
            return;
        }
        let error = wrapped(config.declination, angle(*y, *x, level));
        self.heading_error = error;
        // the heading so far may be that of a magnet: the further off, the less of it is kept
        let doubt = if other { lesser(error.abs() * (0.5 / config.field.dip), 1.0) } else { 0.0 };
        if !self.rest.now && learns {
            self.bias.take_heading(&config.bias, error, dt);
        }
        self.heading_age = lesser(self.heading_age * (1.0 - doubt) + dt, config.heading_tau);
        // an unknown bias does more harm than an unknown field, and the first seconds are the average that the heading starts from
        let hold = self.bias.trusted(&config.bias) && self.heading_age >= config.heading_tau;
        let belief = self.field.belief(&config.field, dt, hold);
        let gain = lesser(dt / self.heading_age, 1.0);
        // a gyro at rest, whose offset is seen, holds the heading better than a field that differs from the one that is known
        if belief > 0.0 && !(self.rest.now && belief < 1.0 && self.field.known()) {
            self.turn_earth(&[0.0, 0.0, error * gain * belief]);
            step.mag_used = true;
        }
    }
}

/// Difference of an angle to the one that is wanted, into [-pi, pi].
fn wrapped(wanted: f32, angle: f32) -> f32 {
    use core::f32::consts::{PI, TAU};
    let error = wanted - angle;
    if wanted != 0.0 && error.abs() > PI { error - TAU.copysign(error) } else { error }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f32::consts::{FRAC_PI_2, PI, TAU};

    #[test]
    fn a_difference_of_angles_goes_the_short_way() {
        for (wanted, angle, known) in [(3.0, -3.0, 6.0 - TAU), (-3.0, 3.0, TAU - 6.0), (0.5, 0.2, 0.3), (0.0, 3.0, -3.0)] {
            assert!((wrapped(wanted, angle) - known).abs() < 1e-6, "{wanted} {angle}: {}", wrapped(wanted, angle));
        }
        assert_eq!([wrapped(FRAC_PI_2, -FRAC_PI_2), wrapped(-FRAC_PI_2, FRAC_PI_2)], [PI, -PI], "half a turn stays as it is");
    }

    /// A field as strong as the strongest is still a field.
    #[test]
    fn a_magnet_is_stronger_than_the_strongest_field() {
        let magnet = |field: Column| {
            let mut dcm = Dcm::new(Config::DEFAULT);
            (dcm.started, dcm.heading_absolute, dcm.since_mag) = (true, true, 0.05);
            let mut step = Step::default();
            dcm.mag(&field, &mut step);
            dcm.heading(&mut step);
            assert_eq!(step.mag_used, !dcm.magnet);
            dcm.magnet
        };
        assert_eq!([[60.0, 0.0, 79.0], [60.0, 0.0, 80.0], [60.0, 0.0, 81.0]].map(magnet), [false, false, true]);
    }
}
