//! esc-pwm
#![no_std]
#![forbid(unsafe_code)]
