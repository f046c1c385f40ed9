//! `quadrig identify`.
//!
//! What it is: plateaus, declared fits with standard errors, quality figures; writes `model.toml`.
//! What can go wrong: refused input; the model appears whole or not at all.
//! Units: as the channels state.
//! Reference: specification `identification.md`.

use crate::Failure;
use crate::apart::Paths;
use crate::folder::figures;
use crate::trouble::unwritten;
use ident::identify::{Identified, identify};
use ident::log::{Log, write_whole};
use ident::report::number;
use std::io::Write;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The run.
    log: PathBuf,
    /// Where the model goes.
    #[arg(short, long)]
    output: PathBuf,
    /// Writes the page with every figure of the run.
    #[arg(long, value_name = "PAGE")]
    report: Option<PathBuf>,
    /// Writes each figure as a file into this folder.
    #[arg(long, value_name = "FOLDER")]
    svg: Option<PathBuf>,
    /// A second run to lay beside it on the page.
    #[arg(long, value_name = "LOG")]
    beside: Option<PathBuf>,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default()
            .reads([&self.log])
            .reads(&self.beside)
            .writes("-o", [&self.output])
            .writes("--report", &self.report)
            .fills("--svg", &self.svg)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let log = Log::read(&args.log)?;
    let found = identify(&log)?;
    write_whole(&args.output, |out| out.write_all(found.model.to_toml().as_bytes())).map_err(unwritten(&args.output))?;
    if args.report.is_some() || args.svg.is_some() {
        draw(args, &log, &found)?;
    }
    if quiet {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    match write!(out, "{}{}", text(&found), told(&log)) {
        // a reader that has seen enough, such as `head`, is no failure
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}

/// The page and the figures.
fn draw(args: &Args, log: &Log, found: &Identified) -> Result<(), Failure> {
    let second = match &args.beside {
        Some(path) => {
            let log = Log::read(path)?;
            let found = identify(&log)?;
            Some((log, found))
        }
        None => None,
    };
    let sheet = ident::report::run(log, found, second.as_ref().map(|(log, found)| (log, found)));
    if let Some(path) = &args.report {
        write_whole(path, |out| out.write_all(sheet.html().as_bytes())).map_err(unwritten(&path))?;
    }
    if let Some(folder) = &args.svg {
        figures(folder, sheet.drawn())?;
    }
    Ok(())
}

fn text(found: &Identified) -> String {
    let mut out = format!("{} plateaus\n", found.plateaus.len());
    let columns: String = found.columns.iter().map(|c| format!("{c:>22}")).collect();
    out += &format!("{:>9} {:>9} {:>6} {:>8}  {columns}\n", "from s", "to s", "rows", "settle s");
    for p in &found.plateaus {
        let means: String = p
            .means
            .iter()
            .map(|m| m.map_or_else(|| format!("{:>22}", "-"), |(v, se)| format!("{v:>12.4} +- {se:>6.4}")))
            .collect();
        out += &format!("{:>9.2} {:>9.2} {:>6} {:>8.2}  {means}\n", p.from_s, p.to_s, p.rows, p.settling_s);
    }
    out += "\ndeclared relations over all rows\n";
    for p in &found.model.polynomials {
        out += &format!("{:<20} {}\n", p.channel, terms(p.coefficients.iter().copied().zip(p.errors.iter().copied())));
    }
    for q in &found.quality {
        out += &format!(
            "{:<20} rms {} {}, noise floor {}, R2 {:.6}\n",
            q.channel,
            number(q.rms),
            q.unit,
            number(q.noise_floor),
            q.r2
        );
    }
    if !found.curves.is_empty() {
        out += "\ncurves through the plateaus (95 % intervals)\n";
    }
    for f in &found.curves {
        let chosen = f.orders.iter().find(|o| o.chosen).map_or_else(String::new, |o| format!(", order by AICc {}", o.degree));
        let left_out =
            if f.curve.outliers.is_empty() { String::new() } else { format!(", left out: points {}", listed(&f.curve.outliers)) };
        let coefficients = (0..=f.degree).map(|k| f.curve.coefficient(k));
        out += &format!(
            "{:<14} {}; chi2 {:.2}{chosen}{left_out}\n",
            f.name,
            terms(coefficients.map(|c| (c.value, c.half))),
            f.curve.chi2
        );
    }
    if !found.constants.is_empty() {
        out += "\nconstants\n";
    }
    for c in &found.constants {
        out += &format!(
            "{:<9} {} +- {} {} (95 %: {} to {})\n",
            c.name,
            number(c.value),
            number(c.se),
            c.unit,
            number(c.value - c.half),
            number(c.value + c.half)
        );
    }
    out
}

/// Places with a comma between them, counted from 1.
fn listed(places: &[usize]) -> String {
    places.iter().map(|n| (n + 1).to_string()).collect::<Vec<_>>().join(", ")
}

/// What the board told of the run, where it told anything.
fn told(log: &Log) -> String {
    let lines = ident::board::told(log);
    if lines.is_empty() {
        return String::new();
    }
    lines.iter().fold("\ntold by the board\n".to_owned(), |out, line| out + line + "\n")
}

fn terms(pairs: impl Iterator<Item = (f64, f64)>) -> String {
    pairs.enumerate().map(|(k, (c, e))| format!("c{k} = {} +- {}", number(c), number(e))).collect::<Vec<_>>().join(", ")
}
