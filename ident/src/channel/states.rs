//! Rows at which the rotor's state is known by itself, and those at which it is not known.
//!
//! What it is: behind a gap, at a run's start and while a controller starts its motor, no command tells the speed; the reading does. Where nobody read
//! a speed on its way, nothing does.
//! What can go wrong: a rotor that is told to turn and never does is none of these: that is a fault, and is predicted.
//! Units: s, us, rev/min.
//! Reference: specification `closing-the-loop.md`, step 2 (blocks after gaps).

use super::{Context, Relation, STANDSTILL};
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

/// Rows at which a relation predicts nothing, in order: a rotor that is told to turn and does not yet, and loads of a speed that nobody read while the
/// rotor went from one to another.
pub(super) fn given(context: &Context, relation: Relation) -> Vec<usize> {
    let Some(pulse) = context.pulse.as_ref().filter(|_| relation == Relation::SpeedFromPulse) else {
        return if relation.is_of_speed() { context.unread.clone() } else { Vec::new() };
    };
    let held_back = |row: &usize| {
        let stands = context.rpm.get(*row).is_some_and(|r| *r < STANDSTILL);
        stands && pulse[*row] >= context.start_pulse_us
    };
    context.starts.iter().map(|s| s.0).filter(held_back).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

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
}
