//! A rotor that is driven by a motor: what holds it back, or drives it otherwise than on the healthy day, goes through its inertia.
//!
//! What it is: a motor with a winding, a supply and an inertia; a healthy day, and days on which the current is limited while the rotor speeds
//! up, the command acts in coarse steps, the load cell's clock drifts, or the rotor is slow.
//! What can go wrong: nothing; a seed gives one day.
//! Units: s, us, rev/min, N, N.m, A, V.
//! Reference: Beharie 2013, Eq. 5.11 as corrected (motor); specification `closing-the-loop.md`, step 1.

mod rig;

use ident::channel::Context;
use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::model::Model;
use ident::verdict::EffectEntry;
use rig::{Chance, K_THRUST, K_TORQUE, KV, NO_LOAD, RESISTANCE};

const VOLTS: f64 = 11.5;
/// Inertia of rotor and propeller, kg m^2.
const INERTIA: f64 = 6.0e-5;
const RAD: f64 = std::f64::consts::TAU / 60.0;

/// One day of the rig.
#[derive(Clone)]
struct Day<'d> {
    seed: u64,
    /// From row to row, s.
    step: f64,
    pulse: Vec<f64>,
    /// Most supply current, A.
    limit: f64,
    /// Steps in which the command acts, us; 0 for none.
    coarse: f64,
    /// By how much the load cell's clock runs slow.
    late: f64,
    /// Time constant in which the controller follows the command, s.
    follows: f64,
    /// Times the inertia.
    heavy: f64,
    noise: &'d [f64; 6],
}

/// Of pulse, two speeds, thrust, torque and current.
const NOISE: [f64; 6] = [0.0, 0.7, 0.7, 0.01, 4e-4, 0.03];

/// A command that is held for some seconds at a level.
fn held(levels: &[f64], step: f64, hold_s: f64) -> Vec<f64> {
    let rows = (hold_s / step) as usize;
    levels.iter().flat_map(|p| std::iter::repeat_n(*p, rows)).collect()
}

fn jumps(step: f64) -> Vec<f64> {
    let up_and_down =
        [1100.0, 1800.0, 1250.0, 1850.0, 1150.0, 1400.0, 1750.0, 1300.0, 1880.0, 1200.0, 1650.0, 1350.0, 1850.0, 1450.0];
    held(&up_and_down, step, 9.0)
}

/// Levels of a staircase up and down, on a grid of their own.
fn stairs(step: f64) -> Vec<f64> {
    let up = (0..16).map(|k| 1100.0 + 50.0 * f64::from(k));
    held(&up.clone().chain(up.rev()).collect::<Vec<f64>>(), step, 4.0)
}

fn day(seed: u64, step: f64, pulse: Vec<f64>) -> Day<'static> {
    Day { seed, step, pulse, limit: f64::INFINITY, coarse: 0.0, late: 0.0, follows: 0.0, heavy: 1.0, noise: &NOISE }
}

/// Parts of a row in which the rotor is turned.
const PARTS: usize = 25;

/// The log of a day.
fn log(day: &Day<'_>) -> Log {
    let chance = &mut Chance::new(day.seed);
    let kt = 60.0 / (std::f64::consts::TAU * KV);
    let (mut w, mut acts): (f64, f64) = (0.0, 1000.0);
    let mut truth: Vec<[f64; 3]> = Vec::new();
    let names = ["pulse_us", "rpm_opto", "rpm_hall", "thrust_n", "torque_nm", "current_a"];
    let mut columns: Vec<Column> = names.map(|name| Column { name: name.into(), values: vec![] }).into();
    for (row, pulse) in day.pulse.iter().enumerate() {
        let (dt, mut mean) = (day.step / PARTS as f64, [0.0; 3]);
        for _ in 0..PARTS {
            let asked = if day.coarse > 0.0 { 1000.0 + day.coarse * ((pulse - 1000.0) / day.coarse).floor() } else { *pulse };
            acts = asked + (acts - asked) * if day.follows > 0.0 { (-dt / day.follows).exp() } else { 0.0 };
            let duty = (acts - 1000.0) / 1000.0;
            // duty (duty V - Kt w) / R <= limit
            let most = (kt * w + ((kt * w).powi(2) + 4.0 * VOLTS * RESISTANCE * day.limit).sqrt()) / (2.0 * VOLTS);
            let duty = if day.limit.is_finite() { duty.min(most) } else { duty };
            let winding = ((duty * VOLTS - kt * w) / RESISTANCE).max(0.0);
            let load = K_TORQUE * w * w;
            let torque = kt * (winding - NO_LOAD).max(-NO_LOAD);
            mean = [mean[0] + w / PARTS as f64, mean[1] + torque / PARTS as f64, mean[2] + duty * winding / PARTS as f64];
            w = (w + dt * (torque - load) / (INERTIA * day.heavy)).max(0.0);
        }
        truth.push(mean);
        // what a slow clock reads was true a while ago
        let at = row as f64 * (1.0 - day.late);
        let (from, part) = (at as usize, at.fract());
        let cell: [f64; 2] = [K_THRUST * truth[from][0].powi(2), truth[from][1]];
        let next = truth.get(from + 1).unwrap_or(&truth[from]);
        let cell = [cell[0] + part * (K_THRUST * next[0].powi(2) - cell[0]), cell[1] + part * (next[1] - cell[1])];
        let values = [*pulse, mean[0] / RAD, mean[0] / RAD, cell[0], cell[1], mean[2]];
        for (column, (value, sd)) in columns.iter_mut().zip(values.iter().zip(day.noise)) {
            column.values.push(value + sd * chance.normal());
        }
    }
    let t = (0..day.pulse.len()).map(|i| day.step * i as f64).collect();
    Log { name: "day.csv".to_owned(), t, columns, ..Log::default() }
}

/// A day against the model of a healthy one, which is written and read back.
fn against(healthy: &Day<'_>, today: &Day<'_>) -> Closed {
    let own = close(&log(healthy), None, &[], &mut |_| {}).expect("a healthy day").model;
    let model = Model::parse("model.toml", &own.to_toml()).expect("what was written");
    close(&log(today), Some(&model), &[], &mut |_| {}).expect("a day")
}

/// The names that are no zeros.
fn names(closed: &Closed) -> Vec<&EffectEntry> {
    closed.verdict.effects.iter().filter(|e| e.id != "tare_shift").collect()
}

fn ids(closed: &Closed) -> Vec<&str> {
    names(closed).iter().map(|e| e.id.as_str()).collect()
}

fn value(closed: &Closed, name: &str) -> f64 {
    let of_first = names(closed)[0].parameters.iter().find(|p| p.name == name).map(|p| p.value);
    of_first.unwrap_or_else(|| panic!("{name} of {:?}", closed.verdict.effects))
}

/// The written model is read back, and predicts what the verdict says.
fn is_written_as_it_is_said(closed: &Closed, today: &Day<'_>) {
    let written = Model::parse("model.toml", &closed.model.to_toml()).expect("what was written");
    let log = log(today);
    let context = Context::new(&log, Some(written.start_pulse_us));
    for channel in ["rpm_opto", "rpm_hall", "current_a", "torque_nm", "thrust_n"] {
        let predicted = written.predict(&context, channel).expect("a channel");
        let target = &context.targets[context.target(channel).expect("a channel")];
        let square = target.rows.iter().zip(&target.y).map(|(row, y)| (y - predicted[*row]).powi(2)).sum::<f64>();
        let (rms, said) = ((square / target.y.len() as f64).sqrt(), closed.verdict.channels[channel].after.rms);
        assert!((rms / said - 1.0).abs() < 0.05, "{channel}: {rms} {said}");
    }
}

/// Six ways up are steep, and their readings of current and torque leave all others: that is how the rotor goes, and no absurd value.
#[test]
fn readings_that_stand_out_at_every_steep_step_are_the_rotors() {
    let healthy = close(&log(&day(1, 0.05, jumps(0.05))), None, &[], &mut |_| {}).expect("a healthy day");
    assert!(!ids(&healthy).contains(&"glitch_rows"), "{:?}", ids(&healthy));
}

#[test]
fn the_next_day_is_the_same() {
    let closed = against(&day(1, 0.05, jumps(0.05)), &day(2, 0.05, jumps(0.05)));
    assert!(names(&closed).is_empty(), "{:?}", ids(&closed));
}

#[test]
fn a_limit_that_no_level_reaches_is_found_where_the_rotor_speeds_up() {
    let healthy = Day { heavy: 2.5, ..day(1, 0.02, jumps(0.02)) };
    let limited = Day { seed: 2, limit: 8.0, ..healthy.clone() };
    let closed = against(&healthy, &limited);
    assert_eq!(ids(&closed), ["current_limit"]);
    // rows on the way up say little of the current, and the energy balance is that of a mean efficiency
    let limit = value(&closed, "limit");
    assert!((limit / 8.0 - 1.0).abs() < 0.25, "{limit}");
    is_written_as_it_is_said(&closed, &limited);
}

#[test]
fn a_coarse_command_is_told_beside_levels_on_a_grid_of_their_own() {
    let coarse = Day { coarse: 12.56, ..day(2, 0.05, stairs(0.05)) };
    let closed = against(&day(1, 0.05, stairs(0.05)), &coarse);
    assert_eq!(ids(&closed), ["throttle_quantisation"]);
    // on levels 50 us apart a step and its double are one
    let step = value(&closed, "step");
    assert!([12.56, 25.12].iter().any(|s| (step - s).abs() < 0.05), "{step}");
    is_written_as_it_is_said(&closed, &coarse);
}

#[test]
fn a_clock_that_drifts_is_no_filter() {
    let late = Day { late: 3e-3, ..day(2, 0.02, stairs(0.02)) };
    let closed = against(&day(1, 0.02, stairs(0.02)), &late);
    assert_eq!(ids(&closed).first(), Some(&"clock_drift"), "{:?}", ids(&closed));
    let rate = value(&closed, "rate");
    assert!((rate / 3e-3 - 1.0).abs() < 0.1, "{rate}");
}

#[test]
fn a_rotor_that_has_become_slow_is_followed_on_a_quick_log() {
    let slow = Day { follows: 0.8, ..day(2, 0.02, jumps(0.02)) };
    let closed = against(&day(1, 0.02, jumps(0.02)), &slow);
    assert_eq!(ids(&closed).first(), Some(&"spinup_lag"), "{:?}", ids(&closed));
}
