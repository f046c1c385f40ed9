//! `quadrig import`.
//!
//! What it is: reads a foreign CSV, writes a rig log or, of a flight, a flight log, prints what was repaired and turned.
//! What can go wrong: what the importer refuses; then nothing is written.
//! Units: converted, and said.
//! Reference: specification `formats.md`.

use crate::Failure;
use crate::apart::Paths;
use crate::join::{With, join};
use crate::open::{Columns, Names, as_written};
use crate::replace::{put, put_as, put_log};
use ident::log::import::Report;
use ident::report::{WIDEST, wrapped};
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The export: CSV of RCbenchmark, Tyto Flight Stand, VESC Tool, ESC telemetry or any other with --map; a flight (Crazyflie, PX4, Betaflight).
    file: PathBuf,
    /// Where the log goes.
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    names: Names,
    /// Of a PX4 or Betaflight recording this rotor's ESC alone, as a rig log; with --with of such a further logger.
    #[arg(long, value_name = "N", value_parser = crate::number::whole::<u32>(1, 12, "rotors"))]
    rotor: Option<u32>,
    /// Another logger of the same run (ESC, flight controller, board), put on this one's clock by what both saw; its channels are named after
    /// it (rpm_esc, current_esc_a, ...), and a page beside the output shows the joint. May be given more than once.
    #[arg(long = "with", value_name = "[esc|fc|board|stand2=]FILE")]
    with: Vec<With>,
    /// Metadata of a flight, such as mass_kg=0.037; may be given more than once.
    #[arg(long = "meta", value_name = "KEY=VALUE")]
    meta: Vec<Meta>,
}

/// One line of metadata.
#[derive(Clone)]
struct Meta(String, toml::Value);

impl std::str::FromStr for Meta {
    type Err = String;

    /// A TOML key and value; a value that is none is taken as text.
    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) = text.split_once('=').ok_or("expected KEY=VALUE")?;
        let plain = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !plain {
            return Err("expected letters, digits and _ before the =".to_owned());
        }
        let read = format!("v = {value}").parse::<toml::Table>().ok().and_then(|mut table| table.remove("v"));
        if read.as_ref().and_then(toml::Value::as_float).is_some_and(|v| !v.is_finite()) {
            return Err("expected a number with an end".to_owned());
        }
        Ok(Self(key.to_owned(), read.unwrap_or_else(|| toml::Value::String(value.to_owned()))))
    }
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.file]).reads(self.with.iter().map(With::file)).writes("-o", [&self.output])
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let options = args.columns.options(&args.names);
    // the rotor of a further logger is no word on the stand's own file
    let rotor = args.rotor.filter(|_| args.with.is_empty());
    let flight = match rotor {
        Some(_) => None,
        None if options.mappings.is_empty() => ident::log::import::flight(&args.file)?,
        None => None,
    };
    let is_flight = flight.is_some();
    let (mut log, report) = match (flight, rotor) {
        (Some(found), _) => found,
        (None, Some(n)) => ident::log::import::rotor(&args.file, n as usize)?
            .ok_or_else(|| format!("--rotor {n}: {} is no PX4 ULog and no Betaflight Blackbox log; expected one of them: leave --rotor away for an export of a stand or an ESC", args.file.display()))?,
        (None, None) => ident::log::import::import_as(&args.file, &options)
            .map_err(|why| crate::kind::another(&args.file).map_or(why.into(), Failure::from))?,
    };
    options.name(&mut log);
    let mut joined = None;
    if is_flight && !args.with.is_empty() {
        return Err(format!("--with: {} is a flight; expected a stand's log", args.file.display()).into());
    }
    if !args.with.is_empty() {
        log = as_written(&log)?;
        log.sha256 = None;
        joined = Some(join(&mut log, &args.file, (&args.with, args.rotor), &options)?);
    }
    if is_flight {
        args.meta.iter().for_each(|Meta(key, value)| drop(log.meta.insert(key.clone(), value.clone())));
        put_as(&args.output, &format!("# {}", ident::log::flight_log::FORMAT), |out| {
            ident::log::flight_log::write_to(&log, out)
        })?;
    } else if let Some(Meta(key, _)) = args.meta.first() {
        return Err(format!("--meta {key}: {} is no flight; expected a flight", args.file.display()).into());
    } else {
        // what every reader takes, or nothing
        as_written(&log)?;
        put_log(&args.output, &log)?;
    }
    if let Some(joined) = &joined {
        let path = args.output.with_extension("joint.html");
        put(&path, &joined.page)?;
    }
    if !quiet {
        joined.iter().flat_map(|j| &j.remarks).for_each(|line| note!("{line}"));
        crate::say::text(&table(&report));
        joined.iter().flat_map(|j| &j.reports).for_each(|r| crate::say::text(&table(r)));
        let columns = log.columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(" ");
        let seconds = log.t[log.len() - 1] - log.t[0];
        let time = if log.time_is_row() { "no time (t_s is the row)".to_owned() } else { format!("{seconds:.3} s") };
        let told = format!("{} rows, {time}, columns t_s {columns}", log.len());
        say!("{}", wrapped(&told, 2));
    }
    Ok(())
}

/// What was found on the way, a table no wider than a terminal.
fn table(report: &Report) -> String {
    let whole = report.table();
    let findings = whole.find("finding").unwrap_or(0);
    // further lines stand beneath the first, as far as that leaves room for them
    let line = |line: &str| match line.split_at_checked(findings) {
        Some((lead, what)) if line.chars().count() > WIDEST => {
            format!("{lead}{}\n", wrapped(what, findings.min(WIDEST / 2)))
        }
        _ => format!("{line}\n"),
    };
    whole.lines().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ident::log::import::Note;

    #[test]
    fn findings_fit_a_terminal() {
        let what = "glitches: one or two samples far from both neighbours; kept, left out of means and fits".to_owned();
        let notes = vec![Note { column: "rpm_electrical".to_owned(), what, count: 1 }];
        let said = table(&Report { notes });
        assert!(said.lines().all(|l| l.chars().count() <= WIDEST) && said.lines().count() == 3, "{said}");
        assert!(said.lines().last().is_some_and(|l| l.starts_with(&" ".repeat(25))), "{said}");
    }
}
