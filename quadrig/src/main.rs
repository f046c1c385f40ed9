//! `quadrig`: the command line.
//!
//! What it is: one subcommand a job, each a thin layer over `ident` and `hal-sim`.
//! What can go wrong: bad input gives one line on stderr and exit status 1, wrong usage 2; nothing is left half-written.
//! Units: as the files state.
//! Reference: specification `formats.md`, "Command line".
#![forbid(unsafe_code)]

mod ahrs;
mod batch;
mod beam;
mod board;
mod calibrate;
mod circle;
mod close_loop;
#[cfg(test)]
mod command_page;
mod demo;
mod effects;
mod end;
mod evidence;
mod flash;
mod fly;
mod identify;
mod import;
mod imu;
mod isolability;
mod join;
mod live;
mod measured;
mod open;
mod plateaus;
mod port;
mod predict;
mod progress;
mod recalibrate;
mod record;
mod rig;
mod run_log;
mod runs;
mod select;
mod sim;
mod spool;
mod step;
mod view;
mod virtual_port;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Rig controller, simulator, identification: from a motor command to a named effect on measured data.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[derive(Parser)]
#[command(version, about, arg_required_else_help = true)]
struct Cli {
    /// No progress, no tables: files and exit status only.
    #[arg(long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// The main job end to end on the built-in rig, no hardware.
    Demo(demo::Args),
    /// Runs the firmware against a simulated rig described by a scenario file.
    Sim(sim::Args),
    /// All thirty-six motor-propeller pairs of the thesis on all cores, a log each.
    Runs(runs::Args),
    /// A thrust stand's, ESC's or flight's export becomes a log; every conversion is said.
    Import(import::Args),
    /// Plateaus, fits and quality figures of a log.
    Identify(identify::Args),
    /// Plateau detectors side by side: each filter of the binary shift algorithm, the threshold study, scores where a command was logged.
    Plateaus(plateaus::Args),
    /// Residual, cause, corrected model, error before and after.
    CloseLoop(close_loop::Args),
    /// The loop on every log of a folder: a row a run; goes on where it stopped, shared among machines by --shard.
    Batch(batch::Args),
    /// Motor, propeller and battery choice.
    Select(select::Args),
    /// Design of the load cell's beam, with a warning of resonance.
    Beam(beam::Args),
    /// Sensor errors of the IMU board from a recording; a rig channel's scale from known values, live or from a recording.
    Calibrate(calibrate::Args),
    /// An old log's raw codes with a better calibration.
    Recalibrate(recalibrate::Args),
    /// The firmware's attitude filter over a recorded file.
    Ahrs(ahrs::Args),
    /// The whole circle in simulation; with --auto the tool flies its own next experiments.
    Loop(circle::Args),
    /// A mission in the air, on the catalogue's powerplants or on an identified model.
    Fly(fly::Args),
    /// Builds, flashes and attaches through probe-rs.
    Flash(flash::Args),
    /// The loop on every recorded set; writes the pages that say what came of it.
    Measured(measured::Args),
    /// Which causes a schedule can tell apart and from which size on, before a run is flown or after.
    Isolability(isolability::Args),
    /// One step of the loop on its own.
    Step(step::Args),
    /// Records from the rig board, with a live view.
    Log(record::Args),
    /// Talks to the rig board: arm, run, set, stop, tare, clear, configure, calibrate.
    Rig(rig::Args),
    /// Talks to the IMU board: its user commands, calibration included.
    Imu(imu::Args),
    /// A board without hardware behind a pseudo-terminal, for other programs.
    Virtual(virtual_port::Args),
    /// The library of effects as pages.
    Effects(effects::Args),
    /// A model's prediction of every measured channel, row for row.
    Predict(predict::Args),
}

/// What went wrong, as one line.
type Failure = Box<dyn std::error::Error>;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let done = match &cli.command {
        Command::Demo(args) => demo::run(args, cli.quiet),
        Command::Sim(args) => sim::run(args, cli.quiet),
        Command::Runs(args) => runs::run(args, cli.quiet),
        Command::Import(args) => import::run(args, cli.quiet),
        Command::Identify(args) => identify::run(args, cli.quiet),
        Command::Plateaus(args) => plateaus::run(args, cli.quiet),
        Command::CloseLoop(args) => close_loop::run(args, cli.quiet),
        Command::Batch(args) => batch::run(args, cli.quiet),
        Command::Select(args) => select::run(args, cli.quiet),
        Command::Beam(args) => beam::run(args, cli.quiet),
        Command::Calibrate(args) => calibrate::run(args, cli.quiet),
        Command::Recalibrate(args) => recalibrate::run(args, cli.quiet),
        Command::Ahrs(args) => ahrs::run(args, cli.quiet),
        Command::Loop(args) => circle::run(args, cli.quiet),
        Command::Fly(args) => fly::run(args, cli.quiet),
        Command::Flash(args) => flash::run(args),
        Command::Measured(args) => measured::run(args, cli.quiet),
        Command::Isolability(args) => isolability::run(args, cli.quiet),
        Command::Step(args) => step::run(args, cli.quiet),
        Command::Log(args) => record::run(args, cli.quiet),
        Command::Rig(args) => rig::run(args, cli.quiet),
        Command::Imu(args) => imu::run(args, cli.quiet),
        Command::Virtual(args) => virtual_port::run(args, cli.quiet),
        Command::Effects(args) => effects::run(args, cli.quiet),
        Command::Predict(args) => predict::run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            let line = e.to_string().replace('\n', " ");
            eprintln!("quadrig: {line}");
            ExitCode::from(1)
        }
    }
}
