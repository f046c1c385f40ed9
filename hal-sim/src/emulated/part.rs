//! The microcontroller with faults that the emulator's own models do not have.
//!
//! What it is: the part as published, with three wrappers. I2C1 can be held: SDA is kept low by a chip, BUSY stays set and no start
//! condition is taken. ADC1 draws noise at the instant of every single conversion, and can stop converting. The flash can be
//! programmed ([`super::flash`]).
//! What can go wrong: a reset rebuilds the part; the wrapper carries the chips over.
//! Units: none.
//! Reference: RM0090 sections 27.3.3 and 27.6.7 (BUSY); crate rigless 0.4, "what the model leaves out".

use super::flash::ProgrammableFlash;
use crate::noise::{Source, Stream};
use rigless::{
    device::{Device, DeviceContext, ErasedDevice, RegisterFile, RequestChange, ResetCause},
    mcu::Mcu,
    soc::{
        Bus,
        stm32f427::{
            Stm32f427,
            generated::{adc1::Register as AdcRegister, i2c3::Register},
            peripherals::{
                adc::{Adc, Channel},
                flash::Flash,
                i2c::I2c,
            },
        },
    },
    time::{EventId, VirtualNanos},
};

/// Clock of the peripheral until the clock tree says otherwise: the internal oscillator.
const RESET_CLOCK_HZ: u64 = 16_000_000;
/// START in CR1 and BUSY in SR2.
const START: u64 = 1 << 8;
const BUSY: u64 = 1 << 1;

/// What a wrapped model does as the one inside it.
macro_rules! pass_on_the_rest {
    () => {
        fn peek(&self, register: Self::Register, file: &RegisterFile, now: VirtualNanos) -> Option<u64> {
            Device::peek(&self.inner, register, file, now)
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
    };
}
pub(super) use pass_on_the_rest;

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

    fn write(&mut self, register: Register, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if self.held && register == Register::Cr1 && value & START != 0 {
            return; // the request stays pending: the bus never looks free
        }
        Device::write(&mut self.inner, register, value, file, context);
    }

    fn on_event(&mut self, event: EventId, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_event(&mut self.inner, event, file, context);
    }

    pass_on_the_rest!();
}

/// Clock of the converter until the clock tree says otherwise.
const ADC_RESET_CLOCK_HZ: u64 = 8_000_000;
/// Units of a converter input in one count: the model answers input x 4095 / reference, rounded down.
pub(super) const ADC_UNITS: u32 = 1000;
/// Channels whose level and noise are set from outside.
const ADC_CHANNELS: usize = 16;

/// ADC1 that reads a level and its noise at every conversion.
#[derive(Debug)]
pub(super) struct NoisyAdc {
    pub(super) inner: Adc,
    /// Level of each channel, counts.
    pub(super) level: [f64; ADC_CHANNELS],
    /// Standard deviation of the noise of a conversion, counts.
    pub(super) noise: f64,
    /// No conversion ends any more.
    pub(super) stopped: bool,
    used: [bool; ADC_CHANNELS],
    turn: usize,
    stream: Stream,
}

impl NoisyAdc {
    fn new(inner: Adc) -> Self {
        Self {
            inner,
            level: [0.0; ADC_CHANNELS],
            noise: 0.0,
            stopped: false,
            used: [false; ADC_CHANNELS],
            turn: 0,
            stream: Stream::new(1, Source::Adc, 99),
        }
    }

    /// Level of a channel from now on, counts.
    pub(super) fn set_level(&mut self, channel: u8, counts: f64) {
        if let Some((level, used)) = self.level.get_mut(usize::from(channel)).zip(self.used.get_mut(usize::from(channel))) {
            (*level, *used) = (counts, true);
        }
    }

    /// Draws what one channel reads from this instant on, in turn, so that every conversion of a scan has noise of its own. The
    /// thresholds of an ideal converter lie half a count below each code.
    fn draw(&mut self) {
        for _ in 0..ADC_CHANNELS {
            self.turn = (self.turn + 1) % ADC_CHANNELS;
            if let (true, Some(channel)) = (self.used[self.turn], Channel::new(self.turn as u8)) {
                let [noise, _] = self.stream.quick_normals();
                let counts = self.level[self.turn] + self.noise * noise + 0.5;
                let code = (counts.max(0.0) as u32).min(4095);
                self.inner.set_input(channel, code * ADC_UNITS + ADC_UNITS / 2);
                return;
            }
        }
    }
}

impl Device for NoisyAdc {
    type Register = AdcRegister;

    fn read(&mut self, register: AdcRegister, file: &mut RegisterFile, context: &mut DeviceContext<'_>) -> Option<u64> {
        Device::read(&mut self.inner, register, file, context)
    }

    fn write(&mut self, register: AdcRegister, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::write(&mut self.inner, register, value, file, context);
    }

    fn on_event(&mut self, event: EventId, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if !self.stopped {
            self.draw();
            Device::on_event(&mut self.inner, event, file, context);
        }
    }

    pass_on_the_rest!();
}

/// The part and its wrapped models.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) chip: Stm32f427,
    pub(super) adc1: NoisyAdc,
    adc1_slot: usize,
    pub(super) i2c1: HeldI2c,
    i2c1_slot: usize,
    pub(super) flash: ProgrammableFlash,
    flash_slot: usize,
}

impl Part {
    pub(super) fn new(mut chip: Stm32f427) -> Result<Self, rigless::soc::Error> {
        let i2c1_slot = chip.bus().slot("I2C1")?;
        let inner = std::mem::replace(&mut chip.i2c[0], I2c::with_clock(RESET_CLOCK_HZ));
        let adc1_slot = chip.bus().slot("ADC1")?;
        let adc1 = NoisyAdc::new(std::mem::replace(&mut chip.adc[0], Adc::with_clock(ADC_RESET_CLOCK_HZ)));
        let flash_slot = chip.bus().slot("FLASH")?;
        let flash = ProgrammableFlash::new(std::mem::replace(&mut chip.flash, Flash::with_clock(RESET_CLOCK_HZ)));
        Ok(Self { chip, adc1, adc1_slot, i2c1: HeldI2c { inner, held: false }, i2c1_slot, flash, flash_slot })
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
        if slot == self.adc1_slot {
            return (self.chip.bus_mut(), Some(&mut self.adc1));
        }
        if slot == self.flash_slot {
            return (self.chip.bus_mut(), Some(&mut self.flash));
        }
        self.chip.split(slot)
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.chip.reset(at, cause);
        let mut fresh = I2c::with_clock(RESET_CLOCK_HZ);
        let mut fresh_adc = Adc::with_clock(ADC_RESET_CLOCK_HZ);
        fresh_adc.inherit(&self.adc1.inner);
        self.adc1.inner = fresh_adc;
        fresh.inherit(&mut self.i2c1.inner);
        self.i2c1.inner = fresh;
        self.flash.restart();
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.chip.poll(now);
    }
}
