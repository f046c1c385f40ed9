//! A rig's channel calibrated from a recording.
//!
//! What it is: the raw codes of a log in which known values stood, each in its window, or in stretches that are found.
//! What can go wrong: a log without codes and without the scale that it was recorded with; a window that is no reading; as many stretches as
//! points are not there. One line says which.
//! Units: s, counts.
//! Reference: specification `formats.md`, "Rig log"; `rig.md`, "load cell".

use super::Args;
use super::channel::Channel;
use super::found::{Found, Taken};
use super::point::{Point, list};
use super::settle::{LENGTH_S, Reading, Sample, reading};
use crate::Failure;
use crate::board::Board;
use crate::replace::put;
use crate::rig::{configure, file};
use frame::flag::{FLAG_SUFFIX, Flag};
use ident::log::Log;
use std::path::Path;

/// Seconds at the end of a stretch that are its reading.
const LAST_S: f64 = 10.0;
/// Counts, and standard errors, by which two stretches differ.
const APART: (f64, f64) = (2.0, 8.0);

/// Runs the command.
pub(super) fn run(channel: Channel, input: &Path, points: &str, day: u16, args: &Args, quiet: bool) -> Result<(), Failure> {
    let log = Log::read(input)?;
    let arm_m = arm(channel, &log, args.arm).map_err(|e| format!("{}: {e}", input.display()))?;
    let points = list(channel, points, arm_m)?;
    let name = input.display().to_string();
    let taken = taken(channel, &log, &points).map_err(|e| format!("{name}: {e}"))?;
    let found = Found::of(channel, taken, before(channel, &log), day, arm_m).map_err(|e| format!("{name}: {e}"))?;
    if args.output.is_none() && !args.port.is_given() {
        super::usage("a calibration from a recording goes to -o FILE, or to the board at --port");
    }
    if let Some(output) = &args.output {
        put(output, &found.toml(&name))?;
    }
    if args.port.is_given() {
        let mut board = Board::open(&args.port)?;
        let mut config = configure::in_force(&mut board)?;
        config.calibrated[channel.place()] = Some(found.calibrated());
        configure::send(&mut board, &config)?;
    }
    if !quiet {
        crate::say::text(&found.table());
    }
    Ok(())
}

/// The scale that a log was recorded with: unit per count.
fn before(channel: Channel, log: &Log) -> Option<f64> {
    log.meta.get(&format!("calibration_{}", channel.column()))?.get("per_count")?.as_float()
}

/// The arm at which masses for the torque hang.
fn arm(channel: Channel, log: &Log, said: Option<f64>) -> Result<f64, String> {
    let configured = || log.meta.get("rig_config").and_then(toml::Value::as_str).and_then(file::arm_of);
    match said.or_else(configured) {
        Some(arm) if arm.is_finite() && arm > 0.0 => Ok(arm),
        Some(arm) => Err(format!("its head tells an arm of {arm} m; expected --arm METRES, above 0")),
        None if channel == Channel::Torque => Err("its head tells no arm; expected --arm METRES".to_owned()),
        None => Ok(1.0),
    }
}

/// The samples of a channel in counts: from the raw codes, or from the readings and the scale that they were made with.
fn samples(channel: Channel, log: &Log) -> Result<Vec<Sample>, String> {
    let name = channel.column();
    let column = |name: String| log.column(&name);
    let flags = column(format!("{name}{FLAG_SUFFIX}"));
    let flag = |row: usize| {
        let code = flags.map_or(f64::NAN, |f| f[row]);
        code.is_finite().then(|| Flag::of(code as u8).map_or("flagged", |flag| flag.words))
    };
    let counts: Vec<f64> = match (column(format!("raw_{name}_sum")), column(format!("raw_{name}_count")), log.column(name)) {
        (Some(sum), Some(count), _) => sum.iter().zip(count).map(|(sum, count)| sum / count).collect(),
        (_, _, Some(values)) => {
            let scale = log.meta.get(&format!("calibration_{name}"));
            let number = |key: &str| scale.and_then(|s| s.get(key)).and_then(toml::Value::as_float);
            let (Some(zero), Some(gain)) = (number("zero_counts"), number("per_count")) else {
                return Err(format!(
                    "column {name}: neither raw codes nor the scale that it was recorded with; record it with --raw"
                ));
            };
            if log.events.iter().any(|e| e.contains("tared:") || e.contains("recalibrated:")) {
                return Err(format!("column {name}: it was tared in mid-run; expected raw codes: record it with --raw"));
            }
            values.iter().map(|value| zero + value / gain).collect()
        }
        _ => return Err(format!("no column {name}; expected it, or raw_{name}_sum and raw_{name}_count")),
    };
    let all = log.t.iter().zip(counts).enumerate();
    Ok(all.filter(|(_, (_, c))| c.is_finite()).map(|(row, (t, counts))| Sample { t: *t, counts, flag: flag(row) }).collect())
}

/// The reading of each point.
fn taken(channel: Channel, log: &Log, points: &[Point]) -> Result<Vec<Taken>, String> {
    let samples = samples(channel, log)?;
    let stretches = if points.iter().all(|p| p.window.is_none()) { Some(matched(&samples, points)?) } else { None };
    let of_point = |(n, point): (usize, &Point)| {
        let part = match (&stretches, point.window) {
            (Some(stretches), _) => &samples[stretches[n].clone()],
            (None, Some((from, to))) => &samples[samples.partition_point(|s| s.t < from)..samples.partition_point(|s| s.t <= to)],
            (None, None) => &[][..],
        };
        let reading = reading(part).map_err(|why| format!("column {}, {}: {why}", channel.column(), point.said))?;
        Ok(Taken { point: point.clone(), reading })
    };
    points.iter().enumerate().map(of_point).collect()
}

/// A settled stretch for each point, in the order of time.
fn matched(samples: &[Sample], points: &[Point]) -> Result<Vec<std::ops::Range<usize>>, String> {
    let found = stretches(samples);
    if found.len() == points.len() {
        return Ok(found.into_iter().map(|(rows, _)| rows).collect());
    }
    let list: Vec<String> = found
        .iter()
        .map(|(rows, reading)| {
            format!("{:.1}..{:.1} s {:.0} counts", samples[rows.start].t, samples[rows.end - 1].t, reading.counts)
        })
        .collect();
    Err(format!(
        "{} settled stretches for {} point{}: {}; expected one for each: give each point its time, as in 200 g@12..18",
        found.len(),
        points.len(),
        if points.len() == 1 { "" } else { "s" },
        if list.is_empty() { "none".to_owned() } else { list.join(", ") }
    ))
}

/// Stretches in which the channel rests, each at another level than the one before: the last seconds of each, and what it reads.
fn stretches(samples: &[Sample]) -> Vec<(std::ops::Range<usize>, Reading)> {
    let plain: Vec<Sample> = samples.iter().map(|s| Sample { flag: None, ..*s }).collect();
    let mut found: Vec<(std::ops::Range<usize>, Reading)> = Vec::new();
    let mut from = 0;
    while from < plain.len() {
        let to = plain.partition_point(|s| s.t < plain[from].t + LENGTH_S);
        let step = ((to - from) / 8).max(1);
        if let Ok(now) = reading(&plain[from..to]) {
            let near = |before: &Reading| (now.counts - before.counts).abs() < APART.0 + APART.1 * now.sigma.max(before.sigma);
            match found.last_mut().filter(|(_, before)| near(before)) {
                Some((rows, before)) => {
                    // a disturbance in between begins it anew
                    let start = if from <= rows.end { rows.start } else { from };
                    (*rows, *before) = (start..to, now);
                }
                None => found.push((from..to, now)),
            }
        }
        from += step;
    }
    for (rows, _) in &mut found {
        let begin = plain.partition_point(|s| s.t < plain[rows.end - 1].t - LAST_S);
        rows.start = rows.start.max(begin);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::settle::tests::samples as made;
    use super::*;

    /// 0, 200 and 500 g, each put on by hand: a bump, then rest.
    fn by_hand(t: f64) -> f64 {
        let swing = |since: f64| 200.0 * (-since / 0.4).exp() * (20.0 * since).sin();
        match t {
            t if t < 6.0 => 1427.0,
            t if t < 13.0 => 1963.0 + swing(t - 6.0),
            t => 2767.0 + swing(t - 13.0),
        }
    }

    fn log(samples: &[Sample], head: &str) -> Log {
        let mut text = format!("# quadrig-log 1\n{head}t_s,thrust_n,thrust_n_flag,raw_thrust_n_sum,raw_thrust_n_count\n");
        for s in samples {
            let flag = if s.flag.is_some() { "11" } else { "" };
            text += &format!("{:.1},0,{flag},{},1000\n", s.t, (s.counts * 1000.0).round());
        }
        Log::parse("rec.csv", text.as_bytes()).expect("a log")
    }

    fn read(log: &Log, points: &str) -> Result<Vec<f64>, String> {
        let points = list(Channel::Thrust, points, 0.1).expect("a list");
        taken(Channel::Thrust, log, &points).map(|t| t.iter().map(|t| t.reading.counts).collect())
    }

    #[test]
    fn settled_stretches_are_found_and_windows_are_taken_as_they_are_given() {
        let log = log(&made(20.0, 0.4, 3, by_hand), "");
        for points in ["0 g, 200 g, 500 g", "0 g@1..5, 200 g@9..12.5, 500 g@16..19.9"] {
            let counts = read(&log, points).expect(points);
            assert!(counts.iter().zip([1427.0, 1963.0, 2767.0]).all(|(a, b)| (a - b).abs() < 0.5), "{points}: {counts:?}");
        }
    }

    #[test]
    fn what_is_saturated_unsettled_or_not_there_is_refused_with_its_place() {
        let mut samples = made(20.0, 0.4, 3, by_hand);
        samples.iter_mut().filter(|s| s.t > 14.0).for_each(|s| s.flag = Some("saturated"));
        let log = log(&samples, "");
        for (points, word) in [
            ("0 g, 200 g, 500 g", "thrust_n, 500 g: the channel is saturated"),
            ("0 g@1..5, 200 g@5.5..8.5", "200 g: not settled"),
            ("0 g@1..5, 200 g@9..10", "200 g: 11 samples in 1.0 s"),
            ("0 g, 200 g", "3 settled stretches for 2 points: 0.1..5.8 s 1427 counts"),
            ("0 g@100..110, 200 g@9..12", "0 g: 0 samples"),
        ] {
            let said = read(&log, points).expect_err(points);
            assert!(said.contains(word) && !said.contains('\n'), "{said}");
        }
    }

    /// Without raw codes the readings are turned back by the scale that they were made with; and without that they are none.
    #[test]
    fn a_log_without_codes_needs_the_scale_in_its_head() {
        let plain = |head: &str, event: &str| {
            let mut text = format!("# quadrig-log 1\n{head}{event}t_s,thrust_n,rpm\n");
            for s in made(8.0, 0.0, 1, |_| 1500.0) {
                text += &format!("{:.1},{:.6},0\n", s.t, (s.counts - 1400.0) * -0.004);
            }
            read(&Log::parse("rec.csv", text.as_bytes()).expect("a log"), "0 g@1..7")
        };
        let head = "# calibration_thrust_n = { zero_counts = 1400.0, per_count = -0.004 }\n";
        let counts = plain(head, "").expect("a reading");
        assert!((counts[0] - 1500.0).abs() < 1e-3, "{counts:?}");
        assert!(plain("", "").expect_err("no scale").contains("--raw"));
        assert!(plain(head, "# event = \"1.0 s: tared: thrust_n\"\n").expect_err("tared").contains("mid-run"));
    }
}
