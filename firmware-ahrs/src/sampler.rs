//! Reads the sensors once a tick.
//!
//! What it is: the only code of the portable half that touches the bus. It keeps one small state a sensor: absent or
//! alive, and since when it fails.
//!
//! What can go wrong: a sensor that fails [`MISSES_ALLOWED`] reads in a row counts as dead; an absent or dead sensor is
//! identified and configured again every [`RETRY_EVERY`] ticks, one sensor a tick, so that a loose plug heals itself and a
//! missing sensor costs almost no bus time. The test accelerometer is optional: where none is fitted its bit stays down.
//!
//! Units: sensor counts in chip axes; ticks of the sampling clock.
//!
//! Reference: specification `ahrs.md`, "Sensors".

use crate::{ACCEL, GYRO, GyroReading, MAG, TEST_ACCEL, TICK_HZ, chips};
use embedded_hal::i2c::I2c;

/// Failed reads in a row after which a sensor counts as dead: 25 ms.
pub const MISSES_ALLOWED: u8 = 5;
/// Ticks between two attempts to bring a sensor back: 1 s.
pub const RETRY_EVERY: u32 = TICK_HZ;
/// The magnetometer is read on every n-th tick, so that each read finds a new sample (200/3 Hz is below its 75 Hz).
pub const MAG_EVERY: u32 = TICK_HZ / chips::MAG.rate.hz() as u32 + 1;

/// What one tick found on the bus; `None` where there is no new reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Readings {
    /// Gyro.
    pub gyro: Option<GyroReading>,
    /// Accelerometer.
    pub accel: Option<[i16; 3]>,
    /// Magnetometer.
    pub mag: Option<[i16; 3]>,
    /// Test accelerometer.
    pub test: Option<[i16; 3]>,
    /// Which sensors are alive: bits as in [`frame::ImuSample::alive`].
    pub alive: u8,
    /// Whose read failed in this tick: the same bits.
    pub lost: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Health {
    #[default]
    Absent,
    Alive {
        misses: u8,
    },
}

impl Health {
    /// Books the outcome of one access and passes the value on.
    fn book<T, E>(&mut self, outcome: Result<T, E>) -> Option<T> {
        match (outcome, *self) {
            (Ok(value), _) => {
                *self = Self::Alive { misses: 0 };
                Some(value)
            }
            (Err(_), Self::Alive { misses }) if misses + 1 < MISSES_ALLOWED => {
                *self = Self::Alive { misses: misses + 1 };
                None
            }
            (Err(_), _) => {
                *self = Self::Absent;
                None
            }
        }
    }

    fn is_alive(self) -> bool {
        self != Self::Absent
    }
}

/// Reads the sensors through any embedded-hal I2C bus.
#[derive(Debug)]
pub struct Sampler<B> {
    bus: B,
    gyro: Health,
    accel: Health,
    mag: Health,
    test: Health,
    tick: u32,
}

impl<B: I2c> Sampler<B> {
    /// Identifies and configures what is there; [`Sampler::alive`] says what was found.
    pub fn new(bus: B) -> Self {
        let absent = Health::Absent;
        let mut sampler = Self { bus, gyro: absent, accel: absent, mag: absent, test: absent, tick: 0 };
        let bus = &mut sampler.bus;
        sampler.gyro.book(chips::gyro(bus).configure());
        sampler.accel.book(chips::accel(bus).configure());
        sampler.mag.book(chips::mag(bus).configure());
        sampler.test.book(chips::test(bus).configure());
        sampler
    }

    /// Sensors that answered with the right identity and still do: bits as in [`frame::Hello::present`].
    #[must_use]
    pub fn alive(&self) -> u8 {
        let bit = |health: Health, bit| if health.is_alive() { bit } else { 0 };
        bit(self.gyro, GYRO) | bit(self.accel, ACCEL) | bit(self.mag, MAG) | bit(self.test, TEST_ACCEL)
    }

    /// Reads whatever is due on this tick.
    pub fn read(&mut self) -> Readings {
        let tick = self.tick;
        self.tick = tick.wrapping_add(1);
        let bus = &mut self.bus;
        match tick % RETRY_EVERY {
            50 if !self.gyro.is_alive() => drop(self.gyro.book(chips::gyro(bus).configure())),
            100 if !self.accel.is_alive() => drop(self.accel.book(chips::accel(bus).configure())),
            150 if !self.mag.is_alive() => drop(self.mag.book(chips::mag(bus).configure())),
            0 if tick > 0 && !self.test.is_alive() => drop(self.test.book(chips::test(bus).configure())),
            _ => {}
        }
        let mut readings = Readings::default();
        let mut lost = |bit, missing| readings.lost |= if missing { bit } else { 0 };
        if self.gyro.is_alive() {
            readings.gyro = self.gyro.book(chips::gyro(bus).read());
            lost(GYRO, readings.gyro.is_none());
        }
        if self.accel.is_alive() {
            readings.accel = self.accel.book(chips::accel(bus).read());
            lost(ACCEL, readings.accel.is_none());
        }
        if self.mag.is_alive() && tick.is_multiple_of(MAG_EVERY) {
            readings.mag = self.mag.book(chips::mag(bus).read());
            lost(MAG, readings.mag.is_none());
        }
        if self.test.is_alive() && tick % MAG_EVERY == 1 {
            readings.test = self.test.book(chips::test(bus).read());
            lost(TEST_ACCEL, readings.test.is_none());
        }
        readings.alive = self.alive();
        readings
    }

    /// Gives the bus back.
    pub fn release(self) -> B {
        self.bus
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use embedded_hal::i2c::{Error, ErrorKind, ErrorType, NoAcknowledgeSource, Operation};

    /// A bus with four register files; each sensor can be pulled out.
    struct Bench {
        fitted: [bool; 4],
        files: [[u8; 64]; 4],
        accesses: [u32; 4],
    }

    #[derive(Debug)]
    struct Nack;
    impl Error for Nack {
        fn kind(&self) -> ErrorKind {
            ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)
        }
    }
    impl ErrorType for Bench {
        type Error = Nack;
    }
    impl I2c for Bench {
        fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), Nack> {
            let n = [0x68, 0x53, 0x1E, 0x18].iter().position(|a| *a == address).ok_or(Nack)?;
            self.accesses[n] += 1;
            if !self.fitted[n] {
                return Err(Nack);
            }
            let mut pointer = 0usize;
            for operation in operations {
                match operation {
                    Operation::Write(bytes) => {
                        pointer = usize::from(bytes[0] & 0x3F); // the LIS3DH's bit for many bytes is not part of it
                        self.files[n][pointer..pointer + bytes.len() - 1].copy_from_slice(&bytes[1..]);
                    }
                    Operation::Read(into) => {
                        let len = into.len();
                        into.copy_from_slice(&self.files[n][pointer..pointer + len]);
                    }
                }
            }
            Ok(())
        }
    }

    fn bench() -> Bench {
        let mut files = [[0; 64]; 4];
        files[0][0] = 0x69;
        files[1][0] = 0xE5;
        files[2][10..13].copy_from_slice(b"H43");
        files[3][0x0F] = 0x33;
        Bench { fitted: [true, true, true, false], files, accesses: [0; 4] }
    }

    #[test]
    fn all_three_are_found_and_configured() {
        let sampler = Sampler::new(bench());
        assert_eq!(sampler.alive(), GYRO | ACCEL | MAG);
        let bench = sampler.release();
        assert_eq!([bench.files[0][0x16], bench.files[1][0x2D], bench.files[2][0x00]], [0x1A, 0x08, 0x18]);
    }

    #[test]
    fn the_magnetometer_is_read_on_every_third_tick() {
        let mut sampler = Sampler::new(bench());
        let fresh = [0; 9].map(|_| sampler.read().mag.is_some());
        assert_eq!(fresh, [true, false, false, true, false, false, true, false, false]);
    }

    #[test]
    fn a_few_lost_reads_are_forgiven_and_more_are_not() {
        let mut sampler = Sampler::new(bench());
        sampler.bus.fitted[0] = false;
        for _ in 0..MISSES_ALLOWED - 1 {
            let r = sampler.read();
            assert_eq!((r.gyro, r.alive & GYRO), (None, GYRO));
        }
        assert_eq!(sampler.read().alive, ACCEL | MAG);
    }

    #[test]
    fn a_sensor_that_was_plugged_in_late_comes_alive_within_a_second() {
        let mut bus = bench();
        bus.fitted = [false; 4];
        let mut sampler = Sampler::new(bus);
        assert_eq!(sampler.alive(), 0);
        sampler.bus.fitted = [true, true, true, false];
        let alive = (0..RETRY_EVERY).map(|_| sampler.read().alive).last();
        assert_eq!(alive, Some(GYRO | ACCEL | MAG));
        assert_eq!(sampler.bus.files[0][0x16], 0x1A, "configured again, not only read");
    }

    #[test]
    fn an_absent_sensor_costs_one_attempt_a_second() {
        let mut bus = bench();
        bus.fitted[2] = false;
        let mut sampler = Sampler::new(bus);
        for _ in 0..10 * RETRY_EVERY {
            assert_eq!(sampler.read().alive, GYRO | ACCEL);
        }
        assert_eq!(sampler.bus.accesses[2], 1 + 10);
    }

    #[test]
    fn the_test_accelerometer_is_optional_and_read_between_the_magnetometer_s_ticks() {
        let mut sampler = Sampler::new(bench());
        assert_eq!(sampler.alive() & TEST_ACCEL, 0, "none is fitted, and that is no fault");
        sampler.bus.fitted[3] = true;
        let found = (0..=RETRY_EVERY).position(|_| sampler.read().alive & TEST_ACCEL != 0);
        assert_eq!(found, Some(RETRY_EVERY as usize));
        sampler.bus.files[3][0x28..0x2E].copy_from_slice(&[0x30, 0x12, 0xF0, 0xFF, 0x00, 0x80]);
        let read = [0; 6].map(|_| sampler.read());
        assert!(read.iter().all(|r| r.test.is_none() || r.mag.is_none()), "never in the same tick");
        assert_eq!(read.iter().filter_map(|r| r.test).collect::<std::vec::Vec<_>>(), [[0x123, -1, -2048]; 2]);
        assert!(read.iter().all(|r| r.lost == 0));
        sampler.bus.fitted[3] = false;
        let lost: u32 = (0..3).map(|_| u32::from(sampler.read().lost & TEST_ACCEL != 0)).sum();
        assert_eq!(lost, 1);
    }

    /// A sensor that answers is read and not configured again: every three ticks cost the bus the same.
    #[test]
    fn healthy_sensors_are_left_as_they_are() {
        let mut sampler = Sampler::new(bench());
        let mut three = || {
            let before = sampler.bus.accesses;
            (0..MAG_EVERY).for_each(|_| {
                sampler.read();
            });
            [0, 1, 2].map(|n| sampler.bus.accesses[n] - before[n])
        };
        let first = three();
        assert!((0..2 * RETRY_EVERY / MAG_EVERY).all(|_| three() == first), "{first:?}");
    }
}
