//! The table itself: read, mapped, repaired, counted.
//!
//! What it is: a foreign CSV becomes a [`Log`] by the dictionary of [`super::header`] and four repair rules.
//! What can go wrong: no time column (row index is taken and said), repeated or backward stamps (dropped, counted), text in
//! a numeric column (refused with its place), fewer than two related channels (refused).
//! Units: the contract's.
//! Reference: specification `formats.md`, `quadrig import`.

use super::Report;
use super::header::{Target, sort};
use crate::log::{Column, Lines, Log, MODELLED, Place, ReadError, SPEED, short};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// A user's own mapping of one column: `target = source * factor`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    /// Column of the contract.
    pub target: String,
    /// Header cell of the file.
    pub source: String,
    /// Multiplied in.
    pub factor: f64,
    /// Added after that.
    pub offset: f64,
}

impl std::str::FromStr for Mapping {
    type Err = String;

    /// `target=source`, `target=source*factor` or `target=source*factor+offset`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wanted =
            "expected TARGET=SOURCE, TARGET=SOURCE*FACTOR or TARGET=SOURCE*FACTOR+OFFSET, such as thrust_n=Load*0.00980665";
        let (target, rest) = text.split_once('=').ok_or(wanted)?;
        let (rest, offset) = match rest.rsplit_once('+') {
            Some((s, o)) if s.contains('*') => (s, o.trim().parse::<f64>().map_err(|_| wanted)?),
            _ => (rest, 0.0),
        };
        let (source, factor) = match rest.rsplit_once('*') {
            Some((s, f)) => (s, f.trim().parse::<f64>().map_err(|_| wanted)?),
            None => (rest, 1.0),
        };
        Ok(Self { target: target.trim().to_owned(), source: source.trim().to_owned(), factor, offset })
    }
}

struct Plan {
    /// For each field of the file: destination in `names`, and how its text becomes a number.
    route: Vec<Option<(usize, Reading)>>,
    names: Vec<String>,
    /// What stands between the fields.
    separator: char,
    /// The first line already held numbers.
    headless: bool,
}

/// How a field becomes a number.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Reading {
    /// A decimal number times a factor plus an offset.
    Number(f64, f64),
    /// Date and time of day, to seconds.
    Stamp,
}

/// Imports a file.
///
/// # Errors
/// [`ReadError`] with file, line and column.
pub fn import(path: &Path, mappings: &[Mapping]) -> Result<(Log, Report), ReadError> {
    let file = path.display().to_string();
    let handle = File::open(path).map_err(|source| ReadError::Io { file: file.clone(), source })?;
    let (mut log, report) = import_from(&file, BufReader::new(handle), mappings)?;
    log.name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or(file);
    log.meta.insert("source".into(), toml::Value::String(log.name.clone()));
    Ok((log, report))
}

/// Imports from any source; `file` is the name for messages.
///
/// # Errors
/// As [`import`].
pub fn import_from(file: &str, source: impl BufRead, mappings: &[Mapping]) -> Result<(Log, Report), ReadError> {
    let mut lines = Lines::new(file, source);
    let mut report = Report::default();
    let header = loop {
        match lines.next_line()? {
            None => {
                return Err(lines.place().refuse(
                    None,
                    "the file is empty or ends before its header",
                    "a CSV with one header line",
                ));
            }
            Some(line) if line.trim().is_empty() || line.starts_with('#') => {}
            Some(line) => break line,
        }
    };
    let plan = plan(&header, mappings, &lines.place(), &mut report)?;
    let rows = read_rows(&mut lines, &header, &plan, &mut report)?;
    let log = assemble(plan.names, rows, &mut report);
    if log.is_empty() {
        return Err(lines.place().refuse(None, "no data rows", "at least one line of numbers under the header"));
    }
    let related = log.measured().count() + usize::from(log.column("pulse_us").is_some());
    if related < 2 {
        return Err(Place { file, line: 1 }.refuse(
            None,
            format!("{related} known channel(s)"),
            "at least two of pulse, rpm, thrust, torque, current, voltage (name them with --map TARGET=SOURCE*FACTOR)",
        ));
    }
    Ok((log, report))
}

fn plan(header: &str, mappings: &[Mapping], place: &Place<'_>, report: &mut Report) -> Result<Plan, ReadError> {
    let separator = [',', '\t', ';'].into_iter().find(|s| header.contains(*s)).unwrap_or(',');
    let numbers: Vec<String> = (1..=header.split(separator).count()).map(|k| k.to_string()).collect();
    let mut cells: Vec<&str> =
        header.split(separator).map(|c| c.trim().trim_start_matches('\u{feff}').trim_matches('"')).collect();
    let headless = cells.iter().all(|c| c.parse::<f64>().is_ok());
    if headless {
        if mappings.is_empty() {
            return Err(place.refuse(
                None,
                "numbers where a header should stand",
                format!("a header line, or columns named by their position (1 to {}), such as --map rpm=5*65", cells.len()),
            ));
        }
        report.add("(file)", "no header line: columns are called by their position; those without --map are left out", 1);
        cells = numbers.iter().map(String::as_str).collect();
    }
    for m in mappings {
        if !cells.contains(&m.source.as_str()) {
            return Err(place.refuse(Some(&m.source), "no such column in the file", format!("one of: {}", cells.join(", "))));
        }
    }
    let mut plan = Plan { route: Vec::new(), names: Vec::new(), separator, headless };
    let mut skipped = 0;
    for cell in &cells {
        let (name, reading) = match mappings.iter().find(|m| m.source == *cell) {
            Some(m) => (m.target.clone(), Reading::Number(m.factor, m.offset)),
            None if headless => {
                skipped += 1;
                plan.route.push(None);
                continue;
            }
            None => match sort(cell) {
                Target::Keep(name, factor) => (name.to_owned(), Reading::Number(factor, 0.0)),
                Target::Covariate(name) => (name, Reading::Number(1.0, 0.0)),
                Target::Stamp => ("t_s".to_owned(), Reading::Stamp),
                Target::Command(full) => ("pulse_us".to_owned(), Reading::Number(1000.0 / full, 1000.0)),
                Target::Skip => {
                    skipped += 1;
                    plan.route.push(None);
                    continue;
                }
                Target::UnknownUnit(name) => {
                    return Err(place.refuse(
                        Some(cell),
                        format!("no known unit for {name}"),
                        format!("a unit in parentheses that can be converted, or --map {name}={cell}*FACTOR"),
                    ));
                }
            },
        };
        if plan.names.contains(&name) {
            return Err(place.refuse(
                Some(cell),
                format!("a second column for {name}"),
                "one column for each channel (choose with --map)",
            ));
        }
        match reading {
            Reading::Stamp => {
                report.add(&name, format!("column '{cell}': date and time of day, as seconds since the first row"), 1)
            }
            Reading::Number(factor, 0.0) if factor != 1.0 => {
                report.add(&name, format!("column '{cell}' converted, times {factor}"), 1);
            }
            Reading::Number(factor, offset) if offset != 0.0 => {
                report.add(&name, format!("column '{cell}' converted, times {factor:.6} plus {offset}"), 1);
            }
            Reading::Number(..) => {}
        }
        plan.route.push(Some((plan.names.len(), reading)));
        plan.names.push(name);
    }
    report.add("(file)", "columns left out: derived from others, or text", skipped);
    Ok(plan)
}

fn read_rows<R: BufRead>(
    lines: &mut Lines<'_, R>,
    header: &str,
    plan: &Plan,
    report: &mut Report,
) -> Result<Vec<Vec<f64>>, ReadError> {
    let cells: Vec<&str> = header.split(plan.separator).collect();
    let width = cells.len();
    let mut columns = vec![Vec::new(); plan.names.len()];
    let mut cut = 0;
    let mut first = plan.headless.then(|| header.to_owned());
    while let Some(line) = first.take().map_or_else(|| lines.next_line(), |line| Ok(Some(line)))? {
        if line.trim().is_empty() {
            continue;
        }
        let place = lines.place();
        let found = line.split(plan.separator).count();
        if found != width {
            if lines.unterminated() {
                cut += 1;
                break;
            }
            let missing = cells.get(found).copied();
            return Err(place.refuse(missing, format!("{found} fields"), format!("{width} as in the header")));
        }
        for ((text, route), cell) in line.split(plan.separator).zip(&plan.route).zip(&cells) {
            let Some((index, reading)) = route else { continue };
            let text = text.trim();
            let value = match reading {
                _ if text.is_empty() => f64::NAN,
                Reading::Number(factor, offset) => {
                    text.parse::<f64>().ok().filter(|v| v.is_finite()).map(|v| v * factor + offset).ok_or_else(|| {
                        place.refuse(Some(cell), format!("'{}'", short(text)), "a finite decimal number or an empty field")
                    })?
                }
                Reading::Stamp => seconds(text).ok_or_else(|| {
                    place.refuse(Some(cell), format!("'{}'", short(text)), "a date and time such as 2019-11-05 17:14:08.947")
                })?,
            };
            columns[*index].push(value);
        }
    }
    report.add("(file)", "last line cut short without a line feed: dropped", cut);
    Ok(columns)
}

/// Seconds of a date and time of day, `YYYY-MM-DD HH:MM:SS` with a fraction after a point or a third colon.
fn seconds(text: &str) -> Option<f64> {
    let (date, time) = text.split_once([' ', 'T'])?;
    let date: Vec<i64> = date.split('-').map(|p| p.parse().ok()).collect::<Option<_>>()?;
    let &[year, month, day] = date.as_slice() else { return None };
    let mut parts = time.trim_end_matches('Z').splitn(3, ':');
    let (hour, minute) = (parts.next()?.parse::<i64>().ok()?, parts.next()?.parse::<i64>().ok()?);
    let second: f64 = parts.next()?.replacen(':', ".", 1).parse().ok()?;
    // days since 1 March of year 0 (Richards 1998)
    let (y, m) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let days = 365 * y + y.div_euclid(4) - y.div_euclid(100) + y.div_euclid(400) + (153 * m + 2) / 5 + day;
    ((1..=12).contains(&month) && second.is_finite()).then(|| (days * 86_400 + hour * 3600 + minute * 60) as f64 + second)
}

fn assemble(mut names: Vec<String>, mut columns: Vec<Vec<f64>>, report: &mut Report) -> Log {
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
    let keep = increasing(&t, report);
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
        if name == "rpm_optical_probe" && values.iter().all(|v| v.is_nan() || *v == 0.0) {
            report.add(&name, "reads zero throughout (no probe): column left out", values.len());
            continue;
        }
        report.add(&name, "blank samples, kept as missing", blanks);
        report.add(&name, "samples that repeat the one before (sample and hold, or coarse steps), kept", repeats(&values));
        log.columns.push(Column { name, values });
    }
    one_speed(&mut log, report);
    orient(&mut log, report);
    super::findings::inspect(&log, report);
    log
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
            if turning.is_empty() { 0.0 } else { crate::noise::median(&mut turning) }
        })
        .collect();
    log.columns.push(Column { name: "rpm".into(), values });
    report.add("rpm", "rotors without a common speed: median of those that turn (thrust and current are of all together)", count);
}

/// Rows whose time moves on. A stamp that repeats or steps back loses its row.
fn increasing(t: &[f64], report: &mut Report) -> Vec<usize> {
    let (mut keep, mut last) = (Vec::with_capacity(t.len()), f64::NEG_INFINITY);
    let (mut equal, mut back, mut blank) = (0, 0, 0);
    for (i, v) in t.iter().enumerate() {
        if v.is_nan() {
            blank += 1;
        } else if *v > last {
            keep.push(i);
            last = *v;
        } else if *v == last {
            equal += 1;
        } else {
            back += 1;
        }
    }
    report.add("t_s", "time stamps that repeat the row before: row dropped", equal);
    report.add("t_s", "time stamps that step back: row dropped", back);
    report.add("t_s", "blank time stamps: row dropped", blank);
    keep
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rcbenchmark_rows_are_repaired_and_counted() {
        let text = "\u{feff}Time (s),ESC signal (\u{b5}s),Torque (N\u{b7}m),Thrust (gf),Voltage (V),Motor Electrical Speed (RPM),App message,\n\
                    0,1000,,,16,0,,\n0,1000,,,16,0,,\n0.5,1100,-0.1,1000,16,5000,,\n0.4,1100,-0.1,,16,5000,,\n0.9,1100,-0.2,2000,16,70";
        let (log, report) = import_from("x.csv", text.as_bytes(), &[]).unwrap();
        assert_eq!(log.t, [0.0, 0.5]);
        assert!((log.column("thrust_n").unwrap()[1] - 9.80665).abs() < 1e-9);
        assert_eq!(log.column("torque_nm").unwrap()[1], 0.1);
        let table = report.table();
        for wanted in ["repeat the row before", "step back", "cut short", "sign turned round", "times 0.00980665"] {
            assert!(table.contains(wanted), "{table}");
        }
    }

    #[test]
    fn a_table_without_time_counts_rows() {
        let (log, _) = import_from("x.csv", "rpm,thrust_n\n1000,1\n2000,4\n".as_bytes(), &[]).unwrap();
        assert!(log.time_is_row());
        assert_eq!(log.t, [0.0, 1.0]);
    }

    #[test]
    fn a_mapping_serves_any_csv() {
        let map: Mapping = "thrust_n=Load cell*0.00980665".parse().unwrap();
        let rpm: Mapping = "rpm=n".parse().unwrap();
        let (log, _) = import_from("x.csv", "t_s,Load cell,n\n0,100,1\n1,200,2\n".as_bytes(), &[map, rpm]).unwrap();
        assert!((log.column("thrust_n").unwrap()[1] - 1.96133).abs() < 1e-9);
        assert!("thrust".parse::<Mapping>().is_err());
    }

    #[test]
    fn faults_name_their_place() {
        for (text, wanted) in [
            ("", "x.csv:1: the file is empty"),
            ("t_s,thrust_n\n", "no data rows"),
            ("t_s,a\n0,1\n", "0 known channel(s)"),
            ("t_s,rpm,thrust_n\n0,1,zz\n", "x.csv:2: column thrust_n: 'zz'"),
            ("t_s,rpm,thrust_n\n0,1\n1,2,3\n", "x.csv:2: column thrust_n: 2 fields; expected 3"),
            ("t_s,rpm,Thrust (stone)\n0,1,2\n", "column Thrust (stone): no known unit"),
            ("t_s,rpm,thrust_n\n0,1,nan\n", "'nan'"),
        ] {
            let message = import_from("x.csv", text.as_bytes(), &[]).unwrap_err().to_string();
            assert!(message.contains(wanted), "{message} lacks {wanted}");
        }
    }
}
