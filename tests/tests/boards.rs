//! The flash images in the emulator: one program, a module a file.
//!
//! What it is: built with feature `emulated`, as `cargo xtask test --emulated` does.
//! What can go wrong: a file that is not listed here is not tested; `dependency_graph` looks for it.
//! Units: none.
//! Reference: CONTRIBUTING.md.

mod emulated_adc;
mod emulated_ahrs;
mod emulated_ahrs_commands;
mod emulated_ahrs_cost;
mod emulated_burst;
mod emulated_campaign;
mod emulated_clock;
mod emulated_console;
mod emulated_dshot;
mod emulated_faults;
mod emulated_flash;
mod emulated_flight;
mod emulated_imu;
mod emulated_inputs;
mod emulated_port;
mod emulated_rig;
mod emulated_settings;
mod emulated_start;
mod emulated_stop;
mod emulated_telemetry;
mod emulated_tick;
mod emulated_virtual;
