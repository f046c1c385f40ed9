//! What the attitude filter costs.
//!
//! What it is: instructions that a cost image of the IMU board executes until it sleeps.
//! What can go wrong: an image that never sleeps runs to the end of the time and counts too much; compare with the time's own
//! count.
//! Units: instructions.
//! Reference: `firmware-ahrs/src/cost/`, `budgets/ahrs.toml`.

use super::machine::{EmulatedError, Machine, Pins, World, firmware, run};

/// Nothing happens outside.
#[derive(Debug, Default)]
struct Nothing;

impl World for Nothing {
    fn wake(&mut self, _: u64, _: &mut Pins<'_>) -> u64 {
        u64::MAX
    }
}

/// Instructions of the image `name` within `milliseconds`.
///
/// # Errors
/// [`EmulatedError`] when there is no image or the emulator gives up.
pub fn instructions(name: &str, milliseconds: u64) -> Result<u64, EmulatedError> {
    let elf = firmware(name)?;
    let (outcome, _) = run(&elf, Machine::new()?, Nothing, milliseconds * 1_000_000)?;
    Ok(outcome.instructions)
}
