//! LIS3DH three-axis accelerometer, on SPI or I2C.
//!
//! What it is: identity check, configuration (high resolution, block update; range and rate by [`Config`]) and one burst read of three axes.
//!
//! What can go wrong: without the multi-byte bit (0x80 in an I2C register address, 0x40 in an SPI one) a burst reads one
//! register again and again; without block update the bytes of two samples can mix; the scale is nominal: the data sheet's
//! 12 mg and ST's application note differ by 2.4 %, so it wants calibrating.
//!
//! Units: 1, 2, 4 and 12 mg per digit at +-2, 4, 8 and 16 g in high resolution (twelve bits, left justified).
//!
//! Reference: LIS3DH data sheet rev 2, table 4 and section 8; the Linux driver st_accel_core agrees.

use crate::error::SensorError;
use embedded_hal::i2c::I2c;
use embedded_hal::spi::{Operation, SpiDevice};

/// Data sheet, section 8, "WHO_AM_I (0Fh)".
const WHO_AM_I: u8 = 0x0F;
/// Data sheet, section 8, "CTRL_REG1 (20h)".
const CTRL_REG1: u8 = 0x20;
/// Data sheet, section 8, "CTRL_REG4 (23h)".
const CTRL_REG4: u8 = 0x23;
/// Data sheet, section 8, "OUT_X_L (28h)": x, y, z, low byte first.
const OUT_X_L: u8 = 0x28;

/// Data sheet, section 8, "WHO_AM_I (0Fh)".
const IDENTITY: u8 = 0x33;
/// All axes, no low power (data sheet, "CTRL_REG1 (20h)").
const ALL_AXES: u8 = 7;
/// Block data update, high resolution (data sheet, "CTRL_REG4 (23h)", bits BDU and HR).
const BLOCK_HIGH: u8 = 1 << 7 | 1 << 3;
/// The register address counts on within an I2C transfer (data sheet, section 6.1.1, "I2C operation").
const I2C_MULTIPLE: u8 = 0x80;
/// Read, and the register address counts on within an SPI transfer (data sheet, section 6.2, bits RW and MS).
const SPI_READ: u8 = 0x80;
const SPI_MULTIPLE: u8 = 0x40;
/// Ends of the twelve-bit range.
const RAIL: i16 = 2047;

/// Seven-bit I2C address, by the level of the pin SA0 (data sheet, section 6.1.1, "I2C operation").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Address {
    /// SA0 low.
    #[default]
    Low = 0x18,
    /// SA0 high.
    High = 0x19,
}

/// Range (data sheet, "CTRL_REG4 (23h)", bits FS).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Range {
    /// +-2 g.
    G2 = 0,
    /// +-4 g.
    G4 = 1,
    /// +-8 g.
    G8 = 2,
    /// +-16 g.
    #[default]
    G16 = 3,
}

impl Range {
    /// Digits per standard gravity in high resolution (data sheet, table 4, "Sensitivity").
    #[must_use]
    pub const fn lsb_per_g(self) -> f32 {
        match self {
            Self::G2 => 1000.0,
            Self::G4 => 500.0,
            Self::G8 => 250.0,
            Self::G16 => 1000.0 / 12.0,
        }
    }

    /// Three words in standard gravities.
    #[must_use]
    pub fn g(self, words: &[i16; 3]) -> [f32; 3] {
        words.map(|word| f32::from(word) / self.lsb_per_g())
    }
}

/// Output rate (data sheet, "CTRL_REG1 (20h)", bits ODR).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Rate {
    /// 1 Hz.
    Hz1 = 1,
    /// 10 Hz.
    Hz10 = 2,
    /// 25 Hz.
    Hz25 = 3,
    /// 50 Hz.
    Hz50 = 4,
    /// 100 Hz.
    Hz100 = 5,
    /// 200 Hz.
    Hz200 = 6,
    /// 400 Hz.
    #[default]
    Hz400 = 7,
    /// 1344 Hz.
    Hz1344 = 9,
}

/// What the chip is set to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// Its range.
    pub range: Range,
    /// Its output rate.
    pub rate: Rate,
}

impl Config {
    /// +-16 g, 400 Hz: what the default is.
    pub const DEFAULT: Self = Self { range: Range::G16, rate: Rate::Hz400 };
}

/// Whether an axis sits at the end of its range.
#[must_use]
pub fn saturated(words: &[i16; 3]) -> bool {
    words.iter().any(|w| *w >= RAIL || *w < -RAIL)
}

mod sealed {
    /// One register is written, or neighbours are read in one transfer.
    pub trait Registers {
        /// The bus's own error.
        type Error;
        /// Reads `into.len()` registers from `register` on.
        fn read(&mut self, register: u8, into: &mut [u8]) -> Result<(), Self::Error>;
        /// Writes one register.
        fn write(&mut self, register: u8, value: u8) -> Result<(), Self::Error>;
    }
}

/// A chip on I2C.
#[derive(Debug)]
pub struct OnI2c<I2C> {
    bus: I2C,
    address: Address,
}

impl<I2C: I2c> sealed::Registers for OnI2c<I2C> {
    type Error = I2C::Error;

    fn read(&mut self, register: u8, into: &mut [u8]) -> Result<(), I2C::Error> {
        let multiple = if into.len() > 1 { I2C_MULTIPLE } else { 0 };
        self.bus.write_read(self.address as u8, &[register | multiple], into)
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), I2C::Error> {
        self.bus.write(self.address as u8, &[register, value])
    }
}

/// A chip on SPI (mode 0 or 3).
#[derive(Debug)]
pub struct OnSpi<SPI> {
    device: SPI,
}

impl<SPI: SpiDevice> sealed::Registers for OnSpi<SPI> {
    type Error = SPI::Error;

    fn read(&mut self, register: u8, into: &mut [u8]) -> Result<(), SPI::Error> {
        let multiple = if into.len() > 1 { SPI_MULTIPLE } else { 0 };
        self.device.transaction(&mut [Operation::Write(&[register | SPI_READ | multiple]), Operation::Read(into)])
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), SPI::Error> {
        self.device.write(&[register, value])
    }
}

/// The accelerometer, on SPI ([`Lis3dh::on_spi`]) or I2C ([`Lis3dh::on_i2c`]).
#[derive(Debug)]
pub struct Lis3dh<Bus> {
    bus: Bus,
    config: Config,
}

impl<SPI: SpiDevice> Lis3dh<OnSpi<SPI>> {
    /// Takes the device on its SPI bus (mode 0 or 3); touches nothing.
    pub const fn on_spi(device: SPI, config: Config) -> Self {
        Self { bus: OnSpi { device }, config }
    }

    /// Gives the device back.
    pub fn release(self) -> SPI {
        self.bus.device
    }
}

impl<I2C: I2c> Lis3dh<OnI2c<I2C>> {
    /// Takes the I2C bus; touches nothing.
    pub const fn on_i2c(bus: I2C, address: Address, config: Config) -> Self {
        Self { bus: OnI2c { bus, address }, config }
    }

    /// Gives the bus back.
    pub fn release(self) -> I2C {
        self.bus.bus
    }
}

impl<Bus: sealed::Registers> Lis3dh<Bus> {
    /// Checks the identity and configures the chip; the rate, which wakes it, is set last.
    ///
    /// # Errors
    /// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when the bus failed.
    pub fn configure(&mut self) -> Result<(), SensorError<Bus::Error>> {
        let mut id = [0u8; 1];
        self.bus.read(WHO_AM_I, &mut id)?;
        let [found] = id;
        if found != IDENTITY {
            return Err(SensorError::WrongIdentity { expected: IDENTITY, found });
        }
        self.bus.write(CTRL_REG4, BLOCK_HIGH | (self.config.range as u8) << 4)?;
        self.bus.write(CTRL_REG1, (self.config.rate as u8) << 4 | ALL_AXES)?;
        Ok(())
    }

    /// Reads the three axes of one sample, in the chip's own axes.
    ///
    /// # Errors
    /// [`SensorError::Bus`] when the transfer failed.
    pub fn read(&mut self) -> Result<[i16; 3], SensorError<Bus::Error>> {
        let mut b = [0u8; 6];
        self.bus.read(OUT_X_L, &mut b)?;
        let [xl, xh, yl, yh, zl, zh] = b;
        // twelve bits, left justified
        Ok([[xl, xh], [yl, yh], [zl, zh]].map(|w| i16::from_le_bytes(w) >> 4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failing_bus::fails_at_every_step;
    use embedded_hal::spi::ErrorKind;
    use embedded_hal_mock::eh1::i2c::{Mock, Transaction};
    use embedded_hal_mock::eh1::spi::{Mock as SpiMock, Transaction as Spi};
    extern crate std;
    use std::vec;

    fn on_i2c(bus: &mut Mock) -> Lis3dh<OnI2c<&mut Mock>> {
        Lis3dh::on_i2c(bus, Address::Low, Config::DEFAULT)
    }

    fn configuration(id: u8) -> std::vec::Vec<Transaction> {
        vec![
            Transaction::write_read(0x18, vec![0x0F], vec![id]),
            Transaction::write(0x18, vec![0x23, 0xB8]),
            Transaction::write(0x18, vec![0x20, 0x77]),
        ]
    }

    #[test]
    fn configures_on_i2c_and_measures_last() {
        let mut bus = Mock::new(&configuration(0x33));
        assert_eq!(on_i2c(&mut bus).configure(), Ok(()));
        bus.done();
    }

    #[test]
    fn another_chip_is_named_and_left_alone() {
        let mut bus = Mock::new(&[Transaction::write_read(0x18, vec![0x0F], vec![0xE5])]);
        assert_eq!(on_i2c(&mut bus).configure(), Err(SensorError::WrongIdentity { expected: 0x33, found: 0xE5 }));
        bus.done();
    }

    #[test]
    fn words_are_little_endian_left_justified_and_read_in_one_burst() {
        let bytes = vec![0x30, 0x12, 0xF0, 0xFF, 0x00, 0x80];
        let mut bus = Mock::new(&[Transaction::write_read(0x18, vec![0xA8], bytes)]);
        assert_eq!(on_i2c(&mut bus).read(), Ok([0x123, -1, -2048]));
        bus.done();
        assert!(saturated(&[0, 0, -2048]) && saturated(&[2047, 0, 0]) && !saturated(&[2046, -2047, 0]));
    }

    #[test]
    fn spi_reads_carry_the_read_and_multiple_bits() {
        let mut spi = SpiMock::new(&[
            Spi::transaction_start(),
            Spi::write_vec(vec![0x8F]),
            Spi::read_vec(vec![0x33]),
            Spi::transaction_end(),
            Spi::transaction_start(),
            Spi::write_vec(vec![0x23, 0xB8]),
            Spi::transaction_end(),
            Spi::transaction_start(),
            Spi::write_vec(vec![0x20, 0x77]),
            Spi::transaction_end(),
            Spi::transaction_start(),
            Spi::write_vec(vec![0xE8]),
            Spi::read_vec(vec![0x00, 0x10, 0x00, 0xF0, 0xF0, 0x7F]),
            Spi::transaction_end(),
        ]);
        assert_eq!(Lis3dh::on_spi(&mut spi, Config::DEFAULT).configure(), Ok(()));
        assert_eq!(Lis3dh::on_spi(&mut spi, Config::DEFAULT).read(), Ok([256, -256, 2047]));
        spi.done();
    }

    /// A device whose n-th transaction fails; the others read the identity.
    struct Failing {
        after: usize,
        asked: usize,
    }

    impl embedded_hal::spi::ErrorType for Failing {
        type Error = ErrorKind;
    }

    impl SpiDevice for Failing {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
            self.asked += 1;
            if self.asked > self.after {
                return Err(ErrorKind::ModeFault);
            }
            for operation in operations {
                if let Operation::Read(into) = operation {
                    into.fill(IDENTITY);
                }
            }
            Ok(())
        }
    }

    #[test]
    fn on_spi_another_chip_is_named_and_a_failing_bus_is_an_error_at_every_step() {
        // nothing answers: the line rests high
        let mut spi = SpiMock::new(&[
            Spi::transaction_start(),
            Spi::write_vec(vec![0x8F]),
            Spi::read_vec(vec![0xFF]),
            Spi::transaction_end(),
        ]);
        assert_eq!(
            Lis3dh::on_spi(&mut spi, Config::DEFAULT).configure(),
            Err(SensorError::WrongIdentity { expected: 0x33, found: 0xFF })
        );
        spi.done();
        for after in 0..3 {
            let mut spi = Failing { after, asked: 0 };
            assert_eq!(Lis3dh::on_spi(&mut spi, Config::DEFAULT).configure(), Err(SensorError::Bus(ErrorKind::ModeFault)));
            assert_eq!(spi.asked, after + 1, "the bus is touched no further");
        }
        assert_eq!(Lis3dh::on_spi(Failing { after: 3, asked: 0 }, Config::DEFAULT).configure(), Ok(()));
        assert_eq!(
            Lis3dh::on_spi(Failing { after: 0, asked: 0 }, Config::DEFAULT).read(),
            Err(SensorError::Bus(ErrorKind::ModeFault))
        );
    }

    #[test]
    fn a_silent_or_stuck_bus_is_an_error_at_every_step() {
        let burst = Transaction::write_read(0x18, vec![0xA8], vec![0; 6]);
        fails_at_every_step(&configuration(0x33), &burst, |bus| on_i2c(bus).configure(), |bus| on_i2c(bus).read());
    }

    #[test]
    fn every_address_range_and_rate_reaches_its_register() {
        use Rate::{Hz1, Hz10, Hz25, Hz50, Hz100, Hz200, Hz400, Hz1344};
        let ranges = [(Range::G2, 0x88), (Range::G4, 0x98), (Range::G8, 0xA8), (Range::G16, 0xB8)];
        let rates = [Hz1, Hz10, Hz25, Hz50, Hz100, Hz200, Hz400, Hz1344].into_iter().zip([1, 2, 3, 4, 5, 6, 7, 9]);
        for (address, wire) in [(Address::Low, 0x18), (Address::High, 0x19)] {
            for (range, code) in ranges {
                for (rate, odr) in rates.clone() {
                    let mut bus = Mock::new(&[
                        Transaction::write_read(wire, vec![0x0F], vec![0x33]),
                        Transaction::write(wire, vec![0x23, code]),
                        Transaction::write(wire, vec![0x20, odr << 4 | 7]),
                        Transaction::write_read(wire, vec![0xA8], vec![0; 6]),
                    ]);
                    let mut chip = Lis3dh::on_i2c(bus, address, Config { range, rate });
                    assert_eq!(chip.configure(), Ok(()));
                    assert_eq!(chip.read(), Ok([0; 3]));
                    bus = chip.release();
                    bus.done();
                }
            }
        }
        assert_eq!(Config::default(), Config::DEFAULT);
    }

    #[test]
    fn words_have_their_units() {
        assert_eq!(Range::G2.g(&[1000, -500, 0]), [1.0, -0.5, 0.0]);
        for range in [Range::G4, Range::G8, Range::G16] {
            assert!(2047.0 / range.lsb_per_g() > 4.0);
        }
        assert!((Range::G16.g(&[250, 0, 0])[0] - 3.0).abs() < 1e-6, "12 mg a digit");
        assert_eq!([Range::G4.g(&[500; 3])[0], Range::G8.g(&[250; 3])[0]], [1.0; 2]);
    }
}
