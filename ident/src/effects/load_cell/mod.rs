//! What the load cell does: zero, gain, creep, hysteresis, resonance, cross-talk, saturation.
//!
//! What it is: one file an effect.
//! What can go wrong: see each.
//! Units: N, N.m; stated on each parameter.
//! Reference: specification `closing-the-loop.md`, list of effects.

pub(super) mod amplifier_saturation;
pub(super) mod beam_resonance;
pub(super) mod creep;
pub(super) mod gain_change;
pub(super) mod hysteresis;
pub(super) mod tare_shift;
pub(super) mod thermal_zero;
pub(super) mod torque_crosstalk;
pub(super) mod zero_drift;
