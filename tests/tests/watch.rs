//! A run held against its model while it goes on: healthy runs, and blades that break in mid-run; a hundred and twenty by `cargo xtask campaign`.

use ident::close::watch::{Departure, Watch};
use ident::log::Log;
use ident::model::Model;
use quadrig_tests::{call, cases};
use std::path::Path;

/// What `--stop-at` is given.
const STOP_AT: f64 = 8.0;
/// Healthy runs, in the suite and in the campaign: as many of each schedule.
const HEALTHY: [u64; 2] = [24, 100];
/// Runs with blades that break.
const BROKEN: [u64; 2] = [8, 20];

/// Flies a scenario and reads its log.
fn flown(folder: &Path, text: &str) -> Log {
    std::fs::write(folder.join("run.toml"), text).expect("a file");
    call(folder, &["--quiet", "sim", "run.toml", "-o", "run.csv"]).succeeded();
    Log::read(&folder.join("run.csv")).expect("a log")
}

/// The model of a healthy day.
fn model(folder: &Path) -> Model {
    let healthy = "seed = 1001\nschedule = { kind = \"up_down\", step_us = 50, hold_s = 6, top_us = 1800 }\n";
    std::fs::write(folder.join("day.toml"), healthy).expect("a file");
    call(folder, &["--quiet", "sim", "day.toml", "-o", "day.csv"]).succeeded();
    call(folder, &["--quiet", "close-loop", "day.csv", "-o", "day"]).succeeded();
    Model::read(&folder.join("day/model.toml")).expect("a model")
}

/// Gives a watch the rows of a log one by one, as the rig sends them.
fn watched(model: &Model, log: &Log) -> (Option<Departure>, f64) {
    let mut watch = Watch::new(model.clone(), STOP_AT);
    let mut worst = 0.0_f64;
    for row in 0..log.len() {
        let cells: Vec<(&'static str, f64)> = log
            .columns
            .iter()
            .filter_map(|c| {
                Some((ident::log::MODELLED.into_iter().chain(["pulse_us", "temp_c"]).find(|n| *n == c.name)?, c.values[row]))
            })
            .collect();
        watch.push(log.t[row], &cells);
        if row % 3 > 0 {
            continue; // as a thread that is busy meanwhile
        }
        if let Some(found) = watch.judge() {
            return (Some(found), worst);
        }
        worst = watch.shown().iter().map(|s| s.floors.abs()).filter(|f| f.is_finite()).fold(worst, f64::max);
    }
    (None, worst)
}

/// Schedules of the runs: other levels and other holds than the model's day.
fn schedule(seed: u64) -> String {
    match seed % 4 {
        0 => "schedule = { kind = \"up_down\", step_us = 50, hold_s = 3, top_us = 1800 }".to_owned(),
        1 => "schedule = { kind = \"staircase\", step_us = 130, hold_s = 5, top_us = 1800 }".to_owned(),
        2 => "schedule = { kind = \"steps\", steps = [{ pulse_us = 1425, hold_s = 10, ramp = false }, { pulse_us = 1710, hold_s = 10, ramp = false }, { pulse_us = 1230, hold_s = 10, ramp = false }, { pulse_us = 1640, hold_s = 10, ramp = false }] }".to_owned(),
        _ => "schedule = { kind = \"steps\", steps = [{ pulse_us = 1300, hold_s = 5, ramp = false }, { pulse_us = 1800, hold_s = 20, ramp = true }, { pulse_us = 1300, hold_s = 20, ramp = true }] }".to_owned(),
    }
}

#[test]
fn healthy_runs_are_stopped_by_nothing() {
    let healthy = cases(HEALTHY[0], HEALTHY[1]);
    let folder = tempfile::tempdir().expect("a folder");
    let model = model(folder.path());
    let mut worst = 0.0_f64;
    for seed in 1..=healthy {
        let log = flown(folder.path(), &format!("seed = {seed}\n{}\n", schedule(seed)));
        let (found, most) = watched(&model, &log);
        worst = worst.max(most);
        assert_eq!(found, None, "seed {seed}, {}", schedule(seed));
    }
    println!("the largest single residual of {healthy} runs: {worst:.1} noise floors");
}

#[test]
fn blades_that_break_in_mid_run_are_found_within_two_seconds() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = model(folder.path());
    for seed in 1..=cases(BROKEN[0], BROKEN[1]) {
        // under load: a tenth of hardly any thrust is below every noise floor
        let t0 = [44.0, 26.0, 13.0, 20.0][(seed % 4) as usize] + 0.37 * seed as f64;
        let change = -0.12 - 0.04 * (seed % 5) as f64;
        let effect = format!(
            "[[effect]]\nid = \"blade_damage\"\nthrust_change = {change}\ntorque_change = {}\nt0_s = {t0}\n",
            -0.5 * change
        );
        let log = flown(folder.path(), &format!("seed = {}\n{}\n{effect}", 300 + seed, schedule(seed)));
        let (found, _) = watched(&model, &log);
        let found = found.unwrap_or_else(|| panic!("{seed}: a change of {change} at {t0} s is not found"));
        println!("{change:+.2} at {t0:.2} s: {found:?}");
        assert!((t0 - 0.3..=t0 + 2.0).contains(&found.seen_s), "{seed}: {change} at {t0} s: {found:?}");
        assert!((found.t_s - t0).abs() < 1.0, "the row is named: {found:?}");
    }
}
