//! A rotor that its controller drives and never brakes.
//!
//! What it is: the rotor's equation in small steps (winding, air, friction; no current flows back), so that it coasts down, on random
//! levels and on a staircase, read by one speed sensor, a load cell, a torque arm and a current meter.
//! What can go wrong: a case whose effect the search misses fails with the verdict in its message.
//! Units: SI, rev/min, us.
//! Reference: Beharie 2013, Eq. 2.21 as corrected and 5.11; effect `spinup_lag`, form `coasting`.

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use rig::Chance;

const STEP: f64 = 0.05;
/// Speed at 2000 us, rev/min.
const FULL: f64 = 6000.0;
/// Winding's rate, 1/s; the air's at full speed, 1/s; friction, share of full speed a second.
const WINDING: f64 = 15.0;
const AIR: f64 = 3.0;
const FRICTION: f64 = 0.1;

/// Levels of 2 to 5 s in any order, and the motor off in the end.
fn random(seed: u64) -> Vec<(f64, f64)> {
    let mut chance = Chance::new(seed);
    let mut levels = vec![(0.0, 1200.0)];
    let mut at = 4.02;
    while at < 140.0 {
        levels.push((at, (1150.0 + 800.0 * chance.uniform()).round()));
        at = ((at + 2.0 + 3.0 * chance.uniform()) / STEP).floor() * STEP + 0.4 * STEP;
    }
    levels.push((at, 1000.0));
    levels
}

/// From low to high and off.
fn staircase() -> Vec<(f64, f64)> {
    let mut levels: Vec<(f64, f64)> = (0..17).map(|k| (8.42 * f64::from(k), 1150.0 + 50.0 * f64::from(k))).collect();
    levels.push((8.42 * 17.0, 1000.0));
    levels
}

/// Speed of the rotor, rev/min, at the instants of a log; `loss` is the speed that is missing at an instant, rev/min.
fn turned(levels: &[(f64, f64)], t: &[f64], loss: impl Fn(f64) -> f64) -> Vec<f64> {
    let goal = |now: f64| {
        let pulse = levels.iter().rev().find(|l| l.0 <= now).map_or(1000.0, |l| l.1);
        if pulse < 1100.0 { 0.0 } else { (pulse - 1000.0) / 1000.0 - loss(now) / FULL }
    };
    let (fine, mut v) = (100, goal(0.0));
    let h = STEP / f64::from(fine);
    t.iter()
        .map(|t| {
            let reading = FULL * v;
            for k in 0..fine {
                let to = goal(t + h * f64::from(k));
                let driven = (to - v) * (WINDING + AIR * (to + v));
                v = (v + h * driven.max(-AIR * v * v - FRICTION)).max(0.0);
            }
            reading
        })
        .collect()
}

/// A log of such a rotor with a drag on its shaft from `t0` on, N.m.
fn log(levels: &[(f64, f64)], t0: f64, drag_nm: f64) -> Log {
    let mut chance = Chance::new(11);
    let t: Vec<f64> = (0..2960).map(|i| STEP * f64::from(i)).collect();
    let rubs = |now: f64| if now >= t0 { drag_nm } else { 0.0 };
    let rpm = turned(levels, &t, |now| 5000.0 * rubs(now));
    let k = |i: usize| rpm[i] / 1000.0;
    let omega = |i: usize| rpm[i] * std::f64::consts::TAU / 60.0;
    let pulse = |now: f64| levels.iter().rev().find(|l| l.0 <= now).map_or(1000.0, |l| l.1);
    let driven = |i: usize| if pulse(t[i]) < 1100.0 { 0.0 } else { 1.0 };
    let n = t.len();
    let channels: [(&str, Vec<f64>, f64); 5] = [
        ("pulse_us", t.iter().map(|t| pulse(*t)).collect(), 0.0),
        ("rpm", rpm.clone(), 2.0),
        ("thrust_n", (0..n).map(|i| 0.15 * k(i).powi(2)).collect(), 0.01),
        ("torque_nm", (0..n).map(|i| 0.0025 * k(i).powi(2)).collect(), 0.0003),
        ("current_a", (0..n).map(|i| driven(i) * (0.3 + 0.04 * k(i).powi(3) + rubs(t[i]) * omega(i) / 12.0)).collect(), 0.04),
    ];
    let columns = channels
        .into_iter()
        .map(|(name, values, noise)| Column {
            name: name.to_owned(),
            values: values.into_iter().map(|v| v + noise * chance.normal()).collect(),
        })
        .collect();
    Log { name: "rotor.csv".to_owned(), t, columns, ..Log::default() }
}

fn verdict(log: &Log) -> Closed {
    close(log, None, &[], &mut |_| {}).expect("a verdict")
}

fn names(closed: &Closed) -> Vec<&str> {
    closed.verdict.effects.iter().map(|e| e.id.as_str()).collect()
}

#[test]
fn its_way_down_is_told_from_a_lag() {
    let closed = verdict(&log(&random(5), f64::INFINITY, 0.0));
    let lag = closed.verdict.effects.iter().find(|e| e.id == "spinup_lag").unwrap_or_else(|| panic!("{:?}", names(&closed)));
    assert!(lag.equation.contains("[coasting"), "{}", lag.equation);
    let value = |name: &str| lag.parameters.iter().find(|p| p.name == name).expect(name).value;
    // driven it goes by winding and air, from standstill to full speed ever quicker, and the air alone halves full speed
    let up = &lag.parameters.iter().find(|p| p.name == "tau_up").expect("tau_up");
    assert!(up.ci95[0] < 1.0 / WINDING && up.ci95[1] > 1.0 / (WINDING + 2.0 * AIR) && up.ci95[1] < 0.1, "{up:?}");
    assert!((value("tau_air") * AIR - 1.0).abs() < 0.15, "{}", value("tau_air"));
    let rpm = &closed.verdict.channels["rpm"];
    assert!(rpm.after.heldout_rms < 0.15 * rpm.before.heldout_rms, "{} of {}", rpm.after.heldout_rms, rpm.before.heldout_rms);
}

#[test]
fn a_friction_is_not_drowned_by_the_way_to_each_level() {
    let (t0, drag) = (60.0, 0.004);
    for levels in [random(5), staircase()] {
        let closed = verdict(&log(&levels, t0, drag));
        let all = names(&closed);
        let friction = closed.verdict.effects.iter().find(|e| e.id == "bearing_friction").unwrap_or_else(|| panic!("{all:?}"));
        let p = friction.parameters.iter().find(|p| p.name == "t0").expect("t0");
        assert!((p.value - t0).abs() < 2.5 && p.ci95[0] < t0 && t0 < p.ci95[1], "{p:?}");
    }
}

/// On a staircase the only way down is that after the last level: the block that holds it knows nothing of it, and may not speak against
/// the lag that all other rows show.
#[test]
fn a_run_that_only_climbs_has_its_lag() {
    let closed = verdict(&log(&staircase(), f64::INFINITY, 0.0));
    assert_eq!(names(&closed), ["spinup_lag"], "{:?}", closed.verdict.alternatives);
}

/// What speeds the rotor up is drawn from the supply at the duty that it has: a log of single readings knows from command and speed how far the
/// rotor is off, and the current of another run follows.
#[test]
fn the_current_of_a_rotor_on_its_way_is_known_on_another_run() {
    on_another_run(f64::NEG_INFINITY);
}

/// The same with a controller that lets no current flow back: while the rotor falls the meter reads what a motor takes that stands.
#[test]
fn a_controller_that_lets_no_current_flow_back_is_known_on_another_run() {
    on_another_run(IDLE);
}

/// Current of a motor that stands, A.
const IDLE: f64 = 0.3;

fn on_another_run(least: f64) {
    let (tau, gain) = (0.15, 6e-6);
    let day = |seed: u64| {
        let mut chance = Chance::new(seed);
        let levels = random(seed);
        let pulse = |now: f64| levels.iter().rev().find(|l| l.0 <= now).map_or(1000.0, |l| l.1);
        let (fine, h) = (50, STEP / 50.0);
        let mut speed = 6.0 * (levels[0].1 - 1000.0);
        let mut columns = [const { Vec::new() }; 4];
        let t: Vec<f64> = (0..2400).map(|i| STEP * f64::from(i)).collect();
        for t in &t {
            let goal = 6.0 * (pulse(*t) - 1000.0);
            let per = std::f64::consts::TAU / 60.0;
            let power = speed * per * (goal - speed) * per / tau;
            let row = [
                pulse(*t),
                speed + chance.normal(),
                0.15 * (speed / 1000.0).powi(2) + 0.005 * chance.normal(),
                (IDLE + 0.04 * (speed / 1000.0).powi(3) + gain * power).max(least) + 0.02 * chance.normal(),
            ];
            columns.iter_mut().zip(row).for_each(|(c, v)| c.push(v));
            (0..fine).for_each(|k| speed += (6.0 * (pulse(t + h * f64::from(k)) - 1000.0) - speed) * h / tau);
        }
        let names = ["pulse_us", "rpm", "thrust_n", "current_a"];
        let columns = names.into_iter().zip(columns).map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        Log { name: "rotor.csv".to_owned(), t, columns, ..Log::default() }
    };
    let (own, other) = (day(5), day(6));
    let closed = close(&own, None, std::slice::from_ref(&other), &mut |_| {}).expect("a verdict");
    let inertia =
        closed.verdict.effects.iter().find(|e| e.id == "rotor_inertia").unwrap_or_else(|| panic!("{:?}", names(&closed)));
    let found = inertia.parameters.iter().find(|p| p.name == "power_gain").expect("power_gain").value;
    assert!((found / gain - 1.0).abs() < 0.1, "{found}");
    let there = &closed.verdict.validation.first().expect("another run").channels["current_a"];
    assert!(there.after < 0.25 * there.before, "{there:?}");
    assert_eq!(inertia.parameters.iter().any(|p| p.name == "coast_drag"), least == IDLE, "{:?}", inertia.parameters);
}
