//! What the simulated powerplant is built of.
//!
//! What it is: one part a file, gathered; effects change them before or in the midst of a run.
//! What can go wrong: nothing here fails.
//! Units: each part carries its own.
//! Reference: specification `rig.md`, "The simulator".

use super::{Air, Blade, Commutation, Flux, Limiter, Motor, Propeller, RoomAir, Supply, Thermal};

/// Parts of the simulated powerplant.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// Source and wiring.
    pub supply: Supply,
    /// Motor and ESC output stage.
    pub motor: Motor,
    /// Magnets, iron and timing of the motor.
    pub flux: Flux,
    /// Propeller.
    pub propeller: Propeller,
    /// Air.
    pub air: Air,
    /// The room around the rotor.
    pub room: RoomAir,
    /// Temperature node.
    pub thermal: Thermal,
    /// The density of the air follows the room temperature.
    pub air_follows_room: bool,
    /// ESC output stage.
    pub limiter: Limiter,
    /// Loss of the rotor's angle.
    pub commutation: Commutation,
    /// Departure of the blades from the square law.
    pub blade: Blade,
    /// Turbulence: relative standard deviation of the drag torque.
    pub gust: f64,
}
