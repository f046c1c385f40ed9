//! The page and the terminal text of a closed loop, whatever kind of log it was closed on.
//!
//! What it is: one file a subject: sentence, state bars, cards, evidence, what is left, provenance, folds, terminal. Each turns values of the
//! verdict into text.
//! What can go wrong: nothing; what a log does not hold is left out.
//! Units: told to the digits that the intervals support.
//! Reference: specification `formats.md`, "Verdict".

mod brief;
mod cards;
mod cautions;
mod contest;
mod evidence;
mod fold;
mod left;
mod look;
mod lost;
mod page;
mod provenance;
mod sentence;
mod state;
mod terminal;
mod vocabulary;

pub(crate) use evidence::{
    ALONE, SEEN, Trace, against, enlarged, headed, lifted, most, moves, over_time, pair, part, rest, scatter, shown_most, slug,
    thinned, two_ways,
};
pub(crate) use fold::{aside, candidates};
pub(crate) use look::{LOOK, SCRIPT};
pub(crate) use page::{Page, Reading, begin};
pub use provenance::{Hidden, Origin};
pub(crate) use sentence::loudest;
pub use sentence::sentence;
pub(crate) use state::bars;
pub use terminal::{WIDEST, terminal, wrapped};
pub use vocabulary::Vocabulary;
#[cfg(test)]
pub(crate) use vocabulary::bare_entry;
pub(crate) use vocabulary::{ALL_ROWS, bare};
