//! `quadrig export`: a model as the file of another program.
//!
//! What it is: thrust curve, motor constants, battery and delay as PX4, ArduPilot, Betaflight, Crazyflie, Simulink or a spreadsheet has them; each
//! file says where its keys are defined, how far the peer's curve is from the model's, and what the model does not tell.
//! What can go wrong: a model without thrust or command, or without what the peer cannot do without, or a run so short that most of full thrust
//! would be computed: refused, and nothing is written.
//! Units: as the peer's.
//! Reference: docs/export.md, with a link to each definition.

mod ardupilot;
mod betaflight;
mod crazyflie;
mod curve;
mod px4;
mod simulink;
mod table;

use crate::Failure;
use crate::apart::Paths;
use crate::replace::put;
use clap::ValueEnum;
use curve::Powerplant;
use ident::model::Model;
use std::path::PathBuf;

/// Whose file.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Peer {
    /// Parameter file of QGroundControl: THR_MDL_FAC, CA_ROTORn_CT, CA_ROTORn_KM, PWM_MAIN_MINn, with --cells BAT1_N_CELLS, with --cells and --rig-supply
    /// BAT1_R_INTERNAL, with --capacity BAT1_CAPACITY.
    Px4,
    /// Parameter file: MOT_THST_EXPO, MOT_SPIN_ARM, _MIN and _MAX, with --cells MOT_BAT_VOLT_MAX and _MIN, with --capacity BATT_CAPACITY.
    Ardupilot,
    /// Lines for the command line: thrust_linear, motor_kv, motor_poles, dshot_idle_value, with --cells those of the battery, with --capacity bat_capacity.
    Betaflight,
    /// C header: thrust over motor voltage, thrust_min and _max, torque over thrust, with --cells the battery's limits.
    Crazyflie,
    /// MATLAB script with a structure of tables for lookup blocks, supply, lag, latency and delays.
    Simulink,
    /// Table of settled states over the pulse, with supply, lag, latency and delays in its head.
    Csv,
}

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The model.
    model: PathBuf,
    /// Whose file it is to be.
    #[arg(long, value_enum)]
    to: Peer,
    /// Where it goes; standard output without it.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Cells in series of the battery that will fly; every file says them, or what hangs on them. The model knows its own supply alone.
    #[arg(long, value_parser = crate::number::whole::<u32>(1, 14, "cells"))]
    cells: Option<u32>,
    /// Capacity of that battery, mAh, as printed on it: no model knows it.
    #[arg(long, value_name = "MAH", value_parser = crate::number::milliampere_hours(100, 100_000))]
    capacity: Option<u32>,
    /// The rig ran on the battery and the leads that will fly: their resistance goes into the file (px4). A bench supply's does not belong there.
    #[arg(long)]
    rig_supply: bool,
    /// Writes the file although more of its full thrust is computed than was measured.
    #[arg(long)]
    extrapolate: bool,
    /// Rotors of the vehicle, for the peers that name each.
    #[arg(long, default_value_t = 4, value_parser = crate::number::whole::<u32>(1, 12, "rotors"))]
    rotors: u32,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.model]).writes("-o", &self.output)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    crate::kind::refuse_no_model(&args.model)?;
    let model = Model::read(&args.model)?;
    let plant = Powerplant::of(&args.model, &model)?;
    if let Some((us, measured_n)) = plant.ends_at().filter(|(_, n)| plant.full_n() > 2.0 * n && !args.extrapolate) {
        return Err(format!(
            "{}: the run ends at {us:.0} us and {measured_n:.2} N, and full thrust would be computed as {:.2} N, more than twice that; expected a run up to full throttle: run one, or take the computed rest with --extrapolate",
            args.model.display(),
            plant.full_n()
        )
        .into());
    }
    let battery = Battery { cells: args.cells, capacity_mah: args.capacity, of_the_rig: args.rig_supply };
    let text = match args.to {
        Peer::Px4 => px4::text(&plant, args.rotors, battery),
        Peer::Ardupilot => ardupilot::text(&plant, battery),
        Peer::Betaflight => betaflight::text(&plant, battery),
        Peer::Crazyflie => crazyflie::text(&plant, battery).map_err(|why| format!("{}: {why}", args.model.display()))?,
        Peer::Simulink => simulink::text(&plant, battery),
        Peer::Csv => table::text(&plant, battery),
    };
    match &args.output {
        Some(path) => {
            put(path, &text)?;
            if !quiet {
                say!("{}: {}", path.display(), plant.title());
                plant.reach().into_iter().for_each(|line| say!("{line}"));
            }
        }
        None => {
            crate::say::text(&text);
            if !quiet {
                plant.reach().into_iter().for_each(|line| note!("{line}"));
            }
        }
    }
    Ok(())
}

/// The battery that will fly, as far as the caller tells it.
#[derive(Clone, Copy)]
struct Battery {
    /// In series.
    cells: Option<u32>,
    capacity_mah: Option<u32>,
    /// The rig ran on it.
    of_the_rig: bool,
}

impl Battery {
    /// What stands in the place of a capacity that nobody told.
    fn no_capacity(self, key: &str) -> Option<String> {
        self.capacity_mah.is_none().then(|| format!("{key}: the capacity of the battery that will fly is not known (--capacity)"))
    }
}

/// Lines of a head behind a comment sign.
fn comments(sign: &str, lines: &[String]) -> String {
    // a name may hold anything; what follows a line break would be no comment
    let shown = |c: char| if c.is_control() { ' ' } else { c };
    lines.iter().map(|line| format!("{sign} {}\n", line.chars().map(shown).collect::<String>())).collect()
}

/// How far the peer's curve is from the model's.
fn off(percent: f64) -> String {
    format!("its curve is within {percent:.2} % of full thrust of the model's")
}

/// Full thrust, for who reads the curve back, and how far it was measured.
fn full(plant: &Powerplant) -> String {
    let reach = plant.reach().map_or_else(String::new, |reach| format!("; {reach}"));
    let begins = if plant.begins { "; supply and motor as the run began" } else { "" };
    format!("full thrust {:.5} N{begins}{reach}", plant.full_n())
}

/// What the peer has no key for, or the model no answer to.
fn untold(lines: impl IntoIterator<Item = String>) -> Vec<String> {
    lines.into_iter().map(|line| format!("not in this file: {line}")).collect()
}
