//! Faults of the I2C bus from a scenario.
//!
//! What it is: the scenario's `i2c_nack` and `i2c_stuck` as the emulated IMU board takes them.
//! What can go wrong: the board takes one bus fault a run; the first of the scenario counts.
//! Units: s in the scenario, from power-up of the board; ns here.
//! Reference: docs/scenario.md, "Faults".

use super::ahrs::BusFault;
use crate::scenario::{FaultKind, Scenario};

/// Clocks after which a stuck chip lets go: the nine that a master gives it.
const FREEING_CLOCKS: u32 = 9;

/// The bus fault that a scenario schedules.
#[must_use]
pub fn bus_fault(scenario: &Scenario) -> BusFault {
    let ns = |s: f64| (s * 1.0e9) as u64;
    for fault in &scenario.faults {
        match fault.kind {
            FaultKind::I2cNack { chip } => {
                return BusFault::LoosePlug { nth: usize::from(chip), off_ns: ns(fault.from_s), back_ns: ns(fault.until_s) };
            }
            FaultKind::I2cStuck => return BusFault::HeldData { from_ns: ns(fault.from_s), clocks: FREEING_CLOCKS },
            _ => {}
        }
    }
    BusFault::None
}
