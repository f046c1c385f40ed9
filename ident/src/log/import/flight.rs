//! Flights of other programs become flight logs.
//!
//! What it is: PX4's ULog and Betaflight's Blackbox (`ulog`, `blackbox`); the decoded logs of the Crazyflie (500 Hz groups with estimate, IMU, rotor speeds and motor commands; motion-capture poses; the
//! excitation logs of ARPL), each known by its header, its frames turned into ours.
//! What can go wrong: a time stamp that repeats or steps back costs its row, which is counted; gaps are counted; a field that is no number is
//! refused with its place.
//! Units: converted on the way in: deg/s, g, mV and 0..65535 to rad/s, m/s^2, V and us.
//! Reference: Crazyflie firmware, `stabilizer` log groups: body x forward, y left, z up; world x forward, y left, z up. Both turn into ours by
//! half a turn about x: (x, -y, -z), and a quaternion (w, x, y, z) into (w, x, -y, -z). Motors of the Crazyflie 2: 1 front right and 3 rear left
//! turn counter-clockwise, 2 rear right and 4 front left clockwise, seen from above.

use super::Report;
use crate::log::{Column, Lines, Log, ReadError, short};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;
/// Full scale of a motor command.
const FULL: f64 = 65_535.0;
/// Gaps are longer than this many median intervals.
const GAP: f64 = 5.0;

/// What a column of theirs is, and the factor and offset to ours.
struct Known {
    theirs: &'static str,
    ours: &'static str,
    factor: f64,
    offset: f64,
}

const fn known(theirs: &'static str, ours: &'static str, factor: f64) -> Known {
    Known { theirs, ours, factor, offset: 0.0 }
}

const RAD: f64 = core::f64::consts::PI / 180.0;

/// Every column that is taken, in the order of the flight log.
const COLUMNS: [Known; 36] = [
    command("pwm.m1", "pulse_us_1"),
    command("pwm.m2", "pulse_us_2"),
    command("pwm.m3", "pulse_us_3"),
    command("pwm.m4", "pulse_us_4"),
    command("motor.m1", "pulse_us_1"),
    command("motor.m2", "pulse_us_2"),
    command("motor.m3", "pulse_us_3"),
    command("motor.m4", "pulse_us_4"),
    known("rpm.m1", "rpm_1", 1.0),
    known("rpm.m2", "rpm_2", 1.0),
    known("rpm.m3", "rpm_3", 1.0),
    known("rpm.m4", "rpm_4", 1.0),
    known("acc.x", "acc_x", G),
    known("acc.y", "acc_y", -G),
    known("acc.z", "acc_z", -G),
    known("gyro.x", "gyro_x", RAD),
    known("gyro.y", "gyro_y", -RAD),
    known("gyro.z", "gyro_z", -RAD),
    known("est.vx", "vel_x", 1.0),
    known("est.vy", "vel_y", -1.0),
    known("est.vz", "vel_z", -1.0),
    known("est.x", "pos_x", 1.0),
    known("est.y", "pos_y", -1.0),
    known("est.z", "pos_z", -1.0),
    known("est.qw", "qw", 1.0),
    known("est.qx", "qx", 1.0),
    known("est.qy", "qy", -1.0),
    known("est.qz", "qz", -1.0),
    known("locSrv.x", "pos_x", 1.0),
    known("locSrv.y", "pos_y", -1.0),
    known("locSrv.z", "pos_z", -1.0),
    known("locSrv.qw", "qw", 1.0),
    known("locSrv.qx", "qx", 1.0),
    known("locSrv.qy", "qy", -1.0),
    known("locSrv.qz", "qz", -1.0),
    known("pm.vbatMV", "voltage_v", 1.0e-3),
];

const fn command(theirs: &'static str, ours: &'static str) -> Known {
    Known { theirs, ours, factor: 1000.0 / FULL, offset: 1000.0 }
}

/// Whether a header is that of a flight.
fn is_flight(header: &str) -> bool {
    let has = |name: &str| header.split(',').any(|cell| cell.trim() == name);
    has("t_s") && ((has("gyro.x") && has("acc.x")) || (has("locSrv.qw") && has("locSrv.x")))
}

/// Imports a flight; nothing where the file's header is not that of one.
///
/// # Errors
/// [`ReadError`] with file, line and column.
pub fn flight(path: &Path) -> Result<Option<(Log, Report)>, ReadError> {
    for binary in [super::ulog::ulog, super::blackbox::blackbox] {
        if let Some(found) = binary(path)? {
            return Ok(Some(found));
        }
    }
    let file = path.display().to_string();
    let handle = File::open(path).map_err(|source| ReadError::Io { file: file.clone(), source })?;
    let Some((mut log, report)) = flight_from(&file, BufReader::new(handle))? else { return Ok(None) };
    log.name = path.file_name().map_or(file, |n| n.to_string_lossy().into_owned());
    log.meta.insert("source".into(), toml::Value::String(log.name.clone()));
    Ok(Some((log, report)))
}

/// The same from any source; `file` is the name for messages.
///
/// # Errors
/// As [`flight`].
pub fn flight_from(file: &str, source: impl BufRead) -> Result<Option<(Log, Report)>, ReadError> {
    let mut lines = Lines::new(file, source);
    let header = loop {
        match lines.next_line() {
            Ok(Some(line)) if line.trim().is_empty() || line.starts_with('#') => {}
            Ok(Some(line)) => break line,
            // the importer of rig logs says what is wrong
            Ok(None) | Err(ReadError::Content { .. }) => return Ok(None),
            Err(e) => return Err(e),
        }
    };
    if !is_flight(&header) {
        return Ok(None);
    }
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let mut report = Report::default();
    let place_of = |name: &str| names.iter().position(|n| *n == name);
    let taken: Vec<(usize, &Known)> = COLUMNS.iter().filter_map(|k| Some((place_of(k.theirs)?, k))).collect();
    let time = place_of("t_s").unwrap_or_default();
    let columns = taken.iter().map(|(_, k)| Column { name: k.ours.to_owned(), values: Vec::new() }).collect();
    let mut log = Log { columns, ..Log::default() };
    let left: Vec<&str> =
        names.iter().enumerate().filter(|(i, _)| *i != time && !taken.iter().any(|(p, _)| p == i)).map(|(_, n)| *n).collect();
    left.iter().for_each(|name| report.add(name, "not a quantity of a flight log; left out", 1));
    let (mut stepped, mut missing) = (0, 0);
    while let Some(line) = lines.next_line()? {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let place = lines.place();
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        if cells.len() != names.len() {
            return Err(place.refuse(None, format!("{} fields", cells.len()), format!("{} as in the header", names.len())));
        }
        let number = |i: usize| -> Result<f64, ReadError> {
            if cells[i].is_empty() {
                return Ok(f64::NAN);
            }
            let value = cells[i].parse::<f64>();
            value.map_err(|_| place.refuse(Some(names[i]), format!("'{}'", short(cells[i])), "a number, or an empty field"))
        };
        let t = number(time)?;
        if !t.is_finite() || log.t.last().is_some_and(|last| t <= *last) {
            stepped += 1;
            continue;
        }
        log.t.push(t);
        for ((i, k), column) in taken.iter().zip(&mut log.columns) {
            let value = number(*i)?;
            missing += usize::from(!value.is_finite());
            column.values.push(if value.is_finite() { k.offset + k.factor * value } else { f64::NAN });
        }
    }
    if log.is_empty() {
        return Err(lines.place().refuse(None, "no data rows", "at least one line of numbers under the header"));
    }
    report.add("t_s", "a time that repeats or steps back, or none: row left out", stepped);
    report.add("(file)", "missing values", missing);
    say_frames(&mut log, &mut report);
    Ok(Some((log, report)))
}

/// What was turned and scaled, and what the flight's metadata are.
fn say_frames(log: &mut Log, report: &mut Report) {
    let count = |prefix: &str| log.columns.iter().filter(|c| c.name.starts_with(prefix)).count();
    report.add(
        "gyro, acc",
        "deg/s and g, body forward-left-up, to rad/s and m/s^2, forward-right-down",
        count("gyro_") + count("acc_"),
    );
    report.add("vel, pos", "world forward-left-up to north-east-down: its x is taken for north", count("vel_") + count("pos_"));
    report.add("q", "body to world, turned by half a turn about x on both sides", count("q"));
    report.add("pulse_us", "motor command 0 to 65535 as 1000 to 2000 us", count("pulse_us_"));
    let mut steps: Vec<f64> = log.t.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let gaps = steps.iter().filter(|s| **s > GAP * usual).count();
    report.add("t_s", format!("gaps of more than {:.0} ms", 1000.0 * GAP * usual), gaps);
    let text = |s: &str| toml::Value::String(s.to_owned());
    if count("pulse_us_") + count("rpm_") > 0 {
        log.meta.insert("layout".into(), text("x: 1 front right, 2 rear right, 3 rear left, 4 front left; 2 and 4 clockwise"));
    }
    log.meta.insert("frames".into(), text("from forward-left-up; north is the world's x"));
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "t_s,est.x,est.y,est.z,est.qx,est.qy,est.qz,est.qw,est.vx,est.vy,est.vz,gyro.x,gyro.y,gyro.z,acc.x,acc.y,acc.z,rpm.m1,pwm.m1,pm.vbatMV,kalman.s\n";

    fn import(text: &str) -> Result<Option<(Log, Report)>, String> {
        flight_from("f.csv", text.as_bytes()).map_err(|e| e.to_string())
    }

    #[test]
    fn frames_and_units_are_ours() {
        let rows = "0,1,2,3,0.1,0.2,0.3,0.9,4,5,6,90,180,-90,0.1,0.2,1,18000,65535,3700,7\n\
                    0.002,1,2,3,0,0,0,1,0,0,0,0,0,0,0,0,1,,0,3700,7\n0.002,1,2,3,0,0,0,1,0,0,0,0,0,0,0,0,1,1,0,3700,7\n";
        let (log, report) = import(&format!("{HEAD}{rows}")).unwrap().unwrap();
        let first = |name: &str| log.column(name).unwrap()[0];
        let near = |name: &str, want: f64| assert!((first(name) - want).abs() < 1e-9, "{name}: {} {want}", first(name));
        for (name, want) in [
            ("pos_x", 1.0),
            ("pos_y", -2.0),
            ("pos_z", -3.0),
            ("vel_y", -5.0),
            ("qw", 0.9),
            ("qx", 0.1),
            ("qy", -0.2),
            ("qz", -0.3),
        ] {
            near(name, want);
        }
        for (name, want) in
            [("gyro_x", RAD * 90.0), ("gyro_y", -RAD * 180.0), ("gyro_z", RAD * 90.0), ("acc_y", -0.2 * G), ("acc_z", -G)]
        {
            near(name, want);
        }
        near("pulse_us_1", 2000.0);
        near("voltage_v", 3.7);
        assert!(log.column("rpm_1").unwrap()[1].is_nan() && log.len() == 2);
        let said = report.table();
        assert!(said.contains("kalman.s") && said.contains("row left out") && said.contains("forward-right-down"), "{said}");
    }

    #[test]
    fn other_files_are_left_to_the_other_importer_and_bad_ones_refused() {
        assert!(import("t_s,pwm,thrust_g\n0,1,2\n").unwrap().is_none());
        assert!(import("").unwrap().is_none());
        let short = import(&format!("{HEAD}0,1\n")).unwrap_err();
        assert!(short.contains("f.csv:2: 2 fields"), "{short}");
        let word = import(&format!("{HEAD}{}\n", "0,one,2,3,0,0,0,1,4,5,6,90,180,-90,0,0,1,1,1,1,1")).unwrap_err();
        assert!(word.contains("f.csv:2: column est.x: 'one'"), "{word}");
        assert!(import(HEAD).unwrap_err().contains("no data rows"));
    }
}
