//! ITG-3200 three-axis gyro.
//!
//! What it is: identity check, configuration (full range, 98 Hz low-pass, 1 kHz internal rate, PLL on the X gyro)
//! and one burst read of temperature and three rates.
//!
//! What can go wrong: the full-scale bits are zero after reset and must be 3, otherwise the rates are not specified;
//! bit 0 of the identity register may read either way; beyond 2000 deg/s the word rests at its limit.
//!
//! Units: 14.375 LSB per deg/s; temperature 280 LSB per kelvin with -13200 at 35 degC.
//!
//! Reference: PS-ITG-3200A rev 1.4; the Linux driver itg3200_core agrees. Beharie 2013 Eq. 4.1-4.2 with errata.

use crate::error::SensorError;
use embedded_hal::i2c::I2c;

/// Bus address with AD0 low, as on the Razor board.
pub const ADDRESS: u8 = 0x68;
/// Counts per degree per second (data sheet, table 3.1).
pub const LSB_PER_DEG_S: f32 = 14.375;

const WHO_AM_I: u8 = 0x00;
const SMPLRT_DIV: u8 = 0x15;
const DLPF_FS: u8 = 0x16;
const TEMP_OUT_H: u8 = 0x1B;
const PWR_MGM: u8 = 0x3E;

const IDENTITY: u8 = 0x34;
/// FS_SEL = 3 (+-2000 deg/s), DLPF_CFG = 2 (98 Hz, internal rate 1 kHz).
const FULL_SCALE_98_HZ: u8 = 3 << 3 | 2;
/// Awake, all axes on, clock from the PLL on the X gyro.
const CLOCK_PLL_X: u8 = 1;

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

    /// Chip temperature, degree Celsius.
    #[must_use]
    pub fn celsius(&self) -> f32 {
        35.0 + (f32::from(self.temperature) + 13_200.0) / 280.0
    }
}

/// Checks the identity and configures the chip.
///
/// # Errors
/// [`SensorError::WrongIdentity`] when another chip answers, [`SensorError::Bus`] when none does.
pub fn configure<B: I2c>(bus: &mut B) -> Result<(), SensorError<B::Error>> {
    let mut id = [0u8; 1];
    bus.write_read(ADDRESS, &[WHO_AM_I], &mut id)?;
    let [found] = id;
    if (found >> 1) & 0x3F != IDENTITY {
        return Err(SensorError::WrongIdentity { address: ADDRESS, found });
    }
    bus.write(ADDRESS, &[PWR_MGM, CLOCK_PLL_X])?;
    bus.write(ADDRESS, &[SMPLRT_DIV, 0])?;
    bus.write(ADDRESS, &[DLPF_FS, FULL_SCALE_98_HZ])?;
    Ok(())
}

/// Reads temperature and rates in one burst, so that the four words belong together.
///
/// # Errors
/// [`SensorError::Bus`] when the transfer failed.
pub fn read<B: I2c>(bus: &mut B) -> Result<GyroReading, SensorError<B::Error>> {
    let mut b = [0u8; 8];
    bus.write_read(ADDRESS, &[TEMP_OUT_H], &mut b)?;
    let [th, tl, xh, xl, yh, yl, zh, zl] = b;
    let word = |h, l| i16::from_be_bytes([h, l]);
    Ok(GyroReading { temperature: word(th, tl), rate: [word(xh, xl), word(yh, yl), word(zh, zl)] })
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
            assert_eq!(configure(&mut bus), Ok(()));
            bus.done();
        }
    }

    #[test]
    fn another_chip_is_named_and_left_alone() {
        let mut bus = Mock::new(&[Transaction::write_read(0x68, vec![0x00], vec![0x71])]);
        assert_eq!(configure(&mut bus), Err(SensorError::WrongIdentity { address: 0x68, found: 0x71 }));
        bus.done();
    }

    #[test]
    fn words_are_big_endian_and_signed_in_the_order_t_x_y_z() {
        let bytes = vec![0xCC, 0x70, 0x01, 0x02, 0xFF, 0xFE, 0x80, 0x00];
        let mut bus = Mock::new(&[Transaction::write_read(0x68, vec![0x1B], bytes)]);
        let got = read(&mut bus).unwrap();
        assert_eq!(got, GyroReading { temperature: -13_200, rate: [258, -2, -32_768] });
        assert!(got.saturated());
        assert_eq!(got.celsius(), 35.0);
        bus.done();
    }

    /// Beharie 2013 Eq. 4.2 reads the raw word 42214 as unsigned; it is -23322 counts, -1622 deg/s.
    #[test]
    fn the_word_of_the_thesis_is_negative() {
        let mut bus = Mock::new(&[Transaction::write_read(0x68, vec![0x1B], vec![0, 0, 0xA4, 0xE6, 0, 0, 0, 0])]);
        let got = read(&mut bus).unwrap();
        assert_eq!(got.rate[0], -23_322);
        assert!(!got.saturated());
        bus.done();
    }

    #[test]
    fn a_silent_or_stuck_bus_is_an_error_at_every_step() {
        let burst = Transaction::write_read(0x68, vec![0x1B], vec![0; 8]);
        fails_at_every_step(&configuration(0x68), &burst, configure, read);
    }
}
