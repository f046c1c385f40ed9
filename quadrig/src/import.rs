//! `quadrig import`.
//!
//! What it is: reads a foreign CSV, writes a rig log or, of a flight, a flight log, prints what was repaired and turned.
//! What can go wrong: what the importer refuses; then nothing is written.
//! Units: converted, and said.
//! Reference: specification `formats.md`.

use crate::Failure;
use crate::apart::Paths;
use crate::trouble::unwritten;
use ident::import::Mapping;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The export: RCbenchmark or Tyto CSV, a tidy CSV, any CSV with --map, or a decoded flight of a Crazyflie.
    file: PathBuf,
    /// Where the log goes.
    #[arg(short, long)]
    output: PathBuf,
    /// A column's meaning, TARGET=SOURCE or TARGET=SOURCE*FACTOR; may be given more than once.
    #[arg(long = "map", value_name = "TARGET=SOURCE*FACTOR")]
    mappings: Vec<Mapping>,
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
        Ok(Self(key.to_owned(), read.unwrap_or_else(|| toml::Value::String(value.to_owned()))))
    }
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.file]).writes("-o", [&self.output])
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let flight = if args.mappings.is_empty() { ident::import::flight(&args.file)? } else { None };
    let is_flight = flight.is_some();
    let (mut log, report) = flight.map_or_else(|| ident::import::import(&args.file, &args.mappings), Ok)?;
    if is_flight {
        args.meta.iter().for_each(|Meta(key, value)| drop(log.meta.insert(key.clone(), value.clone())));
        ident::flight_log::write(&log, &args.output)
    } else if let Some(Meta(key, _)) = args.meta.first() {
        return Err(format!("--meta {key}: {} is no flight; expected a flight", args.file.display()).into());
    } else {
        log.write(&args.output)
    }
    .map_err(unwritten(&args.output))?;
    if !quiet {
        print!("{}", report.table());
        println!(
            "{} rows, {:.3} s, columns t_s {}",
            log.len(),
            log.t[log.len() - 1] - log.t[0],
            log.columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(" ")
        );
    }
    Ok(())
}
