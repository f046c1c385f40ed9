//! The matrix in words: one sentence for the reader's question, one for each group.
//!
//! What it is: what a terminal and a page say alike.
//! What can go wrong: nothing.
//! Units: in the words.
//! Reference: docs/isolability.md.

use super::{Apart, Cause, Group, Isolability};
use crate::numeric::digits::number;

/// What a run says of a cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// Named, and told from every other cause.
    Clear,
    /// Named, and alike with another cause at any size.
    Alike,
    /// Named only if it is as the library has it to a tenth: the declared model takes up nearly all of it.
    Hidden,
    /// Named at no size.
    Unshown,
    /// Not judged: the search fits it at no size with values that make sense.
    Unjudged,
}

impl Standing {
    /// For a table.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Clear => "told apart",
            Self::Alike => "alike",
            Self::Hidden => "hidden",
            Self::Unshown => "not named",
            Self::Unjudged => "not judged",
        }
    }
}

impl Isolability {
    /// How a cause stands on this run.
    #[must_use]
    pub fn standing(&self, k: usize) -> Standing {
        let cause = &self.causes[k];
        if !cause.sensible {
            Standing::Unjudged
        } else if self.groups.iter().any(|g| g.members.contains(&k)) {
            Standing::Alike
        } else if cause.seen.is_none() {
            Standing::Unshown
        } else if cause.is_hidden() {
            Standing::Hidden
        } else {
            Standing::Clear
        }
    }

    /// Names of the causes that stand so.
    #[must_use]
    pub fn names(&self, standing: Standing) -> Vec<&str> {
        (0..self.causes.len()).filter(|k| self.standing(*k) == standing).map(|k| self.causes[k].name.as_str()).collect()
    }

    /// The answer in two sentences.
    #[must_use]
    pub fn summary(&self) -> String {
        let count = |s: Standing| self.names(s).len();
        let judged = self.causes.len() - count(Standing::Unjudged);
        let mut out = format!(
            "On this schedule {} of {judged} causes can be named and told apart from every other one.",
            count(Standing::Clear)
        );
        let rest = [
            (count(Standing::Alike), "alike with another one at any size"),
            (count(Standing::Hidden), "hidden in the declared model"),
            (count(Standing::Unshown), "named at no size"),
        ];
        let rest: Vec<String> = rest.iter().filter(|r| r.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
        if !rest.is_empty() {
            out += &format!(" Of the others: {}.", rest.join(", "));
        }
        out
    }

    /// What a group says: its members.
    #[must_use]
    pub fn members(&self, group: &Group) -> String {
        group.members.iter().map(|k| self.causes[*k].name.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The causes that one is told from at a larger size only than it is named at, with that size in noise floors; none for never.
    #[must_use]
    pub fn later<'c>(&'c self, cause: &'c Cause) -> Vec<(&'c str, Option<f64>)> {
        let Some(seen) = &cause.seen else { return Vec::new() };
        let pairs = cause.apart.iter().zip(&self.causes).filter(|(_, other)| other.sensible);
        let late = pairs.filter_map(|(apart, other)| match apart {
            Apart::From(size) if size.floors > LATER * seen.floors => Some((other.name.as_str(), Some(size.floors))),
            Apart::Never => Some((other.name.as_str(), None)),
            _ => None,
        });
        late.collect()
    }
}

/// Sizes are found to half a doubling; what is closer is the same size.
const LATER: f64 = std::f64::consts::SQRT_2;

impl Cause {
    /// A size in the unit of the cause's own parameter, and what was held.
    #[must_use]
    pub fn in_words(&self) -> String {
        let shown = self.seen.as_ref().unwrap_or(&self.tried);
        let unit = |u: &str| if u == "1" { String::new() } else { format!(" {u}") };
        let own = &shown.quantity;
        let held: Vec<String> = self
            .held
            .iter()
            .filter(|h| h.name != own.name)
            .map(|h| format!("{} {}{}", h.name, short(h.value), unit(&h.unit)))
            .collect();
        let held = if held.is_empty() { String::new() } else { format!(" ({})", held.join(", ")) };
        format!("{} {}{}{held}", own.name, short(own.value), unit(&own.unit))
    }
}

/// Three significant digits.
#[must_use]
pub fn short(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return number(v);
    }
    let digits = 2 - v.abs().log10().floor() as i32;
    if (0..=6).contains(&digits) {
        format!("{v:.*}", digits as usize)
    } else if digits < 0 {
        format!("{v:.0}")
    } else {
        format!("{v:.2e}")
    }
}
