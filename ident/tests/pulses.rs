//! Pulses too few or too many on a ramp; a single one in a whole run, which is a bad sample; and drop-outs that come back, which are no pulses.
//!
//! What it is: three speed sensors on a command that climbs and falls evenly; single readings of one of them are half or twice the speed.
//! What can go wrong: a late reading on a ramp is off as well, but by no more than the speed changed; a resonance is no row of glitches.
//! Units: rev/min, us.
//! Reference: effects `missed_pulses`, `double_pulses`, `glitch_rows`; Garwood 1936 (interval of a count).

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use rig::Chance;

const ROWS: usize = 1600;

/// Three sensors on a ramp up and down; the third reads `factor` times the speed on `rows`, and all of it `late` rows late.
fn ramp(rows: &[usize], factor: f64, late: usize) -> Log {
    read_by(&|i| if rows.contains(&i) { factor } else { 1.0 }, late)
}

/// The same where the third sensor reads `share` of the speed on each row.
fn read_by(share: &dyn Fn(usize) -> f64, late: usize) -> Log {
    let mut chance = Chance::new(7);
    let speed = |i: usize| 8.0 * (100.0 + 900.0 * (1.0 - (2.0 * i as f64 / ROWS as f64 - 1.0).abs()));
    let names = ["pulse_us", "rpm_beam", "rpm_opto", "rpm_hall"];
    let mut columns = names.map(|name| Column { name: name.to_owned(), values: Vec::new() });
    for i in 0..ROWS {
        let off = share(i);
        let wander = 1.0 + 3e-4 * chance.normal();
        let mut read = |truth: f64| truth * wander + 0.5 * chance.normal();
        let readings = [1000.0 + speed(i) / 8.0, read(speed(i)), read(speed(i)), off * read(speed(i.saturating_sub(late)))];
        columns.iter_mut().zip(readings).for_each(|(c, v)| c.values.push(v));
    }
    let t = (0..ROWS).map(|i| 0.1 * i as f64).collect();
    Log { name: "ramp.csv".to_owned(), t, columns: columns.to_vec(), ..Log::default() }
}

fn verdict(log: &Log) -> Closed {
    close(log, None, &[], &mut |_| {}).expect("a verdict")
}

fn names(closed: &Closed) -> Vec<&str> {
    closed.verdict.effects.iter().map(|e| e.id.as_str()).collect()
}

/// The probability of a pulse lies within its interval, and no further from `truth` than a factor.
fn probability(closed: &Closed, truth: f64) {
    let p = &closed.verdict.effects[0].parameters[0];
    assert_eq!(p.name, "probability");
    assert!(p.ci95[0] <= truth && truth <= p.ci95[1] && (p.value / truth - 1.0).abs() < 0.1, "{p:?} for {truth}");
}

#[test]
fn readings_of_half_the_speed_are_lost_pulses_on_a_ramp_too() {
    let closed = verdict(&ramp(&[230, 291, 990, 1422], 0.5, 0));
    assert_eq!(names(&closed), ["missed_pulses"]);
    probability(&closed, 4.0 / ROWS as f64);
}

#[test]
fn one_reading_in_a_run_has_no_name_and_is_listed() {
    for factor in [0.5, 2.0] {
        let closed = verdict(&ramp(&[700], factor, 0));
        assert!(names(&closed).is_empty(), "{:?}", names(&closed));
        let listed: Vec<(&str, usize, usize)> =
            closed.verdict.set_aside.iter().map(|a| (a.channel.as_str(), a.row, a.rows)).collect();
        assert_eq!(listed, [("rpm_hall", 700, 1)]);
    }
}

/// Drop-outs of a sixth of the speed that come back within some rows: the sensor loses its hold, and no pulse by chance.
#[test]
fn a_drop_out_that_comes_back_slowly_is_no_lost_pulse() {
    let lost = |i: usize, from: usize| if i < from { 0.0 } else { 0.15 * (-((i - from) as f64) / 4.0).exp() };
    let closed = verdict(&read_by(&|i| 1.0 - [300, 640, 1010, 1300].iter().map(|from| lost(i, *from)).sum::<f64>(), 0));
    assert!(!names(&closed).contains(&"missed_pulses"), "{:?}", names(&closed));
}

#[test]
fn a_late_sensor_on_a_ramp_loses_no_pulses() {
    for late in [0, 3] {
        let closed = verdict(&ramp(&[], 1.0, late));
        assert!(!names(&closed).iter().any(|n| n.ends_with("_pulses")), "{late}: {:?}", names(&closed));
    }
}
