//! What `quadrig isolability` says of a schedule holds when the simulator flies it with an effect.
//!
//! What it is: the sizes from which causes are named, against verdicts on simulated runs well above and well below them; a pair that is said
//! to be told apart late, against how sure verdicts are of one of the two; and the command's words, files and refusals.
//! What can go wrong: the simulator makes effects from first principles, the library describes them: sizes agree to a factor, not to a digit.
//! Units: as the parameters state.
//! Reference: docs/isolability.md; specification `closing-the-loop.md`, "What counts as proof".

use ident::close::close;
use ident::isolability::{Apart, Isolability, Standing, isolability};
use ident::log::Log;
use quadrig_tests::{call, cases};
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

/// A room that warms evenly: a plain staircase then shows time, load and heat rise together.
const WARMING: &str = "[[effect]]\nid = \"air_density\"\nroom_rate_k_per_s = 0.1\n";

#[test]
fn drifts_on_a_plain_staircase_are_told_apart_late_or_hidden() {
    let folder = TempDir::new().unwrap();
    let found = isolability(&flown(folder.path(), 2, UP, WARMING), &mut |_| {}).unwrap();
    let at = |name: &str| found.causes.iter().position(|c| c.name == name).unwrap_or_else(|| panic!("no cause {name}"));
    // most of it the declared model takes up, and what is left of it changing air leaves as well
    let hidden = found.standing(at("gain_change drift"));
    assert!(matches!(hidden, Standing::Hidden | Standing::Alike), "{hidden:?}");
    let drift = &found.causes[at("zero_drift")];
    let Apart::From(told) = &drift.apart[at("thermal_zero")] else { panic!("{:?}", drift.apart[at("thermal_zero")]) };
    let named = drift.seen.as_ref().unwrap();
    assert!(told.floors < 1.5 * named.floors, "named from {} floors, told apart from {}", named.floors, told.floors);

    // the verdict is sure of the drift well above that size, and not below it
    let seeds = 82..82 + cases(1, 3);
    let sure = |times: f64| -> usize {
        let table = format!("[[effect]]\nid = \"zero_drift\"\nrate_n_per_s = {:e}\n", times * told.quantity.value.abs());
        let runs: Vec<_> =
            seeds.clone().map(|seed| verdict(&flown(folder.path(), seed, UP, &format!("{WARMING}{table}")))).collect();
        println!("{times} times the size from which it is told apart: {runs:?}");
        runs.iter().filter(|(names, kind)| kind == "Attributed" && names.iter().any(|n| n == "zero_drift")).count()
    };
    let (below, above) = (sure(0.7), sure(3.5));
    let runs = seeds.len();
    assert!(3 * below <= runs && 3 * above >= 2 * runs, "sure of the drift in {below} of {runs} below, {above} of {runs} above");

    // levels held for four seconds tell a drift from a shift late
    let hurried = isolability(&flown(folder.path(), 2, &UP.replace("hold_s = 6", "hold_s = 4"), WARMING), &mut |_| {}).unwrap();
    let cause = |name: &str| hurried.causes.iter().position(|c| c.name == name).unwrap_or_else(|| panic!("no cause {name}"));
    let drift = &hurried.causes[cause("zero_drift")];
    let Apart::From(late) = &drift.apart[cause("tare_shift")] else { panic!("{:?}", drift.apart[cause("tare_shift")]) };
    let named = drift.seen.as_ref().unwrap();
    assert!(late.floors > 1.5 * named.floors, "named from {} floors, told apart from {}", named.floors, late.floors);

    // what is hidden is not found surely at the size at which its exact form would be
    let rate = size(&found, "gain_change drift").0;
    let gain = format!("[[effect]]\nid = \"gain_change\"\nrate_per_s = {rate:e}\n");
    let runs: Vec<_> = seeds.map(|seed| verdict(&flown(folder.path(), seed, UP, &format!("{WARMING}{gain}")))).collect();
    println!("a hidden drift of the gain: {runs:?}");
    let sure = runs.iter().filter(|(names, kind)| kind == "Attributed" && names.iter().any(|n| n == "gain_change")).count();
    assert!(sure < runs.len(), "{runs:?}");
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
    // its one script copies tables; the matrix is in the page's own letters, as a drawing in a file of its own
    let scripts = page.matches("<script").count();
    assert!(scripts == 1 && page.contains("<script>if(navigator.clipboard)") && !page.contains("http-equiv"));
    assert!(page.contains("class=\"matrix\"") && !page.contains("href=\"http") && read("a/matrix.svg").contains("<svg"));
    assert!(page.contains(&ident::log::digest(SHORT.as_bytes())), "the page says from which scenario");
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
