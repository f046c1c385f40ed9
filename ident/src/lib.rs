//! From a log to the powerplant model, what it leaves over, the cause of that, and the corrected model.
//!
//! What it is: `log -> plateaus -> fits -> residual -> effect -> corrected model`, each arrow one function that can be called alone. The rooms
//! stand below in the order of their dependencies: each imports from those above it only, which `tests/rooms.rs` holds.
//! What can go wrong: unusable input is refused with its place; a residual that no known effect explains is said to be one.
//! Units: SI, rev/min and microseconds, as the column names say.
//! Reference: specification `identification.md` and `closing-the-loop.md`.
#![forbid(unsafe_code)]

pub mod numeric;

pub mod log;

pub mod signal;

pub mod channel;

pub mod plateau;

pub mod verdict;

pub mod effects;

pub mod model;

pub mod identify;

pub mod fit;

pub mod attribution;

pub mod experiment;

pub mod close;

pub mod several;

pub mod isolability;

pub mod history;

pub mod inertial;

pub mod flight;

pub mod sizing;

pub mod report;
