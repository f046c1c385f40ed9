//! `quadrig sim`.
//!
//! What it is: the portable firmware against a simulated rig; its telemetry, decoded, becomes the log. On request with the ground
//! truth in a side file, the pins' traffic recorded or replayed, or live with pause, single steps and a speed factor. A scenario
//! with a table `[imu]` is a run of the IMU board ([`imu`]).
//! What can go wrong: a scenario that is refused, a firmware that stops; then no log is written.
//! Units: the log's.
//! Reference: docs/scenario.md; specification `formats.md`.

mod imu;

use crate::Failure;
use crate::apart::Paths;
use crate::kind::{PINS, SCENARIO, instead};
use crate::live;
use crate::open::read_model;
use crate::progress::{Bar, foretell};
use crate::replace::{put_as, put_log};
use crate::run_log::{IdentifiedPlant, to_log};
use crate::view;
use hal_sim::native::{PinRecord, Session};
use hal_sim::scenario::AnyScenario;
use hal_sim::{Powerplant, RunRecord, Scenario, SimError, Truth};
use ident::log::{Log, SPEED};
use ident::model::Model;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

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
    /// Writes what was really there at each sample (CSV).
    #[arg(long, conflicts_with = "replay")]
    truth: Option<PathBuf>,
    /// Records the raw codes as well (columns `raw_*`), so that a better calibration can be replayed with `quadrig recalibrate`.
    #[arg(long, conflicts_with = "model")]
    raw: bool,
    /// Writes what the sensors of the IMU board gave, as `quadrig ahrs` reads it (CSV).
    #[arg(long)]
    readings: Option<PathBuf>,
    /// Records everything that reaches the board's pins.
    #[arg(long, conflicts_with_all = ["model", "replay"])]
    pins: Option<PathBuf>,
    /// The firmware alone on recorded pins, without plant and ESC; the scenario gives its configuration.
    #[arg(long, conflicts_with_all = ["model", "live"])]
    replay: Option<PathBuf>,
    /// Shows the run as it goes, in the terminal view; without a terminal a line at a time, and lines on the standard input control it:
    /// p pauses, s steps 0.1 s, a number sets the speed, q ends.
    #[arg(long, conflicts_with = "model")]
    live: bool,
    /// Times real time in the live view; 0 for as fast as it goes.
    #[arg(long, default_value_t = 1.0, requires = "live", value_parser = crate::number::from(0.0, 1e6, "times real time"))]
    speed: f64,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default()
            .reads([&self.scenario])
            .reads(&self.model)
            .reads(&self.replay)
            .writes("-o", [&self.output])
            .writes("--truth", &self.truth)
            .writes("--readings", &self.readings)
            .writes("--pins", &self.pins)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let scenario = match AnyScenario::load(&args.scenario).map_err(|why| instead(&args.scenario, SCENARIO, why))? {
        AnyScenario::Rig(scenario) => *scenario,
        AnyScenario::Imu(scenario) => return imu::run(args, &scenario, quiet),
    };
    args.paths().reads_too(scenario.schedule.files(&args.scenario)).check()?;
    scenario.begins_in_time(&args.scenario)?;
    if args.readings.is_some() {
        return Err(format!(
            "{}: describes the rig; expected a scenario of the IMU board with --readings",
            args.scenario.display()
        )
        .into());
    }
    let name = args.output.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let record = match &args.replay {
        Some(path) => replayed(&scenario, path, quiet)?,
        None => flown(args, &scenario, quiet)?,
    };
    if let Some(path) = &args.truth {
        put_as(path, TRUTH, |out| write_truth(out, &record.truth))?;
    }
    let mut log = to_log(&scenario, &record, &name, args.raw);
    if log.is_empty() {
        return Err("ended before the first sample: no log was written; expected to go on until the rig is armed".into());
    }
    if let Some(path) = &args.model {
        log = fly_model(&scenario, &read_model(path, quiet)?, &log, &name, quiet)?;
    }
    put_log(&args.output, &log)?;
    if !quiet {
        say!("{}: {} samples over {:.1} s", args.output.display(), log.len(), log.t[log.len() - 1]);
    }
    Ok(())
}

/// The run that the arguments ask for, with the record of its pins where one is wanted.
fn flown(args: &Args, scenario: &Scenario, quiet: bool) -> Result<RunRecord, Failure> {
    let mut session = Session::new(scenario, None);
    if args.pins.is_some() {
        session.record_pins(scenario);
    }
    foretell(scenario.run_s(), if args.live && args.speed > 0.0 { args.speed } else { pace(scenario, 1.0) }, quiet);
    let mut cut_short = false;
    if args.live && !quiet && view::is_there() {
        cut_short = live::view(&mut session, scenario, args.speed)?;
    } else if args.live {
        cut_short = live::watch(&mut session, args.speed)?;
    } else {
        let bar = Bar::new("flying", quiet);
        while session.step()? {
            bar.set(session.share());
        }
    }
    if let (Some(path), Some(pins)) = (&args.pins, session.pins()) {
        put_as(path, PINS, |mut out| pins.write(&mut out))?;
    }
    let now_s = session.now_s();
    match session.finish() {
        Err(SimError::Stuck { .. }) if cut_short => Err(format!(
            "ended after {now_s:.1} s of the run, before the rig was armed: nothing was recorded, no log was written; expected to go on until it is armed"
        )
        .into()),
        finished => Ok(finished?),
    }
}

/// Length of a run from which on its pace is tried before it starts, s.
const TRIED_FROM_S: f64 = 600.0;
/// How long the trial's piece of a run takes.
const TRIAL: Duration = Duration::from_millis(150);
/// How long it may take until it records.
const UNTIL_RECORDED: Duration = Duration::from_secs(1);

/// Times real time at which `runs` simulations like this one go on side by side, by a short trial; boundless for one that is over at once anyway.
pub(crate) fn pace(scenario: &Scenario, runs: f64) -> f64 {
    if runs * scenario.run_s() < TRIED_FROM_S {
        return f64::INFINITY;
    }
    let piece = tried(scenario);
    piece.run_s / piece.took.as_secs_f64()
}

/// The first piece of a run.
struct Piece {
    /// How long it is, s.
    run_s: f64,
    /// How long it took, from the first sample to the written log.
    took: Duration,
    /// Its rows.
    #[cfg_attr(not(test), expect(dead_code, reason = "a test asks whether what is tried is the run itself"))]
    rows: usize,
}

/// Flies the first piece of a run as the run is flown: samples are sent, read back, and written as a log. Until the board is armed none of that
/// is done, and a millisecond costs a fraction.
fn tried(scenario: &Scenario) -> Piece {
    let (mut trial, begun) = (Session::new(scenario, None), Instant::now());
    let mut goes_on = true;
    while goes_on && trial.share() == 0.0 && begun.elapsed() < UNTIL_RECORDED {
        goes_on = trial.step().unwrap_or(false);
    }
    let (from_s, begun) = (trial.now_s(), Instant::now());
    while goes_on && begun.elapsed() < TRIAL {
        goes_on = trial.step().unwrap_or(false);
    }
    let run_s = trial.now_s() - from_s;
    let mut rows = 0;
    if let Ok(record) = trial.finish() {
        let log = to_log(scenario, &record, "", false);
        rows = log.len();
        let _ = log.write_to(&mut std::io::sink()); // it takes everything
    }
    Piece { run_s, took: begun.elapsed(), rows }
}

/// The firmware of `scenario` alone on the pins of `path`.
fn replayed(scenario: &Scenario, path: &Path, quiet: bool) -> Result<RunRecord, Failure> {
    let pins = PinRecord::read(path)?;
    let bar = Bar::new("replaying", quiet);
    let telemetry = pins.replay(scenario, &mut |share| bar.set(share));
    Ok(RunRecord::from_telemetry(scenario, telemetry)?)
}

/// Columns of what was really there.
const TRUTH: &str = "t_s,pulse_us,rpm,thrust_n,torque_nm,current_a,voltage_v,temp_c,beam_n,back_emf_rpm";

/// What was really there, a row a sample.
fn write_truth(out: &mut dyn Write, truth: &[Truth]) -> std::io::Result<()> {
    writeln!(out, "{TRUTH}")?;
    for t in truth {
        let p = t.plant;
        writeln!(
            out,
            "{:.3},{:.3},{:.4},{:.6},{:.7},{:.5},{:.5},{:.4},{:.6},{}",
            t.run_s,
            t.pulse_us,
            p.rpm,
            p.thrust_n,
            p.torque_nm,
            p.current_a,
            p.voltage_v,
            p.temp_c,
            t.beam_n,
            t.back_emf_rpm.map_or_else(String::new, |rpm| format!("{rpm:.3}"))
        )?;
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
    foretell(scenario.run_s(), pace(scenario, 1.0), quiet);
    let bar = Bar::new(word, quiet);
    let record = hal_sim::run(scenario, plant, &mut |share| bar.set(share))?;
    Ok(to_log(scenario, &record, name, false))
}

/// The same schedule with an identified model as the plant; `like` is the run whose command it follows.
pub(crate) fn fly_model(scenario: &Scenario, model: &Model, like: &Log, name: &str, quiet: bool) -> Result<Log, Failure> {
    let predicts = |channels: &[&str]| model.polynomials.iter().any(|p| channels.contains(&p.channel.as_str()));
    let lacks = [("speed", predicts(&SPEED)), ("thrust", predicts(&["thrust_n"]))];
    if let Some((what, _)) = lacks.iter().find(|(_, predicted)| !predicted) {
        let expected = "expected one identified from a log with pulse_us, a speed and thrust_n";
        return Err(format!("the model predicts no {what}, and nothing else takes its place; {expected}").into());
    }
    for channel in ["torque_nm", "current_a", "voltage_v"].iter().filter(|c| !quiet && !predicts(&[c])) {
        note!("{channel}: the model does not predict it; the log holds what the channel reads of 0");
    }
    let plant = IdentifiedPlant::new(model, like)
        .ok_or("the model predicts no speed from a command; expected one identified from a log with pulse_us")?;
    let healthy = Scenario { effects: Vec::new(), ..scenario.clone() };
    let mut log = fly(&healthy, Some(Box::new(plant.clone())), name, "re-flying", quiet)?;
    plant.misread(&mut log);
    // what flew is the model's motor and propeller
    for key in ["motor", "propeller"] {
        if let Some(own) = model.meta.get(key) {
            log.meta.insert(key.to_owned(), own.clone());
        }
    }
    Ok(log)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is tried is the run itself: it begins with the first sample, and has as many rows as the run has in that time.
    #[test]
    fn the_trial_flies_a_piece_of_the_run() {
        let text = |rate: u32| {
            format!(
                "schedule = {{ kind = \"steps\", steps = [{{ pulse_us = 1500, hold_s = 5000 }}] }}\n[log]\nrate_hz = {rate}\n"
            )
        };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.toml");
        for rate in [10, 1000] {
            std::fs::write(&path, text(rate)).expect("a file");
            let AnyScenario::Rig(scenario) = AnyScenario::load(&path).expect("a scenario") else { panic!("of a rig") };
            let piece = tried(&scenario);
            let rows = piece.run_s * f64::from(rate);
            assert!(piece.run_s > 0.5 && piece.took >= TRIAL, "{} s", piece.run_s);
            assert!((piece.rows as f64 - rows).abs() <= 2.0, "{} rows in {} s", piece.rows, piece.run_s);
        }
    }
}
