//! Recorded trials.
//!
//! What it is: reads `broad/*.csv.gz`.
//! What can go wrong: a missing folder, a damaged file, a number that is none: one line with file, line and column.
//! Units: s, rad/s, m/s^2, uT.
//! Reference: README of the data; BROAD, Laidig et al., Data 6(7):72, 2021, CC BY 4.0.

use crate::run::Failure;
use std::io::Read;
use std::path::Path;

/// One sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    pub(crate) t: f64,
    pub(crate) gyro: [f32; 3],
    pub(crate) accel: [f32; 3],
    pub(crate) mag: [f32; 3],
    /// Truth; `None` where it is not scored.
    pub(crate) truth: Option<Truth>,
}

/// A true attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Truth {
    /// Unit quaternion, sensor to east-north-up.
    pub(crate) q: [f64; 4],
    /// How long before the sample it holds, s; no longer than since the sample before, of which the estimate is then a mean.
    pub(crate) before: f64,
}

/// One trial.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    pub(crate) name: String,
    pub(crate) samples: Vec<Sample>,
}

const COLUMNS: [&str; 15] = ["t_s", "gx", "gy", "gz", "ax", "ay", "az", "mx", "my", "mz", "qw", "qx", "qy", "qz", "valid"];

/// Reads every trial of the folder, in order of its name.
pub(crate) fn trials(folder: &Path) -> Result<Vec<Trial>, Failure> {
    let entries = std::fs::read_dir(folder).map_err(|e| Failure(format!("{}: {e}", folder.display())))?;
    let mut files: Vec<_> =
        entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| p.extension().is_some_and(|x| x == "gz")).collect();
    files.sort();
    if files.is_empty() {
        return Err(Failure(format!("{}: no *.csv.gz in it", folder.display())));
    }
    files.iter().map(|path| trial(path)).collect()
}

fn trial(path: &Path) -> Result<Trial, Failure> {
    let fail = |what: &dyn std::fmt::Display| Failure(format!("{}: {what}", path.display()));
    let file = std::fs::File::open(path).map_err(|e| fail(&e))?;
    let mut text = String::new();
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).map_err(|e| fail(&e))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    if header != COLUMNS {
        return Err(fail(&format!("line 1: expected the columns {}", COLUMNS.join(","))));
    }
    let samples: Result<Vec<Sample>, Failure> = lines
        .enumerate()
        .map(|(n, line)| {
            let mut v = [0.0f64; 15];
            let mut fields = line.split(',');
            for (slot, column) in v.iter_mut().zip(COLUMNS) {
                let field = fields.next().unwrap_or_default();
                *slot = field.parse().map_err(|_| fail(&format!("line {}: {column}: {field:?} is no number", n + 2)))?;
            }
            let three = |i: usize| [v[i] as f32, v[i + 1] as f32, v[i + 2] as f32];
            let truth = (v[14] == 1.0).then_some(Truth { q: [v[10], v[11], v[12], v[13]], before: 0.0 });
            Ok(Sample { t: v[0], gyro: three(1), accel: three(4), mag: three(7), truth })
        })
        .collect();
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default().trim_end_matches(".csv.gz").to_owned();
    Ok(Trial { name, samples: samples? })
}
