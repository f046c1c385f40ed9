//! Schedules of the host: from a file to the pulses of a rig board.
//!
//! What it is: [`Plan::read`] turns a schedule file, a verdict's next experiment or a log's pulses into segments
//! ([`frame::schedule::Segment`]); a [`Player`] sends them to a board, ahead of their playing where they are too many for its memory,
//! and does what only a host can: wait until a channel has settled, keep thrust or speed constant, end a run at a supply's limit. The
//! simulator's host and the command line use the same player: the same file gives the same pulses.
//!
//! What can go wrong: a file that is none is refused in one line with its place; a board that does not answer or a channel that
//! is missing ends the run ([`Player::failure`]), and its owner stops the motor. What the host cannot send in time the board itself
//! notices: it goes to minimum and latches `schedule ran dry`.
//!
//! Units: us, s and Hz in files; nanoseconds, milliseconds and millihertz on the line.
//!
//! Reference: specification `rig.md`, "ESC pulse and arming" and "The operator's side"; `docs/schedule.md` lists every key.
#![forbid(unsafe_code)]

mod error;
mod file;
mod job;
mod next;
pub mod part;
mod plan;
mod player;
mod replay;
mod table;

pub use error::ScheduleError;
pub use job::{Channel, Job, Otherwise};
pub use part::Part;
pub use plan::{Place, Plan};
pub use player::Player;
pub use replay::{Replay, replay};
