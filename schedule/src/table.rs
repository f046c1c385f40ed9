//! One table of a schedule file, key by key.
//!
//! What it is: each key is taken with its range; what is left over at the end belongs to nobody and is refused with the keys that do.
//! What can go wrong: a missing key is refused at the table's kind, a wrong value at its own place.
//! Units: pulses in us, times in s, frequencies in Hz: each key says so in its name.
//! Reference: `docs/schedule.md`.

use frame::units::PulseWidth;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What was refused: the bytes, and why.
pub(crate) type Refused = (Range<usize>, String);

/// A table that is being read.
pub(crate) struct Keys<'t> {
    table: &'t DeTable<'t>,
    /// What it describes, for messages: "a chirp".
    what: String,
    /// Where that stands.
    place: Range<usize>,
    known: Vec<&'static str>,
}

impl<'t> Keys<'t> {
    /// The keys of a table that describes `what`.
    pub(crate) fn new(table: &'t DeTable<'t>, what: impl Into<String>, place: Range<usize>) -> Self {
        Self { table, what: what.into(), place, known: Vec::new() }
    }

    /// A value that may be missing.
    pub(crate) fn value(&mut self, key: &'static str) -> Option<&'t Spanned<DeValue<'t>>> {
        self.known.push(key);
        self.table.iter().find(|(name, _)| name.get_ref().as_ref() == key).map(|(_, value)| value)
    }

    fn needed<T>(&self, key: &str, value: Option<T>) -> Result<T, Refused> {
        value.ok_or_else(|| (self.place.clone(), format!("{}: expected {key}, which is missing", self.what)))
    }

    /// A number within a range, if it is there.
    pub(crate) fn number_if(&mut self, key: &'static str, low: f64, high: f64) -> Result<Option<f64>, Refused> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let number = number(value, key)?;
        if (low..=high).contains(&number) {
            Ok(Some(number))
        } else {
            Err((value.span(), format!("{key}: expected a number from {low} to {high}, found {number}")))
        }
    }

    /// A number within a range.
    pub(crate) fn number(&mut self, key: &'static str, low: f64, high: f64) -> Result<f64, Refused> {
        let value = self.number_if(key, low, high)?;
        self.needed(key, value)
    }

    /// A whole number within a range; 1 where it is missing.
    pub(crate) fn times(&mut self, key: &'static str, high: f64) -> Result<u32, Refused> {
        let number = self.number_if(key, 1.0, high)?.unwrap_or(1.0);
        let place = self.value(key).map_or(self.place.clone(), Spanned::span);
        if number.fract() == 0.0 {
            Ok(number as u32)
        } else {
            Err((place, format!("{key}: expected a whole number, found {number}")))
        }
    }

    /// A pulse, if it is there.
    pub(crate) fn pulse_if(&mut self, key: &'static str) -> Result<Option<PulseWidth>, Refused> {
        Ok(self.number_if(key, 1000.0, 2000.0)?.map(pulse))
    }

    /// A pulse.
    pub(crate) fn pulse(&mut self, key: &'static str) -> Result<PulseWidth, Refused> {
        let value = self.pulse_if(key)?;
        self.needed(key, value)
    }

    /// A time, milliseconds.
    pub(crate) fn time(&mut self, key: &'static str) -> Result<u32, Refused> {
        Ok(ms(self.number(key, SHORTEST_S, LONGEST_S)?))
    }

    /// A time in milliseconds, if it is there.
    pub(crate) fn time_if(&mut self, key: &'static str) -> Result<Option<u32>, Refused> {
        Ok(self.number_if(key, SHORTEST_S, LONGEST_S)?.map(ms))
    }

    /// Yes or no; no where it is missing.
    pub(crate) fn flag(&mut self, key: &'static str) -> Result<bool, Refused> {
        let Some(value) = self.value(key) else { return Ok(false) };
        value.get_ref().as_bool().ok_or_else(|| (value.span(), format!("{key}: expected true or false")))
    }

    /// A text, if it is there.
    pub(crate) fn text_if(&mut self, key: &'static str) -> Result<Option<&'t str>, Refused> {
        let Some(value) = self.value(key) else { return Ok(None) };
        value.get_ref().as_str().map(Some).ok_or_else(|| (value.span(), format!("{key}: expected a text in quotes")))
    }

    /// A text.
    pub(crate) fn text(&mut self, key: &'static str) -> Result<&'t str, Refused> {
        let value = self.text_if(key)?;
        self.needed(key, value)
    }

    /// A list, not empty.
    pub(crate) fn list(&mut self, key: &'static str) -> Result<&'t [Spanned<DeValue<'t>>], Refused> {
        let value = self.value(key);
        let value = self.needed(key, value)?;
        let list = value.get_ref().as_array().filter(|list| !list.is_empty());
        list.map(|list| &list[..]).ok_or_else(|| (value.span(), format!("{key}: expected a list that is not empty")))
    }

    /// Where a key stands; the table where it does not.
    pub(crate) fn place_of(&mut self, key: &'static str) -> Range<usize> {
        self.value(key).map_or(self.place.clone(), Spanned::span)
    }

    /// Refuses what nobody has asked for.
    pub(crate) fn finish(self) -> Result<(), Refused> {
        let strange = self.table.keys().find(|key| !self.known.contains(&key.get_ref().as_ref()));
        match strange {
            None => Ok(()),
            Some(key) => {
                let mut known = self.known;
                known.sort_unstable();
                known.dedup();
                let name = key.get_ref();
                Err((key.span(), format!("{} has no {name:?}; expected one of {}", self.what, known.join(", "))))
            }
        }
    }
}

/// Shortest and longest time that a file may ask for, s.
const SHORTEST_S: f64 = 0.001;
const LONGEST_S: f64 = 86_400.0;

/// What a value is, as a person calls it.
fn in_words(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) => "a whole number in another base than 10",
        DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

/// A number, whole or not.
pub(crate) fn number(value: &Spanned<DeValue<'_>>, key: &str) -> Result<f64, Refused> {
    let read: Option<f64> = match value.get_ref() {
        DeValue::Integer(n) if n.radix() == 10 => n.as_str().parse().ok(),
        DeValue::Float(n) => n.as_str().parse().ok(),
        _ => None,
    };
    let found = match read {
        Some(n) if n.is_finite() => return Ok(n),
        Some(n) => format!("expected a number with an end, found {n}").to_lowercase(),
        None => format!("expected a number, found {}", in_words(value.get_ref())),
    };
    Err((value.span(), format!("{key}: {found}")))
}

/// A pulse from its width in us.
pub(crate) fn pulse(us: f64) -> PulseWidth {
    PulseWidth((us * 1000.0).round() as u32)
}

/// Whole milliseconds, at least one.
pub(crate) fn ms(s: f64) -> u32 {
    ((s * 1000.0).round() as u32).max(1)
}
