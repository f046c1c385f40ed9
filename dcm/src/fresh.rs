//! New readings of a sensor that a recording repeats.
//!
//! What it is: many logs repeat a sensor's last reading until the next one comes, where another sensor is faster; this tells the new ones.
//! What can go wrong: two equal readings in a row of a sensor at rest look like one; after [`LONGEST_REPEAT`] a repeated
//! reading is taken as new.
//! Units: s.
//! Reference: magnetometers at 15 to 50 Hz in logs of 95 to 286 Hz; an accelerometer at 91 Hz beside a gyro at 107 Hz.

use crate::Vec3;

/// Longest time for which one reading is repeated: slower sensors than 10 Hz are not expected in repeating logs, s.
const LONGEST_REPEAT: f32 = 0.1;

/// Remembers the last reading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fresh {
    last: Option<Vec3>,
    age: f32,
}

impl Fresh {
    /// The reading where it is new; `dt` is the time since the last call.
    pub fn take(&mut self, dt: f32, reading: Option<Vec3>) -> Option<Vec3> {
        self.age += dt;
        if reading.is_none() || (reading == self.last && self.age < LONGEST_REPEAT) {
            return None;
        }
        self.age = 0.0;
        self.last = reading;
        reading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_are_held_back_until_they_are_old() {
        let mut fresh = Fresh::default();
        let (a, b) = (Some(Vec3::x()), Some(Vec3::y()));
        let got = [a, a, b, b, b, None, b].map(|m| fresh.take(0.03, m).is_some());
        assert_eq!(got, [true, false, true, false, false, false, true]);
    }

    #[test]
    fn a_repeat_is_new_as_soon_as_it_is_old() {
        let mut fresh = Fresh::default();
        assert_eq!(fresh.take(LONGEST_REPEAT, Some(Vec3::x())), Some(Vec3::x()));
        assert_eq!(fresh.take(LONGEST_REPEAT, Some(Vec3::x())), Some(Vec3::x()));
    }
}
