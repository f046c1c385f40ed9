//! Columns become a log: rows whose time moves on, one speed, thrust and torque that count positive.
//!
//! What it is: the repair rules of an import, each with its count.
//! What can go wrong: time stamps that repeat or step back lose their row; where that is more than a fifth of the rows the file is refused.
//! Units: the contract's.
//! Reference: specification `formats.md`, `quadrig import`.

use super::header::{ELECTRICAL, OPTICAL};
use super::{Report, findings};
use crate::log::{Column, Log, MODELLED, Place, ReadError, SPEED};
use crate::numeric::order::median;

/// More than this share of rows dropped is no repair any more.
pub(super) const DROPPED: f64 = 0.2;
/// Two speeds differ when the one is off the other by more than this share.
const DIFFER: f64 = 0.02;

/// Names and values become a log; `lines` holds the line of each row.
pub(super) fn assemble(
    place: &Place<'_>,
    mut names: Vec<String>,
    mut columns: Vec<Vec<f64>>,
    lines: &[u64],
    report: &mut Report,
) -> Result<Log, ReadError> {
    let mut log = Log::default();
    let rows = columns.first().map_or(0, Vec::len);
    let t = match names.iter().position(|n| n == "t_s") {
        Some(i) => {
            names.remove(i);
            columns.remove(i)
        }
        None => {
            report.add("t_s", "no time column: the row index stands for it, and no effect of time is offered", rows);
            log.meta.insert("time".into(), toml::Value::String("row".into()));
            (0..rows).map(|i| i as f64).collect()
        }
    };
    let keep = increasing(place, &t, lines, report)?;
    log.t = keep.iter().map(|i| t[*i]).collect();
    if let Some(first) = log.t.first().copied().filter(|t| *t > 1e9) {
        log.t.iter_mut().for_each(|t| *t = ((*t - first) * 1e6).round() / 1e6);
    }
    for (name, values) in names.into_iter().zip(columns) {
        let values: Vec<f64> = keep.iter().map(|i| values[*i]).collect();
        let blanks = values.iter().filter(|v| v.is_nan()).count();
        if blanks == values.len() {
            report.add(&name, "holds no sample: column left out", blanks);
            continue;
        }
        report.add(&name, "blank samples, kept as missing", blanks);
        report.add(&name, "samples that repeat the one before (sample and hold, or coarse steps), kept", repeats(&values));
        log.columns.push(Column { name, values });
    }
    choose_speed(&mut log, report);
    one_speed(&mut log, report);
    orient(&mut log, report);
    findings::inspect(&log, report);
    Ok(log)
}

/// How many samples turn.
fn turning(values: &[f64]) -> usize {
    values.iter().filter(|v| v.is_finite() && **v > 0.0).count()
}

/// Of an optical and an electrical speed the one that reads is the speed; a dead one goes.
fn choose_speed(log: &mut Log, report: &mut Report) {
    let at = |log: &Log, name: &str| log.columns.iter().position(|c| c.name == name);
    let other = SPEED.iter().any(|s| log.column(s).is_some_and(|v| turning(v) > 0));
    // of a tidy file, whose own speed stands beside it, both are kept as they are
    for name in [OPTICAL, ELECTRICAL] {
        let Some(k) = at(log, name) else { continue };
        if turning(&log.columns[k].values) == 0
            && (other || at(log, if name == OPTICAL { ELECTRICAL } else { OPTICAL }).is_some())
        {
            report.add(name, "reads zero throughout: column left out", log.columns[k].values.len());
            log.columns.remove(k);
        }
    }
    if other {
        return;
    }
    log.columns.retain(|c| c.name != "rpm"); // a dead one
    let (optical, electrical) = (at(log, OPTICAL), at(log, ELECTRICAL));
    let taken = match (optical, electrical) {
        (Some(a), Some(b)) => {
            let (o, e) = (&log.columns[a].values, &log.columns[b].values);
            // marks that pass are counted turns; the electrical one needs pole pairs and a turning field
            let optical_reads = 10 * turning(o) >= 9 * turning(e);
            let mut ratios: Vec<f64> = o.iter().zip(e).filter(|(o, e)| **o > 0.0 && **e > 0.0).map(|(o, e)| o / e).collect();
            if ratios.len() > 5 {
                let ratio = median(&mut ratios);
                let off = format!("{ratio:.3} times the electrical speed: pole pairs or marks set wrong?");
                report.add(OPTICAL, off, usize::from((ratio - 1.0).abs() > DIFFER));
            }
            let (name, other) = if optical_reads { (OPTICAL, ELECTRICAL) } else { (ELECTRICAL, OPTICAL) };
            let counts = format!(
                "{} samples turn, {} of {other}, which is kept as a further column",
                turning(&log.columns[if optical_reads { a } else { b }].values),
                turning(&log.columns[if optical_reads { b } else { a }].values)
            );
            report.add("rpm", format!("{name} of two speeds: this one is the speed ({counts})"), 1);
            if optical_reads { a } else { b }
        }
        (Some(k), None) | (None, Some(k)) => {
            report.add("rpm", format!("{}: the only speed that reads is the speed", log.columns[k].name), 1);
            k
        }
        (None, None) => return,
    };
    log.columns[taken].name = "rpm".into();
}

/// Four rotors of one machine and no speed of its own: the median of those that turn stands for it, as the tidy sets do.
fn one_speed(log: &mut Log, report: &mut Report) {
    let rotors: Vec<&Vec<f64>> =
        (1..=8).filter_map(|k| log.columns.iter().find(|c| c.name == format!("rpm{k}"))).map(|c| &c.values).collect();
    if rotors.len() < 2 || log.columns.iter().any(|c| SPEED.contains(&c.name.as_str())) {
        return;
    }
    let count = rotors.len();
    let values: Vec<f64> = (0..log.t.len())
        .map(|i| {
            let mut turning: Vec<f64> = rotors.iter().map(|r| r[i]).filter(|v| v.is_finite() && *v != 0.0).collect();
            if turning.is_empty() { 0.0 } else { median(&mut turning) }
        })
        .collect();
    log.columns.push(Column { name: "rpm".into(), values });
    report.add("rpm", "rotors without a common speed: median of those that turn (thrust and current are of all together)", count);
}

/// Rows whose time moves on. A stamp that repeats or steps back loses its row.
fn increasing(place: &Place<'_>, t: &[f64], lines: &[u64], report: &mut Report) -> Result<Vec<usize>, ReadError> {
    let (mut keep, mut last) = (Vec::with_capacity(t.len()), f64::NEG_INFINITY);
    let (mut equal, mut back, mut blank) = (0, 0, 0);
    // the first of each kind
    let mut firsts = [None; 3];
    for (i, v) in t.iter().enumerate() {
        if v.is_nan() {
            blank += 1;
            firsts[2] = firsts[2].or(lines.get(i));
        } else if *v > last {
            keep.push(i);
            last = *v;
        } else if *v == last {
            equal += 1;
            firsts[0] = firsts[0].or(lines.get(i));
        } else {
            back += 1;
            firsts[1] = firsts[1].or(lines.get(i));
        }
    }
    let dropped = equal + back + blank;
    if dropped as f64 > DROPPED * t.len() as f64 && t.len() >= 20 {
        let whole = keep.iter().all(|i| t[*i].fract() == 0.0);
        let likely = match (equal, back, blank) {
            (e, b, n) if e >= b && e >= n => {
                if whole {
                    "a clock of whole seconds?"
                } else {
                    "a clock too coarse for its rows?"
                }
            }
            (_, b, n) if b >= n => "several runs in one file, or rows out of order?",
            _ => "time in part of the rows only?",
        };
        let found = format!(
            "{dropped} of {} rows would be dropped ({equal} repeat a time stamp, {back} step back, {blank} have none): {likely}",
            t.len()
        );
        return Err(place.refuse(
            Some("t_s"),
            found,
            "a clock that moves on in at least four rows of five (another column with --map t_s=COLUMN)",
        ));
    }
    let first = |line: Option<&u64>| line.map_or_else(String::new, |line| format!(", the first on line {line}"));
    for (what, line, count) in [
        ("time stamps that repeat the row before", firsts[0], equal),
        ("time stamps that step back", firsts[1], back),
        ("blank time stamps", firsts[2], blank),
    ] {
        report.add("t_s", format!("{what}: row dropped{}", first(line)), count);
    }
    Ok(keep)
}

fn repeats(values: &[f64]) -> usize {
    values.windows(2).filter(|w| w[0] == w[1] && w[0] != 0.0).count()
}

/// Thrust and torque count positive: a sign that depends on the direction of rotation is turned round, and said.
fn orient(log: &mut Log, report: &mut Report) {
    let speed = log.columns.iter().find(|c| SPEED.contains(&c.name.as_str())).map(|c| c.values.clone());
    for name in ["thrust_n", "torque_nm"] {
        let Some(column) = log.columns.iter_mut().find(|c| c.name == name) else { continue };
        let extreme = column
            .values
            .iter()
            .zip(speed.iter().flatten().chain(std::iter::repeat(&1.0)))
            .filter(|(v, s)| v.is_finite() && **s > 0.0)
            .map(|(v, _)| *v)
            .fold(0.0_f64, |m, v| if v.abs() > m.abs() { v } else { m });
        if extreme < 0.0 {
            for v in &mut column.values {
                *v = -*v;
            }
            report.add(name, "negative under load (direction of rotation or mounting): sign turned round", column.values.len());
        }
    }
    debug_assert!(log.columns.iter().all(|c| !MODELLED.contains(&c.name.as_str()) || c.values.len() == log.t.len()));
}
