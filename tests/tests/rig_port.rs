//! `quadrig log` and `quadrig rig` against a board behind a pseudo-terminal.

use frame::message::Beep;
use frame::units::Ticks;
use quadrig_tests::desk::{Desk, Line};
use quadrig_tests::{Said, call, quadrig};
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use virtual_board::Cable;

/// Rows of a log, each a list of fields, after a look at its head.
fn rows(log: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(log).expect("a log");
    assert!(text.starts_with("# quadrig-log 1\n"), "{text:.80}");
    assert!(text.ends_with('\n'), "the last line is whole");
    let mut lines = text.lines().skip_while(|l| l.starts_with('#'));
    let names = lines.next().expect("a header").split(',').count();
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|f| f.parse().unwrap_or(f64::NAN)).collect::<Vec<_>>()).collect();
    assert!(rows.iter().all(|r| r.len() == names), "every row is whole");
    assert!(rows.windows(2).all(|w| w[1][0] > w[0][0]), "time goes on");
    rows
}

/// Every sample that left the board whole up to the last row is in the log, at its own time and nothing else is: `rows` against
/// `whole`, both from the first on. Gives how many samples came after the last row.
fn holds_all(rows: &[Vec<f64>], whole: &[Ticks]) -> usize {
    let first = whole.first().expect("samples").as_s();
    for (row, at) in rows.iter().zip(whole) {
        assert!((row[0] - (at.as_s() - first)).abs() < 1.0e-3, "a row at {} s, a sample at {} s", row[0], at.as_s() - first);
    }
    whole.len().checked_sub(rows.len()).expect("no row without a sample")
}

fn start(folder: &Path, words: &[&str]) -> Child {
    let piped = |c: &mut Command| c.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    piped(Command::new(quadrig()).args(words).current_dir(folder)).expect("quadrig starts")
}

fn end(words: &[&str], child: Child) -> Said {
    Said::new(words, child.wait_with_output().expect("it ends"))
}

#[test]
fn one_command_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Clean);
    let rig = |words: &[&str]| call(folder.path(), &[&["rig", "--port", &desk.port], words].concat());
    let said = rig(&["identify"]).succeeded();
    assert!(said.out.contains("rig board, firmware") && said.out.contains("power-on"), "{}", said.out);
    std::thread::sleep(Duration::from_millis(150)); // a whole log interval, for the tare
    assert!(rig(&["tare"]).succeeded().out.contains("tared"));
    rig(&["set", "1300"]).refused(&["not in this state"]);
    rig(&["set", "2500"]).refused(&["US 2500", "1000 to 2000"]);
    rig(&["calibrate"]).refused(&["MAXIMUM", "--esc-is-unpowered"]);
    rig(&["configure", "log-ms", "0"]).refused(&["out of range"]);
    rig(&["configure", "colour", "5"]).refused(&["no such setting"]);
    rig(&["configure", "log-ms", "20"]).succeeded();
    rig(&["stop"]).succeeded();
    rig(&["tare"]).succeeded();
    rig(&["configure", "log-ms", "50"]).refused(&["not in this state"]);
    rig(&["clear"]).succeeded();
    call(folder.path(), &["rig", "stop"]).refused(&["--port"]);
    call(folder.path(), &["rig", "--port", "/dev/no-such-port", "stop"]).refused(&["/dev/no-such-port"]);
    assert!(desk.pulses().iter().all(|p| !p.is_live()), "nothing of this turned the motor");
}

/// One file for everything: what goes over comes back, is named in the log's head, and a file that is refused changes nothing.
#[test]
fn the_whole_configuration_is_one_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Clean);
    let rig = |words: &[&str]| call(folder.path(), &[&["rig", "--port", &desk.port], words].concat());
    let examples = quadrig_tests::root().join("examples/rig");
    let preset = |name: &str| examples.join(name).to_string_lossy().into_owned();
    rig(&["configure", "--read", "-o", "before.toml"]).succeeded();
    let before = std::fs::read_to_string(folder.path().join("before.toml")).expect("a file");
    let said = rig(&["configure", &preset("hall-only.toml")]).succeeded();
    let digest = said.out.trim().rsplit(' ').next().expect("a digest").to_owned();
    let told = rig(&["identify"]).succeeded().out;
    assert!(told.contains(&digest) && told.contains("fitted: rpm_hall, thrust_n, current_a, voltage_v;"), "{told}");

    std::thread::sleep(Duration::from_millis(100));
    call(folder.path(), &["log", "--port", &desk.port, "-o", "run.csv", "--seconds", "0.5"]).succeeded();
    let log = std::fs::read_to_string(folder.path().join("run.csv")).expect("a log");
    assert!(log.contains(&format!("# config_crc32 = \"{digest}\"")), "{log:.400}");
    assert!(log.contains("# sample_hz = 100.0"), "{log:.400}");
    let rows = rows(&folder.path().join("run.csv"));
    assert!(rows.iter().all(|row| row[2].is_nan() && row[4] == 0.0), "the hall sensor alone is there, and stands");

    for (text, place) in [("rate_hz = 10\ncolour = 1\n", "bad.toml:2:1"), ("rate_hz = 1000\n[speed]\nbeam = 0\n", "bad.toml:3:8")]
    {
        std::fs::write(folder.path().join("bad.toml"), text).expect("a file");
        rig(&["configure", "bad.toml"]).refused(&[place]);
    }
    assert!(rig(&["identify"]).succeeded().out.contains(&digest), "what was refused changed nothing");

    rig(&["configure", "before.toml"]).succeeded();
    let said = rig(&["configure", "--read"]).succeeded();
    assert_eq!(said.out, before, "and back");
    rig(&["configure"]).refused(&["--read"]);
}

/// Passes the ESC's beeps on until it is ready.
fn arms(desk: &Desk, child: &mut Child) {
    std::thread::sleep(Duration::from_millis(700));
    desk.power_the_esc();
    let input = child.stdin.as_mut().expect("its input");
    while let Some(beep) = desk.beep(Duration::from_secs(8)) {
        let line = match beep {
            Beep::Long => "long\n".to_owned(),
            Beep::Cells(n) => format!("cells {n}\n"),
            Beep::Ready => "ready\n".to_owned(),
            other => panic!("{other:?}"),
        };
        input.write_all(line.as_bytes()).expect("it listens");
        if beep == Beep::Ready {
            break;
        }
    }
}

/// A schedule of three times the board's memory, ramps and a chirp among it.
fn long_schedule() -> String {
    let mut text = String::from("name = \"long\"\n[[part]]\nkind = \"steps\"\nsteps = [\n");
    for n in 0..380 {
        text += &format!("  {{ pulse_us = {}, hold_s = 0.013, ramp = {} }},\n", 1250 + 7 * (n % 20), n % 4 == 0);
    }
    text + "]\n[[part]]\nkind = \"chirp\"\ncentre_us = 1400\namplitude_us = 50\nfrom_hz = 1\nto_hz = 5\nlength_s = 1.5\n"
}

/// One schedule file: the virtual board's pulses are the simulator's, millisecond by millisecond.
#[test]
fn a_schedule_file_gives_the_same_pulses_here_and_in_the_simulator() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("plan.toml"), long_schedule()).expect("a file");
    let desk = Desk::new(Line::Clean);
    let words = ["rig", "--port", &desk.port, "run", "plan.toml", "-o", "run.csv"];
    let mut child = start(folder.path(), &words);
    arms(&desk, &mut child);
    let said = end(&words, child).succeeded();
    assert!(said.out.contains("long: 2 parts, 6.4 s, up to 1450 us"), "{}", said.out);
    let log = std::fs::read_to_string(folder.path().join("run.csv")).expect("a log");
    assert!(log.contains("# schedule = \"long\"\n"), "{log:.300}");
    let live = |pulses: Vec<u32>| -> Vec<u32> {
        let first = pulses.iter().position(|p| *p > 1_000_000).expect("it ran");
        let last = pulses.iter().rposition(|p| *p > 1_000_000).expect("it ran");
        pulses[first..=last].to_vec()
    };
    let here = live(desk.pulses().iter().map(|p| p.0).collect());

    let text = "schedule = { kind = \"file\", file = \"plan.toml\" }\n[log]\nrate_hz = 100\n";
    let scenario = hal_sim::Scenario::parse(text, &folder.path().join("run.toml")).expect("a scenario");
    let mut session = hal_sim::native::Session::new(&scenario, None);
    let mut pulses = Vec::new();
    while session.step().expect("it flies") {
        pulses.push(session.pulse().0);
    }
    let there = live(pulses);
    assert_eq!(here.len(), there.len());
    assert!(here == there, "from {:?} on", here.iter().zip(&there).position(|(a, b)| a != b));

    let rig = |words: &[&str]| call(folder.path(), &[&["rig", "--port", &desk.port, "run"], words].concat());
    std::fs::write(folder.path().join("bad.toml"), "[[part]]\nkind = \"hold\"\npulse_us = 900\n").expect("a file");
    rig(&["bad.toml"]).refused(&["bad.toml:3:12: pulse_us: expected a number from 1000 to 2000, found 900"]);
    std::fs::write(folder.path().join("verdict.json"), "{\"verdict\": \"none\"}").expect("a file");
    rig(&["--next", "verdict.json"]).refused(&["verdict.json:1:1: this verdict proposes no next experiment"]);
}

/// A verdict's next experiment is run as it is.
#[test]
fn the_next_experiment_of_a_verdict_is_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let steps = r#"[{"pulse_us": 1300, "hold_s": 0.8}, {"pulse_us": 1450.0, "hold_s": 0.6}]"#;
    let verdict =
        format!(r#"{{"format": "quadrig-verdict 2", "next_experiment": {{"why": "quick steps", "schedule": {steps}}}}}"#);
    std::fs::write(folder.path().join("verdict.json"), verdict).expect("a file");
    let desk = Desk::new(Line::Clean);
    let words = ["rig", "--port", &desk.port, "run", "--next", "verdict.json", "-o", "run.csv"];
    let mut child = start(folder.path(), &words);
    arms(&desk, &mut child);
    end(&words, child).succeeded();
    let rows = rows(&folder.path().join("run.csv"));
    for (level, least) in [(1300.0, 7), (1450.0, 5)] {
        let at = rows.iter().filter(|r| r[1] == level).count();
        assert!((least..=least + 2).contains(&at), "{at} rows at {level} us");
    }
}

/// The whole session of an operator: arm by the beeps, run a staircase, record it; and the log is one that `identify` takes.
#[test]
fn arm_run_and_record() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Clean);
    let words = ["rig", "--port", &desk.port, "run", "--step", "150", "--hold", "0.6", "--top", "1450", "-o", "run.csv"];
    let mut child = start(folder.path(), &words);
    arms(&desk, &mut child);
    let said = end(&words, child).succeeded();
    assert!(said.out.contains("Armed: keep clear"), "{}", said.out);
    let rows = rows(&folder.path().join("run.csv"));
    for level in [1150.0, 1300.0, 1450.0] {
        let at: Vec<&Vec<f64>> = rows.iter().filter(|r| r[1] == level).collect();
        assert!(at.len() >= 4, "{} rows at {level} us", at.len());
        assert!(at.last().is_some_and(|r| r[2] > 500.0 && (r[2] / r[5] - 1.0).abs() < 0.01), "{level} us: {:?}", at.last());
    }
    std::thread::sleep(Duration::from_millis(100));
    let pulses = desk.pulses();
    assert!(pulses.iter().any(|p| p.is_live()) && pulses.last().is_some_and(|p| !p.is_live()), "stopped at the end");
}

/// A session that dies takes the motor with it: the operator's program is killed while the rotor turns.
#[test]
fn a_killed_session_stops_the_motor() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Clean);
    let words = ["rig", "--port", &desk.port, "arm"];
    let mut child = start(folder.path(), &words);
    std::thread::sleep(Duration::from_millis(700));
    desk.power_the_esc();
    let mut input = child.stdin.take().expect("its input");
    for line in ["long\n", "cells 3\n", "ready\n"] {
        assert!(desk.beep(Duration::from_secs(8)).is_some());
        input.write_all(line.as_bytes()).expect("it listens");
    }
    std::thread::sleep(Duration::from_millis(300));
    input.write_all(b"set 1200\n").expect("it listens");
    std::thread::sleep(Duration::from_millis(600));
    assert!(desk.pulses().last().is_some_and(|p| p.is_live()), "the motor runs");
    child.kill().expect("it dies");
    let _ = child.wait();
    std::thread::sleep(Duration::from_millis(1300));
    assert!(desk.pulses().last().is_some_and(|p| !p.is_live()), "the board stopped it by itself");
}

#[test]
fn a_log_of_a_noisy_line_keeps_every_whole_frame() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Noisy);
    let words = ["log", "--port", &desk.port, "-o", "noisy.csv", "--seconds", "4", "--motor", "570KV"];
    let said = call(folder.path(), &words).succeeded();
    let rows = rows(&folder.path().join("noisy.csv"));
    println!("{} rows; {}", rows.len(), said.err);
    assert!((12..=35).contains(&rows.len()), "{} rows of 4 s on a line that spoils more than a third", rows.len());
    assert!(holds_all(&rows, &desk.whole()) <= 3, "it ended 4 s after it began");
    let damaged = said.err.split(" damaged").next().and_then(|s| s.rsplit(' ').next()).and_then(|n| n.parse::<u32>().ok());
    assert!(damaged.is_some_and(|n| n >= 5), "the damage is counted: {}", said.err);
    assert!(std::fs::read_to_string(folder.path().join("noisy.csv")).expect("a log").contains("# motor = \"570KV\""));
}

/// Waits until so many samples were heard, and until the last of them has had time to be read.
fn samples(desk: &Desk, n: usize) {
    while desk.whole().len() < n {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(50));
}

#[test]
fn an_unplugged_port_costs_nothing_that_arrived() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::named(Line::Clean, &folder.path().join("tty"));
    let words = ["log", "--port", &desk.port, "-o", "run.csv", "--wait", "0.3"];
    let child = start(folder.path(), &words);
    samples(&desk, 15);
    desk.unplug();
    let said = end(&words, child);
    assert_eq!(said.status, Some(1), "{}", said.err);
    assert!(said.err.contains("the port is gone") && said.err.contains("run.csv"), "{}", said.err);
    let rows = rows(&folder.path().join("run.csv"));
    assert!(holds_all(&rows, &desk.whole()) <= 1, "{} rows", rows.len()); // the last may have been under way
    assert!(!folder.path().join("run.csv.part").exists());
}

/// The cable is pulled and comes back: the log goes on, and the board's clock tells the gap.
#[test]
fn a_port_that_comes_back_goes_on_in_the_same_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::named(Line::Clean, &folder.path().join("tty"));
    let words = ["log", "--port", &desk.port, "-o", "run.csv", "--wait", "20", "--seconds", "3.5"];
    let child = start(folder.path(), &words);
    samples(&desk, 12);
    desk.unplug();
    let before = desk.whole();
    std::thread::sleep(Duration::from_millis(700));
    desk.plug();
    end(&words, child).succeeded();
    let rows = rows(&folder.path().join("run.csv"));
    let gap = rows.windows(2).position(|w| w[1][0] - w[0][0] > 0.5).expect("a gap") + 1;
    assert!(holds_all(&rows[..gap], &before) <= 1, "{gap} rows before the gap");
    let whole = desk.whole();
    let from = rows[gap][0] - rows[0][0];
    let after: Vec<f64> = whole[before.len()..].iter().map(|at| at.as_s() - whole[0].as_s()).collect();
    assert!((after[0] - from).abs() < 1.0e-3, "the first sample after the gap at {} s, the first row at {from} s", after[0]);
    assert!(rows[gap..].iter().zip(&after).all(|(row, at)| (row[0] - at).abs() < 1.0e-3), "and every one after it");
    assert!(rows.len() - gap >= 10 && after.len() - (rows.len() - gap) <= 3, "{} of {}", rows.len() - gap, after.len());
}

/// The board itself loses its supply: its clock begins anew, the log's goes on.
#[test]
fn a_board_that_starts_again_goes_on_in_the_same_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("tty");
    let desk = Desk::named(Line::Clean, &link);
    let words = ["log", "--port", &desk.port.clone(), "-o", "run.csv", "--wait", "20", "--seconds", "2.5"];
    let child = start(folder.path(), &words);
    samples(&desk, 12);
    desk.unplug();
    drop(desk);
    let again = Desk::named(Line::Clean, &link);
    let said = end(&words, child).succeeded();
    assert!(said.err.contains("the board was reset"), "{}", said.err);
    let rows = rows(&folder.path().join("run.csv"));
    assert!(rows.len() >= 11 + 8 && again.whole().len() >= 8, "{} rows", rows.len());
}

/// A file that may not grow further behaves as a full disk does: what fits stays whole, the rest lies elsewhere, both are named.
#[test]
fn a_full_disk_costs_nothing_that_arrived() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Clean);
    // `ulimit -f` counts blocks of 512 bytes; without the signal the write fails as on a full disk
    let script =
        format!("trap '' XFSZ; ulimit -f 10; exec '{}' log --port {} -o full.csv --seconds 3", quadrig().display(), desk.port);
    let output = Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder.path())
        .env("TMPDIR", folder.path())
        .stdin(Stdio::null())
        .output()
        .expect("a shell");
    let said = Said::new(&["log"], output);
    assert_eq!(said.status, Some(1), "{}", said.err);
    assert!(said.err.contains("no room for the last"), "{}", said.err);
    let kept = rows(&folder.path().join("full.csv"));
    let rest = std::fs::read_dir(folder.path()).expect("the folder").filter_map(Result::ok);
    let rest = rest.map(|e| e.path()).find(|p| p.to_string_lossy().contains("quadrig-rest")).expect("the rest is kept");
    let rest = std::fs::read_to_string(rest).expect("it is text");
    println!("{} rows in the log, {} beside it", kept.len(), rest.lines().count());
    assert!(kept.len() >= 5 && rest.lines().count() >= 3);
    let last: f64 = kept.last().expect("rows")[0];
    let next: f64 = rest.lines().next().and_then(|l| l.split(',').next()).and_then(|t| t.parse().ok()).expect("a time");
    assert!((next - last - 0.1).abs() < 0.01, "no row between them is lost: {last} and {next}");
    assert!(kept.len() + rest.lines().count() >= 28, "everything that arrived");
}

#[test]
fn a_silent_port_is_no_board() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_cable, port) = Cable::new().expect("a pseudo-terminal");
    call(folder.path(), &["log", "--port", &port, "-o", "none.csv"]).refused(&["no calibration", "2000000"]);
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing is left behind");
    call(folder.path(), &["rig", "--port", &port, "identify"]).refused(&["no answer"]);
    call(folder.path(), &["rig", "--port", &port, "run", "-o", "none.csv"]).refused(&["no answer"]);
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing is left behind");
}
