//! `quadrig close-loop` on an attitude log.
//!
//! What it is: runs the board's filter over gyro and accelerometer (not over the field, which is to be predicted), hands its attitude
//! to `ident::inertial`, and writes verdict, predictions and report.
//! What can go wrong: refused input; `--model` and `--validate`, which are the rig's; the folder's files appear whole or not at all.
//! Units: rad/s, m/s^2, uT.
//! Reference: specification `formats.md`, "Attitude log" and "Verdict".

use super::{Args, say_unwritten};
use crate::Failure;
use crate::ahrs::imu_log::{ImuLog, Row};
use crate::folder::Folder;
use crate::kind::{columns, has_readings};
use crate::progress::Bar;
use crate::replace::put;
use dcm::{Config, Dcm, Measurement, Vec3};
use ident::inertial::{Attitude, InertialModel, MODEL_FORMAT, Predicted, Recording, Sensor, close};
use ident::report::inertial::VOCABULARY;
use ident::report::inertial::page;
use ident::report::{Origin, terminal};
use nalgebra::{Matrix3, Vector3};
use std::fmt::Write;
use std::path::Path;

/// Whether the first line that is no comment names a gyro's three axes.
pub(crate) fn is_attitude_log(path: &Path) -> bool {
    has_readings(&columns(path))
}

/// Runs the command.
pub(super) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    if args.model.is_some() || !args.validate.is_empty() {
        return Err(format!("{}: an attitude log; expected a rig log with --model and --validate", args.log().display()).into());
    }
    let folder = args.output.as_deref().map(|path| Folder::new(path, "close-loop")).transpose()?;
    let log = ImuLog::read(args.log())?;
    let recording = recording(&log, args.log());
    let closed = {
        let bar = Bar::new("searching", quiet);
        close(&recording, &|rates| attitude(&log, rates), &mut |share| bar.set(share))?
    };
    let json = serde_json::to_string_pretty(&closed.verdict)?;
    if let Some(mut folder) = folder {
        folder.add("verdict.json", format!("{json}\n"));
        folder.add("model.toml", closed.model.to_toml());
        type Rows = fn(&Sensor) -> &Vec<Vector3<f64>>;
        let files: [(&str, Rows); 2] = [("declared.csv", |s| &s.declared), ("pred.csv", |s| &s.corrected)];
        for (name, rows) in files {
            let of = |s: &Sensor| Predicted { channels: s.channels.map(str::to_owned).to_vec(), rows: rows(s).clone() };
            let predicted: Vec<Predicted> = closed.sensors.iter().map(of).collect();
            folder.add(name, predictions(&log, &predicted));
        }
        let seconds = recording.t.first().zip(recording.t.last()).map(|(a, b)| b - a);
        let origin = Origin::of_text(&recording.name, log.text(), recording.t.len(), seconds);
        folder.add("report.html", page(&recording, &closed, origin));
        folder.write()?;
    }
    if args.json {
        say!("{json}");
    } else if !quiet {
        crate::say::text(&terminal(&closed.verdict, VOCABULARY, false));
    }
    say_unwritten(args, quiet);
    Ok(())
}

fn recording(log: &ImuLog, path: &Path) -> Recording {
    let wide = |v: Option<Vec3>| v.map_or_else(|| Vector3::repeat(f64::NAN), |v| v.map(f64::from));
    let column = |of: fn(&Row) -> Option<Vec3>| -> Vec<Vector3<f64>> { log.rows.iter().map(|r| wide(of(r))).collect() };
    let heard = log.rows.iter().any(|r| r.mag.is_some());
    Recording {
        name: path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
        t: log.rows.iter().map(|r| r.t).collect(),
        gyro: column(|r| r.gyro),
        accel: column(|r| r.accel),
        mag: if heard { column(|r| r.mag) } else { Vec::new() },
        temperature: log.column("temp_c").unwrap_or_default(),
        current: log.column("current_a").unwrap_or_default(),
    }
}

/// The board's filter without its magnetometer: north is wherever it starts. Between two rows it turns at the mean of both rates: the
/// board's own rule, the newest rate alone, is half a step ahead, which would pass for a magnetometer that is late by as much.
fn attitude(log: &ImuLog, rates: &[Vector3<f64>]) -> Attitude {
    let mut filter = Dcm::new(Config::DEFAULT);
    let mut out = Attitude::default();
    let mut before = None;
    for ((row, dt), rate) in log.steps().zip(rates) {
        let mean = (before.unwrap_or(*rate) + rate) / 2.0;
        before = rate.iter().all(|w| w.is_finite()).then_some(*rate);
        let gyro = row.gyro.map(|_| mean.map(|w| w as f32));
        filter.update(dt, &Measurement { gyro, accel: row.accel, mag: None });
        let known = filter.is_started();
        out.to_earth.push(if known { filter.matrix().map(f64::from) } else { Matrix3::repeat(f64::NAN) });
        out.rest.push(filter.flags().rest);
    }
    out
}

/// The text of an inertial model, where `path` is one.
pub(crate) fn model_text(path: &Path) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let first = text.lines().find(|l| !l.trim().is_empty() && !l.starts_with('#'))?;
    (first.starts_with("format") && first.contains(MODEL_FORMAT)).then_some(text)
}

/// `quadrig predict` with an inertial model.
pub(crate) fn predict(model: &Path, text: &str, path: &Path, output: &Path) -> Result<(), Failure> {
    let model = InertialModel::parse(&model.display().to_string(), text)?;
    let log = ImuLog::read(path)?;
    let predicted = model.predict(&recording(&log, path), &|rates| attitude(&log, rates))?;
    put(output, &predictions(&log, &predicted))
}

/// The corrected model's prediction of every channel, row for row; empty where it makes no claim.
fn predictions(log: &ImuLog, predicted: &[Predicted]) -> String {
    let mut out = String::from("t_s");
    for c in predicted.iter().flat_map(|s| &s.channels) {
        let _ = write!(out, ",{c}");
    }
    out.push('\n');
    for row in 0..log.rows.len() {
        out.push_str(log.time_text(row));
        for v in predicted.iter().flat_map(|s| s.rows[row].iter()) {
            let _ = if v.is_finite() { write!(out, ",{v:.8}") } else { write!(out, ",") };
        }
        out.push('\n');
    }
    out
}
