//! The terminal view in a terminal: what a person sees and types, and what the log says afterwards.
#![cfg(unix)]

use quadrig_tests::desk::{Desk, Line};
use quadrig_tests::screen::Screen;
use quadrig_tests::{quadrig, root};
use std::path::Path;
use std::process::{Command, ExitStatus};
use std::time::Duration;

const SMALL: (u16, u16) = (80, 24);
const LARGE: (u16, u16) = (120, 40);
const UP: &str = "\x1b[A";

/// Rows of a log, whole and in order.
fn rows(log: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(log).expect("a log");
    assert!(text.starts_with("# quadrig-log 1\n") && text.ends_with('\n'), "{text:.80}");
    let lines = text.lines().filter(|l| !l.starts_with('#')).skip(1); // events may stand among the rows
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|f| f.parse().unwrap_or(f64::NAN)).collect()).collect();
    assert!(rows.windows(2).all(|w| w[1][0] > w[0][0] && w[1].len() == w[0].len()), "whole rows in order");
    rows
}

/// Arms by keys, with the ears of a person.
fn arm(screen: &mut Screen) {
    screen.until("Holding minimum");
    screen.press("b");
    screen.until("beeeeeeep");
    screen.press("l");
    screen.until("beep beep beep");
    screen.press("3");
    screen.until("do re mi");
    screen.press("r");
    screen.until(" ARMED ");
}

#[test]
fn a_rig_is_armed_turned_and_stopped_by_keys_and_everything_is_recorded() {
    for size in [SMALL, LARGE] {
        let folder = tempfile::tempdir().expect("a folder");
        let words = ["rig", "--port", "sim", "arm", "-o", "seen.csv"];
        let mut screen = Screen::start(folder.path(), &words, size);
        arm(&mut screen);
        screen.press("=1250\r");
        screen.until(" RUNNING ");
        screen.until("pulse  1250.0 us");
        screen.press(UP);
        let text = screen.until("pulse  1260.0 us");
        for words in ["SPACE stops", "REC seen.csv", "rpm_beam", "battery on", "0 damaged", "thrust_n", "temp_c"] {
            assert!(text.contains(words), "no {words:?} in\n{text}");
        }
        std::thread::sleep(Duration::from_millis(1500));
        let text = screen.until("ok");
        assert!(text.lines().any(|l| l.contains("rpm_hall") && l.contains("ok") && l.contains('█')), "{text}");
        screen.press(" ");
        screen.until("operator's stop");
        screen.until(" STOPPED ");
        screen.press("x");
        screen.until(" DISARMED ");
        screen.press("q");
        let (status, rest) = screen.end();
        assert!(status.success() && rest.contains("recorded in seen.csv"), "{rest}");
        let rows = rows(&folder.path().join("seen.csv"));
        assert!(rows[0][0] == 0.0 && rows[0][1] == 1000.0, "from the first second: {:?}", rows[0]);
        assert!(rows.iter().any(|r| r[1] == 1260.0 && r[2] > 300.0) && rows.last().is_some_and(|r| r[1] == 1000.0));
    }
}

#[test]
fn a_schedule_waits_for_its_key_shows_what_is_left_and_ends_by_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let words = ["rig", "--port", "sim", "run", "--step", "200", "--hold", "2", "--top", "1400", "-o", "run.csv"];
    let mut screen = Screen::start(folder.path(), &words, SMALL);
    arm(&mut screen);
    screen.until("0:06 to go");
    // its key is offered with the next frame at the latest
    screen.until(" g ");
    std::thread::sleep(Duration::from_millis(500));
    assert!(screen.text().contains(" ARMED "), "it waits");
    screen.press("g");
    screen.until("pulse  1200.0 us");
    screen.until("0:03 left");
    let (status, rest) = screen.end();
    assert!(status.success() && rest.contains("recorded in run.csv"), "{rest}");
    let rows = rows(&folder.path().join("run.csv"));
    assert!(rows.iter().filter(|r| r[1] == 1400.0).count() >= 18, "the top level was held");
}

/// Ends a session by a key, a signal, or a terminal that goes away; its status and its last words where somebody can still hear them.
fn ended(mut screen: Screen, end: &str) -> (Option<ExitStatus>, String) {
    match end {
        "hang-up" => {
            screen.hang_up();
            return (None, String::new());
        }
        "control-c" => screen.press("\x03"),
        signal => screen.signal(signal),
    }
    let (status, rest) = screen.end();
    (Some(status), rest)
}

/// Whatever ends a session stops the motor and closes the recording.
#[test]
fn an_end_by_signal_or_control_c_loses_nothing() {
    for end in ["control-c", "HUP", "TERM", "hang-up"] {
        let folder = tempfile::tempdir().expect("a folder");
        let desk = Desk::new(Line::Clean);
        let mut screen = Screen::start(folder.path(), &["rig", "--port", &desk.port, "arm", "-o", "seen.csv"], SMALL);
        screen.until("Holding minimum");
        desk.power_the_esc();
        for keys in ["l", "3", "r"] {
            assert!(desk.beep(Duration::from_secs(8)).is_some());
            screen.press(keys);
        }
        screen.until(" ARMED ");
        screen.press("=1200\r");
        screen.until("pulse  1200.0 us");
        let (_, rest) = ended(screen, end);
        std::thread::sleep(Duration::from_millis(100));
        assert!(desk.pulses().last().is_some_and(|p| !p.is_live()), "{end}: the motor was stopped at once");
        let rows = rows(&folder.path().join("seen.csv"));
        let whole = desk.whole();
        assert!(whole.len() - rows.len() <= 3, "{end}: {} of {} samples; {rest}", rows.len(), whole.len());
        assert!(rows.iter().any(|r| r[1] == 1200.0), "{end}");
        assert!(!folder.path().join("seen.csv.part").exists(), "{end}");
    }
}

#[test]
fn a_lost_link_is_told_and_the_recording_goes_on_when_it_is_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::named(Line::Clean, &folder.path().join("tty"));
    let mut screen = Screen::start(folder.path(), &["rig", "--port", &desk.port, "view", "-o", "seen.csv"], LARGE);
    screen.until("minimum throttle. Arm");
    std::thread::sleep(Duration::from_millis(500));
    desk.unplug();
    screen.until("the port is gone");
    let before = desk.whole().len();
    desk.plug();
    screen.until("the port is back");
    std::thread::sleep(Duration::from_millis(700));
    screen.press("q");
    let (status, rest) = screen.end();
    assert!(status.success(), "{rest}");
    let (rows, whole) = (rows(&folder.path().join("seen.csv")), desk.whole());
    let gap = rows.windows(2).filter(|w| w[1][0] - w[0][0] > 0.15).count();
    assert!(gap == 1 && rows.len() + 5 >= whole.len() && rows.len() > before, "{} of {}, {gap} gaps", rows.len(), whole.len());
}

#[test]
fn a_full_disk_is_on_the_screen_and_loses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = format!("trap '' XFSZ; ulimit -f 24; exec '{}' log --port sim --speed 4 -o full.csv", quadrig().display());
    let mut command = Command::new("sh");
    command.args(["-c", &script]).env("TMPDIR", folder.path());
    let mut screen = Screen::with(command, folder.path(), SMALL);
    screen.until("REC full.csv");
    screen.until("DISK FULL");
    screen.until("cannot be written to");
    std::thread::sleep(Duration::from_millis(500));
    screen.press("q");
    let (status, rest) = screen.end();
    assert!(status.code() == Some(1) && rest.contains("no room for the last"), "{rest}");
    let kept = rows(&folder.path().join("full.csv"));
    let files = std::fs::read_dir(folder.path()).expect("the folder").filter_map(Result::ok).map(|e| e.path());
    let rest = files.into_iter().find(|p| p.to_string_lossy().contains("quadrig-rest")).expect("the rest is kept");
    let next = std::fs::read_to_string(rest).expect("text");
    let next = next.lines().find(|line| !line.starts_with('#')); // events stand among the rows
    let next: f64 = next.and_then(|l| l.split(',').next()).and_then(|t| t.parse().ok()).expect("a time");
    assert!((next - kept.last().expect("rows")[0] - 0.1).abs() < 0.01, "no row between them is lost");
}

#[test]
fn a_simulated_run_is_watched_paused_and_stepped() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = root().join("examples/sagging-lead.toml").to_string_lossy().into_owned();
    let mut screen = Screen::start(folder.path(), &["sim", &scenario, "-o", "run.csv", "--live"], SMALL);
    screen.until("1 times the clock");
    screen.press("p");
    screen.until("paused");
    let before = screen.text();
    screen.press("+");
    screen.until("2 times the clock");
    screen.press("0");
    let text = screen.until(" RUNNING ");
    assert!(before != text && text.contains("rpm_beam"), "{text}");
    let (status, rest) = screen.end();
    assert!(status.success() && rest.contains("samples over"), "{rest}");
    assert!(folder.path().join("run.csv").is_file());
}

/// Whatever ends a simulated run that is watched keeps what was flown until then.
#[test]
fn an_end_of_a_watched_run_keeps_its_log() {
    let scenario = "rest_s = 1.0\nschedule = { kind = \"staircase\", step_us = 500, hold_s = 300, top_us = 2000 }\n";
    for end in ["control-c", "INT", "TERM", "HUP", "hang-up"] {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("run.toml"), scenario).expect("a scenario");
        let words = ["sim", "run.toml", "-o", "run.csv", "--live", "--speed", "20"];
        let mut screen = Screen::start(folder.path(), &words, SMALL);
        screen.until(" RUNNING ");
        std::thread::sleep(Duration::from_millis(500));
        let (status, rest) = ended(screen, end);
        // who is gone is told nothing
        assert!(status.is_none_or(|s| s.success() && rest.contains("samples over")), "{end}: {rest}");
        assert!(folder.path().join("run.csv").is_file(), "{end}: {rest}");
        let rows = rows(&folder.path().join("run.csv"));
        assert!((50..5000).contains(&rows.len()), "{end}: {} rows of 902 s; {rest}", rows.len());
    }
}
