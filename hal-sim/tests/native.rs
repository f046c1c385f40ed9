//! The firmware on the simulated bench: arms, sweeps, logs, agrees with the truth, and repeats itself to the byte.

use frame::rig::{AdcVerdict, CaptureVerdict, RigState};
use frame::{Event, units::Ticks};
use hal_sim::scenario::{Schedule, Step};
use hal_sim::{PlantState, Powerplant, RunRecord, Scenario, run};

fn fly(scenario: &Scenario) -> RunRecord {
    run(scenario, None, &mut |_| ()).unwrap_or_else(|e| panic!("{e}"))
}

fn short() -> Scenario {
    Scenario { schedule: Schedule::UpDown { step_us: 250.0, hold_s: 3.0, top_us: 2000.0 }, ..Scenario::default() }
}

#[test]
fn it_arms_sweeps_and_logs_without_a_fault() {
    let s = short();
    let record = fly(&s);
    assert_eq!(record.link.damaged + record.link.missing + record.link.foreign, 0);
    assert!(record.samples.iter().all(|r| r.faults.is_empty()));
    let states: Vec<RigState> =
        record.events.iter().filter_map(|e| if let Event::State { to, .. } = e { Some(*to) } else { None }).collect();
    use RigState::{ArmCells, ArmHoldMin, ArmReady, Armed, Running};
    assert_eq!(states, [ArmHoldMin, ArmCells, ArmReady, Armed, Running, Armed]);
    let wanted = s.run_s() * f64::from(s.log.rate_hz);
    assert!((record.samples.len() as f64 - wanted).abs() <= 2.0, "{} for {wanted}", record.samples.len());
    assert_eq!(record.samples.len(), record.truth.len());
    assert!(record.samples.windows(2).all(|w| w[1].at.since(w[0].at) == Ticks::from_ms(100)));
    // motor off before and after, full throttle in between
    let pulses: Vec<f64> = record.samples.iter().map(|r| r.pulse.as_us()).collect();
    assert_eq!((pulses[0], pulses[pulses.len() - 1]), (1000.0, 1000.0));
    assert_eq!(pulses.iter().copied().fold(0.0, f64::max), 2000.0);
}

/// A sample well inside a plateau whose rotor turns.
fn steady(record: &RunRecord, i: usize) -> bool {
    i >= 15 && record.samples[i].pulse.0 > 1_060_000 && (i - 15..=i).all(|j| record.samples[j].pulse == record.samples[i].pulse)
}

#[test]
fn what_is_measured_is_what_is_there() {
    let record =
        fly(&Scenario { schedule: Schedule::UpDown { step_us: 250.0, hold_s: 6.0, top_us: 2000.0 }, ..Scenario::default() });
    let rows: Vec<_> = record.converted().collect();
    let mut levels: std::collections::BTreeMap<u32, Vec<usize>> = std::collections::BTreeMap::new();
    for i in (0..rows.len()).filter(|&i| steady(&record, i)) {
        levels.entry(record.samples[i].pulse.0).or_default().push(i);
    }
    assert_eq!(levels.len(), 4);
    for (pulse, at) in levels {
        let mean = |f: &dyn Fn(usize) -> f64| at.iter().map(|&i| f(i)).sum::<f64>() / at.len() as f64;
        let rpm = mean(&|i| record.truth[i].plant.rpm);
        for channel in 0..4 {
            let got = mean(&|i| rows[i].rpm[channel].unwrap());
            assert!((got / rpm - 1.0).abs() < 5e-4, "channel {channel} at {pulse}: {got} for {rpm}");
            assert!(at.iter().all(|&i| record.samples[i].rpm[channel].verdict == CaptureVerdict::Nominal));
        }
        let truth = |i: usize| record.truth[i].plant;
        let want = [
            (mean(&|i| truth(i).thrust_n), 0.025), // the tare is one mean of 0.1 s
            (mean(&|i| truth(i).torque_nm), 0.001),
            (mean(&|i| truth(i).current_a), 0.03),
            (mean(&|i| truth(i).voltage_v), 0.01),
            (mean(&|i| truth(i).temp_c), 0.1),
        ];
        for (channel, (value, tolerance)) in want.into_iter().enumerate() {
            let got = mean(&|i| rows[i].adc[channel].unwrap());
            assert!((got - value).abs() < tolerance, "channel {channel} at {pulse}: {got} for {value}");
            assert!(at.iter().all(|&i| record.samples[i].adc[channel].verdict == AdcVerdict::Nominal));
        }
    }
}

#[test]
fn noise_at_ten_hertz_is_that_of_the_scenario() {
    let record = fly(&Scenario {
        schedule: Schedule::Steps { steps: vec![Step { pulse_us: 1600.0, hold_s: 60.0, ramp: false }] },
        ..Scenario::default()
    });
    let rows: Vec<_> = record.converted().collect();
    let at: Vec<usize> = (0..rows.len()).filter(|&i| steady(&record, i)).collect();
    assert!(at.len() > 500);
    for (channel, (low, high)) in
        [(0.005, 0.012), (2e-4, 6e-4), (0.025, 0.05), (0.007, 0.013), (0.07, 0.13)].into_iter().enumerate()
    {
        let v: Vec<f64> = at.iter().map(|&i| rows[i].adc[channel].unwrap()).collect();
        let m = v.iter().sum::<f64>() / v.len() as f64;
        let sd = (v.iter().map(|x| (x - m) * (x - m)).sum::<f64>() / v.len() as f64).sqrt();
        assert!(sd > low && sd < high, "channel {channel}: {sd}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_does_not() {
    let a = fly(&short());
    assert_eq!(a, fly(&short()));
    assert_ne!(a.telemetry, fly(&Scenario { seed: 2, ..short() }).telemetry);
}

#[test]
fn an_uploaded_schedule_with_a_ramp_is_followed() {
    let step = |pulse_us, hold_s, ramp| Step { pulse_us, hold_s, ramp };
    let steps = vec![step(1300.0, 2.0, false), step(1700.0, 4.0, true), step(1700.0, 2.0, false)];
    let record = fly(&Scenario { schedule: Schedule::Steps { steps }, ..Scenario::default() });
    let pulses: Vec<f64> = record.samples.iter().map(|s| s.pulse.as_us()).collect();
    let between = pulses.iter().filter(|p| **p > 1310.0 && **p < 1690.0).count();
    assert!((35..=40).contains(&between), "{between}");
    assert!((record.samples.len() as f64 - 120.0).abs() <= 2.0);
}

#[test]
fn fewer_sensors_and_another_rate() {
    let text = "schedule = { kind = \"staircase\", step_us = 500, hold_s = 2, top_us = 2000 }\n\
                [log]\nrate_hz = 50\n[sensors]\nfitted = [\"opto\", \"encoder\"]\n";
    let record = fly(&Scenario::parse(text, std::path::Path::new("x.toml")).unwrap());
    assert!((record.samples.len() as f64 - 500.0).abs() <= 4.0);
    let last = record.converted().max_by(|a, b| a.pulse_us.total_cmp(&b.pulse_us).then(a.t_s.total_cmp(&b.t_s))).unwrap();
    assert_eq!(last.rpm.map(|r| r.is_some()), [false, true, false, true]);
    assert!(last.rpm[1].unwrap() > 5500.0);
}

/// An identified model stands in for the powerplant: a static curve of the pulse.
struct Model;

impl Powerplant for Model {
    fn advance(&mut self, _dt_s: f64, pulse_us: f64) -> PlantState {
        let rpm = if pulse_us > 1060.0 { 5.0 * (pulse_us - 1000.0) } else { 0.0 };
        PlantState { rpm, thrust_n: 1.0e-7 * rpm * rpm, torque_nm: 1.0e-5 * rpm, current_a: 1.0, voltage_v: 11.0, temp_c: 20.0 }
    }
}

#[test]
fn a_model_takes_the_place_of_the_powerplant() {
    let record = run(&short(), Some(Box::new(Model)), &mut |_| ()).unwrap_or_else(|e| panic!("{e}"));
    let rows: Vec<_> = record.converted().collect();
    let i = (0..rows.len()).rfind(|&i| rows[i].pulse_us == 1750.0 && steady(&record, i)).unwrap();
    let row = &rows[i];
    assert!((row.rpm[0].unwrap() - 3750.0).abs() < 4.0, "{:?}", row.rpm);
    assert!((row.adc[0].unwrap() - 1.406).abs() < 0.05 && (row.adc[3].unwrap() - 11.0).abs() < 0.05, "{:?}", row.adc);
}

#[test]
fn progress_grows_to_one() {
    let mut heard = Vec::new();
    run(&short(), None, &mut |share| heard.push(share)).unwrap_or_else(|e| panic!("{e}"));
    assert!(heard.len() > 10 && heard.windows(2).all(|w| w[0] <= w[1]));
    assert_eq!(heard.last(), Some(&1.0));
}

/// The reference page is true: its examples read, and it names every effect and every key.
#[test]
fn the_reference_page_covers_the_catalogue() {
    let page = include_str!("../../docs/scenario.md");
    let mut examples = page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next());
    let file = std::path::Path::new("scenario.md");
    let scenario = Scenario::parse(examples.next().expect("an example of a run"), file).unwrap();
    assert_eq!(scenario.effects.len(), 1);
    assert_eq!(Scenario::parse(examples.next().expect("an example of a fault"), file).unwrap().faults.len(), 1);
    for entry in hal_sim::effect::catalogue() {
        assert!(page.contains(&format!("| `{}`", entry.id)), "{} is not on the page", entry.id);
    }
    // every key with a default of its own, as the file would write it
    let written = toml::Table::try_from(Scenario::default()).unwrap();
    let mut keys = Vec::new();
    for (name, value) in &written {
        match (name.as_str(), value) {
            ("effect" | "fault" | "supply" | "schedule", _) => keys.push(name.clone()),
            (_, toml::Value::Table(section)) => keys.extend(section.keys().map(|key| format!("{name}.{key}"))),
            _ => keys.push(name.clone()),
        }
    }
    assert!(keys.len() > 20, "{keys:?}");
    for key in keys {
        let short = key.split_once('.').map_or(key.as_str(), |(_, own)| own);
        let told = [format!("`{key}`"), format!("`.{short}`"), format!("[[{key}]]")];
        assert!(told.iter().any(|t| page.contains(t.as_str())), "{key} is not on the page");
    }
}

/// The same of the IMU board's part of the page.
#[test]
fn the_reference_page_covers_the_imu_board() {
    let page = include_str!("../../docs/scenario.md");
    let (_, part) = page.split_once("## The IMU board").expect("a part of its own");
    let example = part.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("an example");
    let folder = std::env::temp_dir().join(format!("scenario-page-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("imu.toml");
    std::fs::write(&file, example).unwrap();
    let read = hal_sim::scenario::AnyScenario::load(&file);
    std::fs::remove_dir_all(&folder).unwrap();
    let hal_sim::scenario::AnyScenario::Imu(scenario) = read.unwrap() else { panic!("not a run of the IMU board") };
    let mut scenario = *scenario;
    let chip = hal_sim::scenario::ChipSection {
        matrix: Some([[1.0; 3]; 3]),
        bias: Some([0.0; 3]),
        bias_per_k: Some([0.0; 3]),
        noise: Some(0.0),
    };
    (scenario.imu.gyro, scenario.imu.accelerometer, scenario.imu.magnetometer) = (chip, chip, chip);
    (scenario.imu.start_c, scenario.imu.end_c) = (Some(20.0), Some(30.0));
    let mut keys = Vec::new();
    for (name, value) in toml::Table::try_from(&scenario.imu).unwrap() {
        match value {
            toml::Value::Table(section) => keys.extend(section.keys().map(|key| (format!("imu.{name}.{key}"), key.clone()))),
            _ => keys.push((format!("imu.{name}"), name)),
        }
    }
    assert!(keys.len() >= 25, "{keys:?}");
    for (key, own) in keys {
        let told = [format!("`{key}`"), format!("`.{own}`")];
        assert!(told.iter().any(|t| part.contains(t.as_str())), "{key} is not on the page");
    }
}
