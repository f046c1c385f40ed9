//! The fault campaign: many seeds, and the page with its table.
//!
//! What it is: `faults [--runs N] [--from SEED] [--page FILE]`; the table on standard output, or the page.
//! What can go wrong: a flight that goes wrong ends the command with status 1, with its plan; wrong usage with 2.
//! Units: ms.
//! Reference: `docs/faults.md`.

use hal_sim::fault::{Mishap, Tally, fly_all};
use indicatif::{ProgressBar, ProgressStyle};
use std::process::ExitCode;

const USAGE: &str = "usage: cargo xtask faults [--runs N] [--from SEED] [--page FILE]";

/// What is asked for.
struct Asked {
    runs: u64,
    from: u64,
    page: Option<String>,
}

fn asked() -> Option<Asked> {
    let mut asked = Asked { runs: 10_000, from: 0, page: None };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let value = words.next()?;
        match word.as_str() {
            "--runs" => asked.runs = value.parse().ok().filter(|runs| *runs > 0)?,
            "--from" => asked.from = value.parse().ok()?,
            "--page" => asked.page = Some(value),
            _ => return None,
        }
    }
    Some(asked)
}

/// A count with a space before every three digits.
fn thousands(count: u64) -> String {
    let digits = count.to_string();
    let groups: Vec<_> = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy).collect();
    groups.join(" ")
}

fn page(asked: &Asked, tally: &Tally) -> String {
    let Asked { runs, from, .. } = asked;
    let (kinds, wrong) = (Mishap::all().len(), tally.wrong());
    let again = if *from == 0 { String::new() } else { format!(" --from {from}") };
    format!(
        "# Faults: {} flights\n\n\
         Written by `cargo xtask faults --runs {runs}{again} --page docs/faults.md`; the same command writes the same bytes.\n\n\
         Each flight is one seed. It draws four things:\n\n\
         - a kind of mishap ({kinds} of them, by turns), its place, and the instant at which it comes;\n\
         - the rig: five of the presets of `examples/rig/`, or a part of the sensors with drawn limits, times and rates;\n\
         - what the rig does then: rest, arming, range calibration, running;\n\
         - the throttle: a level, steps, a ramp, a chirp or segments.\n\n\
         The firmware's own shell flies it natively. It is judged from outside, by pulses and telemetry (`hal-sim/src/fault/rule.rs`):\n\n\
         - minimum throttle within the time in which the board can know, and 40 ms for two frames of the ESC;\n\
         - the fault named, none named that nothing justifies, and latched: whoever asks for throttle afterwards gets none;\n\
         - never a pulse above minimum but while running or while the range calibration holds maximum;\n\
         - after a reset disarmed, the first minimum pulse within 40 ms, and told what ended the program;\n\
         - what is no fault stops nothing: a partial rig, a pin that floats, one sensor of four, a loose contact shorter than its limit;\n\
         - one sensor that fails is told in the samples, and no other is blamed.\n\n\
         A stop is counted from the mishap to the start of the last pulse above minimum; the limit is that of the slowest flight.\n\
         Some kinds stop some flights only. With one or two speed sensors nobody can say which is right; a disarmed rig needs no host.\n\
         A stop without a limit is one that nothing asked for and the rule allows there.\n\n\
         What the native board cannot show (registers, masked interrupts, the watchdog itself) flies on the flash image:\n\
         `tests/tests/emulated_campaign.rs`, under the same rules. The overload of the load cell is flown with limits that the amplifier can\n\
         show: the factory's (+-32.6 N, half the beam's yield) lie beyond its rails (-6.1 to 5.1 N), where the reading stands still.\n\n\
         {} flights, {wrong} wrong.\n\n{}",
        thousands(*runs),
        thousands(tally.flown()),
        tally.table()
    )
}

fn main() -> ExitCode {
    let Some(asked) = asked() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    let bar = ProgressBar::new(asked.runs); // draws on a terminal only
    if let Ok(style) = ProgressStyle::with_template("{elapsed_precise} {bar:40} {pos}/{len} flights, {eta} left") {
        bar.set_style(style);
    }
    let tally = fly_all(asked.from..asked.from + asked.runs, |done| bar.set_position(done));
    bar.finish_and_clear();
    match &asked.page {
        Some(file) => {
            if let Err(error) = std::fs::write(file, page(&asked, &tally)) {
                eprintln!("faults: {file}: {error}");
                return ExitCode::from(1);
            }
            println!("{}: {} flights, {} wrong", file, tally.flown(), tally.wrong());
        }
        None => print!("{}", tally.table()),
    }
    tally.failures.iter().for_each(|failure| eprintln!("{failure}"));
    if tally.wrong() == 0 { ExitCode::SUCCESS } else { ExitCode::from(1) }
}
