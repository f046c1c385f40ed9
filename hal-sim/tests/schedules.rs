//! Schedule files, flown natively: the pulses are those of the file to the nanosecond, however long it is.

use esc_pwm::{Played, Slew, Track};
use frame::message::Event;
use frame::rig::RigState;
use frame::schedule::{BATCH, Segment, SegmentBatch};
use frame::units::PulseWidth;
use hal_sim::native::{SimError, run};
use hal_sim::{RunRecord, Scenario};
use schedule::Plan;
use std::path::Path;
use tempfile::TempDir;

/// A scenario in a folder with its schedule file.
fn scenario(folder: &TempDir, schedule: &str, more: &str) -> Scenario {
    std::fs::write(folder.path().join("plan.toml"), schedule).unwrap();
    let text = format!("schedule = {{ kind = \"file\", file = \"plan.toml\" }}\n{more}");
    Scenario::parse(&text, &folder.path().join("run.toml")).unwrap_or_else(|e| panic!("{e}"))
}

fn flown(scenario: &Scenario) -> RunRecord {
    run(scenario, None, &mut |_| {}).unwrap_or_else(|e| panic!("{e}"))
}

/// When the board began to play, ms.
fn began(record: &RunRecord) -> u64 {
    let running = record.events.iter().find_map(|e| match e {
        Event::State { to: RigState::Running, at, .. } => Some(at.as_ms()),
        _ => None,
    });
    running.expect("it ran")
}

/// What the segments give with the board's slew limit, a pulse a millisecond; a track that knows no end of memory.
fn expected(segments: &[Segment]) -> Vec<PulseWidth> {
    let slew = Slew { ns_per_ms: 10_000 };
    let (mut track, mut sent) = (Track::new(), 0usize);
    let mut feed = |track: &mut Track| {
        while sent < segments.len() && usize::from(track.room()) >= BATCH {
            let batch = SegmentBatch::of(sent as u32, &segments[sent..]);
            track.take(batch.first, batch.segments().unwrap(), batch.last).unwrap();
            sent += usize::from(batch.count);
        }
    };
    feed(&mut track);
    track.start();
    let mut now = PulseWidth::MIN;
    let mut pulses = Vec::new();
    for ms in 0.. {
        feed(&mut track);
        match track.at(ms) {
            Played::Pulse(target) => now = slew.toward(now, target, 1),
            Played::Over => break,
            Played::Dry => panic!("the test feeds it"),
        }
        pulses.push(now);
    }
    pulses
}

/// Every sample between the schedule's ends shows the pulse of its millisecond.
fn follows(record: &RunRecord, plan: &Plan) {
    let pulses = expected(plan.segments());
    let begin = began(record);
    let mut compared = 0;
    for sample in record.samples.iter().filter(|s| s.at.as_ms() >= begin) {
        let ms = (sample.at.as_ms() - begin) as usize;
        let pulse = pulses.get(ms).copied().unwrap_or(PulseWidth::MIN);
        assert_eq!(sample.pulse, pulse, "{ms} ms after the beginning");
        compared += usize::from(ms < pulses.len());
    }
    assert!(compared > pulses.len() / 25, "{compared} samples of {} ms", pulses.len());
    assert!(record.events.iter().any(|e| matches!(e, Event::ScheduleDone { .. })), "{:?}", record.events);
}

const EVERYTHING: &str = r#"
name = "everything that needs no host"

[[part]]
kind = "staircase"
step_us = 100
top_us = 1400
hold_s = 0.3
down = true
visits = 2

[[part]]
kind = "ramp"
from_us = 1100
to_us = 1500
length_s = 1.0

[[part]]
kind = "steps"
steps = [{ pulse_us = 1200, hold_s = 0.4 }, { pulse_us = 1450.5, hold_s = 0.5, ramp = true }]

[[part]]
kind = "step"
before_us = 1200
after_us = 1600
hold_s = 0.5

[[part]]
kind = "chirp"
centre_us = 1400
amplitude_us = 60
from_hz = 0.5
to_hz = 6
length_s = 4.0

[[part]]
kind = "visits"
levels_us = [1300, 1500, 1250]
between_us = 1200
between_s = 0.2
hold_s = 0.3
times = 2

[[part]]
kind = "hold"
pulse_us = 1350
hold_s = 0.25

[[part]]
kind = "endurance"
pulse_us = 1300
length_s = 1.5
"#;

const FAST: &str = "[log]\nrate_hz = 100\n";

#[test]
fn every_part_that_needs_no_host_is_followed_exactly() {
    let folder = TempDir::new().unwrap();
    let scenario = scenario(&folder, EVERYTHING, FAST);
    let plan = Plan::read(&folder.path().join("plan.toml")).unwrap();
    assert_eq!(plan.places().len(), 8);
    follows(&flown(&scenario), &plan);
}

/// A log's pulses at 100 Hz are twenty times what fits into the board.
#[test]
fn a_replay_is_streamed_and_followed_exactly() {
    let folder = TempDir::new().unwrap();
    let mut log = String::from("# quadrig-flight 1\nt_s,pulse_us_1,pulse_us_2\n");
    let mut row = |n: u32, text: &str| log.push_str(&format!("{:.3},1000,{text}\n", 3.0 + f64::from(n) * 0.01));
    for n in 0..2500 {
        let pulse = 1400.0 + 150.0 * (f64::from(n) * 0.037).sin() + f64::from(n % 7);
        let text = if n % 50 == 3 { String::new() } else { format!("{pulse:.1}") };
        row(n, &text);
    }
    std::fs::write(folder.path().join("flight.csv"), log).unwrap();
    let part = "[[part]]\nkind = \"replay\"\nfile = \"flight.csv\"\ncolumn = \"pulse_us_2\"\nfrom_s = 4.0\nuntil_s = 26.0\n";
    let scenario = scenario(&folder, part, FAST);
    let plan = Plan::read(&folder.path().join("plan.toml")).unwrap();
    assert!(plan.segments().len() > 2000 && (plan.longest_s() - 22.01).abs() < 0.011, "{}", plan.summary());
    follows(&flown(&scenario), &plan);
    // and as a kind of its own in the scenario
    let text = "schedule = { kind = \"replay\", file = \"flight.csv\", column = \"pulse_us_2\", from_s = 4.0, until_s = 8.0 }\n";
    let scenario = Scenario::parse(&format!("{text}{FAST}"), &folder.path().join("run.toml")).unwrap();
    follows(&flown(&scenario), &scenario.schedule.plan().unwrap());
}

#[test]
fn a_chirp_in_a_scenario_is_the_chirp_of_the_board() {
    let text = "schedule = { kind = \"chirp\", centre_us = 1400, amplitude_us = 60, from_hz = 0.5, to_hz = 6, length_s = 4 }\n";
    let scenario = Scenario::parse(&format!("{text}{FAST}"), Path::new("run.toml")).unwrap();
    assert_eq!(scenario.run_s(), 8.0);
    let same = "[[part]]\nkind = \"chirp\"\ncentre_us = 1400\namplitude_us = 60\nfrom_hz = 0.5\nto_hz = 6\nlength_s = 4\n";
    follows(&flown(&scenario), &Plan::parse(same, Path::new("x.toml")).unwrap());
    for (bad, word) in [("amplitude_us = 700", "at most 400"), ("to_hz = 101", "0 to 100 Hz"), ("lenght_s = 3", "lenght_s")] {
        let key = bad.split(' ').next().unwrap();
        let text = text.split(", ").map(|part| if part.starts_with(key) { bad.to_owned() } else { part.to_owned() });
        let mut text = text.collect::<Vec<_>>().join(", ");
        if key == "lenght_s" {
            text = text.replace("length_s = 4", bad);
        }
        let said = Scenario::parse(&text, Path::new("run.toml")).unwrap_err().to_string();
        assert!(said.starts_with("run.toml:1:") && said.contains(word), "{said}");
    }
}

#[test]
fn more_steps_than_fit_are_streamed() {
    let steps: Vec<String> =
        (0..400).map(|n| format!("{{ pulse_us = {}, hold_s = 0.03, ramp = {} }}", 1200 + 7 * (n % 30), n % 3 == 0)).collect();
    let text = format!("schedule = {{ kind = \"steps\", steps = [{}] }}\n{FAST}", steps.join(", "));
    let scenario = Scenario::parse(&text, Path::new("run.toml")).unwrap();
    follows(&flown(&scenario), &scenario.schedule.plan().unwrap());
}

/// The level is left as soon as the speed has settled: long before the part's end, and not before its window.
#[test]
fn a_wait_until_settled_ends_when_it_has() {
    let folder = TempDir::new().unwrap();
    let part = |within: f64, [over, most]: [f64; 2], otherwise: &str| {
        format!(
            "[[part]]\nkind = \"settle\"\npulse_us = 1600\nwithin_percent = {within}\nover_s = {over}\nat_most_s = {most}\n\
             otherwise = \"{otherwise}\"\n[[part]]\nkind = \"hold\"\npulse_us = 1200\nhold_s = 1\n"
        )
    };
    let record = flown(&scenario(&folder, &part(0.5, [1.0, 20.0], "stop"), FAST));
    let at = |us: u32| record.samples.iter().filter(|s| s.pulse == PulseWidth::from_us(us)).count() as f64 / 100.0;
    assert!((1.0..4.0).contains(&at(1600)), "{} s", at(1600));
    assert!((0.9..1.1).contains(&at(1200)), "{} s", at(1200));
    // half a second from rest: the rotor is still on its way
    let ended = run(&scenario(&folder, &part(0.1, [0.2, 0.5], "stop"), FAST), None, &mut |_| {}).map(|record| record.events);
    assert!(matches!(&ended, Err(SimError::Schedule { reason }) if reason.contains("rpm did not settle")), "{ended:?}");
    let record = flown(&scenario(&folder, &part(0.1, [0.2, 0.5], "go-on"), FAST));
    assert!(record.events.iter().any(|e| matches!(e, Event::ScheduleDone { .. })));
}

#[test]
fn thrust_and_speed_are_kept_by_the_hosts_slow_loop() {
    let folder = TempDir::new().unwrap();
    let text = "[[part]]\nkind = \"thrust\"\nthrust_n = 2.9\nstart_us = 1500\nlow_us = 1200\nhigh_us = 1800\nlength_s = 20\n\
                [[part]]\nkind = \"speed\"\nspeed_rpm = 3000\nstart_us = 1500\nhigh_us = 1800\nlength_s = 20\n";
    let record = flown(&scenario(&folder, text, ""));
    let begin = began(&record) as f64 * 1e-3 - record.start.as_s();
    let mean = |from: f64, value: &dyn Fn(usize) -> f64| {
        let rows: Vec<_> = record.converted().map(|r| r.t_s).collect();
        let at: Vec<usize> = (0..rows.len()).filter(|&i| (from..from + 9.0).contains(&(rows[i] - begin))).collect();
        at.iter().map(|i| value(*i)).sum::<f64>() / at.len() as f64
    };
    let rows: Vec<_> = record.converted().collect();
    let thrust = mean(10.5, &|i| rows[i].adc[0].unwrap());
    let speed = mean(30.5, &|i| rows[i].rpm[3].unwrap());
    println!("{thrust:.4} N for 2.9, {speed:.1} rev/min for 3000");
    assert!((thrust - 2.9).abs() < 0.01 && (speed - 3000.0).abs() < 5.0);
}

/// What the loop may do is bounded by the file, whatever it wishes.
#[test]
fn the_slow_loop_never_leaves_its_bounds() {
    let folder = TempDir::new().unwrap();
    let text = "[[part]]\nkind = \"thrust\"\nthrust_n = 50\nstart_us = 1300\nlow_us = 1250\nhigh_us = 1420\nlength_s = 8\n";
    let record = flown(&scenario(&folder, text, FAST));
    let most = record.samples.iter().map(|s| s.pulse).max().unwrap();
    assert_eq!(most, PulseWidth::from_us(1420));
}

#[test]
fn an_endurance_run_ends_at_the_supplys_limit() {
    let folder = TempDir::new().unwrap();
    let text = "[[part]]\nkind = \"endurance\"\npulse_us = 1700\nlength_s = 600\nuntil_voltage_v = 11.6\n";
    let supply = "supply = { kind = \"lipo\", cells = 3, capacity_ah = 0.2, resistance_ohm = 0.02 }\n";
    let record = flown(&scenario(&folder, text, supply));
    let rows: Vec<_> = record.converted().collect();
    let last = rows.iter().rev().find(|r| r.pulse_us > 1600.0).unwrap();
    let (v, t) = (last.adc[3].unwrap(), last.t_s);
    println!("{v:.2} V after {t:.0} s");
    assert!((11.4..11.65).contains(&v) && t > 20.0 && t < 500.0);
}

/// The next experiment of a verdict, as it is.
#[test]
fn a_verdicts_next_experiment_is_flown_as_it_is() {
    let folder = TempDir::new().unwrap();
    let verdict = r#"{"format": "quadrig-verdict 2", "verdict": "ambiguous", "next_experiment":
        {"why": "quick steps", "schedule": [{"pulse_us": 1200, "hold_s": 1.5}, {"pulse_us": 1500.0, "hold_s": 2}]}}"#;
    std::fs::write(folder.path().join("verdict.json"), verdict).unwrap();
    let text = format!("schedule = {{ kind = \"file\", file = \"verdict.json\" }}\n{FAST}");
    let scenario = Scenario::parse(&text, &folder.path().join("run.toml")).unwrap();
    assert_eq!(scenario.run_s(), 7.5);
    follows(&flown(&scenario), &Plan::next_experiment(&folder.path().join("verdict.json")).unwrap());
}
