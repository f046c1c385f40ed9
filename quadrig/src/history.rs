//! `quadrig history`.
//!
//! What it is: the runs of one rig in one table: its constants run by run, and what changed between which runs.
//! What can go wrong: a file that is no run costs one line on stderr; too few runs, or runs of different rigs, are refused.
//! Units: as the table's heads state.
//! Reference: docs/book/how-to/history.md.

use crate::Failure;
use crate::apart::Paths;
use crate::folder::Folder;
use crate::open::{Columns, Names, may_be_a_run, no_run_in, opened};
use crate::progress::Bar;
use crate::trouble::unread;
use ident::history::{Change, Chart, Entry, History, Measure, in_doubt, named, summary};
use ident::log::Log;
use ident::report::{history_page, history_terminal};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// A folder of a rig's logs and exports (.csv, .tsv, .txt, .log), in the order of their names; or the runs themselves in their order. Where every run is dated, their days are their order.
    #[arg(required = true, value_name = "FOLDER|RUN")]
    runs: Vec<PathBuf>,
    /// Folder for report.html (control charts), history.csv (a row a run and measure) and history.json (what changed).
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// What changed on stdout and nothing else.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    names: Names,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads(&self.runs).fills("-o", &self.output)
    }
}

/// `history.json`.
#[derive(Serialize)]
struct Told<'h> {
    format: &'static str,
    summary: String,
    dated: bool,
    /// Why the runs are hardly of one rig.
    #[serde(skip_serializing_if = "Option::is_none")]
    in_doubt: Option<String>,
    runs: &'h [Entry],
    changes: &'h [Change],
    charts: Vec<Charted<'h>>,
}

/// A measure and its control chart.
#[derive(Serialize)]
struct Charted<'h> {
    #[serde(flatten)]
    measure: &'h Measure,
    #[serde(flatten)]
    chart: Chart,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let folder = args.output.as_deref().map(|path| Folder::new(path, "history")).transpose()?;
    let files = files(&args.runs)?;
    let (logs, refused, found) = read(&files, args, quiet);
    let (mut history, order) = {
        let bar = Bar::new("comparing", quiet);
        History::of(&logs, &|share| bar.set(share)).map_err(|why| format!("{why}{}", without(&refused)))?
    };
    found.iter().filter(|_| !quiet).for_each(|line| note!("{line}"));
    refused.iter().for_each(|line| note!("left out: {line}"));
    in_doubt(&history).iter().filter(|_| !quiet).for_each(|doubt| note!("warning: {doubt}"));
    let ordered: Vec<&Log> = order.iter().map(|k| &logs[*k]).collect();
    {
        let bar = Bar::new("naming", quiet);
        named(&mut history, &ordered, &|share| bar.set(share));
    }
    let json = serde_json::to_string_pretty(&told(&history))?;
    if let Some(mut folder) = folder {
        folder.add("history.csv", csv(&history)?);
        folder.add("history.json", format!("{json}\n"));
        folder.add("report.html", history_page(&history));
        folder.write()?;
    }
    if args.json {
        say!("{json}");
    } else if !quiet {
        crate::say::text(&history_terminal(&history));
    }
    Ok(())
}

/// The runs, a line for each file that is none, and what was found in the others.
fn read(files: &[PathBuf], args: &Args, quiet: bool) -> (Vec<Log>, Vec<String>, Vec<String>) {
    let options = args.columns.options(&args.names);
    let bar = Bar::new("reading", quiet);
    let (mut logs, mut refused, mut found) = (Vec::new(), Vec::new(), Vec::new());
    for (k, path) in files.iter().enumerate() {
        match opened(path, &options) {
            Ok((log, remarks)) => {
                logs.push(log);
                found.extend(remarks);
            }
            Err(e) => refused.push(e.to_string().replace('\n', " ")),
        }
        bar.set((k + 1) as f64 / files.len() as f64);
    }
    (logs, refused, found)
}

/// What a refusal says of the files that are none.
fn without(refused: &[String]) -> String {
    match refused {
        [] => String::new(),
        [only] => format!(" (left out: {only})"),
        [first, ..] => format!(" ({} files are left out; the first: {first})", refused.len()),
    }
}

/// The files, a folder's in the order of their names.
fn files(runs: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let of = |path: &PathBuf| match std::fs::metadata(path).map_err(unread(path))?.is_dir() {
        true => within(path),
        false => Ok(vec![path.clone()]),
    };
    Ok(runs.iter().map(of).collect::<Result<Vec<_>, _>>()?.concat())
}

fn within(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut out = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unread(folder))? {
        let file = entry.map_err(unread(folder))?.path();
        if file.is_file() && may_be_a_run(&file) {
            out.push(file);
        }
    }
    if out.is_empty() {
        return Err(no_run_in(folder));
    }
    out.sort();
    Ok(out)
}

fn told(history: &History) -> Told<'_> {
    let chart = |(k, measure)| Some(Charted { measure, chart: Chart::of(history, k)? });
    Told {
        format: "quadrig-history 1",
        summary: summary(history),
        dated: history.dated,
        in_doubt: in_doubt(history),
        runs: &history.runs,
        changes: &history.changes,
        charts: history.measures.iter().enumerate().filter_map(chart).collect(),
    }
}

/// A row a run and measure.
fn csv(history: &History) -> Result<Vec<u8>, Failure> {
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record(["run", "day", "measure", "unit", "value", "se", "low95", "high95"])?;
    for (k, run) in history.runs.iter().enumerate() {
        let day = if history.dated { history.label(k) } else { String::new() };
        for (measure, value) in history.measures.iter().zip(&run.values) {
            let Some(v) = value else { continue };
            let numbers = [v.value, v.se, v.value - v.half(), v.value + v.half()].map(|v| format!("{v:?}"));
            let mut row = vec![run.run.clone(), day.clone(), measure.name.clone(), measure.unit.clone()];
            row.extend(numbers);
            out.write_record(&row)?;
        }
    }
    Ok(out.into_inner().map_err(|e| e.to_string())?)
}
