//! Each effect changes what it should and leaves the rest alone.
//!
//! The same seed draws the same noise with and without an effect, so what an effect does not touch is equal to the last count.

use hal_sim::effect::{catalogue, find};
use hal_sim::scenario::Schedule;
use hal_sim::{RunRecord, Scenario, run};

/// A short sweep of the demonstration rig with an effect drawn for its length.
fn sweep(seed: u64, effect: Option<&str>) -> Scenario {
    let schedule = Schedule::UpDown { step_us: 200.0, hold_s: 4.0, top_us: 2000.0 };
    let mut scenario = Scenario { seed, schedule, ..Scenario::default() };
    if let Some(id) = effect {
        scenario.effects.push(find(id).unwrap().draw(seed, scenario.run_s()).into());
    }
    scenario
}

/// Drag, thrust and torque per square of speed, taken from the truth where the rotor has settled.
fn coefficients(record: &RunRecord) -> Vec<(f64, f64, f64)> {
    let t = &record.truth;
    (20..t.len())
        .filter(|&i| {
            record.samples[i].pulse.0 > 1_150_000 && (i - 20..i).all(|j| record.samples[j].pulse == record.samples[i].pulse)
        })
        .map(|i| {
            let p = t[i].plant;
            (p.rpm, p.thrust_n / (p.rpm * p.rpm), p.torque_nm / (p.rpm * p.rpm))
        })
        .collect()
}

fn fly(scenario: &Scenario) -> RunRecord {
    run(scenario, None, &mut |_| ()).unwrap_or_else(|e| panic!("{}: {e}", scenario.name))
}

/// Root mean square of the difference of one ADC channel between two runs, in the channel's unit.
fn apart(a: &RunRecord, b: &RunRecord, channel: usize) -> f64 {
    let gain = f64::from(a.calibration.adc[channel].gain);
    let sum: f64 = a
        .samples
        .iter()
        .zip(&b.samples)
        .map(|(x, y)| {
            let (x, y) = (x.adc[channel], y.adc[channel]);
            let d = gain * (f64::from(x.sum) / f64::from(x.count) - f64::from(y.sum) / f64::from(y.count));
            d * d
        })
        .sum();
    (sum / a.samples.len() as f64).sqrt()
}

fn rpm_apart(a: &RunRecord, b: &RunRecord) -> f64 {
    let n = a.truth.len() as f64;
    (a.truth.iter().zip(&b.truth).map(|(x, y)| (x.plant.rpm - y.plant.rpm) * (x.plant.rpm - y.plant.rpm)).sum::<f64>() / n).sqrt()
}

/// Noise of the demonstration rig: thrust, torque, current, voltage, temperature.
const NOISE: [f64; 5] = [0.007, 3e-4, 0.03, 0.01, 0.1];

/// What must move and, of thrust, torque, current, voltage, temperature, what must stay equal to the last count.
fn expectation(id: &str) -> (&'static [&'static str], [bool; 5]) {
    let load_cell = [false, true, true, true, true];
    match id {
        "supply_sag" | "battery_discharge" | "battery_relaxation" => (&["rpm", "voltage"], [false, false, false, false, true]),
        "spinup_lag" | "throttle_quantisation" => (&["rpm"], [false, false, false, true, true]),
        "thermal_derate" => (&["rpm"], [false, false, false, true, true]),
        "current_limit" => (&["rpm", "current"], [false, false, false, true, true]),
        "bearing_friction" => (&["rpm", "current"], [false, false, false, true, true]),
        "reynolds_thrust" => (&["thrust"], load_cell),
        "air_density" => (&["rpm", "thrust", "torque", "temp"], [false, false, false, true, false]),
        "blade_damage" | "blade_flex" => (&["rpm", "thrust", "torque"], [false, false, false, true, true]),
        "thermal_zero" => (&["thrust", "temp"], [false, true, true, true, false]),
        "stall" => (&["rpm", "thrust", "current"], [false, false, false, true, true]),
        "missed_pulses" | "double_pulses" | "alternating_period" | "blade_twist" | "coupling_slip" | "dead_rotor_speed"
        | "noisy_edges" => (&["reading"], [true; 5]),
        "encoder_drag" => (&["reading", "rpm", "current"], [false, false, false, true, true]),
        "clock_drift" => (&["thrust", "torque"], [false, false, true, true, true]),
        "glitch_rows" => (&[], [false; 5]), // which channel is drawn: see the test of its own
        "recirculation" => (&["thrust", "torque", "rpm"], [false, false, false, true, true]),
        "magnet_heat" | "stator_saturation" | "esc_timing" => (&["rpm", "current"], [false, false, false, true, true]),
        "blade_icing" => (&["rpm", "thrust", "torque"], [false, false, false, true, true]),
        "loosening_mount" => (&["thrust", "torque"], [false, false, true, true, true]),
        "desync" => (&["rpm", "current"], [false, false, false, true, true]),
        "arm_friction" => (&["torque"], [true, false, true, true, true]),
        "zero_drift" | "tare_shift" | "gain_change" | "creep" | "hysteresis" | "beam_resonance" | "torque_crosstalk" => {
            (&["thrust"], load_cell)
        }
        "amplifier_saturation" | "channel_filter" | "channel_delay" | "sample_hold" | "quantisation" => (&["thrust"], load_cell),
        _ => panic!("say what {id} is expected to do"),
    }
}

#[test]
fn each_effect_moves_its_channels_and_no_other() {
    for seed in [1] {
        let clean = fly(&sweep(seed, None));
        for entry in catalogue() {
            let id = entry.id;
            let with = fly(&sweep(seed, Some(id)));
            assert_eq!(with.samples.len(), clean.samples.len(), "{id}");
            let (moved, same) = expectation(id);
            for name in moved {
                let ratio = match *name {
                    "rpm" => rpm_apart(&clean, &with),
                    "reading" => clean.samples.iter().zip(&with.samples).filter(|(a, b)| a.rpm != b.rpm).count() as f64,
                    "thrust" => apart(&clean, &with, 0) / NOISE[0],
                    "torque" => apart(&clean, &with, 1) / NOISE[1],
                    "current" => apart(&clean, &with, 2) / NOISE[2],
                    "voltage" => apart(&clean, &with, 3) / NOISE[3],
                    _ => apart(&clean, &with, 4) / NOISE[4],
                };
                println!("{id} seed {seed}: {name} moves by {ratio:.1} times its noise");
                assert!(ratio > 1.5, "{id} seed {seed}: {name} moves by only {ratio} times its noise");
            }
            for (channel, equal) in same.into_iter().enumerate() {
                if equal {
                    assert!(
                        clean.samples.iter().zip(&with.samples).all(|(a, b)| a.adc[channel] == b.adc[channel]),
                        "{id} {channel}"
                    );
                }
            }
            if !moved.contains(&"rpm") && !moved.contains(&"reading") {
                assert!(clean.samples.iter().zip(&with.samples).all(|(a, b)| a.rpm == b.rpm), "{id}");
            }
        }
    }
}

/// A supply fault leaves thrust(rpm) and torque(rpm) whole.
#[test]
fn supply_effects_leave_thrust_of_speed_whole() {
    let clean = coefficients(&fly(&sweep(3, None)));
    let mean = |v: &[(f64, f64, f64)], f: fn(&(f64, f64, f64)) -> f64| v.iter().map(f).sum::<f64>() / v.len() as f64;
    for id in ["supply_sag", "battery_discharge", "bearing_friction", "spinup_lag"] {
        let with = coefficients(&fly(&sweep(3, Some(id))));
        assert!((mean(&with, |c| c.1) / mean(&clean, |c| c.1) - 1.0).abs() < 1e-9, "{id}");
        if id != "spinup_lag" {
            // The lag is still turning the rotor up or down there, and the arm feels its inertia.
            assert!((mean(&with, |c| c.2) / mean(&clean, |c| c.2) - 1.0).abs() < 5e-3, "{id}");
        }
    }
    let damaged = coefficients(&fly(&sweep(3, Some("blade_damage"))));
    assert!((mean(&damaged, |c| c.1) / mean(&clean, |c| c.1) - 1.0).abs() > 3e-3);
}

/// The mode shows in the rms about the mean, near its own frequency and nowhere else.
#[test]
fn the_resonance_shows_in_the_scatter_at_its_own_speed() {
    let record = fly(&sweep(2, Some("beam_resonance")));
    let rows: Vec<_> = record.converted().collect();
    let rms = |low: f64, high: f64| {
        let v: Vec<f64> = (0..rows.len())
            .filter(|&i| (low..high).contains(&(record.truth[i].plant.rpm / 60.0)))
            .filter_map(|i| rows[i].thrust_rms_n)
            .collect();
        assert!(v.len() > 30, "{low}");
        v.iter().sum::<f64>() / v.len() as f64
    };
    let (near, far) = (rms(39.0, 43.0), rms(70.0, 100.0));
    assert!(near > 4.0 * far, "{near} {far}");
}

/// Bursts spoil single rows of the drawn channel and leave the others alone.
#[test]
fn glitches_are_few_and_far_off() {
    let scenario = sweep(4, Some("glitch_rows"));
    let channel = scenario.effects[0].parameters()[0].1 as usize;
    let (clean, with) = (fly(&sweep(4, None)), fly(&scenario));
    let gain = f64::from(clean.calibration.adc[channel].gain).abs();
    let off: Vec<f64> = clean
        .samples
        .iter()
        .zip(&with.samples)
        .map(|(a, b)| {
            let mean = |c: frame::rig::AdcCode| f64::from(c.sum) / f64::from(c.count);
            (gain * (mean(a.adc[channel]) - mean(b.adc[channel]))).abs()
        })
        .collect();
    let far = off.iter().filter(|d| **d > 20.0 * NOISE[channel]).count();
    let same = off.iter().filter(|d| **d == 0.0).count();
    println!("{far} rows of {} spoilt, {same} equal", off.len());
    assert!((1..off.len() / 20).contains(&far), "{far}");
    assert!(far + same >= off.len() - 2 && clean.samples.iter().zip(&with.samples).all(|(a, b)| a.rpm == b.rpm));
}

/// Any effect can be confined to a window of the run: before it and, where nothing is left behind, after it the rig is healthy.
#[test]
fn every_effect_can_be_scheduled_in_time() {
    let clean = fly(&sweep(6, None));
    let (from, until) = (10.0, 34.0);
    for entry in catalogue() {
        let mut scenario = sweep(6, Some(entry.id));
        scenario.effects[0].from_s = Some(from);
        scenario.effects[0].until_s = Some(until);
        let with = fly(&scenario);
        let equal = |low: f64, high: f64| {
            let inside = |i: &usize| (low..high).contains(&clean.truth[*i].run_s);
            (0..clean.samples.len()).filter(inside).all(|i| clean.samples[i] == with.samples[i])
        };
        assert!(equal(0.0, from), "{}: nothing before the window", entry.id);
        // a burst need not fall into the window
        if entry.id != "glitch_rows" {
            assert!(!equal(from, until + 2.0), "{}: something in the window", entry.id);
        }
        // two seconds before the rotor stops, on the last level of the way down
        let last = clean.truth.iter().rposition(|t| t.plant.rpm > 500.0).unwrap() - 20;
        let (a, b) = (clean.truth[last].plant, with.truth[last].plant);
        assert!(clean.truth[last].run_s > until + 2.0);
        assert!((b.rpm / a.rpm - 1.0).abs() < 0.02, "{}: {} rev/min after the window, {} without it", entry.id, b.rpm, a.rpm);
    }
}

/// What only the simulator knows: at least six, and none of them in the list of the specification.
#[test]
fn some_effects_are_of_our_own_invention() {
    assert!(hal_sim::effect::UNKNOWN.len() >= 6);
    for id in hal_sim::effect::UNKNOWN {
        assert!(find(id).is_some(), "{id}");
    }
}
