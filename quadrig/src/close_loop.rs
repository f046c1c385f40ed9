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
use crate::open::{Columns, Names, open};
use crate::progress::Bar;
use ident::close::{Closed, close};
use ident::log::{Log, write_whole};
use ident::model::Model;
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
    /// Folder for model.toml, verdict.json and report.html (attitude logs: pred.csv as well; flights: channels.csv).
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
    let options = args.columns.options(&args.names);
    let log = open(args.log(), &options, quiet)?;
    let model = args.model.as_deref().map(Model::read).transpose()?;
    let others = args.validate.iter().map(|p| open(p, &options, quiet)).collect::<Result<Vec<_>, _>>()?;
    let closed = {
        let bar = Bar::new("searching", quiet);
        close(&log, model.as_ref(), &others, &mut |share| bar.set(share))?
    };
    if !quiet {
        closed.verdict.left_out.iter().for_each(|l| eprintln!("{}: {l}", args.log().display()));
    }
    let json = serde_json::to_string_pretty(&closed.verdict)?;
    if let Some(folder) = &args.output {
        let origin = Origin { model: args.model.as_ref().map(|m| m.display().to_string()), ..Origin::of(&log) };
        write_folder(folder, &log, &closed, &json, origin)?;
    }
    if args.json {
        println!("{json}");
    } else if !quiet {
        print!("{}", terminal(&closed.verdict, Vocabulary::RIG, model.is_some()));
    }
    Ok(())
}

/// Writes what the contract promises into a folder.
pub(crate) fn write_folder(folder: &Path, log: &Log, closed: &Closed, json: &str, origin: Origin) -> Result<(), Failure> {
    let say = |e: std::io::Error| format!("{}: {e}", folder.display());
    std::fs::create_dir_all(folder).map_err(say)?;
    write_whole(&folder.join("model.toml"), |out| out.write_all(closed.model.to_toml().as_bytes())).map_err(say)?;
    write_whole(&folder.join("verdict.json"), |out| writeln!(out, "{json}")).map_err(say)?;
    let page = closed_loop(log, closed, origin);
    write_whole(&folder.join("report.html"), |out| out.write_all(page.as_bytes())).map_err(say)?;
    Ok(())
}
