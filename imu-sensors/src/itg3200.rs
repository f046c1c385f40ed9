//! ITG-3200 three-axis gyro.
//!
//! What it is: identity check, configuration (full range, low-pass and rate by [`Config`], clock from the PLL on the X gyro)
//! and one burst read of temperature and three rates.
//!
//! What can go wrong: the full-scale bits are zero after reset and must be 3, otherwise the rates are not specified;
//! bit 0 of the identity register may read either way; beyond 2000 deg/s the word rests at its limit; the zero is off by several deg/s.
//!
//! Units: 14.375 LSB per deg/s; temperature 280 LSB per kelvin with -13200 at 35 degC.
//!
//! Reference: PS-ITG-3200A rev 1.4; the Linux driver itg3200_core agrees. Beharie 2013 Eq. 4.1-4.2 with errata.

use crate::error::SensorError;
use embedded_hal::i2c::I2c;

/// Counts per degree per second (data sheet, section 3.1, "Sensitivity").
pub const LSB_PER_DEG_S: f32 = 14.375;

/// Data sheet, section 8.1, register 0.
const WHO_AM_I: u8 = 0x00;
/// Data sheet, section 8.2, register 21.
const SMPLRT_DIV: u8 = 0x15;
/// Data sheet, section 8.3, register 22.
const DLPF_FS: u8 = 0x16;
/// Data sheet, section 8.6, registers 27 to 34: temperature, x, y, z, high byte first.
const TEMP_OUT_H: u8 = 0x1B;
/// Data sheet, section 8.7, register 62.
const PWR_MGM: u8 = 0x3E;

/// Bits 6 to 1 of the identity (data sheet, section 8.1).
const IDENTITY: u8 = 0x34;
/// FS_SEL = 3: +-2000 deg/s, the only range that is specified (data sheet, section 8.3).
const FULL_SCALE: u8 = 3 << 3;
/// Awake, all axes on, clock from the PLL on the X gyro (data sheet, section 8.7, CLK_SEL = 1).
const CLOCK_PLL_X: u8 = 1;

/// Seven-bit bus address, by the level of the pin AD0 (data sheet, section 6, "I2C Serial Interface").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Address {
    /// AD0 low, as on the Razor board.
    #[default]
    Low = 0x68,
    /// AD0 high.
    High = 0x69,
}

/// Bandwidth of the digital low-pass (data sheet, section 8.3, DLPF_CFG); the widest samples at 8 kHz inside, the others at 1 kHz.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Bandwidth {
    /// 256 Hz, of samples at 8 kHz.
    Hz256 = 0,
    /// 188 Hz.
    Hz188 = 1,
    /// 98 Hz.
    #[default]
    Hz98 = 2,
    /// 42 Hz.
    Hz42 = 3,
    /// 20 Hz.
    Hz20 = 4,
    /// 10 Hz.
    Hz10 = 5,
    /// 5 Hz.
    Hz5 = 6,
}

/// What the chip is set to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// Where it answers.
    pub address: Address,
    /// Its low-pass.
    pub bandwidth: Bandwidth,
    /// The registers are refreshed on every `divider + 1`th internal sample (data sheet, section 8.2).
    pub divider: u8,
}

impl Config {
    /// Address with AD0 low, 98 Hz, every internal sample: what the default is.
    pub const DEFAULT: Self = Self { address: Address::Low, bandwidth: Bandwidth::Hz98, divider: 0 };

    /// How often the registers are refreshed, Hz.
    #[must_use]
    pub fn rate_hz(&self) -> f32 {
        let internal = if self.bandwidth == Bandwidth::Hz256 { 8000.0 } else { 1000.0 };
        internal / (f32::from(self.divider) + 1.0)
    }
}

/// One reading, in the chip's own axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GyroReading {
    /// Temperature word.
    pub temperature: i16,
    /// Rates about the chip's x, y and z.
    pub rate: [i16; 3],
}

impl GyroReading {
    /// Whether a rate sits at the end of the converter's range.
    #[must_use]
    pub fn saturated(&self) -> bool {
        self.rate.iter().any(|r| *r == i16::MAX || *r == i16::MIN)
    }

    /// Rates about the chip's x, y and z, deg/s.
    #[must_use]
    pub fn deg_s(&self) -> [f32; 3] {
        self.rate.map(|word| f32::from(word) / LSB_PER_DEG_S)
    }

    /// Chip temperature, degree Celsius (data sheet, section 3.1, "Temperature Sensor").
    #[must_use]
    pub fn celsius(&self) -> f32 {
        35.0 + (f32::from(self.temperature) + 13_200.0) / 280.0
    }
}

/// The gyro on its bus.
#[derive(Debug)]
pub struct Itg3200<I2C> {
    bus: I2C,
    config: Config,
}

impl<I2C: I2c> Itg3200<I2C> {
    /// Takes the bus; touches nothing.
    pub const fn new(bus: I2C, config: Config) -> Self {
        Self { bus, config }
    }

    /// Checks the identity and configures the chip.
    ///
    /// # Errors
    /// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when none does.
    pub fn configure(&mut self) -> Result<(), SensorError<I2C::Error>> {
        let address = self.config.address as u8;
        let mut id = [0u8; 1];
        self.bus.write_read(address, &[WHO_AM_I], &mut id)?;
        let [found] = id;
        if (found >> 1) & 0x3F != IDENTITY {
            return Err(SensorError::WrongIdentity { expected: IDENTITY << 1, found });
        }
        self.bus.write(address, &[PWR_MGM, CLOCK_PLL_X])?;
        self.bus.write(address, &[SMPLRT_DIV, self.config.divider])?;
        self.bus.write(address, &[DLPF_FS, FULL_SCALE | self.config.bandwidth as u8])?;
        Ok(())
    }

    /// Reads temperature and rates in one burst, so that the four words belong together.
    ///
    /// # Errors
    /// [`SensorError::Bus`] when the transfer failed.
    pub fn read(&mut self) -> Result<GyroReading, SensorError<I2C::Error>> {
        let mut b = [0u8; 8];
        self.bus.write_read(self.config.address as u8, &[TEMP_OUT_H], &mut b)?;
        let [th, tl, xh, xl, yh, yl, zh, zl] = b;
        let word = |h, l| i16::from_be_bytes([h, l]);
        Ok(GyroReading { temperature: word(th, tl), rate: [word(xh, xl), word(yh, yl), word(zh, zl)] })
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

    fn configuration(id: u8) -> std::vec::Vec<Transaction> {
        vec![
            Transaction::write_read(0x68, vec![0x00], vec![id]),
            Transaction::write(0x68, vec![0x3E, 0x01]),
            Transaction::write(0x68, vec![0x15, 0x00]),
            Transaction::write(0x68, vec![0x16, 0x1A]),
        ]
    }

    #[test]
    fn configures_when_the_identity_is_right_with_either_last_bit() {
        for id in [0x68, 0x69] {
            let mut bus = Mock::new(&configuration(id));
            assert_eq!(Itg3200::new(&mut bus, Config::DEFAULT).configure(), Ok(()));
            bus.done();
        }
    }

    #[test]
    fn another_chip_is_named_and_left_alone() {
        let mut bus = Mock::new(&[Transaction::write_read(0x68, vec![0x00], vec![0x71])]);
        assert_eq!(
            Itg3200::new(&mut bus, Config::DEFAULT).configure(),
            Err(SensorError::WrongIdentity { expected: 0x68, found: 0x71 })
        );
        bus.done();
    }

    #[test]
    fn words_are_big_endian_and_signed_in_the_order_t_x_y_z() {
        let bytes = vec![0xCC, 0x70, 0x01, 0x02, 0xFF, 0xFE, 0x80, 0x00];
        let mut bus = Mock::new(&[Transaction::write_read(0x68, vec![0x1B], bytes)]);
        let got = Itg3200::new(&mut bus, Config::DEFAULT).read().unwrap();
        assert_eq!(got, GyroReading { temperature: -13_200, rate: [258, -2, -32_768] });
        assert!(got.saturated());
        assert_eq!(got.celsius(), 35.0);
        bus.done();
    }

    /// Beharie 2013 Eq. 4.2 reads the raw word 42214 as unsigned; it is -23322 counts, -1622 deg/s.
    #[test]
    fn the_word_of_the_thesis_is_negative() {
        let mut bus = Mock::new(&[Transaction::write_read(0x68, vec![0x1B], vec![0, 0, 0xA4, 0xE6, 0, 0, 0, 0])]);
        let got = Itg3200::new(&mut bus, Config::DEFAULT).read().unwrap();
        assert_eq!(got.rate[0], -23_322);
        assert!(!got.saturated());
        bus.done();
    }

    #[test]
    fn a_silent_or_stuck_bus_is_an_error_at_every_step() {
        let burst = Transaction::write_read(0x68, vec![0x1B], vec![0; 8]);
        fails_at_every_step(
            &configuration(0x68),
            &burst,
            |bus| Itg3200::new(bus, Config::DEFAULT).configure(),
            |bus| Itg3200::new(bus, Config::DEFAULT).read(),
        );
    }

    #[test]
    fn every_address_bandwidth_and_divider_reaches_its_register() {
        use Bandwidth::{Hz5, Hz10, Hz20, Hz42, Hz98, Hz188, Hz256};
        for (address, wire) in [(Address::Low, 0x68), (Address::High, 0x69)] {
            for (code, bandwidth) in [Hz256, Hz188, Hz98, Hz42, Hz20, Hz10, Hz5].into_iter().enumerate() {
                let config = Config { address, bandwidth, divider: 9 };
                let mut bus = Mock::new(&[
                    Transaction::write_read(wire, vec![0x00], vec![0x68]),
                    Transaction::write(wire, vec![0x3E, 0x01]),
                    Transaction::write(wire, vec![0x15, 9]),
                    Transaction::write(wire, vec![0x16, 0x18 + code as u8]),
                    Transaction::write_read(wire, vec![0x1B], vec![0; 8]),
                ]);
                let mut gyro = Itg3200::new(&mut bus, config);
                assert_eq!(gyro.configure(), Ok(()));
                assert_eq!(gyro.read(), Ok(GyroReading::default()));
                bus.done();
                assert_eq!(config.rate_hz(), if code == 0 { 800.0 } else { 100.0 });
            }
        }
        assert_eq!(Config::default(), Config::DEFAULT);
    }

    #[test]
    fn words_have_their_units() {
        let reading = GyroReading { temperature: -13_200 + 280, rate: [115, -23_000, 0] };
        assert_eq!((reading.deg_s(), reading.celsius()), ([8.0, -1600.0, 0.0], 36.0));
    }
}
