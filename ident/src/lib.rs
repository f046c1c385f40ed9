//! From a log to the powerplant model, what it leaves over, the cause of that, and the corrected model.
//!
//! What it is: `log -> plateaus -> fits -> residual -> effect -> corrected model`, each arrow one function that can be called alone.
//! What can go wrong: unusable input is refused with its place; a residual that no known effect explains is said to be one.
//! Units: SI, rev/min and microseconds, as the column names say.
//! Reference: specification `identification.md` and `closing-the-loop.md`.
#![forbid(unsafe_code)]

pub mod almanac;
pub mod attribution;
pub mod bad;
pub mod beam;
mod beside;
pub mod board;
pub mod circle;
pub mod close;
mod colour;
mod conclude;
pub mod context;
mod correction;
pub mod course;
pub mod date;
pub mod design;
pub mod diagnose;
mod drive;
pub mod effects;
pub mod experiment;
pub mod fit;
pub mod flight;
pub mod flight_log;
pub mod heldout;
pub mod history;
pub mod hypothesis;
pub mod identify;
pub mod import;
pub mod inertial;
pub mod inspect;
pub mod isolability;
pub mod join;
pub mod leftover;
pub mod log;
pub mod long;
mod marks;
pub mod model;
mod moment;
pub mod noise;
mod opponent;
pub(crate) mod parallel;
pub mod plateau;
pub mod quantity;
mod read_off;
mod remembered;
pub mod report;
pub mod residual;
mod revise;
pub mod rivals;
pub mod runs;
mod samples;
pub mod search;
pub mod select;
pub mod several;
pub mod shift;
pub mod simulate;
pub mod solve;
pub mod sparse;
mod split;
mod start;
mod steps;
mod supply_limit;
mod suspects;
mod together;
pub mod told;
pub mod unexplained;
pub mod verdict;
pub mod watch;
mod weather;
pub mod words;
