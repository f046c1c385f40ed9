//! A rotor between winding and air.
//!
//! What it is: the way of a rotor from one speed to another as an operator on columns. Winding and air both pull it to its new speed, the air the
//! more the faster it turns. Where the controller does not brake, no current flows far above the new speed: air and friction alone slow it down.
//! So they do wherever the command is below that of the start: no controller holds a motor that is off.
//! Where a block of rows begins nothing is known of the command before, so that no latency is counted there.
//! What can go wrong: the rates are those of a rotor whose speed goes with the command above 1000 us; a curve that bends much makes
//! them rough. How a standing rotor starts is the controller's programme and is not in it.
//! Units: s; speeds as a share of that at 2000 us.
//! Reference: J dw/dt = kt i - kQ w^2 - Q_f with i = (V - kt w)/R, not below 0 where nothing brakes: Beharie 2013, Eq. 2.21 as corrected and
//! 5.11. At a voltage that holds the speed g this is dv/dt = (g - v) (a + b (g + v)), with a = kt^2/(R J) and b = kQ w_max/J.

use crate::channel::{Context, STANDSTILL};
use crate::effects::operator::{Decay, weight_of_ramp};
use crate::numeric::order::usual_step;
use crate::signal::stretches::GAP;

/// Parts that a row is cut into while the rotor coasts; the way of a driven one is exact.
const PARTS: usize = 8;
/// Distance from the new speed, a share of full speed, below which a rotor has arrived.
const ARRIVED: f64 = 1e-3;
/// The same below which it stands there.
const STANDS: f64 = 1e-9;
/// Most rows whose input one row of the output hangs on; of a longer span the first stands for those before it.
const REACH: usize = 4;

/// Constants of a rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rotor {
    /// Time constant of a small change about half the full speed while current flows, s.
    pub(crate) tau_up: f64,
    /// Time in which the air alone halves the full speed, s.
    pub(crate) tau_air: f64,
    /// What friction alone takes, shares of full speed a second.
    pub(crate) friction: f64,
    /// How late the speed answers to the logged command, s.
    pub(crate) latency: f64,
    /// Whether a running controller brakes: current flows back on the way down.
    pub(crate) braked: bool,
}

/// Speed at which [`Rotor::tau_up`] holds, a share of the full one.
const HALF: f64 = 0.5;
/// Least part of the approach that is the winding's: the air cannot have all of it.
const LEAST_OF_WINDING: f64 = 0.02;

impl Rotor {
    /// What slows it down without a current, 1/s, at speed `v`.
    fn braking(&self, v: f64) -> f64 {
        v * v * self.air() + self.friction
    }

    /// Rate of the air at full speed, 1/s: not more than the winding leaves of the approach at half speed.
    fn air(&self) -> f64 {
        (1.0 / self.tau_air.max(1e-6)).min((1.0 - LEAST_OF_WINDING) * self.approach() / (2.0 * HALF))
    }

    /// Rate of the winding, 1/s: what the air leaves of the approach at half speed.
    fn winding(&self) -> f64 {
        self.approach() - 2.0 * HALF * self.air()
    }

    /// Rate of a small change about half speed while current flows, 1/s.
    fn approach(&self) -> f64 {
        1.0 / self.tau_up.max(1e-6)
    }

    /// Rate of approach, 1/s, at speed `v` towards `goal`.
    fn rate(&self, v: f64, goal: f64) -> f64 {
        let driven = self.winding() + self.air() * (goal + v);
        if v > goal && !self.holds(goal) { driven.min(self.braking(v) / (v - goal)) } else { driven }
    }

    /// Whether the controller takes current back on the way down to `goal`.
    fn holds(&self, goal: f64) -> bool {
        self.braked && goal > 0.0
    }

    /// Whether current flows at speed `v` on the way to `goal`.
    fn is_driven(&self, v: f64, goal: f64) -> bool {
        self.holds(goal) || v <= goal + self.braking(goal) / self.winding()
    }

    /// Where current flows from the beginning of some seconds to their end: the share of the way of the goal that one goal would stand
    /// at for the same effect, and what is left of the distance from it. Exact for one goal, and for a straight line near it.
    fn driven(&self, (v, s): (f64, f64), course: Course, (from, to): (f64, f64), decay: &mut Decay) -> Option<(f64, f64)> {
        if !self.is_driven(v, course.goal(from)) {
            return None;
        }
        // of dx/dt = -x (c + b x), x the distance from the goal
        let middle = course.goal(0.5 * (from + to));
        let c = self.winding() + 2.0 * self.air() * middle;
        let near = decay.of(s * c);
        let left = near / (1.0 + self.air() * (v - middle) / c * (1.0 - near));
        let share = from + (to - from) * weight_of_ramp(-left.ln(), left) / (1.0 - left).max(1e-12);
        let goal = course.goal(share);
        self.is_driven(goal + (v - goal) * left, course.goal(to)).then_some((share, left))
    }
}

/// What the goal does between two rows.
#[derive(Debug, Clone, Copy)]
struct Course {
    /// The goal at the earlier row.
    from: f64,
    /// What it changes by until the later one.
    change: f64,
    /// Where the command jumps, whether it has done so yet: it has its next value from a row on, and before the log its first.
    jumps: Option<bool>,
}

impl Course {
    /// The share of the change that is done after a share of the interval.
    fn share(self, of_interval: f64) -> f64 {
        self.jumps.map_or(of_interval.clamp(0.0, 1.0), |done| if done { 1.0 } else { 0.0 })
    }

    /// The goal where a share of the change is done.
    fn goal(self, share: f64) -> f64 {
        self.from + share * self.change
    }
}

/// Where the log did not see what the rotor did before.
struct Blocks(Vec<Block>);

struct Block {
    /// Its first row.
    row: usize,
    /// About the share of full speed with which it begins: the curve is taken for a straight line.
    speed: f64,
    /// From when on the command is known, s: the log has a gap before. Of a standing rotor that has not set out yet it is known throughout.
    known_from: f64,
}

impl Blocks {
    fn of(context: &Context, goals: &[f64]) -> Self {
        let highest = |values: &[f64]| values.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
        let share = highest(goals) / highest(&context.rpm).max(f64::MIN_POSITIVE);
        let speed = |rpm: f64| if rpm < STANDSTILL { 0.0 } else { rpm * share };
        let gap = GAP * usual_step(&context.t);
        let mut known_from = f64::NEG_INFINITY;
        let mut last = None;
        let block = |(row, rpm): &(usize, f64)| {
            let t = context.t[*row];
            if row.checked_sub(1).is_none_or(|before| t - context.t[before] > gap)
                || (known_from.is_finite() && last == row.checked_sub(1))
            {
                known_from = t;
            } else {
                known_from = f64::NEG_INFINITY;
            }
            last = Some(*row);
            Block { row: *row, speed: speed(*rpm), known_from }
        };
        Self(context.starts.iter().map(block).collect())
    }

    /// The block that a row is in; nothing before the first.
    fn of_row(&self, row: usize) -> Option<&Block> {
        self.0[..self.0.partition_point(|block| block.row <= row)].last()
    }
}

/// What one row of the output keeps of the row before, and takes of the input.
#[derive(Debug, Clone, Copy)]
struct Row {
    left: f64,
    first: usize,
    weights: [f64; REACH],
}

/// What a rotor makes of columns.
#[derive(Debug, Clone)]
pub(crate) struct Coasting {
    rows: Vec<Row>,
    /// Share of its input at which it stands on the first row: see [`crate::effects::operator::Lag`].
    first: f64,
}

/// The input of a rotor over a part of an interval: a row, the share of the way to the next, and what is left of the state after it.
type Part = (usize, f64, f64);

impl Row {
    /// Of the parts of an interval, in order.
    fn of(parts: &[Part]) -> Self {
        let newest = parts.last().map_or(0, |p| p.0);
        let oldest = parts.first().map_or(0, |p| p.0);
        let first = oldest.max((newest + 2).saturating_sub(REACH));
        let mut row = Self { left: 1.0, first, weights: [0.0; REACH] };
        for (j, share, left) in parts {
            row.left *= left;
            row.weights.iter_mut().for_each(|w| *w *= left);
            let at = j.saturating_sub(first);
            row.weights[at] += (1.0 - left) * (1.0 - share);
            row.weights[at + 1] += (1.0 - left) * share;
        }
        row
    }
}

impl Coasting {
    /// Of a rotor along the command of a log. `jumps`: the command has its next value from a row on, and goes there in no straight line.
    pub(crate) fn new(context: &Context, rotor: Rotor, jumps: bool) -> Self {
        let (t, Some(pulse)) = (&context.t, &context.pulse) else { return Self { rows: Vec::new(), first: 1.0 } };
        if t.len() < 2 {
            return Self { rows: Vec::new(), first: 1.0 };
        }
        let goals: Vec<f64> =
            pulse.iter().map(|p| if *p < context.start_pulse_us { 0.0 } else { (p - 1000.0).max(0.0) / 1000.0 }).collect();
        let latency = rotor.latency.max(0.0);
        let blocks = Blocks::of(context, &goals);
        let (mut speed, mut row, mut parts) = (goals[0], 0, Vec::with_capacity(PARTS + REACH));
        let mut decay = Decay::new();
        let mut settled: Option<(f64, Row)> = None;
        let interval = |i: usize| {
            let block = blocks.of_row(i - 1);
            if let Some(block) = block.filter(|block| block.row == i - 1) {
                (speed, row, settled) = (block.speed, block.row, None);
            }
            // once it stands at its speed every row is like the one before
            let length = t[i] - t[i - 1];
            let stands = goals[row..=i].iter().all(|g| (g - speed).abs() < STANDS);
            if let Some((_, last)) = settled.as_mut().filter(|(of, _)| stands && (of - length).abs() < 1e-9 * length) {
                last.first += 1;
                row += 1;
                return *last;
            }
            let (from, to) = (t[i - 1] - latency, t[i] - latency);
            let known_from = block.map_or(f64::NEG_INFINITY, |block| block.known_from);
            let calm = goals[row..=i].iter().all(|g| (g - speed).abs() < ARRIVED);
            let step = (t[i] - t[i - 1]) / if calm { 1.0 } else { PARTS as f64 };
            parts.clear();
            let mut now = from;
            while now < to - 1e-9 * step {
                while row + 2 < t.len() && t[row + 1] <= now + 1e-9 * step {
                    row += 1;
                }
                // a part ends at the next row at the latest: there a command that jumps does so
                let next = if t[row + 1] > now + 1e-9 * step { t[row + 1] } else { f64::INFINITY };
                // before its block nothing is known of a command: a rotor there is on its way to the first that was logged
                let unseen = now < known_from - 1e-9 * step;
                let course = Course {
                    from: goals[row],
                    change: if unseen { 0.0 } else { goals[row + 1] - goals[row] },
                    jumps: jumps.then_some(now >= t[0]),
                };
                let share = |at: f64| if unseen { 0.0 } else { course.share((at - t[row]) / (t[row + 1] - t[row])) };
                let mut whole = to.min(if unseen { known_from } else { next });
                // on a slope the rate changes with the goal
                if !calm && share(now) != share(whole) {
                    whole = whole.min(now + step);
                }
                let driven = rotor.driven((speed, whole - now), course, (share(now), share(whole)), &mut decay);
                let (end, share, left) = driven.map_or_else(
                    || {
                        let end = (now + step).min(whole);
                        let share = share(0.5 * (now + end));
                        (end, share, (-rotor.rate(speed, course.goal(share)) * (end - now)).exp())
                    },
                    |(share, left)| (whole, share, left),
                );
                let goal = course.goal(share);
                speed = goal + (speed - goal) * left;
                parts.push((row, share, left));
                now = end;
            }
            let out = Row::of(&parts);
            settled = (stands && i > REACH).then_some((length, out));
            out
        };
        Self { rows: (1..t.len()).map(interval).collect(), first: 1.0 }
    }

    /// The same where the state of some rows is known by itself.
    pub(crate) fn starting_at(mut self, starts: &[(usize, f64)]) -> Self {
        if self.rows.is_empty() {
            return self;
        }
        for (row, _) in starts {
            match row.checked_sub(1) {
                None => self.first = 0.0,
                Some(before) => self.rows[before] = Row { left: 0.0, weights: [0.0; REACH], ..self.rows[before] },
            }
        }
        self
    }

    /// What is left of those states on every row.
    pub(crate) fn carried(&self, starts: &[(usize, f64)]) -> Vec<f64> {
        crate::effects::operator::carried(self.rows.iter().map(|r| r.left), starts)
    }

    /// What becomes of signals: four at a time, because each state waits for the one before it.
    pub(crate) fn of(&self, signals: &[&[f64]]) -> Vec<Vec<f64>> {
        if self.rows.is_empty() {
            return signals.iter().map(|x| x.to_vec()).collect();
        }
        let some = |few: &[&[f64]]| -> Vec<Vec<f64>> {
            let four = [0, 1, 2, 3].map(|k| few[k.min(few.len() - 1)]);
            self.side_by_side(four).into_iter().take(few.len()).collect()
        };
        signals.chunks(4).flat_map(some).collect()
    }

    fn side_by_side(&self, signals: [&[f64]; 4]) -> [Vec<f64>; 4] {
        let mut state = signals.map(|x| self.first * x.first().copied().unwrap_or(0.0));
        let mut out = state.map(|first| {
            let mut values = Vec::with_capacity(self.rows.len() + 1);
            values.push(first);
            values
        });
        for row in &self.rows {
            for ((out, state), x) in out.iter_mut().zip(&mut state).zip(signals) {
                let x = &x[row.first..];
                let input = match x.first_chunk::<REACH>() {
                    Some(x) => sum_of(&row.weights, x),
                    None => sum_of(&row.weights, x),
                };
                *state = row.left * *state + input;
                out.push(*state);
            }
        }
        out
    }
}

#[inline]
fn sum_of(weights: &[f64; REACH], x: &[f64]) -> f64 {
    weights.iter().zip(x).fold(0.0, |sum, (w, x)| sum + w * x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    const ROTOR: Rotor = Rotor { tau_up: 0.04, tau_air: 0.4, friction: 0.1, latency: 0.0, braked: false };

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
        let n = 20_000;
        let air = 1.0 / rotor.tau_air;
        for _ in 0..n {
            let driven = (goal - v) * (1.0 / rotor.tau_up - air + air * (goal + v));
            let alone = -(v * v * air + rotor.friction);
            v += s / f64::from(n) * if rotor.holds(goal) { driven } else { driven.max(alone) };
        }
        v
    }

    #[test]
    fn it_is_the_rotor_s_equation_driven_braked_and_coasting() {
        let braked = Rotor { braked: true, tau_air: 0.15, ..ROTOR };
        for (from, to) in [(1200.0, 1900.0), (1900.0, 1200.0)] {
            let (t, v) = speed(braked, from, to, true);
            let goal = |us: f64| if us < 1050.0 { 0.0 } else { (us - 1000.0) / 1000.0 };
            for row in [50, 51, 53, 60, 90] {
                let exact = integrated(braked, goal(from), goal(to), t[row] - t[49]);
                assert!((v[row] - exact).abs() < 0.002, "{from} {to} row {row}: {} {exact}", v[row]);
            }
        }
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

    /// The log has a gap in which the command has jumped; the rotor sets out with the block's first row.
    #[test]
    fn no_latency_is_counted_where_the_log_begins_anew() {
        let t: Vec<f64> = (0..120).map(|i| 0.02 * f64::from(i) + if i < 60 { 0.0 } else { 9.0 }).collect();
        let pulse: Vec<f64> = (0..120).map(|i| if i < 60 { 1800.0 } else { 1500.0 }).collect();
        let rest = Rotor { tau_air: 0.4, ..ROTOR };
        let way = |i: i32| 0.2 + 0.3 * (1.0 - (-f64::from(i) * 0.02 / 0.04).exp());
        let rpm = (0..120).map(|i| 7000.0 * if i < 60 { 0.8 } else { way(i - 60) }).collect();
        let column = |name: &str, values: Vec<f64>| Column { name: name.to_owned(), values };
        let log = Log { t, columns: vec![column("pulse_us", pulse), column("rpm", rpm)], ..Log::default() };
        let context = Context::bare(&log, Some(1050.0));
        assert_eq!(context.starts.iter().map(|s| s.0).collect::<Vec<_>>(), [60]);
        let goal: Vec<f64> = (0..120).map(|i| if i < 60 { 0.8 } else { 0.5 }).collect();
        let after = |latency: f64| {
            let coasting = Coasting::new(&context, Rotor { latency, ..rest }, true).starting_at(&context.starts);
            let (of, carried) = (coasting.of(&[&goal]).remove(0), coasting.carried(&[(60, 0.2)]));
            of[63] + carried[63]
        };
        assert!((after(0.0) - after(0.05)).abs() < 1e-3, "{} {}", after(0.0), after(0.05));
        assert!(after(0.05) > 0.35 && after(0.05) < 0.5, "{}", after(0.05));
    }

    #[test]
    fn its_constants_are_what_they_say() {
        // a small change is over but for 1/e after one time constant
        let (t, v) = speed(Rotor { tau_up: 0.1, ..ROTOR }, 1490.0, 1510.0, true);
        let row = t.iter().position(|s| s - t[49] >= 0.1 - 1e-9).unwrap();
        assert!(((0.51 - v[row]) / 0.02 - (-1.0_f64).exp()).abs() < 0.01, "{}", v[row]);
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
    fn signals_side_by_side_are_what_each_is_alone() {
        let t: Vec<f64> = (0..60).map(|i| 0.02 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..60).map(|i| 1200.0 + 300.0 * f64::from(i / 13 % 3)).collect();
        let column = |name: &str, values: Vec<f64>| Column { name: name.to_owned(), values };
        let log = Log { t, columns: vec![column("rpm", pulse.clone()), column("pulse_us", pulse)], ..Log::default() };
        let coasting = Coasting::new(&Context::new(&log, Some(1050.0)), ROTOR, true);
        let signals: Vec<Vec<f64>> = (0..6).map(|k| (0..60).map(|i| f64::from(i * k).sin()).collect()).collect();
        let all: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
        let alone: Vec<Vec<f64>> = all.iter().flat_map(|x| coasting.of(&[x])).collect();
        for n in 0..=6 {
            assert_eq!(coasting.of(&all[..n]), alone[..n], "{n}");
        }
    }

    #[test]
    fn what_stands_stays() {
        let (_, v) = speed(ROTOR, 1500.0, 1500.0, false);
        assert!(v.iter().all(|v| (v - 0.5).abs() < 1e-12));
    }
}
