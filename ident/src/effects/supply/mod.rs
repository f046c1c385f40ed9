//! What the supply and the speed controller do: resistance, charge, limits of the current, heat.
//!
//! What it is: one file an effect.
//! What can go wrong: see each.
//! Units: V, A, ohm, Ah; stated on each parameter.
//! Reference: specification `closing-the-loop.md`, list of effects.

pub(super) mod battery_discharge;
pub(super) mod battery_relaxation;
pub(crate) mod cell;
pub(super) mod current_limit;
pub(crate) mod supply_sag;
pub(crate) mod supply_voltage;
pub(super) mod thermal_derate;
