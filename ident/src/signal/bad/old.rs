//! A speed that had waited while the logger paused.
//!
//! What it is: a logger that is busy for some rows' time, mostly because it sends a command, then writes the speed that it was given in between. The
//! first reading behind the pause is of some moment in it.
//! What can go wrong: a rotor that is rather slow for the rows is not on its way by as much, and its reading stays; it is off by little.
//! Units: rows, s, rev/min.
//! Reference: none; seen on RCbenchmark 1585 stands (recorded sets `stand1585-micro` and `stand1585-sov5`).

use super::excursion::Event;
use crate::log::Log;
use crate::numeric::order::usual_step;
use crate::signal::stretches::{CALM_US, GAP, far};

/// The rows right behind a pause whose next one is far from them: a rotor that goes so far within a row has gone farther in the pause. Not where the
/// command steps from the one to the other: that is what sends it.
pub(super) fn found(log: &Log, name: &str) -> Vec<Event> {
    let Some(speed) = log.column(name) else { return Vec::new() };
    let (t, pause) = (&log.t, GAP * usual_step(&log.t));
    let is_old = |i: &usize| t[*i] - t[*i - 1] > pause && t[*i + 1] - t[*i] < pause && far(speed[*i], speed[*i + 1]);
    let command = log.column("pulse_us");
    let steps = |i: &usize| command.is_some_and(|p| (p[*i + 1] - p[*i]).abs() > CALM_US);
    let between = |i: usize| speed[i - 1] + (speed[i + 1] - speed[i - 1]) * (t[i] - t[i - 1]) / (t[i + 1] - t[i - 1]);
    (1..speed.len().saturating_sub(1))
        .filter(|i| speed[i - 1..=i + 1].iter().all(|v| v.is_finite()))
        .filter(|i| is_old(i) && !steps(i))
        .map(|i| Event { rows: i..i + 1, worst: i, expected: between(i), at_step: true, silent: false })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::channel::Context;
    use crate::log::{Column, Log};
    use crate::signal::bad::found;

    /// A rotor that is told to turn at 4000 rev/min, and from row 40 on at 29 000; the logger pauses before rows 40 and 70.
    fn log() -> Log {
        let pauses = [40, 70];
        let mut t = vec![0.0];
        (1..100).for_each(|i| t.push(t[i - 1] + if pauses.contains(&i) { 0.1 } else { 0.01 }));
        let sets_out = t[39] + 0.05;
        let truth = |t: f64| if t < sets_out { 4000.0 } else { 29_000.0 - 25_000.0 * f64::exp((sets_out - t) / 0.02) };
        let rpm: Vec<f64> = (0..100).map(|i| truth(if i == 40 { t[39] } else { t[i] }) + (i % 3) as f64).collect();
        let thrust = t.iter().map(|t| 4e-9 * truth(*t).powi(2)).collect();
        let pulse = (0..100).map(|i| if i < 40 { 1100.0 } else { 1500.0 }).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm), ("thrust_n", thrust)];
        let columns = columns.map(|(name, values)| Column { name: name.to_owned(), values }).to_vec();
        Log { t, columns, ..Log::default() }
    }

    #[test]
    fn the_speed_of_before_a_pause_is_none_behind_it() {
        let log = log();
        let rows: Vec<usize> = found(&log).iter().filter(|a| a.channel == "rpm").map(|a| a.row).collect();
        assert_eq!(rows, [40], "a pause in which nothing moves leaves its reading");
        let context = Context::new(&log, None);
        assert!(context.rpm[40] > 15_000.0, "{}", context.rpm[40]);
        for target in &context.targets {
            assert!(!target.rows.contains(&40), "no sample of {}", target.name);
        }
    }

    /// Sweeps of one row a level, with a pause between them: at the lowest level the rotor stands in each, and the next level sends it.
    #[test]
    fn a_level_of_one_row_behind_a_pause_is_read() {
        let mut text = String::from("# quadrig-log 1\nt_s,pulse_us,rpm\n");
        for sweep in 0..4 {
            for level in 0..16 {
                let rpm = if level == 0 { 0 } else { 3000 + 2000 * level - 20 * sweep };
                text += &format!("{},{},{rpm}\n", 90 * sweep + 4 * level, 1000 + 50 * level);
            }
        }
        let log = Log::parse("run.csv", text.as_bytes()).expect("a log");
        assert_eq!(found(&log), []);
        assert_eq!(Context::new(&log, None).start_pulse_us, 1025.0);
    }
}
