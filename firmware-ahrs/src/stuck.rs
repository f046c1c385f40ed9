//! A chip that answers, but always with the same words.
//!
//! What it is: how often in a row a sensor has given the same three words. The noise of the three chips is about a count or more on every
//! axis, so that all three words rarely repeat, and two hundred repetitions in a row are no chance.
//!
//! What can go wrong: ideal chips of a simulation at rest are found stuck, and rightly so; a sensor at the end of its range on all
//! three axes is too. The words are still shown to the filter: this is a finding for whoever flies it, and no guess of a better value.
//!
//! Units: readings.
//!
//! Reference: specification `ahrs.md`, "Sensors" (stuck-value detection); noise: ITG-3200 0.38 deg/s rms (5 counts), ADXL345 0.75 to
//! 1.1 counts rms, HMC5883L 2 mG (2 counts), data sheets.

/// Readings alike, one after the other, from which on a sensor counts as stuck: a second of the gyro's.
pub const STUCK_AFTER: u16 = 200;

/// Watches one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Watch {
    last: [i16; 3],
    alike: u16,
}

impl Watch {
    /// Takes a fresh reading.
    pub fn take(&mut self, words: &[i16; 3]) {
        if *words == self.last {
            self.alike = self.alike.saturating_add(1);
        } else {
            *self = Self { last: *words, alike: 1 };
        }
    }

    /// Whether the sensor is stuck, by its readings so far.
    #[must_use]
    pub const fn is_stuck(&self) -> bool {
        self.alike >= STUCK_AFTER
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_words_for_a_second_are_stuck_until_one_of_them_moves() {
        let mut watch = Watch::default();
        let mut readings = |words: [i16; 3], n: u16| {
            (0..n).for_each(|_| watch.take(&words));
            watch.is_stuck()
        };
        assert!(!readings([3, -7, 255], STUCK_AFTER - 1));
        assert!(readings([3, -7, 255], 1));
        assert!(readings([3, -7, 255], u16::MAX), "for ever");
        assert!(!readings([3, -7, 256], 1), "one count of one axis is life");
        assert!(!readings([3, -7, 255], STUCK_AFTER - 1));
    }

    #[test]
    fn a_chip_that_gives_zeros_from_the_start_is_found_too() {
        let mut watch = Watch::default();
        (0..STUCK_AFTER).for_each(|_| watch.take(&[0; 3]));
        assert!(watch.is_stuck());
    }
}
