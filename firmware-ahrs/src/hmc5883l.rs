//! HMC5883L three-axis magnetometer.
//!
//! What it is: identity check, configuration (continuous, 75 Hz, 1090 LSB/G) and one burst read of three axes.
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

/// Bus address (0x3C and 0x3D on the wire).
pub const ADDRESS: u8 = 0x1E;
/// Counts per gauss at gain code 1 (data sheet, table 9).
pub const LSB_PER_GAUSS: f32 = 1090.0;
/// Output rate of the configuration, Hz.
pub const RATE_HZ: u32 = 75;

const CONFIG_A: u8 = 0x00;
const CONFIG_B: u8 = 0x01;
const MODE: u8 = 0x02;
const DATA_X_H: u8 = 0x03;
const ID_A: u8 = 0x0A;

const IDENTITY: [u8; 3] = *b"H43";
/// One measurement a sample, 75 Hz, no bias current.
const RATE_75_HZ: u8 = 6 << 2;
/// Gain code 1: 1090 LSB/G.
const GAIN_1090: u8 = 1 << 5;
const CONTINUOUS: u8 = 0;
/// What an axis reads when its converter overflowed.
const OVERFLOW: i16 = -4096;

/// Checks the three identity bytes and configures the chip.
///
/// # Errors
/// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when none does.
pub fn configure<B: I2c>(bus: &mut B) -> Result<(), SensorError<B::Error>> {
    let mut id = [0u8; 3];
    bus.write_read(ADDRESS, &[ID_A], &mut id)?;
    if let Some((found, _)) = id.iter().zip(&IDENTITY).find(|(got, want)| got != want) {
        return Err(SensorError::WrongIdentity { address: ADDRESS, found: *found });
    }
    bus.write(ADDRESS, &[CONFIG_A, RATE_75_HZ])?;
    bus.write(ADDRESS, &[CONFIG_B, GAIN_1090])?;
    bus.write(ADDRESS, &[MODE, CONTINUOUS])?;
    Ok(())
}

/// Reads the three axes of one sample and returns them as x, y, z of the chip.
///
/// Exactly the six data bytes: the register pointer goes back to the first of them by itself after the last.
///
/// # Errors
/// [`SensorError::Bus`] when the transfer failed.
pub fn read<B: I2c>(bus: &mut B) -> Result<[i16; 3], SensorError<B::Error>> {
    let mut b = [0u8; 6];
    bus.write_read(ADDRESS, &[DATA_X_H], &mut b)?;
    let [xh, xl, zh, zl, yh, yl] = b;
    let word = |h, l| i16::from_be_bytes([h, l]);
    Ok([word(xh, xl), word(yh, yl), word(zh, zl)])
}

/// Whether an axis overflowed.
#[must_use]
pub fn overflowed(words: &[i16; 3]) -> bool {
    words.contains(&OVERFLOW)
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
        assert_eq!(configure(&mut bus), Ok(()));
        bus.done();
    }

    #[test]
    fn every_identity_byte_counts() {
        for (id, found) in [([0x00, 0x34, 0x33], 0x00), ([0x48, 0x35, 0x33], 0x35), ([0x48, 0x34, 0xFF], 0xFF)] {
            let mut bus = Mock::new(&[Transaction::write_read(0x1E, vec![0x0A], id.to_vec())]);
            assert_eq!(configure(&mut bus), Err(SensorError::WrongIdentity { address: 0x1E, found }));
            bus.done();
        }
    }

    #[test]
    fn words_are_big_endian_in_the_order_x_z_y() {
        let mut bus = Mock::new(&[Transaction::write_read(0x1E, vec![0x03], vec![0x01, 0x02, 0xFF, 0xFE, 0x00, 0x07])]);
        assert_eq!(read(&mut bus), Ok([258, 7, -2]));
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
        fails_at_every_step(&configuration(), &burst, configure, read);
    }
}
