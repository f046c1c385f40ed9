//! `quadrig sim` as its user meets it: ground truth in a side file, pins recorded and replayed, pause, single steps and speed.

use quadrig_tests::{Said, call, quadrig};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Rest, 1000, 1500 and 2000 us, rest: 7 s after arming.
const SCENARIO: &str =
    "seed = 5\nrest_s = 1.0\nschedule = { kind = \"staircase\", step_us = 500, hold_s = 1.5, top_us = 2000 }\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("run.toml"), SCENARIO).expect("the scenario");
    folder
}

/// Calls with `lines` on the standard input, all at once.
fn told(folder: &Path, words: &[&str], lines: &str) -> (Said, Duration) {
    let begun = Instant::now();
    let mut child = Command::new(quadrig())
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("quadrig starts");
    child.stdin.take().expect("a pipe").write_all(lines.as_bytes()).expect("it listens");
    let output = child.wait_with_output().expect("it ends");
    (Said::new(words, output), begun.elapsed())
}

/// Rows of a log or side file without its comments.
fn rows(folder: &Path, name: &str) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    text.lines().filter(|l| !l.starts_with('#')).map(str::to_owned).collect()
}

fn column(rows: &[String], name: &str) -> Vec<f64> {
    let place = rows[0].split(',').position(|n| n == name).unwrap_or_else(|| panic!("{name} in {}", rows[0]));
    rows[1..].iter().map(|r| r.split(',').nth(place).and_then(|v| v.parse().ok()).unwrap_or(f64::NAN)).collect()
}

#[test]
fn truth_goes_to_a_side_file_and_pins_play_back() {
    let folder = folder();
    let at = folder.path();
    call(at, &["sim", "run.toml", "-o", "log.csv", "--truth", "truth.csv", "--pins", "pins.bin"]).succeeded();
    let (log, truth) = (rows(at, "log.csv"), rows(at, "truth.csv"));
    assert!(log.len() > 60 && log.len() == truth.len(), "{} rows and {}", log.len(), truth.len());
    // at full throttle, settled: what is measured is what is there, and the back-EMF meter agrees with both
    let pulse = column(&truth, "pulse_us");
    let last = pulse.iter().rposition(|p| *p == 2000.0).expect("full throttle");
    let (rpm, meter) = (column(&truth, "rpm"), column(&truth, "back_emf_rpm"));
    let beam = column(&log, "rpm_beam");
    println!("true {} rev/min, beam {}, back-EMF meter {}", rpm[last], beam[last], meter[last]);
    assert!(rpm[last] > 5000.0 && (beam[last] / rpm[last] - 1.0).abs() < 2e-3 && (meter[last] / rpm[last] - 1.0).abs() < 5e-3);
    assert!(meter[0].is_nan() && rpm[0] == 0.0, "a resting motor makes no voltage");
    let thrust = (column(&log, "thrust_n")[last], column(&truth, "thrust_n")[last]);
    assert!((thrust.0 - thrust.1).abs() < 0.1, "{thrust:?}");

    call(at, &["sim", "run.toml", "-o", "again.csv", "--replay", "pins.bin"]).succeeded();
    assert_eq!(rows(at, "again.csv"), log, "the firmware alone on the recorded pins");
    std::fs::write(at.join("pins.bin"), b"quadrig pins 3\n").expect("a stub");
    call(at, &["sim", "run.toml", "-o", "never.csv", "--replay", "pins.bin"]).refused(&["pins.bin"]);
    assert!(!at.join("never.csv").exists());
}

#[test]
fn pause_single_steps_and_speed_change_nothing_but_the_time() {
    let folder = folder();
    let at = folder.path();
    call(at, &["sim", "run.toml", "-o", "plain.csv"]).succeeded();
    let live = ["sim", "run.toml", "-o", "live.csv", "--live", "--speed", "1"];
    let (said, _) = told(at, &live, "p\ns\ns\ns\n0\n");
    let said = said.succeeded();
    let paused: Vec<&str> = said.out.lines().filter(|l| l.contains("paused")).collect();
    assert_eq!(paused.len(), 3, "three steps of 0.1 s while paused:\n{}", said.out);
    let seconds = |line: &str| -> f64 { line.split_whitespace().next().and_then(|s| s.parse().ok()).expect("a time") };
    assert!(paused.windows(2).all(|w| (seconds(w[1]) - seconds(w[0]) - 0.1).abs() < 1e-9), "{paused:?}");
    assert_eq!(rows(at, "live.csv"), rows(at, "plain.csv"), "the bytes are those of the run without a viewer");

    let (said, took) = told(at, &["sim", "run.toml", "-o", "fast.csv", "--live", "--speed", "20"], "");
    let said = said.succeeded();
    let simulated = said.out.lines().filter(|l| l.contains("x20")).map(seconds).fold(0.0, f64::max);
    println!("{simulated:.1} s simulated in {:.2} s at 20 times real time", took.as_secs_f64());
    assert!(simulated > 10.0 && took.as_secs_f64() > 0.95 * simulated / 20.0, "no faster than asked");
    assert_eq!(rows(at, "fast.csv"), rows(at, "plain.csv"));
}

/// A rocking and shaken body: with ideal chips the filter follows it, with drawn errors less so, and `quadrig ahrs` makes the same of the
/// readings.
#[test]
fn the_imu_board_flies_a_scenario_of_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let body = "start_deg = [10.0, -5.0, 60.0]\nrate_deg_s = [0.0, 0.0, 12.0]\nrock_deg = [15.0, 10.0, 0.0]\nrock_hz = 0.4\n\
        shake_m = [0.0, 0.0, 0.002]\nshake_hz = 6.0\n";
    let words = ["sim", "imu.toml", "-o", "attitude.csv", "--truth", "truth.csv", "--readings", "readings.csv"];
    let worst = |a: &[String], b: &[String], name: &str| {
        let (a, b) = (column(a, name), column(b, name));
        let apart = a.iter().zip(&b).skip(2_000).map(|(a, b)| ((a - b + 540.0).rem_euclid(360.0) - 180.0).abs());
        apart.fold(0.0, f64::max)
    };
    let mut off = [0.0f64; 2];
    for (off, drawn) in off.iter_mut().zip([false, true]) {
        let text = format!("seed = 3\n[imu]\nduration_s = 40.0\ndrawn_errors = {drawn}\n[imu.body]\n{body}");
        std::fs::write(at.join("imu.toml"), text).expect("the scenario");
        call(at, &words).succeeded();
        let first = std::fs::read(at.join("attitude.csv")).expect("a log");
        call(at, &words).succeeded();
        assert_eq!(std::fs::read(at.join("attitude.csv")).expect("a log"), first, "the same seed, the same bytes");
        call(at, &["ahrs", "readings.csv", "again.csv"]).succeeded();
        let [told, truth, again] = ["attitude.csv", "truth.csv", "again.csv"].map(|name| rows(at, name));
        assert_eq!(told[0], "t_s,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg");
        assert!(told.len() == truth.len() && told.len() == again.len() && told.len() > 7_900, "{}", told.len());
        for name in ["roll_deg", "pitch_deg", "yaw_deg"] {
            let swing = column(&truth, name).iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let (wrong, apart) = (worst(&told, &truth, name), worst(&told, &again, name));
            println!("drawn errors {drawn}, {name} up to {swing:.1}: off by {wrong:.3}, quadrig ahrs apart by {apart:.4}");
            // six decimals, and a word of the magnetometer that repeats itself counts as an old one in a file: what that is worth grows with
            // how far the filter has yet to go (an offset of degrees a second that no rest has shown)
            assert!(swing > 10.0 && apart < 0.02 + 0.03 * wrong, "{swing} {apart} {wrong}");
            *off = off.max(wrong);
        }
    }
    // words of 1/256 g and 1/1090 gauss alone are worth 0.2 and 0.3 deg
    assert!(off[0] < 0.5 && off[1] > 2.0 * off[0], "{off:?}");
    call(at, &["sim", "imu.toml", "-o", "never.csv", "--live"]).refused(&["imu.toml", "--live"]);
    std::fs::write(at.join("imu.toml"), "motor = \"570KV\"\n[imu]\n").expect("a scenario of both");
    call(at, &["sim", "imu.toml", "-o", "never.csv"]).refused(&["imu.toml:1:1", "motor"]);
    assert!(!at.join("never.csv").exists());
}
