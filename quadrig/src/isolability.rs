//! `quadrig isolability`: which causes a schedule can tell apart, before it is flown as well as after.
//!
//! What it is: the matrix of [`ident::isolability`] on a log, or on a scenario that is flown here first, without what it hides.
//! What can go wrong: refused input; a log on which nothing can be fitted; a folder that cannot be written.
//! Units: noise floors, and each cause's own.
//! Reference: docs/isolability.md.

use crate::Failure;
use crate::apart::Paths;
use crate::close_loop::{flight, inertial};
use crate::folder::{Folder, name_of};
use crate::kind::{SCENARIO, instead};
use crate::open::open;
use crate::progress::{Bar, Outlook};
use crate::sim::fly;
use crate::trouble::unread;
use hal_sim::Scenario;
use hal_sim::scenario::AnyScenario;
use ident::isolability::{Apart, Cause, Isolability, Standing, isolability, short};
use ident::log::import::Options;
use ident::log::{Log, digest};
use ident::report;
use ident::report::wrapped;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// A rig log (.csv), or a scenario (.toml), which is flown first, without the effects that it hides.
    input: PathBuf,
    /// Folder for isolability.html, matrix.svg and matrix.csv; replaced as a whole.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.input]).fills("-o", &self.output)
    }
}

/// The files of the folder.
const FILES: [&str; 3] = ["isolability.html", "matrix.svg", "matrix.csv"];

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let folder = args.output.as_deref().map(|path| Folder::new(path, "isolability")).transpose()?;
    let (log, hidden) = log_of(&args.input, quiet)?;
    let found = {
        let bar = Bar::new("asking", quiet);
        let mut outlook = Outlook::new(quiet);
        isolability(&log, &mut |share| {
            outlook.say(share);
            bar.set(share);
        })?
    };
    if let Some(mut folder) = folder {
        let texts = [
            report::isolability(&found, &comes_from(&args.input)?).html(),
            report::isolability_svg(&found),
            report::isolability_csv(&found),
        ];
        FILES.into_iter().zip(texts).for_each(|(name, text)| folder.add(name, text));
        folder.write()?;
    }
    if !quiet {
        crate::say::text(&(flown(&hidden) + &text(&found)));
    }
    Ok(())
}

/// Where the page comes from: the file with its digest, and the command.
fn comes_from(input: &Path) -> Result<Vec<(&'static str, String)>, Failure> {
    let of = if input.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) { "scenario" } else { "log" };
    let bytes = std::fs::read(input).map_err(unread(input))?;
    let again = format!("quadrig isolability {} -o out", name_of(input));
    Ok(vec![(of, name_of(input)), ("SHA-256", digest(&bytes)), ("again", again)])
}

/// The log, and the effects that a scenario would have hidden in it.
fn log_of(input: &Path, quiet: bool) -> Result<(Log, Vec<String>), Failure> {
    if input.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let AnyScenario::Rig(scenario) = AnyScenario::load(input).map_err(|why| instead(input, SCENARIO, why))? else {
            return Err(format!("{}: describes the IMU board; expected a scenario of the rig", input.display()).into());
        };
        let hidden = scenario.effects.iter().map(|e| e.id().to_owned()).collect();
        let healthy = Scenario { effects: Vec::new(), ..*scenario };
        return Ok((fly(&healthy, None, &name_of(input), "flying", quiet)?, hidden));
    }
    if inertial::is_attitude_log(input) || flight::is_flight_log(input) {
        return Err(format!("{}: an attitude or flight log; expected a rig log or a scenario", input.display()).into());
    }
    Ok((open(input, &Options::default(), quiet)?, Vec::new()))
}

fn flown(hidden: &[String]) -> String {
    if hidden.is_empty() { String::new() } else { format!("flown without what it hides: {}\n", hidden.join(", ")) }
}

/// The matrix as a person reads it.
fn text(found: &Isolability) -> String {
    let mut out = format!("{}: {}\n{}", found.run, found.length(), line(&found.summary(), 0));
    if !found.found.is_empty() {
        out += &line(&format!("The log as it is holds {}; they stay in it.", found.found.join(", ")), 0);
    }
    out += &table(found);
    out += &matrix(found);
    out += &groups(found);
    for (standing, words) in [(Standing::Unshown, "named at no size"), (Standing::Unjudged, "not judged, no fit makes sense")] {
        let names = found.names(standing);
        if !names.is_empty() {
            out += &line(&format!("{words}: {}", names.join(", ")), 2);
        }
    }
    out += &line(&format!("not offered by these channels: {}", found.not_offered.join(", ")), 2);
    out
}

/// A text in lines, further ones set in.
fn line(text: &str, indent: usize) -> String {
    wrapped(text, indent) + "\n"
}

fn table(found: &Isolability) -> String {
    let of_channels = found.causes.iter().filter(|c| c.seen.is_some()).map(|c| c.main.chars().count());
    let wide = of_channels.chain(["channel".len()]).max().unwrap_or_default();
    let mut out = format!(
        "\n{:<26} {:<wide$} {:>6} {:>7}  {}\n",
        "named from this size on", "channel", "floors", "beside", "in its own unit"
    );
    for (k, cause) in found.causes.iter().enumerate() {
        let Some(seen) = &cause.seen else { continue };
        let beside = format!("{:.1} %", 100.0 * cause.free);
        let name = format!("{:>2} {}", k + 1, cause.name);
        let before = format!("{name:<26} {:<wide$} {:>6} {beside:>7}  ", cause.main, short(seen.floors));
        // what is long goes on under itself
        out += &format!("{before}{}", line(&cause.in_words(), before.chars().count()));
    }
    out += &line(
        "floors: root mean square of what the declared model cannot take up. beside: share of its squares that is. Under 1 % a cause is named only if it is exactly as the library has it.",
        0,
    );
    out
}

/// One sign a cell.
fn sign(cause: &Cause, other: usize) -> char {
    let named = cause.seen.as_ref().map_or(0.0, |s| s.floors * std::f64::consts::SQRT_2);
    match &cause.apart[other] {
        Apart::SameName => '=',
        Apart::Elsewhere => ' ',
        Apart::From(size) if size.floors <= named => '.',
        Apart::From(_) => '+',
        Apart::Never => '#',
    }
}

fn matrix(found: &Isolability) -> String {
    let shown: Vec<usize> = (0..found.causes.len()).filter(|k| found.causes[*k].sensible).collect();
    let mut out = String::from("\nrow is there, column is what it could be taken for:\n");
    for (words, digit) in [("", 10), ("", 1)] {
        let head: String = shown.iter().map(|k| char::from(b'0' + (((k + 1) / digit) % 10) as u8)).collect();
        out += &format!("{words:<30} {head}\n");
    }
    for k in &shown {
        let cells: String = shown.iter().map(|other| sign(&found.causes[*k], *other)).collect();
        out += &format!("{:<30} {}\n", format!("{:>2} {}", k + 1, found.causes[*k].name), cells.trim_end());
    }
    out += ". told apart once named, + when larger, # alike at any size, = one name, blank no common channel\n";
    for cause in &found.causes {
        let later: Vec<String> =
            found.later(cause).iter().filter_map(|(name, at)| Some(format!("{name} from {} floors", short((*at)?)))).collect();
        if !later.is_empty() {
            out += &line(&format!("{} is told from {}", cause.name, later.join(", ")), 2);
        }
    }
    out
}

fn groups(found: &Isolability) -> String {
    let mut out = String::new();
    for group in &found.groups {
        out += "\n";
        out += &line(&format!("cannot be told apart: {}", found.members(group)), 2);
        if let Some(next) = &group.next {
            if !next.separates {
                out += &line(&format!("  no run would: {}", next.why), 2);
                continue;
            }
            out += &line(&format!("  a run that would: {}", next.why), 2);
            let steps: Vec<String> = next.schedule.iter().map(|s| format!("{} us x {} s", s.pulse_us, s.hold_s)).collect();
            out += &line(&format!("  {}", steps.join(", ")), 2);
        }
    }
    if found.groups.is_empty() { out } else { out + "\n" }
}
