//! The integration tests of the host: one program, so that the libraries are linked once.
//!
//! What it is: a module a file. `cargo xtask test` runs each module as a program of its own; `cargo test --test suite NAME::` runs one.
//! What can go wrong: a file that is not listed here is not tested; `dependency_graph` looks for it.
//! Units: none.
//! Reference: CONTRIBUTING.md.

mod ahrs_command;
mod batch;
mod blind_small;
mod book;
mod book_commands;
mod circle;
mod contract_input;
mod contract_models;
mod contract_real;
mod demo;
mod dependency_graph;
mod designer;
mod effects_catalogue;
mod export;
mod first_hour;
mod flash;
mod flight_import;
mod flight_loop;
mod fly_command;
mod fuzz_seeds;
mod help_examples;
mod history;
mod imu_port;
mod inertial_causes;
mod isolability;
mod joined_clocks;
mod kept;
mod pages;
mod readme;
mod refusals;
mod report_page;
mod rig_calibration;
mod rig_docs;
mod rig_port;
mod rig_presets;
mod rig_sets;
mod selection;
mod settings_store;
mod several_runs;
mod sim_command;
mod steps;
mod terminal_view;
mod virtual_board;
mod watch;
mod wiring;
