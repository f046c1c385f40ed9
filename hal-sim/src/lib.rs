//! hal-sim
#![forbid(unsafe_code)]
