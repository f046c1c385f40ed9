//! A flight log as arrays: what was measured, in the units of the equations.
//!
//! What it is: rotor speeds in rad/s, commands as a share of full, vectors by axis, velocity turned into body axes; short holes in what is
//! only looked up are bridged; rows on the ground are marked.
//! What can go wrong: a log without specific force and without rate, or without rotors, is refused; a column that holds nothing counts as absent.
//! Units: SI; rad/s.
//! Reference: specification `flight.md`, "Flight log".

use super::FlightError;
use super::channels::Target;
use super::vehicle::Vehicle;
use crate::log::Log;
use crate::log::flight_log::rotors;
use crate::numeric::order::median;
use crate::signal::start::{TURNS, start_pulse};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Longest hole that is bridged in what is looked up, s.
const HOLE_S: f64 = 0.1;
/// Below this share of the usual thrust a vehicle that does not move stands on the ground.
const STANDS: f64 = 0.9;
/// Slower than this it does not move, m/s and rad/s.
const STILL: (f64, f64) = (0.05, 0.1);
/// Largest share of rotors' speed squared at which nothing flies.
const IDLE: f64 = 0.3;
/// Distance of a single reading from its neighbours, in their own scatter, from which it is set aside.
const SPIKE: f64 = 12.0;

/// Three values a row, by axis.
pub type Axes = [Vec<f64>; 3];

/// A single reading that nothing beside it bears out.
#[derive(Debug, Clone, PartialEq)]
pub struct Spike {
    /// Column.
    pub channel: String,
    /// Row, counted from 0.
    pub row: usize,
    /// What stood there.
    pub value: f64,
    /// What its neighbours say.
    pub expected: f64,
}

/// A flight.
#[derive(Debug, Clone)]
pub struct Record {
    /// Name of the log.
    pub name: String,
    /// Times, s.
    pub t: Vec<f64>,
    /// The vehicle.
    pub vehicle: Vehicle,
    /// Speed of each rotor, rad/s; empty where none was measured.
    pub speed: Vec<Vec<f64>>,
    /// Command of each rotor as a share of full (1000 us is 0, 2000 us is 1); empty where none was logged.
    pub command: Vec<Vec<f64>>,
    /// Specific force, m/s^2.
    pub force: Option<Axes>,
    /// Rate, rad/s.
    pub rate: Option<Axes>,
    /// Field, uT (columns `mag_x`, `mag_y`, `mag_z`).
    pub field: Option<Axes>,
    /// Body to earth.
    pub to_earth: Option<Vec<Matrix3<f64>>>,
    /// Velocity over ground in body axes, m/s.
    pub velocity: Option<Axes>,
    /// Height over the log's zero, m.
    pub height: Option<Vec<f64>>,
    /// Supply, V.
    pub voltage: Option<Vec<f64>>,
    /// Current, A.
    pub current: Option<Vec<f64>>,
    /// Temperature, degC.
    pub temperature: Option<Vec<f64>>,
    /// Rows in the air.
    pub flying: Vec<bool>,
    /// Command at which the motors start, as a share of full: up to it none is driven.
    pub start: f64,
    /// Single readings that were set aside.
    pub spikes: Vec<Spike>,
}

impl Record {
    /// From a log.
    ///
    /// # Errors
    /// A log that holds neither specific force nor rate, or neither speeds nor commands of its rotors; a speed that reads nothing while another
    /// rotor turns; metadata that cannot be read.
    pub fn of(log: &Log) -> Result<Self, FlightError> {
        let lacks = |reason: &str| FlightError::Lacks { name: log.name.clone(), reason: reason.to_owned() };
        let vehicle = Vehicle::of(log).map_err(|reason| FlightError::Meta { name: log.name.clone(), reason })?;
        let (cleaned, spikes) = without_spikes(log);
        let log = &cleaned;
        let count = if vehicle.rotors.is_empty() { rotors(log) } else { vehicle.rotors.len() };
        let each = |prefix: &str, to: &dyn Fn(f64) -> f64| -> Vec<Vec<f64>> {
            let all: Option<Vec<Vec<f64>>> = (1..=count).map(|i| looked_up(log, &format!("{prefix}{i}"))).collect();
            all.map_or_else(Vec::new, |all| all.into_iter().map(|c| c.into_iter().map(to).collect()).collect())
        };
        let speed = each("rpm_", &|rpm| rpm * TAU / 60.0);
        let command = each("pulse_us_", &|us| (us - 1000.0) / 1000.0);
        let (force, rate) = (measured(log, "acc"), measured(log, "gyro"));
        if speed.is_empty() && command.is_empty() {
            return Err(lacks(
                "neither the speeds nor the pulses of all its rotors; expected columns rpm_1, ... or pulse_us_1, ...: log one of them",
            ));
        }
        if force.is_none() && rate.is_none() {
            return Err(lacks("neither specific force nor rate; expected columns acc_x, ... or gyro_x, ...: log one of them"));
        }
        if let Some(rotor) = silent(&speed) {
            return Err(FlightError::Silent { name: log.name.clone(), column: Target::Speed(rotor).name() });
        }
        let to_earth = attitude(log);
        let velocity = to_earth.as_ref().and_then(|to_earth| Some(in_body(to_earth, &vector(log, "vel", looked_up)?)));
        let mut record = Self {
            name: log.name.clone(),
            t: log.t.clone(),
            vehicle,
            speed,
            command,
            force,
            rate,
            field: measured(log, "mag"),
            to_earth,
            velocity,
            height: looked_up(log, "pos_z").map(|z| z.into_iter().map(|z| -z).collect()),
            voltage: present(log, "voltage_v"),
            current: looked_up(log, "current_a"),
            temperature: looked_up(log, "temp_c"),
            flying: Vec::new(),
            start: 0.0,
            spikes,
        };
        record.start = record.starts_at();
        record.flying = record.in_the_air();
        Ok(record)
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Number of rotors.
    #[must_use]
    pub fn rotors(&self) -> usize {
        self.speed.len().max(self.command.len())
    }

    /// Readings of a channel that is told as it was logged, in its unit; nothing for others.
    #[must_use]
    pub fn logged(&self, target: Target) -> Vec<f64> {
        match target {
            Target::Speed(i) => self.speed[i].iter().map(|w| w * super::RPM).collect(),
            Target::Voltage => self.voltage.clone().unwrap_or_default(),
            _ => Vec::new(),
        }
    }

    /// What thrust goes with: each rotor's speed, or its command where no speed was measured.
    #[must_use]
    pub fn drive(&self) -> &[Vec<f64>] {
        if self.speed.is_empty() { &self.command } else { &self.speed }
    }

    /// Sum of the squares of what drives the rotors.
    fn squares(&self) -> Vec<f64> {
        (0..self.len()).map(|i| self.drive().iter().map(|d| d[i] * d[i]).sum()).collect()
    }

    /// Command at which the motors start, read off the mean of all rotors: the rows on the ground are what shows it. Where no motor stands still it is
    /// that of every speed controller.
    fn starts_at(&self) -> f64 {
        if self.speed.is_empty() || self.command.is_empty() {
            return 0.0;
        }
        let mean = |of: &[Vec<f64>], row: usize| of.iter().map(|c| c[row]).sum::<f64>() / of.len() as f64;
        let known = |row: &usize| mean(&self.command, *row).is_finite() && mean(&self.speed, *row).is_finite();
        let rows: Vec<usize> = (0..self.len()).filter(known).collect();
        let of = |value: &dyn Fn(usize) -> f64| rows.iter().map(|row| value(*row)).collect::<Vec<f64>>();
        let pulse = of(&|row| 1000.0 + 1000.0 * mean(&self.command, row));
        (start_pulse(&of(&|row| self.t[row]), Some(&pulse), &of(&|row| mean(&self.speed, row))) - 1000.0) / 1000.0
    }

    /// For each row whether a rotor coasts: nothing drives it, and it still turns. How it slows down then is the air's to say, not the pulse's.
    #[must_use]
    pub fn coasts(&self) -> Vec<bool> {
        let mut out = vec![false; self.len()];
        for (speed, command) in self.speed.iter().zip(&self.command) {
            let least = TURNS * speed.iter().copied().fold(0.0, f64::max);
            out.iter_mut().enumerate().for_each(|(i, coasts)| *coasts |= command[i] <= self.start && speed[i] > least);
        }
        out
    }

    /// Whether no motor is driven at a row.
    fn is_cut(&self, row: usize) -> bool {
        !self.speed.is_empty() && !self.command.is_empty() && self.command.iter().all(|c| c[row] <= self.start)
    }

    /// A vehicle whose rotors idle or are cut, or that does not move while they carry less than usual, is not in the air.
    fn in_the_air(&self) -> Vec<bool> {
        let squares = self.squares();
        let mut known: Vec<f64> = squares.iter().copied().filter(|s| s.is_finite()).collect();
        let usual = median(&mut known);
        let size = |of: &Option<Axes>, i: usize| of.as_ref().map(|v| Vector3::new(v[0][i], v[1][i], v[2][i]).norm());
        let still = |i: usize| {
            let slow = size(&self.velocity, i).is_some_and(|v| v < STILL.0);
            slow && size(&self.rate, i).is_none_or(|w| w < STILL.1)
        };
        (0..self.len())
            .map(|i| squares[i] > IDLE * usual && !self.is_cut(i) && !(squares[i] < STANDS * usual && still(i)))
            .collect()
    }
}

/// The first rotor whose speed reads nothing in any row, where another one turns.
fn silent(speed: &[Vec<f64>]) -> Option<usize> {
    let turns = |of: &Vec<f64>| of.iter().any(|w| w.is_finite() && *w != 0.0);
    speed.iter().any(turns).then(|| speed.iter().position(|s| !turns(s)))?
}

/// A column with at least one reading.
fn present(log: &Log, name: &str) -> Option<Vec<f64>> {
    log.column(name).filter(|c| c.iter().any(|v| v.is_finite())).map(<[f64]>::to_vec)
}

/// The same with short holes bridged.
fn looked_up(log: &Log, name: &str) -> Option<Vec<f64>> {
    let mut values = present(log, name)?;
    let known: Vec<usize> = (0..values.len()).filter(|i| values[*i].is_finite()).collect();
    for pair in known.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let span = log.t[b] - log.t[a];
        if b > a + 1 && span <= HOLE_S {
            for i in a + 1..b {
                values[i] = values[a] + (values[b] - values[a]) * (log.t[i] - log.t[a]) / span;
            }
        }
    }
    Some(values)
}

fn vector(log: &Log, name: &str, of: fn(&Log, &str) -> Option<Vec<f64>>) -> Option<Axes> {
    let mut axes = ["x", "y", "z"].map(|axis| of(log, &format!("{name}_{axis}")));
    axes.iter().all(Option::is_some).then(|| axes.each_mut().map(|a| a.take().unwrap_or_default()))
}

fn measured(log: &Log, name: &str) -> Option<Axes> {
    vector(log, name, looked_up)
}

fn attitude(log: &Log) -> Option<Vec<Matrix3<f64>>> {
    let [w, x, y, z] = ["qw", "qx", "qy", "qz"].map(|n| present(log, n));
    let (w, x, y, z) = (w?, x?, y?, z?);
    let turn = |i: usize| {
        let q = Quaternion::new(w[i], x[i], y[i], z[i]);
        if q.norm() > 0.5 {
            UnitQuaternion::from_quaternion(q).to_rotation_matrix().into_inner()
        } else {
            Matrix3::repeat(f64::NAN)
        }
    };
    Some((0..log.len()).map(turn).collect())
}

fn in_body(to_earth: &[Matrix3<f64>], velocity: &Axes) -> Axes {
    let body: Vec<Vector3<f64>> = to_earth
        .iter()
        .enumerate()
        .map(|(i, r)| r.transpose() * Vector3::new(velocity[0][i], velocity[1][i], velocity[2][i]))
        .collect();
    std::array::from_fn(|k| body.iter().map(|v| v[k]).collect())
}

/// The log without single readings that are far from both neighbours, which agree.
fn without_spikes(log: &Log) -> (Log, Vec<Spike>) {
    let mut out = log.clone();
    let mut spikes = Vec::new();
    for column in &mut out.columns {
        let measured = ["rpm_", "acc_", "gyro_", "mag_"].iter().any(|p| column.name.starts_with(p)) || column.name == "voltage_v";
        if !measured {
            continue;
        }
        // distance of each reading from the mean of its neighbours, and of these from each other
        let v = &column.values;
        let away = |i: usize| v[i] - 0.5 * (v[i - 1] + v[i + 1]);
        let inner = 1..v.len().saturating_sub(1);
        let mut sizes: Vec<f64> = inner.clone().map(|i| away(i).abs()).filter(|d| d.is_finite()).collect();
        let usual = sizes.iter().sum::<f64>() / sizes.len().max(1) as f64;
        let typical = median(&mut sizes).max(0.1 * usual);
        let found: Vec<usize> = inner
            .filter(|i| away(*i).abs() > SPIKE * typical && (v[i - 1] - v[i + 1]).abs() < 0.25 * away(*i).abs() && typical > 0.0)
            .collect();
        for i in found {
            let expected = 0.5 * (v[i - 1] + v[i + 1]);
            spikes.push(Spike { channel: column.name.clone(), row: i, value: column.values[i], expected });
        }
        let own = spikes.iter().filter(|s| s.channel == column.name).map(|s| s.row).collect::<Vec<_>>();
        own.into_iter().for_each(|i| column.values[i] = f64::NAN);
    }
    (out, spikes)
}

#[cfg(test)]
mod tests {
    use super::super::standard::standard_flight;
    use super::*;

    /// After the motors are cut the rotors coast: by no pulse, and not in the air, however fast they still turn.
    #[test]
    fn a_rotor_without_drive_coasts() {
        let mut log = standard_flight();
        let (rows, cut) = (log.t.len(), log.t.len() - 300);
        for column in &mut log.columns {
            if column.name.starts_with("rpm_") {
                let from = column.values[cut];
                (cut..rows).for_each(|i| column.values[i] = (from * (1.0 - (i - cut) as f64 / 200.0)).max(0.0));
            } else if column.name.starts_with("pulse_us_") {
                column.values[cut..].fill(1000.0);
            }
        }
        let record = Record::of(&log).unwrap();
        let coasts = record.coasts();
        assert!(record.start > 0.0 && !coasts[cut - 1] && (cut..cut + 190).all(|i| coasts[i]) && !coasts[rows - 1]);
        assert!(record.flying[cut - 1] && !record.flying[cut] && record.speed[0][cut] > 0.99 * record.speed[0][cut - 1]);
    }

    #[test]
    fn a_speed_that_reads_nothing_is_named() {
        let mut log = standard_flight();
        let at = |log: &Log, name: &str| log.columns.iter().position(|c| c.name == name).unwrap();
        let (dead, rows) = (at(&log, "rpm_2"), 100..200);
        let whole = log.columns[dead].values.clone();
        log.columns[dead].values.fill(0.0);
        let said = Record::of(&log).unwrap_err().to_string();
        assert!(said.contains("column rpm_2: reads nothing while the others turn; expected"), "{said}");
        // one that is silent for a time is another matter, and so is one that is taken out: the pulses speak then
        log.columns[dead].values[rows.clone()].copy_from_slice(&whole[rows]);
        assert!(Record::of(&log).is_ok());
        log.columns.remove(dead);
        assert!(Record::of(&log).unwrap().speed.is_empty());
    }
}
