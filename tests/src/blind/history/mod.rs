//! Blind rigs with a history: the runs of one rig over weeks, with one change or none.
//!
//! What it is: seed -> a rig of its own, its days, and what changes from one run on (or drifts, or nothing); only the texts of its logs reach
//! the tool; the scorer compares.
//! What can go wrong: a change that no channel of the rig shows is drawn again.
//! Units: sizes in noise floors of the channel that shows the change most; gains, blades and friction over the whole.
//! Reference: docs/history.md.

pub mod life;
pub mod score;
pub mod tally;
