//! A speed that a table does not read although the load says that the rotor turns.
//!
//! What it is: a sensor that listens to the windings hears little of a slow rotor, and reads nothing, or means of nothing and something. In a table
//! of levels no reading beside it says so; thrust or torque does, which go with the square of the speed.
//! What can go wrong: where the slowest level that is read turns slowly itself, its load is noise, and nothing is found. A load cell whose zero is
//! off by as much as the slowest level lifts is not told from a rotor that turns, where no row of rest tells.
//! Units: rows, rev/min, N or N.m.
//! Reference: momentum theory, Leishman 2006, Principles of Helicopter Aerodynamics, section 2.2.

use super::excursion::Event;
use crate::log::Log;
use crate::numeric::order::median;
use crate::numeric::solve::Normal;
use crate::signal::start::TURNS;

/// Share of the speed that the load tells below which a reading is none.
const HALF: f64 = 0.5;
/// Share of the slowest read level's load from which on a rotor turns: that of half its speed.
const TURNS_BY_LOAD: f64 = HALF * HALF;
/// Levels, the slowest that are read, through which the load of a rotor at rest is told.
const SLOWEST: usize = 3;
/// Fewest levels that are read: two more than a parabola has terms.
const FEWEST: usize = 5;
/// Standard deviations of the load about a parabola by which a turning rotor's must stand out.
const SURE: f64 = 3.0;

/// The rows of a table in which a speed was not read.
pub(super) fn found(log: &Log, name: &str) -> Vec<Event> {
    let (Some(speed), Some(pulse)) = (log.column(name), log.column("pulse_us")) else { return Vec::new() };
    let Some(load) = ["thrust_n", "torque_nm"].iter().find_map(|l| log.column(l)) else { return Vec::new() };
    let known = |i: &usize| speed[*i].is_finite() && load[*i].is_finite() && pulse[*i].is_finite();
    let top = speed.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    let (turning, still): (Vec<usize>, Vec<usize>) = (0..speed.len()).filter(known).partition(|i| speed[*i] > TURNS * top);
    let mut constants: Vec<f64> = turning.iter().map(|i| load[*i] / speed[*i].powi(2)).collect();
    let constant = median(&mut constants);
    // what carries the load of twice the speed that it reads is hardly read
    let is_read = |i: &usize| load[*i] / speed[*i].powi(2) <= constant / (HALF * HALF);
    let (mut read, hardly): (Vec<usize>, Vec<usize>) = turning.into_iter().partition(is_read);
    read.sort_by(|a, b| speed[*a].total_cmp(&speed[*b]));
    let Some(law) = (read.len() >= FEWEST).then(|| Law::of(&read, speed, load)).flatten() else { return Vec::new() };
    let at_rest = |i: &usize| still.iter().filter(|s| pulse[**s] < pulse[*i]).map(|s| load[*s]).fold(law.rest, f64::max);
    let event = |i: usize| {
        let (rest, carried) = (at_rest(&i), law.slowest.1);
        let share = (load[i] - rest) / (carried - rest);
        let turns = carried > rest && share >= TURNS_BY_LOAD && load[i] - rest > SURE * law.scatter;
        let expected = law.slowest.0 * share.max(0.0).sqrt();
        (turns && speed[i] < HALF * expected).then(|| Event { rows: i..i + 1, worst: i, expected, at_step: false, silent: false })
    };
    let mut rows: Vec<usize> = still.iter().chain(&hardly).copied().collect();
    rows.sort_unstable();
    rows.into_iter().filter_map(event).collect()
}

/// What the levels that are read say of the load.
struct Law {
    /// Load of a rotor at rest: by the square of the speed, and no less than nothing, to which load cells are tared.
    rest: f64,
    /// Speed and load of the slowest level.
    slowest: (f64, f64),
    /// Standard deviation of the load about a parabola in the speed.
    scatter: f64,
}

impl Law {
    /// Of rows in the order of their speeds.
    fn of(read: &[usize], speed: &[f64], load: &[f64]) -> Option<Self> {
        let first = *read.first()?;
        let x = |i: usize| speed[i] / speed[first];
        let squares = read.iter().take(SLOWEST).map(|i| (x(*i).powi(2), load[*i], 1.0));
        let rest = Normal::of_polynomial(1, squares).solve()?.coefficients.first().copied()?.max(0.0);
        let parabola = Normal::of_polynomial(2, read.iter().map(|i| (x(*i), load[*i], 1.0))).solve()?.coefficients;
        let left = |i: &usize| load[*i] - parabola.iter().rev().fold(0.0, |sum, c| sum * x(*i) + c);
        let squared: f64 = read.iter().map(|i| left(i).powi(2)).sum();
        let free = read.len().saturating_sub(parabola.len()).max(1);
        Some(Self { rest, slowest: (speed[first], load[first]), scatter: (squared / free as f64).sqrt() })
    }
}

#[cfg(test)]
mod tests {
    use crate::log::Log;
    use crate::signal::bad::found;

    /// Eleven levels of a rotor that turns at each of them but where the command is 1000 us; `read` makes the reading of a row and its speed, `zero` is
    /// what the load cell reads at rest.
    fn rows(first_us: f64, zero: f64, read: impl Fn(usize, f64) -> f64) -> Vec<(usize, f64)> {
        let mut text = String::from("# quadrig-log 1\nt_s,pulse_us,rpm,thrust_n\n");
        for row in 0..11_u32 {
            let pulse = first_us + (2000.0 - first_us) / 10.0 * f64::from(row);
            let speed = if pulse > 1000.0 { 1500.0 + 11.0 * (pulse - 1000.0) } else { 0.0 };
            // blades gain with the speed
            let thrust = 1.2e-8 * speed.powi(2) * (speed.max(1.0) / 8000.0).powf(0.2) + 0.004 * f64::from(row * 7 % 5);
            text += &format!("{},{pulse},{:.0},{:.5}\n", 2 * row, read(row as usize, speed), thrust + zero);
        }
        let log = Log::parse("table.csv", text.as_bytes()).expect("a log");
        found(&log).into_iter().map(|a| (a.row, a.expected)).collect()
    }

    #[test]
    fn a_level_that_lifts_and_reads_nothing_is_not_read() {
        for read in [0.0, 226.0] {
            let found = rows(1050.0, 0.0, |row, speed| if row == 0 { read } else { speed });
            let [(0, expected)] = found[..] else { panic!("{found:?}") };
            assert!((1200.0..2600.0).contains(&expected), "{expected}");
        }
        // beside a row of rest too
        let found = rows(1000.0, 0.0, |row, speed| if row < 2 { 0.0 } else { speed });
        assert!(matches!(found[..], [(1, _)]), "{found:?}");
    }

    #[test]
    fn a_rotor_at_rest_is_read() {
        for zero in [-0.03, 0.0, 0.03] {
            assert_eq!(rows(1000.0, zero, |_, speed| speed), []);
        }
        assert_eq!(rows(1050.0, 0.0, |_, speed| speed), [], "all is read");
    }
}
