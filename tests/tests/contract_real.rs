//! The command line on recordings of real thrust stands.
//!
//! What it is: the whole way from export to corrected model on the runs that the README quotes, and import and identification on
//! every other thrust-stand table at hand.
//! What can go wrong: the recordings are absent ([`quadrig_tests::data`] says what then); a change that makes the correction of
//! a real rig worse, or that names another cause.
//! Units: newtons, seconds.
//! Reference: `README.md` of each data set; the RCbenchmark stand filters its load cells, which is the effect to be found.

use quadrig_tests::{call, data, files};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// By what factor the held-out thrust error of each recorded run falls, at least. The measured ones stand in the README.
const THRUST_FACTOR: f64 = 3.0;
/// How closely a measured factor must agree with the README's.
const README_AGREES: f64 = 0.03;
/// Where the filter's window lies on that stand, s.
const WINDOW_S: std::ops::RangeInclusive<f64> = 0.4..=0.6;
/// The thrust-stand sets and how many tidy tables each holds at least.
const SETS: [(&str, usize); 4] =
    [("crazyflie-stand", 1), ("fivein-static-tables", 112), ("lever-rig-10x45", 4), ("spitz-esc-test", 4)];

fn text(path: &Path) -> &str {
    path.to_str().expect("the data have plain names")
}

/// The filter's window in a verdict, if it is named on thrust.
fn window(verdict: &Value) -> Option<f64> {
    let effects = verdict["effects"].as_array()?;
    let filter = effects
        .iter()
        .find(|e| e["id"] == "channel_filter" && e["channels"].as_array().is_some_and(|c| c.contains(&"thrust_n".into())))?;
    filter["parameters"].as_array()?.iter().find(|p| p["name"].as_str().is_some_and(|n| n.contains("window")))?["value"].as_f64()
}

/// The factor that the README's table states for a run.
fn stated(run: &Path) -> f64 {
    let readme = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md")).expect("the README");
    let stem = run.file_stem().and_then(|s| s.to_str()).expect("a plain name").to_owned();
    let row = readme.lines().find(|l| l.starts_with('|') && l.contains(&stem)).expect("a row for each run in the README");
    row.split('|').nth(4).and_then(|cell| cell.trim().parse().ok()).expect("a factor in the fourth column")
}

/// The lines of the report that the README shows.
fn excerpt() -> Vec<String> {
    let readme = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md")).expect("the README");
    let block = readme.split("```text\n").nth(1).and_then(|rest| rest.split("```").next()).expect("an excerpt in the README");
    block.lines().filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

/// The first of `lines` that `text` does not hold, in their order.
fn missing<'a>(lines: &'a [String], text: &str) -> Option<&'a str> {
    let mut said = text.lines();
    lines.iter().find(|line| !said.any(|said| said == *line)).map(String::as_str)
}

/// A Crazyflie's battery and wires drop some two tenths of a volt per ampere; a term without a name in the power of the same deck would trade
/// places with it.
#[test]
fn a_supply_lead_keeps_its_size_beside_what_has_no_name() {
    let Some(data) = data("the lead of a Crazyflie") else { return };
    let run = data.join("rig/crazyflie-stand/tidy/cf21-stock2.csv");
    let folder = TempDir::new().unwrap();
    let said = call(folder.path(), &["close-loop", text(&run), "-o", "out", "--json"]).succeeded();
    let verdict: Value = serde_json::from_str(&said.out).expect("the verdict is JSON");
    let sag = verdict["effects"].as_array().unwrap().iter().find(|e| e["id"] == "supply_sag").expect("the sag is named");
    let ohms = sag["parameters"][0]["value"].as_f64().unwrap();
    assert!((0.1..0.4).contains(&ohms), "{ohms} ohm");
}

/// A lead that steps with the load, beside a voltage that wanders by far more than its noise: three staircases on two motors.
#[test]
fn a_lead_shows_through_a_voltage_that_wanders() {
    let Some(data) = data("the lead of a recorded stand") else { return };
    for run in [
        "micro/tidy/StepsTestV2_2023-12-17_162536",
        "micro/tidy/StepsTestV2_2024-02-06_131025",
        "sov5/tidy/StepsTestV2_2023-12-14_111824",
    ] {
        let log = data.join(format!("rig/stand1585-{run}.csv"));
        let folder = TempDir::new().unwrap();
        let said = call(folder.path(), &["--quiet", "close-loop", text(&log), "-o", "out", "--json"]).succeeded();
        let verdict: Value = serde_json::from_str(&said.out).expect("the verdict is JSON");
        let effects = verdict["effects"].as_array().expect("effects");
        let sag = effects.iter().find(|e| e["id"] == "supply_sag").unwrap_or_else(|| panic!("{run}: {effects:?}"));
        let ohms = sag["parameters"][0]["value"].as_f64().expect("a resistance");
        assert!((0.04..0.15).contains(&ohms), "{run}: {ohms} ohm");
    }
}

/// A battery that gives way further for seconds, and recovers: two propellers on two days, three cells and four. On the first the name goes in the
/// second look at all names, and joins again. What the speed's telemetry reads
/// within a level is its own error, by thrust, torque and current.
#[test]
fn a_battery_recovers_and_a_telemetry_errs_on_a_recorded_stand() {
    let Some(data) = data("the battery of a recorded stand") else { return };
    for run in ["grp02__dualsky_eco2814c-v2_aeronaut-12x6.5_3s", "grp01__dualsky-eco2814c-v2_graupner-10x6_4s"] {
        let log = data.join(format!("rig/dualcell-eco2814c/tidy/{run}.csv"));
        let folder = TempDir::new().unwrap();
        let said = call(folder.path(), &["--quiet", "close-loop", text(&log), "-o", "out", "--json"]).succeeded();
        let verdict: Value = serde_json::from_str(&said.out).expect("the verdict is JSON");
        let size = |id: &str, name: &str| {
            let effects = verdict["effects"].as_array().expect("effects");
            let found = effects.iter().find(|e| e["id"] == id).unwrap_or_else(|| panic!("{run}: {effects:?}"));
            let parameter = found["parameters"].as_array().expect("parameters").iter().find(|p| p["name"] == name);
            parameter.and_then(|p| p["value"].as_f64()).expect("a size")
        };
        let tau = size("battery_relaxation", "tau");
        assert!((2.0..8.0).contains(&tau), "{run}: {tau} s");
        let share = size("battery_relaxation", "resistance") / size("supply_sag", "resistance");
        assert!((0.3..0.9).contains(&share), "{run}: {share}");
        let model = std::fs::read_to_string(folder.path().join("out/model.toml")).expect("a model");
        let share = model.lines().find_map(|line| line.strip_prefix("sensor_share = ")).expect("of the speed's sensor");
        assert!(share.parse::<f64>().is_ok_and(|share| share > 0.8), "{run}: {share}");
    }
}

#[test]
fn the_loop_closes_on_three_recorded_runs() {
    let Some(data) = data("the loop on recorded runs") else { return };
    let runs = files(&data.join("rig/spitz-esc-test/original"), |name| name.starts_with("Log_") && name.ends_with(".csv"));
    assert_eq!(runs.len(), 3);
    let mut faults = Vec::new();
    let shown = excerpt();
    for run in runs {
        let folder = TempDir::new().unwrap();
        let name = run.file_name().and_then(|name| name.to_str()).expect("a plain name");
        call(folder.path(), &["--quiet", "import", text(&run), "-o", name]).succeeded();
        call(folder.path(), &["--quiet", "identify", name, "-o", "model.toml"]).succeeded();
        let said = call(folder.path(), &["close-loop", name, "-o", "out"]).succeeded();
        if shown.iter().any(|line| line == name) {
            assert_eq!(
                missing(&shown, &said.out),
                None,
                "the README's excerpt is not what `close-loop {name}` says:\n{}",
                said.out
            );
        }
        let verdict = std::fs::read_to_string(folder.path().join("out/verdict.json")).expect("the verdict");
        let verdict: Value = serde_json::from_str(&verdict).expect("the verdict is JSON");
        let thrust = &verdict["channels"]["thrust_n"];
        let error = |when: &str| thrust[when]["heldout_rms"].as_f64().expect("a held-out error");
        let factor = error("before") / error("after");
        let ids: Vec<&str> = verdict["effects"].as_array().into_iter().flatten().filter_map(|e| e["id"].as_str()).collect();
        let window = window(&verdict);
        let line = format!("{}: held-out thrust error falls {factor:.2} times, {ids:?}, window {window:?} s", run.display());
        println!("{line}");
        let agrees = (factor / stated(&run) - 1.0).abs() < README_AGREES;
        if factor <= THRUST_FACTOR || !agrees || !window.is_some_and(|w| WINDOW_S.contains(&w)) {
            faults.push(line);
        }
    }
    assert!(
        faults.is_empty(),
        "expected a factor above {THRUST_FACTOR} that agrees with the README's table, and a window within {WINDOW_S:?} s:\n{}",
        faults.join("\n")
    );
}

#[test]
fn every_thrust_stand_table_imports_and_identifies() {
    let Some(data) = data("import of the thrust-stand tables") else { return };
    for (set, least) in SETS {
        let tables = files(&data.join("rig").join(set).join("tidy"), |name| name.ends_with(".csv"));
        assert!(tables.len() >= least, "{set}: {} tables", tables.len());
        let folder = TempDir::new().unwrap();
        for table in &tables {
            call(folder.path(), &["--quiet", "import", text(table), "-o", "log.csv"]).succeeded();
            call(folder.path(), &["--quiet", "identify", "log.csv", "-o", "model.toml"]).succeeded();
            let model = std::fs::read_to_string(folder.path().join("model.toml")).unwrap();
            assert!(model.contains("[channel."), "{}: no relation was fitted", table.display());
        }
        println!("{set}: {} tables", tables.len());
    }
}

#[test]
fn a_reference_table_without_time_is_imported_as_rows() {
    let Some(data) = data("import of the reference table") else { return };
    let folder = TempDir::new().unwrap();
    for table in files(&data.join("rig/uiuc-static"), |name| name.ends_with(".csv")) {
        call(folder.path(), &["--quiet", "import", text(&table), "-o", "log.csv"]).succeeded();
        let log = std::fs::read_to_string(folder.path().join("log.csv")).unwrap();
        assert!(log.contains("# time = \"row\"\n"), "{log}");
    }
}
