//! `quadrig plateaus`.
//!
//! What it is: the binary shift algorithm on a log with each of its filters as columns and pictures, the threshold study, and scores
//! of both detectors against the levels that a recorded command marks.
//! What can go wrong: a log without the channel; without a command nobody knows the levels, and only counts are given.
//! Units: the channel's; samples.
//! Reference: specification `identification.md`, items 1 and 2; Beharie 2013, section 5.7.4.

use crate::Failure;
use crate::apart::Paths;
use crate::folder::Folder;
use crate::open::found;
use crate::trouble::unread;
use ident::log::import::import;
use ident::log::{FORMAT, Log, SPEED};
use ident::plateau::score::Score;
use ident::plateau::shift::{Filters, Form, Padding, Settings, filters};
use ident::plateau::so_many;
use ident::plateau::study::{Known, best, ours, threshold_study};
use ident::report::{filter_figures, study_figures};
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Runs: rig logs, or exports that `quadrig import` reads without help.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Channel that the filters look at; the first speed channel where none is named.
    #[arg(long)]
    channel: Option<String>,
    /// Which Filter 5.
    #[arg(long, default_value = "mended")]
    form: FormName,
    /// What a shifted copy holds beyond the ends of the run.
    #[arg(long, default_value = "zero")]
    padding: PaddingName,
    /// Threshold of Filter 2, in the channel's unit per sample; found by itself where not given.
    #[arg(long, value_parser = crate::number::positive(1e9, "the channel's unit per sample"))]
    threshold: Option<f64>,
    /// Offset of Filters 3 and 4, samples; found by itself where not given.
    #[arg(long, value_parser = crate::number::whole::<usize>(1, 1_000_000, "samples"))]
    offset: Option<usize>,
    /// Folder for the page with the scores, and each run's filters and threshold study as SVG.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Writes every filter as a column into RUN-filters.csv of the folder too.
    #[arg(long, requires = "output")]
    csv: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormName {
    Published,
    Mended,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum PaddingName {
    Zero,
    Edge,
}

const HEAD: &str = "\
# Plateau detectors on recorded runs

Written by `quadrig plateaus LOG... -o FOLDER`. The levels are those that each run's own command marks, held for 30 rows and more. A level lasts from the
row at which the speed answers a step to the row at which it answers the next. Its value is a line through the means of its
third and its fourth quarter without glitches, with its standard error. It is found where one stretch covers a third of its second
half and reaches into no other level.

*Ours, speed alone* and both binary shift forms do not see the command; *ours* does. The published form is given the threshold and the offset that score
best on the run, which only who knows the levels can choose. The mended one finds them by itself.

*Right*: found with a mean within three standard errors (of the mean and of the level's value together), speed / thrust. *Error*: root mean square over the
found levels, in per cent of the highest level.

";

const TABLE: &str = "\
| run | levels | detector | found | right | wrong | error, % |
| --- | --- | --- | --- | --- | --- | --- |
";

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads(&self.logs).fills("-o", &self.output)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let settings = Settings {
        form: if args.form == FormName::Published { Form::Published } else { Form::Mended },
        padding: if args.padding == PaddingName::Edge { Padding::Edge } else { Padding::Zero },
        threshold: args.threshold,
        offset: args.offset,
    };
    let mut folder = args
        .output
        .as_deref()
        .map(|path| Folder::new(path, "plateaus")) // what is not of a run like this is refused before it begins
        .transpose()?;
    let (mut page, mut pictures) = (format!("{HEAD}{TABLE}"), String::new());
    let mut headed = false;
    for path in &args.logs {
        let log = read(path, quiet)?;
        let channel = match &args.channel {
            Some(name) => name.as_str(),
            None => SPEED.into_iter().find(|c| log.column(c).is_some()).unwrap_or("thrust_n"),
        };
        let Some(values) = log.column(channel) else {
            let there: Vec<&str> = log.columns.iter().map(|c| c.name.as_str()).collect();
            return Err(format!("{}: no column {channel}; expected one of {}", path.display(), there.join(", ")).into());
        };
        if let Some(offset) = args.offset.filter(|offset| *offset >= values.len()) {
            let rows = values.len();
            return Err(format!("--offset {offset}: expected samples, fewer than the {rows} rows of {}", path.display()).into());
        }
        let shifted = filters(values, &settings);
        if !quiet {
            crate::say::text(&text(path, &log, channel, &shifted));
        }
        let rows = scores(path, &log, channel);
        page += &rows;
        if !quiet && !rows.is_empty() {
            crate::say::text(if headed { "" } else { TABLE });
            crate::say::text(&rows);
            headed = true;
        }
        if let Some(folder) = &mut folder {
            pictures += &draw(folder, path, &log, channel, &shifted, args.csv)?;
        }
    }
    if let Some(mut folder) = folder {
        folder.add("README.md", format!("{page}\n## Filters and threshold studies\n{pictures}"));
        folder.write()?;
    }
    Ok(())
}

/// A rig log as it is; anything else through the import.
fn read(path: &Path, quiet: bool) -> Result<Log, Failure> {
    let mut first = String::new();
    let file = std::fs::File::open(path).map_err(unread(&path))?;
    let _ = std::io::Read::take(BufReader::new(file), 64).read_line(&mut first); // what is no text the readers refuse
    if first.contains(FORMAT) {
        return Ok(Log::read(path)?);
    }
    let (log, report) = import(path, &[]).map_err(|why| crate::kind::another(path).map_or(why.into(), Failure::from))?;
    found(path, &report).iter().filter(|_| !quiet).for_each(|line| note!("{line}"));
    Ok(log)
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|n| n.to_string_lossy().replace('.', "_")).unwrap_or_default()
}

/// The stretches of the algorithm beside our plateaus.
fn text(path: &Path, log: &Log, channel: &str, f: &Filters) -> String {
    format!(
        "{}: {channel}: threshold {:.4}, offset {}: {} stretches; ours: {}\n",
        path.display(),
        f.threshold,
        f.offset,
        f.stretches().len(),
        so_many(ours(log, true).len())
    )
}

/// A table row for each detector; none without a recorded command.
fn scores(path: &Path, log: &Log, channel: &str) -> String {
    let (Some([known]), Some(values)) = (Known::from_command(log, [channel]), log.column(channel)) else {
        return String::new();
    };
    let thrust = Known::from_command(log, [channel, "thrust_n"])
        .map(|[_, thrust]| thrust)
        .zip(log.column("thrust_n"))
        .filter(|_| channel != "thrust_n");
    let study = threshold_study(values, &known, Form::Published);
    let Some(chosen) = best(&study) else { return String::new() };
    let published =
        Settings { form: Form::Published, threshold: Some(chosen.threshold), offset: Some(chosen.offset), ..Settings::default() };
    let shifted = |s: &Settings| filters(values, s).stretches();
    let detectors = [
        ("ours".to_owned(), ours(log, true), None),
        ("ours, speed alone".to_owned(), ours(log, false), None),
        (
            format!("published, threshold {:.1}, offset {}", chosen.threshold, chosen.offset),
            shifted(&published),
            Some(Form::Published),
        ),
        ("mended".to_owned(), shifted(&Settings::default()), Some(Form::Mended)),
    ];
    let mut out = String::new();
    for (name, ranges, form) in detectors {
        let own = known.score(values, &ranges, form);
        let other = thrust.as_ref().map(|(k, v)| (k.score(v, &ranges, form), k.top()));
        let pair = |of: &dyn Fn(&Score, f64) -> String| {
            let own = of(&own, known.top());
            other.as_ref().map_or(own.clone(), |(s, top)| format!("{own} / {}", of(s, *top)))
        };
        let _ = writeln!(
            out,
            "| {} | {} | {name} | {} | {} | {} | {} |",
            stem(path),
            own.truths,
            own.found,
            pair(&|s, _| s.within.to_string()),
            own.wrong,
            pair(&|s, top| if s.found > 0 { format!("{:.3}", 100.0 * s.rms() / top) } else { "-".to_owned() })
        );
    }
    out
}

/// Filters and the threshold study of the published form as pictures; what the page says of them.
fn draw(folder: &mut Folder, path: &Path, log: &Log, channel: &str, f: &Filters, csv: bool) -> Result<String, Failure> {
    let name = stem(path);
    if csv {
        let mut text = Vec::new();
        table(&mut text, log, channel, f)?;
        folder.add(format!("{name}-filters.csv"), text);
    }
    let mut figures = filter_figures(log, f, channel);
    figures.iter_mut().for_each(|figure| figure.id = format!("{name}-{}", figure.id));
    if let (Some([known]), Some(values)) = (Known::from_command(log, [channel]), log.column(channel)) {
        figures.extend(study_figures(&threshold_study(values, &known, Form::Published), channel, &name));
    }
    let mut out = format!("\n### {name}\n\n");
    for figure in &figures {
        let file = format!("{}.svg", figure.id);
        let _ = writeln!(out, "![{}]({file})", figure.title);
        folder.add(file, figure.file());
    }
    Ok(out)
}

fn table(out: &mut dyn Write, log: &Log, channel: &str, f: &Filters) -> std::io::Result<()> {
    writeln!(out, "t_s,{channel},filter1,filter2,filter3,filter4,filter5,filter6")?;
    let values = log.column(channel).unwrap_or_default();
    let bit = |v: &[bool], i: usize| v.get(i).map_or(String::new(), |b| u8::from(*b).to_string());
    for (i, t) in log.t.iter().enumerate() {
        let number = |v: Option<&f64>| v.filter(|v| v.is_finite()).map_or(String::new(), f64::to_string);
        let six = f.six.get(i).map_or(String::new(), i8::to_string);
        let logic = [bit(&f.two, i), bit(&f.three, i), bit(&f.four, i), bit(&f.five, i)].join(",");
        writeln!(out, "{t},{},{},{logic},{six}", number(values.get(i)), number(f.one.get(i)))?;
    }
    Ok(())
}
