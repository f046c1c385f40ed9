//! LIS3DH three-axis accelerometer, the test accelerometer, on I2C or SPI.
//!
//! What it is: identity check, configuration (high resolution, +-16 g, 400 Hz, block update) and one burst read of three axes.
//!
//! What can go wrong: without the multi-byte bit (0x80 in an I2C register address, 0x40 in an SPI one) a burst reads one
//! register again and again; without block update the bytes of two samples can mix; the scale is nominal: the data sheet's
//! 12 mg and ST's application note differ by 2.4 %, so it wants calibrating.
//!
//! Units: 12 mg per digit at +-16 g in high resolution (twelve bits, left justified).
//!
//! Reference: LIS3DH data sheet rev 2, table 4 and section 8; the Linux driver st_accel_core agrees.

use crate::error::SensorError;
use embedded_hal::i2c::I2c;
use embedded_hal::spi::{Operation, SpiDevice};

/// Bus address with SA0 low.
pub const ADDRESS: u8 = 0x18;
/// Digits per standard gravity at +-16 g in high resolution.
pub const LSB_PER_G: f32 = 1000.0 / 12.0;

const WHO_AM_I: u8 = 0x0F;
const CTRL_REG1: u8 = 0x20;
const CTRL_REG4: u8 = 0x23;
const OUT_X_L: u8 = 0x28;

const IDENTITY: u8 = 0x33;
/// ODR code 7 (400 Hz), no low power, all axes.
const RATE_400_HZ: u8 = 7 << 4 | 7;
/// Block data update, +-16 g, high resolution.
const BLOCK_16_G_HIGH: u8 = 1 << 7 | 3 << 4 | 1 << 3;
const I2C_MULTIPLE: u8 = 0x80;
const SPI_READ: u8 = 0x80;
const SPI_MULTIPLE: u8 = 0x40;
/// Ends of the twelve-bit range.
const RAIL: i16 = 2047;

fn identified<E>(found: u8) -> Result<(), SensorError<E>> {
    if found == IDENTITY { Ok(()) } else { Err(SensorError::WrongIdentity { address: ADDRESS, found }) }
}

/// Twelve bits, left justified, little endian.
fn words(b: [u8; 6]) -> [i16; 3] {
    let [xl, xh, yl, yh, zl, zh] = b;
    [[xl, xh], [yl, yh], [zl, zh]].map(|w| i16::from_le_bytes(w) >> 4)
}

/// Checks the identity and configures the chip on I2C.
///
/// # Errors
/// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when none does.
pub fn configure<B: I2c>(bus: &mut B) -> Result<(), SensorError<B::Error>> {
    let mut id = [0u8; 1];
    bus.write_read(ADDRESS, &[WHO_AM_I], &mut id)?;
    let [found] = id;
    identified(found)?;
    bus.write(ADDRESS, &[CTRL_REG4, BLOCK_16_G_HIGH])?;
    bus.write(ADDRESS, &[CTRL_REG1, RATE_400_HZ])?;
    Ok(())
}

/// Reads the three axes of one sample on I2C, in the chip's own axes.
///
/// # Errors
/// [`SensorError::Bus`] when the transfer failed.
pub fn read<B: I2c>(bus: &mut B) -> Result<[i16; 3], SensorError<B::Error>> {
    let mut b = [0u8; 6];
    bus.write_read(ADDRESS, &[OUT_X_L | I2C_MULTIPLE], &mut b)?;
    Ok(words(b))
}

/// Checks the identity and configures the chip on SPI (mode 0 or 3).
///
/// # Errors
/// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when the bus failed.
pub fn configure_spi<S: SpiDevice>(spi: &mut S) -> Result<(), SensorError<S::Error>> {
    let mut id = [0u8; 1];
    spi.transaction(&mut [Operation::Write(&[WHO_AM_I | SPI_READ]), Operation::Read(&mut id)])?;
    let [found] = id;
    identified(found)?;
    spi.write(&[CTRL_REG4, BLOCK_16_G_HIGH])?;
    spi.write(&[CTRL_REG1, RATE_400_HZ])?;
    Ok(())
}

/// Reads the three axes of one sample on SPI, in the chip's own axes.
///
/// # Errors
/// [`SensorError::Bus`] when the transfer failed.
pub fn read_spi<S: SpiDevice>(spi: &mut S) -> Result<[i16; 3], SensorError<S::Error>> {
    let mut b = [0u8; 6];
    spi.transaction(&mut [Operation::Write(&[OUT_X_L | SPI_READ | SPI_MULTIPLE]), Operation::Read(&mut b)])?;
    Ok(words(b))
}

/// Whether an axis sits at the end of the +-16 g range.
#[must_use]
pub fn saturated(words: &[i16; 3]) -> bool {
    words.iter().any(|w| *w >= RAIL || *w < -RAIL)
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
        assert_eq!(configure(&mut bus), Ok(()));
        bus.done();
    }

    #[test]
    fn another_chip_is_named_and_left_alone() {
        let mut bus = Mock::new(&[Transaction::write_read(0x18, vec![0x0F], vec![0xE5])]);
        assert_eq!(configure(&mut bus), Err(SensorError::WrongIdentity { address: 0x18, found: 0xE5 }));
        bus.done();
    }

    #[test]
    fn words_are_little_endian_left_justified_and_read_in_one_burst() {
        let bytes = vec![0x30, 0x12, 0xF0, 0xFF, 0x00, 0x80];
        let mut bus = Mock::new(&[Transaction::write_read(0x18, vec![0xA8], bytes)]);
        assert_eq!(read(&mut bus), Ok([0x123, -1, -2048]));
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
        assert_eq!(configure_spi(&mut spi), Ok(()));
        assert_eq!(read_spi(&mut spi), Ok([256, -256, 2047]));
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
        assert_eq!(configure_spi(&mut spi), Err(SensorError::WrongIdentity { address: 0x18, found: 0xFF }));
        spi.done();
        for after in 0..3 {
            let mut spi = Failing { after, asked: 0 };
            assert_eq!(configure_spi(&mut spi), Err(SensorError::Bus(ErrorKind::ModeFault)));
            assert_eq!(spi.asked, after + 1, "the bus is touched no further");
        }
        assert_eq!(configure_spi(&mut Failing { after: 3, asked: 0 }), Ok(()));
        assert_eq!(read_spi(&mut Failing { after: 0, asked: 0 }), Err(SensorError::Bus(ErrorKind::ModeFault)));
    }

    #[test]
    fn a_silent_or_stuck_bus_is_an_error_at_every_step() {
        let burst = Transaction::write_read(0x18, vec![0xA8], vec![0; 6]);
        fails_at_every_step(&configuration(0x33), &burst, configure, read);
    }
}
