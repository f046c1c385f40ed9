//! Intervals that hold: 95 % of the stated intervals contain the truth.
//!
//! What it is: simulated runs with known constants, identified one by one; the share of intervals that hold is counted for each
//! constant, with and without a spoilt level.
//! What can go wrong: an error that is stated too small or too large.
//! Units: shares.
//! Reference: specification `identification.md`, item 3. `cargo test --release -p ident --test intervals -- --ignored --nocapture` runs
//! the thousand.

mod rig;

use ident::identify::identify;
use rig::{K_THRUST, K_TORQUE, KV, NO_LOAD, RESISTANCE, Trouble, omega, run};
use std::collections::BTreeMap;

/// Counts for each constant how many intervals held, of how many.
fn coverage(runs: u64, trouble: Trouble) -> BTreeMap<&'static str, (u32, u32)> {
    let mut held: BTreeMap<&'static str, (u32, u32)> = BTreeMap::new();
    let mut count = |name: &'static str, inside: bool| {
        let entry = held.entry(name).or_default();
        entry.0 += u32::from(inside);
        entry.1 += 1;
    };
    for seed in 1..=runs {
        let r = run(trouble, 120, 7_000 + seed);
        let found = identify(&r.log).expect("a run that can be identified");
        let truths = [
            ("k_T", K_THRUST),
            ("k_Q", K_TORQUE),
            ("KV", KV),
            ("R", RESISTANCE),
            ("I0", NO_LOAD),
            ("tau_up", r.tau),
            ("tau_down", r.tau),
        ];
        for (name, truth) in truths {
            if let Some(c) = found.constants.iter().find(|c| c.name == name) {
                count(name, (c.value - truth).abs() <= c.half);
            }
        }
        for (name, label, k) in [("thrust(rpm)", "band of thrust", K_THRUST), ("torque(rpm)", "band of torque", K_TORQUE)] {
            let f = found.curves.iter().find(|f| f.name == name).expect("a curve");
            for (rpm, label) in [(2000.0, label), (4500.0, label)] {
                let truth = k * omega(rpm).powi(2);
                count(label, (f.curve.at(rpm / 1000.0) - truth).abs() <= f.curve.band(rpm / 1000.0));
            }
        }
    }
    held
}

fn check(runs: u64, trouble: Trouble, low: f64, high: f64) {
    let mut faults = Vec::new();
    for (name, (inside, all)) in coverage(runs, trouble) {
        let share = f64::from(inside) / f64::from(all);
        println!("{name:<15} {share:.4} of {all}");
        if !(low..=high).contains(&share) || u64::from(all) < runs / 2 {
            faults.push(format!("{name}: {share:.3} of {all}"));
        }
    }
    assert!(faults.is_empty(), "outside {low} to {high}: {}", faults.join(", "));
}

const UP_DOWN: Trouble =
    Trouble { resonance: false, erratic: false, missing: false, drift: false, up_down: true, no_command: false, spoilt: false };

/// A hundred runs bound a share of 95 % to about 2.2 % (one standard deviation).
#[test]
fn intervals_hold_on_a_hundred_runs() {
    check(100, UP_DOWN, 0.885, 1.0);
}

#[test]
fn a_spoilt_level_does_not_spoil_them() {
    check(60, Trouble { spoilt: true, ..UP_DOWN }, 0.86, 1.0);
}

#[test]
#[ignore = "a thousand runs: a minute"]
fn intervals_hold_on_a_thousand_runs() {
    check(1000, UP_DOWN, 0.93, 0.97);
}
