//! What a designer decides: motor, propeller and batteries, and the beam of the load cell.
//!
//! What it is: selection by printed, measured or simulated figures, and the arithmetic of a cantilever.
//! What can go wrong: see each.
//! Units: newtypes of [`crate::log::quantity`].
//! Reference: specification `identification.md`.

pub mod beam;
pub mod select;
