//! The microcontroller with faults that the emulator's own models do not have.
//!
//! What it is: the part as published, with a wrapper round I2C1 that can hold the bus: SDA is kept low by a chip, BUSY stays
//! set and no start condition is taken.
//! What can go wrong: a reset rebuilds the part; the wrapper carries the chips over.
//! Units: none.
//! Reference: RM0090 sections 27.3.3 and 27.6.7 (BUSY); crate rigless 0.4, "what the model leaves out".

use rigless::{
    device::{Device, DeviceContext, ErasedDevice, RegisterFile, RequestChange, ResetCause},
    mcu::Mcu,
    soc::{
        Bus,
        stm32f427::{Stm32f427, generated::i2c3::Register, peripherals::i2c::I2c},
    },
    time::{EventId, VirtualNanos},
};

/// Clock of the peripheral until the clock tree says otherwise: the internal oscillator.
const RESET_CLOCK_HZ: u64 = 16_000_000;
/// START in CR1 and BUSY in SR2.
const START: u64 = 1 << 8;
const BUSY: u64 = 1 << 1;

/// I2C1 that can be held.
#[derive(Debug)]
pub(super) struct HeldI2c {
    pub(super) inner: I2c,
    pub(super) held: bool,
}

impl Device for HeldI2c {
    type Register = Register;

    fn read(&mut self, register: Register, file: &mut RegisterFile, context: &mut DeviceContext<'_>) -> Option<u64> {
        let value = Device::read(&mut self.inner, register, file, context);
        if self.held && register == Register::Sr2 {
            return Some(value.unwrap_or_else(|| file.get(register)) | BUSY);
        }
        value
    }

    fn peek(&self, register: Register, file: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        Device::peek(&self.inner, register, file, now)
    }

    fn write(&mut self, register: Register, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if self.held && register == Register::Cr1 && value & START != 0 {
            return; // the request stays pending: the bus never looks free
        }
        Device::write(&mut self.inner, register, value, file, context);
    }

    fn on_event(&mut self, event: EventId, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_event(&mut self.inner, event, file, context);
    }

    fn on_request(&mut self, request: RequestChange, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_request(&mut self.inner, request, file, context);
    }

    fn on_clock(&mut self, hz: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_clock(&mut self.inner, hz, file, context);
    }

    fn reset(&mut self) {
        Device::reset(&mut self.inner);
    }

    fn reset_line(&mut self, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::reset_line(&mut self.inner, file, context);
    }
}

/// The part and its wrapped models.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) chip: Stm32f427,
    pub(super) i2c1: HeldI2c,
    i2c1_slot: usize,
}

impl Part {
    pub(super) fn new(mut chip: Stm32f427) -> Result<Self, rigless::soc::Error> {
        let i2c1_slot = chip.bus().slot("I2C1")?;
        let inner = std::mem::replace(&mut chip.i2c[0], I2c::with_clock(RESET_CLOCK_HZ));
        Ok(Self { chip, i2c1: HeldI2c { inner, held: false }, i2c1_slot })
    }
}

impl Mcu for Part {
    fn bus(&self) -> &Bus {
        self.chip.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.chip.bus_mut()
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        if slot == self.i2c1_slot {
            return (self.chip.bus_mut(), Some(&mut self.i2c1));
        }
        self.chip.split(slot)
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.chip.reset(at, cause);
        let mut fresh = I2c::with_clock(RESET_CLOCK_HZ);
        fresh.inherit(&mut self.i2c1.inner);
        self.i2c1.inner = fresh;
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.chip.poll(now);
    }
}
