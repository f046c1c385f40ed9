//! Which causes stand behind a residual, how sure that is, and what is left.
//!
//! What it is: the search (`diagnose`) over the library, one name at a time (`round`, `evidence`, `choose`), several at once (`together`) and each
//! asked again (`revise`, `split`), against what has no name (`opponent`, `correction`, `beside`) and what stands as near (`rivals`, `suspects`); the
//! last look at the whole (`standing`, `conclude`, `sure`), and what is left beside it (`unexplained`). [`columns`] is the engine that knows columns and channels only, which flights use.
//! What can go wrong: see each.
//! Units: evidence in nats.
//! Reference: specification `closing-the-loop.md`.

pub(crate) mod beside;
pub(crate) mod choose;
pub mod columns;
pub(crate) mod conclude;
pub(crate) mod correction;
pub(crate) mod depends;
pub mod diagnose;
pub mod evidence;
pub(crate) mod jump;
pub mod long;
pub(crate) mod moment;
pub(crate) mod opponent;
pub(crate) mod places;
pub(crate) mod revise;
pub mod rivals;
pub(crate) mod round;
pub(crate) mod split;
pub(crate) mod standing;
pub(crate) mod sure;
pub(crate) mod suspects;
pub(crate) mod together;
pub mod unexplained;
