//! The measures of all runs.
//!
//! What it is: each channel beside the curve of all runs, the supply, what speed sensors differ by, the surroundings of the day, and the
//! constants of the thesis.
//! What can go wrong: what a run cannot tell is missing for that run; what fewer than [`FEWEST`] runs tell is left out.
//! Units: as each measure states.
//! Reference: specification `identification.md`, item 3.

use super::FEWEST;
use super::channel::{Told, measure, samples, told};
use super::curve::{Curve, SAMPLES, curves};
use super::measure::{Measure, Scale, Value};
use crate::channel::{Context, STANDSTILL};
use crate::identify::identify;
use crate::log::{Log, SPEED};
use crate::numeric::order::{median, quantum};
use crate::numeric::parallel::in_parallel;
use crate::numeric::solve::Normal;
use crate::verdict::words;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rows by which a lag is told.
const MOVING: usize = 24;

/// For each run one value a measure.
type Table = Vec<Vec<Option<Value>>>;

/// The measures and each run's values of them; nothing where no channel has a curve.
pub(super) fn of(logs: &[&Log], progress: &(dyn Fn(f64) + Sync)) -> Option<(Vec<Measure>, Table)> {
    let done = AtomicUsize::new(0);
    let tick = || progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / (2 * logs.len()) as f64);
    let contexts = in_parallel(logs.len(), &|k| {
        let context = Context::new(logs[k], None);
        tick();
        context
    });
    let curves = curves(&contexts);
    if curves.is_empty() {
        return None;
    }
    let all: Vec<Vec<Told>> = in_parallel(logs.len(), &|k| {
        let told = of_run(logs[k], &contexts[k], &curves);
        tick();
        told
    });
    let mut measures: Vec<Measure> = Vec::new();
    for (m, _) in all.iter().flatten() {
        if !measures.iter().any(|known| known.name == m.name) {
            measures.push(m.clone());
        }
    }
    measures.retain(|m| all.iter().filter(|run| run.iter().any(|(own, _)| own.name == m.name)).count() >= FEWEST);
    measures.sort_by_key(|m| (m.asked, m.of_day));
    let values = |run: &Vec<Told>| {
        let of = |m: &Measure| run.iter().find(|(own, _)| own.name == m.name).map(|(_, v)| *v);
        measures.iter().map(of).collect()
    };
    let table = all.iter().map(values).collect();
    Some((measures, table))
}

fn of_run(log: &Log, context: &Context, curves: &[Curve]) -> Vec<Told> {
    let mut out = constants(log);
    out.extend(curves.iter().filter_map(|c| told(context, c)).flatten());
    let beside = contrasts(&out);
    out.extend(beside);
    out.extend(supply(context));
    out.extend(differences(log, context));
    out.extend(day(log));
    out.retain(|(_, v)| v.value.is_finite() && v.se.is_finite() && v.se > 0.0);
    out
}

/// What identification gives: shown, and made up of what is asked by itself.
fn constants(log: &Log) -> Vec<Told> {
    let found = identify(log).map(|found| found.constants).unwrap_or_default();
    let of = |c: &crate::identify::Constant| {
        let m = Measure {
            name: c.name.to_owned(),
            words: c.words().to_owned(),
            unit: c.unit.to_owned(),
            scale: Scale::Linear,
            channel: String::new(),
            of_two: false,
            asked: false,
            of_day: false,
        };
        (m, Value { value: c.value, se: c.se })
    };
    found.iter().map(of).collect()
}

/// Voltage without load, and what it gives way for each ampere.
fn supply(context: &Context) -> Vec<Told> {
    let Some(target) = context.target("voltage_v").map(|k| &context.targets[k]) else { return Vec::new() };
    let places: Vec<usize> = (0..target.rows.len()).filter(|k| target.claims(target.rows[*k])).collect();
    if places.len() < SAMPLES {
        return Vec::new();
    }
    let pick = |v: &[f64]| -> Vec<f64> { places.iter().map(|k| v[target.rows[*k]]).collect() };
    let mut columns = vec![vec![1.0; places.len()]];
    let (from, to) = (context.t[0], context.t[context.len() - 1]);
    columns.push(pick(&context.t.iter().map(|t| (t - from) / (to - from).max(1e-9) - 0.5).collect::<Vec<f64>>()));
    columns.extend(context.current.as_ref().map(|c| pick(c)));
    let y: Vec<f64> = places.iter().map(|k| target.y[*k]).collect();
    let Some(s) = Normal::of_columns(&columns, &y, &vec![1.0; y.len()]).solve() else { return Vec::new() };
    let variance = s.rss / (y.len() - columns.len()).max(1) as f64;
    let value = |j: usize, times: f64| Value { value: times * s.coefficients[j], se: (s.inverse[(j, j)] * variance).sqrt() };
    let linear = |id: &str, words: &str, unit: &str| measure("voltage_v", id, words.to_owned(), unit, Scale::Linear);
    let no_load = Measure { of_day: true, asked: false, ..linear("zero", "voltage without load", "V") };
    let mut out = vec![(no_load, value(0, 1.0)), (linear("drift", "drift of the supply within a run", "V"), value(1, 1.0))];
    if columns.len() > 2 {
        out.push((linear("resistance", "resistance of the supply", "ohm"), value(2, -1.0)));
    }
    if target.noise.rms > 0.0 {
        let rms = target.noise.rms;
        let noise = measure("voltage_v", "noise", "noise floor of the voltage".to_owned(), "V", Scale::Log);
        out.push((noise, Value { value: rms, se: rms / (2.0 * y.len() as f64).sqrt() }));
    }
    out.extend(samples(context, target));
    out
}

/// What each speed sensor reads beyond the others, at half and at full speed, and how it scatters about that.
fn differences(log: &Log, context: &Context) -> Vec<Told> {
    let channels: Vec<(&'static str, &[f64])> = SPEED
        .into_iter()
        .filter_map(|name| Some((name, log.column(name)?)))
        .filter(|(name, _)| context.target(name).is_some())
        .collect();
    if channels.len() < 2 {
        return Vec::new();
    }
    let mut top: Vec<f64> = context.rpm.iter().copied().filter(|v| *v > STANDSTILL).collect();
    if top.len() < SAMPLES {
        return Vec::new();
    }
    top.sort_by(f64::total_cmp);
    let top = top[top.len() * 49 / 50];
    let mut out = Vec::new();
    for (name, own) in &channels {
        let others = others_of(&channels, name, log.len());
        let mut columns = [Vec::new(), Vec::new()];
        let mut y = Vec::new();
        let both = |row: &usize| own[*row].is_finite() && others[*row].is_finite();
        for row in (0..log.len()).filter(both).filter(|row| context.rpm[*row] > 0.2 * top) {
            columns[0].push(1.0);
            columns[1].push(context.rpm[row] / top - 0.5);
            y.push(100.0 * (own[row] - others[row]) / context.rpm[row]);
        }
        if y.len() < SAMPLES {
            continue;
        }
        // single rows that are far off are counted by themselves and must not carry the level
        let centre = median(&mut y.clone());
        let spread = median(&mut y.iter().map(|v| (v - centre).abs()).collect::<Vec<f64>>()).max(1e-6);
        let weights: Vec<f64> = y.iter().map(|v| f64::from(u8::from((v - centre).abs() < 8.0 * spread))).collect();
        let Some(s) = Normal::of_columns(&columns, &y, &weights).solve() else { continue };
        let n = weights.iter().sum::<f64>();
        let variance = (s.rss / (n - 2.0).max(1.0)).max(1e-12);
        let value = |j: usize| Value { value: s.coefficients[j], se: (s.inverse[(j, j)] * variance).sqrt() };
        let words = words::channel(name);
        out.push((measure(name, "beyond the others", format!("{words} beyond the other speeds"), "%", Scale::Linear), value(0)));
        out.push((
            measure(name, "beyond with speed", format!("{words} beyond the others, over the speed"), "%", Scale::Linear),
            value(1),
        ));
        // sensors that read the same to the last digit scatter by that digit
        let rms = variance.sqrt().max(100.0 * quantum(own) / (12.0_f64.sqrt() * top));
        let scatter = measure(name, "scatter beside", format!("scatter of {words} about the others"), "%", Scale::Log);
        out.push((scatter, Value { value: rms, se: rms / (2.0 * n).sqrt() }));
        out.extend(lag(context, own, &others, &words, name));
        let far = y.len() as f64 - n + 0.5;
        let odd = measure(name, "odd rows", format!("rows in which {words} stands alone"), "%", Scale::Count);
        let share = 100.0 / y.len() as f64;
        out.push((odd, Value { value: share * far, se: share * far.sqrt() }));
    }
    out
}

/// The median of the other speed sensors on each row; no number where none reads.
fn others_of(channels: &[(&'static str, &[f64])], name: &str, rows: usize) -> Vec<f64> {
    let of = |row: usize| {
        let mut all: Vec<f64> = channels.iter().filter(|c| c.0 != name).map(|c| c.1[row]).filter(|v| v.is_finite()).collect();
        if all.is_empty() { f64::NAN } else { median(&mut all) }
    };
    (0..rows).map(of).collect()
}

/// By how much a speed sensor is behind the others: what it reads less than they do, over what they rise by in a second, where they move most.
fn lag(context: &Context, own: &[f64], others: &[f64], words: &str, name: &'static str) -> Option<Told> {
    let t = &context.t;
    let moves: Vec<(f64, f64)> = (1..others.len().saturating_sub(1))
        .map(|i| ((others[i + 1] - others[i - 1]) / (t[i + 1] - t[i - 1]), others[i] - own[i]))
        .filter(|(rate, behind)| rate.is_finite() && behind.is_finite())
        .collect();
    let mut rates: Vec<f64> = moves.iter().map(|m| m.0.abs()).collect();
    rates.sort_by(f64::total_cmp);
    let fast = rates.get(rates.len().checked_sub(MOVING)?).copied().filter(|rate| *rate > 0.0)?;
    let mut behind: Vec<f64> = moves.iter().filter(|m| m.0.abs() >= fast).map(|m| 1000.0 * m.1 / m.0).collect();
    let n = behind.len() as f64;
    let middle = median(&mut behind);
    let spread = 1.4826 * median(&mut behind.iter().map(|v| (v - middle).abs()).collect::<Vec<f64>>());
    // the standard error of a median; no clock is better than a hundredth of a row
    let se = (1.2533 * spread / n.sqrt()).max(10.0 * context.step());
    let of = measure(name, "late beside", format!("{words} behind the others"), "ms", Scale::Linear);
    Some((of, Value { value: middle, se }))
}

/// How the gains of two channels over the speed differ: the day's air, which moves all of them alike, falls out.
fn contrasts(told: &[Told]) -> Vec<Told> {
    const PAIRS: [[&str; 2]; 3] = [["thrust_n", "torque_nm"], ["thrust_n", "current_a"], ["torque_nm", "current_a"]];
    let gain = |channel: &str| told.iter().find(|(m, _)| m.channel == channel && m.name.ends_with(" gain")).map(|(_, v)| *v);
    let of = |[a, b]: [&str; 2]| {
        let (one, other) = (gain(a)?, gain(b)?);
        let (of_a, of_b) = (words::channel(a), words::channel(b));
        let m = measure(a, &format!("gain beside {b}"), format!("gain of {of_a} beside that of {of_b}"), "%", Scale::Linear);
        let m = Measure { of_two: true, ..m };
        Some((m, Value { value: one.value - other.value, se: one.se.hypot(other.se) }))
    };
    PAIRS.into_iter().filter_map(of).collect()
}

/// Mean temperature and pressure.
fn day(log: &Log) -> Vec<Told> {
    let of = |(column, words, unit): (&str, &str, &str)| {
        let values: Vec<f64> = log.column(column)?.iter().copied().filter(|v| v.is_finite()).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        let m = Measure { asked: false, of_day: true, ..measure(column, "mean", words.to_owned(), unit, Scale::Linear) };
        (n >= 1.0).then_some((m, Value { value: mean, se: (square / n).sqrt().max(1e-6) }))
    };
    [("temp_c", "temperature", "degC"), ("pressure_hpa", "pressure", "hPa")].into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    /// Four sensors of a speed that moves; the last of them a twentieth of a second late, and all of them whole numbers.
    #[test]
    fn a_sensor_that_is_late_is_told_in_milliseconds() {
        let t: Vec<f64> = (0..1200).map(|i| 0.02 * f64::from(i)).collect();
        let ramp = |t: f64| (1000.0 + 4000.0 * ((0.5 * t).sin() + 1.0)).round();
        let of = |late: f64| t.iter().map(|t| ramp(t - late)).collect::<Vec<f64>>();
        let columns = [("rpm_beam", of(0.0)), ("rpm_opto", of(0.0)), ("rpm_hall", of(0.0)), ("rpm_encoder", of(0.05))];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.into(), values }).collect();
        let log = Log { name: "late.csv".into(), t, columns, ..Log::default() };
        let told = differences(&log, &Context::new(&log, None));
        let of = |name: &str| told.iter().find(|(m, _)| m.name == name).map(|(_, v)| *v).expect(name);
        let late = of("rpm_encoder late beside");
        assert!((late.value - 50.0).abs() < 3.0 && late.se < 3.0, "{late:?}");
        assert!(of("rpm_beam late beside").value.abs() < 3.0);
        // sensors that read the same to the last digit scatter by that digit, not by nothing
        assert!(of("rpm_beam scatter beside").value > 1e-3, "{:?}", of("rpm_beam scatter beside"));
    }

    /// Dense air lifts thrust and torque alike: how their gains differ does not know of it.
    #[test]
    fn the_days_air_falls_out_of_two_gains() {
        let gain = |channel: &str, value: f64| {
            let of = measure(channel, "gain", "gain".to_owned(), "%", Scale::Linear);
            (of, Value { value, se: 0.1 })
        };
        let beside = |thrust: f64, torque: f64| contrasts(&[gain("thrust_n", thrust), gain("torque_nm", torque)])[0].1;
        assert_eq!(beside(2.0, 2.0).value, beside(-1.0, -1.0).value);
        assert!((beside(-3.0, 1.0).value + 4.0).abs() < 1e-12 && (beside(0.0, 0.0).se - 0.1 * 2.0_f64.sqrt()).abs() < 1e-12);
    }
}
