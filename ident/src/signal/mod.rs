//! What a channel's samples are by themselves: noise, colour, bad samples, stretches, the speed and the drive behind it.
//!
//! What it is: all that is read off a log before any relation between its channels is asked for.
//! What can go wrong: see each.
//! Units: those of the channels.
//! Reference: specification `closing-the-loop.md`, step 2.

pub mod bad;
pub(crate) mod colour;
pub mod consensus;
pub(crate) mod drive;
pub mod noise;
pub mod residual;
pub(crate) mod settle;
pub(crate) mod start;
pub mod stretches;
