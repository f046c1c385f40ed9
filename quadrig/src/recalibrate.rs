//! `quadrig recalibrate`: an old log's raw codes with a better calibration.
//!
//! What it is: the readings of a log that was recorded with `--raw`, made anew from the codes: with the scales of a calibration
//! (`quadrig calibrate`), or with everything that a rig's configuration says of scales and marks. A tare stays what it was, in counts.
//! What can go wrong: a log without codes, or without the scale that it was recorded with, is refused; so is a file that changes nothing.
//! Units: as in the log.
//! Reference: specification `formats.md`, "Rig log" ("so that a better calibration can be replayed").

use crate::Failure;
use crate::apart::Paths;
use crate::kind::refuse_other;
use crate::replace::put_log;
use crate::rig::{date, file};
use firmware_rig::Config;
use firmware_rig::rig_config::Calibrated;
use frame::calibration::AdcScale;
use frame::rig::{ADC_CHANNELS, ADC_NAMES, CAPTURE_CHANNELS, CAPTURE_NAMES};
use ident::log::Log;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Counts by which a zero in force differs from the untared one where a tare was taken.
const TARED: f64 = 0.01;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The log, recorded with --raw.
    log: PathBuf,
    /// The better calibration: a file of `quadrig calibrate`, or a rig's configuration.
    #[arg(long, value_name = "FILE")]
    with: PathBuf,
    /// Where the log with the new readings goes.
    #[arg(short, long)]
    output: PathBuf,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.log, &self.with]).writes("-o", [&self.output])
    }
}

/// A new scale, and how it was found, where it was.
#[derive(Debug, Clone, Copy)]
struct Better {
    scale: AdcScale,
    found: Option<Calibrated>,
}

/// What a file says anew.
#[derive(Debug, Clone, Copy)]
struct News {
    scales: [Option<Better>; ADC_CHANNELS],
    marks: [u16; CAPTURE_CHANNELS],
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut log = Log::read(&args.log)?;
    let news = read(&args.with)?;
    let changed = apply(&mut log, &news).map_err(|e| format!("{}: {e}", args.log.display()))?;
    if changed.is_empty() {
        return Err(format!(
            "{}: says nothing new of the channels of {}; expected another scale for one of them",
            args.with.display(),
            args.log.display()
        )
        .into());
    }
    let words = format!("{} with {}", args.log.display(), args.with.display());
    log.meta.insert("recalibrated".to_owned(), Value::String(words));
    put_log(&args.output, &log)?;
    if !quiet {
        changed.iter().for_each(|line| say!("{line}"));
    }
    Ok(())
}

/// A calibration's scales; of a whole configuration everything.
fn read(path: &Path) -> Result<News, Failure> {
    refuse_other(path, "a file of `quadrig calibrate`, or a rig's configuration: docs/configuration.md lists the keys")?;
    if file::is_scales_alone(path) {
        let better = |found: Calibrated| Better { scale: found.scale, found: Some(found) };
        return Ok(News { scales: file::scales(path)?.map(|found| found.map(better)), marks: [0; CAPTURE_CHANNELS] });
    }
    let (config, _) = file::read(path)?;
    let whole = config.apply(&Config::thesis_570kv()).calibration();
    let scale = |n: usize| config.fitted[n].then(|| Better { scale: whole.adc[n], found: config.calibrated[n] });
    Ok(News { scales: std::array::from_fn(scale), marks: config.marks })
}

/// Makes the readings anew; a line for each channel that changed.
fn apply(log: &mut Log, news: &News) -> Result<Vec<String>, String> {
    let mut changed = Vec::new();
    for (channel, better) in news.scales.iter().enumerate() {
        if let Some(better) = better.as_ref().filter(|_| log.column(ADC_NAMES[channel]).is_some()) {
            changed.extend(rescaled(log, channel, better)?);
        }
    }
    for (channel, marks) in news.marks.iter().enumerate().filter(|(_, marks)| **marks > 0) {
        if log.column(CAPTURE_NAMES[channel]).is_some() {
            changed.extend(remarked(log, channel, *marks)?);
        }
    }
    Ok(changed)
}

fn number(table: &Table, key: &str) -> Option<f64> {
    table.get(key).and_then(|v| v.as_float().or_else(|| v.as_integer().map(|n| n as f64)))
}

fn column<'l>(log: &'l mut Log, name: &str) -> Option<&'l mut Vec<f64>> {
    log.columns.iter_mut().find(|c| c.name == name).map(|c| &mut c.values)
}

fn raw(log: &Log, name: &str, what: &str) -> Result<Vec<f64>, String> {
    let column = format!("raw_{name}_{what}");
    log.column(&column)
        .map(<[f64]>::to_vec)
        .ok_or_else(|| format!("no column {column}; expected a log that was recorded with --raw"))
}

/// One analogue channel with another scale; `None` when it is the same.
fn rescaled(log: &mut Log, channel: usize, better: &Better) -> Result<Option<String>, String> {
    let name = ADC_NAMES[channel];
    let key = format!("calibration_{name}");
    let old = log.meta.get(&key).and_then(Value::as_table).cloned();
    let scale = old.as_ref().and_then(|t| Some((number(t, "zero_counts")?, number(t, "per_count")?)));
    let (Some(mut head), Some((zero, gain))) = (old, scale) else {
        return Err(format!(
            "its head has no {key}; expected the scale that {name} was recorded with: a log of `quadrig log` or `sim`"
        ));
    };
    let untared = number(&head, "untared_zero_counts").unwrap_or(zero);
    let (new_zero, new_gain) = (f64::from(better.scale.zero), f64::from(better.scale.gain));
    if near(new_gain, gain) && near(new_zero, untared) {
        return Ok(None);
    }
    let (sum, count) = (raw(log, name, "sum")?, raw(log, name, "count")?);
    let values = column(log, name).ok_or("no such column")?;
    for ((value, sum), count) in values.iter_mut().zip(sum).zip(count).filter(|((value, _), _)| value.is_finite()) {
        let mean = sum / count;
        let in_force = mean - *value / gain; // what was tared in mid-run shows here
        let zero = if (in_force - untared).abs() < TARED + 1e-5 / gain.abs() { new_zero } else { in_force };
        *value = (mean - zero) * new_gain;
    }
    if channel == 0
        && let Some(rms) = column(log, "thrust_rms_n")
    {
        rms.iter_mut().for_each(|v| *v *= (new_gain / gain).abs());
    }
    let tared = (zero - untared).abs() >= TARED;
    head.insert("zero_counts".to_owned(), Value::Float(if tared { zero } else { new_zero }));
    head.insert("untared_zero_counts".to_owned(), Value::Float(new_zero));
    head.insert("per_count".to_owned(), Value::Float(new_gain));
    crate::evidence::how_found(&mut head, better.found.as_ref());
    log.meta.insert(key, Value::Table(head));
    let day = better.found.filter(|f| f.day > 0).map_or_else(String::new, |f| format!(", {}", date::text(f.day)));
    Ok(Some(format!("{name}: {gain} a count became {new_gain}{day}{}", if tared { "; the tare stays" } else { "" })))
}

/// The same number, as far as single precision tells.
fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * a.abs().max(b.abs())
}

/// One speed sensor with another number of marks; `None` when it is the same.
fn remarked(log: &mut Log, channel: usize, marks: u16) -> Result<Option<String>, String> {
    let name = CAPTURE_NAMES[channel];
    let key = format!("calibration_{name}");
    let before = log.meta.get(&key).and_then(|t| t.get("marks")).and_then(Value::as_integer);
    let before = before.ok_or_else(|| {
        format!("its head has no {key}; expected the marks that {name} was recorded with: a log of `quadrig log` or `sim`")
    })?;
    if before == i64::from(marks) {
        return Ok(None);
    }
    let timer_hz = log
        .meta
        .get("timer_hz")
        .and_then(Value::as_integer)
        .ok_or("its head has no timer_hz; expected a log of `quadrig log` or `sim`")? as f64;
    let (edges, span) = (raw(log, name, "edges")?, raw(log, name, "span")?);
    let values = column(log, name).ok_or("no such column")?;
    for ((value, edges), span) in values.iter_mut().zip(edges).zip(span).filter(|((value, _), _)| **value > 0.0) {
        *value = 60.0 * edges / f64::from(marks) * timer_hz / span;
    }
    log.meta.insert(key, Value::Table(Table::from_iter([("marks".to_owned(), Value::Integer(marks.into()))])));
    Ok(Some(format!("{name}: {before} marks a revolution became {marks}")))
}
