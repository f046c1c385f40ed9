//! `quadrig step`: one step of the loop on a log, as a table or as JSON.
//!
//! What it is: `declare`, `residual`, `anything`, `depends`, `candidates`, `choose`, `nameless`, `report`, `close`.
//! What can go wrong: refused input; a log on which nothing can be fitted.
//! Units: in the heads of the columns.
//! Reference: specification `closing-the-loop.md`, "The steps".

use crate::Failure;
use crate::apart::Paths;
use crate::open::{Columns, Names, open};
use crate::progress::Bar;
use clap::builder::PossibleValuesParser;
use ident::close::inspect::{STEPS, Table, step};
use ident::report::{WIDEST, wrapped};
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

impl Args {
    /// What it reads.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.log])
    }
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
    let total = widths.iter().sum::<usize>() + 2 * widths.len().saturating_sub(1);
    if total > WIDEST {
        return records(table);
    }
    let line = |cells: &[String]| -> String {
        let padded: Vec<String> = cells.iter().zip(&widths).map(|(c, w)| format!("{c:<w$}")).collect();
        format!("{}\n", padded.join("  ").trim_end())
    };
    let head: Vec<String> = table.columns.iter().map(|c| (*c).to_owned()).collect();
    let body: String = table.rows.iter().map(|r| line(r)).collect();
    format!("{}{}{body}\n{}\n", heading(table), line(&head), wrapped(&table.note, 0))
}

fn heading(table: &Table) -> String {
    format!("{}\n\n", wrapped(&format!("{}: {}", table.step, table.question), 0))
}

/// A table too wide for a terminal: a paragraph for each row, its first cell as the heading.
fn records(table: &Table) -> String {
    let widest = table.columns.iter().skip(1).map(|c| c.chars().count()).max().unwrap_or(0);
    let paragraph = |row: &Vec<String>| -> String {
        let (first, rest) = row.split_first().map_or(("", &[][..]), |(first, rest)| (first.as_str(), rest));
        let cells = table.columns.iter().skip(1).zip(rest).filter(|(_, cell)| !cell.trim().is_empty());
        let lines = cells.map(|(name, cell)| format!("  {name:<widest$}  {}\n", wrapped(cell, widest + 4)));
        format!("{} {}\n{}", table.columns.first().copied().unwrap_or_default(), wrapped(first, 2), lines.collect::<String>())
    };
    let body: String = table.rows.iter().map(paragraph).collect();
    format!("{}{body}\n{}\n", heading(table), wrapped(&table.note, 0))
}
