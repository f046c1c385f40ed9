//! What can be read from the filter and set in it.
//!
//! What it is: attitude, bias, accelerations, flags and quality; heading reset; the state as words.
//! What can go wrong: bias and hard iron beyond their limits are cut; words that are no state are refused.
//! Units: rad, rad/s, m/s^2, uT.
//! Reference: specification `ahrs.md`, "Attitude", outputs.

use super::state::{Words, checksum};
use super::{Dcm, StateError};
use crate::angles::{euler_of, quaternion_of};
use crate::columns::{clamp, lesser, square};
use crate::linear::determinant;
use crate::trig::root;
use crate::{Config, Earth, Euler, Mat3, STANDARD_GRAVITY, Vec3};
use core::borrow::Borrow;
use core::f32::consts::{PI, TAU};

/// Words of a saved state.
pub const STATE_WORDS: usize = 105;
/// First word of a saved state: changes whenever the list of fields does.
const STATE_VERSION: u32 = 0x4443_4D07;

/// What holds now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Flags {
    /// Roll and pitch are set.
    pub started: bool,
    /// The first averages still fill (that of the heading where there is a field): gains are larger than later.
    pub startup: bool,
    /// The body rests.
    pub rest: bool,
    /// The heading refers to the magnetic field.
    pub heading_absolute: bool,
    /// A field to compare with is known.
    pub field_known: bool,
    /// The field differs from it; the heading is frozen, or follows at half gain after a minute while the body moves.
    pub field_disturbed: bool,
    /// Rest or motion has shown the gyro bias.
    pub bias_trusted: bool,
}

/// How good it is, in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Quality {
    /// What the field says against the present heading, rad.
    pub heading_error: f32,
    /// Standard deviation of the gyro bias, rad/s.
    pub bias_sigma: f32,
    /// Field norm against its reference, share; 0 while none is known.
    pub field_norm: f32,
    /// Dip against its reference, rad; 0 while none is known.
    pub field_dip: f32,
    /// Hard iron that was found and not calibrated away, uT.
    pub iron: f32,
}

impl<C: Borrow<Config> + Clone> Dcm<C> {
    /// Rotation body to earth (NED).
    #[must_use]
    pub fn matrix(&self) -> &Mat3 {
        &self.matrix
    }

    /// Rotation body to the earth axes that are asked for.
    #[must_use]
    pub fn matrix_to(&self, earth: Earth) -> Mat3 {
        earth.from_ned(&self.matrix)
    }

    /// Unit quaternion body to earth (NED), Hamilton, scalar first and not negative.
    #[must_use]
    pub fn quaternion(&self) -> [f32; 4] {
        quaternion_of(&self.matrix)
    }

    /// Roll, pitch and yaw (NED); at the pole roll is 0.
    #[must_use]
    pub fn euler(&self) -> Euler {
        euler_of(&self.matrix)
    }

    /// Whether roll and pitch have been set by an accelerometer reading.
    #[must_use]
    pub fn is_started(&self) -> bool {
        self.started
    }

    /// Whether the heading refers to the magnetic field; without a magnetometer it is relative to the start.
    #[must_use]
    pub fn heading_is_absolute(&self) -> bool {
        self.heading_absolute
    }

    /// Estimated gyro bias, rad/s: what is subtracted from the gyro.
    #[must_use]
    pub fn bias(&self) -> Vec3 {
        Vec3::from(self.bias.value)
    }

    /// Sets the bias, for instance from a stored calibration, with its standard deviation, rad/s (0: exact). What is not
    /// finite or beyond the limit is cut.
    pub fn set_bias(&mut self, bias: Vec3, sigma: f32) {
        let limit = self.config.borrow().bias.limit;
        self.bias.value = [bias.x, bias.y, bias.z].map(|b| if b.is_finite() { b } else { 0.0 });
        clamp(&mut self.bias.value, limit);
        let share = sigma / limit;
        self.bias.variance = if share.is_finite() { lesser(share * share, 1.0) } else { 1.0 };
    }

    /// Hard iron that was found, uT, body axes: what a calibration has not taken out.
    #[must_use]
    pub fn iron(&self) -> Vec3 {
        Vec3::from(self.iron.found)
    }

    /// Forgets hard iron and field reference: after a new magnetometer calibration.
    pub fn forget_field(&mut self) {
        self.iron.clear();
        self.field = super::Field::new();
        self.heading_age = 0.0;
    }

    /// Turns the heading to `yaw` (rad, NED, any number of turns) and keeps the tilt. With a magnetometer the field pulls it back; without, it stays.
    pub fn set_heading(&mut self, yaw: f32) {
        if !yaw.is_finite() {
            return;
        }
        self.turn_earth(&[0.0, 0.0, libm::remainderf(yaw - self.euler().yaw, TAU)]);
    }

    /// What is left of a specific force without gravity, body axes, m/s^2.
    #[must_use]
    pub fn linear_acceleration(&self, force: &Vec3) -> Vec3 {
        force + self.matrix.row(2).transpose() * STANDARD_GRAVITY
    }

    /// Acceleration in the earth frame that a specific force means, m/s^2.
    #[must_use]
    pub fn earth_acceleration(&self, force: &Vec3, earth: Earth) -> Vec3 {
        self.matrix_to(earth) * self.linear_acceleration(force)
    }

    /// Unit vector of gravity (down), body axes.
    #[must_use]
    pub fn gravity(&self) -> Vec3 {
        self.matrix.row(2).transpose()
    }

    /// What holds now.
    #[must_use]
    pub fn flags(&self) -> Flags {
        let config = self.config.borrow();
        Flags {
            started: self.started,
            startup: self.tilt.starting(config.tilt_tau) || (self.heading_absolute && self.heading_age < config.heading_tau),
            rest: self.rest.now,
            heading_absolute: self.heading_absolute,
            field_known: self.field.known(),
            field_disturbed: self.heading_absolute && self.field.refused(&config.field),
            bias_trusted: self.bias.trusted(&config.bias),
        }
    }

    /// How good it is.
    #[must_use]
    pub fn quality(&self) -> Quality {
        let (field_norm, field_dip) = self.field.against();
        Quality {
            heading_error: self.heading_error,
            bias_sigma: self.config.borrow().bias.limit * root(self.bias.variance),
            field_norm,
            field_dip,
            iron: root(square(&self.iron.found)),
        }
    }

    /// The state, bit by bit, between a version and a checksum; the configuration is not in it.
    #[must_use]
    pub fn save(&self) -> [u32; STATE_WORDS] {
        let mut out = [0; STATE_WORDS];
        let [version, numbers @ .., sum] = &mut out;
        *version = STATE_VERSION;
        let mut slots = numbers.iter_mut();
        let mut copy = self.clone();
        copy.words(&mut |word| {
            if let Some(slot) = slots.next() {
                *slot = word.to_bits();
            }
        });
        *sum = checksum(numbers);
        out
    }

    /// Continues from a saved state.
    ///
    /// # Errors
    /// [`StateError`] when the words are of another version or not those that [`Dcm::save`] gave; the filter is then unchanged.
    pub fn restore(&mut self, words: &[u32; STATE_WORDS]) -> Result<(), StateError> {
        let [version, rest @ .., sum] = words;
        if *version != STATE_VERSION {
            return Err(StateError::Version(*version));
        }
        if let Some(at) = rest.iter().position(|w| !f32::from_bits(*w).is_finite()) {
            return Err(StateError::NotFinite(at + 1));
        }
        let mut next = self.clone();
        let mut from = rest.iter();
        next.words(&mut |word| {
            if let Some(bits) = from.next() {
                *word = f32::from_bits(*bits);
            }
        });
        let m = &next.matrix;
        let good = (m * m.transpose() - Mat3::identity()).abs().max() < 1e-2 && determinant(m) > 0.0;
        if !good {
            return Err(StateError::NoRotation);
        }
        if *sum != checksum(rest) {
            return Err(StateError::Damaged);
        }
        *self = next;
        Ok(())
    }

    /// Difference of this heading to another attitude's, rad in (-pi, pi].
    #[must_use]
    pub fn heading_against(&self, other: &Mat3) -> f32 {
        let relative = self.matrix * other.transpose();
        let angle = libm::atan2f(relative.m21 - relative.m12, relative.m11 + relative.m22);
        if angle <= -PI { PI } else { angle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_words_is_the_number_of_fields() {
        let mut n = 2; // version and checksum
        Dcm::new(Config::default()).words(&mut |_| n += 1);
        assert_eq!(n, STATE_WORDS);
    }
}
