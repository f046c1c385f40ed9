//! `quadrig history`: the runs of one rig, what changed between which of them, and what is no history.
//!
//! What it is: the built program on six runs of the simulated rig with a change and on six without; dated runs, exports, files that are no
//! runs, and refusals.
//! What can go wrong: a change that is found elsewhere or not at all, one that is found where there is none, a file that stops the others.
//! Units: as the columns state.
//! Reference: docs/book/how-to/history.md.

use quadrig_tests::{Said, call};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

/// Seeds of the runs; from the fifth on the lead may be bad.
const SEEDS: std::ops::RangeInclusive<u32> = 1..=6;
const FIRST_BAD: u32 = 5;
const FILES: [&str; 3] = ["history.csv", "history.json", "report.html"];

/// A folder `runs` of six runs of a rig, and a folder `alike` of six without the change.
fn flown() -> &'static Path {
    static MADE: OnceLock<TempDir> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = TempDir::new().unwrap();
        for (name, bad_ohm) in [("runs", 0.08), ("alike", 0.05)] {
            fs::create_dir(folder.path().join(name)).unwrap();
            for seed in SEEDS {
                let ohm = if seed < FIRST_BAD { 0.05 } else { bad_ohm };
                let text = format!(
                    "seed = {seed}\nmotor = \"570KV\"\nschedule = {{ kind = \"staircase\", step_us = 100, hold_s = 6, top_us = 2000 }}\n\
                     [[effect]]\nid = \"supply_sag\"\nresistance_ohm = {ohm}\n"
                );
                fs::write(folder.path().join("s.toml"), text).unwrap();
                call(folder.path(), &["--quiet", "sim", "s.toml", "-o", &format!("{name}/run{seed}.csv")]).succeeded();
            }
        }
        folder
    })
    .path()
}

/// A folder of a test's own with copies of the runs, each through a change of its text.
fn changed(of: &str, change: impl Fn(u32, String) -> String) -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("runs")).unwrap();
    for seed in SEEDS {
        let text = fs::read_to_string(flown().join(format!("{of}/run{seed}.csv"))).unwrap();
        fs::write(folder.path().join(format!("runs/run{seed}.csv")), change(seed, text)).unwrap();
    }
    folder
}

fn json(said: &Said) -> Value {
    serde_json::from_str(&said.out).expect("JSON and nothing else")
}

#[test]
fn a_change_is_found_in_its_gap_and_has_its_name() {
    let folder = TempDir::new().unwrap();
    let runs = flown().join("runs");
    let runs = runs.to_str().unwrap();
    let said = call(folder.path(), &["history", runs, "-o", "out"]).succeeded();
    assert!(
        said.out.starts_with("6 runs, one change. Between run 4 and run 5: the resistance of the supply went from"),
        "{}",
        said.out
    );
    assert!(said.out.lines().all(|l| l.chars().count() <= 100), "{}", said.out);
    assert_eq!(said.err, "");

    let files = FILES.map(|name| fs::read(folder.path().join("out").join(name)).unwrap());
    let told: Value = serde_json::from_slice(&files[1]).unwrap();
    let change = &told["changes"][0];
    assert_eq!((&change["first"], &change["kind"], &change["names"][0]["id"]), (&4.into(), &"step".into(), &"supply_sag".into()));
    let ohm = change["moved"].as_array().unwrap().iter().find(|m| m["name"] == "voltage_v resistance").expect("the lead moved");
    let ends = [0, 1].map(|k| ohm["ci95"][k].as_f64().unwrap());
    assert!(ends[0] < 0.03 && 0.03 < ends[1] && ends[1] - ends[0] < 0.003, "{ohm}");

    let table = String::from_utf8(files[0].clone()).unwrap();
    let of_first: Vec<&str> = table.lines().filter(|l| l.starts_with("run1.csv,")).collect();
    assert_eq!(table.lines().next(), Some("run,day,measure,unit,value,se,low95,high95"));
    assert!(of_first.iter().any(|l| l.contains(",k_T,N.s2,1.")) && of_first.len() > 30, "{of_first:?}");

    let page = String::from_utf8(files[2].clone()).unwrap();
    assert!(
        page.contains("<h1>Between run 4 and run 5: the resistance of the supply went from")
            && page.contains("id=\"chart-voltage-v-resistance\"")
    );

    // the same bytes again, over the earlier results
    let again = call(folder.path(), &["history", runs, "-o", "out"]).succeeded();
    assert_eq!(again.out, said.out);
    assert_eq!(FILES.map(|name| fs::read(folder.path().join("out").join(name)).unwrap()), files);
}

#[test]
fn runs_alike_show_no_change() {
    let said = call(flown(), &["history", "alike", "--json"]).succeeded();
    let told = json(&said);
    assert_eq!(told["changes"].as_array().map(Vec::len), Some(0), "{}", told["changes"]);
    assert!(told["summary"].as_str().unwrap().starts_with("No change was found over 6 runs"), "{}", told["summary"]);
    // of six runs none can lie outside limits that all of them make
    let charts = told["charts"].as_array().unwrap();
    assert!(!charts.is_empty() && charts.iter().all(|c| c["low"].is_null() && c["high"].is_null() && c["centre"].is_number()));
}

/// Days in the heads order the runs, whatever the files are called, and name the gap.
#[test]
fn dated_runs_stand_in_the_order_of_their_days() {
    // run 1 is the latest, run 6 the earliest
    let folder =
        changed("runs", |seed, text| text.replace("# date = \"simulated\"", &format!("# date = \"2026-03-{:02}\"", 19 - seed)));
    let told = json(&call(folder.path(), &["history", "runs", "--json"]).succeeded());
    assert_eq!(
        (&told["dated"], &told["runs"][0]["run"], &told["changes"][0]["first"]),
        (&true.into(), &"run6.csv".into(), &2.into())
    );
    assert!(told["summary"].as_str().unwrap().contains("Between 2026-03-14 and 2026-03-15"), "{}", told["summary"]);
}

/// Exports without a head of this program's are runs too, and what is none costs one line.
#[test]
fn exports_are_runs_and_a_bad_file_costs_one_line() {
    let folder = changed("runs", |_, text| {
        let rows = text.lines().filter(|l| !l.starts_with('#'));
        rows.map(|l| l.replace("thrust_n", "Thrust (N)") + "\n").collect()
    });
    fs::write(folder.path().join("runs/broken.csv"), "# quadrig-log 1\nt_s,rpm,thrust_n\n0,1,x\n").unwrap();
    fs::write(folder.path().join("runs/notes.md"), "no run\n").unwrap();
    let said = call(folder.path(), &["history", "runs", "--json"]).succeeded();
    let broken =
        "left out: runs/broken.csv:3: column thrust_n: 'x'; expected a decimal number, or an empty field for a missing sample\n";
    assert!(said.err.ends_with(broken) && said.err.matches("\nleft out: ").count() == 1, "{}", said.err);
    // what was converted is said of each file, in one block
    for seed in SEEDS {
        let block = format!("runs/run{seed}.csv: read as an export; found on the way:\n  ");
        assert_eq!(said.err.matches(&block).count(), 1, "{}", said.err);
    }
    assert_eq!(said.err.matches("column 'Thrust (N)' is taken").count(), SEEDS.count(), "{}", said.err);
    assert_eq!(call(folder.path(), &["--quiet", "history", "runs", "--json"]).succeeded().err, broken);

    // a run that is laid beside another, and one whose levels are asked for, are no exception
    let export = format!("runs/run{}.csv", SEEDS.end());
    let own = flown().join("runs/run1.csv");
    let beside = ["identify", own.to_str().unwrap(), "-o", "m.toml", "--report", "p.html", "--beside", &export];
    for words in [&beside[..], &["beam", "--run", &export], &["plateaus", &export]] {
        let said = call(folder.path(), words).succeeded();
        assert_eq!(said.err.matches(&format!("{export}: read as an export; found on the way:\n")).count(), 1, "{}", said.err);
        assert!(said.err.contains("Thrust (N)"), "{}", said.err);
    }
    let told = json(&said);
    assert_eq!(
        (told["runs"].as_array().map(Vec::len), &told["changes"][0]["first"]),
        (Some(6), &4.into()),
        "{}",
        told["summary"]
    );
}

#[test]
fn what_is_no_history_is_refused() {
    let folder = changed("alike", |seed, text| if seed == 6 { text.replace("\"570KV\"", "\"700KV\"") } else { text });
    let at = folder.path();
    call(at, &["history", "runs", "-o", "out"]).refused(&[
        "run1.csv and run6.csv are of different rigs",
        "\"700KV\"",
        "expected runs of one rig",
    ]);
    call(at, &["history", "runs/run1.csv"]).refused(&["1 run; expected at least 3 runs of one rig"]);
    call(at, &["history", "runs/run1.csv", "runs/run2.csv", "runs/run1.csv"]).refused(&["the same log", "leave one out"]);
    call(at, &["history", "gone"]).refused(&["gone: "]);
    fs::create_dir(at.join("empty")).unwrap();
    call(at, &["history", "empty", "-o", "out"]).refused(&["empty: no file ends in .csv", "expected rig logs or exports"]);
    // three times the thrust is another propeller, whatever the head says
    let folder = changed("alike", |seed, text| {
        let column = text.lines().find(|l| !l.starts_with('#')).unwrap().split(',').position(|c| c == "thrust_n").unwrap();
        let scaled = |line: &str| -> String {
            let cell = |(k, c): (usize, &str)| match c.parse::<f64>() {
                Ok(v) if k == column && seed == 2 => format!("{:.4}", 4.0 * v),
                _ => c.to_owned(),
            };
            if line.starts_with("# quadrig-log") {
                // so much thrust is refused unless somebody vouches for it
                format!("{line}\n# vouched = [\"thrust_n\"]")
            } else if line.starts_with('#') {
                line.to_owned()
            } else {
                line.split(',').enumerate().map(cell).collect::<Vec<_>>().join(",")
            }
        };
        text.lines().map(|l| scaled(l) + "\n").collect()
    });
    call(folder.path(), &["history", "runs", "-o", "out"]).refused(&[
        "of different rigs",
        "gain of thrust",
        "more than any effect can",
    ]);
    assert!(!folder.path().join("out").exists() && !at.join("out").exists(), "nothing is written");
}
