//! A body that flies: attitude, rotors, drag, wind, ground.
//!
//! What it is: [`RigidBody`] moves under forces and moments ([`body`]); an [`Airframe`] says what it weighs and where its rotors sit;
//! [`Wind`] blows; [`Vibration`] shakes; [`Autopilot`] steers; [`Vehicle`] puts them together with one [`crate::Powerplant`] a rotor and takes a pulse for each.
//! What can go wrong: nothing here fails; a powerplant that gives a NaN or a negative speed is taken as a resting rotor.
//! Units: SI; us for pulses, rev/min for rotor speed. Earth frame NED, body frame FRD; rotor axes lie along -z of the body.
//! Reference: Beharie 2013 chapters 2 and 7 as corrected in the errata; specification `flight.md`.

pub mod airframe;
pub mod attitude;
pub mod autopilot;
pub mod body;
pub mod ground;
mod rotors;
pub mod vehicle;
pub mod vibration;
pub mod wind;

pub use airframe::{Airframe, Rotor};
pub use autopilot::{Autopilot, Gains};
pub use body::{Acting, Motion, RigidBody};
pub use ground::Ground;
pub use vehicle::{Flying, Vehicle};
pub use vibration::Vibration;
pub use wind::Wind;

/// A vector in space.
pub type Vector = nalgebra::Vector3<f64>;
/// A three by three matrix.
pub type Matrix = nalgebra::Matrix3<f64>;
/// A rotation, body to earth.
pub type Rotation = nalgebra::UnitQuaternion<f64>;

/// Standard gravity, m/s^2 (CGPM 1901).
pub const G: f64 = 9.806_65;
