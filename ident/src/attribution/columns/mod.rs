//! From channels and what may be behind them to names, errors before and after, and what is left.
//!
//! What it is: four stages, each a function from values to a value, that know channels and columns only:
//! [`ask`] (candidates: what could join, and what this log can show) -> [`posterior()`] (which hypothesis, how sure) -> [`held_out`]
//! (validation on readings that no fit saw) -> [`conclude()`] (what is said). A [`Library`] brings the causes of a kind of log; flights are the
//! first that does.
//! What can go wrong: a channel with too few readings is left out by who makes it; a log on which nothing can be shown ends without a name.
//! Units: those of the channels; evidence in nats.
//! Reference: specification `closing-the-loop.md`; Kennedy & O'Hagan 2001 (a discrepancy without a name beside the named terms).
//!
//! ```text
//! readings = declared columns + named terms + nameless terms + wander (nameless, in time) + white noise
//!            ------------- amplitudes with priors ---------     ---- noise of each channel ---------
//! ```
//!
//! Everything that decides: the prior (half a name is expected, [`candidates::prior_odds`]), [`candidates::LEAST_ANGLE`] (how far the
//! compact forms are off), [`noise::SLOWEST`] (a wander turns round twenty times), and the verdict's own contract (2 %, three floors).

pub mod candidates;
pub mod channel;
pub mod conclude;
pub mod design;
pub mod evidence;
pub mod fit;
pub mod library;
pub mod noise;
pub mod posterior;
mod shapes;
pub mod validate;

pub use candidates::{Asked, ask};
pub use channel::Channel;
pub use conclude::{Conclusion, HeldOut, Kept, Left, conclude, conclude_told};
pub use design::{Column, Design, Owner, Prior, Values};
pub use fit::{Fit, Problem, fit, parameters};
pub use library::{Candidate, Library, Placed, Shape, UNKNOWN};
pub use noise::Noise;
pub use posterior::{Posterior, posterior, told};
pub use validate::held_out;
