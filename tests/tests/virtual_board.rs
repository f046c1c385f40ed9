//! `--port sim` and `quadrig virtual`: boards without hardware, by the commands that people type.

use quadrig_tests::{Said, call, quadrig, root};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::{Duration, Instant};

fn rows(log: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(log).expect("a log");
    let lines = text.lines().skip_while(|l| l.starts_with('#')).skip(1);
    lines.map(|l| l.split(',').map(|f| f.parse().unwrap_or(f64::NAN)).collect()).collect()
}

/// Arms, runs and records on the virtual board of `port`, as fast as it goes.
fn run(folder: &Path, port: &str, log: &str) -> Said {
    let words = ["rig", "--port", port, "--speed", "0", "--assist", "run", "--step", "200", "--hold", "2", "--top", "1600"];
    call(folder, &[&words[..], &["-o", log]].concat()).succeeded()
}

#[test]
fn a_rehearsal_is_heard_recorded_and_the_same_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = run(folder.path(), "sim", "a.csv");
    for words in ["the ESC: beeeeeeep ", "beep beep beep ", "do re mi ", "Armed: keep clear", "Running: keep clear"] {
        assert!(said.out.contains(words), "{words}: {}", said.out);
    }
    run(folder.path(), "sim", "b.csv");
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect("a log");
    assert!(bytes("a.csv") == bytes("b.csv"), "the same command, the same bytes");
    let rows = rows(&folder.path().join("a.csv"));
    let top = rows.iter().rev().find(|row| row[1] == 1600.0).expect("the top level");
    assert!(top[2] > 2000.0 && (top[2] / top[5] - 1.0).abs() < 0.01 && top[9] > 11.0, "{top:?}");
}

/// A scenario's effects count from the first pulse above minimum: a blade that breaks 3 s into the run takes thrust away from there on.
#[test]
fn a_scenario_puts_its_rig_before_the_board() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[[effect]]\nid = \"blade_damage\"\nthrust_change = -0.3\ntorque_change = 0.1\nt0_s = 3.0\n";
    std::fs::write(folder.path().join("broken.toml"), text).expect("a file");
    run(folder.path(), "sim:broken.toml", "broken.csv");
    run(folder.path(), "sim", "whole.csv");
    let thrust = |log: &str| rows(&folder.path().join(log)).iter().map(|row| row[6] - 0.0).collect::<Vec<_>>();
    let (broken, whole) = (thrust("broken.csv"), thrust("whole.csv"));
    let pulses: Vec<f64> = rows(&folder.path().join("whole.csv")).iter().map(|row| row[1]).collect();
    let live = pulses.iter().position(|p| *p > 1000.0).expect("it runs");
    let differs = broken.iter().zip(&whole).position(|(a, b)| (a - b).abs() > 0.1).expect("the damage shows");
    let after_s = 0.1 * (differs - live) as f64;
    assert!((2.9..3.4).contains(&after_s), "{after_s} s after the first live pulse");
    call(folder.path(), &["rig", "--port", "sim:nowhere.toml", "stop"]).refused(&["nowhere.toml"]);
    std::fs::write(folder.path().join("bad.toml"), "motor = 3\n").expect("a file");
    call(folder.path(), &["log", "--port", "sim:bad.toml", "-o", "x.csv"]).refused(&["bad.toml:1:9"]);
}

#[test]
fn what_is_stored_is_there_for_the_next_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let preset = root().join("examples/rig/hall-only.toml").to_string_lossy().into_owned();
    let rig = |words: &[&str]| call(folder.path(), &[&["rig", "--port", "sim", "--flash", "rig.bin"], words].concat());
    rig(&["configure", &preset]).succeeded();
    assert_eq!(std::fs::metadata(folder.path().join("rig.bin")).expect("the file").len(), 256 * 1024);
    assert!(rig(&["identify"]).succeeded().out.contains("fitted: rpm_hall, thrust_n, current_a, voltage_v;"));
    let plain = call(folder.path(), &["rig", "--port", "sim", "identify"]).succeeded();
    assert!(plain.out.contains("rpm_beam"), "a board without the file is as it left the factory");

    let imu = |words: &[&str]| {
        call(folder.path(), &[&["imu", "--port", "sim", "--flash", "imu.bin", "--speed", "0"], words].concat()).succeeded().out
    };
    assert!(imu(&["identify"]).contains("sensors gyro accel mag"));
    imu(&["stream", "off"]);
    assert!(imu(&["save"]).contains("saved"));
    assert!(folder.path().join("imu.bin").is_file());

    std::fs::write(folder.path().join("short.bin"), [0; 99]).expect("a file");
    call(folder.path(), &["rig", "--port", "sim", "--flash", "short.bin", "stop"]).refused(&["short.bin", "99 bytes", "262144"]);
}

#[test]
fn what_a_virtual_board_is_not_is_said_in_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("imu.toml"), "[imu]\n").expect("a file");
    let refused = |words: &[&str], texts: &[&str]| call(folder.path(), words).refused(texts);
    refused(&["rig", "--port", "/dev/null", "--flash", "a.bin", "stop"], &["--flash", "--port sim"]);
    refused(&["rig", "--port", "/dev/null", "--assist", "stop"], &["--assist", "--port sim"]);
    refused(&["rig", "--port", "sim:imu.toml", "stop"], &["virtual IMU board", "rig board"]);
    refused(&["imu", "--port", "sim:imu.toml", "--image", "x.elf", "errors"], &["imu.toml", "--image"]);
    refused(&["rig", "--port", "sim", "--speed", "-1", "stop"], &["--speed -1"]);
    refused(&["virtual", "--speed", "0"], &["--speed 0", "a positive number"]);
    std::fs::write(folder.path().join("file"), "mine").expect("a file");
    refused(&["virtual", "--link", "file", "--seconds", "1"], &["--link file", "no link"]);
    assert_eq!(std::fs::read_to_string(folder.path().join("file")).expect("still there"), "mine");
}

/// A board behind a pseudo-terminal, and the hands at its bench.
struct Bench {
    child: Child,
    hands: ChildStdin,
    said: BufReader<std::process::ChildStdout>,
}

impl Bench {
    fn new(folder: &Path, words: &[&str]) -> Self {
        let mut child = Command::new(quadrig())
            .args([&["virtual"], words].concat())
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("quadrig starts");
        let (hands, said) = (child.stdin.take().expect("its input"), child.stdout.take().expect("its output"));
        Self { child, hands, said: BufReader::new(said) }
    }

    /// The next line that holds `words`.
    fn hears(&mut self, words: &str) -> String {
        loop {
            let mut line = String::new();
            assert!(self.said.read_line(&mut line).expect("its output") > 0, "it ended without {words:?}");
            if line.contains(words) {
                return line;
            }
        }
    }

    fn does(&mut self, deed: &str, told: &str) {
        writeln!(self.hands, "{deed}").expect("it listens");
        self.hears(told);
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = self.child.kill(); // a test that fails leaves no board behind
        let _ = self.child.wait();
    }
}

#[cfg(unix)]
#[test]
fn other_programs_find_it_behind_a_pseudo_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path(), &["--link", "board", "--flash", "board.bin"]);
    let port = bench.hears("/dev/").trim().to_owned();
    assert_eq!(std::fs::read_link(folder.path().join("board")).expect("a link").to_string_lossy(), port);
    let rig = |words: &[&str]| call(folder.path(), &[&["rig", "--port", "board"], words].concat());
    assert!(rig(&["identify"]).succeeded().out.contains("rig board, firmware"));
    let interval = || std::thread::sleep(Duration::from_millis(250)); // a whole log interval
    let (mut counts, masses) = (Vec::new(), ["0", "100", "200", "300"]);
    for mass in masses {
        bench.does(&format!("hang {mass}"), "on the load cell");
        interval();
        let said = rig(&["status"]).succeeded().out;
        let line = said.lines().find(|l| l.starts_with("thrust_n ") && l.contains(" counts, rms")).expect("a reading");
        counts.push(line.split(" counts").next().and_then(|s| s.rsplit(' ').next()?.parse::<f64>().ok()).expect("counts"));
    }
    assert!(counts.windows(2).all(|w| (w[1] - w[0] - 266.5).abs() < 10.0), "100 g each, but for the noise: {counts:?}");
    rig(&["save"]).succeeded();
    bench.does("stop", "stop loop is open");
    interval();
    rig(&["clear"]).refused(&["stop loop"]);
    bench.does("release", "closed");
    interval();
    rig(&["clear"]).succeeded();
    bench.does("power on", "supply is on");
    bench.does("meters", "11.5");
    bench.does("reset", "reset key");
    interval();
    let said = rig(&["identify"]).succeeded().out;
    assert!(said.contains("reset key"), "{said}");
    bench.does("dance", "expected power on|off");

    let killed = Command::new("kill").args(["-TERM", &bench.child.id().to_string()]).status().expect("kill");
    assert!(killed.success());
    let ended = Instant::now();
    assert!(bench.child.wait().expect("it ends").success(), "a polite kill is an end in order");
    assert!(ended.elapsed() < Duration::from_secs(5));
    assert!(std::fs::symlink_metadata(folder.path().join("board")).is_err(), "the link is gone");
    let mut rest = String::new();
    bench.said.read_to_string(&mut rest).expect("text");
    assert!(folder.path().join("board.bin").is_file());
}
