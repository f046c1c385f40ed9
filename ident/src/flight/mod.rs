//! Closing the loop on a flight: what the declared model of a flying vehicle leaves over, why, and the corrected model.
//!
//! What it is: a flight log becomes channels through a stated filter (`windows`, `channels`); the declared model (`declared`) and the effects
//! of `effects/` become columns (`library`); the attribution does the rest (`crate::attribution::columns`).
//! What can go wrong: a log that is too short, or that lacks what the model is made of, is refused with what it lacks.
//! Units: SI; rad/s; body FRD, earth NED.
//! Reference: specification `flight.md`, "The loop on flights".

pub mod channels;
mod close;
pub mod columns;
mod declared;
pub mod effects;
pub mod library;
pub mod model;
pub(crate) mod nameless;
pub mod predict;
pub mod record;
mod rows;
pub mod scene;
pub(crate) mod standard;
pub mod vehicle;
pub(crate) mod vibration;
pub mod windows;
mod words;

pub use close::{Closed, Shown, close, told};
pub use model::{FORMAT as MODEL_FORMAT, FlightModel};

/// Standard gravity, m/s^2.
pub(crate) const G: f64 = 9.806_65;
/// rev/min of one rad/s.
pub(crate) const RPM: f64 = 60.0 / std::f64::consts::TAU;

/// Shortest flight in the air, s: below it nothing can be left out and predicted.
pub const SHORTEST_S: f64 = 4.0;

/// Why a flight cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlightError {
    /// It lacks a column.
    #[error("{name}: holds {reason}")]
    Lacks {
        /// Log.
        name: String,
        /// What is not there.
        reason: String,
    },
    /// Metadata that cannot be read.
    #[error("{name}: {reason}")]
    Meta {
        /// Log.
        name: String,
        /// Key, value and what is expected.
        reason: String,
    },
    /// A model file that cannot be taken.
    #[error("{file}: {reason}; expected a model written by `quadrig close-loop` on a flight log")]
    Model {
        /// File and line.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// A speed that reads nothing throughout.
    #[error(
        "{name}: column {column}: reads nothing while the others turn; expected its speed: take the column out, or mend the sensor; without it force and moments go with the pulses"
    )]
    Silent {
        /// Log.
        name: String,
        /// Column.
        column: String,
    },
    /// Readings that no model can be fitted to.
    #[error(
        "{name}: nothing can be fitted to {seconds:.1} s in the air; expected readings that move in every column: one that holds the same number throughout is the usual reason, take it out"
    )]
    Unfit {
        /// Log.
        name: String,
        /// What there is in the air, s.
        seconds: f64,
    },
    /// Too short.
    #[error(
        "{name}: {seconds:.1} s in the air with all its readings; expected at least {SHORTEST_S} s, to leave stretches out and predict them"
    )]
    Short {
        /// Log.
        name: String,
        /// What there is.
        seconds: f64,
    },
}
