//! What meters make of a run: slow, late, coarse, and with a clock of their own.
//!
//! What it is: a quasi-static rig on random levels; the meters read it through what each test hides in them.
//! What can go wrong: a case whose effect the search misses fails with the verdict in its message.
//! Units: SI, rev/min, us.
//! Reference: specification `closing-the-loop.md`, "Timing and acquisition"; effects `channel_filter`, `channel_delay`, `clock_drift`,
//! `quantisation`, `glitch_rows`.

mod rig;

use ident::channel::Context;
use ident::close::{Closed, close};
use ident::effects::library;
use ident::effects::placed::Placed;
use ident::fit::heldout;
use ident::fit::{Rows, fit};
use ident::log::{Column, Log};
use ident::model::Declared;
use ident::verdict::Kind;
use rig::Chance;

const STEP: f64 = 0.05;
const ROWS: usize = 3000;

/// The instant of a row, and the command at any instant: levels of 2 to 5 s, a jump somewhere within a row.
struct Command(Vec<(f64, f64)>);

impl Command {
    fn new(seed: u64) -> Self {
        let mut chance = Chance::new(seed);
        let mut at = 0.0;
        let mut levels = Vec::new();
        while at < ROWS as f64 * STEP {
            levels.push((at, (1150.0 + 750.0 * chance.uniform()).round()));
            at = ((at + 2.0 + 3.0 * chance.uniform()) / STEP).floor() * STEP + 0.3 * STEP;
        }
        Self(levels)
    }

    /// Up and down once, a little at every row.
    fn ramp() -> Self {
        let pulse = |i: usize| 1900.0 - 800.0 * (2.0 * i as f64 / ROWS as f64 - 1.0).abs();
        Self((0..ROWS).map(|i| (STEP * (i as f64 - 0.5), pulse(i))).collect())
    }

    /// From a low level to each of some others and back, every one of them once.
    fn visits(levels: &[f64]) -> Self {
        let stay = ROWS as f64 * STEP / (2.0 * levels.len() as f64);
        let at = |i: usize| ((i as f64 * stay / STEP).floor() + 0.3) * STEP;
        Self((0..2 * levels.len()).map(|i| (at(i), if i % 2 == 0 { 1100.0 } else { levels[i / 2] })).collect())
    }

    fn pulse(&self, t: f64) -> f64 {
        self.0.iter().rev().find(|l| l.0 <= t).map_or(1000.0, |l| l.1)
    }

    fn speed(&self, t: f64) -> f64 {
        6.0 * (self.pulse(t) - 1000.0)
    }
}

fn thrust(rpm: f64) -> f64 {
    0.25 * (rpm / 1000.0).powi(2)
}

fn torque(rpm: f64) -> f64 {
    0.004 * (rpm / 1000.0).powi(2)
}

fn current(rpm: f64) -> f64 {
    0.3 + 0.05 * (rpm / 1000.0).powi(3)
}

/// A log of what four meters read at each instant, noise added.
fn log(command: &Command, meters: [&dyn Fn(f64) -> f64; 4], noise: [f64; 4]) -> Log {
    let mut chance = Chance::new(3);
    let t: Vec<f64> = (0..ROWS).map(|i| STEP * i as f64).collect();
    let column = |name: &str, values: Vec<f64>| Column { name: name.to_owned(), values };
    let mut columns = vec![column("pulse_us", t.iter().map(|t| command.pulse(*t)).collect())];
    for ((name, meter), noise) in ["rpm", "thrust_n", "torque_nm", "current_a"].into_iter().zip(meters).zip(noise) {
        columns.push(column(name, t.iter().map(|t| meter(*t) + noise * chance.normal()).collect()));
    }
    Log { name: "meters.csv".to_owned(), t, columns, ..Log::default() }
}

const NOISE: [f64; 4] = [3.0, 0.01, 0.0003, 0.02];

fn verdict(log: &Log) -> Closed {
    close(log, None, &[], &mut |_| {}).expect("a verdict")
}

fn names(closed: &Closed) -> Vec<&str> {
    closed.verdict.effects.iter().map(|e| e.id.as_str()).collect()
}

fn close_to(closed: &Closed, name: &str, truth: f64, tolerance: f64) {
    let p = closed.verdict.effects[0].parameters.iter().find(|p| p.name == name).expect(name);
    assert!((p.value - truth).abs() < tolerance, "{p:?} for {truth}");
}

/// A first-order lag of a signal of jumps, by small steps.
fn lagged(signal: &dyn Fn(f64) -> f64, tau: f64) -> Vec<f64> {
    let fine = 50;
    let h = STEP / f64::from(fine);
    let mut state = signal(0.0);
    (0..ROWS)
        .map(|i| {
            let value = state;
            (0..fine).for_each(|k| {
                let now = signal(STEP * i as f64 + h * (f64::from(k) + 1.0));
                state = now + (state - now) * (-h / tau).exp();
            });
            value
        })
        .collect()
}

#[test]
fn the_only_speed_meter_is_slow_where_all_that_follows_the_speed_is_ahead_of_it() {
    let c = Command::new(11);
    let tau = 0.06;
    let slow = lagged(&|t| c.speed(t), tau);
    let rpm = |t: f64| slow[(t / STEP).round() as usize];
    let closed = verdict(&log(&c, [&rpm, &|t| thrust(c.speed(t)), &|t| torque(c.speed(t)), &|t| current(c.speed(t))], NOISE));
    assert_eq!(names(&closed), ["channel_filter"], "{:?}", closed.verdict.alternatives);
    assert!(closed.verdict.effects[0].channels.contains(&"rpm".to_owned()));
    close_to(&closed, "tau", tau, 0.004);
}

#[test]
fn the_only_speed_meter_is_late_where_all_that_follows_the_speed_is_ahead_of_it() {
    let c = Command::new(12);
    let closed = verdict(&log(
        &c,
        [&|t| c.speed(t - 0.4), &|t| thrust(c.speed(t)), &|t| torque(c.speed(t)), &|t| current(c.speed(t))],
        NOISE,
    ));
    assert_eq!(names(&closed), ["channel_delay"], "{:?}", closed.verdict.alternatives);
    close_to(&closed, "delay", 0.4, STEP);
}

#[test]
fn a_channel_may_be_seconds_late() {
    let c = Command::new(13);
    let closed = verdict(&log(
        &c,
        [&|t| c.speed(t), &|t| thrust(c.speed(t - 4.3)), &|t| torque(c.speed(t)), &|t| current(c.speed(t))],
        NOISE,
    ));
    assert_eq!(names(&closed), ["channel_delay"], "{:?}", closed.verdict.alternatives);
    close_to(&closed, "delay", 4.3, STEP);
}

#[test]
fn a_clock_may_drift_by_less_than_a_row() {
    let c = Command::new(14);
    // a second-order ramp between levels, so that every instant counts
    let smooth = lagged(&|t| c.speed(t), 0.5);
    let at = |t: f64| {
        let x = (t / STEP).clamp(0.0, (ROWS - 2) as f64);
        let i = x as usize;
        smooth[i] + (x - i as f64) * (smooth[i + 1] - smooth[i])
    };
    let rate = 0.1 * STEP / (ROWS as f64 * STEP);
    let late = |t: f64| t - rate * t;
    let quiet = [0.3, 0.0005, 0.00001, 0.02];
    let closed = verdict(&log(&c, [&at, &|t| thrust(at(late(t))), &|t| torque(at(late(t))), &|t| current(at(t))], quiet));
    assert!(names(&closed).contains(&"clock_drift"), "{:?}", names(&closed));
    let e = closed.verdict.effects.iter().find(|e| e.id == "clock_drift").expect("named");
    assert!((e.parameters[0].value / rate - 1.0).abs() < 0.1, "{:?} for {rate}", e.parameters[0]);
}

#[test]
fn a_coarse_reading_is_neither_glitch_nor_resonance() {
    let c = Command::ramp();
    let mut log = log(
        &c,
        [&|t| c.speed(t), &|t| thrust(c.speed(t)), &|t| torque(c.speed(t)), &|t| current(c.speed(t))],
        [3.0, 0.06, 0.0003, 0.02],
    );
    let step = 0.9;
    log.columns[2].values.iter_mut().for_each(|v| *v = (*v / step).round() * step);
    let closed = verdict(&log);
    assert_eq!(names(&closed), ["quantisation"], "{:?}", closed.verdict.alternatives);
    close_to(&closed, "step", step, 1e-6);
}

#[test]
fn what_nothing_explains_comes_with_what_is_nearest() {
    let c = Command::new(16);
    // a wave of the zero that no effect of the library makes, and a drift in it
    let drifting = |rate: f64| {
        let wave = |t: f64| 0.15 * (std::f64::consts::TAU * t / 6.0).sin() + rate * t;
        verdict(&log(
            &c,
            [&|t| c.speed(t), &|t| thrust(c.speed(t)) + wave(t), &|t| torque(c.speed(t)), &|t| current(c.speed(t))],
            NOISE,
        ))
    };
    // a drift that is most of it is named, and the wave is told beside it
    let most = drifting(0.003);
    assert_eq!((most.verdict.verdict, names(&most)), (Kind::Attributed, vec!["zero_drift"]));
    close_to(&most, "rate", 0.003, 0.0003);
    assert!(
        most.verdict.unexplained.iter().any(|u| u.channel == "thrust_n" && u.over_floor > 3.0),
        "{:?}",
        most.verdict.unexplained
    );
    let closed = drifting(0.0015);
    assert_eq!(closed.verdict.verdict, Kind::Unattributed, "{:?}", names(&closed));
    let others = &closed.verdict.alternatives;
    assert!(!others.is_empty() && others.iter().all(|a| a.probability < closed.verdict.effects[0].probability), "{others:?}");
    let all: f64 = others.iter().map(|a| a.probability).sum::<f64>() + closed.verdict.effects[0].probability;
    assert!(all < 1.0 + 1e-9, "{all}");
}

/// A cell that averages slowly and is read once a second: the hold is told from its repeats, and the lag from what is held.
#[test]
fn a_hold_and_the_lag_beneath_it_are_two() {
    let c = Command::new(16);
    let tau = 0.5;
    let slow = lagged(&|t| thrust(c.speed(t)), tau);
    let mut chance = Chance::new(17);
    let noise: Vec<f64> = (0..ROWS).map(|_| 0.01 * chance.normal()).collect();
    let held = |t: f64| {
        let row = (((t + 1e-9).floor() / STEP).round() as usize).min(ROWS - 1);
        slow[row] + noise[row]
    };
    let meters: [&dyn Fn(f64) -> f64; 4] = [&|t| c.speed(t), &held, &|t| torque(c.speed(t)), &|t| current(c.speed(t))];
    let closed = verdict(&log(&c, meters, [NOISE[0], 0.0, NOISE[2], NOISE[3]]));
    let mut found = names(&closed);
    found.sort_unstable();
    assert_eq!(found, ["channel_filter", "sample_hold"], "{:?}", closed.verdict.alternatives);
    let filter = closed.verdict.effects.iter().find(|e| e.id == "channel_filter").expect("a filter");
    let p = filter.parameters.iter().find(|p| p.name == "tau").unwrap_or_else(|| panic!("{:?}", filter.parameters));
    assert!((p.value - tau).abs() < 0.05, "{p:?}");
}

/// Two speed sensors that average over the same while: no clock drifts, and neither is late alone.
#[test]
fn speeds_that_are_late_together_are_no_clock_that_drifts() {
    let c = Command::new(18);
    let late = 0.4;
    let mut log =
        log(&c, [&|t| c.speed(t - late), &|t| thrust(c.speed(t)), &|t| torque(c.speed(t)), &|t| current(c.speed(t))], NOISE);
    let mut chance = Chance::new(19);
    let second = log.t.iter().map(|t| 1.001 * c.speed(t - late) + NOISE[0] * chance.normal()).collect();
    log.columns.iter_mut().find(|c| c.name == "rpm").expect("a speed").name = "rpm_hall".to_owned();
    log.columns.insert(2, Column { name: "rpm_encoder".to_owned(), values: second });
    let closed = verdict(&log);
    assert_eq!(names(&closed), ["channel_delay"], "{:?}", closed.verdict.alternatives);
    assert!(["rpm_hall", "rpm_encoder", "thrust_n"].iter().all(|c| closed.verdict.effects[0].channels.iter().any(|on| on == c)));
    close_to(&closed, "delay", late, 0.03);
}

#[test]
fn the_interval_of_held_values_is_known_to_the_clock_of_their_updates_although_rows_are_missing() {
    let c = Command::new(14);
    let period = 0.0813;
    let mut log = log(&c, [&|t| c.speed(t), &|t| thrust(c.speed(t)), &|t| torque(c.speed(t)), &|t| current(c.speed(t))], NOISE);
    let mut chance = Chance::new(15);
    let readings = &mut log.columns.iter_mut().find(|c| c.name == "current_a").expect("a current").values;
    let (mut due, mut held) = (0.0, 0.0);
    for (i, reading) in readings.iter_mut().enumerate() {
        let t = STEP * i as f64;
        if t >= due {
            held = *reading;
            due = ((t / period).floor() + 1.0) * period;
        }
        *reading = if chance.uniform() < 0.06 { f64::NAN } else { held };
    }
    let closed = verdict(&log);
    assert_eq!(names(&closed), ["sample_hold"], "{:?}", closed.verdict.alternatives);
    close_to(&closed, "period", period, 3e-5);
}

#[test]
fn a_level_that_the_rest_does_not_surround_is_no_judge_of_a_damaged_blade() {
    let c = Command::visits(&[1600.0, 1300.0, 1900.0, 1450.0, 1750.0, 1350.0, 1550.0, 1850.0]);
    // after it two levels only, both in the last fifth of the run
    let t0 = 114.0;
    let after = |t: f64| if t > t0 { 1.0 } else { 0.0 };
    let speed = |t: f64| c.speed(t) * (1.0 - 0.02 * after(t));
    let log = log(
        &c,
        [&speed, &|t| thrust(speed(t)) * (1.0 - 0.04 * after(t)), &|t| torque(speed(t)) * (1.0 + 0.06 * after(t)), &|t| {
            current(speed(t)) * (1.0 + 0.06 * after(t))
        }],
        NOISE,
    );
    let context = Context::new(&log, None);
    let declared = Declared::default();
    let damage = library().iter().find(|e| e.id() == "blade_damage").expect("in the library");
    let instance = damage.instances(&context).remove(0);
    let placed = [Placed { effect: *damage, instance, shape: vec![t0] }];
    let fitted = fit(&context, declared, &placed, None, Rows::All).expect("a fit");
    let folds = heldout::folds(&context);
    let nothing = fit(&context, declared, &[], None, Rows::All).expect("a fit");
    let before = heldout::errors(&context, declared, &nothing, &folds);
    let around = heldout::errors_around_newest(&context, declared, &fitted, &folds, &before);
    let speed = context.target("rpm").expect("a speed");
    let (all, known) =
        (around.with[speed].rms / around.without[speed].rms, around.known_with[speed].rms / around.known_without[speed].rms);
    assert!(all > 1.05, "{all}");
    assert!(known < 1.05, "{known}");
}
/// What changed since a model was made, on another day of the same rig: zero, gain and friction of the whole run.
#[test]
fn what_was_there_before_the_run_shows_against_a_model_of_another_day() {
    let (first, second) = (Command::new(21), Command::new(22));
    let healthy = |c: &Command| {
        log(c, [&|t| c.speed(t), &|t| thrust(c.speed(t)), &|t| torque(c.speed(t)), &|t| current(c.speed(t))], NOISE)
    };
    let model = verdict(&healthy(&first)).model;
    let against = |log: Log| close(&log, Some(&model), &[], &mut |_| {}).expect("a verdict");
    let same = against(healthy(&second));
    assert_eq!(names(&same), [""; 0], "{:?}", same.verdict.effects);
    let with = |column: usize, change: &dyn Fn(f64) -> f64| {
        let mut log = healthy(&second);
        // the room is as warm as on any day, and hardly changes
        let warmth = log.t.iter().map(|t| 24.5 + 0.3 * (t / 40.0).sin()).collect();
        log.columns[column].values.iter_mut().for_each(|v| *v = change(*v));
        log.columns.push(Column { name: "temp_c".into(), values: warmth });
        against(log)
    };
    let tare = with(2, &|v| v + 0.02);
    assert_eq!(names(&tare), ["tare_shift"], "{:?}", tare.verdict.effects);
    close_to(&tare, "offset", 0.02, 0.002);
    let gain = with(2, &|v| 1.03 * v);
    assert_eq!(names(&gain), ["gain_change"], "{:?}", gain.verdict.effects);
    close_to(&gain, "gain_change", 0.03, 0.002);
    assert!(gain.verdict.effects[0].parameters.iter().any(|p| p.name == "t0" && p.value <= 0.0));
    // the model that names it loads, and predicts the day on which it was found
    let text = gain.model.to_toml();
    let again = ident::model::Model::parse("model.toml", &text).expect("a model");
    let known = close(&with_gain(&healthy(&second)), Some(&again), &[], &mut |_| {}).expect("a verdict");
    assert_eq!(names(&known), [""; 0], "{:?}", known.verdict.effects);
    let drag = 0.004;
    let rubs = log(
        &second,
        [&|t| second.speed(t) * 0.99, &|t| thrust(second.speed(t) * 0.99), &|t| torque(second.speed(t) * 0.99), &|t| {
            current(second.speed(t) * 0.99) + drag * second.speed(t) * std::f64::consts::TAU / 60.0 / 12.0
        }],
        NOISE,
    );
    let friction = against(rubs);
    assert_eq!(names(&friction)[0], "bearing_friction", "{:?}", friction.verdict.effects);
}

fn with_gain(log: &Log) -> Log {
    let mut log = log.clone();
    log.columns[2].values.iter_mut().for_each(|v| *v *= 1.03);
    log
}

#[test]
fn a_cell_may_lose_a_third_of_the_thrust_and_two_names_are_claimed_less_surely() {
    let c = Command::new(31);
    let lost = |t: f64| thrust(c.speed(t)) * if t < 80.0 { 1.0 } else { 0.65 };
    let one = verdict(&log(&c, [&|t| c.speed(t), &lost, &|t| torque(c.speed(t)), &|t| current(c.speed(t))], NOISE));
    assert_eq!(names(&one), ["gain_change"]);
    close_to(&one, "gain_change", -0.35, 0.005);
    assert!(one.verdict.effects[0].probability > 0.9);
    // each of two names may be wrong
    let slow = lagged(&|t| current(c.speed(t)), 0.4);
    let meter = |t: f64| slow[(t / STEP).round() as usize];
    let two = verdict(&log(&c, [&|t| c.speed(t), &lost, &|t| torque(c.speed(t)), &meter], NOISE));
    assert_eq!(names(&two).len(), 2, "{:?}", names(&two));
    let claimed: Vec<f64> = two.verdict.effects.iter().map(|e| e.probability).collect();
    assert!(claimed.iter().all(|p| (0.75..=0.93).contains(p)), "{claimed:?}");
    let both = claimed.iter().product::<f64>();
    assert!((0.6..=0.851).contains(&both), "{both}");
}

#[test]
fn wrong_readings_come_after_the_meter() {
    let command = Command::new(12);
    let speed = |t: f64| command.speed(t);
    // an ammeter that takes the mean of a second, and five readings of its line that are absurd
    let mean = |t: f64| (0..40).map(|k| current(command.speed(t - 0.025 * f64::from(k)))).sum::<f64>() / 40.0;
    let absurd = |t: f64| [401, 902, 1403, 2004, 2505].contains(&((t / STEP).round() as usize));
    let read = |t: f64| if absurd(t) { 60.0 } else { mean(t) };
    let run =
        log(&command, [&speed, &|t| thrust(command.speed(t)), &|t| torque(command.speed(t)), &read], [1.0, 0.01, 0.0003, 0.02]);
    let closed = close(&run, None, &[], &mut |_| {}).expect("a log");
    let mut named: Vec<&str> = closed.verdict.effects.iter().map(|e| e.id.as_str()).collect();
    named.sort_unstable();
    assert_eq!(named, ["channel_filter", "glitch_rows"]);
}
