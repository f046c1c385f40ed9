//! Names and what has no name, side by side: what a verdict says channel by channel.
//!
//! What it is: a quasi-static rig with a lead, a load cell, an ammeter and one to three speed sensors; what is hidden on one channel has no
//! part in what is said of another.
//! What can go wrong: a case whose verdict says too little or too much fails with the verdict in its message.
//! Units: SI, rev/min, us.
//! Reference: specification `formats.md`, "Verdict"; `closing-the-loop.md`, steps 6 and 7.

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::verdict::Scope;
use ident::verdict::{Kind, Unexplained};
use rig::Chance;

const STEP: f64 = 0.05;
const ROWS: usize = 3000;

/// What is hidden.
#[derive(Clone, Copy)]
struct Hidden<'h> {
    seed: u64,
    /// Resistance of the lead, ohm.
    lead: f64,
    /// What the ammeter reads beside the current, of time and speed, A.
    amps: &'h dyn Fn(f64, f64) -> f64,
    /// What the load cell reads beside the thrust, N.
    newtons: &'h dyn Fn(f64, f64) -> f64,
    /// What the third speed sensor reads of a speed.
    hall: &'h dyn Fn(f64) -> f64,
    /// Wander of the rotor from row to row, rev/min.
    wander: f64,
}

const NOTHING: Hidden<'static> =
    Hidden { seed: 1, lead: 0.0, amps: &|_, _| 0.0, newtons: &|_, _| 0.0, hall: &|n| n, wander: 0.0 };

/// Levels of 3 s in an order in which load and time have little to do with each other.
fn pulses() -> Vec<f64> {
    (0..ROWS).map(|i| i / 60).map(|k| if k % 10 == 0 { 1000.0 } else { 1120.0 + (k * 37 % 50) as f64 * 16.0 }).collect()
}

/// A log with the speed channels and without the command where it is not wanted.
fn log(hidden: Hidden<'_>, speeds: &[&str], command: bool) -> Log {
    let mut chance = Chance::new(hidden.seed);
    let (t, pulse): (Vec<f64>, Vec<f64>) = ((0..ROWS).map(|i| STEP * i as f64).collect(), pulses());
    let drawn = |n: f64| 0.2 + 0.1 * (n / 1000.0).powi(3);
    let mut rpm = Vec::new();
    for p in &pulse {
        let free = if *p < 1050.0 { 0.0 } else { 6.0 * (p - 1000.0) };
        // the speed that the lead leaves
        let n = (0..40).fold(free, |n, _| 0.5 * n + 0.5 * free * (1.0 - hidden.lead * drawn(n) / 12.0));
        let wander = hidden.wander * chance.normal();
        rpm.push(if free > 0.0 { n + wander } else { 0.0 });
    }
    let mut noisy = |name: &str, noise: f64, value: &dyn Fn(usize) -> f64| Column {
        name: name.to_owned(),
        values: (0..ROWS).map(|i| value(i) + noise * chance.normal()).collect(),
    };
    let mut columns = if command { vec![Column { name: "pulse_us".to_owned(), values: pulse }] } else { Vec::new() };
    for name in speeds {
        columns.push(noisy(name, 1.0, &|i| if *name == "rpm_hall" { (hidden.hall)(rpm[i]) } else { rpm[i] }));
    }
    columns.push(noisy("thrust_n", 0.01, &|i| 0.25 * (rpm[i] / 1000.0).powi(2) + (hidden.newtons)(t[i], rpm[i])));
    columns.push(noisy("current_a", 0.02, &|i| drawn(rpm[i]) + (hidden.amps)(t[i], rpm[i])));
    columns.push(noisy("voltage_v", 0.01, &|i| 12.0 - hidden.lead * drawn(rpm[i])));
    Log { name: "run.csv".to_owned(), t, columns, ..Log::default() }
}

fn closed(log: &Log) -> Closed {
    close(log, None, &[], &mut |_| {}).expect("a log")
}

fn names(closed: &Closed) -> Vec<&str> {
    closed.verdict.effects.iter().map(|e| e.id.as_str()).filter(|id| *id != "unknown").collect()
}

fn left<'c>(closed: &'c Closed, channel: &str) -> Option<&'c Unexplained> {
    closed.verdict.unexplained.iter().find(|u| u.channel == channel)
}

/// What the contract says of every verdict.
fn keeps_the_contract(closed: &Closed) {
    let v = &closed.verdict;
    for (name, c) in &v.channels {
        let loud = c.after.heldout_rms > 3.0 * c.noise_floor_rms;
        assert!(!loud || left(closed, name).is_some(), "{name} is loud and not told: {:?}", v.unexplained);
        assert!(!loud || v.verdict != Kind::None, "none, and {name} is loud");
    }
    for e in &v.effects {
        assert!(e.heldout_error_reduction >= 0.0, "{}: {}", e.id, e.heldout_error_reduction);
        assert!((0.0..=1.0).contains(&e.probability), "{}: {}", e.id, e.probability);
        for c in e.channels.iter().filter_map(|c| v.channels.get(c)) {
            assert!(c.after.heldout_rms <= 1.02 * c.before.heldout_rms, "{} makes {:?} worse", e.id, e.channels);
        }
    }
}

/// Waves that nothing in the log goes with, on the ammeter and on the load cell: larger than all that the lead does to the voltage.
#[test]
fn a_lead_stays_named_whatever_is_left_on_current_and_thrust() {
    let wave = |size: f64| move |t: f64, _: f64| size * (0.9 * t).sin();
    let (amps, newtons) = (wave(0.8), wave(0.4));
    for (amps, newtons, loud) in [
        (&amps as &dyn Fn(f64, f64) -> f64, NOTHING.newtons, "current_a"),
        (NOTHING.amps, &newtons as &dyn Fn(f64, f64) -> f64, "thrust_n"),
    ] {
        let run = closed(&log(Hidden { lead: 0.07, amps, newtons, ..NOTHING }, &["rpm"], true));
        let v = &run.verdict;
        assert_eq!((v.verdict, names(&run)), (Kind::Attributed, vec!["supply_sag"]), "{:?}", v.unexplained);
        let lead = &v.effects[0].parameters[0];
        assert!((lead.value / 0.07 - 1.0).abs() < 0.05, "{lead:?}");
        assert_eq!(v.effects[0].scope, Scope::Rig);
        assert!(v.effects[0].probability > 0.9, "{}", v.effects[0].probability);
        assert!(left(&run, loud).is_some_and(|u| u.over_floor > 3.0), "{:?}", v.unexplained);
        let voltage = &v.channels["voltage_v"];
        assert!(voltage.after.heldout_rms < 0.3 * voltage.before.heldout_rms, "{voltage:?}");
        keeps_the_contract(&run);
    }
}

/// A dependence that nobody named, on a channel of its own: corrected beside the name, with the variable that it goes with.
#[test]
fn what_has_no_name_is_corrected_beside_the_name_of_another_channel() {
    let reading = |t: f64| (0.31 * t).sin() + 0.6 * (0.187 * t + 1.0).cos();
    let newtons = |t: f64, _: f64| 0.15 * reading(t).powi(2);
    let mut run = log(Hidden { lead: 0.07, newtons: &newtons, ..NOTHING }, &["rpm"], true);
    run.columns.push(Column { name: "slack_mm".to_owned(), values: run.t.iter().map(|t| reading(*t)).collect() });
    let run = closed(&run);
    let v = &run.verdict;
    let ids: Vec<&str> = v.effects.iter().map(|e| e.id.as_str()).collect();
    assert_eq!((v.verdict, ids), (Kind::Attributed, vec!["supply_sag", "unknown"]));
    assert_eq!(
        (&v.effects[1].channels[..], &v.effects[1].depends_on[..]),
        (&["thrust_n".to_owned()][..], &["slack_mm".to_owned()][..])
    );
    let thrust = &v.channels["thrust_n"];
    assert!(thrust.after.heldout_rms < 0.4 * thrust.before.heldout_rms, "{thrust:?}");
    keeps_the_contract(&run);
}

/// Eleven readings of a thrust that stops growing half way up: too few rows for any test of colour.
#[test]
fn none_means_none_on_a_table_of_eleven_rows() {
    let mut chance = Chance::new(3);
    let n = 11;
    let t: Vec<f64> = (0..n).map(f64::from).collect();
    let pulse: Vec<f64> = t.iter().map(|k| 1100.0 + 60.0 * k).collect();
    let rpm: Vec<f64> = pulse.iter().map(|p| 6.0 * (p - 1000.0) + chance.normal()).collect();
    let thrust: Vec<f64> = rpm.iter().map(|r| 0.25 * (r.min(2400.0) / 1000.0).powi(2) + 0.001 * chance.normal()).collect();
    let columns = [("pulse_us", pulse), ("rpm", rpm), ("thrust_n", thrust)];
    let columns = columns.into_iter().map(|(name, values)| Column { name: name.into(), values }).collect();
    let table = closed(&Log { name: "table.csv".into(), t, columns, ..Log::default() });
    assert_ne!(table.verdict.verdict, Kind::None);
    assert!(left(&table, "thrust_n").is_some(), "{:?}", table.verdict.channels);
    keeps_the_contract(&table);
}

/// A rotor that wanders by more than a sensor is off: against the command nothing shows, against the other sensors all of it does. A gain of the
/// sensor's own is none of it.
#[test]
fn none_means_none_on_what_one_speed_sensor_reads_beyond_the_others() {
    let speeds = ["rpm_beam", "rpm_opto", "rpm_hall"];
    let swings = |n: f64| n + 8.0 * (n / 140.0).sin();
    let off = closed(&log(Hidden { hall: &swings, wander: 8.0, ..NOTHING }, &speeds, true));
    assert_ne!(off.verdict.verdict, Kind::None);
    assert!(left(&off, "rpm_hall - others").is_some_and(|u| u.over_floor > 3.0), "{:?}", off.verdict.unexplained);
    keeps_the_contract(&off);
    let gain = |n: f64| 1.003 * n;
    let healthy = closed(&log(Hidden { hall: &gain, wander: 8.0, ..NOTHING }, &speeds, true));
    assert_eq!(healthy.verdict.verdict, Kind::None, "{:?} {:?}", names(&healthy), healthy.verdict.unexplained);
}

#[test]
fn a_speed_that_no_command_asks_for_is_an_input() {
    let run = closed(&log(Hidden { lead: 0.07, ..NOTHING }, &["rpm"], false));
    assert_eq!(run.verdict.format, "quadrig-verdict 2");
    assert_eq!(run.verdict.channels.not_predicted["rpm"], "no command was logged");
    assert!(!run.verdict.channels.contains_key("rpm"));
    assert!(names(&run).contains(&"supply_sag"), "{:?}", names(&run));
    assert!(left(&run, "rpm").is_none(), "{:?}", run.verdict.unexplained);
    keeps_the_contract(&run);
}
