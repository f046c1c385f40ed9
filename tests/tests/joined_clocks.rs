//! A stand's log and an ESC's own log of one run become one: the command line, and the recorded pair.
//!
//! What it is: `import STAND --with ESC` on a run that is written twice with two clocks, and on the F40 run of the `spitz-esc-test` set, whose
//! stand logged no command: with the ESC's log it has one, and the speed is predicted from it.
//! What can go wrong: the recorded data are absent (the test says so); a joint that is wrong; a log that is half-written after a refusal.
//! Units: as the columns state.
//! Reference: README of the set: "the ESC's own log of the same run (own clock, own sensors)".

use ident::log::Log;
use quadrig_tests::bench::{Bench, good_log};
use quadrig_tests::{call, data};
use std::fs;

/// The good log as an ESC would have it: another clock, its own header, no thrust.
fn esc_log(offset_s: f64, drift: f64) -> String {
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        format!(
            "{:.4};{};{};{};{}\n",
            1000.0 * (offset_s + cells[0] * (1.0 + drift)),
            cells[1],
            7.0 * cells[2],
            cells[4],
            cells[5]
        )
    };
    "time_ms;pulse_us;erpm;current (A);voltage (V)\n".to_owned() + &good_log().lines().skip(3).map(row).collect::<String>()
}

#[test]
fn two_logs_of_one_run_become_one() {
    let bench = Bench::new();
    // the stand logs no command
    let stand: String = good_log()
        .lines()
        .map(|l| match l.split(',').collect::<Vec<_>>()[..] {
            [t, _, rpm, thrust, current, voltage] => format!("{t},{rpm},{thrust},{current},{voltage}\n"),
            _ => format!("{l}\n"),
        })
        .collect();
    fs::write(bench.path("stand.csv"), stand).unwrap();
    fs::write(bench.path("esc.csv"), esc_log(50.0, 200e-6)).unwrap();
    let words = ["import", "stand.csv", "--with", "esc.csv", "--pole-pairs", "7", "-o", "run.csv"];
    let said = bench.call(&words).succeeded();
    assert!(said.out.contains("offset -50.0"), "{}", said.out);
    assert!(said.out.contains("pulse_us of esc.csv, which the stand lacks, as it stood"), "{}", said.out);
    assert!(said.err.contains("electrical turns, times 1 over 7 pole pairs"), "{}", said.err);
    let log = Log::read(&bench.path("run.csv")).unwrap();
    assert!(["pulse_us", "rpm_esc", "current_esc_a", "voltage_esc_v"].iter().all(|c| log.column(c).is_some()));
    assert!(log.meta["joint_esc"].as_str().unwrap().contains("ppm"));
    let page = fs::read_to_string(bench.path("run.joint.html")).unwrap();
    assert!(page.contains("joint-whole-0") && !page.replace("http://www.w3.org/2000/svg", "").contains("http"));
    // the same twice
    fs::rename(bench.path("run.csv"), bench.path("first.csv")).unwrap();
    bench.call(&words).succeeded();
    assert_eq!(fs::read(bench.path("run.csv")).unwrap(), fs::read(bench.path("first.csv")).unwrap());

    let before = bench.names();
    let refused = |more: &[&str], said: &str| {
        bench.call(&[&["--quiet", "import", "stand.csv", "-o", "none.csv"], more].concat()).refused(&[said])
    };
    fs::write(
        bench.path("still.csv"),
        "t_s,rpm,current_a\n".to_owned() + &(0..400).map(|k| format!("{k},4000,3\n")).collect::<String>(),
    )
    .unwrap();
    refused(&["--with", "still.csv"], "stand.csv and still.csv: no channel that both hold changes");
    refused(&["--pole-pairs", "7", "--with", "esc.csv", "--with", "esc.csv"], "two loggers called esc");
    refused(&["--with", "esc.csv"], "electrical turns and no pole pairs");
    assert_eq!(bench.names().len(), before.len() + 1);
    assert_eq!(bench.call(&["import", "stand.csv", "-o", "none.csv", "--with", "radio=esc.csv"]).status, Some(2));
}

/// A flight controller on the stand records four rotors, one of which turns.
#[test]
fn a_flight_controllers_recording_is_joined_too() {
    let bench = Bench::new();
    let good = Log::read(&bench.path("good.csv")).unwrap();
    let zero = vec![0.0; good.len()];
    let column = |name: &str, values: &[f64]| ident::log::Column { name: name.to_owned(), values: values.to_vec() };
    let mut flight = Log { t: good.t.iter().map(|t| 7.0 + t).collect(), ..Log::default() };
    for axis in ["gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"] {
        flight.columns.push(column(axis, &zero));
    }
    let (pulse, rpm) = (good.column("pulse_us").unwrap(), good.column("rpm").unwrap());
    for n in 1..=4 {
        flight.columns.push(column(&format!("pulse_us_{n}"), if n == 2 { pulse } else { &zero }));
        flight.columns.push(column(&format!("rpm_{n}"), if n == 2 { rpm } else { &zero }));
    }
    flight.columns.push(column("voltage_v", good.column("voltage_v").unwrap()));
    flight.columns.push(column("current_a", good.column("current_a").unwrap()));
    fs::write(bench.path("fc.bbl"), quadrig_tests::recorders::blackbox(&flight)).unwrap();
    let words = ["--quiet", "import", "good.csv", "--with", "fc=fc.bbl", "-o", "run.csv"];
    bench.call(&words).refused(&["fc.bbl records several rotors; expected --rotor N"]);
    bench.call(&[&words[..], &["--rotor", "2"]].concat()).succeeded();
    let log = Log::read(&bench.path("run.csv")).unwrap();
    assert!(
        log.column("pulse_fc_us").is_some() && log.column("current_of_all_a_fc").is_some(),
        "{:?}",
        log.columns.iter().map(|c| &c.name).collect::<Vec<_>>()
    );
    let joint = log.meta["joint_fc"].as_str().unwrap();
    let offset: f64 = joint.strip_prefix("fc.bbl: offset ").and_then(|r| r.split(' ').next()?.parse().ok()).expect("an offset");
    assert!((offset + 7.0).abs() < 0.002, "{joint}");
    let off =
        log.column("rpm").unwrap().iter().zip(log.column("rpm_fc").unwrap()).filter(|(a, b)| (*a - *b).abs() > 15.0).count();
    assert!(off < 30, "{off} rows differ");
}

/// The recorded pair: the command of the ESC's log gets into the stand's, and the speed follows from it.
#[test]
fn the_recorded_stand_gets_the_escs_command() {
    let Some(data) = data("the stand's log with the ESC's own") else { return };
    let folder = tempfile::TempDir::new().unwrap();
    let set = data.join("rig/spitz-esc-test/original");
    let path = |name: &str| set.join(name).to_str().unwrap().to_owned();
    let (stand, esc) = (path("Log_2019-11-05_171350.csv"), path("f40_steps_5-2.csv"));
    let said = call(
        folder.path(),
        &["import", &stand, "--with", &esc, "--motor", "F40 Pro III", "--propeller", "T7056", "-o", "run.csv"],
    )
    .succeeded();
    println!("{}", said.out);
    let log = Log::read(&folder.path().join("run.csv")).unwrap();
    let pulse = log.column("pulse_us").expect("a command");
    let known = pulse.iter().filter(|p| p.is_finite()).count();
    assert!(5 * known > 4 * log.len(), "{known} of {}", log.len());
    // both saw the same speed
    let (a, b) = (log.column("rpm").unwrap(), log.column("rpm_esc").unwrap());
    let mut off: Vec<f64> =
        a.iter().zip(b).filter(|(a, b)| **a > 3000.0 && b.is_finite()).map(|(a, b)| (a / b - 1.0).abs()).collect();
    off.sort_by(f64::total_cmp);
    assert!(off[off.len() / 2] < 0.01, "the two speeds differ by {}", off[off.len() / 2]);
    let said = call(folder.path(), &["close-loop", "run.csv", "--json"]).succeeded();
    let verdict: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    let rpm = &verdict["channels"]["rpm"];
    let (before, after) =
        (rpm["before"]["heldout_rms"].as_f64().expect("predicted"), rpm["after"]["heldout_rms"].as_f64().unwrap());
    println!("speed from the pulse: {before:.0} before, {after:.0} after");
    assert!(after <= before && after < 2000.0, "{rpm}");
}
