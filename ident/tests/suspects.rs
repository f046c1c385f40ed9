//! Causes that a run holds and cannot show.
//!
//! What it is: a quasi-static rig; what is hidden leaves something over that other causes leave as well.
//! What can go wrong: a case whose cause is named, or not listed, fails with the verdict in its message.
//! Units: SI, rev/min, us.
//! Reference: specification `closing-the-loop.md`, step 7.

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::verdict::Kind;
use rig::Chance;

const STEP: f64 = 0.05;
const ROWS: usize = 3000;

/// Levels of 3 s from the bottom to the top, or any others.
fn levels(level: impl Fn(usize) -> f64) -> Vec<f64> {
    (0..ROWS).map(|i| level(i / 60)).collect()
}

fn climbing() -> Vec<f64> {
    levels(|k| if k == 0 { 1000.0 } else { 1100.0 + 16.0 * k as f64 })
}

fn scattered() -> Vec<f64> {
    levels(|k| if k % 10 == 0 { 1000.0 } else { 1120.0 + (k * 37 % 50) as f64 * 16.0 })
}

/// A log of columns that are given quiet, with their noise.
fn log(pulse: Vec<f64>, columns: Vec<(&str, Vec<f64>, f64)>) -> Log {
    let mut chance = Chance::new(11);
    let t: Vec<f64> = (0..ROWS).map(|i| STEP * i as f64).collect();
    let mut all = vec![Column { name: "pulse_us".into(), values: pulse }];
    for (name, quiet, noise) in columns {
        all.push(Column { name: name.into(), values: quiet.iter().map(|v| v + noise * chance.normal()).collect() });
    }
    Log { name: "run.csv".into(), t, columns: all, ..Log::default() }
}

/// Not named, but first of what is listed with what is.
fn assert_suspected(closed: &Closed, id: &str) {
    let v = &closed.verdict;
    assert!(
        matches!(v.verdict, Kind::Unattributed | Kind::Ambiguous),
        "{:?}",
        v.effects.iter().map(|e| &e.id).collect::<Vec<_>>()
    );
    let listed: Vec<String> = v.alternatives.iter().map(|a| a.ids.join("+")).collect();
    assert_eq!(listed.first().map(String::as_str), Some(id), "{listed:?}");
}

fn closed(log: &Log) -> Closed {
    close(log, None, &[], &mut |_| {}).expect("a log")
}

fn speed(pulse: f64) -> f64 {
    if pulse < 1050.0 { 0.0 } else { 7.0 * (pulse - 1000.0) }
}

#[test]
fn the_hysteresis_of_a_cell_that_was_loaded_only_is_suspected() {
    let rpm: Vec<f64> = climbing().iter().map(|p| speed(*p)).collect();
    let top = rpm.iter().copied().fold(0.0, f64::max);
    let thrust = rpm.iter().map(|n| {
        let f = (n / top).powi(2);
        0.25 * (n / 1000.0).powi(2) - 0.6 * 2.0 * f * (1.0 - f)
    });
    let run = log(climbing(), vec![("rpm", rpm.clone(), 1.0), ("thrust_n", thrust.collect(), 0.01)]);
    let closed = closed(&run);
    assert_suspected(&closed, "hysteresis");
    // the verdict stands for none of the names that the suspect would do without
    assert!((0..closed.verdict.effects.len()).all(|k| !closed.diagnosis.claims(k)));
}

#[test]
fn a_sag_that_no_voltage_shows_is_suspected() {
    let (mut rpm, mut current) = (Vec::new(), Vec::new());
    for p in scattered() {
        // the speed that the sag leaves, with the current that it leaves
        let mut n = speed(p);
        for _ in 0..40 {
            n = 0.5 * n + 0.5 * speed(p) * (1.0 - 0.02 * amps(n));
        }
        rpm.push(n);
        current.push(amps(n));
    }
    let run = log(scattered(), vec![("rpm", rpm, 1.0), ("current_a", current, 0.02)]);
    assert_suspected(&closed(&run), "supply_sag");
}

fn amps(n: f64) -> f64 {
    0.2 + 0.1 * (n / 1000.0).powi(3)
}

#[test]
fn an_encoder_that_is_never_uncoupled_is_suspected_of_what_a_turning_rotor_draws() {
    let rpm: Vec<f64> = scattered().iter().map(|p| speed(*p)).collect();
    let current = rpm.iter().map(|n| if *n > 0.0 { 0.9 + amps(*n) } else { 0.2 });
    let columns = vec![("rpm_encoder", rpm.clone(), 1.0), ("rpm_opto", rpm.clone(), 1.0), ("current_a", current.collect(), 0.02)];
    assert_suspected(&closed(&log(scattered(), columns)), "encoder_drag");
}

/// The arm sees the brake, and it is named: the suspect of the same name does not stand beside it.
#[test]
fn a_brake_that_the_arm_sees_is_named_without_a_doubt() {
    let rpm: Vec<f64> = scattered().iter().map(|p| speed(*p)).collect();
    let turning = |n: f64, more: f64| if n > 0.0 { more } else { 0.0 };
    let torque = rpm.iter().map(|n| 0.004 * (n / 1000.0).powi(2) + turning(*n, 0.01)).collect();
    let current = rpm.iter().map(|n| amps(*n) + turning(*n, 0.9)).collect();
    let columns = vec![("rpm_encoder", rpm.clone(), 1.0), ("torque_nm", torque, 0.0003), ("current_a", current, 0.02)];
    let verdict = closed(&log(scattered(), columns)).verdict;
    let named: Vec<&str> = verdict.effects.iter().map(|e| e.id.as_str()).collect();
    assert!(named.contains(&"encoder_drag"), "{named:?}");
    assert!(verdict.alternatives.iter().all(|a| a.ids != ["encoder_drag"]), "{:?}", verdict.alternatives);
}

/// A current that falls while the rotor speeds up: what `rotor_inertia` would be with the wrong sign.
#[test]
fn an_inertia_that_gives_while_the_rotor_speeds_up_is_none() {
    let pulse: Vec<f64> = (0..ROWS).map(|i| 1500.0 + 300.0 * (0.02 * i as f64).sin()).collect();
    let rpm: Vec<f64> = pulse.iter().map(|p| speed(*p)).collect();
    let gives = |sign: f64| {
        let rate =
            |i: usize| (rpm[(i + 1).min(ROWS - 1)] - rpm[i.saturating_sub(1)]) / (2.0 * STEP) * std::f64::consts::TAU / 60.0;
        let current = (0..ROWS).map(|i| amps(rpm[i]) + sign * 0.004 * rate(i)).collect();
        let run = log(pulse.clone(), vec![("rpm", rpm.clone(), 1.0), ("current_a", current, 0.02)]);
        closed(&run).verdict.effects.iter().any(|e| e.id == "rotor_inertia")
    };
    assert!(gives(1.0) && !gives(-1.0));
}

/// One reading a level: what bends over the load bends over the time.
#[test]
fn a_sweep_of_single_readings_says_nothing_of_time() {
    let mut chance = Chance::new(5);
    let n = 40;
    let t: Vec<f64> = (0..n).map(|i| 4.0 * i as f64).collect();
    let pulse: Vec<f64> = (0..n).map(|i| 1100.0 + 20.0 * i as f64).collect();
    let mut noisy = |of: &dyn Fn(usize) -> f64, noise: f64| (0..n).map(|i| of(i) + noise * chance.normal()).collect::<Vec<f64>>();
    let rpm = noisy(&|i| speed(pulse[i]), 0.5);
    let thrust = noisy(&|i| 0.25 * (speed(pulse[i]) / 1000.0).powi(2) + 0.004 * t[i], 0.003);
    let columns = [("pulse_us", pulse.clone()), ("rpm", rpm), ("thrust_n", thrust)];
    let columns = columns.into_iter().map(|(name, values)| Column { name: name.into(), values }).collect();
    let sweep = Log { name: "sweep.csv".into(), t, columns, ..Log::default() };
    let of_time = ["zero_drift", "tare_shift", "creep"];
    assert!(
        closed(&sweep).diagnosis.candidates.concat().iter().all(|c| c.ids().iter().all(|id| !of_time.contains(&id.as_str())))
    );
}

/// Speed alone, off its curve by what nothing in the log tells: there is no variable to correct it with, and something is there.
#[test]
fn a_residual_that_nothing_logged_could_explain_is_not_nothing() {
    let pulse = scattered();
    let rpm: Vec<f64> = pulse.iter().enumerate().map(|(i, p)| speed(*p) * (1.0 + 0.01 * (0.004 * i as f64).sin())).collect();
    let mut run = log(pulse, vec![("rpm", rpm, 1.0)]);
    run.meta.insert("time".into(), "row".into());
    let verdict = closed(&run).verdict;
    assert_eq!(verdict.verdict, Kind::Unattributed, "{:?}", verdict.effects.iter().map(|e| &e.id).collect::<Vec<_>>());
}
