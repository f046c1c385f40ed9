//! An SPI port with the test accelerometer on it.
//!
//! What it is: `embedded_hal::spi::SpiDevice` at 10 MHz, mode 3: chip select falls, bytes go both ways, chip select rises. The chip is the
//! [`Lis3dh`] of [`crate::imu`].
//! What can go wrong: nothing fails on the wires; a chip that is not there leaves them pulled up and every byte reads 0xFF.
//! Units: ns since power-up.
//! Reference: LIS3DH data sheet rev 2, section 6.2 (SPI: read and multiple bits) and table 6 (10 MHz at the most); embedded-hal 1.0, `spi`.

use crate::clock::VirtualClock;
use crate::imu::Lis3dh;
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// One byte at 10 MHz, ns.
const BYTE_NS: u64 = 800;
/// Chip select before the first and after the last clock, ns (table 6: at least 5 and 20).
const SELECT_NS: u64 = 20;

/// The port.
#[derive(Debug, Clone)]
pub struct SpiPort {
    clock: VirtualClock,
    chip: Option<Lis3dh>,
}

impl SpiPort {
    /// A port on `clock` with its chip, or with nothing.
    #[must_use]
    pub fn new(clock: VirtualClock, chip: Option<Lis3dh>) -> Self {
        Self { clock, chip }
    }

    /// The chip.
    #[must_use]
    pub fn chip(&self) -> Option<&Lis3dh> {
        self.chip.as_ref()
    }

    /// One byte out and one in.
    fn exchange(&mut self, out: u8) -> u8 {
        let at_ns = self.clock.now_ns();
        self.clock.pass_ns(BYTE_NS);
        self.chip.as_mut().map_or(0xFF, |chip| chip.exchange(out, at_ns))
    }
}

impl ErrorType for SpiPort {
    type Error = Infallible;
}

impl SpiDevice for SpiPort {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        self.clock.pass_ns(SELECT_NS);
        if let Some(chip) = &mut self.chip {
            chip.select();
        }
        for operation in operations {
            match operation {
                Operation::Read(bytes) => bytes.iter_mut().for_each(|b| *b = self.exchange(0)),
                Operation::Write(bytes) => bytes.iter().for_each(|b| {
                    self.exchange(*b);
                }),
                Operation::Transfer(read, write) => {
                    for i in 0..read.len().max(write.len()) {
                        let got = self.exchange(write.get(i).copied().unwrap_or(0));
                        if let Some(slot) = read.get_mut(i) {
                            *slot = got;
                        }
                    }
                }
                Operation::TransferInPlace(bytes) => bytes.iter_mut().for_each(|b| *b = self.exchange(*b)),
                Operation::DelayNs(ns) => self.clock.delay_ns(*ns),
            }
        }
        self.clock.pass_ns(SELECT_NS);
        Ok(())
    }
}
