//! What the rotor and the air about it do: inertia, friction, blades, Reynolds number, density, stall.
//!
//! What it is: one file an effect.
//! What can go wrong: see each.
//! Units: N, N.m, rev/min; stated on each parameter.
//! Reference: specification `closing-the-loop.md`, list of effects.

pub(crate) mod air_density;
pub(super) mod bearing_friction;
pub(super) mod blade_damage;
pub(super) mod blade_flex;
pub(super) mod coasting;
pub(super) mod reynolds_thrust;
pub(super) mod rotor_inertia;
pub(super) mod spinup_lag;
pub(super) mod stall;
