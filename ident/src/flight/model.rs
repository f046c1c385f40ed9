//! The corrected model of a flight, `model.toml` of a flight log.
//!
//! What it is: the declared model's coefficients and those of every effect that was found, enough to predict the flight again or another one
//! of the same vehicle from its log.
//! What can go wrong: a file that is not of this format is refused with its line.
//! Units: stated in the comment above each effect; coefficients are over the mass (m/s^2 for a force).
//! Reference: specification `formats.md`, "Powerplant model" (scope).

use super::FlightError;
use super::columns::Usual;
use super::vehicle::Vehicle;
use crate::model::ending;
use crate::numeric::digits;
use crate::verdict::Parameter;
use crate::verdict::Scope;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// First key of the format.
pub const FORMAT: &str = crate::model::OF_FLIGHT;

/// The model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightModel {
    /// [`FORMAT`].
    pub format: String,
    /// Log that it was identified from.
    pub source: String,
    /// First and last time of that log, s.
    pub span_s: [f64; 2],
    /// The vehicle, as that log's metadata have it.
    pub vehicle: Vehicle,
    /// Usual sizes over that log, of which some coefficients are multiples.
    pub usual: Usual,
    /// Coefficients of the declared model.
    pub declared: Vec<Coefficient>,
    /// What was added.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effect: Vec<Added>,
}

/// A number with its standard error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coefficient {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard error.
    pub se: f64,
}

/// An effect, or with the id `unknown` a function without a name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Added {
    /// Its name.
    pub id: String,
    /// Which of its forms; empty where it has one.
    pub form: String,
    /// What it belongs to.
    pub scope: Scope,
    /// Its shapes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shape: Vec<Coefficient>,
    /// Its amplitudes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub amplitude: Vec<Coefficient>,
    /// Knots of a function without a name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub knots: Vec<f64>,
}

impl FlightModel {
    /// The file's text; `told` are each effect's parameters in the units of the verdict, written above it for people.
    ///
    /// # Panics
    /// Never: the model is a table of numbers and words.
    #[must_use]
    pub fn to_toml(&self, told: &[Vec<Parameter>]) -> String {
        let text = toml::to_string(&self.to_its_digits()).expect("a table of numbers and words");
        let mut out = String::new();
        let mut told = told.iter();
        for line in text.lines() {
            if line == "[[effect]]" {
                for p in told.next().into_iter().flatten() {
                    let [lo, hi] = p.ci95;
                    let number = crate::numeric::digits::number;
                    let _ =
                        writeln!(out, "# {} = {} {} (95 %: {} to {})", p.name, number(p.value), p.unit, number(lo), number(hi));
                }
            }
            out += line;
            out.push('\n');
        }
        ending::framed(&out)
    }

    /// Each number to the digits that its standard error supports.
    fn to_its_digits(&self) -> Self {
        let mut out = self.clone();
        let of_effects = out.effect.iter_mut().flat_map(|e| e.shape.iter_mut().chain(&mut e.amplitude));
        for c in out.declared.iter_mut().chain(of_effects) {
            (c.value, c.se) = (digits::of_value(c.value, c.se), digits::of_error(c.se));
        }
        out.effect.iter_mut().flat_map(|e| &mut e.knots).for_each(|k| *k = digits::plain(*k));
        let usual = &mut out.usual;
        let [middle, spread] = &mut usual.command;
        let [volts, amperes] = &mut usual.supply;
        let sizes = [&mut usual.sum, &mut usual.squares, &mut usual.turning, &mut usual.arm, &mut usual.rpm, &mut usual.start];
        sizes.into_iter().chain([middle, spread, volts, amperes]).for_each(|v| *v = digits::plain(*v));
        out
    }

    /// Reads the file's text; `file` is the name for messages.
    ///
    /// # Errors
    /// [`FlightError::Model`] with the place.
    pub fn parse(file: &str, text: &str) -> Result<Self, FlightError> {
        let refuse = |line: usize, reason: String| FlightError::Model { file: format!("{file}:{line}"), reason };
        if let Some((line, column, reason)) = ending::cut_short(text) {
            return Err(FlightError::Model { file: format!("{file}:{line}:{column}"), reason });
        }
        let model: Self = toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(1, |s| text[..s.start.min(text.len())].matches('\n').count() + 1);
            refuse(line, e.message().lines().next().unwrap_or("not TOML").to_owned())
        })?;
        if model.format != FORMAT {
            return Err(refuse(1, format!("format is {:?}; expected a flight's, {FORMAT:?}", model.format)));
        }
        let all = model.declared.iter().chain(model.effect.iter().flat_map(|e| e.shape.iter().chain(&e.amplitude)));
        if let Some(bad) = all.into_iter().find(|c| !(c.value.is_finite() && c.se.is_finite() && c.se >= 0.0)) {
            return Err(refuse(1, format!("{} = {} with the standard error {}", bad.name, bad.value, bad.se)));
        }
        Ok(model)
    }
}
