//! `quadrig import`.
//!
//! What it is: reads a foreign CSV, writes a rig log, prints what was repaired.
//! What can go wrong: what the importer refuses; then nothing is written.
//! Units: converted, and said.
//! Reference: specification `formats.md`.

use crate::Failure;
use ident::import::Mapping;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The export: RCbenchmark or Tyto CSV, a tidy CSV, or any CSV with --map.
    file: PathBuf,
    /// Where the log goes.
    #[arg(short, long)]
    output: PathBuf,
    /// A column's meaning, TARGET=SOURCE or TARGET=SOURCE*FACTOR; may be given more than once.
    #[arg(long = "map", value_name = "TARGET=SOURCE*FACTOR")]
    mappings: Vec<Mapping>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let (log, report) = ident::import::import(&args.file, &args.mappings)?;
    log.write(&args.output).map_err(|e| format!("{}: {e}", args.output.display()))?;
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
