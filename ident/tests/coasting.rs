//! A supply that gets nothing back: what a rotor that slows down makes of the current ends at the idle current.
//!
//! What it is: a rig with an inertia on two schedules, the second with deeper steps down; the model of the first predicts the second. A rig
//! whose ESC brakes gives current back, and keeps doing so in the prediction.
//! What can go wrong: a straight line of the power into the rotor predicts current that flows back where none can.
//! Units: A, rev/min, us, s.
//! Reference: `rotor_inertia`.

mod rig;

use ident::close::close;
use ident::context::Context;
use ident::log::{Column, Log};
use rig::Chance;

/// Current of an idle drive, A, and what the power into the rotor costs, A.s3/rad2.
const IDLE: f64 = 0.05;
const GAIN: f64 = 8e-6;

/// Levels of 6 s at 20 Hz with a rotor of 0.3 s; current is no less than `least`.
fn flown(levels: &[f64], seed: u64, least: f64) -> Log {
    let mut chance = Chance::new(seed);
    let (dt, tau) = (0.05, 0.3);
    let (mut rpm, mut columns) = (0.0, vec![Vec::new(); 4]);
    for level in levels {
        for _ in 0..120 {
            let goal = 7.0 * (level - 1000.0);
            rpm = goal + (rpm - goal) * f64::exp(-dt / tau);
            let (krpm, turns) = (rpm / 1000.0, std::f64::consts::TAU / 60.0);
            let power = rpm * turns * (goal - rpm) / tau * turns;
            let current = (IDLE + 0.03 * krpm.powi(3) + GAIN * power).max(least);
            let read = [*level, rpm + 3.0 * chance.normal(), current + 0.01 * chance.normal(), 12.0 + 0.004 * chance.normal()];
            columns.iter_mut().zip(read).for_each(|(c, v)| c.push(v));
        }
    }
    let t = (0..columns[0].len()).map(|i| dt * i as f64).collect();
    let names = ["pulse_us", "rpm", "current_a", "voltage_v"];
    let columns = names.into_iter().zip(columns).map(|(name, values)| Column { name: name.into(), values }).collect();
    Log { name: "run.csv".into(), t, columns, ..Log::default() }
}

/// Levels up and down in steps of so many us.
fn staircase(step: f64) -> Vec<f64> {
    let up: Vec<f64> = (1..).map(|k| 1000.0 + step * f64::from(k)).take_while(|p| *p <= 2000.0).collect();
    up.iter().chain(up.iter().rev().skip(1)).copied().collect()
}

/// Least current that the model of a run predicts of another one with deep steps, and the root mean square of what it misses, A.
fn predicted(least: f64) -> (f64, f64, String) {
    let closed = close(&flown(&staircase(250.0), 1, least), None, &[], &mut |_| {}).expect("a verdict");
    let other = flown(&[1200.0, 2000.0, 1050.0, 1900.0, 1100.0, 1600.0, 1050.0, 2000.0, 1200.0], 2, least);
    let context = Context::new(&other, Some(closed.model.start_pulse_us));
    let current = closed.model.predict(&context, "current_a").expect("a prediction");
    let read = other.column("current_a").expect("a current");
    let off: f64 = current.iter().zip(read).map(|(a, b)| (a - b).powi(2)).sum();
    let lowest = current.iter().copied().fold(f64::INFINITY, f64::min);
    let told = closed.verdict.effects.iter().map(|e| format!("{} {} {:?}\n", e.id, e.equation, e.channels)).collect();
    (lowest, (off / current.len() as f64).sqrt(), told)
}

#[test]
fn no_current_is_predicted_to_flow_back_where_none_does() {
    let (lowest, missed, told) = predicted(IDLE);
    assert!(told.contains("rotor_inertia") && told.contains("[") && told.contains("no_current_flows_back"), "{told}");
    assert!(lowest > IDLE - 0.1 && missed < 0.15, "{lowest} A predicted, {missed} A missed\n{told}");
}

#[test]
fn what_a_braking_controller_gives_back_is_predicted() {
    let (lowest, missed, told) = predicted(f64::NEG_INFINITY);
    assert!(told.contains("rotor_inertia") && !told.contains("no_current_flows_back"), "{told}");
    assert!(lowest < -1.0 && missed < 0.3, "{lowest} A predicted, {missed} A missed\n{told}");
}
