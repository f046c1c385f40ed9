//! What a sensor does on a run that is held against the model of a healthy day: three speed sensors on one rotor, an encoder, a load cell.
//!
//! What it is: a quasi-static rig on random levels, with sensors that fail one at a time.
//! What can go wrong: a case whose effect the search misses fails with the verdict in its message.
//! Units: SI, rev/min, us.
//! Reference: specification `closing-the-loop.md`, "RPM sensing", "Timing and acquisition", step 1.

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::model::Model;
use ident::verdict::Kind;
use rig::Chance;

const STEP: f64 = 0.05;
const ROWS: usize = 3000;
const SENSORS: [&str; 4] = ["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder"];

/// What is the matter on a day.
struct Day<'d> {
    seed: u64,
    /// Torque that brakes the rotor at an instant, N.m.
    drag: &'d dyn Fn(f64) -> f64,
    /// What a sensor makes of a reading, of its number, the instant and the speed.
    reads: &'d dyn Fn(usize, f64, f64) -> f64,
    /// Instant that the load cell shows at an instant, s.
    shows: &'d dyn Fn(f64) -> f64,
    /// Noise of the beam, rev/min.
    beam: f64,
    /// Random walk of the speed, rev/min a row.
    gusts: f64,
    /// Zero of the load cell, N.
    zero: f64,
}

const HEALTHY: Day<'static> =
    Day { seed: 1, drag: &|_| 0.0, reads: &|_, _, rpm| rpm, shows: &|t| t, beam: 1.0, gusts: 0.0, zero: 0.0 };

/// Command at each row: the same levels of 2 to 5 s every day.
fn command() -> Vec<f64> {
    let mut chance = Chance::new(77);
    let mut out = Vec::new();
    while out.len() < ROWS {
        let rows = ((2.0 + 3.0 * chance.uniform()) / STEP) as usize;
        let pulse = (1150.0 + 750.0 * chance.uniform()).round();
        out.extend(std::iter::repeat_n(pulse, rows));
    }
    out.truncate(ROWS);
    out
}

/// The log of a day.
fn log(day: &Day<'_>) -> Log {
    let mut chance = Chance::new(day.seed);
    let t: Vec<f64> = (0..ROWS).map(|i| STEP * i as f64).collect();
    let pulse = command();
    let mut walk = 0.0;
    let speeds: Vec<f64> = (0..ROWS)
        .map(|i| {
            walk = 0.97 * walk + day.gusts * chance.normal();
            6.0 * (pulse[i] - 1000.0) - 4000.0 * (day.drag)(t[i]) + walk
        })
        .collect();
    let krpm = |i: usize| speeds[i] / 1000.0;
    let mut noisy = |name: &str, noise: f64, value: &dyn Fn(usize) -> f64| Column {
        name: name.to_owned(),
        values: (0..ROWS).map(|i| value(i) + noise * chance.normal()).collect(),
    };
    let row = |t: f64| ((t / STEP).round().max(0.0) as usize).min(ROWS - 1);
    let drawn = |i: usize| 0.3 + 0.05 * krpm(i).powi(3) + (day.drag)(t[i]) * speeds[i] * std::f64::consts::TAU / 60.0 / 12.0;
    let mut columns = vec![Column { name: "pulse_us".to_owned(), values: pulse }];
    for (k, name) in SENSORS.into_iter().enumerate() {
        columns.push(noisy(name, if k == 0 { day.beam } else { 1.0 }, &|i| (day.reads)(k, t[i], speeds[i])));
    }
    columns.push(noisy("thrust_n", 0.01, &|i| day.zero + 0.25 * krpm(row((day.shows)(t[i]))).powi(2)));
    columns.push(noisy("torque_nm", 0.0003, &|i| 0.004 * krpm(i).powi(2)));
    columns.push(noisy("current_a", 0.02, &drawn));
    Log { name: "day.csv".to_owned(), t, columns, ..Log::default() }
}

fn model(day: &Day<'_>) -> Model {
    let closed = close(&log(day), None, &[], &mut |_| {}).expect("a healthy day");
    Model::parse("model.toml", &closed.model.to_toml()).expect("the model of a healthy day")
}

/// What is named but for new zeros, which every day may have.
fn names(closed: &Closed) -> Vec<&str> {
    let zeros = |equation: &str| equation.contains("since before the run");
    let named = closed.verdict.effects.iter().filter(|e| e.id != "tare_shift" || !zeros(&e.equation));
    named.map(|e| e.id.as_str()).collect()
}

fn against(model: &Model, day: &Day<'_>) -> Closed {
    close(&log(day), Some(model), &[], &mut |_| {}).expect("a day")
}

#[test]
fn one_sensor_is_judged_by_what_the_others_read() {
    let model = model(&HEALTHY);
    let same = against(&model, &Day { seed: 2, ..HEALTHY });
    assert_eq!(names(&same), [""; 0]);
    let halved = |k: usize, _: f64, rpm: f64| if k == 2 { 0.5 * rpm } else { rpm };
    let dead = against(&model, &Day { seed: 3, reads: &halved, ..HEALTHY });
    assert_eq!(names(&dead), ["dead_rotor_speed"]);
}

#[test]
fn an_encoder_that_brakes_is_slower_by_its_own_reading_too() {
    let coupled = |t: f64| if t < 70.0 { 0.004 } else { 0.0 };
    let reads = |k: usize, t: f64, rpm: f64| if k == 3 && t >= 70.0 { f64::NAN } else { rpm };
    let braked = against(&model(&HEALTHY), &Day { seed: 4, drag: &coupled, reads: &reads, ..HEALTHY });
    assert_eq!(names(&braked), ["encoder_drag"]);
}

#[test]
fn cuts_too_many_above_one_speed_are_those_of_a_twisted_blade() {
    let struck = |fast: f64| {
        move |k: usize, t: f64, rpm: f64| {
            let row = (t / STEP).round() as u64;
            let (often, cuts) = (row.is_multiple_of(23), 8.0 + (row % 3) as f64);
            if k == 0 && often && rpm > fast { rpm * (cuts + 1.0) / cuts } else { rpm }
        }
    };
    let model = model(&HEALTHY);
    let twisted = against(&model, &Day { seed: 5, reads: &struck(4000.0), ..HEALTHY });
    assert_eq!(names(&twisted), ["blade_twist"]);
    let onset = &twisted.verdict.effects[0].parameters[0];
    assert!(onset.name == "onset" && onset.ci95[0] < 4000.0 && onset.ci95[1] > 4000.0, "{onset:?}");
    // the model that knows the twist does not take a sensor's own doubled pulses at low speeds for it
    let known = Model::parse("model.toml", &twisted.model.to_toml()).expect("the model of a twisted blade");
    let slow = |k: usize, t: f64, rpm: f64| if k == 0 && rpm < 3500.0 { struck(0.0)(k, t, rpm) } else { rpm };
    assert_eq!(names(&against(&known, &Day { seed: 22, reads: &slow, ..HEALTHY })), ["double_pulses"]);
    // at every speed it is the sensor's own
    let doubled = against(&model, &Day { seed: 6, reads: &struck(0.0), ..HEALTHY });
    assert_eq!(names(&doubled), ["double_pulses"]);
}

/// Sensors whose gains differ by as much as healthy ones do: a median of their readings would be now one of them and now another.
#[test]
fn a_beam_that_leaves_the_others_takes_none_along() {
    let gains = |k: usize, _: f64, rpm: f64| rpm * (1.0 + [0.0, -0.003, 0.003, 0.0][k]);
    let bends = |k: usize, t: f64, rpm: f64| gains(k, t, rpm) + if k == 0 { 0.02 * (rpm - 4000.0).max(0.0) } else { 0.0 };
    let closed = close(&log(&Day { seed: 8, reads: &bends, ..HEALTHY }), None, &[], &mut |_| {}).expect("a verdict");
    assert_eq!(names(&closed), ["blade_twist"]);
    let healthy = close(&log(&Day { seed: 8, reads: &gains, ..HEALTHY }), None, &[], &mut |_| {}).expect("a verdict");
    assert!(names(&healthy).is_empty(), "{:?}", names(&healthy));
}

/// A constant share of the speed is a healthy sensor's own gain up to some of its standard deviations of 0.3 %, and lost pulses beyond.
#[test]
fn what_a_healthy_gain_explains_is_no_loss_of_pulses() {
    for (share, expected) in [(0.003, vec![]), (0.006, vec![]), (0.03, vec!["missed_pulses"])] {
        let low = |k: usize, _: f64, rpm: f64| if k == 2 { rpm * (1.0 - share) } else { rpm };
        let closed = close(&log(&Day { seed: 12, reads: &low, ..HEALTHY }), None, &[], &mut |_| {}).expect("a verdict");
        assert_eq!(names(&closed), expected, "{share}");
    }
}

#[test]
fn a_hold_is_seen_beneath_the_noise() {
    let period = 0.834;
    let last_update = |t: f64| ((t - 0.3) / period).floor() * period + 0.3;
    let held = against(&model(&HEALTHY), &Day { seed: 7, shows: &last_update, ..HEALTHY });
    assert_eq!(names(&held), ["sample_hold"]);
    let found = &held.verdict.effects[0].parameters[0];
    assert!(found.ci95[0] < period && found.ci95[1] > period && (found.value - period).abs() < 0.002, "{found:?}");
    // a meter that is late by one and the same time repeats nothing
    let late = against(&model(&HEALTHY), &Day { seed: 8, shows: &|t| t - 0.4, ..HEALTHY });
    assert_eq!(names(&late), ["channel_delay"]);
}

#[test]
fn gusts_of_another_day_are_no_news() {
    let windy = |seed| Day { seed, gusts: 0.6, ..HEALTHY };
    let model = model(&windy(1));
    for seed in 10..16 {
        assert_eq!(names(&against(&model, &windy(seed))), [""; 0], "seed {seed}");
    }
}

#[test]
fn no_name_rests_on_one_moment() {
    // one sensor lags once, for a quarter of a second, as it may when a rotor starts
    let slow = |k: usize, t: f64, rpm: f64| if k == 3 && (60.0..60.25).contains(&t) { rpm - 400.0 * (60.3 - t) } else { rpm };
    let once = against(&model(&HEALTHY), &Day { seed: 9, reads: &slow, ..HEALTHY });
    assert_eq!(names(&once), [""; 0]);
}

#[test]
fn a_new_zero_does_not_answer_for_the_rest() {
    let wavers = |_: usize, t: f64, rpm: f64| rpm + 8.0 * (0.9 * t).sin();
    let day = against(&model(&HEALTHY), &Day { seed: 23, reads: &wavers, zero: 0.2, ..HEALTHY });
    assert_eq!(names(&day), ["unknown"]);
    let [zero, rest] = &day.verdict.effects[..] else { panic!("{:?}", day.verdict.effects) };
    assert_eq!((zero.id.as_str(), zero.channels[0].as_str()), ("tare_shift", "thrust_n"));
    assert!(rest.channels.iter().all(|c| c.starts_with("rpm")), "{:?}", rest.channels);
}

#[test]
fn a_sensor_that_grows_noisy_is_news_without_a_name() {
    let model = model(&HEALTHY);
    let noisy = against(&model, &Day { seed: 20, beam: 6.0, ..HEALTHY });
    assert_eq!((noisy.verdict.verdict, names(&noisy)), (Kind::Unattributed, vec!["unknown"]));
    let found = &noisy.verdict.effects[0];
    assert_eq!(found.channels, ["rpm_beam"]);
    assert!(
        found.evidence.starts_with("rpm_beam scatters 6.") || found.evidence.starts_with("rpm_beam scatters 5."),
        "{}",
        found.evidence
    );
    assert_eq!(names(&against(&model, &Day { seed: 21, beam: 2.0, ..HEALTHY })), [""; 0]);
}
