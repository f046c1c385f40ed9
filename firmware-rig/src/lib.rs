//! firmware-rig
#![no_std]
#![forbid(unsafe_code)]
