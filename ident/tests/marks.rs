//! Marks of a speed sensor that do not stand opposite each other, told by a board that times whole revolutions.
//!
//! What it is: a quasi-static rig whose readings are right; only the board's account of the periods differs.
//! What can go wrong: a case that is named and should not be, or the other way round, fails with the verdict in its message.
//! Units: SI, rev/min, us, deg.
//! Reference: Beharie 2013, section 5.7.1.

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::model::Model;
use ident::verdict::Kind;
use rig::Chance;

const ROWS: usize = 1500;

/// A staircase whose hall sensor's magnets stand off by what `angle` makes of the speed; `bump` is an error of the thrust.
fn log(seed: u64, angle: impl Fn(f64) -> f64, bump: impl Fn(f64) -> f64) -> Log {
    let mut chance = Chance::new(seed);
    let t: Vec<f64> = (0..ROWS).map(|i| 0.1 * i as f64).collect();
    let pulse: Vec<f64> = (0..ROWS).map(|i| if i < 50 { 1000.0 } else { 1150.0 + 15.0 * ((i / 50 * 17) % 40) as f64 }).collect();
    let rpm: Vec<f64> = pulse.iter().map(|p| if *p < 1050.0 { 0.0 } else { 7.0 * (p - 1000.0) }).collect();
    let mut columns = vec![Column { name: "pulse_us".into(), values: pulse }];
    let mut add = |name: &str, quiet: Vec<f64>, noise: f64| {
        columns.push(Column { name: name.into(), values: quiet.iter().map(|v| v + noise * chance.normal()).collect() });
    };
    for name in ["rpm_beam", "rpm_opto", "rpm_hall"] {
        add(name, rpm.clone(), 2.0);
    }
    add("thrust_n", rpm.iter().map(|r| 1.5e-7 * r * r + bump(*r)).collect(), 0.01);
    add("uneven_hall_deg", rpm.iter().map(|r| if *r > 0.0 { angle(*r) } else { f64::NAN }).collect(), 0.1);
    Log { name: "run.csv".into(), t, columns, ..Log::default() }
}

fn closed(log: &Log, model: Option<&Model>) -> Closed {
    close(log, model, &[], &mut |_| {}).expect("a log")
}

fn names(closed: &Closed) -> Vec<&str> {
    closed.verdict.effects.iter().map(|e| e.id.as_str()).collect()
}

#[test]
fn magnets_that_stand_off_are_named_and_change_no_prediction() {
    let log = log(1, |_| 22.0, |_| 0.0);
    let closed = closed(&log, None);
    assert_eq!((names(&closed), closed.verdict.verdict), (vec!["alternating_period"], Kind::Attributed));
    let entry = &closed.verdict.effects[0];
    assert_eq!(entry.channels, ["rpm_hall"]);
    let [low, high] = entry.parameters[0].ci95;
    assert!(low < 22.0 && 22.0 < high && high - low < 0.1, "{low} to {high}");
    let (before, after) = (&closed.verdict.channels["rpm_hall"].before, &closed.verdict.channels["rpm_hall"].after);
    assert!((before.rms - after.rms).abs() < 1e-12, "{} and {}", before.rms, after.rms);
    // the written model predicts the same, and the next day's magnets are no news
    let model = Model::parse("model.toml", &closed.model.to_toml()).expect("a model");
    let next = self::log(2, |_| 22.3, |_| 0.0);
    let again = self::closed(&next, Some(&model));
    assert_eq!((names(&again), again.verdict.verdict), (vec![], Kind::None));
    // that they came loose since is
    let loose = self::closed(&self::log(3, |_| 31.0, |_| 0.0), Some(&model));
    assert_eq!(names(&loose), ["alternating_period"]);
    assert!((loose.verdict.effects[0].parameters[0].value - 9.0).abs() < 0.1, "{:?}", loose.verdict.effects[0].parameters);
    assert!(loose.verdict.effects[0].evidence.contains("31.0 deg off"), "{}", loose.verdict.effects[0].evidence);
    // and so is that they were set right, however small what is left of the angle
    let mended = self::closed(&self::log(3, |rpm| 0.3 + 1e-4 * rpm, |_| 0.0), Some(&model));
    assert_eq!(names(&mended), ["alternating_period"]);
    let news = mended.verdict.effects[0].parameters[0].value;
    assert!((news + 21.4).abs() < 0.3, "{news}");
    let next = Model::parse("model.toml", &mended.model.to_toml()).expect("a model");
    assert_eq!(self::closed(&self::log(4, |_| 0.6, |_| 0.0), Some(&next)).verdict.verdict, Kind::None);
}

#[test]
fn what_stands_as_it_should_or_changes_with_the_speed_is_not_named() {
    for (seed, angle) in [(4, 0.1), (5, 3.0)] {
        let closed = closed(&log(seed, |_| angle, |_| 0.0), None);
        assert_eq!(closed.verdict.verdict, Kind::None, "{angle} deg: {:?}", names(&closed));
    }
    let twisted = closed(&log(6, |rpm| 14.0 * (rpm / 5000.0).powi(2), |_| 0.0), None);
    assert_eq!(twisted.verdict.verdict, Kind::None, "{:?}", names(&twisted));
    // at one speed nothing tells the two apart
    let mut held = log(7, |_| 8.0, |_| 0.0);
    let speed = held.column("rpm_beam").expect("a speed").to_vec();
    let angle = held.columns.last_mut().expect("the marks");
    angle.values.iter_mut().zip(speed).filter(|(_, rpm)| !(3000.0..3500.0).contains(rpm)).for_each(|(v, _)| *v = f64::NAN);
    assert_eq!(closed(&held, None).verdict.verdict, Kind::None);
}

#[test]
fn an_account_of_marks_is_no_variable_that_a_residual_depends_on() {
    let closed = closed(&log(7, |rpm| 0.1 + 1e-3 * rpm, |_| 0.0), None);
    assert!(closed.context.covariates.is_empty(), "{:?}", closed.context.covariates.first().map(|c| &c.0));
}

#[test]
fn beside_another_cause_it_is_a_further_name_and_beside_what_has_none_the_only_one() {
    let beside = closed(&log(8, |_| 15.0, |rpm| if rpm > 3500.0 { -3e-7 * (rpm - 3500.0).powi(2) } else { 0.0 }), None);
    let ids = names(&beside);
    assert!(ids.len() > 1 && ids.iter().position(|id| *id == "alternating_period") == Some(ids.len() - 1), "{ids:?}");
    // each is as sure as it is by itself
    let p: Vec<f64> = beside.verdict.effects.iter().map(|e| e.probability).collect();
    assert!(p.iter().all(|p| (0.5..1.0).contains(p)), "{p:?}");
    let unknown = closed(&log(9, |_| 15.0, |rpm| 0.3 * (rpm / 150.0).sin()), None);
    assert_eq!((names(&unknown), unknown.verdict.verdict), (vec!["alternating_period", "unknown"], Kind::Attributed));
    assert!(unknown.verdict.effects[0].evidence.contains("rpm_hall long and short"), "{}", unknown.verdict.effects[0].evidence);
    assert_eq!(unknown.model.told_by_the_board().count(), 1);
}
