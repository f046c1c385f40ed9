//! A rig's channels calibrated live on a board behind a pseudo-terminal, and from recordings; what was found is stored, logged and used.

use quadrig_tests::desk::{Desk, Line};
use quadrig_tests::{Said, call, quadrig};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use virtual_board::Hand;

/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;

/// What a hand does at a prompt, and the line that is typed then.
type Step<'s> = (Do, &'s str);

/// At the bench.
#[derive(Clone, Copy)]
enum Do {
    Hand(Hand),
    Swing(f64),
}

/// Calls a guided calibration: each time it asks, something is done at the bench, time passes for the hand to let go, and a line is typed.
fn guided(folder: &Path, desk: &Desk, words: &[&str], steps: &[Step<'_>]) -> Said {
    let words = [&["calibrate"], words, &["--port", &desk.port]].concat();
    let piped = |c: &mut Command| c.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = piped(Command::new(quadrig()).args(&words).current_dir(folder)).expect("quadrig starts");
    let mut input = child.stdin.take();
    let mut said = BufReader::new(child.stdout.take().expect("its output")).lines().map_while(Result::ok);
    let (mut out, mut steps) = (String::new(), steps.iter());
    for line in said.by_ref() {
        let asks = line.ends_with("then press enter") || line.contains("type it") || line.starts_with("press enter to store");
        out += &(line + "\n");
        if !asks {
            continue;
        }
        match (steps.next(), &mut input) {
            (Some((deed, typed)), Some(input)) => {
                desk.swing(None);
                match *deed {
                    Do::Hand(hand) => desk.hand(hand),
                    Do::Swing(grams) => desk.swing(Some((grams, 0.3))),
                }
                std::thread::sleep(Duration::from_millis(250));
                if writeln!(input, "{typed}").is_err() {
                    break;
                }
            }
            _ => drop(input.take()), // the operator goes away
        }
    }
    drop(input);
    let output = child.wait_with_output().expect("it ends");
    Said { out, ..Said::new(&words, output) }
}

fn hang(grams: f64) -> Do {
    Do::Hand(Hand::Hang(grams))
}

fn read(folder: &Path, desk: &Desk) -> String {
    call(folder, &["rig", "--port", &desk.port, "configure", "--read"]).succeeded().out
}

/// The number behind `key = ` in the section `[name]`.
fn number(text: &str, section: &str, key: &str) -> f64 {
    let section = text.split_once(section).unwrap_or_else(|| panic!("no {section} in {text}")).1;
    let line = section.lines().find_map(|l| l.strip_prefix(key)).unwrap_or_else(|| panic!("no {key} in {section}"));
    line.trim_start_matches([' ', '=']).parse().unwrap_or_else(|e| panic!("{line}: {e}"))
}

/// The mean of a column of a log.
fn mean(log: &Path, column: &str) -> f64 {
    let text = std::fs::read_to_string(log).expect("a log");
    let mut lines = text.lines().skip_while(|l| l.starts_with('#'));
    let place = lines.next().expect("a header").split(',').position(|n| n == column).unwrap_or_else(|| panic!("{column}"));
    let values: Vec<f64> = lines.filter_map(|l| l.split(',').nth(place)?.parse().ok()).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

/// Masses on the load cell: the scale is right within its own errors, stored, told, in the head of the log, and what is read with it is the
/// mass that hangs there.
#[test]
fn masses_put_on_one_after_the_other_become_the_load_cells_scale() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Clean);
    let words = ["loadcell", "--points", "0 g, 150 g, 300 g, 150 g, 0 g", "--date", "2026-11-24", "-o", "cal.toml"];
    let steps: Vec<Step<'_>> = [0.0, 150.0, 300.0, 150.0, 0.0, 0.0].iter().map(|g| (hang(*g), "")).collect();
    let said = guided(folder.path(), &desk, &words, &steps).succeeded();
    println!("{}", said.out);
    assert!(said.out.contains("of 5 points") && said.out.contains("in force and stored"), "{}", said.out);

    let stored = read(folder.path(), &desk);
    let of = |key: &str| number(&stored, "[calibrated.thrust]", key);
    // the bench's bridge: 231.37 g a volt after the amplifier, half of it at the converter (errata 5.35)
    let wanted = -231.37e-3 * G * 2.0 * 3.3 / 4096.0;
    let (gain, sigma) = (of("per_count "), of("per_count_sigma"));
    assert!((gain / wanted - 1.0).abs() < 2e-3 && (gain - wanted).abs() < 5.0 * sigma, "{gain} +- {sigma}, wanted {wanted}");
    assert!(of("residual") < 0.01 && of("worst") < 0.02 && of("zero_sigma") < 2.0 && of("points") == 5.0, "{stored}");
    assert!(stored.contains("date = \"2026-11-24\""), "{stored}");
    let file = std::fs::read_to_string(folder.path().join("cal.toml")).expect("a file");
    assert!(file.starts_with("# quadrig-rig-calibration 1\n") && file.contains("# 300 g"), "{file}");

    let status = call(folder.path(), &["rig", "--port", &desk.port, "status"]).succeeded().out;
    println!("{status}");
    assert!(status.contains("5 points, residuals") && status.contains("2026-11-24"), "{status}");
    assert!(status.contains("jitter       ticks 1000.00 to 1000.00 us") && status.contains("index        0 marks"), "{status}");

    desk.hand(Hand::Hang(0.0));
    std::thread::sleep(Duration::from_millis(250));
    call(folder.path(), &["rig", "--port", &desk.port, "tare"]).succeeded();
    desk.hand(Hand::Hang(250.0));
    std::thread::sleep(Duration::from_millis(250));
    call(folder.path(), &["log", "--port", &desk.port, "-o", "run.csv", "--seconds", "1.5", "--motor", "570KV", "--raw"])
        .succeeded();
    let read = mean(&folder.path().join("run.csv"), "thrust_n");
    assert!((read + 0.25 * G).abs() < 0.01, "{read} N of 250 g");
    let log = std::fs::read_to_string(folder.path().join("run.csv")).expect("a log");
    let head: Vec<&str> = log.lines().filter(|l| l.starts_with("# calibration_thrust_n")).collect();
    let holds = |word: &str| head.len() == 1 && head[0].contains(word);
    assert!(
        ["date = \"2026-11-24\"", "residual = ", "source = \"calibrated\"", "points = 5"].iter().all(|w| holds(w)),
        "{head:?}"
    );
    assert!(
        log.contains("# rig_config = ") && log.contains("# motor = \"570KV\"") && log.contains("raw_thrust_n_sum"),
        "{log:.900}"
    );
}

/// A saturated channel, one that hangs at its amplifier's rail and a swinging one become no calibration, each said in one line; and where the
/// operator goes away or says no, nothing is stored.
#[test]
fn what_is_saturated_or_swings_is_refused_and_nothing_is_stored() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Clean);
    let before = read(folder.path(), &desk);
    let tried = |points: &str, steps: &[Step<'_>], words: &[&str]| {
        let said = guided(folder.path(), &desk, &["loadcell", "--points", points], steps);
        assert_eq!(said.status, Some(1), "{points}: {}{}", said.out, said.err);
        for word in words {
            assert!(said.err.contains(word), "{points}: {word:?} is not in {}", said.err);
        }
        said.out
    };
    let lifted = Do::Hand(Hand::Hang(-900.0)); // the other end of the converter
    tried("0 g, -900 g", &[(hang(0.0), ""), (lifted, "")], &["thrust_n, -900 g: the channel is ", "nothing was stored"]);
    tried("0 g, 200 g", &[(hang(0.0), ""), (Do::Swing(200.0), "")], &["thrust_n, 200 g: not settled", "nothing was stored"]);
    let rail: Vec<Step<'_>> = [0.0, 150.0, 300.0, 600.0].iter().map(|g| (hang(*g), "")).collect();
    tried("0 g, 150 g, 300 g, 600 g", &rail, &["of the range off the line"]);
    let said = tried("0 g, 200 g", &[(hang(0.0), ""), (hang(200.0), ""), (hang(0.0), "no")], &["nothing was stored"]);
    assert!(said.contains("two points: no residual"), "{said}");
    assert_eq!(read(folder.path(), &desk), before);
}

/// The other channels: torque by masses on the arm, current and voltage against a meter; values as the operator types them.
#[test]
fn every_other_channel_is_calibrated_by_its_own_values() {
    type Case = (&'static str, [(&'static str, fn(f64) -> Hand, f64); 3], f64);
    let cases: [Case; 3] = [
        (
            "torque",
            [("0 g", Hand::Twist, 0.0), ("100 g", Hand::Twist, 0.1 * 0.15 * G), ("200 g", Hand::Twist, 0.2 * 0.15 * G)],
            0.4,
        ),
        ("current", [("0 A", Hand::Draw, 0.0), ("5 A", Hand::Draw, 5.0), ("20 A", Hand::Draw, 20.0)], 20.0),
        ("voltage", [("9000 mV", Hand::Supply, 9.0), ("11", Hand::Supply, 11.0), ("12.6 V", Hand::Supply, 12.6)], 6.0),
    ];
    std::thread::scope(|scope| {
        for (channel, values, unit_per_volt) in cases {
            scope.spawn(move || {
                let folder = tempfile::tempdir().expect("a folder");
                let desk = Desk::new(Line::Clean);
                if channel == "voltage" {
                    desk.power_the_esc(); // or there is no supply to read
                }
                let mut steps: Vec<Step<'_>> =
                    values.iter().map(|(typed, hand, value)| (Do::Hand(hand(*value)), *typed)).collect();
                steps.push((Do::Hand(Hand::Draw(0.0)), ""));
                let said = guided(folder.path(), &desk, &[channel, "--arm", "0.15", "--yes"], &steps).succeeded();
                let stored = read(folder.path(), &desk);
                let of = |key: &str| number(&stored, &format!("[calibrated.{channel}]"), key);
                let (gain, wanted) = (of("per_count "), unit_per_volt * 3.3 / 4096.0);
                assert!((gain / wanted - 1.0).abs() < 3e-3, "{channel}: {gain} for {wanted}\n{}", said.out);
                assert!(of("points") == 3.0 && of("per_count_sigma") > 0.0, "{stored}");
            });
        }
    });
}

/// A staircase as `quadrig sim` records it, with the plant's own current as the meter; the scale that comes out is that of the bench, it goes
/// to the board, and an old log is read anew with it.
#[test]
fn a_recording_calibrates_and_an_old_log_is_read_anew() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let scenario = "seed = 5\nrest_s = 3.0\nschedule = { kind = \"staircase\", step_us = 250, hold_s = 4.0, top_us = 2000 }\n";
    std::fs::write(at.join("run.toml"), scenario).expect("a scenario");
    call(at, &["sim", "run.toml", "-o", "run.csv", "--truth", "truth.csv", "--raw"]).succeeded();
    let truth = std::fs::read_to_string(at.join("truth.csv")).expect("the truth");
    let rows: Vec<Vec<f64>> =
        truth.lines().skip(1).map(|l| l.split(',').map(|v| v.parse().unwrap_or(f64::NAN)).collect()).collect();
    let meter = |from: f64, to: f64| {
        let values: Vec<f64> = rows.iter().filter(|r| (from..=to).contains(&r[0])).map(|r| r[5]).collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let windows = [(4.0, 6.9), (8.5, 10.9), (12.5, 14.9), (16.5, 18.9), (20.5, 22.9)];
    let points: Vec<String> = windows.iter().map(|(a, b)| format!("{:.4} A@{a}..{b}", meter(*a, *b))).collect();
    let words =
        ["calibrate", "current", "-i", "run.csv", "--points", &points.join(", "), "--date", "2026-01-31", "-o", "cal.toml"];
    let said = call(at, &words).succeeded();
    println!("{}", said.out);
    let file = std::fs::read_to_string(at.join("cal.toml")).expect("a file");
    let gain = number(&file, "[calibrated.current]", "per_count ");
    assert!((gain / (20.0 * 3.3 / 4096.0) - 1.0).abs() < 5e-3, "{gain}");
    assert!(file.contains("date = \"2026-01-31\"") && number(&file, "[calibrated.current]", "points") == 5.0, "{file}");

    // to a board, alone and beside what it has
    let desk = Desk::new(Line::Clean);
    call(at, &["rig", "--port", &desk.port, "configure", "cal.toml"]).succeeded();
    assert!(read(at, &desk).contains("[calibrated.current]"));

    // an old log, read with a scale that is 10 % more and 5 counts off: what a better one is for
    let wrong = file.replace(&format!("per_count = {gain}"), &format!("per_count = {}", gain * 1.1));
    std::fs::write(at.join("wrong.toml"), wrong).expect("a file");
    let before = std::fs::read(at.join("run.csv")).expect("a log");
    call(at, &["recalibrate", "run.csv", "--with", "wrong.toml", "-o", "wrong.csv"]).succeeded();
    let (old, new) = (mean(&at.join("run.csv"), "current_a"), mean(&at.join("wrong.csv"), "current_a"));
    assert!((new / old - 1.1).abs() < 0.02, "{old} became {new}");
    call(at, &["recalibrate", "wrong.csv", "--with", "cal.toml", "-o", "right.csv"]).succeeded();
    let again = mean(&at.join("right.csv"), "current_a");
    assert!((again / old - 1.0).abs() < 0.01, "{old} came back as {again}");
    assert_eq!(std::fs::read(at.join("run.csv")).expect("a log"), before, "the old log is what it was");
    call(at, &["recalibrate", "right.csv", "--with", "cal.toml", "-o", "same.csv"]).refused(&["says nothing new"]);
    call(at, &["recalibrate", "run.csv", "--with", "cal.toml", "-o", "run.csv"])
        .refused(&["run.csv", "is an input of this command; expected another file for -o"]);
    call(at, &["sim", "run.toml", "-o", "plain.csv"]).succeeded();
    call(at, &["recalibrate", "plain.csv", "--with", "cal.toml", "-o", "x.csv"]).refused(&["raw_current_a_sum", "--raw"]);
    call(at, &["calibrate", "current", "-i", "run.csv", "--points", "1 A@6.5..8, 3 A@12.5..14.9", "-o", "x.toml"])
        .refused(&["1 A: "]);
    call(at, &["calibrate", "current", "-i", "run.csv", "--points", "1 g, 2 g", "-o", "x.toml"])
        .refused(&["no unit of current_a"]);
    assert!(!at.join("x.csv").exists() && !at.join("x.toml").exists());
    // the tare stays what it was in counts: a load cell read 5 % higher
    let text = "[calibrated.thrust]\nzero_counts = 1400\nper_count = -0.00385\nresidual = 0\nworst = 0\npoints = 2\n";
    std::fs::write(at.join("cell.toml"), text).expect("a file");
    let said = call(at, &["recalibrate", "run.csv", "--with", "cell.toml", "-o", "cell.csv"]).succeeded();
    assert!(said.out.contains("the tare stays"), "{}", said.out);
    let head = std::fs::read_to_string(at.join("cell.csv")).expect("a log");
    assert!(head.contains("# recalibrated = \"run.csv with cell.toml\""), "{head:.600}");
    let (old, new) = (mean(&at.join("run.csv"), "thrust_n"), mean(&at.join("cell.csv"), "thrust_n"));
    let ratio = 0.00385 / (231.37e-3 * G * 2.0 * 3.3 / 4096.0);
    assert!((new / old / ratio - 1.0).abs() < 2e-3, "{old} became {new}, expected {ratio} times");
}

/// What happened and what was flagged stands in the log, for people and for readers: a line of a speed sensor breaks in mid-run.
#[test]
fn a_log_keeps_what_happened_and_what_was_flagged() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let scenario = "seed = 5\nrest_s = 2.0\nschedule = { kind = \"staircase\", step_us = 250, hold_s = 4.0, top_us = 1500 }\n\
                    [[fault]]\nid = \"adc_stuck\"\nchannel = 1\nhigh = true\nfrom_s = 8.0\nuntil_s = 60.0\n";
    std::fs::write(at.join("run.toml"), scenario).expect("a scenario");
    call(at, &["sim", "run.toml", "-o", "run.csv"]).succeeded();
    let log = std::fs::read_to_string(at.join("run.csv")).expect("a log");
    let head: Vec<&str> = log.lines().filter(|l| l.starts_with('#')).collect();
    let event = |word: &str| {
        head.iter().find(|l| l.starts_with("# event = ") && l.contains(word)).unwrap_or_else(|| panic!("no {word} in {head:#?}"))
    };
    assert!(
        event("conversions lost").contains("conversions lost: torque_nm") && event("conversions lost").contains("\"8."),
        "{head:#?}"
    );
    event("state: armed to running");
    assert!(
        head.iter().any(|l| l.starts_with("# schedule = ")) && head.iter().any(|l| l.starts_with("# firmware = ")),
        "{head:#?}"
    );
    let columns: Vec<&str> = log.lines().find(|l| l.starts_with("t_s")).expect("a header").split(',').collect();
    let place = columns.iter().position(|n| *n == "torque_nm_flag").expect("a column of flags");
    let rows: Vec<Vec<&str>> = log.lines().filter(|l| !l.starts_with('#')).skip(1).map(|l| l.split(',').collect()).collect();
    let time = |row: &Vec<&str>| row[0].parse::<f64>().expect("a time");
    assert!(rows.iter().filter(|r| time(r) < 7.95).all(|r| r[place].is_empty()), "nominal before");
    assert!(rows.iter().filter(|r| time(r) > 8.2).all(|r| r[place] == "14"), "short from there on");
    // and the reader takes it
    let said = call(at, &["identify", "run.csv", "-o", "model.toml"]).succeeded();
    assert!(said.out.contains("torque_nm: short in") && said.out.contains("conversions lost: torque_nm"), "{}", said.out);
    let model = std::fs::read_to_string(at.join("model.toml")).expect("a model");
    assert!(!model.contains("rig_config") && !model.contains("calibration_"), "a model is no archive: {model:.400}");
}

/// A burst beside the running rotor: the spectrum shows the rotor's own frequency in the thrust.
#[test]
fn a_burst_shows_what_vibrates() {
    let folder = tempfile::tempdir().expect("a folder");
    let desk = Desk::new(Line::Clean);
    let burst = |words: &[&str]| call(folder.path(), &[&["rig", "--port", &desk.port, "burst"], words].concat());
    burst(&["noise"]).refused(&["no such channel", "thrust"]);
    let said = burst(&["current"]).succeeded();
    assert!(said.out.contains("24576 conversions at 8500.0") && said.out.contains("the rotor stands"), "{}", said.out);
    desk.swing(Some((100.0, 0.5))); // 0.49 N up and down, once in a second
    let said = burst(&["thrust", "-o", "burst.csv", "--spectrum", "lines.csv", "--to", "50"]).succeeded();
    println!("{}", said.out);
    let line = said.out.lines().find(|l| l.contains(" Hz ")).expect("a line stands out");
    let numbers: Vec<f64> = line.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    assert!((numbers[0] - 1.0).abs() < 0.1 && (numbers[1] - 0.49).abs() < 0.05, "{line}");
    let rows =
        std::fs::read_to_string(folder.path().join("burst.csv")).expect("a log").lines().filter(|l| !l.starts_with('#')).count();
    assert_eq!(rows, 24_577);
}
