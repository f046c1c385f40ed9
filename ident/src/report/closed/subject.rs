//! What a log is of: a rig, a vehicle, or a board that carries sensors alone.
//!
//! What it is: one noun for page and terminal, told by the channels of the verdict.
//! What can go wrong: a flight of which neither rotors' speeds nor turning are told reads as a board.
//! Units: none.
//! Reference: specification `flight.md`, "The loop on flights"; `formats.md`, "Verdict".

use crate::effects::Scope;
use crate::verdict::Verdict;
use crate::words::scope;

/// Channels of an attitude log.
const BOARD: [&str; 9] = ["ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz"];

/// What a log is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Subject {
    /// A powerplant on a stand.
    Rig,
    /// What flies.
    Vehicle,
    /// Sensors that are carried about.
    Board,
}

impl Subject {
    /// Of the log of a verdict.
    pub(super) fn of(verdict: &Verdict) -> Self {
        let names = || verdict.channels.iter().map(|c| c.0).chain(verdict.channels.not_predicted.iter().map(|c| c.0));
        let rotor = |name: &str| name.strip_prefix("rpm_").is_some_and(|i| i.parse::<usize>().is_ok());
        if names().any(|name| name.starts_with("ang_acc_") || rotor(name)) {
            Self::Vehicle
        } else if names().any(|name| BOARD.contains(&name.as_str()) || name.starts_with("acc_")) {
            Self::Board
        } else {
            Self::Rig
        }
    }

    /// Its noun.
    pub(super) const fn noun(self) -> &'static str {
        match self {
            Self::Rig => "rig",
            Self::Vehicle => "vehicle",
            Self::Board => "board",
        }
    }

    /// The short word of a scope.
    pub(super) const fn scope_word(self, of: Scope) -> &'static str {
        match of {
            Scope::Rig => self.noun(),
            other => other.word(),
        }
    }

    /// What a scope means to the reader.
    pub(super) fn scope(self, of: Scope) -> String {
        scope(of).replace("the rig", &format!("the {}", self.noun()))
    }
}
