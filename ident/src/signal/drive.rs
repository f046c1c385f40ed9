//! The speed that a command makes, before any cause is sought.
//!
//! What it is: a curve of held speeds over the command, and a rotor that follows it with one time constant up and one down, found with
//! absolute errors so that lost readings have no say. What bad readings are told from, and what a gap in the speed is bridged by.
//! What can go wrong: a supply that sags or a rotor that rubs makes another speed of the same command; whoever asks must allow for that.
//! Units: us, s, rev/min.
//! Reference: first-order motor model, Beharie 2013, section 5.7.3; least absolute deviations, Huber & Ronchetti 2009, chapter 7.

use crate::log::Log;
use crate::numeric::order::{median, quantum, usual_step};
use crate::signal::bad::Curve;
use crate::signal::start::{start_pulse, uncommanded};
use crate::signal::stretches::{GAP, STILL_US, bridge, starts};
use std::ops::Range;

/// Fewest rows in which the command stands still that a level is taken from; the later half of them.
const HELD: usize = 6;
/// Time constants that are tried, s: quick rotors of toys to large ones that coast.
const CONSTANTS: (f64, f64, usize) = (0.02, 3.0, 24);
/// Share of a row's step that stands for a rotor that arrives at once.
const AT_ONCE: f64 = 0.2;
/// Time constants that are tried between the neighbours of the best one.
const FINE: usize = 9;
/// Standard deviations by which the level of a held command may be off.
const LEVEL: f64 = 3.0;
/// Share of the way still to go that is uncertain while a rotor is on it: one time constant stands for a rotor that has several.
const ON_ITS_WAY: f64 = 0.15;

/// Mean angular acceleration since the row before, rad/s^2, of a speed in rev/min; none after a gap in time, nor where two rows follow each
/// other at once and their own errors would make any acceleration. `usual`: the usual time between rows, s.
pub(crate) fn acceleration_of_rows(t: &[f64], speed: &[f64], usual: f64) -> Vec<f64> {
    let since = |i: usize| {
        let dt = t[i] - t[i - 1];
        let known = (0.5 * usual..GAP * usual).contains(&dt);
        if known { (speed[i] - speed[i - 1]) / dt * std::f64::consts::TAU / 60.0 } else { 0.0 }
    };
    (0..t.len()).map(|i| if i == 0 { 0.0 } else { since(i) }).collect()
}

/// A drive.
pub(crate) struct Drive {
    /// Speed on every row, rev/min.
    pub(crate) speed: Vec<f64>,
    /// Standard deviation of that on every row, rev/min, where the rotor has no other cause to turn otherwise.
    pub(crate) sd: Vec<f64>,
    /// Speed that the curve has at its command, rev/min.
    pub(crate) asked: Vec<f64>,
    /// Speed that it goes to, rev/min: where a command is held long enough the speed that is reached there, else that of the curve.
    goal: Vec<f64>,
    /// Rows on which more of the way is left than the speed of a held command scatters by, and the motor is on.
    on_its_way: Vec<bool>,
    /// Time constants up and down, s.
    constants: [f64; 2],
    /// Standard deviation of the speed of a held command, rev/min.
    usual: f64,
}

impl Drive {
    /// What the commands of a log make of a speed; `None` without a command or with too few readings. A missing reading is not finite.
    pub(crate) fn of(log: &Log, speed: &[f64]) -> Option<Self> {
        let told = log.column("pulse_us").filter(|c| c.iter().any(|v| v.is_finite()))?;
        let mut speed = speed.to_vec();
        uncommanded(told).into_iter().for_each(|row| speed[row] = f64::NAN);
        Self::of_command(&log.t, &bridge(&log.t, told), &speed)
    }

    /// The same of a command without gaps, us.
    pub(crate) fn of_command(t: &[f64], pulse: &[f64], speed: &[f64]) -> Option<Self> {
        let start = start_pulse(t, Some(pulse), speed);
        let turns = |p: f64| p >= start;
        let stretches = held(pulse);
        let held: Vec<usize> = stretches.iter().cloned().flatten().filter(|i| speed[*i].is_finite()).collect();
        let pairs = held.iter().filter(|i| turns(pulse[**i])).map(|i| (pulse[*i], speed[*i])).collect();
        let curve = Curve::through(pairs)?;
        let goal: Vec<f64> = pulse.iter().map(|p| if turns(*p) { curve.at(*p).max(0.0) } else { 0.0 }).collect();
        // what the rotor did in a gap is not known: behind it the speed is the one that is measured there
        let first = speed.first().copied().filter(|v| v.is_finite()).map(|v| (0, v));
        let begins: Vec<(usize, f64)> = first.into_iter().chain(starts(t, speed, false)).collect();
        let speed_of = |up: f64, down: f64| follow(t, &goal, &begins, up, down);
        let error = |up: f64, down: f64| -> f64 {
            speed_of(up, down).iter().zip(speed).filter(|(_, y)| y.is_finite()).map(|(p, y)| (p - y).abs()).sum()
        };
        let (from, to, n) = CONSTANTS;
        let ratio = f64::powf(to / from, 1.0 / (n - 1) as f64);
        let at_once = AT_ONCE * usual_step(t);
        let constants: Vec<f64> =
            std::iter::once(at_once).filter(|tau| *tau < from).chain((0..n).map(|k| from * ratio.powi(k as i32))).collect();
        let best = |among: &[f64], of: &dyn Fn(f64) -> f64| {
            among.iter().map(|tau| (of(*tau), *tau)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
        };
        let both = best(&constants, &|tau| error(tau, tau))?;
        // between the neighbours of what was found
        let close =
            |tau: f64| -> Vec<f64> { (0..FINE).map(|k| tau * ratio.powf(2.0 * k as f64 / (FINE - 1) as f64 - 1.0)).collect() };
        let up = best(&constants, &|tau| error(tau, both))?;
        let down = best(&constants, &|tau| error(up, tau))?;
        let up = best(&close(up), &|tau| error(tau, down))?;
        let down = best(&close(down), &|tau| error(up, tau))?;
        let speed_made = speed_of(up, down);
        // a rotor that stands is no measure of how well one that turns is known
        let driven = held.iter().filter(|i| turns(pulse[**i]));
        let mut left: Vec<f64> = driven.map(|i| (speed[*i] - speed_made[*i]).abs()).collect();
        let usual = (SIGMA * median(&mut left)).max(quantum(speed));
        let jump = |i: usize| (goal[i] - goal[i.saturating_sub(1)]).abs();
        let sd = (0..goal.len()).map(|i| usual.hypot(ON_ITS_WAY * (goal[i] - speed_made[i])).hypot(0.5 * jump(i))).collect();
        let on_its_way = (0..goal.len()).map(|i| turns(pulse[i]) && (goal[i] - speed_made[i]).abs() > usual).collect();
        let (asked, goal) = (goal.clone(), reached(goal, &stretches, speed));
        Some(Self { speed: speed_made, sd, asked, goal, on_its_way, constants: [up, down], usual })
    }

    /// By how much a reading is off what the command makes, rev/min: as its level is, and because the way began at another moment. The latter is
    /// what is beyond the scatter of held commands, and no more than the speed changes from the row before to the one after.
    pub(crate) fn off(&self, row: usize, reading: f64) -> (f64, f64) {
        let off = reading - self.speed[row];
        let most = (self.speed[(row + 1).min(self.speed.len() - 1)] - self.speed[row.saturating_sub(1)]).abs();
        let moving = (off - off.clamp(-LEVEL * self.usual, LEVEL * self.usual)).clamp(-most, most);
        (off - moving, moving)
    }

    /// What is left of what a moment of the way at a row was off, so long before or after it, s.
    pub(crate) fn left(&self, row: usize, since: f64) -> f64 {
        let [up, down] = self.constants;
        (-since.abs() / if self.goal[row] > self.speed[row] { up } else { down }).exp()
    }

    /// Angular acceleration of a rotor that has these speeds on its way to where the command sends it, rad/s^2; none once it is there, where a
    /// reading is off by its own error.
    pub(crate) fn acceleration(&self, speed: &[f64]) -> Vec<f64> {
        let [up, down] = self.constants;
        let of = |i: usize| {
            let left = (self.goal[i] - speed[i]) * std::f64::consts::TAU / 60.0;
            if self.on_its_way[i] { left / if left > 0.0 { up } else { down } } else { 0.0 }
        };
        (0..speed.len()).map(of).collect()
    }
}

/// Goals with those of held commands exchanged for the speed that is reached there: the same command does not always make the same speed.
fn reached(mut goal: Vec<f64>, settled: &[Range<usize>], speed: &[f64]) -> Vec<f64> {
    for range in settled {
        let mut there: Vec<f64> = speed[range.clone()].iter().copied().filter(|v| v.is_finite()).collect();
        if there.is_empty() {
            continue;
        }
        let level = median(&mut there);
        // the settled half of a stretch follows its other half
        let from = range.start - range.len().min(range.start);
        let asked = goal[range.start];
        goal[from..range.end].iter_mut().filter(|g| **g == asked).for_each(|g| *g = level);
    }
    goal
}

/// Standard deviation over the median absolute one, of a normal distribution.
pub(crate) const SIGMA: f64 = 1.4826;

/// The later half of each stretch in which the command stands still.
fn held(pulse: &[f64]) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let mut from = 0;
    for i in 1..=pulse.len() {
        if i == pulse.len() || (pulse[i] - pulse[i - 1]).abs() > STILL_US {
            if i - from >= HELD {
                out.push(from + (i - from) / 2..i);
            }
            from = i;
        }
    }
    out
}

/// A first-order lag behind a goal, from the states that some rows begin with.
fn follow(t: &[f64], goal: &[f64], begins: &[(usize, f64)], up: f64, down: f64) -> Vec<f64> {
    let mut begins = begins.iter().copied().peekable();
    let first = begins.next_if(|b| b.0 == 0).map(|b| b.1);
    let mut state = first.or(goal.first().copied()).unwrap_or(0.0);
    let mut out = Vec::with_capacity(goal.len());
    out.push(state);
    // most rows are as far apart as the ones before
    let (mut step, mut left) = (f64::NAN, [0.0; 2]);
    for i in 1..goal.len() {
        let dt = t[i] - t[i - 1];
        if (dt - step).abs() > 1e-9 || step.is_nan() {
            (step, left) = (dt, [down, up].map(|tau| (-dt / tau).exp()));
        }
        let begins = begins.next_if(|b| b.0 == i).map(|b| b.1);
        state = begins.unwrap_or(goal[i] + (state - goal[i]) * left[usize::from(goal[i] > state)]);
        out.push(state);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    #[test]
    fn a_probe_that_drops_out_does_not_move_what_the_command_makes() {
        let n = 3000;
        let t: Vec<f64> = (0..n).map(|i| 0.02 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..n).map(|i| 1100.0 + 60.0 * f64::from(i / 150 * 7 % 13)).collect();
        let goal: Vec<f64> = pulse.iter().map(|p| 6.0 * (p - 1000.0)).collect();
        let truth = follow(&t, &goal, &[], 0.1, 0.25);
        let read: Vec<f64> =
            truth.iter().enumerate().map(|(i, v)| if (400..425).contains(&(i % 450)) { 0.2 * v } else { *v }).collect();
        let log = Log { t, columns: vec![Column { name: "pulse_us".into(), values: pulse }], ..Log::default() };
        let drive = Drive::of(&log, &read).expect("a command");
        let off = drive.speed.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 150.0, "{off} rev/min");
        let far =
            drive.speed.iter().zip(&truth).zip(&drive.sd).filter(|((a, b), sd)| (*a - *b).abs() > 4.0 * **sd + 30.0).count();
        assert!(far * 100 < truth.len(), "{far} rows");
    }

    #[test]
    fn a_rotor_that_follows_at_once_is_not_on_its_way() {
        let t: Vec<f64> = (0..600).map(|i| 0.02 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..600).map(|i| 1100.0 + 100.0 * f64::from(i / 50 * 5 % 9)).collect();
        let read: Vec<f64> = pulse.iter().map(|p| 6.0 * (p - 1000.0)).collect();
        let drive = Drive::of_command(&t, &pulse, &read).expect("a command");
        let most = drive.speed.iter().zip(&read).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most < 50.0, "{most} rev/min of jumps of 3000");
    }
}
