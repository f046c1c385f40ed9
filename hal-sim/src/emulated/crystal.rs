//! The crystal, and the two peripherals that see it: the clock tree and the timer that measures it.
//!
//! What it is: the part's own model of RCC, whose crystal may be silent or fail, and a model of TIM11 channel 1 on HSE_RTC, which the
//! emulator lacks: it captures every eighth period of the crystal over RTCPRE in ticks of the internal oscillator.
//! What can go wrong: the emulator's core takes no NMI from the clock security system: the flag CSSF rises, the clock is switched, and
//! the firmware's own look at the flag must do.
//! Units: Hz; ns since power-up.
//! Reference: RM0090 sections 7.2.7, 7.2.11, 7.3.1, 7.3.3, 19.5; crate rigless 0.4, "what the model leaves out".

use super::part::pass_on_the_rest;
use rigless::{
    device::{Device, DeviceContext, RegisterFile, RequestChange},
    soc::stm32f427::{
        generated::{rcc::Register as RccRegister, tim11::Register as TimerRegister},
        peripherals::rcc::Rcc,
    },
    time::{EventId, VirtualNanos},
};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The internal oscillator, Hz.
const INTERNAL_HZ: u64 = 16_000_000;
/// HSERDY in CR.
const HSERDY: u64 = 1 << 17;
/// RTCPRE in CFGR, five bits from here.
const RTCPRE: u64 = 16;

/// What is soldered to the crystal's pins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quartz {
    /// A crystal of so many Hz that oscillates.
    Good(u64),
    /// One that does not oscillate.
    Silent,
}

impl Quartz {
    fn hz(self) -> u64 {
        match self {
            Self::Good(hz) => hz,
            Self::Silent => 0,
        }
    }
}

/// The clock tree with its crystal.
#[derive(Debug)]
pub(super) struct Clocks {
    pub(super) inner: Rcc,
    quartz: Quartz,
    /// The divided frequency that TIM11 sees, Hz; 0: none.
    divided: Arc<AtomicU64>,
}

impl Clocks {
    pub(super) fn new(quartz: Quartz) -> Self {
        let mut this = Self { inner: Rcc::new(), quartz, divided: Arc::default() };
        this.take(Rcc::new());
        this
    }

    /// Takes the tree as a reset leaves it; the crystal stays.
    pub(super) fn take(&mut self, fresh: Rcc) {
        self.inner = fresh;
        self.inner.attach_crystals(self.quartz.hz(), 0);
        self.divided.store(0, Ordering::Relaxed);
    }

    /// What TIM11 sees of it.
    pub(super) fn measured(&self) -> MeasuringTimer {
        MeasuringTimer { divided: Arc::clone(&self.divided), begun: VirtualNanos(0), served: 0 }
    }

    /// The crystal stops oscillating, for good.
    pub(super) fn fail(&mut self, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.quartz = Quartz::Silent;
        self.inner.fail_hse(file, context);
        self.follow(file);
    }

    /// What the crystal does to the registers.
    fn follow(&self, file: &mut RegisterFile) {
        if self.quartz == Quartz::Silent {
            file.set(RccRegister::Cr, file.get(RccRegister::Cr) & !HSERDY);
        }
        let division = file.get(RccRegister::Cfgr) >> RTCPRE & 31;
        let divided = if division < 2 { 0 } else { self.quartz.hz() / division };
        self.divided.store(divided, Ordering::Relaxed);
    }
}

impl Device for Clocks {
    type Register = RccRegister;

    fn read(&mut self, register: RccRegister, file: &mut RegisterFile, context: &mut DeviceContext<'_>) -> Option<u64> {
        Device::read(&mut self.inner, register, file, context)
    }

    fn write(&mut self, register: RccRegister, value: u64, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::write(&mut self.inner, register, value, file, context);
        self.follow(file);
    }

    fn on_event(&mut self, event: EventId, file: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        Device::on_event(&mut self.inner, event, file, context);
        self.follow(file);
    }

    pass_on_the_rest!();
}

/// TIM11 with its first channel on HSE_RTC.
#[derive(Debug)]
pub(super) struct MeasuringTimer {
    divided: Arc<AtomicU64>,
    begun: VirtualNanos,
    served: u64,
}

impl MeasuringTimer {
    /// Captures so far; none unless the channel is set up as the manual asks for.
    fn captures(&self, file: &RegisterFile, now: VirtualNanos) -> u64 {
        let bit = |register, mask: u64, value| file.get(register) & mask == value;
        let on = bit(TimerRegister::Cr1, 1, 1)
            && bit(TimerRegister::Ccer, 1, 1)
            && bit(TimerRegister::Ccmr1Input, 3, 1)
            && bit(TimerRegister::Or, 3, 2);
        let hz = if on { self.divided.load(Ordering::Relaxed) } else { 0 };
        let passed = u128::from(now.0.saturating_sub(self.begun.0));
        (passed * u128::from(hz) / (1_000_000_000 * u128::from(Self::prescaler(file)))) as u64
    }

    /// Edges to a capture: IC1PSC.
    fn prescaler(file: &RegisterFile) -> u64 {
        1 << (file.get(TimerRegister::Ccmr1Input) >> 2 & 3)
    }

    /// Counter at the latest capture.
    fn captured(&self, nth: u64, file: &RegisterFile) -> u64 {
        let hz = self.divided.load(Ordering::Relaxed).max(1);
        let ticks = u128::from(nth) * u128::from(Self::prescaler(file)) * u128::from(INTERNAL_HZ) / u128::from(hz);
        (ticks & 0xffff) as u64
    }
}

impl Device for MeasuringTimer {
    type Register = TimerRegister;

    fn read(&mut self, register: TimerRegister, file: &mut RegisterFile, context: &mut DeviceContext<'_>) -> Option<u64> {
        let captures = self.captures(file, context.now());
        let waiting = captures - self.served.min(captures);
        match register {
            TimerRegister::Sr => Some(u64::from(waiting > 0) << 1 | u64::from(waiting > 1) << 9),
            TimerRegister::Ccr1 => {
                self.served = captures;
                Some(self.captured(captures, file))
            }
            _ => None,
        }
    }

    fn write(&mut self, register: TimerRegister, _: u64, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if register == TimerRegister::Cr1 {
            (self.begun, self.served) = (context.now(), 0);
        }
    }
}
