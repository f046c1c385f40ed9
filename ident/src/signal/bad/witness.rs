//! Who bears witness for a channel, and what is expected of it.
//!
//! What it is: the other speed channels for a speed, the speed for thrust, torque and current, the command where neither is there; each
//! through a curve of its own, torque and current with what speeding the rotor up takes. What was found bad of one channel is bridged before the next one is judged by it.
//! What can go wrong: a log of one channel has no witness but its own time.
//! Units: rows, s, the channel's own.
//! Reference: specification `closing-the-loop.md`, step 2 (relations between channels).

use super::curve::Curve;
use super::excursion::Event;
use crate::log::{Log, SPEED};
use crate::numeric::order::median;
use crate::signal::drive::acceleration_of_rows;
use crate::signal::stretches::{CALM_US, GAP, bridge};
use std::collections::BTreeMap;

/// Change of a regressor within two rows, as a share of its span, that is a step where no command was logged.
const STEP: f64 = 0.02;

/// Channels that rise while the rotor speeds up, beyond their curves: its inertia takes torque, and torque takes current.
const ACCELERATES: [&str; 2] = ["torque_nm", "current_a"];

/// The log as far as it has been judged.
pub(super) struct Witnesses<'l> {
    pub(super) log: &'l Log,
    /// Time, s; rows of a log without are taken to be a twentieth of a second apart.
    pub(super) t: Vec<f64>,
    /// Readings without those that were found bad.
    clean: BTreeMap<&'static str, Vec<f64>>,
    pulse: Option<Vec<f64>>,
    /// Median time step, s.
    step: f64,
}

/// One channel's samples with what is expected of them.
pub(super) struct Case {
    /// Row of each sample.
    pub(super) rows: Vec<usize>,
    /// The reading.
    pub(super) y: Vec<f64>,
    /// What the first witness says, on every row of the log; nothing where there is none.
    pub(super) said: Vec<f64>,
    /// Reading less that.
    pub(super) r: Vec<f64>,
    /// The first rows of steps of the load, in order, and whether time has a gap there.
    pub(super) steps: Vec<(usize, bool)>,
    /// Whether the first witness knows at once what the rotor does: a command or another speed.
    pub(super) prompt: bool,
    /// What further witnesses say.
    pub(super) others: Vec<Vec<f64>>,
    /// What the command says where it is not the first witness; nothing where there is none.
    pub(super) commanded: Vec<f64>,
}

impl<'l> Witnesses<'l> {
    /// All channels as they are.
    pub(super) fn of(log: &'l Log) -> Self {
        let clean = super::judged().filter_map(|name| Some((name, log.column(name)?.to_vec()))).collect();
        let measured = |c: &&[f64]| c.iter().any(|v| v.is_finite());
        let pulse = log.column("pulse_us").filter(measured).map(|c| bridge(&log.t, c));
        let mut steps: Vec<f64> = log.t.windows(2).map(|w| w[1] - w[0]).collect();
        let step = if steps.is_empty() { 1.0 } else { median(&mut steps) };
        let t = if log.time_is_row() { (0..log.len()).map(|i| 0.05 * i as f64).collect() } else { log.t.clone() };
        Self { log, t, clean, pulse, step }
    }

    /// A channel's readings without those that were found bad.
    pub(super) fn clean(&self, name: &str) -> Option<&[f64]> {
        self.clean.get(name).map(Vec::as_slice)
    }

    /// The command on every row, where there is one.
    pub(super) fn pulse(&self) -> Option<&[f64]> {
        self.pulse.as_deref()
    }

    /// Leaves these rows of a channel out.
    pub(super) fn take_out(&mut self, name: &'static str, events: &[Event]) {
        if let Some(values) = self.clean.get_mut(name) {
            events.iter().for_each(|e| values[e.rows.clone()].fill(f64::NAN));
        }
    }

    /// Leaves these rows of a channel out and no others.
    pub(super) fn settle(&mut self, name: &'static str, events: &[Event]) {
        if let Some(column) = self.log.column(name) {
            self.clean.insert(name, column.to_vec());
        }
        self.take_out(name, events);
    }

    /// What is expected of a channel, further witnesses included where they are asked for.
    pub(super) fn case(&self, name: &'static str, with_others: bool) -> Option<Case> {
        let column = self.clean.get(name)?;
        let rows: Vec<usize> = (0..column.len()).filter(|i| column[*i].is_finite()).collect();
        if rows.len() < super::FEWEST {
            return None;
        }
        let y: Vec<f64> = rows.iter().map(|i| column[*i]).collect();
        let signals = self.signals(name);
        let later = self.pulse.as_ref().filter(|p| with_others && signals.first() != Some(*p));
        let commanded = later.and_then(|p| self.through(&rows, &y, p)).unwrap_or_default();
        let mut signals = signals.into_iter();
        let first = signals.find_map(|signal| Some((self.through(&rows, &y, &signal)?, signal)));
        let (mut said, signal) = first.unwrap_or_default();
        if ACCELERATES.contains(&name)
            && let Some(speed) = self.speed(name)
        {
            let takes = acceleration_of_rows(&self.log.t, &speed, self.step);
            let left: Vec<f64> = rows.iter().zip(&y).map(|(i, y)| y - said.get(*i).copied().unwrap_or(0.0)).collect();
            add_share(&mut said, &rows, &left, &takes);
        }
        let r = if said.is_empty() { y.clone() } else { rows.iter().zip(&y).map(|(i, y)| y - said[*i]).collect() };
        let others = if with_others { signals.filter_map(|s| self.through(&rows, &y, &s)).collect() } else { Vec::new() };
        let prompt = self.pulse.is_some() || SPEED.contains(&name) && self.speed(name).is_some();
        Some(Case { steps: self.steps(&signal), prompt, rows, y, said, r, others, commanded })
    }

    /// What a curve through a signal says on every row.
    fn through(&self, rows: &[usize], y: &[f64], signal: &[f64]) -> Option<Vec<f64>> {
        let curve = Curve::through(rows.iter().zip(y).map(|(i, y)| (signal[*i], *y)).collect())?;
        Some(signal.iter().map(|x| curve.at(*x)).collect())
    }

    /// The signals that bear witness for a channel, the best first. The command is a witness only where it is the first: at its steps
    /// the rotor comes later.
    fn signals(&self, name: &str) -> Vec<Vec<f64>> {
        let speeds = self.speed(name);
        let follows = |names: &[&str]| names.iter().filter(|n| **n != name).filter_map(|n| self.measured(n)).collect::<Vec<_>>();
        let load = ["thrust_n", "torque_nm", "current_a"];
        let mut out = Vec::new();
        if name == "voltage_v" {
            out.extend(follows(&["current_a"]));
        }
        if name != "temp_c" {
            out.extend(speeds);
        }
        if out.is_empty() {
            out.extend(self.pulse.clone());
        }
        if name != "temp_c" && name != "voltage_v" {
            out.extend(follows(&load));
        }
        out
    }

    /// Median of the speed channels but this one, bridged.
    fn speed(&self, but: &str) -> Option<Vec<f64>> {
        let channels: Vec<&Vec<f64>> = SPEED.iter().filter(|s| **s != but).filter_map(|s| self.clean.get(s)).collect();
        let of = |i: usize| {
            let mut values: Vec<f64> = channels.iter().map(|c| c[i]).filter(|v| v.is_finite()).collect();
            median(&mut values)
        };
        let values: Vec<f64> = if let [only] = channels[..] { only.clone() } else { (0..self.log.len()).map(of).collect() };
        self.bridged(&values)
    }

    fn measured(&self, name: &str) -> Option<Vec<f64>> {
        self.bridged(self.clean.get(name)?)
    }

    fn bridged(&self, values: &[f64]) -> Option<Vec<f64>> {
        let samples = values.iter().filter(|v| v.is_finite()).count();
        (samples >= super::FEWEST).then(|| bridge(&self.log.t, values))
    }

    /// First rows of the steps of the command; none without one.
    pub(super) fn jumps(&self) -> Vec<usize> {
        let jumps = |p: &[f64], i: usize| (p[i] - p[i - 1]).abs() > CALM_US;
        self.pulse.as_ref().map_or_else(Vec::new, |p| (1..p.len()).filter(|i| jumps(p, *i)).collect())
    }

    /// Where the load steps: in the command, or in the signal where there is none; and where time has a gap.
    fn steps(&self, signal: &[f64]) -> Vec<(usize, bool)> {
        let t = &self.log.t;
        let (by, most, back) = match &self.pulse {
            Some(pulse) => (pulse.as_slice(), CALM_US, 1),
            None => (signal, STEP * span(signal), 2),
        };
        let jumps = |i: usize| !by.is_empty() && (by[i] - by[i.saturating_sub(back)]).abs() > most;
        let gap = |i: usize| t[i] - t[i - 1] > GAP * self.step;
        (1..t.len()).filter(|i| gap(*i) || jumps(*i)).map(|i| (i, gap(i))).collect()
    }
}

/// Adds the share of an acceleration that a channel shows: of speeding up, and of slowing down, where a controller may let the rotor coast.
/// Least absolute departures through the origin (the weighted median of the ratios), so that no bad sample decides it.
fn add_share(said: &mut [f64], rows: &[usize], left: &[f64], takes: &[f64]) {
    for sign in [1.0, -1.0] {
        let mut ratios: Vec<(f64, f64)> = rows
            .iter()
            .zip(left)
            .filter(|(i, _)| sign * takes[**i] > 0.0)
            .map(|(i, l)| (l / takes[*i], takes[*i].abs()))
            .collect();
        let share = weighted_median(&mut ratios);
        said.iter_mut().zip(takes).filter(|(_, a)| sign * **a > 0.0).for_each(|(s, a)| *s += share * a);
    }
}

/// The value up to which half of the weight lies; 0 of nothing.
fn weighted_median(of: &mut [(f64, f64)]) -> f64 {
    of.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * of.iter().map(|v| v.1).sum::<f64>();
    let mut below = 0.0;
    for (value, weight) in of.iter() {
        below += weight;
        if below >= half {
            return *value;
        }
    }
    0.0
}

fn span(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    high - low
}
