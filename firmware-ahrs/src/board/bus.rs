//! I2C1 as a polled master with bounded waits.
//!
//! What it is: the embedded-hal I2C trait over the registers. The HAL's driver sets up pins and timing; its transfers are
//! not used, because they wait for ever on a stuck bus.
//!
//! What can go wrong: nobody acknowledges ([`BusError::Nack`]), another master or a glitch wins
//! ([`BusError::ArbitrationLost`]), a line is held down ([`BusError::Timeout`]). After the last two the bus is recovered: up to
//! nine clocks until the chip that holds SDA has shifted its byte out, a stop condition, and a reset of the peripheral.
//! An interrupt between two bytes only stretches the clock: the last bytes of a read follow the reference manual's
//! byte-transfer-finished procedure, not a race with the shift register.
//!
//! Units: bytes; microseconds of patience, counted in core cycles.
//!
//! Reference: RM0090 section 27.3.3, figures 242 to 245; errata ES0182 2.8 (BERR is to be ignored); I2C-bus specification
//! UM10204 section 3.1.16 (bus clear).

use super::CORE_HZ;
use cortex_m::peripheral::DWT;
use embedded_hal::i2c::{Error, ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use stm32f4xx_hal::gpio::alt::i2c1::{Scl, Sda};
use stm32f4xx_hal::gpio::{Alternate, OpenDrain, PB6, PB7, PinState};
use stm32f4xx_hal::i2c::I2c as Configured;
use stm32f4xx_hal::pac::{I2C1, i2c1};

/// Longest wait for one flag: a byte takes 23 us, the sensors do not stretch the clock.
pub(crate) const PATIENCE_US: u32 = 300;
const PATIENCE: u32 = PATIENCE_US * (CORE_HZ / 1_000_000);

/// Why a transfer failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub(crate) enum BusError {
    /// Nobody at this address, or the byte was refused.
    Nack(NoAcknowledge),
    /// Another master won.
    ArbitrationLost,
    /// A flag did not come within [`PATIENCE_US`].
    Timeout,
}

/// What was not acknowledged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub(crate) enum NoAcknowledge {
    /// The address.
    Address,
    /// A data byte.
    Data,
}

impl Error for BusError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Nack(NoAcknowledge::Address) => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
            Self::Nack(NoAcknowledge::Data) => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data),
            Self::ArbitrationLost => ErrorKind::ArbitrationLoss,
            Self::Timeout => ErrorKind::Bus,
        }
    }
}

/// Half a clock of the recovery: 100 kHz.
const HALF_CLOCK: u32 = CORE_HZ / 200_000;
/// Clocks after which no chip can still be in the middle of a byte (UM10204 section 3.1.16).
const CLEARING_CLOCKS: u32 = 9;

/// The bus.
pub(crate) struct Bus {
    i2c: I2C1,
    scl: PB6<Alternate<4, OpenDrain>>,
    sda: PB7<Alternate<4, OpenDrain>>,
}

impl ErrorType for Bus {
    type Error = BusError;
}

impl Bus {
    /// Takes the peripheral from the HAL, which has set up clock, pins and timing; `None` when it is on other pins.
    pub(crate) fn new(configured: Configured<I2C1>) -> Option<Self> {
        match configured.release() {
            (i2c, (Scl::PB6(scl), Sda::PB7(sda))) => Some(Self { i2c, scl, sda }),
            _ => None,
        }
    }

    /// Polls SR1 until `ready`, an error flag or the end of patience.
    fn wait(&self, phase: NoAcknowledge, ready: impl Fn(&i2c1::sr1::R) -> bool) -> Result<(), BusError> {
        let begun = DWT::cycle_count();
        loop {
            let sr1 = self.i2c.sr1().read();
            if sr1.af().bit_is_set() {
                self.i2c.sr1().modify(|_, w| w.af().clear_bit());
                return Err(BusError::Nack(phase));
            }
            if sr1.arlo().bit_is_set() {
                return Err(BusError::ArbitrationLost);
            }
            if ready(&sr1) {
                return Ok(());
            }
            if DWT::cycle_count().wrapping_sub(begun) > PATIENCE {
                return Err(BusError::Timeout);
            }
        }
    }

    /// Waits for the stop condition of the transfer before, which the hardware ends by itself.
    fn wait_stopped(&self) -> Result<(), BusError> {
        let begun = DWT::cycle_count();
        while self.i2c.cr1().read().stop().bit_is_set() {
            if DWT::cycle_count().wrapping_sub(begun) > PATIENCE {
                return Err(BusError::Timeout);
            }
        }
        Ok(())
    }

    /// (Repeated) start and address. ADDR is left set, because a read must set ACK before it is cleared.
    fn start(&self, address: u8, read: bool) -> Result<(), BusError> {
        self.i2c.cr1().modify(|_, w| w.start().set_bit().ack().set_bit().pos().clear_bit());
        self.wait(NoAcknowledge::Address, |sr1| sr1.sb().bit_is_set())?;
        self.i2c.dr().write(|w| w.dr().set(address << 1 | u8::from(read)));
        self.wait(NoAcknowledge::Address, |sr1| sr1.addr().bit_is_set())
    }

    /// ADDR is cleared by reading SR1 (done while waiting) and then SR2.
    fn clear_addr(&self) {
        let _ = self.i2c.sr2().read();
    }

    fn byte(&self) -> u8 {
        self.i2c.dr().read().dr().bits()
    }

    fn write_bytes(&self, bytes: &[u8]) -> Result<(), BusError> {
        self.clear_addr();
        for byte in bytes {
            self.wait(NoAcknowledge::Data, |sr1| sr1.tx_e().bit_is_set())?;
            self.i2c.dr().write(|w| w.dr().set(*byte));
        }
        self.wait(NoAcknowledge::Data, |sr1| sr1.btf().bit_is_set() || (bytes.is_empty() && sr1.tx_e().bit_is_set()))
    }

    /// Reads after ADDR. `stop` ends the transaction; without it the last byte is refused and the next
    /// operation's start follows.
    fn read_bytes(&self, into: &mut [u8], stop: bool) -> Result<(), BusError> {
        let cr1 = self.i2c.cr1();
        let finish = || {
            if stop {
                cr1.modify(|_, w| w.stop().set_bit());
            }
        };
        let received = || self.wait(NoAcknowledge::Data, |sr1| sr1.rx_ne().bit_is_set());
        let both = || self.wait(NoAcknowledge::Data, |sr1| sr1.btf().bit_is_set());
        match into {
            [] => {
                self.clear_addr();
                finish();
            }
            [only] => {
                cr1.modify(|_, w| w.ack().clear_bit());
                self.clear_addr();
                finish();
                received()?;
                *only = self.byte();
            }
            [first, second] => {
                cr1.modify(|_, w| w.ack().clear_bit().pos().set_bit());
                self.clear_addr();
                both()?;
                finish();
                *first = self.byte();
                *second = self.byte();
            }
            [early @ .., third, second, last] => {
                self.clear_addr();
                for slot in early {
                    received()?;
                    *slot = self.byte();
                }
                both()?; // two bytes wait, the clock is held: ACK off now refuses exactly the last byte
                cr1.modify(|_, w| w.ack().clear_bit());
                *third = self.byte();
                both()?;
                finish();
                *second = self.byte();
                received()?;
                *last = self.byte();
            }
        }
        Ok(())
    }

    /// One operation after the other with repeated starts; the caller ends the transaction on success and failure.
    fn run(&self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        self.wait_stopped()?;
        let last = operations.len().saturating_sub(1);
        for (i, operation) in operations.iter_mut().enumerate() {
            match operation {
                Operation::Write(bytes) => {
                    self.start(address, false)?;
                    self.write_bytes(bytes)?;
                    if i == last {
                        self.i2c.cr1().modify(|_, w| w.stop().set_bit());
                    }
                }
                Operation::Read(into) => {
                    self.start(address, true)?;
                    self.read_bytes(into, i == last)?;
                }
            }
        }
        Ok(())
    }

    /// Clocks a held data line free and ends with a stop condition, by hand.
    fn clear(&mut self) {
        let Self { scl, sda, .. } = self;
        scl.with_open_drain_output_in_state(PinState::High, |scl| {
            sda.with_open_drain_output_in_state(PinState::High, |sda| {
                for _ in 0..CLEARING_CLOCKS {
                    if sda.is_high() {
                        break;
                    }
                    scl.set_low();
                    cortex_m::asm::delay(HALF_CLOCK);
                    scl.set_high();
                    cortex_m::asm::delay(HALF_CLOCK);
                }
                scl.set_low();
                sda.set_low();
                cortex_m::asm::delay(HALF_CLOCK);
                scl.set_high();
                cortex_m::asm::delay(HALF_CLOCK);
                sda.set_high();
                cortex_m::asm::delay(HALF_CLOCK);
            });
        });
    }

    /// Software reset of the peripheral, keeping the timing that the HAL computed.
    #[allow(unsafe_code)] // the words written are the ones just read from the same registers
    fn reset(&self) {
        let (cr2, ccr, trise) = (self.i2c.cr2().read().bits(), self.i2c.ccr().read().bits(), self.i2c.trise().read().bits());
        self.i2c.cr1().modify(|_, w| w.swrst().set_bit());
        self.i2c.cr1().reset();
        self.i2c.cr2().write(|w| unsafe { w.bits(cr2) });
        self.i2c.ccr().write(|w| unsafe { w.bits(ccr) });
        self.i2c.trise().write(|w| unsafe { w.bits(trise) });
        self.i2c.cr1().modify(|_, w| w.pe().set_bit());
    }
}

impl I2c for Bus {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let outcome = self.run(address, operations);
        match outcome {
            Ok(()) => {}
            Err(BusError::Nack(_)) => {
                self.i2c.cr1().modify(|_, w| w.stop().set_bit());
            }
            Err(_) => {
                self.i2c.cr1().modify(|_, w| w.pe().clear_bit()); // off the pins' state machine while they are ours
                self.clear();
                self.reset();
            }
        }
        outcome
    }
}
