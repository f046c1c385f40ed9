//! The recorded sets: where their files lie, how they are read, which runs share a rig.
//!
//! What it is: one entry a folder of `DATA/rig`, with the authors' own words on the rig in brief.
//! What can go wrong: an absent folder is no set of files: the page then says so.
//! Units: converted on import.
//! Reference: the `README.md` of each set.

use crate::trouble::unread;
use ident::log::Log;
use ident::log::import::import;
use std::path::{Path, PathBuf};

/// A set.
#[derive(Debug)]
pub(crate) struct Set {
    /// Folder below `rig`.
    pub(crate) folder: &'static str,
    /// Folder of the files below that.
    pub(crate) files: &'static str,
    /// What a file's name must contain.
    pub(crate) holds: &'static str,
    /// What was measured.
    pub(crate) what: &'static str,
    /// Which runs come from one rig.
    pub(crate) rigs: Rigs,
    /// What the name of a file that is no run of its own contains; empty where every file is a run.
    pub(crate) leaves_out: &'static str,
    /// Whether the data's licence lets figures of single runs be published.
    pub(crate) figures: bool,
}

/// Which runs of a set come from one rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rigs {
    /// Every run is a rig of its own.
    Own,
    /// All runs are one rig.
    One,
    /// So many characters at the head of a file's name, up to a dot, name the rig.
    Head(usize),
    /// What follows this word in a file's name names the rig.
    After(&'static str),
}

/// Every set.
pub(crate) const SETS: [Set; 9] = [
    Set {
        folder: "spitz-esc-test",
        files: "original",
        holds: "Log_",
        what: "RCbenchmark stand, three motors with three ESCs, one three-bladed 7-inch propeller, the stand's own exports. Three rigs on one stand: what the stand does must come back, what a motor does need not.",
        rigs: Rigs::Own,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "lever-rig-10x45",
        files: "tidy",
        holds: ".csv",
        what: "Lever-arm load cell, 760 KV motor with a 10x4.5 propeller, one rig at four supply voltages. The authors logged no time: it is reconstructed to about 20 %, and so are rates and time constants.",
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "crazyflie-stand",
        files: "tidy",
        holds: ".csv",
        what: "Crazyflie 2.1 upside down on a scale, all four rotors together, 1S battery. No time column: rows are counted, and no effect of time is offered.",
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "uiuc-static",
        files: "",
        holds: ".csv",
        what: "APC Slow Flyer 9x4.7 of the UIUC propeller data site: sixteen rows of coefficients, thrust and torque computed from them.",
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "fivein-static-tables",
        files: "tidy",
        holds: ".csv",
        what: "Static sweeps of eleven points, motors (letter) by five-inch propellers (digit) by two supply voltages: two runs of each rig.",
        rigs: Rigs::Head(2),
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "dualcell-eco2814c",
        files: "tidy",
        holds: ".csv",
        what: "Two bar load cells (thrust, torque), one motor with 10- and 12-inch propellers, lithium batteries, speed and temperature from the ESC's telemetry. A rig is a propeller and a battery; two of them were measured in two sessions. The file has no time stamps: rows are taken as 0.1 s.",
        rigs: Rigs::After("v2_"),
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "stand1585-micro",
        files: "tidy",
        holds: ".csv",
        what: "RCbenchmark 1585, a small motor on a 4S battery, two days: staircases of one row a step, and fast steps logged throughout.",
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "stand1585-sov5",
        files: "tidy",
        holds: ".csv",
        what: "RCbenchmark 1585, a racing motor on a 6S battery: two staircases of one row a step, one run of fast steps.",
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "xnova-thrust-map",
        files: "tidy",
        holds: ".csv",
        what: "RCbenchmark stand, xNova motor on a 6S battery: one rotor alone (sr), and beside the others of a multirotor (mr), whose current is that of several motors. The authors state no licence: no figures. Their pool of rows without time is no run.",
        rigs: Rigs::Head(2),
        leaves_out: "pool",
        figures: false,
    },
];

impl Set {
    /// The set's files in order of name.
    pub(crate) fn files(&self, folder: &Path) -> Result<Vec<PathBuf>, String> {
        let folder = folder.join(self.files);
        if !folder.is_dir() {
            return Ok(Vec::new());
        }
        let left_out = |name: &str| !self.leaves_out.is_empty() && name.contains(self.leaves_out);
        let wanted =
            |name: &str| name.contains(self.holds) && name.ends_with(".csv") && !name.ends_with(".mocap.csv") && !left_out(name);
        let mut out = Vec::new();
        for entry in std::fs::read_dir(&folder).map_err(unread(&folder))? {
            let path = entry.map_err(|e| format!("{}: {e}", folder.display()))?.path();
            if path.file_name().is_some_and(|n| wanted(&n.to_string_lossy())) {
                out.push(path);
            }
        }
        out.sort();
        Ok(out)
    }

    /// Key of the rig that a run comes from.
    pub(crate) fn rig(&self, name: &str) -> String {
        match self.rigs {
            Rigs::Own => name.to_owned(),
            Rigs::One => self.folder.to_owned(),
            Rigs::Head(n) => name.chars().take(n).collect::<String>().split('.').next().unwrap_or_default().to_owned(),
            Rigs::After(word) => name.split_once(word).map_or(name, |(_, rest)| rest).to_owned(),
        }
    }

    /// A file as a log, and how many findings its import reported.
    pub(crate) fn read(&self, file: &Path) -> Result<(Log, usize), String> {
        let (mut log, report) = import(file, &[]).map_err(|e| short(&e.to_string()))?;
        // the same samples in the sender's own units: no covariates of their own
        log.columns.retain(|c| !c.name.ends_with("_raw"));
        Ok((log, report.notes.len()))
    }
}

/// A message without the folder, which differs from desk to desk.
fn short(message: &str) -> String {
    message.rsplit('/').next().unwrap_or(message).to_owned()
}
