//! What of the powerplant follows from its parts alone.
//!
//! What it is: products and quotients of the parts that would otherwise be found anew each millisecond.
//! What can go wrong: parts that change leave it behind; whoever changes them makes it anew.
//! Units: SI.
//! Reference: `docs/speed.md`.

use super::flux::Flux;
use super::parts::Parts;

/// What follows from the parts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fixed {
    pub(super) torque_constant: f64,
    pub(super) friction_nm: f64,
    /// Of the air at run start.
    pub(super) density: f64,
    /// The same over that for which the propeller's coefficients hold.
    pub(super) relative_density: f64,
    /// Magnets, iron and timing change the torque constant.
    pub(super) flux_acts: bool,
    winding_ohm: f64,
    /// Duty and resistance of the line with the conductance that they make.
    conductance: (f64, f64, f64),
}

impl Fixed {
    /// Of `parts`.
    pub(super) fn of(parts: &Parts) -> Self {
        let density = parts.air.density();
        Self {
            torque_constant: parts.motor.torque_constant(),
            friction_nm: parts.motor.friction_nm(),
            density,
            relative_density: density / parts.propeller.reference_density,
            flux_acts: parts.flux != Flux::default(),
            winding_ohm: parts.motor.resistance_ohm,
            conductance: (f64::NAN, f64::NAN, f64::NAN),
        }
    }

    /// Conductance of the winding with the line seen through `duty`, 1/ohm: found once for as long as both stand still.
    #[inline]
    pub(super) fn per_ohm(&mut self, duty: f64, line_ohm: f64) -> f64 {
        if (duty, line_ohm) != (self.conductance.0, self.conductance.1) {
            self.conductance = (duty, line_ohm, 1.0 / (self.winding_ohm + duty * duty * line_ohm));
        }
        self.conductance.2
    }
}
