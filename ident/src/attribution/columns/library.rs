//! What a kind of log may hold: the causes that are asked, and what they make of its channels.
//!
//! What it is: the one thing that a kind of log (a flight, a rig's run, an attitude log) brings along. Everything else here knows channels
//! and columns only.
//! What can go wrong: a candidate whose column is nothing on this log is never named.
//! Units: those of the channels; each shape states its own.
//! Reference: the plan of `attribution`.

use super::design::{Column, Design};

/// A parameter that enters a term's columns other than as an amplitude.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Name, a contract of the verdict file.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Plausible range, over which it is expected evenly.
    pub range: (f64, f64),
    /// Whether nothing lies beyond the range, so that its ends are values like any other (a share).
    pub closed: bool,
}

/// Share of a range within which a value lies on its edge.
const EDGE: f64 = 2e-3;

impl Shape {
    /// Whether a value lies inside the range, and not on an edge that stands for what lies beyond.
    #[must_use]
    pub fn inside(&self, value: f64) -> bool {
        let (lo, hi) = self.range;
        self.closed || ((value - lo) / (hi - lo) - 0.5).abs() < 0.5 - EDGE
    }
}

/// One term that a hypothesis may take up.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Identifier, a contract of the verdict file; `unknown` for a term without a name.
    pub id: &'static str,
    /// Which of several forms (a rotor, a sensor); empty where there is one.
    pub form: String,
    /// Its shapes.
    pub shapes: Vec<Shape>,
    /// Shapes at which it is asked first and from which the search begins; one empty list where it has none.
    pub starts: Vec<Vec<f64>>,
    /// Candidates of which one must be there, by identifier; empty where it stands alone.
    pub needs: Vec<&'static str>,
    /// Candidates beside which it may not stand, by identifier and form: what it would double.
    pub excludes: Vec<(&'static str, String)>,
}

impl Candidate {
    /// Whether it has a name.
    #[must_use]
    pub fn is_named(&self) -> bool {
        self.id != UNKNOWN
    }
}

/// Identifier of a term without a name.
pub const UNKNOWN: &str = "unknown";

/// A candidate with its shapes, as part of a hypothesis.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Position in the list of candidates.
    pub candidate: usize,
    /// One value a shape.
    pub shape: Vec<f64>,
}

/// What a kind of log brings along.
pub trait Library: Sync {
    /// Everything that may be asked of this log.
    fn candidates(&self) -> &[Candidate];
    /// All columns of a hypothesis, those of the declared model first and always the same number of them.
    fn design(&self, hypothesis: &[Placed]) -> Design;
    /// The columns that `extra` adds, where it changes none of the hypothesis' own; `None` where it does.
    fn addition(&self, hypothesis: &[Placed], extra: &Placed) -> Option<Vec<Column>>;
}
