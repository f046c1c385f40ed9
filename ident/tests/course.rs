//! A rotor that takes the same way every day, which no form of the library has: what it does otherwise than on the healthy day is news.
//!
//! What it is: a rig whose speed swings about its new level, a healthy day, another one, days on which its supply gives no more than a
//! rotor that speeds up from rest takes, and days on which the load cell reads something else.
//! What can go wrong: nothing; a seed gives one day.
//! Units: s, us, rev/min, N, N.m.
//! Reference: specification `closing-the-loop.md`, step 1.

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::model::Model;
use ident::verdict::Kind;
use rig::{Chance, STEP};

/// Levels of the command, us.
const LEVELS: [f64; 14] =
    [1100.0, 1700.0, 1250.0, 1800.0, 1150.0, 1400.0, 1750.0, 1300.0, 1500.0, 1200.0, 1650.0, 1350.0, 1850.0, 1450.0];
/// Rows of a level.
const HOLD: usize = 120;
/// Frequency and damping of the way to a new level, rad/s.
const SWING: (f64, f64) = (9.0, 0.35);

/// One day of the rig.
struct Day<'d> {
    seed: u64,
    levels: &'d [f64],
    /// Most that the speed gains on its way to the highest levels, rev/min a second.
    most: f64,
    /// What the load cell reads of a thrust, N, and a torque, N.m, at an instant, s, before its noise.
    cell: &'d dyn Fn(f64, f64, f64) -> f64,
}

const HEALTHY: Day<'static> = Day { seed: 1, levels: &LEVELS, most: f64::INFINITY, cell: &|thrust, _, _| thrust };

/// The log of a day.
fn log(day: &Day<'_>) -> Log {
    let chance = &mut Chance::new(day.seed);
    let pulse: Vec<f64> = day.levels.iter().flat_map(|p| std::iter::repeat_n(*p, HOLD)).collect();
    let (mut rpm, mut rate) = (7.0 * (day.levels[0] - 1000.0), 0.0);
    let mut columns: Vec<Column> =
        ["pulse_us", "rpm", "thrust_n", "torque_nm"].map(|name| Column { name: name.into(), values: vec![] }).into();
    for (row, p) in pulse.iter().enumerate() {
        let start = rpm;
        for _ in 0..20 {
            let dt = STEP / 20.0;
            rate += (SWING.0.powi(2) * (7.0 * (p - 1000.0) - rpm) - 2.0 * SWING.1 * SWING.0 * rate) * dt;
            if *p > 1780.0 {
                rate = f64::min(rate, day.most);
            }
            rpm += rate * dt;
        }
        let torque = 3.5e-9 * rpm * rpm + 6e-6 * (rpm - start) / STEP;
        let thrust = (day.cell)(2.5e-7 * rpm * rpm, torque, STEP * row as f64);
        let noise = [0.0, 1.0, 0.01, 5e-4].map(|sd| sd * chance.normal());
        let truth = [*p, rpm, thrust, torque];
        columns.iter_mut().zip(truth.iter().zip(noise)).for_each(|(column, (value, noise))| column.values.push(value + noise));
    }
    let t = (0..pulse.len()).map(|i| STEP * i as f64).collect();
    Log { name: "day.csv".to_owned(), t, columns, ..Log::default() }
}

/// The model of the healthy day, written and read back.
fn model() -> Model {
    let own = close(&log(&HEALTHY), None, &[], &mut |_| {}).expect("a healthy day").model;
    let read = Model::parse("model.toml", &own.to_toml()).expect("what was written");
    let (a, b) = (own.course.expect("a course"), read.course.as_ref().expect("a course"));
    assert_eq!((&a.t, &a.commands), (&b.t, &b.commands));
    for ((channel, errors), (_, read)) in a.errors.iter().zip(&b.errors) {
        let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-3 * a.abs() || a.is_nan() && b.is_nan();
        assert!(errors.iter().zip(read).all(same), "{channel}");
    }
    read
}

fn against(model: &Model, day: &Day<'_>) -> Closed {
    close(&log(day), Some(model), &[], &mut |_| {}).expect("a day")
}

/// By how much the rows of the speed are news, rms in noises.
fn news(closed: &Closed) -> f64 {
    let target = &closed.context.targets[closed.context.target("rpm").expect("a speed")];
    let predicted = closed.declared.predict(&closed.context, "rpm").expect("a speed");
    let news = target.rows.iter().zip(&target.y).map(|(row, y)| target.news(*row, y - predicted[*row] - target.known[*row]));
    (news.map(|n| n * n).sum::<f64>() / target.rows.len() as f64).sqrt() / target.noise.rms
}

/// The first name that is no zero.
fn first(closed: &Closed) -> &str {
    closed.verdict.effects.iter().map(|e| e.id.as_str()).find(|id| *id != "tare_shift").unwrap_or("")
}

#[test]
fn the_same_way_is_no_news_and_another_one_is() {
    let model = model();
    let same = against(&model, &Day { seed: 2, ..HEALTHY });
    let weak_day = Day { seed: 2, most: 6_000.0, ..HEALTHY };
    let weak = against(&model, &weak_day);
    assert_eq!(same.verdict.verdict, Kind::None, "{:?}", same.verdict.effects);
    assert!(news(&same) < 1.5 && news(&weak) > 5.0 * news(&same), "{} {}", news(&same), news(&weak));
    assert_ne!(weak.verdict.verdict, Kind::None);
    // without the course a model is not to be trusted where it is as far off as that
    let forgetful = Model { course: None, ..model };
    let weak = against(&forgetful, &weak_day);
    assert!(news(&weak) < 2.0, "{}", news(&weak));
}

#[test]
fn another_schedule_finds_no_counterparts() {
    let model = model();
    let mut other = LEVELS;
    other.reverse();
    let other = Day { seed: 3, levels: &other, ..HEALTHY };
    let day = against(&model, &other);
    assert_eq!(day.verdict.verdict, Kind::None, "{:?}", day.verdict.effects);
    let forgetful = against(&Model { course: None, ..model }, &other);
    assert_eq!(news(&day), news(&forgetful));
}

/// Where the load is held both are a share of the thrust; only what turns the rotor faster is in one and not in the other.
#[test]
fn a_cell_that_begins_to_read_the_torque_is_told_from_a_gain_that_changes() {
    let model = model();
    let crosstalk = against(
        &model,
        &Day { seed: 4, cell: &|thrust, torque, t| thrust + if t > 41.0 { 3.0 * torque } else { 0.0 }, ..HEALTHY },
    );
    assert_eq!(first(&crosstalk), "torque_crosstalk", "{:?}", crosstalk.verdict.effects);
    let entry = crosstalk.verdict.effects.iter().find(|e| e.id == "torque_crosstalk").expect("named");
    let value = |name: &str| entry.parameters.iter().find(|p| p.name == name).expect("a parameter").value;
    assert!((value("coefficient") - 3.0).abs() < 0.15 && (value("t0") - 41.0).abs() < 0.3, "{:?}", entry.parameters);
    let gain = against(&model, &Day { seed: 4, cell: &|thrust, _, t| if t > 41.0 { 1.042 * thrust } else { thrust }, ..HEALTHY });
    assert_eq!(first(&gain), "gain_change", "{:?}", gain.verdict.effects);
}

#[test]
fn coarse_steps_are_seen_beneath_the_noise() {
    let model = model();
    // a cell that was tared on one side of an edge
    for zero in [0.01, 0.08] {
        coarse_steps(&model, &Day { seed: 5, cell: &|thrust, _, _| 0.2 * ((thrust + 0.03) / 0.2).round() + zero, ..HEALTHY });
    }
}

fn coarse_steps(model: &Model, coarse: &Day<'_>) {
    let closed = against(model, coarse);
    assert_eq!(first(&closed), "quantisation", "{:?}", closed.verdict.effects);
    let entry = closed.verdict.effects.iter().find(|e| e.id == "quantisation").expect("named");
    let value = |name: &str| entry.parameters.iter().find(|p| p.name == name).expect("a parameter").value;
    assert!((value("step") / 0.2 - 1.0).abs() < 0.01, "{:?}", entry.parameters);
    let thrust = &closed.verdict.channels["thrust_n"];
    assert!(thrust.after.rms < 0.5 * thrust.before.rms, "{thrust:?}");
    // the written model rounds as the verdict says, but for what the curve knows of a level on an edge
    let written = Model::parse("model.toml", &closed.model.to_toml()).expect("what was written");
    let context = ident::channel::Context::new(&log(coarse), Some(written.start_pulse_us));
    let predicted = written.predict(&context, "thrust_n").expect("a thrust");
    let target = &context.targets[context.target("thrust_n").expect("a thrust")];
    let squares = target.rows.iter().zip(&target.y).map(|(row, y)| (y - predicted[*row]).powi(2)).sum::<f64>();
    let rms = (squares / target.rows.len() as f64).sqrt();
    assert!((rms / thrust.after.rms - 1.0).abs() < 0.15, "{rms} {thrust:?}");
}

#[test]
fn a_course_is_read_as_strictly_as_the_rest() {
    let text = model().to_toml();
    let line = |key: &str| text.lines().find(|l| l.starts_with(key)).expect("a key of the course").to_owned();
    let refused = |key: &str, to: &str, said: &str| {
        let message = Model::parse("m.toml", &text.replacen(&line(key), to, 1)).expect_err(to).to_string();
        assert!(message.contains(said) && message.contains("expected"), "{message}");
    };
    refused("changed_s = ", "changed_s = [1.0, 0.5]", "course.changed_s");
    refused("pulse_us = ", "pulse_us = [1000.0]", "course.pulse_us");
    refused("t_s = ", "", "course.t_s");
    refused("thrust_n = ", "thrust_n = [0.1]", "course.thrust_n");
    refused("thrust_n = ", "thrusts = [0.1]", "thrusts");
}
