//! Numbers of a description, within their range.
//!
//! What it is: what `serde` reads a number with where not every number makes sense.
//! What can go wrong: a number outside is refused, with what was expected and what was found.
//! Units: those of the key.
//! Reference: docs/scenario.md.

use serde::{Deserialize, Deserializer, de::Error};

/// A number for which `ok` holds.
pub(crate) fn checked<'de, D: Deserializer<'de>>(d: D, ok: impl Fn(f64) -> bool, expected: &str) -> Result<f64, D::Error> {
    let value = f64::deserialize(d)?;
    if ok(value) { Ok(value) } else { Err(D::Error::custom(format!("expected {expected}, found {value}"))) }
}

/// A number above nought.
#[cfg(feature = "files")]
pub(crate) fn positive<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| v > 0.0 && v.is_finite(), "a number above 0")
}

/// A number from nought.
pub(crate) fn not_negative<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    checked(d, |v| v >= 0.0 && v.is_finite(), "a number not below 0")
}
