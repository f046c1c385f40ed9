//! The IMU board on the emulator: its chips on the I2C bus, fed by a body whose motion is known, and a user at the line.
//!
//! What it is: the chips of [`crate::imu`] as peers of the emulated I2C1, and the board's surroundings that let a chip go or hold the bus,
//! say what a user says, press the reset key and cut the supply in the midst of a store.
//! What can go wrong: see [`crate::imu`]; a chip whose reading ends in an acknowledged byte is counted in [`AhrsRun::unfinished`].
//! Units: counts; ns since power-up.
//! Reference: RM0090 section 27; crate rigless 0.4.

use super::machine::{EmulatedError, Machine, Outcome, Pins, Port, World, firmware, run};
pub use crate::imu::{BusFault, ChipKind, Errors, Motion, SensorChip, Served};
use crate::native::ahrs::ImuRig;
use rigless::{
    chip::{Timeline, i2c},
    snapshot::Store,
};
use std::collections::VecDeque;

/// A chip of ours as a peer of the emulated bus.
#[derive(Debug)]
struct Peer(SensorChip);

impl Store for Peer {}

impl i2c::Peer for Peer {
    fn start(&mut self, address: u8, read: bool, line: &mut Timeline<'_, '_>) -> bool {
        self.0.start(address, read, line.now().0)
    }

    fn write(&mut self, byte: u8, _: &mut Timeline<'_, '_>) -> bool {
        self.0.write(byte);
        true
    }

    fn read(&mut self, last: bool, _: &mut Timeline<'_, '_>) -> u8 {
        self.0.read(last)
    }

    fn stop(&mut self, _: &mut Timeline<'_, '_>) {
        self.0.stop();
    }
}

/// What is done to the board.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Act {
    /// Says these bytes on the line.
    Say(Vec<u8>),
    /// Presses the reset key.
    Reset,
    /// The serial line shows an overrun without a byte.
    Overrun,
    /// Lets the supply fail at the store of this number from now on; the board is reset then.
    FailAtStore(u32),
}

/// What happens around the IMU board.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ImuWorld {
    fault: BusFault,
    /// What is done, by time, ns.
    script: VecDeque<(u64, Act)>,
    /// The supply may fail: look often.
    failing: bool,
    pulled_up: bool,
    held: bool,
    clock_high: bool,
    /// Rising edges of SCL while the data line was held.
    pub clocks_seen: u32,
}

/// Pins of the bus: port B.
const SCL: u8 = 6;
const SDA: u8 = 7;

impl ImuWorld {
    fn hold(&mut self, held: bool, pins: &mut Pins<'_>) {
        self.held = held;
        self.clock_high = pins.level(Port::B, SCL);
        pins.hold_i2c(held);
        pins.drive(Port::B, SDA, !held);
    }

    /// Does what is due; gives the time of what comes next.
    fn act(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64 {
        let mut reset = self.failing && pins.has_failed();
        while let Some((_, act)) = self.script.pop_front_if(|(at, _)| *at <= now_ns) {
            match act {
                Act::Say(bytes) => pins.say(&bytes),
                Act::Reset => reset = true,
                Act::Overrun => pins.overrun_serial(),
                Act::FailAtStore(nth) => {
                    pins.fail_at_store(nth);
                    self.failing = true;
                }
            }
        }
        if reset {
            pins.press_reset();
            self.pulled_up = false; // levels from outside are to be driven again
            self.failing = false;
            return now_ns + LOOK_NS;
        }
        let look = if self.failing { now_ns + LOOK_NS } else { u64::MAX };
        self.script.front().map_or(look, |(at, _)| look.min(*at))
    }
}

/// Time between two looks at a supply that may fail, ns.
const LOOK_NS: u64 = 100_000;

impl World for ImuWorld {
    fn wake(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64 {
        if !self.pulled_up {
            pins.drive(Port::B, SCL, true);
            pins.drive(Port::B, SDA, true);
            self.pulled_up = true;
        }
        let next = self.act(now_ns, pins);
        next.min(match self.fault {
            BusFault::None => u64::MAX,
            BusFault::LoosePlug { nth, off_ns, back_ns } => {
                pins.unplug(nth, (off_ns..back_ns).contains(&now_ns));
                [off_ns, back_ns].into_iter().find(|at| *at > now_ns).unwrap_or(u64::MAX)
            }
            BusFault::HeldData { from_ns, .. } if now_ns < from_ns => from_ns,
            BusFault::HeldData { .. } => {
                self.hold(true, pins);
                u64::MAX
            }
        })
    }

    fn watches(&self) -> bool {
        self.held
    }

    fn accessed(&mut self, _: Option<(u64, u64)>, pins: &mut Pins<'_>) {
        let high = pins.level(Port::B, SCL);
        self.clocks_seen += u32::from(high && !self.clock_high);
        self.clock_high = high;
        if matches!(self.fault, BusFault::HeldData { clocks, .. } if clocks > 0 && self.clocks_seen >= clocks) {
            self.hold(false, pins);
        }
    }
}

/// What an IMU run leaves behind.
#[derive(Debug)]
pub struct AhrsRun {
    /// The run itself.
    pub outcome: Outcome<ImuWorld>,
    /// What each chip handed out, in the order of [`ChipKind::ALL`]; empty for a chip that was not fitted.
    pub served: [Vec<Served>; 3],
    /// What the test accelerometer handed out; empty where none was fitted.
    pub test_served: Vec<Served>,
    /// Stores to the settings' flash.
    pub stores: u32,
    /// Reads whose last byte was acknowledged, so that the chip still drove the bus at their end.
    pub unfinished: u32,
}

/// Runs the IMU image for `milliseconds` with ideal chips, those in `fitted`, on a body that moves as `motion`.
///
/// # Errors
/// [`EmulatedError`] when there is no image or the emulator gives up.
pub fn ahrs(motion: Motion, fitted: &[ChipKind], fault: BusFault, milliseconds: u64) -> Result<AhrsRun, EmulatedError> {
    ahrs_with(&ImuRig { motion, fitted: fitted.to_vec(), fault, ..ImuRig::default() }, milliseconds)
}

/// Runs the IMU image on everything that the native run is given: chips with errors, hidden effects, bus faults.
///
/// # Errors
/// [`EmulatedError`] when there is no image or the emulator gives up.
pub fn ahrs_with(rig: &ImuRig, milliseconds: u64) -> Result<AhrsRun, EmulatedError> {
    ahrs_in(ImuWorld { fault: rig.fault, ..ImuWorld::default() }, rig, milliseconds)
}

/// Runs the image on a body that moves as `motion`, with a `script` of what is done to the board, by ms since power-up.
///
/// # Errors
/// [`EmulatedError`] when there is no image or the emulator gives up.
pub fn ahrs_by_script(
    motion: Motion,
    fitted: &[ChipKind],
    errors: &Errors,
    script: &[(u64, Act)],
    milliseconds: u64,
) -> Result<AhrsRun, EmulatedError> {
    let script = script.iter().map(|(ms, act)| (ms * 1_000_000, act.clone())).collect();
    let rig = ImuRig { motion, fitted: fitted.to_vec(), errors: *errors, ..ImuRig::default() };
    ahrs_in(ImuWorld { script, ..ImuWorld::default() }, &rig, milliseconds)
}

fn ahrs_in(world: ImuWorld, rig: &ImuRig, milliseconds: u64) -> Result<AhrsRun, EmulatedError> {
    let elf = firmware("firmware-ahrs")?;
    let mut machine = Machine::new()?;
    for kind in &rig.fitted {
        machine.mcu.i2c1.inner.attach(Peer(SensorChip::new(*kind, rig.body(), &rig.errors).with(&rig.hidden)));
    }
    let (outcome, mut machine) = run(&elf, machine, world, milliseconds * 1_000_000)?;
    let mut unfinished = 0;
    let mut record = |kind: ChipKind| {
        let place = rig.fitted.iter().position(|f| *f == kind);
        let chip = place.and_then(|n| machine.mcu.i2c1.inner.chip_mut::<Peer>(n));
        chip.map_or_else(Vec::new, |chip| {
            unfinished += chip.0.unfinished;
            std::mem::take(&mut chip.0.served)
        })
    };
    let served = ChipKind::ALL.map(&mut record);
    let test_served = record(ChipKind::Lis3dh);
    let stores = machine.mcu.flash.stores;
    Ok(AhrsRun { outcome, served, test_served, stores, unfinished })
}
