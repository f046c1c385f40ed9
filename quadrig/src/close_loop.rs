//! `quadrig close-loop`.
//!
//! What it is: the verdict on a log, as a table or as JSON, and the folder with model, verdict and report. An attitude log, known by
//! its columns, gets the verdict on the inertial unit instead; a flight log the one on the vehicle.
//! What can go wrong: refused input; the folder's files appear whole or not at all.
//! Units: as the channels state.
//! Reference: specification `formats.md`.

pub(crate) mod flight;
pub(crate) mod inertial;
mod several;

use crate::Failure;
use crate::apart::Paths;
use crate::folder::{Folder, tell_apart};
use crate::open::{Columns, Names, open, read_model};
use crate::progress::Bar;
use ident::close::{Closed, close};
use ident::log::{Log, Named, named_alike};
use ident::model::{FittedTo, Model};
use ident::report::{Origin, Vocabulary, closed_loop, terminal};
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The run: a rig log, or a stand's or ESC's own export. Several are runs of one rig, each predicted by a fit to the others.
    #[arg(required = true, value_name = "RUN")]
    logs: Vec<PathBuf>,
    /// A declared model that stands as it is, instead of the thesis baseline.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Another run of the same rig, for the error before and after.
    #[arg(long)]
    validate: Vec<PathBuf>,
    /// Folder for model.toml (with model.discrepancy.toml beside it), verdict.json and report.html (attitude logs: pred.csv as well; flights: channels.csv). Without it
    /// nothing is written: the verdict is shown and gone.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// The verdict on stdout and nothing else.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    names: Names,
}

impl Args {
    /// The first run.
    fn log(&self) -> &Path {
        self.logs.first().map_or(Path::new(""), PathBuf::as_path)
    }

    /// Every run, those that take no part last.
    fn runs(&self) -> Vec<&Path> {
        self.logs.iter().chain(&self.validate).map(PathBuf::as_path).collect()
    }

    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads(&self.logs).reads(&self.model).reads(&self.validate).fills("-o", &self.output)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    if args.logs.len() > 1 {
        return several::run(args, quiet);
    }
    if inertial::is_attitude_log(args.log()) {
        return inertial::run(args, quiet);
    }
    if flight::is_flight_log(args.log()) {
        return flight::run(args, quiet);
    }
    let folder = args.output.as_deref().map(|path| Folder::new(path, "close-loop")).transpose()?;
    let options = args.columns.options(&args.names);
    let mut log = open(args.log(), &options, quiet)?;
    let model = args.model.as_deref().map(|path| read_model(path, quiet)).transpose()?;
    if let Some(same) = args.validate.iter().find(|p| p.canonicalize().ok() == args.log().canonicalize().ok()) {
        let what = "it is the log itself, whose figures validate nothing; expected another run of the rig";
        return Err(format!("--validate {}: {what}", same.display()).into());
    }
    let mut others = args.validate.iter().map(|p| open(p, &options, quiet)).collect::<Result<Vec<_>, _>>()?;
    tell_apart(std::iter::once(&mut log).chain(&mut others), &args.runs());
    let path = args.model.as_ref().map(|m| m.display().to_string()).unwrap_or_default();
    let declared = model.as_ref().map(|m| Named::by(&path, |key| m.meta.get(key)));
    of_one_rig(declared.into_iter().chain(std::iter::once(&log).chain(&others).map(Log::names)))?;
    let closed = {
        let bar = Bar::new("searching", quiet);
        close(&log, model.as_ref(), &others, &mut |share| bar.set(share))?
    };
    if !quiet {
        closed.verdict.left_out.iter().for_each(|l| note!("{}: {l}", args.log().display()));
    }
    let json = serde_json::to_string_pretty(&closed.verdict)?;
    if let Some(mut folder) = folder {
        let origin = Origin {
            model: args.model.as_ref().map(|m| m.display().to_string()),
            validated: others.iter().map(FittedTo::of).collect(),
            ..Origin::of(&log)
        };
        folder.extend(results(&log, &closed, origin)?);
        folder.write()?;
    }
    if args.json {
        say!("{json}");
    } else if !quiet {
        crate::say::text(&terminal(&closed.verdict, Vocabulary::RIG, model.is_some()));
    }
    say_unwritten(args, quiet);
    Ok(())
}

/// Refuses what is of several rigs: names and values of one would stand for the other.
fn of_one_rig<'a>(rigs: impl IntoIterator<Item = Named<'a>>) -> Result<(), Failure> {
    named_alike(rigs).map_err(|e| format!("{e}; expected one rig: where a head is wrong, --motor and --propeller name it").into())
}

/// Says that what was shown is not kept.
pub(super) fn say_unwritten(args: &Args, quiet: bool) {
    if args.output.is_none() && !args.json && !quiet {
        note!("nothing was written; with -o FOLDER model, verdict and page are kept");
    }
}

/// What the contract promises of a run.
pub(crate) fn results(log: &Log, closed: &Closed, origin: Origin) -> Result<Vec<(String, Vec<u8>)>, Failure> {
    let json = serde_json::to_string_pretty(&closed.verdict)?;
    let files = [("verdict.json", json + "\n"), ("report.html", closed_loop(log, closed, origin))];
    let files = files.map(|(name, text)| (name.to_owned(), text.into_bytes()));
    Ok(model_files(&closed.model).chain(files).collect())
}

/// A model's file, and the one beside it.
pub(crate) fn model_files(model: &Model) -> impl Iterator<Item = (String, Vec<u8>)> {
    let (text, beside) = model.files();
    let beside = beside.map(|text| ("model.discrepancy.toml", text));
    std::iter::once(("model.toml", text)).chain(beside).map(|(name, text)| (name.to_owned(), text.into_bytes()))
}
