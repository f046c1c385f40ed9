//! What of a model holds on which run.
//!
//! What it is: a run with a zero that drifts and a blade that is damaged; the model that is corrected on it predicts this run with both, and another
//! run of the rig without the drift and with the damage from the start, as the file says too.
//! What can go wrong: a drift that travels would be off by its rate times the length of the other run.
//! Units: N, s.
//! Reference: specification `formats.md`, "Scope".

use ident::channel::Context;
use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::model::Model;
use ident::verdict::Scope;

/// Zero drift of the first run, N/s, and the share of thrust and torque that a damaged blade loses at an instant of it, s.
const DRIFT: f64 = 0.002;
const DAMAGE: (f64, f64) = (0.12, 70.0);

fn noise(i: usize, k: u64) -> f64 {
    // twelve uniform numbers from splitmix64 (Steele, Lea & Flood 2014)
    let of = |j: u64| {
        let mut z = (12 * i as u64 + j + 1 + 1_000_003 * k).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..12).map(of).sum::<f64>() - 6.0
}

/// A run of 140 s; levels in an order that repeats each load.
fn run(name: &str, order: usize, drift: f64, damaged_from: Option<f64>) -> Log {
    let n = 1400;
    let t: Vec<f64> = (0..n).map(|i| 0.1 * i as f64).collect();
    let pulse: Vec<f64> = (0..n).map(|i| 1100.0 + 60.0 * ((i / 50 * order) % 14) as f64).collect();
    let lost = |i: usize| if damaged_from.is_some_and(|from| t[i] >= from) { DAMAGE.0 } else { 0.0 };
    let speed: Vec<f64> =
        (0..n).map(|i| 6.0 * (pulse[i] - 1000.0) * (1.0 + 0.3 * lost(i)) + 1.5 * noise(i, order as u64)).collect();
    let load = |k: f64, sigma: f64, stream: u64| -> Vec<f64> {
        (0..n).map(|i| k * speed[i].powi(2) * (1.0 - lost(i)) + sigma * noise(i, stream + 10 * order as u64)).collect()
    };
    let (mut thrust, torque) = (load(2.5e-7, 0.01, 2), load(4e-9, 2e-4, 3));
    thrust.iter_mut().zip(&t).for_each(|(y, t)| *y += drift * t);
    let current =
        (0..n).map(|i| 0.1 + 1.2e-10 * speed[i].powi(3) * (1.0 - lost(i)) + 0.02 * noise(i, 40 + order as u64)).collect();
    let columns = [("pulse_us", pulse), ("rpm", speed), ("thrust_n", thrust), ("torque_nm", torque), ("current_a", current)];
    let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
    Log { name: name.to_owned(), t, columns, ..Log::default() }
}

fn error(model: &Model, log: &Log, channel: &'static str) -> f64 {
    let context = Context::new(log, Some(model.start_pulse_us));
    let (prediction, target) = (model.predict(&context, channel).expect("known"), context.target(channel).expect("measured"));
    let target = &context.targets[target];
    let sum: f64 = target.rows.iter().zip(&target.y).map(|(i, y)| (y - prediction[*i]).powi(2)).sum();
    (sum / target.rows.len() as f64).sqrt()
}

fn closed() -> (Log, Closed) {
    let log = run("first.csv", 5, DRIFT, Some(DAMAGE.1));
    let closed = close(&log, None, &[], &mut |_| {}).expect("a verdict");
    (log, closed)
}

#[test]
fn a_drift_stays_at_home_and_damage_travels() {
    let (log, closed) = closed();
    let scope = |id: &str| closed.verdict.effects.iter().find(|e| e.id == id).map(|e| e.scope);
    assert_eq!(
        (scope("zero_drift"), scope("blade_damage")),
        (Some(Scope::Run), Some(Scope::Event)),
        "{:?}",
        closed.verdict.effects
    );
    let model = &closed.model;
    // on its own run with everything, whatever the log is called
    let renamed = Log { name: "copy.csv".to_owned(), ..log.clone() };
    assert!(error(&model.on(&renamed), &log, "thrust_n") < 0.012);
    // on a later run the blade is damaged from the start, and the zero is set anew
    let later = run("later.csv", 3, 0.0, Some(0.0));
    let carried = model.on(&later);
    let [held, replayed, declared] = [&*carried, model, &closed.declared].map(|m| error(m, &later, "thrust_n"));
    // the mean of what the drift was is the day's zero, and no more
    assert!(held < DRIFT * 70.0 + 0.03, "{held} N");
    assert!(
        held < 0.5 * replayed && held < 0.5 * declared,
        "{held} N, {replayed} with the events of the first run, {declared} declared"
    );
    assert!(error(&carried, &later, "torque_nm") < 0.5 * error(model, &later, "torque_nm"));
}

/// On a run that only climbs a zero that jumps looks like a part of the load's curve. Where it surely happened, it is none on another run.
#[test]
fn a_jump_on_a_climb_leaves_the_curve_as_it_is() {
    const JUMP: (f64, f64) = (0.15, 32.5);
    let mut climb = run("climb.csv", 1, 0.0, None);
    climb.t.truncate(700);
    climb.columns.iter_mut().for_each(|c| c.values.truncate(700));
    let thrust = climb.columns.iter_mut().find(|c| c.name == "thrust_n").expect("a thrust");
    thrust.values.iter_mut().zip(&climb.t).filter(|(_, t)| **t >= JUMP.1).for_each(|(y, _)| *y += JUMP.0);
    let closed = close(&climb, None, &[], &mut |_| {}).expect("a verdict");
    let jump = closed.verdict.effects.iter().find(|e| e.id == "tare_shift").expect("the jump");
    assert!(jump.probability > 0.8 && jump.scope == Scope::Event, "{jump:?}");
    let off = error(&closed.model.elsewhere(), &run("other.csv", 5, 0.0, None), "thrust_n");
    assert!(off < 0.02, "{off} N, and the noise is 0.01 N");
}

#[test]
fn the_file_says_it_too() {
    let (log, closed) = closed();
    let text = closed.model.to_toml();
    let read = |text: &str| Model::parse("model.toml", text).map_err(|e| e.to_string());
    let model = read(&text).expect("what was written");
    assert!(model.is_of(&log), "{text}");
    let later = run("later.csv", 3, 0.0, Some(0.0));
    for channel in ["thrust_n", "torque_nm", "current_a", "rpm"] {
        for log in [&log, &later] {
            let [a, b] = [&model, &closed.model].map(|m| error(&m.on(log), log, channel));
            assert!((a / b - 1.0).abs() < 1e-6, "{channel}: {a} {b}");
        }
    }
    for (good, bad, wanted) in [
        ("scope = \"run\"", "scope = \"rig\"", "scope: \"rig\"; expected 'run', which zero_drift has in this form"),
        ("rows = 1400", "rows = -1", "run[0].rows: -1; expected a number of rows"),
        ("sha256 = \"", "sha256 = \"x", "expected 64 hexadecimal digits"),
    ] {
        assert!(text.contains(good), "{good}: {text}");
        let refused = read(&text.replacen(good, bad, 1)).expect_err(bad);
        assert!(refused.contains(wanted) && refused.lines().count() == 1, "{refused}");
    }
}

/// A row for each level is a table; rows within a level, or rows that come quicker than a rotor arrives, are none.
#[test]
fn a_table_of_levels_is_told_from_a_run() {
    let is_table = |step: f64, rows_a_level: usize| {
        let n = 24;
        let column = |name: &str, values: Vec<f64>| Column { name: name.to_owned(), values };
        let pulse: Vec<f64> = (0..n).map(|i| 1200.0 + 30.0 * (i / rows_a_level) as f64).collect();
        let rpm = pulse.iter().map(|p| 7.0 * (p - 1000.0)).collect();
        let columns = vec![column("pulse_us", pulse), column("rpm", rpm)];
        let log = Log { t: (0..n).map(|i| step * i as f64).collect(), columns, ..Log::default() };
        Context::new(&log, Some(1050.0)).is_table()
    };
    assert!(is_table(5.0, 1) && is_table(0.5, 1));
    assert!(!is_table(5.0, 3), "three rows a level show what happens within it");
    assert!(!is_table(0.1, 1), "a ramp of ten rows a second");
}
