//! Runs of the rig image on its bench, and what they leave behind.
//!
//! What it is: a machine, an image, a scenario's bench and an operator together for so many milliseconds.
//! What can go wrong: [`EmulatedError`]: no image, or the emulator gives up.
//! Units: ms; ns since power-up of the board.
//! Reference: `emulated/rig.rs`.

use super::{MS, Operator, RigWorld, SeenPulse};
use crate::bench::Truth;
use crate::emulated::flash::Caches;
use crate::emulated::machine::{self, EmulatedError, Machine, Outcome, firmware};
use crate::emulated::pulse::SeenFrame;
use crate::scenario::Scenario;
use frame::message::Message;
use frame::units::Ticks;
use frame::wire::LinkStats;
use std::path::Path;

/// What a rig run leaves behind.
#[derive(Debug)]
pub struct RigRun<O> {
    /// The operator as the run left them.
    pub operator: O,
    /// Every decoded message with the board's time of sending.
    pub messages: Vec<(Ticks, Message)>,
    /// Counters of the host's decoder.
    pub link: LinkStats,
    /// When the reset key was pressed, ns.
    pub resets: Vec<u64>,
    /// Every pulse on the ESC pin.
    pub pulses: Vec<SeenPulse>,
    /// Everything else that it carried: DShot frames.
    pub frames: Vec<SeenFrame>,
    /// When the stops of [`Action::StopBeforePulse`](super::Action::StopBeforePulse) came, ns.
    pub stops: Vec<u64>,
    /// What was really there, every millisecond.
    pub truth: Vec<(u64, Truth)>,
    /// Stores to the settings' flash.
    pub stores: u32,
    /// Its erases, and the caches in front of it.
    pub caches: Caches,
    /// The run itself.
    pub outcome: Outcome<()>,
}

/// Runs the rig image for `milliseconds` on the bench of `scenario` with `operator` at the host.
///
/// # Errors
/// [`EmulatedError`] when there is no image or the emulator gives up.
pub fn rig<O: Operator + 'static>(scenario: &Scenario, operator: O, milliseconds: u64) -> Result<RigRun<O>, EmulatedError> {
    rig_on(Machine::new()?, scenario, operator, milliseconds)
}

/// The same on a given machine.
///
/// # Errors
/// As [`rig`].
pub fn rig_on<O: Operator + 'static>(
    board: Machine,
    scenario: &Scenario,
    operator: O,
    milliseconds: u64,
) -> Result<RigRun<O>, EmulatedError> {
    rig_from(&firmware("firmware-rig")?, board, scenario, operator, milliseconds)
}

/// The same with the image at `elf`.
///
/// # Errors
/// As [`rig`].
pub fn rig_from<O: Operator + 'static>(
    elf: &Path,
    board: Machine,
    scenario: &Scenario,
    operator: O,
    milliseconds: u64,
) -> Result<RigRun<O>, EmulatedError> {
    let (outcome, board) = machine::run(elf, board, RigWorld::new(scenario, operator), milliseconds * MS)?;
    let Outcome { world, telemetry, now_ns, instructions, accesses } = outcome;
    Ok(RigRun {
        operator: world.operator,
        messages: world.messages,
        link: world.decoder.stats(),
        resets: world.resets,
        pulses: world.pulses,
        frames: world.frames,
        stops: world.stops,
        truth: world.truth,
        stores: board.mcu.flash.stores,
        caches: board.mcu.flash.caches,
        outcome: Outcome { world: (), telemetry, now_ns, instructions, accesses },
    })
}
