//! The terminal view: what an operator sees and which keys do what.
//!
//! What it is: [`Screen`], everything that is shown, made from messages alone; [`draw`], which puts it on a terminal of any size; [`keys`], which
//! turns a key into a [`keys::Wish`]; [`Terminal`], the only part with input and output.
//! What can go wrong: a terminal that is too small shows what fits, state and stop key first; one that goes away ends the view, never a recording.
//! Units: those of the log's columns.
//! Reference: specification `rig.md`, "The operator's side"; docs/view.md.

mod channel;
mod draw;
mod glyphs;
pub(crate) mod keys;
mod screen;
mod terminal;
mod trend;

#[cfg(test)]
mod tests;

pub(crate) use screen::{Course, Live, Recorded, Screen, Tone, Under};
pub(crate) use terminal::{Terminal, is_there};
