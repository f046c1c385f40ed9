//! Every preset of `examples/rig/`, flown against the virtual board: configured from the file, tared, armed, run and recorded.
//!
//! What it is: what an operator does on the first day, by the same commands; the board is as it left the factory before, and the
//! truth of the plant judges what the log says.
//! What can go wrong: these rigs move in real time, all at once; a machine that is stopped for a second makes them latch.

use frame::esc::{BACK_EMF_NAME, ESC_NAMES};
use frame::message::Beep;
use frame::rig::{ADC_NAMES, CAPTURE_NAMES};
use hal_sim::Scenario;
use quadrig_tests::desk::{Desk, Line};
use quadrig_tests::{Said, call, quadrig, root};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Level that is run, us.
const LEVEL: u32 = 1400;

/// A preset, the propeller before it, whether its ESC's profile has cells to type, and the columns that its rig fills.
struct Preset {
    name: &'static str,
    propeller: &'static str,
    cells: bool,
    rate_hz: f64,
    columns: &'static [&'static str],
}

/// Columns of a rig with everything fitted.
const ALL: [&str; 9] =
    ["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder", "thrust_n", "torque_nm", "current_a", "voltage_v", "temp_c"];

const PRESETS: [Preset; 7] = [
    Preset { name: "thesis", propeller: "11x4.7", cells: true, rate_hz: 10.0, columns: &ALL },
    Preset { name: "dshot", propeller: "11x4.7", cells: false, rate_hz: 10.0, columns: &ALL },
    Preset { name: "beam-only", propeller: "11x4.7", cells: true, rate_hz: 10.0, columns: &["rpm_beam"] },
    Preset { name: "load-cell-only", propeller: "11x4.7", cells: true, rate_hz: 100.0, columns: &["thrust_n"] },
    Preset {
        name: "three-blade",
        propeller: "9x4.5x3",
        cells: false,
        rate_hz: 50.0,
        columns: &["rpm_beam", "rpm_opto", "thrust_n", "torque_nm"],
    },
    Preset {
        name: "hall-only",
        propeller: "11x4.7",
        cells: true,
        rate_hz: 100.0,
        columns: &["rpm_hall", "thrust_n", "current_a", "voltage_v"],
    },
    Preset {
        name: "esc-telemetry",
        propeller: "11x4.7",
        cells: true,
        rate_hz: 100.0,
        columns: &[
            "rpm_hall",
            "thrust_n",
            "rpm_esc",
            "current_esc_a",
            "voltage_esc_v",
            "temp_esc_c",
            "charge_esc_mah",
            "rpm_bemf",
        ],
    },
];

/// Columns of a log by name, gaps as NaN.
fn columns(log: &Path) -> BTreeMap<String, Vec<f64>> {
    let text = std::fs::read_to_string(log).expect("a log");
    let mut lines = text.lines().skip_while(|l| l.starts_with('#'));
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|f| f.parse().unwrap_or(f64::NAN)).collect()).collect();
    names.iter().enumerate().map(|(n, name)| ((*name).to_owned(), rows.iter().map(|row| row[n]).collect())).collect()
}

/// Configures, tares, arms by what the ESC beeps, runs one level and records it.
fn flown(preset: &Preset, desk: &Desk, folder: &Path) {
    let file = root().join("examples/rig").join(preset.name).with_extension("toml");
    let rig = |words: &[&str]| call(folder, &[&["rig", "--port", &desk.port], words].concat()).succeeded();
    rig(&["configure", &file.to_string_lossy()]);
    std::thread::sleep(Duration::from_millis(250)); // a whole log interval
    if preset.columns.contains(&"thrust_n") {
        rig(&["tare"]);
    }
    let level = LEVEL.to_string();
    let words = ["rig", "--port", &desk.port, "run", "--step", "400", "--hold", "2.5", "--top", &level, "-o", "run.csv"];
    let piped = |c: &mut Command| c.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = piped(Command::new(quadrig()).args(words).current_dir(folder)).expect("quadrig starts");
    std::thread::sleep(Duration::from_millis(700));
    desk.power_the_esc();
    let mut input = child.stdin.take().expect("its input");
    while let Some(beep) = desk.beep(Duration::from_secs(8)) {
        let line = match beep {
            Beep::Long => "long\n",
            Beep::Cells(_) if !preset.cells => continue, // the profile knows of none, and nobody has to type them
            Beep::Cells(_) => "cells 3\n",
            Beep::Ready => "ready\n",
            other => panic!("{other:?}"),
        };
        input.write_all(line.as_bytes()).expect("it listens");
        if beep == Beep::Ready {
            break;
        }
    }
    Said::new(&words, child.wait_with_output().expect("it ends")).succeeded();
}

/// What the log says of the level against what was there.
fn judged(preset: &Preset, desk: &Desk, folder: &Path) {
    let name = preset.name;
    let log = columns(&folder.join("run.csv"));
    let truth = desk.truth_at(LEVEL).expect("the level was run").plant;
    let there = |column: &str| match column {
        "thrust_n" => (truth.thrust_n, 0.03 + 0.02 * truth.thrust_n),
        "torque_nm" => (truth.torque_nm, 0.004 + 0.02 * truth.torque_nm),
        "current_a" => (truth.current_a, 0.05 + 0.02 * truth.current_a),
        "voltage_v" => (truth.voltage_v, 0.1),
        "temp_c" => (truth.temp_c, 1.0),
        // an ESC's own sensors: 3 % and 0.25 A off, the temperature of its own transistors, and what was drawn since its start
        "current_esc_a" => (0.25 + 1.03 * truth.current_a, 0.05 + 0.02 * truth.current_a),
        "voltage_esc_v" => (0.995 * truth.voltage_v, 0.1),
        "temp_esc_c" => (25.0, 15.0),
        "charge_esc_mah" => (2.5, 2.5),
        _ => (truth.rpm, 0.005 * truth.rpm),
    };
    let last: Vec<usize> = (0..log["t_s"].len()).filter(|row| log["pulse_us"][*row] == f64::from(LEVEL)).collect();
    let rows = &last[last.len() - (0.5 * preset.rate_hz) as usize..]; // half a second of the settled level
    for column in CAPTURE_NAMES.into_iter().chain(ADC_NAMES).chain(ESC_NAMES).chain([BACK_EMF_NAME]) {
        let values: Vec<f64> = log.get(column).map(|v| rows.iter().map(|row| v[*row]).collect()).unwrap_or_default();
        if preset.columns.contains(&column) {
            // the ESC's frames are rarer than the samples
            let told: Vec<f64> = values.into_iter().filter(|v| v.is_finite() || !ESC_NAMES.contains(&column)).collect();
            let mean = told.iter().sum::<f64>() / told.len() as f64;
            let (wanted, off) = there(column);
            assert!((mean - wanted).abs() < off, "{name}: {column} reads {mean}, {wanted} is there");
        } else {
            assert!(values.iter().all(|v| v.is_nan()), "{name}: {column} is not fitted and reads {values:?}");
        }
    }
    let step = (log["t_s"][rows[rows.len() - 1]] - log["t_s"][rows[0]]) / (rows.len() - 1) as f64;
    assert!((step * preset.rate_hz - 1.0).abs() < 0.01, "{name}: a sample each {step} s");
}

#[test]
fn every_preset_flies_and_reads_what_is_there() {
    let there = std::fs::read_dir(root().join("examples/rig")).expect("the presets").count();
    assert_eq!(there, PRESETS.len(), "every file there is a preset that is flown here");
    std::thread::scope(|scope| {
        for preset in &PRESETS {
            scope.spawn(move || {
                let folder = tempfile::tempdir().expect("a folder");
                let text = format!("propeller = {:?}", preset.propeller);
                let scenario = Scenario::parse(&text, Path::new("rig.toml")).expect("a scenario");
                let desk = Desk::with_rig(Line::Clean, scenario);
                flown(preset, &desk, folder.path());
                judged(preset, &desk, folder.path());
            });
        }
    });
}
