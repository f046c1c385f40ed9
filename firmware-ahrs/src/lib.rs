//! firmware-ahrs
#![no_std]
#![forbid(unsafe_code)]
