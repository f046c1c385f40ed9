//! ADXL345 three-axis accelerometer.
//!
//! What it is: identity check, configuration (full resolution, +-16 g, 400 Hz) and one burst read of three axes.
//!
//! What can go wrong: reading the axes one by one can mix two samples, hence the burst; the sensor is asynchronous to
//! the tick, hence twice its rate, so that every reading is a new one; the gain is nominal to a few per cent.
//!
//! Units: 256 LSB per g in full resolution, at every range.
//!
//! Reference: ADXL345 rev E; Linux adxl345_core agrees. The thesis calls it ADXL325 (section 4.2.2.2, see errata).

use crate::error::SensorError;
use embedded_hal::i2c::I2c;

/// Bus address with ALT ADDRESS low, as on the Razor board.
pub const ADDRESS: u8 = 0x53;
/// Counts per standard gravity in full resolution (data sheet, table 1).
pub const LSB_PER_G: f32 = 256.0;

const DEVID: u8 = 0x00;
const BW_RATE: u8 = 0x2C;
const POWER_CTL: u8 = 0x2D;
const DATA_FORMAT: u8 = 0x31;
const DATAX0: u8 = 0x32;

const IDENTITY: u8 = 0xE5;
/// 400 Hz output, 200 Hz bandwidth, normal power.
const RATE_400_HZ: u8 = 0x0C;
/// FULL_RES, right justified, +-16 g, no self-test.
const FULL_RESOLUTION_16_G: u8 = 1 << 3 | 3;
const MEASURE: u8 = 1 << 3;
/// End of the 13-bit range of +-16 g.
const RAIL: i16 = 4095;

/// Checks the identity and configures the chip; measurement is switched on last.
///
/// # Errors
/// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when none does.
pub fn configure<B: I2c>(bus: &mut B) -> Result<(), SensorError<B::Error>> {
    let mut id = [0u8; 1];
    bus.write_read(ADDRESS, &[DEVID], &mut id)?;
    let [found] = id;
    if found != IDENTITY {
        return Err(SensorError::WrongIdentity { address: ADDRESS, found });
    }
    bus.write(ADDRESS, &[BW_RATE, RATE_400_HZ])?;
    bus.write(ADDRESS, &[DATA_FORMAT, FULL_RESOLUTION_16_G])?;
    bus.write(ADDRESS, &[POWER_CTL, MEASURE])?;
    Ok(())
}

/// Reads the three axes of one sample, in the chip's own axes.
///
/// # Errors
/// [`SensorError::Bus`] when the transfer failed.
pub fn read<B: I2c>(bus: &mut B) -> Result<[i16; 3], SensorError<B::Error>> {
    let mut b = [0u8; 6];
    bus.write_read(ADDRESS, &[DATAX0], &mut b)?;
    let [xl, xh, yl, yh, zl, zh] = b;
    let word = |l, h| i16::from_le_bytes([l, h]);
    Ok([word(xl, xh), word(yl, yh), word(zl, zh)])
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
        assert_eq!(configure(&mut bus), Ok(()));
        bus.done();
    }

    #[test]
    fn another_chip_is_named_and_left_alone() {
        let mut bus = Mock::new(&[Transaction::write_read(0x53, vec![0x00], vec![0x33])]);
        assert_eq!(configure(&mut bus), Err(SensorError::WrongIdentity { address: 0x53, found: 0x33 }));
        bus.done();
    }

    #[test]
    fn words_are_little_endian_and_signed_in_the_order_x_y_z() {
        let mut bus = Mock::new(&[Transaction::write_read(0x53, vec![0x32], vec![0x02, 0x01, 0xFE, 0xFF, 0x00, 0xF0])]);
        let got = read(&mut bus).unwrap();
        assert_eq!(got, [258, -2, -4096]);
        bus.done();
    }

    #[test]
    fn the_rails_of_thirteen_bits_are_saturation() {
        assert!(saturated(&[0, 4095, 0]));
        assert!(saturated(&[-4096, 0, 0]));
        assert!(!saturated(&[-4095, 4094, 256]));
    }

    #[test]
    fn a_silent_or_stuck_bus_is_an_error_at_every_step() {
        let burst = Transaction::write_read(0x53, vec![0x32], vec![0; 6]);
        fails_at_every_step(&configuration(), &burst, configure, read);
    }
}
