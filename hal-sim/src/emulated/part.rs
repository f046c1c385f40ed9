//! The microcontroller with faults that the emulator's own models do not have.
//!
//! What it is: the part as published, with wrappers. I2C1 can be held: SDA is kept low by a chip, BUSY stays set and no start
//! condition is taken. ADC1 draws noise for every single conversion, and can stop converting ([`super::converter`]). The flash can be
//! programmed ([`super::flash`]); the crystal can be silent or of another frequency, and is measured by TIM11 ([`super::crystal`]). TIM3 is
//! fed by DMA1, and what it says to the ESC is heard ([`super::pulse`]).
//! What can go wrong: a reset rebuilds the part; the wrapper carries the chips over.
//! Units: none.
//! Reference: RM0090 sections 27.3.3 and 27.6.7 (BUSY); crate rigless 0.4, "what the model leaves out".

use super::converter::{BlockDma, NoisyAdc};
use super::crystal::{Clocks, MeasuringTimer, Quartz};
use super::flash::ProgrammableFlash;
use super::pulse::{HeardTimer, controller};
use rigless::{
    device::{Device, DeviceContext, ErasedDevice, RegisterFile, RequestChange, ResetCause},
    mcu::Mcu,
    soc::{
        Bus,
        stm32f427::{
            Stm32f427,
            generated::{i2c3::Register, usart6::Register as SerialRegister},
            peripherals::{adc::Adc, flash::Flash, i2c::I2c},
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

/// Place of TIM3 among the part's general-purpose timers.
pub(super) const PULSE_TIMER: usize = 1;
/// ORE in the status of a USART.
const ORE: u64 = 1 << 3;

/// USART1 with an overrun and no byte: it came as the last byte was being read (RM0090 section 30.3.3). It answers in the part's place
/// until status and then data were read.
#[derive(Debug, Default)]
pub(super) struct StuckOverrun {
    pub(super) up: bool,
    seen: bool,
}

impl Device for StuckOverrun {
    type Register = SerialRegister;

    fn read(&mut self, register: SerialRegister, _: &mut RegisterFile, _: &mut DeviceContext<'_>) -> Option<u64> {
        match register {
            SerialRegister::Sr => {
                self.seen = true;
                Some(ORE)
            }
            SerialRegister::Dr => {
                self.up = !self.seen;
                self.seen = false;
                Some(0)
            }
            _ => None,
        }
    }
}

/// The part and its wrapped models.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) chip: Stm32f427,
    pub(super) adc1: NoisyAdc,
    adc1_slot: usize,
    dma2: BlockDma,
    dma2_slot: usize,
    pub(super) i2c1: HeldI2c,
    i2c1_slot: usize,
    pub(super) flash: ProgrammableFlash,
    flash_slot: usize,
    pub(super) clocks: Clocks,
    clocks_slot: usize,
    measuring: MeasuringTimer,
    measuring_slot: usize,
    pub(super) stuck: StuckOverrun,
    serial_slot: usize,
    pub(super) pulse: HeardTimer,
    pulse_slot: usize,
}

impl Part {
    pub(super) fn new(mut chip: Stm32f427, quartz: Quartz) -> Result<Self, rigless::soc::Error> {
        let i2c1_slot = chip.bus().slot("I2C1")?;
        let inner = std::mem::replace(&mut chip.i2c[0], I2c::with_clock(RESET_CLOCK_HZ));
        let adc1_slot = chip.bus().slot("ADC1")?;
        let adc1 = NoisyAdc::new(std::mem::replace(&mut chip.adc[0], Adc::with_clock(RESET_CLOCK_HZ)));
        let (dma2, dma2_slot) = (adc1.controller(), chip.bus().slot("DMA2")?);
        let flash_slot = chip.bus().slot("FLASH")?;
        let flash = ProgrammableFlash::new(std::mem::replace(&mut chip.flash, Flash::with_clock(RESET_CLOCK_HZ)));
        let (clocks_slot, measuring_slot) = (chip.bus().slot("RCC")?, chip.bus().slot("TIM11")?);
        let serial_slot = chip.bus().slot("USART1")?;
        let pulse_slot = chip.bus().slot("TIM3")?;
        let pulse = HeardTimer::new(&mut chip.tim[PULSE_TIMER]);
        chip.dma[0] = controller();
        let clocks = Clocks::new(quartz);
        let measuring = clocks.measured();
        let i2c1 = HeldI2c { inner, held: false };
        let stuck = StuckOverrun::default();
        Ok(Self {
            chip,
            adc1,
            adc1_slot,
            dma2,
            dma2_slot,
            i2c1,
            i2c1_slot,
            flash,
            flash_slot,
            clocks,
            clocks_slot,
            measuring,
            measuring_slot,
            stuck,
            serial_slot,
            pulse,
            pulse_slot,
        })
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
        if slot == self.dma2_slot {
            return (self.chip.bus_mut(), Some(&mut self.dma2));
        }
        if slot == self.flash_slot {
            return (self.chip.bus_mut(), Some(&mut self.flash));
        }
        if slot == self.clocks_slot {
            return (self.chip.bus_mut(), Some(&mut self.clocks));
        }
        if slot == self.serial_slot && self.stuck.up {
            return (self.chip.bus_mut(), Some(&mut self.stuck));
        }
        if slot == self.pulse_slot {
            return (self.chip.bus_mut(), Some(&mut self.pulse));
        }
        if slot == self.measuring_slot {
            return (self.chip.bus_mut(), Some(&mut self.measuring));
        }
        self.chip.split(slot)
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.chip.reset(at, cause);
        let mut fresh = I2c::with_clock(RESET_CLOCK_HZ);
        self.adc1.restart();
        self.dma2 = self.adc1.controller();
        fresh.inherit(&mut self.i2c1.inner);
        self.i2c1.inner = fresh;
        self.flash.restart();
        self.clocks.take(std::mem::take(&mut self.chip.rcc));
        self.measuring = self.clocks.measured();
        self.pulse.restart(at, &mut self.chip.tim[PULSE_TIMER]);
        self.chip.dma[0] = controller();
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.chip.poll(now);
    }
}
