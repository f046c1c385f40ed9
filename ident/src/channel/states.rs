//! Rows at which the rotor's state is known by itself, and those at which it is not known.
//!
//! What it is: behind a gap, at a run's start and while a controller starts its motor, no command tells the speed; the reading does. Where nobody read
//! a speed on its way, nothing does.
//! What can go wrong: a rotor that is told to turn and never does is none of these: that is a fault, and is predicted.
//! Units: s, us, rev/min.
//! Reference: specification `closing-the-loop.md`, step 2 (blocks after gaps).

use super::{Context, Relation, STANDSTILL};
use crate::log::{Log, SPEED};
use crate::signal::stretches;

/// Rows at which the rotor's speed is known by itself, whatever came before ([`Context::starts`]).
pub(super) fn known(t: &[f64], rpm: &[f64], pulse: Option<&[f64]>, start_us: f64, settling: &[bool]) -> Vec<(usize, f64)> {
    let mut out = stretches::starts(t, rpm, settling.first() == Some(&true));
    if let Some(pulse) = pulse.filter(|_| !rpm.is_empty()) {
        let held_back = stretches::held_back(t, stretches::latest(t), |i| pulse[i] >= start_us, |i| rpm[i] < STANDSTILL);
        out.extend(held_back.into_iter().map(|i| (i, rpm[i])));
        out.sort_unstable_by_key(|(row, _)| *row);
        out.dedup_by_key(|(row, _)| *row);
    }
    out
}

/// Rows at which a relation predicts nothing, in order: a rotor that is told to turn and does not yet, or whose command is not known, and loads
/// of a speed that nobody read while the rotor went from one to another.
pub(super) fn given(context: &Context, relation: Relation) -> Vec<usize> {
    let Some(pulse) = context.pulse.as_ref().filter(|_| relation == Relation::SpeedFromPulse) else {
        return if relation.is_of_speed() { context.unread.clone() } else { Vec::new() };
    };
    let held_back = |row: &usize| {
        let stands = context.rpm.get(*row).is_some_and(|r| *r < STANDSTILL);
        stands && pulse[*row] >= context.start_pulse_us
    };
    let mut out: Vec<usize> = context.starts.iter().map(|s| s.0).filter(held_back).collect();
    out.extend(&context.uncommanded);
    out.sort_unstable();
    out.dedup();
    out
}

/// The speed on the rows that tell where the motor starts: those with a command, from the first reading to the last. What stands beyond them, the
/// nearest reading held, is not known to turn; a line between two readings is.
pub(super) fn told(log: &Log, rpm: &[f64], uncommanded: &[usize]) -> Vec<f64> {
    let columns: Vec<&[f64]> = SPEED.iter().filter_map(|s| log.column(s)).collect();
    let read = |row: &usize| columns.iter().any(|c| c[*row].is_finite());
    let (first, last) = ((0..rpm.len()).find(read), (0..rpm.len()).rfind(read));
    let told = |row: usize| first.is_some_and(|f| f <= row) && last.is_some_and(|l| row <= l);
    let mut out: Vec<f64> = rpm.iter().enumerate().map(|(row, v)| if told(row) { *v } else { f64::NAN }).collect();
    uncommanded.iter().filter(|row| **row < rpm.len()).for_each(|row| out[*row] = f64::NAN);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    /// 50 rows a second; told to turn from row 100 on, the rotor sets out 40 rows later.
    #[test]
    fn a_rotor_that_waits_for_its_controller_is_given_until_it_turns() {
        let rows = 300;
        let pulse = (0..rows).map(|i| if i < 100 { 1000.0 } else { 1500.0 }).collect();
        let turns = |i: i32| if i < 140 { 0.0 } else { 4000.0 * (1.0 - f64::exp(-f64::from(i - 139) / 10.0)) };
        let columns = [("pulse_us", pulse), ("rpm", (0..rows).map(turns).collect()), ("thrust_n", vec![1.0; rows as usize])];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.into(), values }).collect();
        let log = Log { t: (0..rows).map(|i| 0.02 * f64::from(i)).collect(), columns, ..Log::default() };
        let context = Context::new(&log, Some(1100.0));
        let [speed, thrust] = ["rpm", "thrust_n"].map(|name| &context.targets[context.target(name).expect("a channel")]);
        assert_eq!(speed.given, (100..140).collect::<Vec<_>>());
        assert!(speed.rows.iter().all(|row| !(100..140).contains(row)), "what is given is no sample");
        assert!(thrust.given.is_empty(), "a load follows the speed as it was read");
        assert_eq!(thrust.rows.len(), rows as usize);
    }

    /// A probe that misses the row of a step: nothing tells the speed there, and no load is predicted from it.
    #[test]
    fn a_load_of_a_speed_that_nobody_read_is_not_predicted() {
        let level = |i: usize| [2000.0, 6000.0][i / 50 % 2];
        let rpm = (0..300).map(|i| if [150, 220].contains(&i) { f64::NAN } else { level(i) }).collect();
        let thrust = (0..300).map(|i| 1e-7 * level(i) * level(i)).collect();
        let columns = [("rpm", rpm), ("thrust_n", thrust)].map(|(name, values)| Column { name: name.into(), values });
        let log = Log { t: (0..300).map(|i| 0.02 * f64::from(i)).collect(), columns: columns.to_vec(), ..Log::default() };
        let context = Context::new(&log, None);
        let target = &context.targets[context.target("thrust_n").expect("a channel")];
        assert_eq!(target.given, [150]);
        assert!(!target.claims(150) && target.claims(220), "a level says what its rows read");
    }

    /// A rotor at its slowest; then the recorder goes on without a command, and somebody has cut the motor. What the sensor gave up on is not known
    /// to turn, and what stood at the start stood.
    #[test]
    fn rows_without_a_command_tell_nothing_of_the_command() {
        let n = 400;
        let command = |i: usize| [1000.0, 1300.0, 1031.0, f64::NAN][i / 100];
        let speed = |i: usize| [0.0, 12_000.0, 1900.0, 0.0][i / 100];
        let columns = [("pulse_us", (0..n).map(command).collect()), ("rpm", (0..n).map(speed).collect())];
        let columns = columns.map(|(name, values): (&str, Vec<f64>)| Column { name: name.into(), values }).to_vec();
        let log = Log { t: (0..n).map(|i| 0.05 * i as f64).collect(), columns, ..Log::default() };
        let context = Context::new(&log, None);
        assert_eq!(context.start_pulse_us, 1015.5);
        let target = &context.targets[context.target("rpm").expect("a channel")];
        assert!(target.rows.iter().all(|row| *row < 300) && target.given.contains(&350));
    }

    /// A sensor that gives up on a rotor which coasts: what is held for its silence is not known to turn.
    #[test]
    fn a_speed_that_is_held_does_not_move_the_start() {
        let part = |i: usize| [60, 160].partition_point(|from| *from <= i);
        let coasts = |i: usize| if i < 166 { 12_000.0 - 1500.0 * (i as f64 - 159.0) } else { f64::NAN };
        let n = 300;
        let pulse = (0..n).map(|i| [1000.0, 1300.0, 1000.0][part(i)]).collect();
        let rpm = (0..n).map(|i| [0.0, 12_000.0, coasts(i)][part(i)]).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm)];
        let columns = columns.map(|(name, values): (&str, Vec<f64>)| Column { name: name.into(), values }).to_vec();
        let log = Log { t: (0..n).map(|i| 0.03 * i as f64).collect(), columns, ..Log::default() };
        assert_eq!(Context::new(&log, None).start_pulse_us, 1150.0);
    }
}
