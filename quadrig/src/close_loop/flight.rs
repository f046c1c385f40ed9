//! `quadrig close-loop` and `quadrig predict` on a flight log.
//!
//! What it is: the loop of `ident::flight`, its verdict, model, predictions and report.
//! What can go wrong: refused input; a model of another kind; the folder's files appear whole or not at all.
//! Units: as the channels state.
//! Reference: specification `flight.md`, "The loop on flights".

use super::inertial::is_attitude_log;
use super::{Args, say_unwritten};
use crate::Failure;
use crate::folder::{Folder, tell_apart};
use crate::progress::Bar;
use crate::replace::put;
use crate::trouble::unread;
use ident::flight::columns::Flight;
use ident::flight::library::FlightLibrary;
use ident::flight::predict::{columns, is_by_row, is_own, over_windows, seen_by};
use ident::flight::{FlightModel, MODEL_FORMAT, close};
use ident::log::Log;
use ident::log::flight_log;
use ident::model::FittedTo;
use ident::report::flight::VOCABULARY;
use ident::report::flight::page;
use ident::report::{Origin, terminal};
use std::fmt::Write;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Whether a file begins as a flight log does.
pub(crate) fn is_flight_log(path: &Path) -> bool {
    begins_as(path, flight_log::FORMAT)
}

/// Whether a file begins as a log of a format does.
fn begins_as(path: &Path, format: &str) -> bool {
    let Ok(file) = std::fs::File::open(path) else { return false };
    let first = BufReader::new(file).lines().map_while(Result::ok).find(|l| !l.trim().is_empty());
    first.is_some_and(|l| l.trim_start_matches('#').trim() == format)
}

/// Runs the command.
pub(super) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let folder = args.output.as_deref().map(|path| Folder::new(path, "close-loop")).transpose()?;
    let mut log = flight_log::read(args.log())?;
    let model = args.model.as_deref().map(read_model).transpose()?;
    let mut others = args.validate.iter().map(|p| other_flight(p)).collect::<Result<Vec<_>, _>>()?;
    tell_apart(std::iter::once(&mut log).chain(&mut others), &args.runs());
    let closed = {
        let bar = Bar::new("searching", quiet);
        close(&log, model.as_ref(), &others, &mut |share| bar.set(share))?
    };
    let json = serde_json::to_string_pretty(&closed.verdict)?;
    if let Some(mut folder) = folder {
        let origin = Origin {
            model: args.model.as_ref().map(|m| m.display().to_string()),
            validated: others.iter().map(FittedTo::of).collect(),
            ..Origin::of(&log)
        };
        folder.add("verdict.json", format!("{json}\n"));
        folder.add("model.toml", closed.model.to_toml(&closed.parameters));
        folder.add("channels.csv", channels(&closed.flight));
        folder.add("report.html", page(&closed, origin));
        folder.write()?;
    }
    if args.json {
        say!("{json}");
    } else if !quiet {
        crate::say::text(&terminal(&closed.verdict, VOCABULARY, model.is_some()));
    }
    say_unwritten(args, quiet);
    Ok(())
}

/// A flight to validate on; a log of another kind is refused as what it is.
fn other_flight(path: &Path) -> Result<Log, Failure> {
    let kind = if is_attitude_log(path) {
        Some("an attitude log")
    } else if begins_as(path, ident::log::FORMAT) {
        Some("a rig log")
    } else {
        None
    };
    match kind {
        Some(kind) => Err(format!(
            "{}:1:1: {kind}, and the run is a flight; expected another flight of the same vehicle for --validate",
            path.display()
        )
        .into()),
        None => Ok(flight_log::read(path)?),
    }
}

fn read_model(path: &Path) -> Result<FlightModel, Failure> {
    crate::kind::refuse_no_model(path)?;
    let text = std::fs::read_to_string(path).map_err(unread(&path))?;
    Ok(FlightModel::parse(&path.display().to_string(), &text)?)
}

/// The text of a flight model, where `path` is one.
pub(crate) fn model_text(path: &Path) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let first = text.lines().find(|l| !l.trim().is_empty() && !l.starts_with('#'))?;
    (first.starts_with("format") && first.contains(MODEL_FORMAT)).then_some(text)
}

/// `quadrig predict` with a flight model.
pub(crate) fn predict(model: &Path, text: &str, path: &Path, output: &Path) -> Result<(), Failure> {
    let model = FlightModel::parse(&model.display().to_string(), text)?;
    let log = flight_log::read(path)?;
    let predicted = predictions(&model, &seen_by(&model, &log)?);
    put(output, &predicted)
}

/// One line a row of the log: speeds and voltage as logged, all else as the mean of its window; empty where there is no claim.
fn predictions(model: &FlightModel, flight: &Flight) -> String {
    let own = is_own(model, flight);
    let by_row = flight.by_row();
    let (names, values): (Vec<String>, Vec<Vec<f64>>) = [flight, &by_row]
        .into_iter()
        .flat_map(|view| {
            let library = FlightLibrary::new(view);
            let predicted = over_windows(view, &columns(model, &library, own));
            let rows = std::ptr::eq(view, &by_row);
            let kept = view.channels.targets.iter().zip(predicted).filter(move |(target, _)| is_by_row(**target) == rows);
            kept.map(|(target, values)| (target.name(), spread(view, &values))).collect::<Vec<_>>()
        })
        .unzip();
    csv(&flight.record.t, &names, &values)
}

/// The windows' values on their rows.
fn spread(flight: &Flight, values: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; flight.record.len()];
    for ((a, b), v) in flight.windows.bounds.iter().zip(values) {
        out[*a..*b].fill(*v);
    }
    out
}

/// What the channels were, through the stated filter: beside it anyone can recompute the figures from the predictions.
fn channels(flight: &Flight) -> String {
    let names: Vec<String> = flight.channels.channels.iter().map(|c| c.name.clone()).collect();
    let values: Vec<Vec<f64>> = flight.channels.channels.iter().map(|c| spread(flight, &c.y)).collect();
    csv(&flight.record.t, &names, &values)
}

fn csv(t: &[f64], names: &[String], values: &[Vec<f64>]) -> String {
    let mut out = format!("t_s,{}\n", names.join(","));
    for (row, at) in t.iter().enumerate() {
        let _ = write!(out, "{at}"); // a string takes everything
        for column in values {
            let _ = if column[row].is_finite() { write!(out, ",{:.9}", column[row]) } else { write!(out, ",") };
        }
        out.push('\n');
    }
    out
}
