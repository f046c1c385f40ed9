//! Which words a library has for its effects.
//!
//! What it is: what the log is of, and three look-ups, so that sentence, cards and terminal are the same for rig, flight and attitude logs.
//! What can go wrong: an identifier that no library knows is told by itself.
//! Units: none.
//! Reference: specification `closing-the-loop.md`, lists of effects.

use crate::effects::{About, by_id};
use crate::verdict::Scope;
use crate::verdict::words::{Clause, over_time, parameter_of};
use crate::verdict::{EffectEntry, Kin};

/// The words of a library of effects.
#[derive(Debug, Clone, Copy)]
pub struct Vocabulary {
    /// What the log is of, such as a rig.
    pub noun: &'static str,
    /// What a declared model is where none was given.
    pub declared: &'static str,
    /// Which rows a fit did not see when it predicted them.
    pub held_out: &'static str,
    /// Which rows the figures show.
    pub figures: &'static str,
    /// What an effect is.
    pub about: fn(&str) -> Option<About>,
    /// What a found effect does.
    pub clause: fn(&EffectEntry) -> Clause,
    /// A parameter in words, by the effect's identifier and its own name; empty where no reader asks for it.
    pub parameter: fn(&str, &str) -> String,
    /// Whether what removes most noise floors is told first, rather than what removes the largest share of its own channel: for a log whose channels
    /// are of unlike sizes.
    pub by_floors: bool,
}

/// Of figures that show a model on the rows that it was fitted to.
pub(crate) const ALL_ROWS: &str = "Figures draw the models that were fitted to all rows. Bars and cards count the errors of fits on rows that they did not see.";

impl Vocabulary {
    /// Of a rig's log.
    pub const RIG: Self = Self {
        noun: "rig",
        declared: "static curves, fitted to what was measured",
        held_out: "five time blocks and every second interior level",
        figures: ALL_ROWS,
        about: |id| by_id(id).map(|e| e.about()),
        clause: |found| by_id(&found.id).map_or_else(|| bare(found), |e| e.said(found)),
        parameter: parameter_of,
        by_floors: false,
    };

    /// What a found effect does, and of several runs on which.
    #[must_use]
    pub fn said(self, found: &EffectEntry) -> Clause {
        let clause = (self.clause)(found);
        let clause = Clause { does: over_time(&clause.does), ..clause };
        match &found.run {
            Some(run) => Clause::new(clause.who, format!("{} in run {run}", clause.does)),
            None => clause,
        }
    }

    /// The short word of a scope.
    pub(crate) const fn scope_word(self, of: Scope) -> &'static str {
        match of {
            Scope::Rig => self.noun,
            other => other.word(),
        }
    }

    /// What an effect that was not found would do, on the channels of one that was.
    pub(crate) fn of_another(self, id: &str, beside: Option<&EffectEntry>) -> Clause {
        let scope = beside.map_or(Scope::Rig, |e| e.scope);
        let channels = beside.map(|e| e.channels.clone()).unwrap_or_default();
        let entry = EffectEntry { scope, channels, ..bare_entry(id) };
        (self.clause)(&entry)
    }
}

/// The words for an effect of which only the identifier is known.
pub(crate) fn bare(found: &EffectEntry) -> Clause {
    Clause::titled(&found.id.replace('_', " "), found)
}

/// An effect of which only the identifier is known.
pub(crate) fn bare_entry(id: &str) -> EffectEntry {
    EffectEntry {
        kin: Kin::Own,
        id: id.to_owned(),
        scope: Scope::Rig,
        run: None,
        channels: Vec::new(),
        depends_on: Vec::new(),
        equation: String::new(),
        probability: 0.0,
        parameters: Vec::new(),
        heldout_error_reduction: 0.0,
        evidence: String::new(),
    }
}

/// A verdict that only says what is left.
#[cfg(test)]
pub(crate) fn bare_verdict(unexplained: Vec<crate::verdict::Unexplained>) -> crate::verdict::Verdict {
    crate::verdict::Verdict {
        format: crate::verdict::FORMAT,
        run: "run.csv".to_owned(),
        verdict: crate::verdict::Kind::Unattributed,
        channels: crate::verdict::Channels::default(),
        effects: Vec::new(),
        unexplained,
        alternatives: Vec::new(),
        next_experiment: None,
        left_out: Vec::new(),
        set_aside: Vec::new(),
        guessed_floors: None,
        sensor_share: None,
        at_rest: false,
        held: false,
        validation: Vec::new(),
        runs: Vec::new(),
    }
}
