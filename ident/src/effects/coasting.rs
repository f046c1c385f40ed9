//! A rotor whose controller drives it and never brakes it.
//!
//! What it is: the way of a rotor from one speed to another as an operator on columns. Driven, it approaches its new speed the faster
//! the more the winding and the air hold it; above it no current flows, and the air and friction alone slow it down.
//! What can go wrong: the rates are those of a rotor whose speed goes with the command above 1000 us; a curve that bends much makes
//! them rough. How a standing rotor starts is the controller's programme and is not in it.
//! Units: s; speeds as a share of that at 2000 us.
//! Reference: J dw/dt = kt i - kQ w^2 - Q_f with i = max(0, (V - kt w)/R): Beharie 2013, Eq. 2.21 as corrected and 5.11.

use crate::context::Context;

/// Parts that a row is cut into while the rotor is on its way.
const PARTS: usize = 8;
/// Distance from the new speed, a share of full speed, below which a rotor has arrived.
const ARRIVED: f64 = 1e-3;
/// Most rows whose input one row of the output hangs on; of a longer span the last stands for the rest.
const REACH: usize = 4;

/// Constants of a rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rotor {
    /// Time constant of a small change at full speed, driven, s.
    pub(super) tau_up: f64,
    /// Time in which the air alone halves the full speed, s.
    pub(super) tau_down: f64,
    /// What friction alone takes, shares of full speed a second.
    pub(super) friction: f64,
    /// How late the speed answers to the logged command, s.
    pub(super) latency: f64,
}

impl Rotor {
    /// Rate of approach, 1/s, at speed `v` towards `goal`.
    fn rate(&self, v: f64, goal: f64) -> f64 {
        let air = 1.0 / self.tau_down.max(1e-6);
        let winding = (1.0 / self.tau_up.max(1e-6) - 2.0 * air).max(0.0);
        let driven = winding + air * (goal + v);
        if v > goal { driven.min((air * v * v + self.friction) / (v - goal)) } else { driven }
    }
}

/// The input of an interval, and what it leaves of the state.
#[derive(Debug, Clone, Copy)]
struct Row {
    left: f64,
    first: usize,
    weights: [f64; REACH],
}

/// What a rotor makes of columns.
#[derive(Debug, Clone)]
pub(super) struct Coasting {
    rows: Vec<Row>,
}

/// Where an instant lies: a row and the share of the way to the next.
struct Place<'t> {
    t: &'t [f64],
    row: usize,
    jumps: bool,
}

impl Place<'_> {
    /// Instants are asked for in order of time.
    fn of(&mut self, at: f64) -> (usize, f64) {
        let t = self.t;
        while self.row + 2 < t.len() && t[self.row + 1] <= at {
            self.row += 1;
        }
        let share = ((at - t[self.row]) / (t[self.row + 1] - t[self.row])).clamp(0.0, 1.0);
        // a command that jumps has its new value from the earlier row on
        (self.row, if self.jumps && at > t[0] { 1.0 } else { share })
    }
}

impl Coasting {
    /// Of a rotor along the command of a log. `jumps`: the command goes from row to row at once, and not in a straight line.
    pub(super) fn new(context: &Context, rotor: Rotor, jumps: bool) -> Self {
        let (t, Some(pulse)) = (&context.t, &context.pulse) else { return Self { rows: Vec::new() } };
        if t.len() < 2 {
            return Self { rows: Vec::new() };
        }
        let goals: Vec<f64> =
            pulse.iter().map(|p| if *p < context.start_pulse_us { 0.0 } else { (p - 1000.0).max(0.0) / 1000.0 }).collect();
        let mut place = Place { t, row: 0, jumps };
        let mut speed = goals[0];
        let mut last = 0;
        let interval = |i: usize| {
            let (from, h) = (t[i - 1] - rotor.latency, t[i] - t[i - 1]);
            let calm = goals[last..=i].iter().all(|g| (g - speed).abs() < ARRIVED);
            let parts = if calm { 1 } else { PARTS };
            let step = h / parts as f64;
            let mut row = Row { left: 1.0, first: 0, weights: [0.0; REACH] };
            for part in 0..parts {
                let (j, share) = place.of(from + (part as f64 + 0.5) * step);
                if part == 0 {
                    row.first = j;
                    last = j;
                }
                let goal = goals[j] + share * (goals[j + 1] - goals[j]);
                let left = (-rotor.rate(speed, goal) * step).exp();
                speed = goal + (speed - goal) * left;
                row.left *= left;
                row.weights.iter_mut().for_each(|w| *w *= left);
                let at = (j - row.first).min(REACH - 2);
                row.weights[at] += (1.0 - left) * (1.0 - share);
                row.weights[at + 1] += (1.0 - left) * share;
            }
            row
        };
        Self { rows: (1..t.len()).map(interval).collect() }
    }

    /// What becomes of signals.
    pub(super) fn of(&self, signals: &[&[f64]]) -> Vec<Vec<f64>> {
        signals.iter().map(|x| self.of_one(x)).collect()
    }

    fn of_one(&self, x: &[f64]) -> Vec<f64> {
        let mut state = x.first().copied().unwrap_or(0.0);
        let rows = self.rows.iter().map(|row| {
            let input = row.weights.iter().zip(&x[row.first..]).fold(0.0, |sum, (w, x)| sum + w * x);
            state = row.left * state + input;
            state
        });
        x.iter().take(1).copied().chain(rows).collect()
    }
}
