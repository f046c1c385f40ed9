//! Arithmetic that knows no rig.
//!
//! What it is: medians, weighted least squares, a simplex search, digits, chances, and threads for pieces of work that do not wait for each other.
//! What can go wrong: see each.
//! Units: none.
//! Reference: in each.

pub(crate) mod chance;
pub mod digits;
pub mod order;
pub(crate) mod parallel;
pub mod simplex;
pub mod solve;
