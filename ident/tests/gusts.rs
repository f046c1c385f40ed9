//! Gusts in the torque that the thrust cell reads: white within every hold, so that no channel's residual has a colour.
//!
//! What it is: torque that really scatters by two per cent of itself, a torque sensor with noise of its own, and a thrust cell that
//! reads a share of the true torque, on a staircase.
//! What can go wrong: thrust and torque that are shaken together in the ratio of their readings are no cross-talk, and are not named.
//! Units: N, N.m, rev/min, us.
//! Reference: effect `torque_crosstalk`; Carroll et al. 2006, Measurement Error in Nonlinear Models, chapter 4.

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use rig::Chance;

/// A run whose thrust reads `coefficient` times the true torque, or, where `shaken`, whose gusts move thrust and torque alike.
fn run(coefficient: f64, shaken: bool) -> Log {
    let mut chance = Chance::new(41);
    let names = ["pulse_us", "rpm", "thrust_n", "torque_nm"];
    let mut columns = names.map(|name| Column { name: name.to_owned(), values: Vec::new() });
    let mut t = Vec::new();
    for i in 0..3600 {
        let pulse = 1000.0 + 90.0 * f64::from(i / 300 % 11);
        let speed = if pulse > 1050.0 { 7.0 * (pulse - 1000.0) } else { 0.0 };
        let (thrust, torque) = (1.5e-7 * speed * speed, 2.5e-9 * speed * speed);
        let gust = 0.02 * chance.normal();
        let acting = torque * (1.0 + gust);
        let cell = if shaken { thrust * (1.0 + gust) } else { thrust + coefficient * acting };
        let readings = [
            pulse,
            (speed + if speed > 0.0 { 2.0 * chance.normal() } else { 0.0 }),
            cell + 0.004 * chance.normal(),
            acting + 0.0004 * chance.normal(),
        ];
        t.push(f64::from(i) * 0.05);
        columns.iter_mut().zip(readings).for_each(|(c, v)| c.values.push(v));
    }
    Log { name: "gusts.csv".to_owned(), t, columns: columns.to_vec(), ..Log::default() }
}

fn verdict(log: &Log) -> Closed {
    close(log, None, &[], &mut |_| {}).expect("a verdict")
}

#[test]
fn cross_talk_of_gusts_is_named_with_its_coefficient() {
    for truth in [-35.0, 12.0, 40.0] {
        let closed = verdict(&run(truth, false));
        let effect = closed.verdict.effects.first().expect("an effect");
        assert_eq!(effect.id, "torque_crosstalk", "{:?}", closed.verdict.effects);
        let p = &effect.parameters[0];
        println!("{truth}: {:.2} ({:.2} to {:.2})", p.value, p.ci95[0], p.ci95[1]);
        assert!((p.value / truth - 1.0).abs() < 0.08, "{} for {truth}", p.value);
    }
}

#[test]
fn what_shakes_both_meters_is_no_cross_talk() {
    let closed = verdict(&run(0.0, true));
    assert!(closed.verdict.effects.iter().all(|e| e.id != "torque_crosstalk"), "{:?}", closed.verdict.effects);
}
