//! HMC5883L three-axis magnetometer.
//!
//! What it is: identity check, configuration (continuous; averaging, rate and gain by [`Config`]) and one burst read of three axes.
//!
//! What can go wrong: the axes come in the order x, **z**, y; an axis out of range reads -4096; the first sample after
//! a change of gain still has the old gain; if only some of the six bytes are read the chip locks its data. The
//! look-alike HMC5843 has the same identity, another axis order and other gains, and cannot be told apart by its registers.
//!
//! Units: 1090 LSB per gauss at the default gain; range +-1.3 G.
//!
//! Reference: HMC5883L data sheet, pages 11 to 16; Linux hmc5843_core agrees.

use crate::error::SensorError;
use embedded_hal::i2c::I2c;

/// Bus address, the only one (data sheet, page 11: 0x3C and 0x3D on the wire).
pub const ADDRESS: u8 = 0x1E;

/// Data sheet, "Configuration Register A".
const CONFIG_A: u8 = 0x00;
/// Data sheet, "Configuration Register B".
const CONFIG_B: u8 = 0x01;
/// Data sheet, "Mode Register".
const MODE: u8 = 0x02;
/// Data sheet, "Data Output X Registers A and B"; z and y follow, high byte first.
const DATA_X_H: u8 = 0x03;
/// Data sheet, "Identification Register A"; B and C follow.
const ID_A: u8 = 0x0A;

/// Data sheet, "Identification Register A", "B" and "C".
const IDENTITY: [u8; 3] = *b"H43";
/// Data sheet, "Mode Register", continuous-measurement mode.
const CONTINUOUS: u8 = 0;
/// What an axis reads when its converter overflowed (data sheet, "Data Output X Registers A and B").
const OVERFLOW: i16 = -4096;

/// Measurements that a sample is averaged of (data sheet, "Configuration Register A", bits MA).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Averaging {
    /// One.
    #[default]
    One = 0,
    /// Two.
    Two = 1,
    /// Four.
    Four = 2,
    /// Eight.
    Eight = 3,
}

/// Output rate (data sheet, "Configuration Register A", bits DO).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Rate {
    /// 0.75 Hz.
    Hz0_75 = 0,
    /// 1.5 Hz.
    Hz1_5 = 1,
    /// 3 Hz.
    Hz3 = 2,
    /// 7.5 Hz.
    Hz7_5 = 3,
    /// 15 Hz.
    Hz15 = 4,
    /// 30 Hz.
    Hz30 = 5,
    /// 75 Hz.
    #[default]
    Hz75 = 6,
}

impl Rate {
    /// The rate, Hz.
    #[must_use]
    pub const fn hz(self) -> f32 {
        match self {
            Self::Hz0_75 => 0.75,
            Self::Hz1_5 => 1.5,
            Self::Hz3 => 3.0,
            Self::Hz7_5 => 7.5,
            Self::Hz15 => 15.0,
            Self::Hz30 => 30.0,
            Self::Hz75 => 75.0,
        }
    }
}

/// Range, and with it the gain (data sheet, "Configuration Register B", table 9).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Range {
    /// +-0.88 G.
    Gauss0_88 = 0,
    /// +-1.3 G.
    #[default]
    Gauss1_3 = 1,
    /// +-1.9 G.
    Gauss1_9 = 2,
    /// +-2.5 G.
    Gauss2_5 = 3,
    /// +-4.0 G.
    Gauss4_0 = 4,
    /// +-4.7 G.
    Gauss4_7 = 5,
    /// +-5.6 G.
    Gauss5_6 = 6,
    /// +-8.1 G.
    Gauss8_1 = 7,
}

impl Range {
    /// Counts per gauss.
    #[must_use]
    pub const fn lsb_per_gauss(self) -> f32 {
        match self {
            Self::Gauss0_88 => 1370.0,
            Self::Gauss1_3 => 1090.0,
            Self::Gauss1_9 => 820.0,
            Self::Gauss2_5 => 660.0,
            Self::Gauss4_0 => 440.0,
            Self::Gauss4_7 => 390.0,
            Self::Gauss5_6 => 330.0,
            Self::Gauss8_1 => 230.0,
        }
    }

    /// Three words in gauss.
    #[must_use]
    pub fn gauss(self, words: &[i16; 3]) -> [f32; 3] {
        words.map(|word| f32::from(word) / self.lsb_per_gauss())
    }
}

/// What the chip is set to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// Measurements a sample.
    pub averaging: Averaging,
    /// Its output rate.
    pub rate: Rate,
    /// Its range.
    pub range: Range,
}

impl Config {
    /// One measurement a sample, 75 Hz, +-1.3 G: what the default is.
    pub const DEFAULT: Self = Self { averaging: Averaging::One, rate: Rate::Hz75, range: Range::Gauss1_3 };
}

/// Whether an axis overflowed.
#[must_use]
pub fn overflowed(words: &[i16; 3]) -> bool {
    words.contains(&OVERFLOW)
}

/// The magnetometer on its bus.
#[derive(Debug)]
pub struct Hmc5883l<I2C> {
    bus: I2C,
    config: Config,
}

impl<I2C: I2c> Hmc5883l<I2C> {
    /// Takes the bus; touches nothing.
    pub const fn new(bus: I2C, config: Config) -> Self {
        Self { bus, config }
    }

    /// Checks the three identity bytes and configures the chip.
    ///
    /// # Errors
    /// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when none does.
    pub fn configure(&mut self) -> Result<(), SensorError<I2C::Error>> {
        let mut id = [0u8; 3];
        self.bus.write_read(ADDRESS, &[ID_A], &mut id)?;
        if let Some((found, expected)) = id.iter().zip(&IDENTITY).find(|(got, want)| got != want) {
            return Err(SensorError::WrongIdentity { expected: *expected, found: *found });
        }
        let Config { averaging, rate, range } = self.config;
        self.bus.write(ADDRESS, &[CONFIG_A, (averaging as u8) << 5 | (rate as u8) << 2])?;
        self.bus.write(ADDRESS, &[CONFIG_B, (range as u8) << 5])?;
        self.bus.write(ADDRESS, &[MODE, CONTINUOUS])?;
        Ok(())
    }

    /// Reads the three axes of one sample and returns them as x, y, z of the chip.
    ///
    /// Exactly the six data bytes: the register pointer goes back to the first of them by itself after the last.
    ///
    /// # Errors
    /// [`SensorError::Bus`] when the transfer failed.
    pub fn read(&mut self) -> Result<[i16; 3], SensorError<I2C::Error>> {
        let mut b = [0u8; 6];
        self.bus.write_read(ADDRESS, &[DATA_X_H], &mut b)?;
        let [xh, xl, zh, zl, yh, yl] = b;
        let word = |h, l| i16::from_be_bytes([h, l]);
        Ok([word(xh, xl), word(yh, yl), word(zh, zl)])
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
            Transaction::write_read(0x1E, vec![0x0A], vec![0x48, 0x34, 0x33]),
            Transaction::write(0x1E, vec![0x00, 0x18]),
            Transaction::write(0x1E, vec![0x01, 0x20]),
            Transaction::write(0x1E, vec![0x02, 0x00]),
        ]
    }

    #[test]
    fn configures_when_the_identity_is_right() {
        let mut bus = Mock::new(&configuration());
        assert_eq!(Hmc5883l::new(&mut bus, Config::DEFAULT).configure(), Ok(()));
        bus.done();
    }

    #[test]
    fn every_identity_byte_counts() {
        for (id, expected, found) in
            [([0x00, 0x34, 0x33], 0x48, 0x00), ([0x48, 0x35, 0x33], 0x34, 0x35), ([0x48, 0x34, 0xFF], 0x33, 0xFF)]
        {
            let mut bus = Mock::new(&[Transaction::write_read(0x1E, vec![0x0A], id.to_vec())]);
            assert_eq!(Hmc5883l::new(&mut bus, Config::DEFAULT).configure(), Err(SensorError::WrongIdentity { expected, found }));
            bus.done();
        }
    }

    #[test]
    fn words_are_big_endian_in_the_order_x_z_y() {
        let mut bus = Mock::new(&[Transaction::write_read(0x1E, vec![0x03], vec![0x01, 0x02, 0xFF, 0xFE, 0x00, 0x07])]);
        assert_eq!(Hmc5883l::new(&mut bus, Config::DEFAULT).read(), Ok([258, 7, -2]));
        bus.done();
    }

    #[test]
    fn overflow_is_its_own_code() {
        assert!(overflowed(&[0, -4096, 0]));
        assert!(!overflowed(&[-2048, 2047, 0]));
    }

    #[test]
    fn a_silent_or_stuck_bus_is_an_error_at_every_step() {
        let burst = Transaction::write_read(0x1E, vec![0x03], vec![0; 6]);
        fails_at_every_step(
            &configuration(),
            &burst,
            |bus| Hmc5883l::new(bus, Config::DEFAULT).configure(),
            |bus| Hmc5883l::new(bus, Config::DEFAULT).read(),
        );
    }

    #[test]
    fn every_averaging_rate_and_range_reaches_its_register() {
        use Averaging::{Eight, Four, One, Two};
        use Range::{Gauss0_88, Gauss1_3, Gauss1_9, Gauss2_5, Gauss4_0, Gauss4_7, Gauss5_6, Gauss8_1};
        use Rate::{Hz0_75, Hz1_5, Hz3, Hz7_5, Hz15, Hz30, Hz75};
        let ranges = [Gauss0_88, Gauss1_3, Gauss1_9, Gauss2_5, Gauss4_0, Gauss4_7, Gauss5_6, Gauss8_1];
        for (a, averaging) in [One, Two, Four, Eight].into_iter().enumerate() {
            for (n, rate) in [Hz0_75, Hz1_5, Hz3, Hz7_5, Hz15, Hz30, Hz75].into_iter().enumerate() {
                for (r, range) in ranges.into_iter().enumerate() {
                    let mut bus = Mock::new(&[
                        Transaction::write_read(0x1E, vec![0x0A], b"H43".to_vec()),
                        Transaction::write(0x1E, vec![0x00, (32 * a + 4 * n) as u8]),
                        Transaction::write(0x1E, vec![0x01, (32 * r) as u8]),
                        Transaction::write(0x1E, vec![0x02, 0x00]),
                    ]);
                    assert_eq!(Hmc5883l::new(&mut bus, Config { averaging, rate, range }).configure(), Ok(()));
                    bus.done();
                }
            }
        }
        assert_eq!(Config::default(), Config::DEFAULT);
    }

    /// The ends of twelve bits reach at least as far as the range says.
    #[test]
    fn gains_are_those_of_their_ranges() {
        let said = [0.88, 1.3, 1.9, 2.5, 4.0, 4.7, 5.6, 8.1];
        use Range::{Gauss0_88, Gauss1_3, Gauss1_9, Gauss2_5, Gauss4_0, Gauss4_7, Gauss5_6, Gauss8_1};
        let ranges = [Gauss0_88, Gauss1_3, Gauss1_9, Gauss2_5, Gauss4_0, Gauss4_7, Gauss5_6, Gauss8_1];
        for (range, gauss) in ranges.into_iter().zip(said) {
            assert!((1.0..1.7).contains(&(2048.0 / range.lsb_per_gauss() / gauss)), "{range:?}");
        }
        assert_eq!(Gauss1_3.gauss(&[1090, -545, 0]), [1.0, -0.5, 0.0]);
        assert_eq!([Rate::Hz0_75.hz(), Rate::Hz75.hz()], [0.75, 75.0]);
    }
}
