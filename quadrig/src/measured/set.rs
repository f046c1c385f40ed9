//! The recorded sets: where their files lie, how they are read, which runs share a rig.
//!
//! What it is: one entry a folder of `DATA/rig`, with the authors' own words on the rig in brief.
//! What can go wrong: an absent folder is no set of files: the page then says so.
//! Units: converted on import; flights become one equivalent rotor (see [`Kind::Flight`]).
//! Reference: the `README.md` of each set.

use ident::import::{Mapping, import};
use ident::log::{Column, Log};
use std::path::{Path, PathBuf};

/// How a set's files are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    /// By the importer as they are.
    Stand,
    /// A flight: the vehicle as one rotor. `thrust_n` is the specific force along the body's z axis times the mass, `rpm` the root
    /// mean square of the four speeds, `pulse_us` their mean command; the estimated velocity goes along as covariates.
    Flight {
        /// Mass with battery, kg; 1 where it is not known, thrust then being N/kg.
        mass_kg: f64,
        /// Columns of commands begin with this.
        command: &'static str,
    },
}

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
    /// How the files are read.
    pub(crate) kind: Kind,
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
pub(crate) const SETS: [Set; 11] = [
    Set {
        folder: "spitz-esc-test",
        files: "original",
        holds: "Log_",
        what: "RCbenchmark stand, three motors with three ESCs, one three-bladed 7-inch propeller, the stand's own exports. Three rigs on one stand: what the stand does must come back, what a motor does need not.",
        kind: Kind::Stand,
        rigs: Rigs::Own,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "lever-rig-10x45",
        files: "tidy",
        holds: ".csv",
        what: "Lever-arm load cell, 760 KV motor with a 10x4.5 propeller, one rig at four supply voltages. The authors logged no time: it is reconstructed to about 20 %, and so are rates and time constants.",
        kind: Kind::Stand,
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "crazyflie-stand",
        files: "tidy",
        holds: ".csv",
        what: "Crazyflie 2.1 upside down on a scale, all four rotors together, 1S battery. No time column: rows are counted, and no effect of time is offered.",
        kind: Kind::Stand,
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "uiuc-static",
        files: "",
        holds: ".csv",
        what: "APC Slow Flyer 9x4.7 of the UIUC propeller data site: sixteen rows of coefficients, thrust and torque computed from them.",
        kind: Kind::Stand,
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "fivein-static-tables",
        files: "tidy",
        holds: ".csv",
        what: "Static sweeps of eleven points, motors (letter) by five-inch propellers (digit) by two supply voltages: two runs of each rig.",
        kind: Kind::Stand,
        rigs: Rigs::Head(2),
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "crazyflie-flights",
        files: "",
        holds: "brush",
        what: "Figure-of-eight flights with four rotor speeds and an IMU. Not a rig: the vehicle is read as one rotor, its specific force times its mass against the root mean square of the four speeds.",
        kind: Kind::Flight { mass_kg: 0.037, command: "pwm_m" },
        rigs: Rigs::Head(9),
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "arpl-crazyflie-flights",
        files: "",
        holds: "log",
        what: "Excitation flight of a Crazyflie at 1 kHz with IMU and motor commands, without rotor speeds.",
        kind: Kind::Flight { mass_kg: 1.0, command: "motor_m" },
        rigs: Rigs::Own,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "dualcell-eco2814c",
        files: "tidy",
        holds: ".csv",
        what: "Two bar load cells (thrust, torque), one motor with 10- and 12-inch propellers, lithium batteries, speed and temperature from the ESC's telemetry. A rig is a propeller and a battery; two of them were measured in two sessions. The file has no time stamps: rows are taken as 0.1 s.",
        kind: Kind::Stand,
        rigs: Rigs::After("v2_"),
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "stand1585-micro",
        files: "tidy",
        holds: ".csv",
        what: "RCbenchmark 1585, a small motor on a 4S battery, two days: staircases of one row a step, and fast steps logged throughout.",
        kind: Kind::Stand,
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "stand1585-sov5",
        files: "tidy",
        holds: ".csv",
        what: "RCbenchmark 1585, a racing motor on a 6S battery: two staircases of one row a step, one run of fast steps.",
        kind: Kind::Stand,
        rigs: Rigs::One,
        leaves_out: "",
        figures: true,
    },
    Set {
        folder: "xnova-thrust-map",
        files: "tidy",
        holds: ".csv",
        what: "RCbenchmark stand, xNova motor on a 6S battery: one rotor alone (sr), and beside the others of a multirotor (mr), whose current is that of several motors. The authors state no licence: no figures. Their pool of rows without time is no run.",
        kind: Kind::Stand,
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
        for entry in std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))? {
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
        match self.kind {
            Kind::Stand => {
                let (mut log, report) = import(file, &[]).map_err(|e| short(&e.to_string()))?;
                // the same samples in the sender's own units: no covariates of their own
                log.columns.retain(|c| !c.name.ends_with("_raw"));
                Ok((log, report.notes.len()))
            }
            Kind::Flight { mass_kg, command } => flight(file, self.mass(file, mass_kg), command),
        }
    }

    /// The brushed vehicle weighs 34.7 g.
    fn mass(&self, file: &Path, given: f64) -> f64 {
        let brushed = file.file_name().is_some_and(|n| n.to_string_lossy().starts_with("brushed"));
        if brushed { 0.0347 } else { given }
    }
}

/// A message without the folder, which differs from desk to desk.
fn short(message: &str) -> String {
    message.rsplit('/').next().unwrap_or(message).to_owned()
}

fn flight(file: &Path, mass_kg: f64, command: &str) -> Result<(Log, usize), String> {
    let mut mappings =
        vec![Mapping { target: "thrust_n".into(), source: "acc.z".into(), factor: 9.806_65 * mass_kg, offset: 0.0 }];
    let header = std::fs::read_to_string(file).map_err(|e| e.to_string())?.lines().next().unwrap_or_default().to_owned();
    let second = if header.contains("pm.vbatMV") { ("voltage_v", "pm.vbatMV", 1.0e-3) } else { ("pulse_us", "motor.m1", 1.0) };
    mappings.push(Mapping { target: second.0.into(), source: second.1.into(), factor: second.2, offset: 0.0 });
    let (mut log, report) = import(file, &mappings).map_err(|e| short(&e.to_string()))?;
    let starting = |log: &Log, head: &str| -> Vec<Vec<f64>> {
        log.columns.iter().filter(|c| c.name.starts_with(head)).map(|c| c.values.clone()).collect()
    };
    let (speeds, mut commands) = (starting(&log, "rpm_m"), starting(&log, command));
    commands.extend(log.column("pulse_us").map(<[f64]>::to_vec));
    let mean = |of: &[Vec<f64>], i: usize, power: i32| -> f64 {
        (of.iter().map(|c| c[i].powi(power)).sum::<f64>() / of.len() as f64).powf(1.0 / f64::from(power))
    };
    let velocity: Vec<Vec<f64>> =
        ["est_vx", "est_vy", "est_vz"].iter().filter_map(|n| log.column(n).map(<[f64]>::to_vec)).collect();
    log.columns.retain(|c| ["thrust_n", "voltage_v"].contains(&c.name.as_str()));
    let rows = 0..log.t.len();
    let mut push = |name: &str, values: Vec<f64>| log.columns.push(Column { name: name.into(), values });
    if !commands.is_empty() {
        push("pulse_us", rows.clone().map(|i| 1000.0 + mean(&commands, i, 1) / 65.535).collect());
    }
    if !speeds.is_empty() {
        push("rpm", rows.clone().map(|i| mean(&speeds, i, 2)).collect());
    }
    if velocity.len() == 3 {
        push("speed_mps", rows.clone().map(|i| velocity.iter().map(|v| v[i] * v[i]).sum::<f64>().sqrt()).collect());
        push("climb_mps", velocity[2].clone());
    }
    Ok((log, report.notes.len()))
}
