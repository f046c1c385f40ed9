//! `quadrig`: the command line.
//!
//! What it is: one subcommand a job, each a thin layer over `ident` and `hal-sim`.
//! What can go wrong: bad input gives one line on stderr and exit status 1, wrong usage 2; nothing is left half-written.
//! Units: as the files state.
//! Reference: specification `formats.md`, "Command line".
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)] // a reader may be gone: see `say`

#[macro_use]
mod say;
mod ahrs;
mod apart;
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
mod export;
mod flash;
mod fly;
mod folder;
mod help;
mod history;
mod identify;
mod import;
mod imu;
mod isolability;
mod join;
mod kind;
mod live;
mod man;
mod measured;
mod number;
mod open;
mod plateaus;
mod port;
mod predict;
mod progress;
mod recalibrate;
mod record;
mod replace;
mod rig;
mod run_log;
mod runs;
mod select;
mod sim;
mod spool;
mod step;
mod trouble;
mod view;
mod virtual_port;

use apart::Paths;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
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
    /// A rig's constants run by run, and what changed between which runs.
    History(history::Args),
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
    /// A model as the file of a flight controller or of a simulator: thrust curve, motor constants, battery, delay.
    Export(export::Args),
    /// Completions of the command line for a shell, on standard output.
    Completions(man::Completions),
    /// Manual pages of the command line.
    Man(man::Args),
}

/// What went wrong, as one line.
type Failure = Box<dyn std::error::Error>;

impl Command {
    /// What it reads and writes.
    fn paths(&self) -> Paths<'_> {
        match self {
            Self::Demo(args) => args.paths(),
            Self::Sim(args) => args.paths(),
            Self::Runs(args) => args.paths(),
            Self::Import(args) => args.paths(),
            Self::Identify(args) => args.paths(),
            Self::Plateaus(args) => args.paths(),
            Self::CloseLoop(args) => args.paths(),
            Self::Batch(args) => args.paths(),
            Self::History(args) => args.paths(),
            Self::Select(args) => args.paths(),
            Self::Beam(args) => args.paths(),
            Self::Calibrate(args) => args.paths(),
            Self::Recalibrate(args) => args.paths(),
            Self::Ahrs(args) => args.paths(),
            Self::Loop(args) => args.paths(),
            Self::Fly(args) => args.paths(),
            Self::Measured(args) => args.paths(),
            Self::Isolability(args) => args.paths(),
            Self::Log(args) => args.paths(),
            Self::Rig(args) => args.paths(),
            Self::Effects(args) => args.paths(),
            Self::Predict(args) => args.paths(),
            Self::Export(args) => args.paths(),
            Self::Man(args) => args.paths(),
            Self::Step(args) => args.paths(),
            Self::Completions(_) | Self::Flash(_) | Self::Imu(_) | Self::Virtual(_) => Paths::default(),
        }
    }

    fn run(&self, quiet: bool) -> Result<(), Failure> {
        self.paths().check()?;
        match self {
            Self::Demo(args) => demo::run(args, quiet),
            Self::Sim(args) => sim::run(args, quiet),
            Self::Runs(args) => runs::run(args, quiet),
            Self::Import(args) => import::run(args, quiet),
            Self::Identify(args) => identify::run(args, quiet),
            Self::Plateaus(args) => plateaus::run(args, quiet),
            Self::CloseLoop(args) => close_loop::run(args, quiet),
            Self::Batch(args) => batch::run(args, quiet),
            Self::History(args) => history::run(args, quiet),
            Self::Select(args) => select::run(args, quiet),
            Self::Beam(args) => beam::run(args, quiet),
            Self::Calibrate(args) => calibrate::run(args, quiet),
            Self::Recalibrate(args) => recalibrate::run(args, quiet),
            Self::Ahrs(args) => ahrs::run(args, quiet),
            Self::Loop(args) => circle::run(args, quiet),
            Self::Fly(args) => fly::run(args, quiet),
            Self::Flash(args) => flash::run(args),
            Self::Measured(args) => measured::run(args, quiet),
            Self::Isolability(args) => isolability::run(args, quiet),
            Self::Step(args) => step::run(args, quiet),
            Self::Log(args) => record::run(args, quiet),
            Self::Rig(args) => rig::run(args, quiet),
            Self::Imu(args) => imu::run(args, quiet),
            Self::Virtual(args) => virtual_port::run(args, quiet),
            Self::Effects(args) => effects::run(args, quiet),
            Self::Predict(args) => predict::run(args),
            Self::Export(args) => export::run(args, quiet),
            Self::Completions(args) => man::completions(args),
            Self::Man(args) => man::run(args, quiet),
        }
    }
}

fn main() -> ExitCode {
    let taken = help::taught(Cli::command()).try_get_matches().and_then(|matches| Cli::from_arg_matches(&matches));
    let cli = match taken {
        Ok(cli) => cli,
        Err(why) => {
            let Some(line) = number::refusal(&why) else { why.exit() };
            note!("quadrig: {line}");
            return ExitCode::from(1);
        }
    };
    match cli.command.run(cli.quiet) {
        Ok(()) => say::status(),
        Err(e) => {
            let line = e.to_string().replace('\n', " ");
            note!("quadrig: {line}");
            ExitCode::from(1)
        }
    }
}
