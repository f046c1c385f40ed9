//! `quadrig demo`: the main job end to end, without hardware.
//!
//! What it is: arm, sweep, log, identify, find the residual, name the effect, correct the model, simulate with it, report.
//! What can go wrong: nothing that a newcomer has to know; a failure says what failed.
//! Units: as the log states.
//! Reference: specification `formats.md`, `quadrig demo`.

use crate::Failure;
use crate::apart::Paths;
use crate::close_loop::results;
use crate::folder::Folder;
use crate::progress::Bar;
use crate::sim::{fly, fly_model};
use clap::builder::PossibleValuesParser;
use hal_sim::{Scenario, effect};
use ident::channel::{Context, unit_of};
use ident::close::close;
use ident::log::Log;
use ident::plateau::{plateaus, so_many};
use ident::report::{Hidden, Origin, Vocabulary, terminal, wrapped};
use ident::verdict::words::{channel, digits, scaled};
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

/// The effects among which the seed draws.
const HIDDEN: [&str; 6] = ["supply_sag", "battery_discharge", "thermal_zero", "zero_drift", "beam_resonance", "channel_filter"];

/// What `--effect` says.
fn effect_help() -> String {
    let list = |names: &[&str]| ident::verdict::words::list(&names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>());
    let (drawn, unknown) = (list(&HIDDEN), list(&effect::UNKNOWN));
    format!(
        "Hides this effect; without it one is drawn of {drawn}. The library of the identification does not know {unknown}: these are never named"
    )
}

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Draws the hidden effect and every noise; from the clock when not given.
    #[arg(long, value_parser = crate::number::whole::<u64>(0, u64::MAX, "a seed"))]
    seed: Option<u64>,
    #[arg(long, help = effect_help(), value_parser = PossibleValuesParser::new(effect::catalogue().iter().map(|e| e.id)))]
    effect: Option<String>,
    /// Folder for log, model, verdict and report.
    #[arg(short, long, default_value = "out/demo")]
    output: PathBuf,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().fills("-o", [&self.output])
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let seed =
        args.seed.unwrap_or_else(|| SystemTime::now().duration_since(UNIX_EPOCH).map_or(1, |d| d.as_millis() as u64 % 1_000_000));
    let id = args.effect.clone().unwrap_or_else(|| HIDDEN[(mixed(seed) % HIDDEN.len() as u64) as usize].to_owned());
    let scenario = Scenario::demo(seed, Some(&id))?;
    let mut folder = Folder::new(&args.output, "demo")?;
    let say = |line: String| {
        if !quiet {
            say!("{line}");
        }
    };
    let hides = format!("seed {seed}: a 570 KV motor with an 11x4.7 propeller; one effect is hidden (repeat with --seed {seed})");
    say(wrapped(&hides, 0));
    let log = fly(&scenario, None, "run.csv", "flying", quiet)?;
    let mut text = Vec::new();
    log.write_to(&mut text)?;
    let found = so_many(plateaus(&Context::new(&log, None), &log).len());
    say(format!("the rig firmware armed the ESC, flew an up-down staircase and logged {} samples; {found}\n", log.len()));

    // from here on only the log is known, as it was written
    let log = Log::parse("run.csv", text.as_slice())?;
    folder.add("run.csv", text);
    let closed = {
        let bar = Bar::new("searching", quiet);
        close(&log, None, &[], &mut |share| bar.set(share))?
    };
    let truth = &scenario.effects[0];
    let parameters = truth
        .parameters()
        .iter()
        .map(|(n, v, u)| format!("{n} = {}{}", size(*v), if *u == "1" { String::new() } else { format!(" {u}") }))
        .collect();
    let hidden = Hidden { seed, id: truth.id().to_owned(), parameters };
    let judged = hidden.judged(&closed.verdict);
    let origin = Origin { hidden: Some(hidden), ..Origin::of(&log) };
    folder.extend(results(&log, &closed, origin)?);
    say(terminal(&closed.verdict, Vocabulary::RIG, false));

    match fly_model(&scenario, &closed.model, &log, "again.csv", quiet) {
        Ok(again) => {
            let mut text = Vec::new();
            again.write_to(&mut text)?;
            folder.add("again.csv", text);
            say(resimulated(&closed.model, &again));
        }
        Err(e) => say(format!("the corrected model as the plant: the firmware stopped the run ({e})\n")),
    }

    folder.write()?;
    judged.into_iter().map(|line| wrapped(&line, 2)).for_each(&say);
    say(format!("the page to look at: {}", args.output.join("report.html").display()));
    Ok(())
}

/// What the corrected model leaves over on the run that was simulated with it.
fn resimulated(model: &ident::model::Model, again: &Log) -> String {
    let context = model.context(again);
    let mut out = String::from("the corrected model as the plant, same schedule:\n");
    for target in context.targets.iter().filter(|t| ident::log::MODELLED.contains(&t.name)) {
        let Some(prediction) = model.predict(&context, target.name) else { continue };
        let residual: Vec<f64> = target.rows.iter().zip(&target.y).map(|(i, y)| y - prediction[*i]).collect();
        let rms = (residual.iter().map(|r| r * r).sum::<f64>() / residual.len() as f64).sqrt();
        let (factor, unit) = scaled(rms.max(target.noise.rms), unit_of(target.name));
        let [left, floor] = [rms, target.noise.rms].map(|v| format!("{} {unit}", digits(factor * v, 0.005 * factor * v)));
        out += &format!("  {:<16}{left:>14} left, noise floor {floor}\n", channel(target.name));
    }
    out
}

/// A size of what was hidden; a whole number, such as that of a channel, as itself.
fn size(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { four(value) }
}

/// To four significant digits.
fn four(value: f64) -> String {
    let near: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if near.abs() < 1e-3 { format!("{near:e}") } else { format!("{near}") }
}

/// Spreads neighbouring seeds (splitmix64).
fn mixed(seed: u64) -> u64 {
    let z = (seed.wrapping_add(0x9E37_79B9_7F4A_7C15)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (z ^ (z >> 31)).wrapping_mul(0x94D0_49BB_1331_11EB) >> 33
}

/// Every effect that can be hidden is one that the simulator knows.
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_simulator_knows_what_the_demonstration_hides() {
        assert!(HIDDEN.iter().all(|id| effect::find(id).is_some()));
    }

    #[test]
    fn a_whole_number_has_no_decimals() {
        let sizes = [1.0, 0.013_431_7, 68.284_88, 0.592_01, 6.300_04e-5].map(size);
        assert_eq!(sizes, ["1", "0.01343", "68.28", "0.592", "6.3e-5"]);
    }

    #[test]
    fn seeds_draw_every_effect() {
        let drawn: std::collections::BTreeSet<u64> = (0..60).map(|s| mixed(s) % HIDDEN.len() as u64).collect();
        assert_eq!(drawn.len(), HIDDEN.len());
    }
}
