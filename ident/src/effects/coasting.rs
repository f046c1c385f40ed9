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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    const ROTOR: Rotor = Rotor { tau_up: 0.04, tau_down: 0.4, friction: 0.1, latency: 0.0 };

    /// A command that stands at one value, then at another, 50 rows a second, and the speed of a rotor whose curve is a straight line.
    fn speed(rotor: Rotor, from_us: f64, to_us: f64, jumps: bool) -> (Vec<f64>, Vec<f64>) {
        let t: Vec<f64> = (0..200).map(|i| 0.02 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..200).map(|i| if i < 50 { from_us } else { to_us }).collect();
        let column = |name: &str, values: Vec<f64>| Column { name: name.to_owned(), values };
        let rpm = pulse.iter().map(|p| 7.0 * (p - 1000.0)).collect();
        let log = Log { t: t.clone(), columns: vec![column("pulse_us", pulse.clone()), column("rpm", rpm)], ..Log::default() };
        let context = Context::new(&log, Some(1050.0));
        let goal: Vec<f64> = pulse.iter().map(|p| if *p < 1050.0 { 0.0 } else { (p - 1000.0) / 1000.0 }).collect();
        (t, Coasting::new(&context, rotor, jumps).of(&[&goal]).remove(0))
    }

    /// The rotor's equation in small steps, from the instant of the jump on.
    fn integrated(rotor: Rotor, mut v: f64, goal: f64, s: f64) -> f64 {
        let (air, n) = (1.0 / rotor.tau_down, 20_000);
        let winding = 1.0 / rotor.tau_up - 2.0 * air;
        for _ in 0..n {
            let driven = (goal - v) * (winding + air * (goal + v));
            v += s / f64::from(n) * driven.max(-(air * v * v + rotor.friction));
        }
        v
    }

    #[test]
    fn it_is_the_rotor_s_equation_driven_and_coasting() {
        for (from, to) in [(1200.0, 1900.0), (1900.0, 1200.0), (2000.0, 1950.0), (1800.0, 1000.0)] {
            let (t, v) = speed(ROTOR, from, to, true);
            let goal = |us: f64| if us < 1050.0 { 0.0 } else { (us - 1000.0) / 1000.0 };
            // the jump lies between rows 49 and 50, at the earlier one
            for row in [50, 53, 60, 90, 199] {
                let exact = integrated(ROTOR, goal(from), goal(to), t[row] - t[49]);
                assert!((v[row] - exact).abs() < 0.012, "{from} {to} row {row}: {} {exact}", v[row]);
            }
        }
    }

    #[test]
    fn its_constants_are_what_they_say() {
        // a small change at full speed is over but for 1/e after one time constant
        let (t, v) = speed(Rotor { tau_up: 0.1, ..ROTOR }, 1980.0, 2000.0, true);
        let row = t.iter().position(|s| s - t[49] >= 0.1 - 1e-9).unwrap();
        assert!(((1.0 - v[row]) / 0.02 - (-1.0_f64).exp()).abs() < 0.01, "{}", v[row]);
        // the air alone halves the full speed
        let (t, v) = speed(Rotor { friction: 0.0, ..ROTOR }, 2000.0, 1000.0, true);
        let row = t.iter().position(|s| s - t[49] >= 0.4 - 1e-9).unwrap();
        assert!((v[row] - 0.5).abs() < 0.01, "{}", v[row]);
        // a line between rows is later than a jump at the earlier one by half a row, and the latency by itself
        let at = |rotor: Rotor, jumps: bool| speed(rotor, 1200.0, 1900.0, jumps).1[52];
        let late = |s: f64| at(Rotor { latency: s, ..ROTOR }, true);
        assert!((at(ROTOR, false) - late(0.01)).abs() < 0.03 && late(0.0) > late(0.01) && late(0.01) > late(0.02));
        assert!((late(0.02) - speed(ROTOR, 1200.0, 1900.0, true).1[51]).abs() < 0.02);
    }

    #[test]
    fn what_stands_stays() {
        let (_, v) = speed(ROTOR, 1500.0, 1500.0, false);
        assert!(v.iter().all(|v| (v - 0.5).abs() < 1e-12));
    }
}
