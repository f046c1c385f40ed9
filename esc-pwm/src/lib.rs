//! From a command to an ESC pulse that is always safe.
//!
//! What it is: exact pulse arithmetic ([`timer`]) and the same throttle as DShot frames ([`dshot`]), the arming machine as a table ([`arming`]), throttle schedules as
//! pure functions of elapsed time ([`schedule`]) or segments of a host ([`track`]), and the limits that bring the throttle to minimum ([`protection`]).
//!
//! What can go wrong: a timer clock that cannot divide the 20 ms period exactly is refused at construction; every
//! refused command lists all of its reasons; every tripped limit latches until the operator clears it.
//!
//! Units: nanoseconds of pulse, timer ticks, milliseconds of schedule; SI for the limits.
//!
//! Reference: specification `rig.md`, "ESC pulse and arming"; Beharie 2013, section 3.2 and Appendix C.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing))]

#[cfg(test)]
extern crate std;

pub mod arming;
pub mod dshot;
pub mod fault;
pub mod output;
pub mod protection;
pub mod schedule;
pub mod segment;
pub mod state;
pub mod timer;
pub mod track;
pub mod units;

pub use arming::{ArmingEvent, ArmingTimes, Objections, Outcome, Transition, pulse_for, step, time_out};
pub use dshot::{EscOutput, FrameTimer, Throttle};
pub use fault::{Fault, FaultSet, Refusals};
pub use output::{OutputError, PulseOutput};
pub use protection::{Bounds, Limits, Protection, Readings};
pub use schedule::{Chirp, Schedule, Slew, Staircase, ThrottleCurve};
pub use segment::{Segment, Shape, Steer};
pub use state::State;
pub use timer::{PulseTimer, TimerError};
pub use track::{Played, TRACK, Track};
pub use units::PulseWidth;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
