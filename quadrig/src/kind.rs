//! What a file is that a command does not take.
//!
//! What it is: the two files of the IMU board, known by the names of their columns, and what takes or makes them instead.
//! What can go wrong: nothing; any other file is left to its reader's own words.
//! Units: none.
//! Reference: specification `formats.md`, "Attitude log"; docs/scenario.md.

use std::io::{BufRead, BufReader};
use std::path::Path;

/// What is said of the board's own log, which holds the attitude and no readings.
pub(crate) const ATTITUDE_ALONE: &str = "an attitude without the readings behind it; expected gx,gy,gz,ax,ay,az: `quadrig sim SCENARIO -o LOG --readings READINGS` writes them";

/// Names of a table's columns: its first line that is no comment.
pub(crate) fn columns(path: &Path) -> Vec<String> {
    let Ok(file) = std::fs::File::open(path) else { return Vec::new() };
    let lines = BufReader::new(file).lines().map_while(Result::ok);
    let header = lines.into_iter().find(|l| !l.starts_with('#') && !l.trim().is_empty()).unwrap_or_default();
    header.split(',').map(|name| name.trim().to_owned()).collect()
}

/// Whether columns are those of a gyro.
pub(crate) fn has_readings(columns: &[String]) -> bool {
    ["gx", "gy", "gz"].iter().all(|n| columns.iter().any(|c| c == n))
}

/// Whether columns are an attitude and nothing that it was made from.
pub(crate) fn is_attitude_alone<S: AsRef<str>>(columns: &[S]) -> bool {
    let has = |name: &str| columns.iter().any(|c| c.as_ref() == name);
    ["qw", "qx", "qy", "qz"].into_iter().all(has) && !has("gx") && !has("gyro_x")
}

/// What a file is that is no rig's log, where it is one of the IMU board's.
pub(crate) fn of_the_imu(path: &Path) -> Option<String> {
    let columns = columns(path);
    let file = path.display();
    if is_attitude_alone(&columns) {
        Some(format!("{file}:1:1: {ATTITUDE_ALONE}"))
    } else if has_readings(&columns) {
        Some(format!("{file}:1:1: readings of an IMU; expected a rig's log: `quadrig close-loop` and `quadrig ahrs` take these"))
    } else {
        None
    }
}
