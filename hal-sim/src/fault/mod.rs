//! Faults of the rig: what can go wrong, what the board must do about it, and the campaign that tries it.
//!
//! What it is: kinds of mishap with their place ([`Mishap`]), a seeded choice of kind, time, rig and throttle ([`Plan`]), what the
//! specification asks for ([`Rule`]), one flight of a plan on the native board ([`flight`]), its judgement ([`judge`]) and the table of many
//! ([`Tally`]). The flash image flies the same plans under the same rules.
//! What can go wrong: a plan that never reaches its mishap is reported as a failure, not as a pass.
//! Units: ms.
//! Reference: specification `rig.md`, "Protection", "On a real bench" and "The simulator" (faults at any time).

pub mod flight;
mod host;
mod injury;
pub mod judge;
mod mishap;
mod operator;
mod plan;
mod rig;
mod rule;
mod tally;
mod words;

pub use host::arming_beep;
pub use injury::{Injury, PING_MS, by_hand};
pub use judge::{Failure, Observed, Survived, Wrong, judge};
pub use mishap::{Mishap, Request};
pub use plan::{Course, Phase, Plan};
pub use rig::Preset;
pub use rule::{Answer, REACTION_MS, Rule};
pub use tally::{Row, Tally, fly_all};
