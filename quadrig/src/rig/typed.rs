//! What an operator types where there is no terminal view.
//!
//! What it is: one line, one command, or a hand at a virtual bench.
//! What can go wrong: words that are none; the answer lists them.
//! Units: us of pulse.
//! Reference: Beharie 2013, Fig. 3.10.

use super::pulse;
use crate::Failure;
use frame::message::{Beep, Command};
use virtual_board::Hand;

/// What a typed line means.
pub(crate) enum Typed {
    /// A command for the board.
    Command(Command),
    /// A hand at a virtual board's bench.
    Hand(Hand),
    /// The end.
    End,
}

/// What a typed line asks for; `hands` where there is a bench to lay hands on.
pub(crate) fn typed(line: &str, hands: bool) -> Result<Typed, Failure> {
    let mut words = line.split_whitespace();
    let (word, value) = (words.next().unwrap_or(""), words.next());
    let number =
        || value.and_then(|v| v.parse::<f64>().ok()).ok_or_else(|| format!("{line:?}: expected a number after the word"));
    Ok(Typed::Command(match word {
        "" => Command::Ping,
        "long" => Command::Beep(Beep::Long),
        "cells" => Command::Beep(Beep::Cells(number()?.clamp(0.0, 255.0) as u8)),
        "ready" => Command::Beep(Beep::Ready),
        "double" => Command::Beep(Beep::Double),
        "programming" => Command::Beep(Beep::Programming),
        "nosignal" => Command::Beep(Beep::NoSignal),
        "selftest" => Command::Beep(Beep::SelfTestFailed),
        "set" => Command::SetPulse(pulse(number()?)?),
        "run" => Command::RunSchedule,
        "tare" => Command::Tare,
        "stop" => Command::Stop,
        "quit" => return Ok(Typed::End),
        "bench" if hands => {
            let words = line.trim_start().strip_prefix("bench").unwrap_or("");
            return Ok(Typed::Hand(Hand::parse(words.trim())?));
        }
        _ => {
            let bench = if hands { ", or bench and what a hand does there (bench power on)" } else { "" };
            return Err(format!(
                "{word:?}: type long, cells N, ready, double, programming, nosignal, selftest, set US, run, tare, stop or quit{bench}"
            )
            .into());
        }
    }))
}
