//! Messy rigs: rigs as they are, and on top of them what nobody declared.
//!
//! What it is: a rig with line resistance, a rotor that follows, slow meters and coarse displays; a log with drop-outs, gaps, sparse
//! channels, sometimes no command; then nothing, a known effect, an unknown one, an event, or two of these.
//! What can go wrong: a cause that the schedule does not show; [`size`] says which, from the generator's own truth.
//! Units: SI, rev/min, us; sizes in noise floors.
//! Reference: specification `closing-the-loop.md`, "What counts as proof".

pub mod dirt;
pub mod scenario;
pub mod score;
pub mod size;
pub mod tally;
