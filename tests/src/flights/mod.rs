//! Blind flights: a generator of its own, the scorer, the tables.
//!
//! What it is: a vehicle, a route, a pilot and at most a few hidden effects, drawn by a seed; only the text of the flight log reaches the tool.
//! It shares no code with the simulator's body or with the library: its own rigid body, rotors from blade elements and momentum theory.
//! What can go wrong: an effect that a route hardly shows is drawn again with another strength; its size is told.
//! Units: SI; sizes in noise floors of a window.
//! Reference: specification `flight.md`, "The loop on flights" (proof); `closing-the-loop.md`, "Blind trials".

pub mod body;
pub mod campaign;
pub mod cause;
pub mod pilot;
pub mod rotor;
pub mod route;
pub mod scenario;
pub mod score;
pub mod sense;
pub mod size;
pub mod tally;
pub mod vehicle;
pub mod world;

/// Standard gravity, m/s^2.
pub const G: f64 = 9.806_65;
/// Density of the air, kg/m^3.
pub const AIR: f64 = 1.2;

/// A vector.
pub type V = [f64; 3];

/// Sum.
#[must_use]
pub fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// A multiple.
#[must_use]
pub fn times(k: f64, a: V) -> V {
    [k * a[0], k * a[1], k * a[2]]
}

/// Cross product.
#[must_use]
pub fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length.
#[must_use]
pub fn length(a: V) -> f64 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}
