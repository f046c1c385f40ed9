//! `quadrig identify`.
//!
//! What it is: plateaus, declared fits with standard errors, quality figures; writes `model.toml`.
//! What can go wrong: refused input; the model appears whole or not at all, and last: where another output cannot be written it is not there,
//! and the line tells what is.
//! Units: as the channels state.
//! Reference: specification `identification.md`.

use crate::Failure;
use crate::apart::Paths;
use crate::folder::{Folder, figures};
use crate::open::{Columns, Names, open};
use crate::replace::put;
use ident::channel::{DIFFERENCES, unit_of};
use ident::identify::curves::power::{csv, in_doubt};
use ident::identify::curves::ratio;
use ident::identify::{Identified, identify, identify_in};
use ident::log::Log;
use ident::numeric::digits::number;
use ident::plateau::so_many;
use ident::report::{Sheet, WIDEST, headline, when, wrapped};
use ident::verdict::words::{bracketed, channel, to_error};
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The run: a rig log, or a stand's or ESC's own export.
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
    /// Writes the plateaus with power, efficiencies and coefficients, each with its standard error (CSV; SI units in the names).
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Writes thrust over throttle and supply voltage with its 95 % band (CSV: us, %, V, N).
    #[arg(long, value_name = "FILE")]
    surface: Option<PathBuf>,
    /// Density of the air, kg/m^3, where the log does not tell it.
    #[arg(long, value_name = "KG_M3", value_parser = crate::number::from(0.1, 10.0, "a density in kg/m^3"))]
    air: Option<f64>,
    /// A second run to lay beside it on the page.
    #[arg(long, value_name = "LOG")]
    beside: Option<PathBuf>,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    names: Names,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default()
            .reads([&self.log])
            .reads(&self.beside)
            .writes("-o", [&self.output])
            .writes("--report", &self.report)
            .writes("--table", &self.table)
            .writes("--surface", &self.surface)
            .fills("--svg", &self.svg)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    if args.beside.is_some() && args.report.is_none() && args.svg.is_none() {
        return Err("--beside: nothing is drawn that it could stand on; expected --report or --svg with it".into());
    }
    let svg = args.svg.as_deref().map(|path| Folder::new(path, "identify --svg")).transpose()?;
    let log = open(&args.log, &args.columns.options(&args.names), quiet)?;
    let found = identify_in(&log, args.air)?;
    let sheet = (args.report.is_some() || args.svg.is_some()).then(|| draw(args, &log, &found, quiet)).transpose()?;
    let surface = args.surface.as_ref().zip(found.surface.as_ref().ok()).map(|(path, surface)| (path, surface.csv()));
    let table = args.table.as_ref().map(|path| (path, csv(&found.plateaus, &found.levels)));
    let page = args.report.as_ref().zip(sheet.as_ref()).map(|(path, sheet)| (path, sheet.html()));
    let model = (&args.output, found.model.files().0);
    let mut written = Vec::new();
    if let Some((folder, sheet)) = svg.zip(sheet.as_ref()) {
        figures(folder, sheet.drawn())?;
        written.extend(&args.svg);
    }
    for (path, text) in table.into_iter().chain(surface).chain(page).chain([model]) {
        put(path, &text).map_err(|why| format!("{why}{}", there(&written)))?;
        written.push(path);
    }
    if !quiet {
        crate::say::text(&(text(&log, &found) + &told(&log)));
    }
    match (&args.surface, &found.surface) {
        (Some(path), Err(why)) => {
            let expected = "expected a log that tells it; everything else is written";
            Err(format!("{}: --surface: {why}, so that {} is not there; {expected}", args.log.display(), path.display()).into())
        }
        _ => Ok(()),
    }
}

/// What is written already when something else cannot be.
fn there(written: &[&PathBuf]) -> String {
    let names: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    if names.is_empty() { String::new() } else { format!("; written already: {}", names.join(", ")) }
}

/// The page and the figures.
fn draw(args: &Args, log: &Log, found: &Identified, quiet: bool) -> Result<Sheet, Failure> {
    let second = match &args.beside {
        Some(path) => {
            let log = open(path, &args.columns.options(&args.names), quiet)?;
            let found = identify(&log)?;
            Some((log, found))
        }
        None => None,
    };
    Ok(ident::report::run(log, found, second.as_ref().map(|(log, found)| (log, found))))
}

/// The head of a row: a channel, or of what a speed sensor reads beyond the others that sensor's own word.
fn row_of(name: &str) -> String {
    let own = DIFFERENCES.iter().find(|(_, difference)| *difference == name).map(|(own, _)| channel(own));
    match own.as_deref().and_then(|said| said.strip_prefix("speed (")?.strip_suffix(')')) {
        Some(sensor) => format!("{sensor} - other speeds"),
        None => channel(name),
    }
}

fn text(log: &Log, found: &Identified) -> String {
    let mut out = format!("{}\n\n", wrapped(&headline(found), 0)) + &levels(log, found);
    out += "\ndeclared relations over all rows (of the speed in 1000 rev/min; of the pulse above 1000 us in ms)\n";
    for p in &found.model.polynomials {
        let all = terms(p.coefficients.iter().copied().zip(p.errors.iter().map(|se| 1.96 * se)));
        out += &format!("{:<20} {}\n", row_of(&p.channel), wrapped(&all, 21));
    }
    for q in &found.quality {
        out += &format!(
            "{:<20} rms {} {}, noise floor {}, R2 {:.6}\n",
            row_of(q.channel),
            number(q.rms),
            q.unit,
            number(q.noise_floor),
            q.r2
        );
    }
    if !found.curves.is_empty() {
        out += "\ncurves through the plateaus as read (95 % intervals)\n";
    }
    for f in &found.curves {
        let chosen = f.orders.iter().find(|o| o.chosen).map_or_else(String::new, |o| format!(", order by AICc {}", o.degree));
        let left_out =
            if f.curve.outliers.is_empty() { String::new() } else { format!(", left out: points {}", listed(&f.curve.outliers)) };
        let coefficients = (0..=f.degree).map(|k| f.curve.coefficient(k));
        out += &format!(
            "{:<26} {}\n",
            format!("{} over {}", channel(&f.y), channel(f.x)),
            wrapped(
                &format!(
                    "{}; chi2/dof {}{chosen}{left_out}",
                    terms(coefficients.map(|c| (c.value, c.half))),
                    ratio(f.curve.chi2)
                ),
                27
            )
        );
    }
    if !found.constants.is_empty() {
        out += "\nconstants\n";
    }
    for c in &found.constants {
        let [value, se, low, high] = to_error([c.value, c.se, c.value - c.half, c.value + c.half], c.se);
        out += &format!("{:<9} {value} +- {se} {} (95 %: {low} to {high})\n", c.name, c.unit);
        if let Some(law) = c.law {
            out += &format!("{:<9} {}\n", "", wrapped(&law.words(), 10));
        }
    }
    out + &asked(found)
}

/// Least width of a column of the plateaus' table beside its own.
const LEAST: usize = 14;

/// The plateaus, a few channels at a time; channels without a reading are left out.
fn levels(log: &Log, found: &Identified) -> String {
    let ([from, to, _], places) = when(log);
    let settle = if log.time_is_row() { "settle" } else { "settle s" };
    let [from, to] = [from, to].map(|title| title.replace(',', ""));
    let mut out = format!(
        "{} as read (in brackets: half of the 95 % interval, in units of the last digit)\n{:>3}{from:>9}{to:>9}{:>7}{settle:>10}\n",
        so_many(found.plateaus.len()),
        "",
        "rows"
    );
    for (n, p) in found.plateaus.iter().enumerate() {
        let [from, to, settles] = [p.from_s, p.to_s, p.settling_s].map(|v| format!("{v:.places$}"));
        out += &format!("{:>3}{from:>9}{to:>9}{:>7}{settles:>10}\n", n + 1, p.rows);
    }
    let read = |k: &usize| found.plateaus.iter().any(|p| p.means[*k].is_some());
    let columns: Vec<usize> = (0..found.columns.len()).filter(read).collect();
    // as wide as the longest name asks for, as many as fit
    let width = columns.iter().map(|k| channel(&found.columns[*k]).chars().count() + 1).fold(LEAST, usize::max);
    let most = ((WIDEST - 3) / width).max(1);
    for block in columns.chunks(most) {
        let head = |word: &dyn Fn(&str) -> String| {
            block.iter().map(|k| format!("{:>width$}", word(&found.columns[*k]))).collect::<String>()
        };
        let (names, units) = (head(&channel), head(&|name| unit_of(name).to_owned()));
        out += &format!("\n{:>3}{names}\n{:>3}{units}\n", "", "");
        for (n, p) in found.plateaus.iter().enumerate() {
            let cell = |k: &usize| match p.means[*k] {
                Some((v, 0.0)) => format!("{v}"), // a command has no error
                Some((v, se)) => bracketed(v, 1.96 * se).unwrap_or_else(|| number(v)),
                None => "-".to_owned(),
            };
            let cells: String = block.iter().map(|k| format!("{:>width$}", cell(k))).collect();
            out += &format!("{:>3}{cells}\n", n + 1);
        }
    }
    out
}

/// What a designer asks of each plateau, in 100 columns.
fn asked(found: &Identified) -> String {
    const SHOWN: [(&str, &str, usize); 9] = [
        ("pulse_us", "us", 0),
        ("thrust_n", "N", 3),
        ("electrical_w", "W in", 1),
        ("shaft_w", "W shaft", 1),
        ("g_per_w", "g/W", 2),
        ("motor_efficiency", "motor", 3),
        ("figure_of_merit", "merit", 3),
        ("c_t", "C_T", 4),
        ("c_p", "C_P", 4),
    ];
    if found.levels.is_empty() {
        return String::new();
    }
    let mut out = String::from("\npower, efficiency, coefficients (\"motor\" with its controller; - is not known)\n");
    out += &SHOWN.map(|(_, head, _)| format!("{head:>9}")).concat();
    for level in &found.levels {
        let cell = |(name, _, digits): (&str, &str, usize)| {
            level.of(name).map_or_else(|| format!("{:>9}", "-"), |(v, _)| format!("{v:>9.digits$}"))
        };
        out += &format!("\n{}", SHOWN.map(cell).concat());
    }
    out.push('\n');
    let zero = found.zero_words();
    if !zero.is_empty() {
        out += &format!("{}\n", wrapped(&zero, 2));
    }
    in_doubt(&found.levels).iter().for_each(|line| out += &format!("{}\n", wrapped(line, 2)));
    found.disc.lacks().iter().for_each(|lack| out += &format!("{}\n", wrapped(lack, 2)));
    match &found.surface {
        Ok(s) => {
            out + &format!(
                "thrust over throttle and voltage: --surface FILE; measured {:.2} to {:.2} V\n",
                s.measured.0, s.measured.1
            )
        }
        Err(why) => out + &format!("{}\n", wrapped(&format!("thrust over throttle and voltage: {why}"), 2)),
    }
}

/// Places with a comma between them, counted from 1.
fn listed(places: &[usize]) -> String {
    places.iter().map(|n| (n + 1).to_string()).collect::<Vec<_>>().join(", ")
}

/// What the board told of the run, where it told anything.
fn told(log: &Log) -> String {
    let lines = ident::log::board::told(log);
    if lines.is_empty() {
        return String::new();
    }
    lines.iter().fold("\ntold by the board\n".to_owned(), |out, line| out + line + "\n")
}

/// Coefficients, each with half of its 95 % interval in brackets.
fn terms(pairs: impl Iterator<Item = (f64, f64)>) -> String {
    pairs
        .enumerate()
        .map(|(k, (c, e))| format!("c{k} = {}", bracketed(c, e).unwrap_or_else(|| number(c))))
        .collect::<Vec<_>>()
        .join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    /// A staircase of five levels.
    fn staircase(head: &str, step: f64) -> Log {
        let mut csv = format!("# quadrig-log 1\n{head}t_s,pulse_us,rpm,thrust_n\n");
        for i in 0..600 {
            let wave = f64::from(i * i % 97) / 97.0;
            let (pulse, rpm) = (1200 + 100 * (i / 120), 1400.0 + 700.0 * f64::from(i / 120) + 4.0 * wave);
            let _ = writeln!(csv, "{},{pulse},{rpm},{}", step * f64::from(i), 1e-7 * rpm * rpm + 0.01 * wave);
        }
        Log::parse("run.csv", csv.as_bytes()).expect("a log")
    }

    /// Rows without a time are told as rows.
    #[test]
    fn plateaus_of_a_log_without_a_time_are_told_in_rows() {
        let told = |log: &Log| text(log, &identify(log).expect("levels"));
        let (timed, rows) = (told(&staircase("", 0.1)), told(&staircase("# time = \"row\"\n", 1.0)));
        assert!(timed.contains("   from s     to s   rows  settle s\n"), "{timed}");
        assert!(rows.contains(" from row   to row   rows    settle\n") && rows.contains("      119    120 "), "{rows}");
        assert!(!rows.contains(" s\n") && !rows.contains(" s "), "{rows}");
    }
}
