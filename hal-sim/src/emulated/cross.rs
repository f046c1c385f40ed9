//! The ESC's telemetry and the back-EMF meter at the emulated board's pins.
//!
//! What it is: what a [`super::World`] hands to USART3 and to channel 4 of TIM1, and whether the firmware listens there.
//! What can go wrong: the emulator times a byte by the rate that the firmware has set: another rate of the sender has to be given as the bytes and
//! errors that a receiver makes of it ([`crate::sensor::EscTelemetry`] does).
//! Units: none.
//! Reference: RM0090 sections 30.3.3 (a byte with a framing error is moved to DR, with FE), 30.6.1 (FE), 17.3.5 (input capture).

use super::machine::{FarEnd, Pins, level};
use firmware_rig::esc_line::LINE_ERROR;
use rigless::{
    chip::uart::Rate,
    soc::{
        st::tim::Channel,
        stm32f427::generated::{
            tim1::{Register as TimerRegister, ccer},
            usart6::{Register as SerialRegister, cr1},
        },
    },
};

/// Place of USART3 among the part's serial ports: the ESC's telemetry.
pub(super) const ESC_PORT: usize = 2;
/// Place of TIM1 among the part's advanced timers, and the channel of the back-EMF meter.
const METER_TIMER: usize = 0;
const METER_CHANNEL: u8 = 4;

impl Pins<'_> {
    /// Whether USART3 receives: the ESC's telemetry is listened to.
    pub fn esc_port_listens(&mut self) -> bool {
        let (_, registers) = self.machine.mcu.chip.serial_port(ESC_PORT);
        let control = registers.get(SerialRegister::Cr1);
        cr1::UE.is_set(control) && cr1::RE.is_set(control)
    }

    /// Bytes for USART3, one after the other from now on at the rate that the firmware has set. Where one is marked as damaged all of them come
    /// with a framing error, their bits turned over (RM0090 section 30.3.3).
    pub fn say_to_esc_port(&mut self, words: &[u16]) {
        if words.is_empty() {
            return;
        }
        let port = &mut self.machine.mcu.chip.usart[ESC_PORT];
        let damaged = words.iter().any(|word| word & LINE_ERROR != 0);
        port.errors_mut().framing = Rate { name: "esc", per_million: if damaged { Rate::EVERY_WORD } else { 0 } };
        if let Some(far) = port.chip_mut::<FarEnd>() {
            far.to_say.extend(words.iter().map(|word| word & 0xff));
        }
    }

    /// Whether channel 4 of TIM1 captures: the back-EMF meter is listened to.
    pub fn meter_listens(&mut self) -> bool {
        let (_, registers) = self.machine.mcu.chip.advanced_timer(METER_TIMER);
        ccer::CC4E.is_set(registers.get(TimerRegister::Ccer))
    }

    /// Drives the input of channel 4 of TIM1. The emulator does not connect pins and timers: ask [`Pins::alternate`].
    pub fn drive_meter(&mut self, high: bool) {
        if let Some(channel) = Channel::new(METER_CHANNEL) {
            self.machine.mcu.chip.drive_advanced_timer(self.at, METER_TIMER, |timer, registers, context| {
                timer.drive_input(channel, level(high), registers, context);
            });
        }
    }
}
