//! `quadrig identify`.
//!
//! What it is: plateaus, declared fits with standard errors, quality figures; writes `model.toml`.
//! What can go wrong: refused input; the model appears whole or not at all.
//! Units: as the channels state.
//! Reference: specification `identification.md`.

use crate::Failure;
use ident::identify::identify;
use ident::log::{Log, write_whole};
use ident::report::number;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The run.
    log: PathBuf,
    /// Where the model goes.
    #[arg(short, long)]
    output: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let log = Log::read(&args.log)?;
    let found = identify(&log)?;
    write_whole(&args.output, |out| out.write_all(found.model.to_toml().as_bytes()))
        .map_err(|e| format!("{}: {e}", args.output.display()))?;
    if quiet {
        return Ok(());
    }
    println!("{} plateaus", found.plateaus.len());
    println!(
        "{:>9} {:>9} {:>6}  {}",
        "from s",
        "to s",
        "rows",
        found.columns.iter().map(|c| format!("{c:>22}")).collect::<String>()
    );
    for p in &found.plateaus {
        let means: String = p
            .means
            .iter()
            .map(|m| m.map_or_else(|| format!("{:>22}", "-"), |(v, se)| format!("{:>12.4} +- {:>6.4}", v, se)))
            .collect();
        println!("{:>9.2} {:>9.2} {:>6}  {means}", p.from_s, p.to_s, p.rows);
    }
    for p in &found.model.polynomials {
        let terms: Vec<String> = p
            .coefficients
            .iter()
            .zip(&p.errors)
            .enumerate()
            .map(|(k, (c, e))| format!("c{k} = {} +- {}", number(*c), number(*e)))
            .collect();
        println!("{:<12} {}", p.channel, terms.join(", "));
    }
    for q in &found.quality {
        println!("{:<12} rms {} {}, noise floor {}, R2 {:.6}", q.channel, number(q.rms), q.unit, number(q.noise_floor), q.r2);
    }
    for c in &found.constants {
        println!("{:<12} {} +- {} {}", c.name, number(c.value), number(c.se), c.unit);
    }
    Ok(())
}
