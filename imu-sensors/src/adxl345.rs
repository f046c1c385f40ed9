//! ADXL345 three-axis accelerometer.
//!
//! What it is: identity check, configuration (full resolution, range and rate by [`Config`]) and one burst read of three axes.
//!
//! What can go wrong: reading the axes one by one can mix two samples, hence the burst; the sensor is asynchronous to
//! its reader, so set twice the rate at which you read and every reading is a new one; the gain is nominal to a few per cent.
//!
//! Units: 256 LSB per g in full resolution, at every range.
//!
//! Reference: ADXL345 rev E; Linux adxl345_core agrees. The thesis calls it ADXL325 (section 4.2.2.2, see errata).

use crate::error::SensorError;
use embedded_hal::i2c::I2c;

/// Counts per standard gravity in full resolution (data sheet, table 1, "Sensitivity").
pub const LSB_PER_G: f32 = 256.0;

/// Data sheet, "Register definitions", register 0x00.
const DEVID: u8 = 0x00;
/// Data sheet, "Register definitions", register 0x2C.
const BW_RATE: u8 = 0x2C;
/// Data sheet, "Register definitions", register 0x2D.
const POWER_CTL: u8 = 0x2D;
/// Data sheet, "Register definitions", register 0x31.
const DATA_FORMAT: u8 = 0x31;
/// Data sheet, "Register definitions", registers 0x32 to 0x37: x, y, z, low byte first.
const DATAX0: u8 = 0x32;

/// Data sheet, register 0x00: "a fixed device ID code of 0xE5".
const IDENTITY: u8 = 0xE5;
/// FULL_RES, right justified, no self-test (data sheet, register 0x31).
const FULL_RESOLUTION: u8 = 1 << 3;
/// Data sheet, register 0x2D, bit Measure.
const MEASURE: u8 = 1 << 3;

/// Seven-bit bus address, by the level of the pin ALT ADDRESS (data sheet, "I2C").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Address {
    /// ALT ADDRESS low, as on the Razor board.
    #[default]
    Low = 0x53,
    /// ALT ADDRESS high.
    High = 0x1D,
}

/// Range (data sheet, register 0x31, "Range bits").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Range {
    /// +-2 g, 10 bits.
    G2 = 0,
    /// +-4 g, 11 bits.
    G4 = 1,
    /// +-8 g, 12 bits.
    G8 = 2,
    /// +-16 g, 13 bits.
    #[default]
    G16 = 3,
}

impl Range {
    /// Whether an axis sits at the end of the range: 10 bits at +-2 g, one more for each doubling.
    #[must_use]
    pub fn saturated(self, words: &[i16; 3]) -> bool {
        let rail = (512 << self as u8) - 1;
        words.iter().any(|w| *w >= rail || *w < -rail)
    }
}

/// Output rate at normal power (data sheet, table 7); the bandwidth is half of it. I2C at 400 kHz carries up to 800 Hz (data sheet, "I2C").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Rate {
    /// 6.25 Hz.
    Hz6_25 = 6,
    /// 12.5 Hz.
    Hz12_5 = 7,
    /// 25 Hz.
    Hz25 = 8,
    /// 50 Hz.
    Hz50 = 9,
    /// 100 Hz.
    Hz100 = 10,
    /// 200 Hz.
    Hz200 = 11,
    /// 400 Hz.
    #[default]
    Hz400 = 12,
    /// 800 Hz.
    Hz800 = 13,
    /// 1600 Hz.
    Hz1600 = 14,
    /// 3200 Hz.
    Hz3200 = 15,
}

impl Rate {
    /// The rate, Hz.
    #[must_use]
    pub fn hz(self) -> f32 {
        3200.0 / (1u32 << (15 - self as u8)) as f32
    }
}

/// What the chip is set to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// Where it answers.
    pub address: Address,
    /// Its range.
    pub range: Range,
    /// Its output rate.
    pub rate: Rate,
}

impl Config {
    /// Address with ALT ADDRESS low, +-16 g, 400 Hz: what the default is.
    pub const DEFAULT: Self = Self { address: Address::Low, range: Range::G16, rate: Rate::Hz400 };
}

/// Three words in standard gravities.
#[must_use]
pub fn g(words: &[i16; 3]) -> [f32; 3] {
    words.map(|word| f32::from(word) / LSB_PER_G)
}

/// The accelerometer on its bus.
#[derive(Debug)]
pub struct Adxl345<I2C> {
    bus: I2C,
    config: Config,
}

impl<I2C: I2c> Adxl345<I2C> {
    /// Takes the bus; touches nothing.
    pub const fn new(bus: I2C, config: Config) -> Self {
        Self { bus, config }
    }

    /// Checks the identity and configures the chip; measurement is switched on last.
    ///
    /// # Errors
    /// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when none does.
    pub fn configure(&mut self) -> Result<(), SensorError<I2C::Error>> {
        let address = self.config.address as u8;
        let mut id = [0u8; 1];
        self.bus.write_read(address, &[DEVID], &mut id)?;
        let [found] = id;
        if found != IDENTITY {
            return Err(SensorError::WrongIdentity { expected: IDENTITY, found });
        }
        self.bus.write(address, &[BW_RATE, self.config.rate as u8])?;
        self.bus.write(address, &[DATA_FORMAT, FULL_RESOLUTION | self.config.range as u8])?;
        self.bus.write(address, &[POWER_CTL, MEASURE])?;
        Ok(())
    }

    /// Reads the three axes of one sample, in the chip's own axes.
    ///
    /// # Errors
    /// [`SensorError::Bus`] when the transfer failed.
    pub fn read(&mut self) -> Result<[i16; 3], SensorError<I2C::Error>> {
        let mut b = [0u8; 6];
        self.bus.write_read(self.config.address as u8, &[DATAX0], &mut b)?;
        let [xl, xh, yl, yh, zl, zh] = b;
        let word = |l, h| i16::from_le_bytes([l, h]);
        Ok([word(xl, xh), word(yl, yh), word(zl, zh)])
    }

    /// Gives the bus back.
    pub fn release(self) -> I2C {
        self.bus
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failing_bus::fails_at_every_step;
    use embedded_hal_mock::eh1::i2c::{Mock, Transaction};
    extern crate std;
    use std::vec;

    fn configuration() -> std::vec::Vec<Transaction> {
        vec![
            Transaction::write_read(0x53, vec![0x00], vec![0xE5]),
            Transaction::write(0x53, vec![0x2C, 0x0C]),
            Transaction::write(0x53, vec![0x31, 0x0B]),
            Transaction::write(0x53, vec![0x2D, 0x08]),
        ]
    }

    #[test]
    fn configures_when_the_identity_is_right_and_measures_last() {
        let mut bus = Mock::new(&configuration());
        assert_eq!(Adxl345::new(&mut bus, Config::DEFAULT).configure(), Ok(()));
        bus.done();
    }

    #[test]
    fn another_chip_is_named_and_left_alone() {
        let mut bus = Mock::new(&[Transaction::write_read(0x53, vec![0x00], vec![0x33])]);
        assert_eq!(
            Adxl345::new(&mut bus, Config::DEFAULT).configure(),
            Err(SensorError::WrongIdentity { expected: 0xE5, found: 0x33 })
        );
        bus.done();
    }

    #[test]
    fn words_are_little_endian_and_signed_in_the_order_x_y_z() {
        let mut bus = Mock::new(&[Transaction::write_read(0x53, vec![0x32], vec![0x02, 0x01, 0xFE, 0xFF, 0x00, 0xF0])]);
        let got = Adxl345::new(&mut bus, Config::DEFAULT).read().unwrap();
        assert_eq!(got, [258, -2, -4096]);
        bus.done();
    }

    #[test]
    fn the_rails_of_each_range_are_saturation() {
        for (range, rail) in [(Range::G2, 511), (Range::G4, 1023), (Range::G8, 2047), (Range::G16, 4095)] {
            assert!(range.saturated(&[0, rail, 0]));
            assert!(range.saturated(&[-rail - 1, 0, 0]));
            assert!(!range.saturated(&[-rail, rail - 1, 256]));
        }
    }

    #[test]
    fn every_address_range_and_rate_reaches_its_register() {
        use Rate::{Hz6_25, Hz12_5, Hz25, Hz50, Hz100, Hz200, Hz400, Hz800, Hz1600, Hz3200};
        for (address, wire) in [(Address::Low, 0x53), (Address::High, 0x1D)] {
            for (range, code) in [(Range::G2, 0x08), (Range::G4, 0x09), (Range::G8, 0x0A), (Range::G16, 0x0B)] {
                for (n, rate) in [Hz6_25, Hz12_5, Hz25, Hz50, Hz100, Hz200, Hz400, Hz800, Hz1600, Hz3200].into_iter().enumerate()
                {
                    let mut bus = Mock::new(&[
                        Transaction::write_read(wire, vec![0x00], vec![0xE5]),
                        Transaction::write(wire, vec![0x2C, 6 + n as u8]),
                        Transaction::write(wire, vec![0x31, code]),
                        Transaction::write(wire, vec![0x2D, 0x08]),
                        Transaction::write_read(wire, vec![0x32], vec![0; 6]),
                    ]);
                    let mut chip = Adxl345::new(&mut bus, Config { address, range, rate });
                    assert_eq!(chip.configure(), Ok(()));
                    assert_eq!(chip.read(), Ok([0; 3]));
                    bus.done();
                    assert_eq!(rate.hz(), 6.25 * (1 << n) as f32);
                }
            }
        }
        assert_eq!(Config::default(), Config::DEFAULT);
        assert_eq!(g(&[256, -512, 0]), [1.0, -2.0, 0.0]);
    }

    #[test]
    fn a_silent_or_stuck_bus_is_an_error_at_every_step() {
        let burst = Transaction::write_read(0x53, vec![0x32], vec![0; 6]);
        fails_at_every_step(
            &configuration(),
            &burst,
            |bus| Adxl345::new(bus, Config::DEFAULT).configure(),
            |bus| Adxl345::new(bus, Config::DEFAULT).read(),
        );
    }
}
