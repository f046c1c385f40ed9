//! The I2C bus of the IMU board as an embedded-hal back end.
//!
//! What it is: `embedded_hal::i2c::I2c` over the three chips at 400 kHz on the virtual clock, with the faults of a scenario: a chip that
//! does not acknowledge, a data line that is held.
//! What can go wrong: [`BusError::NoAcknowledge`] of a chip that is absent or off the bus; [`BusError::Held`] while SDA is low, after
//! which the bus is given its nine clocks and a chip that waits for fewer lets go.
//! Units: ns since power-up.
//! Reference: NXP UM10204 rev 6, sections 3.1.10 (nine bits a byte) and 3.1.16 (bus clear); embedded-hal 1.0.

use super::body::Body;
use super::chip::{ChipKind, SensorChip, Served};
use super::errors::Errors;
use super::hidden::Hidden;
use crate::clock::VirtualClock;
use embedded_hal::i2c::{Error, ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};

/// One bit at 400 kHz, ns.
const BIT_NS: u64 = 2_500;
/// A byte and its acknowledgement, bits.
const BYTE_BITS: u64 = 9;
/// Time after which the board gives up a held bus, ns: the time-out of its driver, 300 us.
const GIVE_UP_NS: u64 = 300_000;
/// Clocks that free a bus (UM10204, section 3.1.16) and the length of one of them, ns.
const FREEING_CLOCKS: u32 = 9;
const FREEING_CLOCK_NS: u64 = 10_000;

/// What goes wrong on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BusFault {
    /// Nothing.
    #[default]
    None,
    /// One chip is off the bus for a while.
    LoosePlug {
        /// Which of the fitted chips, in their order.
        nth: usize,
        /// When it goes, ns.
        off_ns: u64,
        /// When it comes back, ns.
        back_ns: u64,
    },
    /// A chip holds SDA low until it has seen some clocks.
    HeldData {
        /// When it begins to, ns.
        from_ns: u64,
        /// Rising edges of SCL after which it lets go; 0 for never.
        clocks: u32,
    },
}

impl BusFault {
    /// A data line that is held from an instant on, ns, until the bus is freed as it should be.
    #[must_use]
    pub fn held(from_ns: u64) -> Self {
        Self::HeldData { from_ns, clocks: FREEING_CLOCKS }
    }
}

/// Why a transfer failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BusError {
    /// Nobody answers at this address.
    #[error("no chip acknowledges address {0:#04x}")]
    NoAcknowledge(u8),
    /// SDA is held low.
    #[error("the data line is held low")]
    Held,
}

impl Error for BusError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NoAcknowledge(_) => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
            Self::Held => ErrorKind::Bus,
        }
    }
}

/// The bus with its chips.
#[derive(Debug)]
pub struct I2cBus {
    clock: VirtualClock,
    chips: Vec<SensorChip>,
    fault: BusFault,
    /// Clocks that a holding chip has seen.
    clocks_seen: u32,
}

impl I2cBus {
    /// A bus on `clock` with the chips of `fitted` on `body`.
    #[must_use]
    pub fn new(clock: VirtualClock, fitted: &[ChipKind], body: impl Into<Body>, errors: &Errors, fault: BusFault) -> Self {
        let body = body.into();
        let chips = fitted.iter().map(|kind| SensorChip::new(*kind, body.clone(), errors)).collect();
        Self { clock, chips, fault, clocks_seen: 0 }
    }

    /// The same bus with hidden effects about its chips.
    #[must_use]
    pub fn with(mut self, hidden: &Hidden) -> Self {
        self.chips = self.chips.into_iter().map(|chip| chip.with(hidden)).collect();
        self
    }

    /// The same bus, whose chips keep nothing of what they hand out.
    #[must_use]
    pub fn forgetful(mut self) -> Self {
        self.chips.iter_mut().for_each(|chip| chip.forgetful = true);
        self
    }

    /// What each chip handed out, in the order of [`ChipKind::ALL`]; nothing of a chip that is not fitted.
    #[must_use]
    pub fn served(&self) -> [&[Served]; 3] {
        ChipKind::ALL.map(|kind| self.chips.iter().find(|c| c.kind() == kind).map_or(&[][..], |c| &c.served))
    }

    /// Clocks that a chip which held the data line has seen.
    #[must_use]
    pub fn clocks_seen(&self) -> u32 {
        self.clocks_seen
    }

    fn held(&self) -> bool {
        let BusFault::HeldData { from_ns, clocks } = self.fault else { return false };
        self.clock.now_ns() >= from_ns && (clocks == 0 || self.clocks_seen < clocks)
    }

    fn plugged(&self, nth: usize) -> bool {
        let now = self.clock.now_ns();
        !matches!(self.fault, BusFault::LoosePlug { nth: off, off_ns, back_ns } if off == nth && (off_ns..back_ns).contains(&now))
    }

    /// Sends a start with an address; gives the chip that acknowledges.
    fn start(&mut self, address: u8, read: bool) -> Result<usize, BusError> {
        let at_ns = self.clock.now_ns();
        self.clock.pass_ns(BYTE_BITS * BIT_NS);
        let mut answer = None;
        for nth in 0..self.chips.len() {
            if self.plugged(nth) && self.chips.get_mut(nth).is_some_and(|chip| chip.start(address, read, at_ns)) {
                answer = Some(nth);
            }
        }
        answer.ok_or(BusError::NoAcknowledge(address))
    }

    fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let mut before = None;
        let count = operations.len();
        let reads: Vec<bool> = operations.iter().map(|o| matches!(o, Operation::Read(_))).collect();
        for (i, operation) in operations.iter_mut().enumerate() {
            let read = reads.get(i).copied().unwrap_or_default();
            let chip = match before {
                Some((chip, direction)) if direction == read => chip,
                _ => self.start(address, read)?,
            };
            before = Some((chip, read));
            let closes = i + 1 == count || reads.get(i + 1) != Some(&read);
            let Some(chip) = self.chips.get_mut(chip) else { continue };
            match operation {
                Operation::Read(bytes) => {
                    let last = bytes.len();
                    for (k, byte) in bytes.iter_mut().enumerate() {
                        *byte = chip.read(closes && k + 1 == last);
                        self.clock.pass_ns(BYTE_BITS * BIT_NS);
                    }
                }
                Operation::Write(bytes) => {
                    for byte in bytes.iter() {
                        chip.write(*byte);
                        self.clock.pass_ns(BYTE_BITS * BIT_NS);
                    }
                }
            }
        }
        Ok(())
    }
}

impl ErrorType for I2cBus {
    type Error = BusError;
}

impl I2c for I2cBus {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        if self.held() {
            let left = match self.fault {
                BusFault::HeldData { clocks, .. } if clocks > 0 => clocks.saturating_sub(self.clocks_seen).min(FREEING_CLOCKS),
                _ => FREEING_CLOCKS,
            };
            self.clocks_seen += left;
            self.clock.pass_ns(GIVE_UP_NS + u64::from(left) * FREEING_CLOCK_NS);
            return Err(BusError::Held);
        }
        let done = self.transfer(address, operations);
        for chip in &mut self.chips {
            chip.stop();
        }
        self.clock.pass_ns(2 * BIT_NS); // stop and bus-free time
        done
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::Motion;
    use super::*;

    fn bus(fitted: &[ChipKind], fault: BusFault) -> (VirtualClock, I2cBus) {
        let clock = VirtualClock::default();
        (clock.clone(), I2cBus::new(clock, fitted, Motion::LEVEL, &Errors::default(), fault))
    }

    #[test]
    fn identities_defaults_and_the_time_that_a_transfer_takes() {
        let (clock, mut bus) = bus(&ChipKind::ALL, BusFault::None);
        let mut id = [0];
        for (address, register, want) in [(0x68, 0x00, 0x69), (0x53, 0x00, 0xE5), (0x1E, 0x0A, b'H')] {
            bus.write_read(address, &[register], &mut id).unwrap();
            assert_eq!(id[0], want);
        }
        // four bytes of nine bits, stop and idle: 38 bits of 2.5 us
        assert_eq!(clock.now_ns(), 3 * 95_000);
        let mut words = [0; 6];
        bus.write_read(0x53, &[0x32], &mut words).unwrap();
        assert_eq!(words, [0; 6], "in standby");
        bus.write(0x53, &[0x2D, 0x08]).unwrap();
        bus.write(0x53, &[0x31, 0x0B]).unwrap();
        bus.write_read(0x53, &[0x32], &mut words).unwrap();
        assert_eq!(words, [0, 0, 0, 0, 0, 1], "1 g along chip z: 256");
        assert_eq!(bus.served()[1].len(), 2);
        assert!(bus.chips.iter().all(|c| c.unfinished == 0));
    }

    #[test]
    fn absent_unplugged_and_held() {
        let (_, mut absent) = bus(&[ChipKind::Itg3200], BusFault::None);
        assert_eq!(absent.write(0x53, &[0]), Err(BusError::NoAcknowledge(0x53)));
        let (clock, mut loose) = bus(&ChipKind::ALL, BusFault::LoosePlug { nth: 1, off_ns: 1_000_000, back_ns: 2_000_000 });
        assert_eq!(loose.write(0x53, &[0]), Ok(()));
        clock.advance_to(1_500_000);
        assert_eq!(loose.write(0x53, &[0]), Err(BusError::NoAcknowledge(0x53)));
        assert_eq!(loose.write(0x68, &[0]), Ok(()));
        clock.advance_to(2_000_000);
        assert_eq!(loose.write(0x53, &[0]), Ok(()));
        for (clocks, freed) in [(5, true), (0, false)] {
            let (_, mut held) = bus(&ChipKind::ALL, BusFault::HeldData { from_ns: 0, clocks });
            assert_eq!(held.write(0x68, &[0]), Err(BusError::Held));
            assert_eq!(held.write(0x68, &[0]).is_ok(), freed);
        }
    }
}
