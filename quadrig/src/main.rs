//! quadrig
#![forbid(unsafe_code)]
fn main() {}
