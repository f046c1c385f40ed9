//! The channels of a flight.
//!
//! What it is: three specific forces, three angular accelerations, each rotor's speed, the voltage; with an attitude in the log the three
//! rates against its own turning, and with a magnetometer the field. All through the stated filter (`windows`).
//! What can go wrong: a channel without what it is predicted from is not made; why is said.
//! Units: m/s^2, rad/s^2, rad/s (rotors' speeds too), V, uT.
//! Reference: specification `flight.md`, "The loop on flights".

use super::record::{Axes, Record};
use super::windows::Windows;
use crate::attribution::columns::Channel;
use crate::attribution::columns::channel::FEWEST;
use crate::numeric::order::quantum;
use crate::verdict::words::digits;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// What a channel shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// Specific force along an axis.
    Force(usize),
    /// Angular acceleration about an axis.
    Turning(usize),
    /// Rate about an axis, less that of the attitude.
    Rate(usize),
    /// Speed of a rotor.
    Speed(usize),
    /// Supply voltage.
    Voltage,
    /// Field along an axis.
    Field(usize),
}

const AXES: [&str; 3] = ["x", "y", "z"];
/// Share of a reading to which one that never changes is told: three digits.
const FIGURES: f64 = 5e-3;
/// Share of a reading beneath which a change of it is the arithmetic's: a mean of a million doubles is off by less.
const ROUNDING: f64 = 1e-9;

impl Target {
    /// Name of the channel, that of the log's column where there is one.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Force(k) => format!("acc_{}", AXES[k]),
            Self::Turning(k) => format!("ang_acc_{}", AXES[k]),
            Self::Rate(k) => format!("gyro_{}", AXES[k]),
            Self::Speed(i) => format!("rpm_{}", i + 1),
            Self::Voltage => "voltage_v".to_owned(),
            Self::Field(k) => format!("mag_{}", AXES[k]),
        }
    }

    /// Unit.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Force(_) => "m/s^2",
            Self::Turning(_) => "rad/s^2",
            Self::Rate(_) => "rad/s",
            Self::Speed(_) => "rev/min",
            Self::Voltage => "V",
            Self::Field(_) => "uT",
        }
    }
}

/// The channels of a flight, and what is known of each row beforehand.
#[derive(Debug, Clone)]
pub struct Channels {
    /// What each shows.
    pub targets: Vec<Target>,
    /// Their readings.
    pub channels: Vec<Channel>,
    /// Channels that nothing predicts, each with the reason.
    pub not_predicted: Vec<(String, String)>,
    /// Mean rate of the attitude over each window, rad/s, where there is one.
    pub turned: Option<Axes>,
}

impl Channels {
    /// Of a record in its windows.
    #[must_use]
    pub fn of(record: &Record, windows: &Windows) -> Self {
        let mut made = Self { targets: Vec::new(), channels: Vec::new(), not_predicted: Vec::new(), turned: None };
        let layout = !record.vehicle.rotors.is_empty();
        made.turned = record.to_earth.as_ref().map(|r| turned(r, windows, record));
        for k in 0..3 {
            if let Some(force) = &record.force {
                made.push(
                    Target::Force(k),
                    windows,
                    windows.mean(&force[k]),
                    windows.floor_of_mean(&force[k]).max(resolution(&force[k])),
                );
            }
        }
        for k in 0..3 {
            let Some(rate) = &record.rate else { continue };
            if layout {
                made.push(Target::Turning(k), windows, windows.slope(&rate[k]), windows.floor_of_slope(&rate[k]));
            } else {
                made.leave_out(&Target::Turning(k).name(), "where the rotors sit is not known (metadata `layout` or `rotors_m`)");
            }
        }
        made.rates(record, windows);
        for (i, speed) in record.speed.iter().enumerate() {
            if record.command.is_empty() {
                made.leave_out(&Target::Speed(i).name(), "no pulse was logged");
            } else {
                let rpm: Vec<f64> = speed.iter().map(|w| w * super::RPM).collect();
                made.push(Target::Speed(i), windows, windows.mean(&rpm), windows.floor_of_mean(&rpm).max(resolution(&rpm)));
            }
        }
        if let Some(voltage) = &record.voltage {
            made.push(Target::Voltage, windows, windows.mean(voltage), windows.floor_of_mean(voltage).max(resolution(voltage)));
        }
        if record.current.is_some() {
            made.leave_out("current_a", "an input: the voltage follows from it");
        }
        if let (Some(field), Some(_)) = (&record.field, &record.to_earth) {
            for (k, values) in field.iter().enumerate() {
                made.push(Target::Field(k), windows, windows.mean(values), windows.floor_of_mean(values).max(resolution(values)));
            }
        }
        made
    }

    /// The gyro against the attitude of the log.
    fn rates(&mut self, record: &Record, windows: &Windows) {
        let (Some(rate), Some(turned)) = (&record.rate, self.turned.clone()) else { return };
        for k in 0..3 {
            let excess: Vec<f64> = windows.mean(&rate[k]).iter().zip(&turned[k]).map(|(w, t)| w - t).collect();
            // from window to window the attitude's own noise is seen twice
            let steps: Vec<f64> = excess.windows(2).map(|p| p[1] - p[0]).filter(|d| d.is_finite()).collect();
            let floor = (steps.iter().map(|d| d * d).sum::<f64>() / (2.0 * steps.len().max(1) as f64)).sqrt();
            self.push(Target::Rate(k), windows, excess, floor.max(windows.floor_of_mean(&rate[k])));
        }
    }

    fn push(&mut self, target: Target, windows: &Windows, y: Vec<f64>, floor: f64) {
        let size = y.iter().filter(|v| v.is_finite()).map(|v| v.abs()).fold(0.0, f64::max);
        if y.len() < FEWEST || y.iter().any(|v| !v.is_finite()) {
            self.leave_out(&target.name(), "too few readings in the air");
        } else if y.iter().all(|v| (v - y[0]).abs() <= ROUNDING * size) {
            self.leave_out(
                &target.name(),
                &format!("reads {} {} throughout: nothing to explain", digits(y[0], FIGURES * y[0].abs()), target.unit()),
            );
        } else {
            let floor = floor.max(ROUNDING * size).max(f64::MIN_POSITIVE);
            self.targets.push(target);
            self.channels.push(Channel { name: target.name(), unit: target.unit(), t: windows.t.clone(), y, floor });
        }
    }

    fn leave_out(&mut self, name: &str, why: &str) {
        self.not_predicted.push((name.to_owned(), why.to_owned()));
    }

    /// Position of a target.
    #[must_use]
    pub fn position(&self, target: Target) -> Option<usize> {
        self.targets.iter().position(|t| *t == target)
    }
}

/// Standard deviation that a display's steps leave.
fn resolution(values: &[f64]) -> f64 {
    quantum(values) / 12.0f64.sqrt()
}

/// Mean rate at which the attitude turns between the ends of each window, body axes; compared with the mean of the gyro over its rows.
fn turned(to_earth: &[Matrix3<f64>], windows: &Windows, record: &Record) -> Axes {
    let mut out: Axes = Default::default();
    for (a, b) in &windows.bounds {
        // half a row beyond each end, where there is one: a mean over n rows stands for n intervals
        let (from, to) = (a.saturating_sub(1), (*b).min(to_earth.len() - 1));
        let ends = |i: usize, j: usize| Rotation3::from_matrix_unchecked(to_earth[i].transpose() * to_earth[j]).scaled_axis();
        let inner = ends(*a, b - 1) / (record.t[b - 1] - record.t[*a]);
        let outer = ends(from, to) / (record.t[to] - record.t[from]);
        let rate: Vector3<f64> = if outer.iter().all(|v| v.is_finite()) { 0.5 * (inner + outer) } else { inner };
        (0..3).for_each(|k| out[k].push(rate[k]));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::columns::Flight;
    use super::super::standard::standard_flight;
    use super::*;

    /// A supply that never moves has no noise to hold an error against, and nothing to explain.
    #[test]
    fn a_reading_that_never_changes_is_not_predicted() {
        let mut log = standard_flight();
        let voltage = log.columns.iter_mut().find(|c| c.name == "voltage_v").unwrap();
        voltage.values.fill(11.5);
        let channels = Flight::of(Record::of(&log).unwrap()).channels;
        assert!(channels.position(Target::Voltage).is_none() && channels.position(Target::Speed(0)).is_some());
        let told = ("voltage_v".to_owned(), "reads 11.5 V throughout: nothing to explain".to_owned());
        assert!(channels.not_predicted.contains(&told), "{:?}", channels.not_predicted);
    }
}
