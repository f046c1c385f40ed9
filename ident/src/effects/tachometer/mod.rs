//! What single speed sensors do: pulses lost or doubled, marks, slip, twist, the friction of an encoder.
//!
//! What it is: one file an effect.
//! What can go wrong: see each.
//! Units: rev/min; stated on each parameter.
//! Reference: specification `closing-the-loop.md`, list of effects.

pub(crate) mod alternating_period;
pub(super) mod blade_twist;
pub(super) mod coupling_slip;
pub(super) mod dead_rotor_speed;
pub(super) mod double_pulses;
pub(super) mod encoder_drag;
pub(super) mod missed_pulses;
pub(super) mod pulses;
pub(super) mod speed_channel;
