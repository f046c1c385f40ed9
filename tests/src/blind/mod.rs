//! Blind campaign: a second generator that shares no code with simulator or library, and the scorer.
//!
//! What it is: seed -> rig, schedule, effects -> the text of two logs; only that text reaches the tool; the scorer compares.
//! What can go wrong: an effect that leaves less over than was drawn even at its largest is recorded at the size that it has.
//! Units: SI, rev/min, us; sizes in noise floors.
//! Reference: specification `closing-the-loop.md`, "What counts as proof".

pub mod chance;
pub mod effect;
pub mod fit;
pub mod history;
pub mod messy;
pub mod resume;
pub mod rig;
pub mod run;
pub mod scenario;
pub mod schedule;
pub mod score;
pub mod simulated;
pub mod tally;
pub mod unknown;
pub mod write;
