//! From a log to the powerplant model, what it leaves over, the cause of that, and the corrected model.
//!
//! What it is: `log -> plateaus -> fits -> residual -> effect -> corrected model`, each arrow one function that can be called alone. The rooms
//! stand below in the order of their dependencies: each imports from those above it only, which `tests/rooms.rs` holds.
//! What can go wrong: unusable input is refused with its place; a residual that no known effect explains is said to be one.
//! Units: SI, rev/min and microseconds, as the column names say.
//! Reference: specification `identification.md` and `closing-the-loop.md`.
#![forbid(unsafe_code)]

// arithmetic that knows no rig: medians, least squares, a simplex search, digits, threads
pub mod numeric;

// the file formats, other people's exports, dates and quantities, several loggers on one clock, what a board says of itself
pub mod log;

// what samples are by themselves: noise and its colour, bad samples, stretches, the speed of several sensors, the drive behind it
pub mod signal;

// a log made ready for questions: relations, targets, regressors
pub mod channel;

// stretches in which the rig stands still, and the binary shift that cuts them
pub mod plateau;

// the contract of a verdict as types, and the words that tell of it
pub mod verdict;

// the library of causes, one file each, and the designs whose columns they change
pub mod effects;

// the powerplant model: its file, what it predicts, on which run, how far, and what it is off by
pub mod model;

// curves through the plateaus, constants, quality: the thesis' powerplant
pub mod identify;

// a hypothesis fitted: separable least squares, the search for shapes, errors on rows that it did not see
pub mod fit;

// which causes stand behind a residual, how sure that is, and what is left
pub mod attribution;

// the next run: the schedule on which two hypotheses differ most
pub mod experiment;

// the loop itself: log in, verdict and corrected model out; its steps, its yardstick, a run watched while it goes on
pub mod close;

// several runs of one rig, in one fit
pub mod several;

// which causes a schedule can tell apart, and from which size on
pub mod isolability;

// a rig's constants run by run, and what changed when
pub mod history;

// the loop on an attitude log
pub mod inertial;

// the loop on a flight, with the effects of an airframe
pub mod flight;

// what a designer decides: motor, propeller, batteries, the beam of the load cell
pub mod sizing;

// pages, figures and text of all of these
pub mod report;
