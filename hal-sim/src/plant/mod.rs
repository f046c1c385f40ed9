//! The things that the rig measures: what turns, bends and heats.
//!
//! What it is: one file for each part, parameters with their units and sources, states integrated at a fixed step.
//! What can go wrong: see each part.
//! Units: SI; rev/min and us at the edges.
//! Reference: specification `rig.md`, "The simulator"; errata for every figure.

pub mod air;
pub mod beam;
pub mod blade;
pub mod bridge;
pub mod commutation;
pub mod esc;
pub mod esc_guard;
pub mod esc_program;
mod fixed;
pub mod flux;
pub mod limiter;
pub mod meter;
pub mod motor;
pub mod mount;
pub mod parts;
pub mod powerplant;
pub mod propeller;
pub mod rig_plant;
pub mod room_air;
pub mod shaft;
pub mod supply;
pub mod thermal;

pub use air::Air;
pub use beam::Beam;
pub use blade::Blade;
pub use bridge::Bridge;
pub use commutation::Commutation;
pub use esc::{Esc, EscDialogue, EscState};
pub use esc_guard::{CutOff, Guard};
pub use flux::Flux;
pub use limiter::Limiter;
pub use meter::Meter;
pub use motor::Motor;
pub use mount::Mount;
pub use parts::Parts;
pub use powerplant::{BackEmf, PlantBlock, PlantLevers, PlantState, Powerplant};
pub use propeller::Propeller;
pub use rig_plant::RigPlant;
pub use room_air::RoomAir;
pub use supply::Supply;
pub use thermal::Thermal;
