//! What meters, logger and command do to readings: filters, delays, clocks, held, rounded and absurd readings.
//!
//! What it is: one file an effect.
//! What can go wrong: see each.
//! Units: s, us; stated on each parameter.
//! Reference: specification `closing-the-loop.md`, list of effects.

pub(super) mod channel_delay;
pub(super) mod channel_filter;
pub(super) mod clock_drift;
pub(crate) mod glitch_rows;
pub(crate) mod quantisation;
pub(crate) mod sample_hold;
pub(super) mod throttle_quantisation;
