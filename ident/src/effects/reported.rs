//! A fitted parameter as a verdict reports it.
//!
//! What it is: value, unit and interval.
//! What can go wrong: an error that is not known gives the interval of what is known at all.
//! Units: stated with each.
//! Reference: specification `formats.md`, verdict.

use super::{Estimate, Shape};
use crate::channel::unit_of;
use crate::verdict::Parameter;

/// Unit of a parameter that has the unit of whatever channel its effect is on.
const OF_CHANNEL: &str = "channel";

/// A parameter with its interval. Where its standard error is not known the interval is what is known at all: the range of the shape,
/// or for an amplitude everything from nothing to twice its size.
pub(crate) fn parameter(e: &Estimate, shapes: &[Shape], channel: &str) -> Parameter {
    let range = shapes.iter().find(|s| s.name == e.name && s.range.1 > s.range.0).map(|s| s.range);
    // what cannot be below zero is not
    let least = if shapes.iter().any(|s| s.name == e.name && s.range.0 >= 0.0) { 0.0 } else { f64::NEG_INFINITY };
    let ci95 = match range {
        _ if e.se.is_finite() => [(e.value - 1.96 * e.se).max(least.min(e.value)), e.value + 1.96 * e.se],
        Some((from, to)) => [from.min(e.value), to.max(e.value)],
        None => [e.value - e.value.abs(), e.value + e.value.abs()],
    };
    let unit = if e.unit == OF_CHANNEL { unit_of(channel).to_owned() } else { e.unit.clone() };
    Parameter { name: e.name.clone(), value: e.value, unit, ci95 }
}
