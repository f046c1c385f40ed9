//! `quadrig close-loop` on several runs of one rig.
//!
//! What it is: each run closed alone, then all in one fit; the folder holds the rig's model, verdict and page, and below `runs` those of each run.
//! What can go wrong: an attitude or flight log among them, a log twice, or a run that cannot be closed is refused by name.
//! Units: as the channels state.
//! Reference: specification `formats.md`, "Command line".

use super::{Args, flight, inertial, model_files, of_one_rig, results, say_unwritten};
use crate::Failure;
use crate::folder::{Folder, tell_apart};
use crate::open::open;
use crate::progress::Bar;
use ident::close::validation;
use ident::log::Log;
use ident::report::{Origin, Vocabulary, several, terminal};
use ident::several::{Outcome, Run, close_each, close_together};
use std::path::Path;

/// Runs the command.
pub(super) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    if let Some(path) = args.logs.iter().find(|p| inertial::is_attitude_log(p) || flight::is_flight_log(p)) {
        return Err(format!("{}: no log of a rig; expected several runs of one rig: give it alone", path.display()).into());
    }
    if let Some(model) = &args.model {
        return Err(
            format!("{}: --model with several logs; expected one log with --model, or several without", model.display()).into()
        );
    }
    let folder = args.output.as_deref().map(|path| Folder::new(path, "close-loop")).transpose()?;
    let options = args.columns.options(&args.names);
    let mut logs = args.logs.iter().map(|p| open(p, &options, quiet)).collect::<Result<Vec<_>, _>>()?;
    let mut others = args.validate.iter().map(|p| open(p, &options, quiet)).collect::<Result<Vec<_>, _>>()?;
    tell_apart(logs.iter_mut().chain(&mut others), &args.runs());
    of_one_rig(logs.iter().chain(&others).map(Log::names))?;
    let (runs, mut outcome) = {
        let bar = Bar::new("searching", quiet);
        let runs = close_each(logs, &|share| bar.set(0.7 * share))?;
        let outcome = close_together(&runs, &mut |share| bar.set(0.7 + 0.3 * share));
        (runs, outcome)
    };
    outcome.verdict.validation = others.iter().map(|other| validation(other, &outcome.declared, &outcome.model)).collect();
    let json = serde_json::to_string_pretty(&outcome.verdict)?;
    if let Some(mut folder) = folder {
        fill(&mut folder, &runs, &outcome, &json)?;
        folder.write()?;
    }
    if args.json {
        say!("{json}");
    } else if !quiet {
        crate::say::text(&terminal(&outcome.verdict, Vocabulary::RIG, false));
    }
    say_unwritten(args, quiet);
    Ok(())
}

/// The rig's files, and a folder for each run.
fn fill(folder: &mut Folder<'_>, runs: &[Run], outcome: &Outcome, json: &str) -> Result<(), Failure> {
    let names = names(runs);
    for (run, name) in runs.iter().zip(&names) {
        let files = results(&run.log, &run.closed, Origin::of(&run.log))?;
        folder.extend(files.into_iter().map(|(file, bytes)| (format!("runs/{name}/{file}"), bytes)));
    }
    let links: Vec<String> = names.iter().map(|name| format!("runs/{name}/report.html")).collect();
    folder.extend(model_files(&outcome.model));
    folder.add("verdict.json", format!("{json}\n"));
    folder.add("report.html", several(runs, outcome, &links));
    Ok(())
}

/// A folder's name for each run: its file's without the ending, numbered where two are alike.
fn names(runs: &[Run]) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for run in runs {
        let stem = Path::new(&run.log.name).file_stem().map_or_else(|| "run".to_owned(), |s| s.to_string_lossy().into_owned());
        let mut name = stem.clone();
        let mut n = 2;
        while out.contains(&name) {
            name = format!("{stem}-{n}");
            n += 1;
        }
        out.push(name);
    }
    out
}
