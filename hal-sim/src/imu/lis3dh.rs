//! Register file of LIS3DH, the test accelerometer, on SPI.
//!
//! What it is: identity, defaults, address byte and data format of the real chip as its four wires see it; it measures the body's motion
//! through its errors.
//! What can go wrong: an unconfigured chip is powered down and reads zeros; a read without the multiple bit gives the same register again
//! and again; the high-resolution bit decides how many bits are left.
//! Units: digits, left justified in 16 bits; ns since power-up.
//! Reference: LIS3DH data sheet rev 2, table 4 (sensitivity), sections 6.2 (SPI) and 8 (registers); written down here again on purpose, not
//! taken from the driver of `firmware-ahrs`.

use super::errors::ChipErrors;
use super::motion::Motion;
use super::{Served, to_chip};
use crate::noise::{Source, Stream};

const WHO_AM_I: usize = 0x0F;
const CTRL_REG1: usize = 0x20;
const CTRL_REG4: usize = 0x23;
const OUT_X_L: usize = 0x28;
const READ: u8 = 0x80;
const MULTIPLE: u8 = 0x40;

/// The chip.
#[derive(Debug, Clone)]
pub struct Lis3dh {
    motion: Motion,
    errors: ChipErrors,
    noise: Stream,
    registers: [u8; 64],
    /// First byte after select: read, multiple, address.
    address: Option<u8>,
    /// Everything that it handed out.
    pub served: Vec<Served>,
}

impl Lis3dh {
    /// A chip after power-up on a body that moves as `motion`; its errors in g, its noise from `seed`.
    #[must_use]
    pub fn new(motion: Motion, errors: ChipErrors, seed: u64) -> Self {
        let mut registers = [0; 64];
        registers[WHO_AM_I] = 0x33;
        registers[CTRL_REG1] = 0x07;
        Self { motion, errors, noise: Stream::new(seed, Source::Imu, 3), registers, address: None, served: Vec::new() }
    }

    /// Chip select falls.
    pub fn select(&mut self) {
        self.address = None;
    }

    /// Eight clocks: a byte from the master and one for it.
    pub fn exchange(&mut self, byte: u8, at_ns: u64) -> u8 {
        let Some(address) = self.address else {
            self.address = Some(byte);
            if byte & READ != 0 && usize::from(byte & 0x3F) == OUT_X_L {
                self.latch(at_ns);
            }
            return 0xFF;
        };
        let register = usize::from(address & 0x3F);
        if address & MULTIPLE != 0 {
            self.address = Some(address & !0x3F | (address + 1) & 0x3F);
        }
        if address & READ != 0 {
            return self.registers[register];
        }
        if register > WHO_AM_I {
            self.registers[register] = byte;
        }
        0xFF
    }

    /// Puts a new reading into the data registers.
    fn latch(&mut self, at_ns: u64) {
        let (rate, range) = (self.registers[CTRL_REG1] >> 4, self.registers[CTRL_REG4] >> 4 & 3);
        let words = if rate == 0 {
            [0; 3] // powered down
        } else {
            let mg = [1.0, 2.0, 4.0, 12.0][usize::from(range)]; // table 4, high resolution
            let (bits, scale) = if self.registers[CTRL_REG4] & 8 != 0 { (12, 1.0) } else { (10, 4.0) };
            let top = f64::from(1 << (bits - 1));
            let seen = self.errors.seen(to_chip(self.motion.force(at_ns)), 25.0, &mut self.noise);
            seen.map(|g| (libm::round(g * 1000.0 / mg / scale).clamp(-top, top - 1.0) as i16) << (16 - bits))
        };
        let bytes = words.map(i16::to_le_bytes);
        self.registers[OUT_X_L..OUT_X_L + 6].copy_from_slice(bytes.as_flattened());
        self.served.push(Served { at_ns, words });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(chip: &mut Lis3dh, address: u8, count: usize) -> Vec<u8> {
        chip.select();
        chip.exchange(address, 0);
        (0..count).map(|_| chip.exchange(0, 0)).collect()
    }

    fn write(chip: &mut Lis3dh, register: u8, value: u8) {
        chip.select();
        chip.exchange(register, 0);
        chip.exchange(value, 0);
    }

    #[test]
    fn identity_power_down_resolution_and_the_multiple_bit() {
        let mut chip = Lis3dh::new(Motion::LEVEL, ChipErrors::default(), 1);
        assert_eq!(read(&mut chip, 0x8F, 1), [0x33]);
        assert_eq!(read(&mut chip, 0xE8, 6), [0; 6], "powered down");
        write(&mut chip, 0x20, 0x77);
        write(&mut chip, 0x23, 0xB8);
        assert_eq!(read(&mut chip, 0xE8, 6), [0, 0, 0, 0, 0x30, 0x05], "1 g along chip z: 83 digits of 12 mg");
        assert_eq!(read(&mut chip, 0xA8 + 4, 3), [0x30; 3], "without the multiple bit");
        write(&mut chip, 0x23, 0x80);
        assert_eq!(read(&mut chip, 0xEC, 2), [0x30, 0x05], "the reading of before: only a burst from x on takes a new one");
        assert_eq!(read(&mut chip, 0xE8, 6)[4..], [0x80, 0x3E], "+-2 g in ten bits: 250 digits of 4 mg");
        write(&mut chip, 0x0F, 1);
        assert_eq!(read(&mut chip, 0x8F, 1), [0x33], "read only");
    }
}
