//! A flight with its rows on the ground: motors that stand still before the take-off and after the landing.
//!
//! What it is: a made flight of four rotors whose speed is a curve of the pulse above a start and nothing below it, closed.
//! What can go wrong: a curve that goes on below the start gives the standing motors thousands of turns.
//! Units: SI, rev/min, us.
//! Reference: specification `flight.md`, "The loop on flights".

use ident::flight::close;
use ident::log::{Column, Log};

const HZ: f64 = 50.0;
/// Command below which the motors stand, as a share of full.
const START: f64 = 0.07;

fn rpm(u: f64) -> f64 {
    if u > START { 1500.0 + 9000.0 * u - 2500.0 * u * u } else { 0.0 }
}

/// Commands: off, a slow ramp on the ground, a flight that moves each rotor by its own wave, a ramp down, off.
fn command(rotor: usize, t: f64) -> f64 {
    let wave = 0.03 * (t * (1.1 + 0.37 * rotor as f64)).sin() + 0.02 * (t * 0.31).sin();
    match t {
        t if t < 4.0 => 0.0,
        t if t < 6.0 => 0.5 * (t - 4.0) / 2.0,
        t if t < 46.0 => 0.5 + wave,
        t if t < 48.0 => 0.5 * (48.0 - t) / 2.0,
        _ => 0.0,
    }
}

fn flight() -> Log {
    let t: Vec<f64> = (0..(52.0 * HZ) as usize).map(|i| i as f64 / HZ).collect();
    // a noise that is the same every time
    let noise = |i: usize, k: usize| ((i as f64 * 12.9898 + k as f64 * 78.233).sin() * 43_758.545_3).fract() - 0.5;
    let mut log = Log { name: "flight.csv".into(), t: t.clone(), ..Log::default() };
    let mut push = |name: String, values: Vec<f64>| log.columns.push(Column { name, values });
    let mut squares = vec![0.0; t.len()];
    for rotor in 0..4 {
        let u: Vec<f64> = t.iter().map(|t| command(rotor, *t)).collect();
        let speed: Vec<f64> =
            u.iter().enumerate().map(|(i, u)| rpm(*u) + if *u > START { 6.0 * noise(i, rotor) } else { 0.0 }).collect();
        squares.iter_mut().zip(&speed).for_each(|(s, w)| *s += w * w);
        push(format!("pulse_us_{}", rotor + 1), u.iter().map(|u| 1000.0 + 1000.0 * u).collect());
        push(format!("rpm_{}", rotor + 1), speed);
    }
    let hover = 4.0 * rpm(0.5).powi(2);
    let flies = |t: f64| (5.9..46.1).contains(&t);
    let force = |i: usize| if flies(t[i]) { -9.81 * squares[i] / hover } else { -9.81 };
    for (k, name) in ["acc_x", "acc_y", "acc_z"].iter().enumerate() {
        push((*name).into(), (0..t.len()).map(|i| 0.02 * noise(i, 10 + k) + if k == 2 { force(i) } else { 0.0 }).collect());
    }
    for (k, name) in ["gyro_x", "gyro_y", "gyro_z"].iter().enumerate() {
        push((*name).into(), (0..t.len()).map(|i| 0.002 * noise(i, 20 + k)).collect());
    }
    push("voltage_v".into(), (0..t.len()).map(|i| 15.8 + 0.01 * noise(i, 30)).collect());
    log
}

#[test]
fn motors_that_stand_are_predicted_to_stand() {
    let closed = close(&flight(), None, &[], &mut |_| {}).expect("a flight");
    for rotor in 1..=4 {
        let c = &closed.verdict.channels[format!("rpm_{rotor}").as_str()];
        println!("rpm_{rotor}: before {:.1} rev/min held out, {:.1} on all rows", c.before.heldout_rms, c.before.rms);
        assert!(c.before.heldout_rms < 300.0, "rotor {rotor}: {:?}", c.before);
        assert!(c.before.rms < 300.0, "rotor {rotor}: {:?}", c.before);
    }
    let start = closed.flight.usual.start;
    assert!((START - 0.03..=START + 0.03).contains(&start), "{start}");
}
