//! What a person does at the bench.
//!
//! What it is: [`Hand`], and the words for it: `power on`, `stop`, `hang 200`.
//! What can go wrong: words that are none; the answer lists them.
//! Units: gram, N.m, V.
//! Reference: docs/virtual.md.

use frame::esc::{BACK_EMF_NAME, ESC_NAMES};
use frame::rig::{ADC_NAMES, CAPTURE_NAMES};

/// A deed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hand {
    /// Switches the ESC's supply on or off.
    Power(bool),
    /// Opens the stop loop (presses the emergency stop), or closes it.
    StopLoop {
        /// Open: stop.
        open: bool,
    },
    /// Hangs a mass on the load cell, gram; 0 takes it off.
    Hang(f64),
    /// Twists the torque arm, N.m; 0 lets it go.
    Twist(f64),
    /// Draws a current through the shunt with a load of one's own, A; 0 takes it off.
    Draw(f64),
    /// Sets the bench supply, V.
    Supply(f64),
    /// Pulls a plug, or puts it back: capture channels first, then analogue ones, the ESC's telemetry, the back-EMF meter.
    Plug {
        /// Which.
        plug: usize,
        /// Out.
        out: bool,
    },
    /// Presses the board's reset key.
    Reset,
}

/// Every word.
const WORDS: &str = "power on|off; stop, release (the emergency stop); hang GRAMS (on the load cell); twist NM (the torque arm); draw AMPERES (a load of one's own); supply VOLTS; unplug CHANNEL, plug CHANNEL; reset (key)";

/// Names of the plugs, by their columns in the log.
fn plugs() -> impl Iterator<Item = &'static str> {
    let [telemetry, ..] = ESC_NAMES;
    CAPTURE_NAMES.into_iter().chain(ADC_NAMES).chain([telemetry, BACK_EMF_NAME])
}

impl Hand {
    /// Every word, for people.
    pub const WORDS: &str = WORDS;

    /// The deed that a line of words means.
    ///
    /// # Errors
    /// What was expected, in one line.
    pub fn parse(line: &str) -> Result<Self, String> {
        let mut words = line.split_whitespace();
        let both = (words.next().unwrap_or(""), words.next());
        let number = |word: &str| -> Result<f64, String> {
            let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| format!("{line:?}: a number is needed, found {word:?}"))
        };
        let plug = |name: &str| -> Result<usize, String> {
            let found = plugs().position(|n| n == name);
            found.ok_or_else(|| format!("{name:?}: no such channel; there are {}", plugs().collect::<Vec<_>>().join(", ")))
        };
        match both {
            ("power", Some("on")) => Ok(Self::Power(true)),
            ("power", Some("off")) => Ok(Self::Power(false)),
            ("stop", None) => Ok(Self::StopLoop { open: true }),
            ("release", None) => Ok(Self::StopLoop { open: false }),
            ("hang", Some(grams)) => Ok(Self::Hang(number(grams)?)),
            ("draw", Some(current)) => Ok(Self::Draw(number(current)?)),
            ("twist", Some(torque)) => Ok(Self::Twist(number(torque)?)),
            ("supply", Some(volts)) => match number(volts)? {
                v if (0.0..=60.0).contains(&v) => Ok(Self::Supply(v)),
                v => Err(format!("{v} V: a bench supply gives 0 to 60 V")),
            },
            ("unplug", Some(name)) => Ok(Self::Plug { plug: plug(name)?, out: true }),
            ("plug", Some(name)) => Ok(Self::Plug { plug: plug(name)?, out: false }),
            ("reset", None) => Ok(Self::Reset),
            _ => Err(format!("{line:?}: expected {WORDS}")),
        }
    }

    /// What was done, for people.
    #[must_use]
    pub fn words(&self) -> String {
        let name = |plug: usize| plugs().nth(plug).unwrap_or("?");
        match *self {
            Self::Power(true) => "the ESC's supply is on".to_owned(),
            Self::Power(false) => "the ESC's supply is off".to_owned(),
            Self::StopLoop { open: true } => "the emergency stop is pressed: the stop loop is open".to_owned(),
            Self::StopLoop { open: false } => "the emergency stop is released: the stop loop is closed".to_owned(),
            Self::Hang(0.0) => "nothing hangs on the load cell".to_owned(),
            Self::Hang(grams) => format!("{grams} g hang on the load cell"),
            Self::Twist(0.0) => "the torque arm is free".to_owned(),
            Self::Twist(torque) => format!("the torque arm is twisted by {torque} N.m"),
            Self::Draw(0.0) => "nothing but the ESC draws current".to_owned(),
            Self::Draw(current) => format!("a load draws {current} A through the shunt"),
            Self::Supply(volts) => format!("the supply is set to {volts} V"),
            Self::Plug { plug, out: true } => format!("{} is unplugged", name(plug)),
            Self::Plug { plug, out: false } => format!("{} is plugged in", name(plug)),
            Self::Reset => "the reset key was pressed".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_deeds_and_others_are_refused_with_the_list() {
        assert_eq!(Hand::parse("power on"), Ok(Hand::Power(true)));
        assert_eq!(Hand::parse("  hang   200.5 "), Ok(Hand::Hang(200.5)));
        assert_eq!(Hand::parse("unplug rpm_hall"), Ok(Hand::Plug { plug: 2, out: true }));
        assert_eq!(Hand::parse("plug thrust_n"), Ok(Hand::Plug { plug: 4, out: false }));
        assert_eq!(Hand::parse("unplug rpm_bemf"), Ok(Hand::Plug { plug: 10, out: true }));
        assert!(Hand::parse("unplug beam").is_err_and(|e| e.contains("rpm_beam")));
        assert!(Hand::parse("supply 230").is_err_and(|e| e.contains("60 V")));
        assert!(Hand::parse("dance").is_err_and(|e| e.contains("power on|off")));
        assert!(Hand::parse("hang much").is_err_and(|e| e.contains("number")));
    }
}
