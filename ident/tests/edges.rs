//! Limits that are reached close beneath the top of a run, where few levels lie.
//!
//! What it is: a quasi-static rig whose amplifier, or whose supply, reaches its limit just before the highest level.
//! What can go wrong: a search whose grid ends below finds nothing, and the verdict names something else.
//! Units: SI, rev/min, us.
//! Reference: specification `closing-the-loop.md`, step 4.

mod rig;

use ident::close::close;
use ident::log::{Column, Log};
use rig::Chance;

const ROWS: usize = 4000;

/// Visits of a few levels, to the highest now and then.
fn pulse(level: impl Fn(usize) -> f64) -> Vec<f64> {
    (0..ROWS).map(|i| if i < 60 { 1000.0 } else { level(i / 80) }).collect()
}

/// A log: `reached` bends the command, `rail` the thrust's reading.
fn log(pulse: Vec<f64>, reached: f64, rail: f64) -> Log {
    let mut chance = Chance::new(3);
    let t: Vec<f64> = (0..ROWS).map(|i| 0.05 * i as f64).collect();
    let speed = |p: f64| if p < 1050.0 { 0.0 } else { 7.0 * (p.min(reached) - 1000.0) };
    let rpm: Vec<f64> = pulse.iter().map(|p| speed(*p)).collect();
    let mut columns = vec![Column { name: "pulse_us".into(), values: pulse }];
    let mut add = |name: &str, noise: f64, value: &dyn Fn(f64) -> f64| {
        let values = rpm.iter().map(|r| value(*r) + noise * chance.normal()).collect();
        columns.push(Column { name: name.into(), values });
    };
    add("rpm", 1.5, &|r| r);
    add("current_a", 0.02, &|r| 0.2 + 2e-11 * r.powi(3));
    add("torque_nm", 0.0001, &|r| 2.4e-9 * r * r);
    add("thrust_n", 0.004, &|r| 1.4e-7 * r * r);
    let thrust = columns.last_mut().expect("a thrust");
    thrust.values.iter_mut().for_each(|v| *v = v.min(rail));
    Log { name: "run.csv".into(), t, columns, ..Log::default() }
}

/// The first name and its first parameter.
fn named(log: &Log) -> (String, f64) {
    let verdict = close(log, None, &[], &mut |_| {}).expect("a log").verdict;
    verdict.effects.first().map_or_else(Default::default, |e| (e.id.clone(), e.parameters.first().map_or(f64::NAN, |p| p.value)))
}

#[test]
fn an_amplifier_that_saturates_at_the_highest_level_only() {
    let levels = pulse(|k| [1150.0, 1300.0, 1420.0, 1560.0, 1700.0, 1830.0, 1900.0, 1960.0][k * 5 % 8]);
    let highest = 1.4e-7 * (7.0 * 960.0_f64).powi(2);
    for below in [0.004, 0.008] {
        let rail = highest * (1.0 - below);
        let (id, level) = named(&log(levels.clone(), f64::INFINITY, rail));
        assert!(id == "amplifier_saturation" && (level - rail).abs() < 1e-3, "{below}: {id} {level} of {rail}");
    }
}

#[test]
fn a_supply_that_reaches_its_limit_at_the_highest_level_only() {
    // a wide range of levels, and one on which a share of the range is less than a limit needs above it
    for (highest, reached) in [(1950.0, 1945.5), (1700.0, 1695.4)] {
        let span = highest - 1050.0;
        let levels = [0.11, 0.28, 0.41, 0.57, 0.72, 0.87, 0.937, 1.0].map(|share: f64| (1050.0 + share * span).round());
        let (id, _) = named(&log(pulse(|k| levels[k * 5 % 8]), reached, f64::INFINITY));
        assert_eq!(id, "current_limit", "of {highest} us");
    }
}
