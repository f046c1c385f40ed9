//! `quadrig sim`.
//!
//! What it is: the portable firmware against a simulated rig; its telemetry, decoded, becomes the log.
//! What can go wrong: a scenario that is refused, a firmware that stops; then no log is written.
//! Units: the log's.
//! Reference: docs/scenario.md; specification `formats.md`.

use crate::Failure;
use crate::progress::Bar;
use crate::run_log::{IdentifiedPlant, to_log};
use hal_sim::{Powerplant, Scenario};
use ident::log::Log;
use ident::model::Model;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The scenario file.
    scenario: PathBuf,
    /// Where the log goes.
    #[arg(short, long)]
    output: PathBuf,
    /// An identified model takes the place of the scenario's powerplant.
    #[arg(long)]
    model: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let scenario = Scenario::load(&args.scenario)?;
    let name = args.output.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut log = fly(&scenario, None, &name, "flying", quiet)?;
    if let Some(path) = &args.model {
        log = fly_model(&scenario, &Model::read(path)?, &log, &name, quiet)?;
    }
    log.write(&args.output).map_err(|e| format!("{}: {e}", args.output.display()))?;
    if !quiet {
        println!("{}: {} samples over {:.1} s", args.output.display(), log.len(), log.t[log.len() - 1]);
    }
    Ok(())
}

/// One simulated run as a log.
pub(crate) fn fly(
    scenario: &Scenario,
    plant: Option<Box<dyn Powerplant>>,
    name: &str,
    word: &str,
    quiet: bool,
) -> Result<Log, Failure> {
    let bar = Bar::new(word, quiet);
    let record = hal_sim::run(scenario, plant, &mut |share| bar.set(share))?;
    Ok(to_log(scenario, &record, name))
}

/// The same schedule with an identified model as the plant; `like` is the run whose command it follows.
pub(crate) fn fly_model(scenario: &Scenario, model: &Model, like: &Log, name: &str, quiet: bool) -> Result<Log, Failure> {
    let plant = IdentifiedPlant::new(model, like)
        .ok_or("the model predicts no speed from a command; expected one identified from a log with pulse_us")?;
    let healthy = Scenario { effects: Vec::new(), ..scenario.clone() };
    let mut log = fly(&healthy, Some(Box::new(plant.clone())), name, "re-flying", quiet)?;
    plant.misread(&mut log);
    Ok(log)
}
