//! The registers under both boards' first and last steps.

pub mod clock;
pub mod crash;
