//! The numbers of the command line.
//!
//! What it is: one parser for every option that takes a number: it has an end, and lies within what the option can mean.
//! What can go wrong: a word, `nan`, `inf`, a number beyond the limits: one line with option, value and what was expected, exit status 1.
//! Units: of each option, said in its refusal.
//! Reference: clap, `TypedValueParser`.

use clap::error::{ContextKind, ContextValue};
use ident::log::short;
use std::error::Error;
use std::fmt;

/// What was expected in the place of a value.
#[derive(Debug)]
pub(crate) struct Expected(String);

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Error for Expected {}

/// A number from `low` to `high`.
pub(crate) fn from(low: f64, high: f64, what: &'static str) -> impl Fn(&str) -> Result<f64, Expected> + Clone + Send + Sync {
    move |text| {
        let found = text.trim().parse().ok().filter(|v| (low..=high).contains(v));
        found.ok_or_else(|| Expected(format!("expected {what} from {low} to {high}")))
    }
}

/// A number above 0, `high` at most.
pub(crate) fn positive(high: f64, what: &'static str) -> impl Fn(&str) -> Result<f64, Expected> + Clone + Send + Sync {
    move |text| {
        let found = text.trim().parse().ok().filter(|v| *v > 0.0 && *v <= high);
        found.ok_or_else(|| Expected(format!("expected a positive number of {what}, {high} at most")))
    }
}

/// A whole number from `low` to `high`.
pub(crate) fn whole<T>(low: u64, high: u64, what: &'static str) -> impl Fn(&str) -> Result<T, Expected> + Clone + Send + Sync
where
    T: TryFrom<u64>,
{
    move |text| {
        let found = text.trim().parse().ok().filter(|n| (low..=high).contains(n));
        found
            .and_then(|n: u64| T::try_from(n).ok())
            .ok_or_else(|| Expected(format!("expected {what}, a whole number from {low} to {high}")))
    }
}

/// Milliampere-hours, a whole number from `low` to `high`; what may be ampere-hours is told as such.
pub(crate) fn milliampere_hours(low: u32, high: u32) -> impl Fn(&str) -> Result<u32, Expected> + Clone + Send + Sync {
    move |text| {
        let found = text.trim().parse().ok().filter(|n| (low..=high).contains(n));
        found.ok_or_else(|| {
            let ah = text.trim().parse::<f64>().ok().filter(|ah| *ah > 0.0 && *ah < f64::from(low));
            let hint = ah.map_or_else(String::new, |ah| format!(": is it in A.h? {ah} A.h are {:.0} mAh", 1000.0 * ah));
            Expected(format!("expected mAh, a whole number from {low} to {high}") + &hint)
        })
    }
}

/// The line of a refusal that is one of these numbers'.
pub(crate) fn refusal(error: &clap::Error) -> Option<String> {
    let expected = error.source()?.downcast_ref::<Expected>()?;
    let text = |kind: ContextKind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    let (option, value) = (text(ContextKind::InvalidArg), text(ContextKind::InvalidValue));
    let name = option.split(' ').next().unwrap_or_default().trim_matches(['<', '>', '[', ']', '.']);
    Some(format!("{name} {}: {expected}", short(&value)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cli;
    use crate::help::taught;
    use clap::{Arg, Command, CommandFactory};
    use std::any::TypeId;

    #[test]
    fn a_number_lies_within_its_limits() {
        let (grams, long, cells) = (from(0.0, 5.0, "g"), positive(2.5, "m"), whole::<u32>(1, 14, "cells"));
        assert_eq!(
            (grams("0").ok(), grams("5").ok(), long("2.5").ok(), cells("14").ok()),
            (Some(0.0), Some(5.0), Some(2.5), Some(14))
        );
        for text in ["nan", "inf", "-1", "1e999", "word", "", "6"] {
            assert_eq!(grams(text).map_err(|e| e.to_string()), Err("expected g from 0 to 5".to_owned()), "{text}");
            assert!(long(text).is_err() && cells(text).is_err() || text == "6", "{text}");
        }
        assert!(long("0").is_err() && cells("0").is_err() && cells("15").is_err() && cells("1.5").is_err());
    }

    fn takes_a_number(arg: &Arg) -> bool {
        let own = arg.get_value_parser().type_id();
        let kinds = [TypeId::of::<f64>(), TypeId::of::<f32>(), TypeId::of::<usize>(), TypeId::of::<u64>(), TypeId::of::<u32>()];
        kinds.iter().chain(&[TypeId::of::<u16>()]).any(|kind| own == *kind)
    }

    /// Every option with a number, by the words that lead to it.
    fn options(command: &Command, path: &[String], found: &mut Vec<(Vec<String>, String)>) {
        for arg in command.get_arguments().filter(|arg| takes_a_number(arg)) {
            found.extend(arg.get_long().map(|long| (path.to_vec(), format!("--{long}"))));
        }
        for inner in command.get_subcommands() {
            options(inner, &[path, &[inner.get_name().to_owned()]].concat(), found);
        }
    }

    #[test]
    fn no_option_takes_what_is_no_number() {
        let command = taught(Cli::command());
        let mut found = Vec::new();
        options(&command, &["quadrig".to_owned()], &mut found);
        assert!(found.len() > 45, "{}", found.len());
        for (path, option) in &found {
            for value in ["nan", "inf", "-inf", "1e999", "word", "-7e12"] {
                let words = path.iter().cloned().chain([format!("{option}={value}")]);
                let refused = command.clone().try_get_matches_from(words).expect_err("no number");
                if option == "--side" {
                    continue; // A or B
                }
                let said = refusal(&refused).unwrap_or_else(|| panic!("{path:?} {option}={value}: {refused}"));
                assert!(said.starts_with(&format!("{option} {value}: expected ")), "{said}");
            }
        }
    }

    #[test]
    fn a_long_value_is_cut() {
        let refused = taught(Cli::command()).try_get_matches_from(["quadrig", "select", "--thrust", &"9".repeat(1000)]);
        let said = refusal(&refused.expect_err("too much")).expect("a number's");
        assert!(said.len() < 120 && said.contains("999...: expected N from 0"), "{said}");
    }

    /// A number below 0 is a value, not an option that nobody knows.
    #[test]
    fn a_number_below_0_is_refused_as_one() {
        let refused = taught(Cli::command()).try_get_matches_from(["quadrig", "log", "-o", "x.csv", "--seconds", "-3"]);
        let said = refusal(&refused.expect_err("below 0")).expect("a number's");
        assert!(said.starts_with("--seconds -3: expected a positive number of seconds"), "{said}");
    }
}
