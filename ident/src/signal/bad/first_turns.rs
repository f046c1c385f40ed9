//! A tachometer before the rotor's first turns are done.
//!
//! What it is: a tachometer times its marks, so that it reads nothing until the second one has passed; with one mark a turn that is up to two
//! turns after the start. Its zeros of that time are no readings.
//! What can go wrong: a rotor that stands for a moment after the command is not told from one that has begun to turn.
//! Units: rows, s, rev/min.
//! Reference: two turns from rest at a constant acceleration take 2 x 2/n at the speed n that is reached (turns, turns a second).

use super::excursion::Event;
use super::witness::Witnesses;
use crate::signal::stretches::CALM_US;
use std::collections::BTreeMap;

/// Turns, times two for a speed that grows evenly from nothing, in s rev/min.
const SILENT: f64 = 2.0 * 2.0 * 60.0;

/// The rows in which a tachometer had not seen its second mark.
pub(super) fn found(witnesses: &Witnesses<'_>, name: &'static str) -> Vec<Event> {
    let Some(read) = witnesses.clean(name) else { return Vec::new() };
    let measured: Vec<usize> = (0..read.len()).filter(|i| read[*i].is_finite()).collect();
    let rests = |i: &usize| read[*i] <= 0.0;
    let standing = stands(witnesses, read);
    let stands = |row: usize| witnesses.pulse().is_none() || standing(row);
    let first_readings = measured.windows(2).enumerate().filter(|(_, w)| rests(&w[0]) && !rests(&w[1]));
    first_readings
        .filter_map(|(k, w)| {
            let first = w[1];
            let rest: Vec<usize> = measured[..=k].iter().rev().copied().take_while(rests).collect();
            let commanded = |i: usize| witnesses.pulse().is_none_or(|p| (p[i] - p[first]).abs() <= CALM_US);
            let silent = |i: &&usize| witnesses.t[first] - witnesses.t[**i] < SILENT / read[first] && commanded(**i);
            let rows = rest.iter().take_while(silent).count();
            // a stretch without a row of rest before it is a drop-out, and no start
            let start = (rows > 0 && rest.get(rows).is_some_and(|before| stands(*before))).then(|| rest[rows - 1])?;
            Some(Event { rows: start..first, worst: start, expected: read[first], at_step: true, silent: true })
        })
        .collect()
}

/// Whether the rotor stands at the command of a row: most readings at that command say nothing. At no row of a log without a command.
pub(super) fn stands<'w>(witnesses: &'w Witnesses<'_>, read: &[f64]) -> impl Fn(usize) -> bool + use<'w> {
    let level = |p: f64| (p / CALM_US).round() as i64;
    // readings at each command, and those that say nothing
    let mut at_command: BTreeMap<i64, [usize; 2]> = BTreeMap::new();
    let pulse = witnesses.pulse();
    for (p, v) in pulse.into_iter().flatten().zip(read).filter(|(_, v)| v.is_finite()) {
        let [all, none] = at_command.entry(level(*p)).or_default();
        *all += 1;
        *none += usize::from(*v <= 0.0);
    }
    move |row| pulse.and_then(|p| at_command.get(&level(p[row]))).is_some_and(|[all, none]| 2 * none > *all)
}

#[cfg(test)]
mod tests {
    use crate::log::Log;
    use crate::signal::bad::found;

    /// A rotor that is started at 10 s; its tachometer is silent for `silent` rows of a tenth of a second, then reads 600 rev/min.
    fn started(silent: usize) -> Log {
        let mut text = String::from("# quadrig-log 1\nt_s,pulse_us,rpm,thrust_n\n");
        for row in 0..400 {
            let on = row >= 100;
            let (pulse, thrust) = if on { (1100, 0.06) } else { (1000, 0.0) };
            let rpm = if row >= 100 + silent { 600.0 + f64::from(row as u32 % 7) } else { 0.0 };
            text +=
                &format!("{:.1},{pulse},{rpm},{:.4}\n", 0.1 * f64::from(row as u32), thrust + 1e-4 * f64::from(row as u32 % 5));
        }
        Log::parse("started.csv", text.as_bytes()).expect("a log")
    }

    #[test]
    fn the_zeros_of_two_turns_are_no_readings_and_those_of_rest_are() {
        let rows =
            |silent| found(&started(silent)).into_iter().filter(|a| a.channel == "rpm").map(|a| a.span()).collect::<Vec<_>>();
        assert_eq!(rows(2), vec![100..102; 1]);
        assert!(rows(0).is_empty(), "{:?}", rows(0));
        // of a longer silence the load says that the rotor turned: a mark was lost
        assert_eq!(rows(30), vec![100..130; 1]);
    }

    /// A mark that is lost across a step of the command, on a rotor that turns before and after.
    #[test]
    fn zeros_of_a_rotor_that_was_told_to_turn_are_no_start() {
        let mut text = String::from("# quadrig-log 1\nt_s,pulse_us,rpm\n");
        for row in 0..400_u32 {
            let pulse = if row < 200 { 1500 } else { 1520 };
            let rpm = if (150..204).contains(&row) { 0 } else { 600 + row % 7 };
            text += &format!("{:.2},{pulse},{rpm}\n", 0.02 * f64::from(row));
        }
        let log = Log::parse("lost.csv", text.as_bytes()).expect("a log");
        assert!(super::found(&crate::signal::bad::witness::Witnesses::of(&log), "rpm").is_empty());
    }
}
