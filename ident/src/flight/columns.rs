//! Making columns: from values a row to what the channels see of them.
//!
//! What it is: a term says what it adds to a force, a moment or a reading, row by row; here it passes the stated filter and gets its place.
//! What can go wrong: a part for a channel that the flight lacks is dropped.
//! Units: those of the channels for an amplitude of one.
//! Reference: see `windows`, `attribution::design`.

use super::channels::{Channels, Target};
use super::record::Record;
use super::scene::{FORCE, GYRO, SPEED, Scene, delayed, followed};
use super::vibration::Shaking;
use super::windows::Windows;
use crate::attribution::columns::{Column, Owner, Prior, Values};
use crate::numeric::order::median;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Ratio of speeds at which one rotor gives twice the thrust of another.
const FAR: f64 = std::f64::consts::SQRT_2;

/// A flight in its windows, with the sizes that priors are made of.
#[derive(Debug, Clone)]
pub struct Flight {
    /// The flight row by row.
    pub record: Record,
    /// Its windows.
    pub windows: Windows,
    /// Its channels.
    pub channels: Channels,
    /// Usual sizes.
    pub usual: Usual,
    /// How much it shakes; `None` where that hardly changes.
    pub shaking: Option<Shaking>,
}

/// Usual sizes of what priors are made of: medians over the flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Usual {
    /// Sum of what drives the rotors, rad/s.
    pub sum: f64,
    /// Sum of its squares.
    pub squares: f64,
    /// Angular acceleration that the whole weight makes at an arm's length, rad/s^2.
    pub turning: f64,
    /// Length of an arm in the unit of the rotors' places.
    pub arm: f64,
    /// Speed of a rotor, rev/min.
    pub rpm: f64,
    /// Middle and spread of the commands, as a share of full.
    pub command: [f64; 2],
    /// Command at which the motors start, as a share of full: up to it they stand still.
    #[serde(default)]
    pub start: f64,
    /// Voltage, V, and current, A; 1 where there is none.
    pub supply: [f64; 2],
}

impl Flight {
    /// Of a record.
    #[must_use]
    pub fn of(record: Record) -> Self {
        let usable: Vec<bool> = (0..record.len()).map(|i| usable(&record, i)).collect();
        let windows = Windows::new(&record.t, &usable);
        let channels = Channels::of(&record, &windows);
        let usual = Usual::of(&record, &usable);
        let shaking = Shaking::of(&record, &windows);
        Self { record, windows, channels, usual, shaking }
    }

    /// The same flight row by row, for what is told as it was logged: each row whose inputs are known is a window of its own, on the ground too.
    /// Rows in which a rotor coasts make no claim.
    #[must_use]
    pub fn by_row(&self) -> Self {
        let record = self.record.clone();
        let coasts = record.coasts();
        let known = |i: usize| {
            let series = record.speed.iter().chain(&record.command).chain(&record.current);
            series.into_iter().all(|c| c[i].is_finite()) && record.voltage.as_ref().is_none_or(|v| v[i].is_finite())
        };
        let rows: Vec<usize> = (0..record.len()).filter(|i| known(*i) && !coasts[*i]).collect();
        let windows = Windows::each(&record.t, &rows);
        let channels = Channels::of(&record, &windows);
        Self { windows, channels, usual: self.usual, shaking: None, record }
    }
}

fn usable(record: &Record, i: usize) -> bool {
    let vectors = [&record.force, &record.rate, &record.velocity, &record.field];
    let series = record.speed.iter().chain(&record.command).chain(&record.height).chain(&record.current).chain(&record.voltage);
    record.flying[i]
        && vectors.into_iter().flatten().all(|v| v.iter().all(|axis| axis[i].is_finite()))
        && record.to_earth.as_ref().is_none_or(|r| r[i].m11.is_finite())
        && series.into_iter().all(|c| c[i].is_finite())
}

impl Usual {
    fn of(record: &Record, usable: &[bool]) -> Self {
        let rows: Vec<usize> = (0..record.len()).filter(|i| usable[*i]).collect();
        let middle = |of: &dyn Fn(usize) -> f64, absent: f64| {
            let mut values: Vec<f64> = rows.iter().map(|i| of(*i)).filter(|v| v.is_finite()).collect();
            if values.is_empty() { absent } else { median(&mut values) }
        };
        let drive = record.drive();
        // the sums of all rotors, as those say it whose speed can be theirs
        let believed = believed(record, &rows);
        let all = drive.len() as f64 / believed.len().max(1) as f64;
        let sum = |of: &dyn Fn(f64) -> f64, i: usize| all * believed.iter().map(|d| of(d[i])).sum::<f64>();
        let rotors = drive.len().max(1) as f64;
        let commands = record.command.len().max(1) as f64;
        let command = middle(&|i| record.command.iter().map(|c| c[i]).sum::<f64>() / commands, 0.5);
        let count = (rows.len() as f64 * commands).max(1.0);
        let square: f64 = rows.iter().flat_map(|i| record.command.iter().map(move |c| (c[*i] - command).powi(2))).sum();
        let vehicle = &record.vehicle;
        Self {
            sum: middle(&|i| sum(&|d| d, i), 1.0),
            squares: middle(&|i| sum(&|d| d * d, i), 1.0),
            turning: vehicle.usual_turning(),
            arm: vehicle.rotors.first().map_or(1.0, |r| r.x.hypot(r.y)),
            rpm: if record.speed.is_empty() { 0.0 } else { middle(&|i| sum(&|d| d, i) / rotors * super::RPM, 1.0) },
            command: [command, (square / count).sqrt().max(1e-3)],
            start: record.start,
            supply: [
                middle(&|i| record.voltage.as_ref().map_or(f64::NAN, |v| v[i]), 1.0),
                middle(&|i| record.current.as_ref().map_or(f64::NAN, |v| v[i]), 1.0).max(1e-3),
            ],
        }
    }
}

/// What drives the rotors, without the one whose speed cannot be its own: usually so far from the others' that it would give half or twice their
/// thrust, on which nothing flies level. Where more than one is, nobody can say which.
fn believed<'r>(record: &'r Record, rows: &[usize]) -> Vec<&'r Vec<f64>> {
    let drive = record.drive();
    let usual = |of: &Vec<f64>| {
        let mut values: Vec<f64> = rows.iter().map(|i| of[*i]).filter(|v| v.is_finite()).collect();
        if values.is_empty() { 0.0 } else { median(&mut values) }
    };
    let sizes: Vec<f64> = if record.speed.is_empty() { Vec::new() } else { drive.iter().map(usual).collect() };
    let is_far = |rotor: &usize| {
        let mut others: Vec<f64> = sizes.iter().enumerate().filter(|(k, _)| k != rotor).map(|(_, size)| *size).collect();
        let (own, theirs) = (sizes[*rotor], if others.is_empty() { 0.0 } else { median(&mut others) });
        own * FAR < theirs || own > FAR * theirs
    };
    let far: Vec<usize> = (0..sizes.len()).filter(is_far).collect();
    match far[..] {
        [out] if drive.len() > 2 => drive.iter().enumerate().filter(|(k, _)| *k != out).map(|(_, d)| d).collect(),
        _ => drive.iter().collect(),
    }
}

/// What drives a rotor by its command, through the rotor's lag if it has one, row by row; and whether it turns at that.
#[must_use]
pub fn driven(flight: &Flight, scene: &Scene<'_>, rotor: usize) -> Vec<(f64, bool)> {
    let record = scene.record;
    let command = &record.command[rotor];
    let behind = scene.lag.map(|lag| followed(&record.t, command, &lag));
    let start = flight.usual.start;
    behind.as_ref().unwrap_or(command).iter().map(|u| (*u, *u > start)).collect()
}

/// Where the columns of one term come together.
pub struct Sink<'s> {
    /// The flight.
    pub flight: &'s Flight,
    /// What acts, as the whole hypothesis has it.
    pub scene: &'s Scene<'s>,
    /// Identifiers of the terms before this one.
    pub before: &'s [&'static str],
    owner: Owner,
    out: Vec<Column>,
}

impl<'s> Sink<'s> {
    /// For a term.
    #[must_use]
    pub fn new(flight: &'s Flight, scene: &'s Scene<'s>, before: &'s [&'static str], owner: Owner) -> Self {
        Self { flight, scene, before, owner, out: Vec::new() }
    }

    /// Begins a column; what [`Self::part`] adds belongs to it.
    pub fn column(&mut self, name: &'static str, prior: Prior) -> &mut Self {
        self.out.push(Column { owner: self.owner, name, prior, parts: Vec::new() });
        self
    }

    /// What the column adds to a channel, a value a row, where the rotors' speeds say it.
    pub fn part(&mut self, target: Target, rows: &[f64]) -> &mut Self {
        self.said_by(SPEED, target, rows)
    }

    /// What the column adds to a channel, a value a row, where the readings of the sensor at `source` say it: these are late themselves.
    pub fn said_by(&mut self, source: usize, target: Target, rows: &[f64]) -> &mut Self {
        let Some(channel) = self.flight.channels.position(target) else { return self };
        let (windows, t) = (&self.flight.windows, &self.flight.record.t);
        let behind = |sensor: usize| self.behind(sensor, source, rows);
        let seen = match target {
            Target::Force(_) => windows.mean(&behind(FORCE)),
            Target::Turning(_) => windows.slope_of_rate(&behind(GYRO)),
            Target::Speed(_) if self.scene.late[SPEED] != 0.0 => windows.mean(&delayed(t, rows, self.scene.late[SPEED])),
            _ => windows.mean(rows),
        };
        self.seen(channel, seen)
    }

    /// What the sensor at `source` says, row by row, as late as the one at `sensor` is.
    #[must_use]
    pub fn behind(&self, sensor: usize, source: usize, rows: &[f64]) -> Vec<f64> {
        let late = self.scene.late;
        delayed(&self.flight.record.t, rows, late[sensor] - late[source])
    }

    /// What the column adds to a channel of which a value a window is known already.
    pub fn window(&mut self, target: Target, values: Vec<f64>) -> &mut Self {
        match self.flight.channels.position(target) {
            Some(channel) => self.seen(channel, values),
            None => self,
        }
    }

    fn seen(&mut self, channel: usize, values: Vec<f64>) -> &mut Self {
        if let Some(column) = self.out.last_mut() {
            match column.parts.iter_mut().find(|(c, _)| *c == channel) {
                Some((_, old)) => *old = Arc::new(old.iter().zip(&values).map(|(a, b)| a + b).collect()),
                None => column.parts.push((channel, Arc::new(values) as Values)),
            }
        }
        self
    }

    /// The same constant in a channel.
    pub fn constant(&mut self, target: Target) -> &mut Self {
        let n = self.flight.windows.len();
        self.window(target, vec![1.0; n])
    }

    /// The columns.
    #[must_use]
    pub fn done(self) -> Vec<Column> {
        self.out
    }
}

#[cfg(test)]
mod tests {
    use super::super::standard::standard_flight;
    use super::*;

    /// A speed channel that reads half or one and a half of its rotor's speed does not move the sizes that coefficients are told in.
    #[test]
    fn a_broken_speed_channel_leaves_the_usual_sizes() {
        let usual = |factor: f64| {
            let mut log = standard_flight();
            let of_rotor = log.columns.iter_mut().find(|c| c.name == "rpm_2").unwrap();
            of_rotor.values.iter_mut().for_each(|v| *v *= factor);
            Flight::of(Record::of(&log).unwrap()).usual
        };
        let whole = usual(1.0);
        for factor in [0.5, 1.5, 2.0] {
            let broken = usual(factor);
            for (got, want) in [(broken.sum, whole.sum), (broken.squares, whole.squares), (broken.rpm, whole.rpm)] {
                assert!((got / want - 1.0).abs() < 0.03, "{factor}: {got} {want}");
            }
        }
        // what a rotor may well do is taken as it is
        assert!((usual(1.1).sum / whole.sum - 1.025).abs() < 0.01);
    }
}
