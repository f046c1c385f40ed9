//! What is wrong in a log, counted: the part of the report that repairs nothing.
//!
//! What it is: uneven time steps and gaps, glitch rows, coarse steps of a channel.
//! What can go wrong: nothing; a healthy log adds no line.
//! Units: the channel's; seconds.
//! Reference: specification `formats.md`, `quadrig import`; `identification.md`, item 6.

use super::Report;
use crate::log::{Gaps, Log, trimmed};
use crate::numeric::order::{median, quantum};

/// A gap is longer than so many usual steps.
const GAP: f64 = 5.0;
/// A glitch leaves its neighbours by so many usual differences, and by this share of the channel's range.
const GLITCH: (f64, f64) = (40.0, 0.05);
/// A step is coarse above this share of the scatter between neighbours.
const COARSE: f64 = 0.5;

/// Adds what is wrong in a log to the report.
pub(super) fn inspect(log: &Log, report: &mut Report) {
    if !log.time_is_row() {
        time_steps(log, report);
    }
    for column in &log.columns {
        let present: Vec<f64> = column.values.iter().copied().filter(|v| v.is_finite()).collect();
        let count = glitches(&present);
        report.add(
            &column.name,
            "glitches: one or two samples far from both neighbours; kept, left out of means and fits",
            count,
        );
        let (step, scatter) = (quantum(&present), scatter(&present));
        let distinct = distinct(&present);
        if column.name != "pulse_us" && step > 0.0 && distinct > 2 && (scatter == 0.0 || step > COARSE * scatter) {
            report.add(&column.name, format!("distinct values: coarse steps of {} hide the noise", few(step)), distinct);
        }
    }
}

fn time_steps(log: &Log, report: &mut Report) {
    let steps: Vec<f64> = log.t.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.len() < 3 {
        return;
    }
    let usual = median(&mut steps.clone());
    let longest = steps.iter().copied().fold(0.0, f64::max);
    let uneven = steps.iter().filter(|s| (*s / usual - 1.0).abs() > 0.2).count();
    report.add("t_s", format!("time steps more than a fifth off the usual {} s: kept as they are", few(usual)), uneven);
    let gaps = steps.iter().filter(|s| **s > GAP * usual).count();
    report.add(
        "t_s",
        format!("gaps of more than {GAP:.0} steps, the longest {} s: kept, nothing is filled in", few(longest)),
        gaps,
    );
    if let Some(gaps) = Gaps::of(log) {
        report.add("t_s", gaps.to_string(), 1);
    }
}

/// Figures of a step that is told.
const FIGURES: f64 = 4.0;

/// A step to so many figures, however small it is.
fn few(v: f64) -> String {
    let places = FIGURES - 1.0 - v.abs().max(f64::MIN_POSITIVE).log10().floor();
    trimmed(v, places.clamp(0.0, 300.0) as usize)
}

/// Isolated excursions of one or two samples.
fn glitches(z: &[f64]) -> usize {
    let mut differences: Vec<f64> = z.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 0.0).collect();
    if differences.len() < 20 {
        return 0;
    }
    let usual = median(&mut differences);
    let mut sorted = z.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let range = sorted[sorted.len() * 99 / 100] - sorted[sorted.len() / 100];
    let far = (GLITCH.0 * usual).max(GLITCH.1 * range);
    let (mut count, mut i) = (0, 1);
    while i + 1 < z.len() {
        let back = (1..=2).find(|m| z.get(i + m).is_some_and(|after| (after - z[i - 1]).abs() < 0.2 * far));
        match back {
            Some(m) if (i..i + m).all(|k| (z[k] - z[i - 1]).abs() > far) => {
                count += m;
                i += m;
            }
            _ => i += 1,
        }
    }
    count
}

/// Typical difference between neighbours that differ at all less often than they stay, 0 where most are equal.
fn scatter(z: &[f64]) -> f64 {
    let mut d: Vec<f64> = z.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    if d.is_empty() { 0.0 } else { median(&mut d) }
}

fn distinct(z: &[f64]) -> usize {
    let mut v = z.to_vec();
    v.sort_unstable_by(f64::total_cmp);
    v.dedup();
    v.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    #[test]
    fn each_fault_is_counted() {
        let mut t: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        t[150..].iter_mut().for_each(|t| *t += 3.0);
        let mut rpm: Vec<f64> = (0..200).map(|i| 3000.0 + 10.0 * (f64::from(i) * 2.4).sin()).collect();
        rpm[60] = 9000.0;
        rpm[90] = 0.0;
        rpm[91] = 0.0;
        let volt: Vec<f64> = (0..200).map(|i| 11.5 + 0.1 * f64::from(i / 17 % 12)).collect();
        let log = Log {
            t,
            columns: vec![Column { name: "rpm".into(), values: rpm }, Column { name: "voltage_v".into(), values: volt }],
            ..Log::default()
        };
        let mut report = Report::default();
        inspect(&log, &mut report);
        let of =
            |column: &str, word: &str| report.notes.iter().find(|n| n.column == column && n.what.contains(word)).map(|n| n.count);
        assert_eq!(of("rpm", "glitches"), Some(3));
        assert_eq!(of("t_s", "gaps"), Some(1));
        assert_eq!(of("voltage_v", "coarse steps of 0.1"), Some(12));
        assert_eq!(of("rpm", "coarse"), None);
    }

    /// A fine display in a large unit, a fast log: no step is told as nothing.
    #[test]
    fn a_small_step_keeps_its_digits() {
        for (step, said) in [(2e-5, "0.00002"), (65.4, "65.4"), (0.1, "0.1"), (1.234_56e-7, "0.0000001235"), (12_345.6, "12346")]
        {
            assert_eq!(few(step), said);
        }
        let torque: Vec<f64> = (0..200).map(|i| 2e-5 * f64::from(i / 17 % 12)).collect();
        let t = (0..200).map(|i| 2e-5 * f64::from(i + i / 3)).collect();
        let log = Log { t, columns: vec![Column { name: "torque_nm".into(), values: torque }], ..Log::default() };
        let mut report = Report::default();
        inspect(&log, &mut report);
        let said: Vec<&str> = report.notes.iter().map(|n| n.what.as_str()).collect();
        for told in ["coarse steps of 0.00002 hide", "off the usual 0.00002 s"] {
            assert!(said.iter().any(|what| what.contains(told)), "{said:?}");
        }
    }
}
