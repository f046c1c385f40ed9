//! What a run has beyond a healthy day of the same rig: the model of that day is declared, and what it leaves over of its own run is no news.
//!
//! What it is: a rig from the power balance of its motor, whose curves are no polynomials and whose rotor lags; a healthy day, another one
//! with other noise and other zeros, and days with another supply, colder air and a coarse command.
//! What can go wrong: nothing; a seed gives one day.
//! Units: s, us, rev/min, N, N.m, A, V, degC.
//! Reference: Beharie 2013, Eq. 5.11 as corrected (motor), 2.17 (density); specification `closing-the-loop.md`, step 1.

mod rig;

use ident::channel::Context;
use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::model::Model;
use ident::model::leftover::Leftover;
use ident::verdict::Kind;
use rig::{Chance, K_THRUST, K_TORQUE, KV, NO_LOAD, RESISTANCE, STEP};

/// One day of the rig.
struct Day<'d> {
    seed: u64,
    /// Zeros of thrust, N, and torque, N.m.
    tare: (f64, f64),
    /// Volts of the supply at a current, A, after a charge, Ah.
    supply: &'d dyn Fn(f64, f64) -> f64,
    /// Temperature of the room at an instant, degC.
    room: &'d dyn Fn(f64) -> f64,
    /// What the controller makes of a pulse, us.
    acts_on: &'d dyn Fn(f64) -> f64,
}

const HEALTHY: Day<'static> = Day { seed: 1, tare: (0.0, 0.0), supply: &|_, _| 11.5, room: &|_| 15.0, acts_on: &wavy };

/// A controller whose answer to the pulse is no cubic, us.
fn wavy(pulse: f64) -> f64 {
    pulse + 3.0 * (pulse / 60.0).sin()
}

/// Time constant of the rotor, s.
const TAU: f64 = 0.2;
/// The controller's own draw, W.
const OWN_DRAW: f64 = 0.35;

/// Settled speed, rad/s: duty V = Kt w + R (Q/Kt + I0), Q = kQ density w^2.
fn settled(pulse: f64, volts: f64, density: f64) -> f64 {
    let kt = 60.0 / (std::f64::consts::TAU * KV);
    let a = RESISTANCE * K_TORQUE * density / kt;
    let c = RESISTANCE * NO_LOAD - (pulse - 1000.0) / 1000.0 * volts;
    if pulse < 1040.0 { 0.0 } else { (-kt + (kt * kt - 4.0 * a * c).sqrt()) / (2.0 * a) }
}

/// Supply current from the power balance.
fn drawn(w: f64, volts: f64, density: f64) -> f64 {
    let kt = 60.0 / (std::f64::consts::TAU * KV);
    let load = if w > 0.1 { K_TORQUE * density * w * w + kt * NO_LOAD } else { 0.0 };
    (w * load + RESISTANCE / (kt * kt) * load * load + OWN_DRAW) / volts
}

/// The log of a day: up and down a staircase, 40 rows a level.
fn log(day: &Day<'_>) -> Log {
    let chance = &mut Chance::new(day.seed);
    let levels = (0..21).chain((0..20).rev()).map(|k| 1000.0 + 50.0 * f64::from(k));
    let pulse: Vec<f64> = levels.flat_map(|p| std::iter::repeat_n(p, 40)).collect();
    let mut columns: Vec<Column> = ["pulse_us", "rpm", "thrust_n", "torque_nm", "current_a", "voltage_v", "temp_c"]
        .map(|name| Column { name: name.to_owned(), values: Vec::new() })
        .into();
    let (mut w, mut charge, mut amps) = (0.0, 0.0, 0.0);
    for (i, p) in pulse.iter().enumerate() {
        let t = STEP * i as f64;
        let density = 288.15 / ((day.room)(t) + 273.15);
        let mut volts = (day.supply)(amps, charge);
        for _ in 0..5 {
            volts = (day.supply)(drawn(w, volts, density), charge);
        }
        w += (settled((day.acts_on)(*p), volts, density) - w) * (1.0 - (-STEP / TAU).exp());
        amps = drawn(w, volts, density);
        charge += amps * STEP / 3600.0;
        let square = density * w * w;
        let truth = [
            *p,
            w * 60.0 / std::f64::consts::TAU,
            K_THRUST * square + day.tare.0,
            K_TORQUE * square + day.tare.1,
            amps,
            volts,
            (day.room)(t),
        ];
        let noise = [0.0, if w > 1.0 { 1.0 } else { 0.0 }, 0.007, 3e-4, 0.03, 0.01, 0.1];
        for ((column, truth), noise) in columns.iter_mut().zip(truth).zip(noise) {
            column.values.push(truth + noise * chance.normal());
        }
    }
    let t = (0..pulse.len()).map(|i| STEP * i as f64).collect();
    Log { name: "day.csv".to_owned(), t, columns, ..Log::default() }
}

/// The model of the healthy day, written and read back.
fn model() -> Model {
    let own = close(&log(&HEALTHY), None, &[], &mut |_| {}).expect("a healthy day");
    let read = Model::parse("model.toml", &own.model.to_toml()).expect("what was written");
    let mut written = own.model.leftovers.clone();
    written.sort_by(|a, b| a.0.cmp(&b.0));
    assert_eq!(read.leftovers.len(), written.len());
    // to the digits that are written
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-5 * a.abs().max(b.abs());
    for ((channel, left), (name, own)) in read.leftovers.iter().zip(&written) {
        let curves = left.curve.iter().zip(&own.curve).all(|(a, b)| same(a.0, b.0) && same(a.1, b.1));
        let scatters = left.scatter.iter().flatten().zip(own.scatter.iter().flatten()).all(|(a, b)| same(*a, *b));
        assert!(channel == name && left.curve.len() == own.curve.len() && curves && scatters, "{channel}: {left:?} {own:?}");
    }
    read
}

fn against(model: &Model, day: &Day<'_>) -> Closed {
    close(&log(day), Some(model), &[], &mut |_| {}).expect("a day")
}

fn names(closed: &Closed) -> Vec<&str> {
    closed.verdict.effects.iter().map(|e| e.id.as_str()).collect()
}

/// The first name that is no zero.
fn first(closed: &Closed) -> &str {
    names(closed).into_iter().find(|id| *id != "tare_shift").unwrap_or("")
}

#[test]
fn the_next_healthy_day_has_new_zeros_and_no_more() {
    let model = model();
    for seed in [2, 3] {
        let same = against(&model, &Day { seed, ..HEALTHY });
        assert_eq!(names(&same), [""; 0], "{:?}", same.verdict.effects);
        let tared = against(&model, &Day { seed, tare: (0.03, -0.0005), ..HEALTHY });
        assert_eq!(names(&tared), ["tare_shift"; 2], "{:?}", tared.verdict.effects);
        for (channel, offset) in [("thrust_n", 0.03), ("torque_nm", -0.0005)] {
            let entry = tared.verdict.effects.iter().find(|e| e.channels == [channel]).expect("both zeros");
            let found = &entry.parameters[0];
            assert!((found.value / offset - 1.0).abs() < 0.1, "{channel}: {found:?}");
        }
    }
    // what the model is off by on its own day is news where nobody wrote it down
    let forgetful = Model { leftovers: Vec::new(), ..model };
    let same = against(&forgetful, &Day { seed: 2, ..HEALTHY });
    assert_ne!(names(&same), [""; 0]);
}

#[test]
fn the_curve_is_what_a_cubic_misses_of_the_motor() {
    let model = model();
    let log = log(&HEALTHY);
    let context = Context::new(&log, Some(model.start_pulse_us));
    let predicted = model.predict(&context, "rpm").expect("a speed");
    let (_, left) = model.leftovers.iter().find(|(channel, _)| channel == "rpm").expect("a speed");
    // the end of each level above the one where the motor starts
    let missed: Vec<(f64, f64)> = (2..40)
        .map(|level| {
            let row = 40 * level + 38;
            let pulse = log.columns[0].values[row];
            let truth = settled(wavy(pulse), 11.5, 1.0) * 60.0 / std::f64::consts::TAU;
            (truth - predicted[row], left.known((pulse - 1000.0) / 1000.0))
        })
        .collect();
    let rms = |errors: &mut dyn Iterator<Item = f64>| (errors.map(|e| e * e).sum::<f64>() / missed.len() as f64).sqrt();
    let (without, with) = (rms(&mut missed.iter().map(|m| m.0)), rms(&mut missed.iter().map(|m| m.0 - m.1)));
    assert!(without > 5.0 && with < 0.1 * without, "{without} {with}");
    // and the rotor is still on its way in the first quarter of a second
    let noise = context.targets[context.target("rpm").expect("a speed")].noise.rms;
    let beyond_noise = |class: usize| (left.scatter[1][class].powi(2) - noise * noise).max(0.0).sqrt();
    assert!(beyond_noise(0) > 5.0 * beyond_noise(4), "{:?} {noise}", left.scatter);
}

#[test]
fn another_supply_colder_air_and_a_coarse_command_are_told() {
    let model = model();
    let tare = (0.03, -0.0005);
    let day = Day { seed: 4, tare, ..HEALTHY };
    let sag = against(&model, &Day { supply: &|amps, _| 11.5 - 0.05 * amps, ..day });
    assert_eq!(first(&sag), "supply_sag", "{:?}", sag.verdict.effects);
    let battery = against(&model, &Day { supply: &|amps, charge| 12.4 - 8.0 * charge - 0.02 * amps, ..day });
    assert_eq!(first(&battery), "battery_discharge", "{:?}", battery.verdict.effects);
    let cold = against(&model, &Day { room: &|t| 15.0 - 0.08 * t, ..day });
    assert_eq!(first(&cold), "air_density", "{:?}", cold.verdict.effects);
    // the written model predicts what the verdict says, whatever day its reader knows
    let day_log = log(&Day { room: &|t| 15.0 - 0.08 * t, ..day });
    let written = Model::parse("model.toml", &cold.model.to_toml()).expect("what was written");
    let context = Context::new(&day_log, Some(written.start_pulse_us));
    let predicted = written.predict(&context, "thrust_n").expect("a thrust");
    let measured = &day_log.columns[2].values;
    let rms = (measured.iter().zip(&predicted).map(|(y, p)| (y - p).powi(2)).sum::<f64>() / predicted.len() as f64).sqrt();
    let said = cold.verdict.channels["thrust_n"].after.rms;
    assert!((rms / said - 1.0).abs() < 0.02, "{rms} {said}");
    let coarse = against(&model, &Day { acts_on: &|p| wavy(1000.0 + 23.0 * ((p - 1000.0) / 23.0 + 1e-9).floor()), ..day });
    assert_eq!(first(&coarse), "throttle_quantisation", "{:?}", coarse.verdict.effects);
}

/// A sag that explains all that is new of voltage and speed, and a torque that nothing in the library explains.
#[test]
fn a_name_stands_beside_news_on_another_channel_and_the_news_are_told() {
    let model = model();
    let sagging = Day { seed: 5, supply: &|amps, _| 11.5 - 0.05 * amps, ..HEALTHY };
    let mut log = log(&sagging);
    let rpm = log.columns[1].values.clone();
    let torque = &mut log.columns[3];
    torque.values.iter_mut().zip(&rpm).for_each(|(q, r)| *q *= 1.0 + 0.08 * (r / 150.0).sin());
    let closed = close(&log, Some(&model), &[], &mut |_| {}).expect("a day");
    assert_eq!((closed.verdict.verdict, first(&closed)), (Kind::Attributed, "supply_sag"), "{:?}", names(&closed));
    let told = |closed: &Closed| closed.verdict.unexplained.iter().any(|u| u.channel == "torque_nm" && u.over_floor > 3.0);
    assert!(told(&closed), "{:?}", closed.verdict.unexplained);
    let alone = against(&model, &sagging);
    assert_eq!(alone.verdict.verdict, Kind::Attributed);
    assert!(!told(&alone), "{:?}", alone.verdict.unexplained);
}

#[test]
fn what_is_left_over_is_read_as_strictly_as_the_rest() {
    let text = model().to_toml();
    let line = |key: &str| text.lines().find(|l| l.starts_with(key)).expect("a key of every channel").to_owned();
    let (scatter, at, error) = (line("left_scatter_n "), line("left_at_krpm "), line("left_n "));
    let refused = |from: &str, to: &str, said: &str| {
        let message = Model::parse("m.toml", &text.replacen(from, to, 1)).expect_err(to).to_string();
        assert!(message.contains(said) && message.contains("expected"), "{message}");
    };
    let part = "[0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]";
    refused(&scatter, "left_scatter_n = [0.1, 0.2]", "left_scatter_n");
    refused(&scatter, &format!("left_scatter_n = [{part}, {part}]"), "left_scatter_n");
    refused(&scatter, &format!("left_scatter_n = [{part}, {part}, {}]", part.replace("0.1]", "-0.1]")), "left_scatter_n");
    refused(&scatter, "", "left_scatter_n");
    refused(&at, "left_at_krpm = [1.0, 0.5]", "left_at_krpm");
    refused(&error, "left_n = [0.0]", "left_n");
    refused(&error, "left_over = 3", "left_over");
    refused("air_density_ratio = ", "air_density_ratio = -", "air_density_ratio");
    assert_eq!(Leftover::default().known(1.0), 0.0);
}
