//! `quadrig step`: one step of the loop on a log, as a table or as JSON.
//!
//! What it is: `declare`, `residual`, `anything`, `depends`, `candidates`, `choose`, `nameless`, `report`, `close`.
//! What can go wrong: refused input; a log on which nothing can be fitted.
//! Units: in the heads of the columns.
//! Reference: specification `closing-the-loop.md`, "The steps".

use crate::Failure;
use crate::open::{Columns, Names, open};
use crate::progress::Bar;
use clap::builder::PossibleValuesParser;
use ident::inspect::{STEPS, Table, step};
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The step.
    #[arg(value_parser = PossibleValuesParser::new(STEPS.map(|s| s.0)))]
    step: String,
    /// The run.
    log: PathBuf,
    /// The table as JSON and nothing else.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    names: Names,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let log = open(&args.log, &args.columns.options(&args.names), quiet)?;
    let found = {
        let bar = Bar::new(&args.step, quiet);
        step(&args.step, &log, &mut |share| bar.set(share))
    };
    let table = found.ok_or_else(|| format!("{}: no channel can be fitted; expected at least two related channels", log.name))?;
    if args.json {
        say!("{}", serde_json::to_string_pretty(&table)?);
    } else if !quiet {
        crate::say::text(&text(&table));
    }
    Ok(())
}

fn text(table: &Table) -> String {
    let widths: Vec<usize> = (0..table.columns.len())
        .map(|k| {
            table
                .rows
                .iter()
                .filter_map(|r| r.get(k))
                .map(|c| c.chars().count())
                .chain([table.columns[k].len()])
                .max()
                .unwrap_or(0)
        })
        .collect();
    let line = |cells: &[String]| -> String {
        let padded: Vec<String> = cells.iter().zip(&widths).map(|(c, w)| format!("{c:<w$}")).collect();
        format!("{}\n", padded.join("  ").trim_end())
    };
    let head: Vec<String> = table.columns.iter().map(|c| (*c).to_owned()).collect();
    let body: String = table.rows.iter().map(|r| line(r)).collect();
    format!("{}: {}\n\n{}{body}\n{}\n", table.step, table.question, line(&head), table.note)
}
