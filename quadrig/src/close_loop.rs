//! `quadrig close-loop`.
//!
//! What it is: the verdict on a log, as a table or as JSON, and the folder with model, verdict and report. An attitude log, known by
//! its columns, gets the verdict on the inertial unit instead; a flight log the one on the vehicle.
//! What can go wrong: refused input; the folder's files appear whole or not at all.
//! Units: as the channels state.
//! Reference: specification `formats.md`.

pub(crate) mod flight;
pub(crate) mod inertial;

use crate::Failure;
use crate::progress::Bar;
use ident::close::{Closed, close};
use ident::log::{Log, write_whole};
use ident::model::Model;
use ident::report::number;
use ident::verdict::{Kind, Verdict};
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The run.
    log: PathBuf,
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
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    if inertial::is_attitude_log(&args.log) {
        return inertial::run(args, quiet);
    }
    if flight::is_flight_log(&args.log) {
        return flight::run(args, quiet);
    }
    let log = Log::read(&args.log)?;
    let model = args.model.as_deref().map(Model::read).transpose()?;
    let others = args.validate.iter().map(|p| Log::read(p)).collect::<Result<Vec<_>, _>>()?;
    let closed = {
        let bar = Bar::new("searching", quiet);
        close(&log, model.as_ref(), &others, &mut |share| bar.set(share))?
    };
    if !quiet {
        closed.verdict.left_out.iter().for_each(|l| eprintln!("{}: {l}", args.log.display()));
    }
    let json = serde_json::to_string_pretty(&closed.verdict)?;
    if let Some(folder) = &args.output {
        write_folder(folder, &log, &closed, &json)?;
    }
    if args.json {
        println!("{json}");
    } else if !quiet {
        print!("{}", table(&closed.verdict));
    }
    Ok(())
}

/// Writes what the contract promises into a folder.
pub(crate) fn write_folder(folder: &Path, log: &Log, closed: &Closed, json: &str) -> Result<(), Failure> {
    let say = |e: std::io::Error| format!("{}: {e}", folder.display());
    std::fs::create_dir_all(folder).map_err(say)?;
    write_whole(&folder.join("model.toml"), |out| out.write_all(closed.model.to_toml().as_bytes())).map_err(say)?;
    write_whole(&folder.join("verdict.json"), |out| writeln!(out, "{json}")).map_err(say)?;
    let page = ident::report::closed_loop(log, closed);
    write_whole(&folder.join("report.html"), |out| out.write_all(page.as_bytes())).map_err(say)?;
    Ok(())
}

/// The verdict as a person reads it.
pub(crate) fn table(verdict: &Verdict) -> String {
    let mut out = format!("{}: {}\n\n", verdict.run, sentence(verdict));
    out += &format!("{:<12} {:>11} {:>11} {:>11} {:>7}  unit\n", "held-out", "noise floor", "before", "after", "factor");
    for (name, c) in &verdict.channels {
        let (b, a) = (c.before.heldout_rms, c.after.heldout_rms);
        out += &format!("{name:<12} {:>11.5} {b:>11.5} {a:>11.5} {:>7.2}  {}\n", c.noise_floor_rms, b / a.max(1e-300), c.unit);
    }
    for left_out in &verdict.left_out {
        out += &format!("{left_out}\n");
    }
    for e in &verdict.effects {
        out += &format!("\n{} (p = {:.2}) on {}\n  {}\n", e.id, e.probability, e.channels.join(", "), e.equation);
        for p in &e.parameters {
            out += &format!(
                "  {} = {} {}  (95 %: {} to {})\n",
                p.name,
                number(p.value),
                p.unit,
                number(p.ci95[0]),
                number(p.ci95[1])
            );
        }
        out += &format!("  evidence: {}\n", e.evidence);
    }
    out += &unexplained(verdict);
    out += &set_aside(verdict);
    if !verdict.alternatives.is_empty() {
        let list: Vec<String> =
            verdict.alternatives.iter().map(|a| format!("{} ({:.3})", a.ids.join(" + "), a.probability)).collect();
        out += &format!("\nalternatives: {}\n", list.join(", "));
    }
    if let Some(next) = &verdict.next_experiment {
        out += &format!(
            "\nnext experiment: {}\n  {}\n",
            next.why,
            next.schedule.iter().map(|s| format!("{} us x {} s", s.pulse_us, s.hold_s)).collect::<Vec<_>>().join(", ")
        );
    }
    for v in &verdict.validation {
        out += &format!("\non {}:\n", v.run);
        for (name, b) in &v.channels {
            out += &format!("  {name:<12} before {:>11.5}  after {:>11.5}\n", b.before, b.after);
        }
    }
    out
}

/// What is left beside the names, channel by channel.
fn unexplained(verdict: &Verdict) -> String {
    let mut out = String::new();
    for u in &verdict.unexplained {
        let on = if u.depends_on.is_empty() { String::new() } else { format!(", goes with {}", u.depends_on.join(", ")) };
        out += &format!("\nleft on {}: {:.1} noise floors, {}{on}", u.channel, u.over_floor, u.looks_like);
    }
    for (channel, reason) in &verdict.channels.not_predicted {
        out += &format!("\nnot predicted: {channel}, {reason}");
    }
    if out.is_empty() { out } else { out + "\n" }
}

/// Most lines about samples that were set aside; the verdict's file has them all.
const ASIDE: usize = 5;

/// The samples that took no part.
fn set_aside(verdict: &Verdict) -> String {
    let all = &verdict.set_aside;
    let mut out: String = all.iter().take(ASIDE).map(|aside| format!("\n{aside}")).collect();
    if all.len() > ASIDE {
        out += &format!("\nand {} more stretches like these, listed in verdict.json and in the report", all.len() - ASIDE);
    }
    if out.is_empty() { out } else { out + "\n" }
}

fn sentence(verdict: &Verdict) -> String {
    let ids: Vec<&str> = verdict.effects.iter().map(|e| e.id.as_str()).filter(|id| *id != "unknown").collect();
    match verdict.verdict {
        Kind::Attributed => format!("the model lacks {}", ids.join(" and ")),
        Kind::Ambiguous => format!("the model lacks {}, or something that looks the same on this run", ids.join(" and ")),
        Kind::Unattributed => "something is left over that no known effect explains".to_owned(),
        Kind::None => "nothing significant is left over".to_owned(),
    }
}
