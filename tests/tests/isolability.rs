//! What `quadrig isolability` says of a schedule holds when the simulator flies it with an effect.
//!
//! What it is: the sizes from which causes are named, against verdicts on simulated runs well above and well below them; a pair that is said
//! to be alike, against the verdict on a run that holds one of the two; and the command's words, files and refusals.
//! What can go wrong: the simulator makes effects from first principles, the library describes them: sizes agree to a factor, not to a digit.
//! Units: as the parameters state.
//! Reference: docs/isolability.md; specification `closing-the-loop.md`, "What counts as proof".

use ident::close::close;
use ident::isolability::{Isolability, Standing, isolability};
use ident::log::Log;
use quadrig_tests::call;
use std::path::Path;
use tempfile::TempDir;

const UP_DOWN: &str =
    "schedule = { kind = \"up_down\", step_us = 100, hold_s = 4, top_us = 2000 }\n[sensors]\nfitted = [\"opto\"]\n";
const UP: &str =
    "schedule = { kind = \"staircase\", step_us = 100, hold_s = 6, top_us = 2000 }\n[sensors]\nfitted = [\"opto\"]\n";

/// A run of the simulated rig.
fn flown(folder: &Path, seed: u32, rig: &str, effect: &str) -> Log {
    std::fs::write(folder.join("rig.toml"), format!("seed = {seed}\n{rig}{effect}")).unwrap();
    call(folder, &["--quiet", "sim", "rig.toml", "-o", "run.csv"]).succeeded();
    Log::read(&folder.join("run.csv")).unwrap()
}

/// The names of a verdict, and its kind.
fn verdict(log: &Log) -> (Vec<String>, String) {
    let closed = close(log, None, &[], &mut |_| {}).unwrap();
    let names = closed.verdict.effects.iter().map(|e| e.id.clone()).filter(|id| id != "unknown").collect();
    (names, format!("{:?}", closed.verdict.verdict))
}

/// The size from which on a cause is named, in its own unit, and where it was held.
fn size(found: &Isolability, name: &str) -> (f64, f64) {
    let cause = found.causes.iter().find(|c| c.name == name).unwrap_or_else(|| panic!("no cause {name}"));
    let seen = cause.seen.as_ref().unwrap_or_else(|| panic!("{name} is named at no size"));
    (seen.quantity.value.abs(), cause.held.first().map_or(0.0, |h| h.value))
}

/// Causes that the simulator can make at any size: name in the matrix, identifier, and the table of the effect.
const TRIED: [(&str, &str, &str); 6] = [
    ("tare_shift", "tare_shift", "offset_n = SIZE\nt0_s = HELD"),
    ("gain_change step", "gain_change", "gain_change = SIZE\nt0_s = HELD"),
    ("zero_drift", "zero_drift", "rate_n_per_s = SIZE"),
    ("hysteresis", "hysteresis", "width_n = SIZE"),
    ("supply_sag", "supply_sag", "resistance_ohm = SIZE"),
    ("bearing_friction", "bearing_friction", "constant_nm = SIZE\nt0_s = HELD"),
];

/// Times the predicted size at which nearly every run must be named, and at which hardly any may be.
const ABOVE: f64 = 2.5;
const BELOW: f64 = 0.4;

#[test]
fn a_cause_is_named_above_its_size_and_not_far_below() {
    let folder = TempDir::new().unwrap();
    let found = isolability(&flown(folder.path(), 1, UP_DOWN, ""), &mut |_| {}).unwrap();
    let mut account = String::new();
    let (mut above, mut below, mut runs) = (0, 0, 0);
    for (name, id, table) in TRIED {
        let (at, held) = size(&found, name);
        account += &format!("{name} from {at:.3e}:");
        for seed in [71, 72] {
            let named = |times: f64| {
                let table = table.replace("SIZE", &format!("{:e}", times * at)).replace("HELD", &format!("{held}"));
                verdict(&flown(folder.path(), seed, UP_DOWN, &format!("[[effect]]\nid = \"{id}\"\n{table}\n"))).0
            };
            let [high, low] = [ABOVE, BELOW].map(named);
            runs += 1;
            above += usize::from(high.iter().any(|n| n == id));
            below += usize::from(low.iter().any(|n| n == id));
            account += &format!(" above {} below {};", high.join("+"), low.join("+"));
        }
        account += "\n";
    }
    println!("{above} of {runs} named above, {below} below\n{account}");
    assert!(above * 10 >= runs * 9 - 5, "{above} of {runs} named at {ABOVE} times their size\n{account}");
    assert!(below * 10 <= runs, "{below} of {runs} named at {BELOW} times their size\n{account}");
}

#[test]
fn drifts_on_a_plain_staircase_are_said_to_be_alike_or_hidden_and_are() {
    let folder = TempDir::new().unwrap();
    let found = isolability(&flown(folder.path(), 2, UP, ""), &mut |_| {}).unwrap();
    let standing = |name: &str| {
        let k = found.causes.iter().position(|c| c.name == name).unwrap_or_else(|| panic!("no cause {name}"));
        found.standing(k)
    };
    assert_eq!(standing("gain_change drift"), Standing::Hidden);
    assert_eq!(standing("zero_drift"), Standing::Alike);
    let group = found.groups.iter().map(|g| found.members(g)).find(|m| m.contains("zero_drift")).unwrap();
    assert!(group.contains("thermal_zero"), "{group}");
    assert!(found.groups.iter().any(|g| g.next.as_ref().is_some_and(|n| !n.schedule.is_empty())));

    // four times the size at which each would be named alone
    let rate = 4.0 * size(&found, "zero_drift").0;
    let warm = format!(
        "[[effect]]\nid = \"thermal_zero\"\nrise_k_per_w = 0.0\ntau_s = 60.0\nambient_rate_k_per_s = 0.02\ncoefficient_n_per_k = {:e}\n",
        rate / 0.02
    );
    let (names, kind) = verdict(&flown(folder.path(), 81, UP, &warm));
    println!("thermal_zero: {names:?} {kind}");
    assert!(kind == "Ambiguous" || !names.iter().any(|n| n == "thermal_zero"), "{names:?} {kind}");
    let drift = format!("[[effect]]\nid = \"gain_change\"\nrate_per_s = {:e}\n", 2.0 * size(&found, "gain_change drift").0);
    let runs: Vec<_> = (82..85).map(|seed| verdict(&flown(folder.path(), seed, UP, &drift))).collect();
    println!("gain_change drift: {runs:?}");
    assert!(runs.iter().filter(|r| r.1 == "Attributed" && r.0 == ["gain_change"]).count() < runs.len(), "{runs:?}");
}

const SHORT: &str = "seed = 3\nschedule = { kind = \"up_down\", step_us = 250, hold_s = 4, top_us = 2000 }\n[sensors]\nfitted = [\"opto\"]\n[log]\nrate_hz = 5\n[[effect]]\nid = \"creep\"\namplitude = 0.05\ntau_s = 20.0\n";

#[test]
fn the_command_says_shows_and_writes_the_matrix() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("rig.toml"), SHORT).unwrap();
    let said = call(folder.path(), &["isolability", "rig.toml", "-o", "a"]).succeeded().out;
    assert!(said.starts_with("flown without what it hides: creep\n"), "{said}");
    assert!(said.contains("can be named and told apart from every other one"), "{said}");
    assert!(said.lines().all(|l| l.chars().count() <= 100), "{said}");
    call(folder.path(), &["--quiet", "isolability", "rig.toml", "-o", "b"]).succeeded();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    for name in ["isolability.html", "matrix.svg", "matrix.csv"] {
        assert_eq!(read(&format!("a/{name}")), read(&format!("b/{name}")), "{name}");
    }
    let page = read("a/isolability.html");
    assert!(page.contains("<svg") && !page.contains("http-equiv") && !page.contains("<script") && !page.contains("href=\"http"));
    let csv = read("a/matrix.csv");
    let widths: Vec<usize> = csv.lines().map(|l| l.split(',').count()).collect();
    assert!(widths.len() > 10 && widths.iter().all(|w| *w == widths.len() + 7), "{csv}");
}

#[test]
fn what_is_no_run_of_the_rig_is_refused_in_one_line() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("board.toml"), "[imu]\n").unwrap();
    std::fs::write(folder.path().join("head.csv"), "t_s,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n").unwrap();
    call(folder.path(), &["isolability", "board.toml"]).refused(&["board.toml", "expected a scenario of the rig"]);
    call(folder.path(), &["isolability", "head.csv"]).refused(&["head.csv", "expected a rig log or a scenario"]);
    call(folder.path(), &["isolability", "none.csv"]).refused(&["none.csv"]);
}
