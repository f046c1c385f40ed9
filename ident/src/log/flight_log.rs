//! The flight log, `quadrig-flight 1`: reading, checking, writing.
//!
//! What it is: a [`Log`] with the columns of a flight: `pulse_us_1..n`, `rpm_1..n`, `acc_x..z` (specific force), `gyro_x..z`, `vel_x..z`,
//! `pos_x..z`, `qw,qx,qy,qz` (body to earth), `voltage_v`, `current_a`; all but the time optional, others kept under their names. Metadata
//! `mass_kg`, `arm_m`, `layout`, `inertia_kgm2`.
//! What can go wrong: as for the rig log; a vector or a quaternion of which a component is missing is refused.
//! Units: m/s^2 and rad/s in body FRD; m and m/s in earth NED; us, rev/min, V, A.
//! Reference: specification `flight.md`, "Flight log".

use crate::log::{Log, Place, ReadError};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

/// First line of the format.
pub const FORMAT: &str = "quadrig-flight 1";

/// Columns that mean nothing without each other.
const TOGETHER: [&[&str]; 5] = [
    &["acc_x", "acc_y", "acc_z"],
    &["gyro_x", "gyro_y", "gyro_z"],
    &["vel_x", "vel_y", "vel_z"],
    &["pos_x", "pos_y", "pos_z"],
    &["qw", "qx", "qy", "qz"],
];

/// Reads a flight log.
///
/// # Errors
/// [`ReadError`] with file, line and column for anything that is not the format.
pub fn read(path: &Path) -> Result<Log, ReadError> {
    let file = path.display().to_string();
    let handle = File::open(path).map_err(|source| ReadError::Io { file: file.clone(), source })?;
    let log = parse(&file, BufReader::new(handle))?;
    Ok(Log { name: path.file_name().map_or(file, |n| n.to_string_lossy().into_owned()), ..log })
}

/// Reads a flight log from any source; `file` is the name for messages.
///
/// # Errors
/// As [`read`].
pub fn parse(file: &str, source: impl BufRead) -> Result<Log, ReadError> {
    let log = Log::parse_as(FORMAT, file, source)?;
    let known = |name: &&&str| log.column(name).is_some();
    for group in TOGETHER.iter().filter(|g| g.iter().any(|n| known(&n))) {
        if let Some(missing) = group.iter().find(|n| !known(n)) {
            let line = 1 + log.meta.len() + 1;
            return Err(Place { file, line }.refuse(Some(missing), "not there", format!("all of {}", group.join(", "))));
        }
    }
    Ok(log)
}

/// Writes a flight log to any sink.
///
/// # Errors
/// What the sink says.
pub fn write_to(log: &Log, out: &mut dyn Write) -> std::io::Result<()> {
    log.write_as(FORMAT, out)
}

/// Number of rotors of which a log has a pulse or a speed.
#[must_use]
pub fn rotors(log: &Log) -> usize {
    let number = |name: &str| name.strip_prefix("pulse_us_").or_else(|| name.strip_prefix("rpm_"))?.parse::<usize>().ok();
    log.columns.iter().filter_map(|c| number(&c.name)).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_reads_and_writes_back() {
        let text = "# quadrig-flight 1\n# mass_kg = 1.174\n# inertia_kgm2 = [0.01, 0.01, 0.02]\nt_s,pulse_us_1,pulse_us_2,gyro_x,gyro_y,gyro_z,qw,qx,qy,qz\n\
                    0,1672,1672,0.1234567,0,0,1,0,0,0\n0.01,1700,,0,0,0,0.999999995,0.0001,0,0\n";
        let log = parse("f.csv", text.as_bytes()).unwrap();
        assert_eq!(
            (rotors(&log), log.meta["mass_kg"].as_float(), log.column("pulse_us_2").unwrap()[1].is_nan()),
            (2, Some(1.174), true)
        );
        let mut out = Vec::new();
        log.write_as(FORMAT, &mut out).unwrap();
        let again = parse("f.csv", out.as_slice()).unwrap();
        assert_eq!(
            (again.meta.clone(), again.column("qw"), again.column("gyro_x")),
            (log.meta.clone(), log.column("qw"), log.column("gyro_x"))
        );
    }

    #[test]
    fn what_is_no_flight_is_refused() {
        for (text, word) in [
            ("# quadrig-log 1\nt_s,a,b\n0,1,2\n", "'# quadrig-flight 1'"),
            ("# quadrig-flight 1\nt_s,qw,qx,qy\n0,1,0,0\n", "f.csv:2: column qz: not there"),
            ("# quadrig-flight 1\nt_s,pulse_us_1,rpm_1\n0,5,1\n", "500 to 2500"),
            ("# quadrig-flight 1\nt_s,pulse_us_1,rpm_1\n0,1500\n", "f.csv:3: column rpm_1"),
        ] {
            let said = parse("f.csv", text.as_bytes()).unwrap_err().to_string();
            assert!(said.contains(word), "{said}");
        }
    }
}
