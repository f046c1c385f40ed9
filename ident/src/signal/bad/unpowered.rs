//! A voltmeter before the supply is switched on, and after it is switched off.
//!
//! What it is: the readings of next to nothing at either end of a log whose other readings are those of a supply, while the command rests and no
//! current flows. They are of no supply, and the rig has none then.
//! What can go wrong: a supply that fails while the motor is told to turn is an event of the run, and stays.
//! Units: rows, V.
//! Reference: none.

use super::excursion::Event;
use super::{CHANNEL_OF_SUPPLY, FEWEST};
use crate::log::Log;
use crate::numeric::order::median;
use crate::signal::stretches::CALM_US;

/// Share of the usual voltage below which there is no supply, and of the largest current below which none flows: controllers cut off at half of
/// their supply, and a tenth of it runs none.
const NONE: f64 = 0.1;

/// The rows without a supply: those at the beginning, and those at the end.
pub(super) fn found(log: &Log) -> Vec<Event> {
    let Some(volts) = log.column(CHANNEL_OF_SUPPLY) else { return Vec::new() };
    let powered: Vec<f64> = volts.iter().copied().filter(|v| *v > 0.0).collect();
    if powered.len() < FEWEST {
        return Vec::new();
    }
    let usual = median(&mut powered.clone());
    let rests = resting(log);
    let off = |row: &usize| volts[*row].is_nan() || volts[*row].abs() < NONE * usual && rests(*row);
    let (all, on) = (volts.len(), |row: &usize| !off(row));
    let (Some(first), Some(last)) = ((0..all).find(on), (0..all).rfind(on)) else { return Vec::new() };
    let event = |rows: std::ops::Range<usize>, beside: usize| {
        let worst = rows.clone().find(|row| volts[*row].is_finite())?;
        Some(Event { worst, expected: volts[beside], rows, at_step: false, silent: false })
    };
    event(0..first, first).into_iter().chain(event(last + 1..all, last)).collect()
}

/// Whether on a row the command is at its lowest and no current flows, as far as the log has both.
fn resting(log: &Log) -> impl Fn(usize) -> bool + '_ {
    let finite = |name| log.column(name).into_iter().flatten().copied().filter(|v: &f64| v.is_finite());
    let lowest = finite("pulse_us").fold(f64::INFINITY, f64::min);
    let most = finite("current_a").fold(0.0, f64::max);
    move |row| {
        let commanded = log.column("pulse_us").is_none_or(|p| p[row].is_nan() || p[row] < lowest + CALM_US);
        commanded && log.column("current_a").is_none_or(|a| a[row].is_nan() || a[row].abs() < NONE * most)
    }
}

#[cfg(test)]
mod tests {
    use crate::log::{Column, Log};
    use crate::signal::bad::found;

    /// A staircase whose voltmeter reads nothing on some rows.
    fn log(off: impl Fn(usize) -> bool) -> Log {
        let t: Vec<f64> = (0..600).map(|i| 0.1 * f64::from(i)).collect();
        let wave = |i: usize| 0.01 * ((i * i) as f64 * 0.7).sin();
        let level = |i: usize| if (100..500).contains(&i) { (i / 50) as f64 } else { 0.0 };
        let of = |f: &dyn Fn(usize) -> f64| (0..600).map(f).collect::<Vec<f64>>();
        let volts = |i: usize| if off(i) { 0.1 * wave(i) } else { 12.0 - 0.05 * level(i) + wave(i) };
        let columns = [
            ("pulse_us", of(&|i| 1000.0 + 40.0 * level(i))),
            ("current_a", of(&|i| level(i) + wave(i + 7))),
            ("voltage_v", of(&volts)),
        ];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.into(), values }).collect();
        Log { name: "off.csv".into(), t, columns, ..Log::default() }
    }

    fn rows(log: &Log) -> Vec<std::ops::Range<usize>> {
        found(log).into_iter().filter(|a| a.channel == "voltage_v").map(|a| a.span()).collect()
    }

    #[test]
    fn readings_without_a_supply_are_set_aside() {
        let off = log(|i| !(53..580).contains(&i));
        assert_eq!(rows(&off), vec![0..53, 580..600]);
        let first = found(&off).remove(0);
        assert!(first.value.abs() < 0.01 && (first.expected - 12.0).abs() < 0.1, "{first}");
        assert!(rows(&log(|_| false)).is_empty());
    }

    #[test]
    fn a_supply_that_fails_under_load_stays() {
        assert!(rows(&log(|i| i >= 450)).iter().all(|rows| rows.start >= 500), "{:?}", rows(&log(|i| i >= 450)));
    }
}
