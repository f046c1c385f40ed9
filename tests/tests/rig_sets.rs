//! Every recorded set with time or row order goes from its file to fits, plateaus and a page, with a table of what is wrong in it.
//!
//! What it is: import and identification of each set as published and as tidied, what the import must have noticed, and thrust
//! coefficients set beside the UIUC table.
//! What can go wrong: the recordings are absent ([`quadrig_tests::data`] says what then); a set that no longer goes through.
//! Units: as in the files; thrust coefficients have none.
//! Reference: `README.md` of each set; Brandt, Deters, Ananda & Selig, UIUC Propeller Data Site, volume 1.

use ident::channel::Context;
use ident::close::close;
use ident::identify::curves::thrust_coefficient;
use ident::identify::{Identified, identify};
use ident::log::import::import;
use ident::signal::bad::SetAside;
use quadrig_tests::{call, data, files};
use std::path::Path;
use tempfile::TempDir;

/// File, what the import must say of it, plateaus at least, and whether a thrust coefficient must come out.
const SETS: [(&str, &[&str], usize, bool); 10] = [
    ("crazyflie-stand/original/cf21_stock2.csv", &["no time column", "rotors without a common speed", "coarse steps"], 10, true),
    ("crazyflie-stand/tidy/cf21-stock2.csv", &["no time column", "coarse steps"], 10, true),
    ("lever-rig-10x45/tidy/robbe11.0.csv", &["gaps of more than", "glitches", "coarse steps of 65"], 20, true),
    ("lever-rig-10x45/tidy/robbe12.2.csv", &["gaps of more than", "coarse steps of 65"], 20, true),
    ("spitz-esc-test/original/Log_2019-11-05_171350.csv", &["blank samples", "repeat the row before", "glitches"], 20, true),
    ("spitz-esc-test/original/Log_2019-11-07_174807.csv", &["step back", "blank samples", "sign turned round"], 20, true),
    ("spitz-esc-test/original/Log_2019-11-09_181347.csv", &["step back", "blank samples", "time steps more than"], 20, true),
    ("spitz-esc-test/original/f40_steps_5-2.csv", &["date and time of day", "repeat the row before"], 20, false),
    ("spitz-esc-test/tidy/f40-esc32v3.esc-log.csv", &["repeat the row before"], 20, false),
    ("spitz-esc-test/tidy/f80-aikon-pwm.csv", &["step back", "blank samples"], 20, true),
];

fn identified(path: &Path) -> (String, Identified) {
    let (log, report) = import(path, &[]).unwrap_or_else(|e| panic!("{e}"));
    let found = identify(&log).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    (report.table(), found)
}

fn constant(found: &Identified, name: &str) -> Option<(f64, f64)> {
    found.constants.iter().find(|c| c.name == name).map(|c| (c.value, c.half))
}

#[test]
fn every_set_goes_through_and_says_what_is_wrong_in_it() {
    let Some(data) = data("the recorded sets") else { return };
    let mut faults = Vec::new();
    for (file, words, plateaus, thrust) in SETS {
        let (table, found) = identified(&data.join("rig").join(file));
        for word in words {
            if !table.contains(word) {
                faults.push(format!("{file}: the table lacks '{word}'"));
            }
        }
        if found.plateaus.len() < plateaus {
            faults.push(format!("{file}: {} plateaus", found.plateaus.len()));
        }
        let k = constant(&found, "k_T");
        // the lever rig's levels do not follow the square: its interval holds the farthest level, 18 % off
        if k.is_some_and(|(v, half)| v > 0.0 && half < 0.25 * v) != thrust {
            faults.push(format!("{file}: k_T {k:?}"));
        }
    }
    let tables = files(&data.join("rig/fivein-static-tables/original"), |n| n.ends_with(".csv"));
    assert!(tables.len() >= 100);
    for path in tables.iter().step_by(9) {
        let (_, found) = identified(path);
        if found.plateaus.is_empty() || constant(&found, "k_T").is_none_or(|(v, _)| v <= 0.0) {
            faults.push(format!("{}: no k_T from a static table", path.display()));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// At 7 V a sensor that listens to the windings reads nothing, or next to nothing, of the slowest level of two fifths of the static tables. The rotor
/// lifts all the same: the level was not read. What is predicted from there at 11 V, where that level is read, is better by it.
#[test]
fn a_level_that_lifts_was_not_read() {
    let Some(data) = data("the static tables") else { return };
    let folder = data.join("rig/fivein-static-tables/tidy");
    let log = |path: &Path| import(path, &[]).unwrap_or_else(|e| panic!("{e}")).0;
    let mut unread = Vec::new();
    for path in files(&folder, |n| n.ends_with(".csv")) {
        let closed = close(&log(&path), None, &[], &mut |_| {}).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let levels = closed.verdict.set_aside.into_iter().filter(|a| a.channel == "rpm");
        unread.extend(levels.map(|a| (path.clone(), a.row, a.value, a.expected)));
    }
    for (path, row, value, expected) in &unread {
        let told = format!("{}, row {row}: {value} of {expected}", path.display());
        assert!(*row < 2 && *value < 500.0 && (1500.0..3500.0).contains(expected), "{told}");
    }
    assert_eq!(unread.len(), 44, "of 112 tables");
    let [seven, eleven] = ["i8_7.csv", "i8_11.csv"].map(|name| log(&folder.join(name)));
    let closed = close(&seven, None, &[eleven], &mut |_| {}).expect("a verdict");
    let speed = closed.verdict.validation[0].channels["rpm"];
    assert!(speed.after < 0.8 * speed.before, "{speed:?}");
}

/// Runs that end with a rotor that coasts, a sensor that gives up on it, and rows without a command; staircases of one row a level whose lowest comes
/// right behind a pause. None of it moves the pulse at which the motor starts: it stands at 1000 us, and turns at the pulse beside.
#[test]
fn the_motor_starts_above_the_pulse_at_which_it_stands() {
    let Some(data) = data("the 1585 stands") else { return };
    for (file, turns_us) in [
        ("stand1585-micro/tidy/TimeConstant_Test_2024-02-06_134515.csv", 1044.0),
        ("stand1585-micro/tidy/StepsTestV2_2024-02-06_131025.csv", 1026.5),
        ("stand1585-sov5/tidy/TimeConstant_Test_2023-12-13_130935.csv", 1031.0),
    ] {
        let (log, _) = import(&data.join("rig").join(file), &[]).unwrap_or_else(|e| panic!("{e}"));
        let context = Context::new(&log, None);
        assert_eq!(context.start_pulse_us, 0.5 * (1000.0 + turns_us), "{file}");
        let stands = |a: &SetAside| a.channel == "rpm" && a.value == 0.0 && a.expected > 5000.0;
        assert!(!context.set_aside.iter().any(stands), "{file}: {:?}", context.set_aside);
    }
}

/// The published lever-rig file has neither header nor commas: its columns are named on the command line, by position.
#[test]
fn a_file_without_a_header_is_mapped_by_position() {
    let Some(data) = data("the lever rig as published") else { return };
    let file = data.join("rig/lever-rig-10x45/original/robbe11.0.txt");
    let folder = TempDir::new().unwrap();
    let file = file.to_str().unwrap();
    call(folder.path(), &["import", file, "-o", "run.csv"]).refused(&["numbers where a header should stand", "--map rpm=5*65"]);
    let maps = ["--map", "pulse_us=1*4+1000", "--map", "rpm=5*65", "--map", "current_a=2*0.1", "--map", "voltage_v=7*0.1"];
    let said = call(folder.path(), &[&["import", file, "-o", "run.csv"], &maps[..]].concat()).succeeded();
    assert!(said.out.contains("no header line") && said.out.contains("no time column"), "{}", said.out);
    let said =
        call(folder.path(), &["identify", "run.csv", "-o", "m.toml", "--report", "r.html", "--svg", "figures"]).succeeded();
    assert!(said.out.starts_with("25 plateaus"), "{}", said.out);
    let page = std::fs::read_to_string(folder.path().join("r.html")).unwrap().replace("http://www.w3.org/2000/svg", "");
    let script = page.split("<script>").nth(1).and_then(|s| s.split("</script>").next()).expect("the script that copies tables");
    assert!(page.matches("<script").count() == 1 && script.len() < 600, "{script}");
    for word in ["http:", "https:", "@import", "url(", "<link", "<img"] {
        assert!(!page.contains(word), "the page holds {word}");
    }
    for needed in
        ["prefers-color-scheme:dark", "@media print", "max-width:600px", "class=\"tip\"", "class=\"a band\"", "class=\"span\""]
    {
        assert!(page.contains(needed), "the page lacks {needed}");
    }
    assert!(folder.path().join("figures/current-rpm.svg").exists() && folder.path().join("figures/rpm-pulse.svg").exists());
}

/// Three motors and controllers with one propeller: its k_T is one number, within the intervals that each run states.
#[test]
fn one_propeller_has_one_thrust_coefficient() {
    let Some(data) = data("three runs of one propeller") else { return };
    let runs = files(&data.join("rig/spitz-esc-test/original"), |n| n.starts_with("Log_"));
    let k: Vec<(f64, f64)> = runs.iter().map(|r| constant(&identified(r).1, "k_T").expect("k_T")).collect();
    for (i, a) in k.iter().enumerate() {
        for b in &k[i + 1..] {
            assert!((a.0 - b.0).abs() < a.1.hypot(b.1) * 1.1, "{a:?} {b:?}");
        }
    }
}

/// What is uncertain when the lever rig's 10x4.5 is laid beside UIUC's 9x4.7: relative half widths of what may be, each taken as evenly
/// likely within it (standard uncertainty = half width / sqrt 3), with where it comes from. Derived in docs/identification.md.
const UNCERTAIN: [(&str, f64); 7] = [
    ("density of the air: 98 to 103 kPa, 15 to 30 degC", 0.05),
    ("pitch: 0.25 inch of moulding tolerance on 4.5, by 0.98 (blade element theory)", 0.055),
    ("pitch over diameter: exponent 0.85 to 1.35 on 0.45 / 0.522 (zero-lift angle unknown)", 0.037),
    ("chord: slow-fly families differ by 15 %, by 0.74 (blade element theory)", 0.11),
    ("Reynolds number: spread of the UIUC table over its own speeds", 0.027),
    ("arms: 88 and 165 mm known to 1 mm", 0.013),
    ("force scale: one count of the converter in the 99 counts of the 0.2 kg mass", 0.01),
];

/// UIUC's 9x4.7 beside the lever rig's 10x4.5, thrust going with pitch over diameter: within two combined standard uncertainties.
#[test]
fn thrust_coefficients_agree_with_the_uiuc_table_within_what_is_uncertain() {
    let Some(data) = data("the UIUC table") else { return };
    let text = std::fs::read_to_string(data.join("rig/uiuc-static/apcsf_9x4.7_static.csv")).unwrap();
    let table: Vec<f64> = text.lines().skip(1).filter_map(|l| l.split(',').nth(1)?.parse().ok()).collect();
    let uiuc = table.iter().sum::<f64>() / table.len() as f64;
    let expected = uiuc * (4.5 / 10.0) / (4.7 / 9.0);
    let known = UNCERTAIN.iter().map(|(_, half)| half * half / 3.0).sum::<f64>();
    for path in files(&data.join("rig/lever-rig-10x45/tidy"), |n| n.ends_with(".csv")) {
        let (k, half) = constant(&identified(&path).1, "k_T").expect("k_T");
        let measured = thrust_coefficient(k, 0.254, 1.2);
        let limit = 2.0 * (known + (half / k / 1.96).powi(2)).sqrt();
        let off = measured / expected - 1.0;
        println!("{}: C_T {measured:.4}, UIUC scaled {expected:.4}, {off:+.3} of +-{limit:.3}", path.display());
        assert!(off.abs() < limit, "{}: {measured} for {expected}", path.display());
    }
    // the same table read as a log: its own C_T comes back from its thrust
    let (_, found) = identified(&data.join("rig/uiuc-static/apcsf_9x4.7_static.csv"));
    let (k, _) = constant(&found, "k_T").expect("k_T of the table");
    assert!((thrust_coefficient(k, 0.2286, 1.225) / uiuc - 1.0).abs() < 0.06);
}

/// The probe of the third run misses its mark for six readings at the most while the rotor turns fast. Its rotor coasts ahead of the load cell after
/// each step down, and what the load says of the speed is two in a hundred off for as long as a level lasts: neither is a loss.
#[test]
fn a_probe_that_reads_well_beside_a_late_load_is_believed() {
    let Some(data) = data("a probe beside a late load") else { return };
    let (log, _) = import(&data.join("rig/spitz-esc-test/original/Log_2019-11-09_181347.csv"), &[]).expect("an import");
    let closed = close(&log, None, &[], &mut |_| {}).expect("a verdict");
    let fast: Vec<_> = closed.context.set_aside.iter().filter(|a| a.channel == "rpm" && a.t_s > 20.0).collect();
    assert!(fast.len() >= 10 && fast.iter().all(|a| a.rows <= 8), "{fast:?}");
}

/// Rows of a table as pulse, speed, current and voltage, the rotor turning.
fn levels(path: &Path) -> Vec<[f64; 4]> {
    let (log, _) = import(path, &[]).unwrap_or_else(|e| panic!("{e}"));
    let column = |name: &str| log.column(name).unwrap_or_else(|| panic!("{}: no {name}", path.display())).to_vec();
    let all = ["pulse_us", "rpm", "current_a", "voltage_v"].map(column);
    (0..log.len()).map(|i| [0, 1, 2, 3].map(|k| all[k][i])).filter(|row| row[1] > 100.0).collect()
}

/// A column along another, by straight lines; nothing outside.
fn along(rows: &[[f64; 4]], x: usize, y: usize, at: f64) -> Option<f64> {
    let between = rows.windows(2).find(|w| w[0][x] <= at && at <= w[1][x] && w[0][x] < w[1][x])?;
    Some(between[0][y] + (at - between[0][x]) / (between[1][x] - between[0][x]) * (between[1][y] - between[0][y]))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The powers of the voltage that a model carries over to another supply: ratios of speed at a pulse and of current at a speed over those of the
/// voltage, on every pair of runs at 7 and 11 V. The set that they were read off.
#[test]
fn the_powers_of_the_supply_s_voltage_are_those_of_the_pairs() {
    let Some(data) = data("the five-inch tables") else { return };
    let (mut slow, mut fast, mut current) = (Vec::new(), Vec::new(), Vec::new());
    for path in files(&data.join("rig/fivein-static-tables/tidy"), |n| n.ends_with("_7.csv")) {
        let low = levels(&path);
        let high = levels(Path::new(&path.display().to_string().replace("_7.csv", "_11.csv")));
        for [pulse, rpm, ampere, volts] in &high {
            let power = |x: usize, y: usize, at: f64, value: f64| {
                Some((value / along(&low, x, y, at)?).ln() / (volts / along(&low, x, 3, at)?).ln())
            };
            match power(0, 1, *pulse, *rpm) {
                Some(e) if *pulse < 1200.0 => slow.push(e),
                Some(e) if *pulse > 1600.0 => fast.push(e),
                _ => {}
            }
            current.extend(power(1, 2, *rpm, *ampere));
        }
    }
    let pairs = [&slow, &fast, &current].map(Vec::len);
    let found = [slow, fast, current].map(median);
    println!("speed at low and at high pulses, current at a speed: {found:.2?}, of {pairs:?} levels");
    let near = |value: f64, known: f64| (value - known).abs() < 0.05;
    assert!(pairs.iter().all(|n| *n > 40), "{pairs:?}");
    assert!(near(found[0], 0.97) && near(found[1], 0.82) && near(found[2], -0.70), "{found:?}");
}

/// Without torque and propeller the power alone speaks of the units: of no run of these five stands, in rev/min; of nearly all, in rad/s or in
/// electrical turns.
#[test]
fn a_speed_of_another_unit_shows_in_the_power_of_real_runs() {
    let Some(rig) = data("real runs in other units") else { return };
    let sets = ["fivein-static-tables", "dualcell-eco2814c", "lever-rig-10x45", "stand1585-micro", "stand1585-sov5"];
    let mut told = [0; 3];
    let mut runs = 0;
    for file in sets.iter().flat_map(|set| files(&rig.join("rig").join(set).join("tidy"), |name| name.ends_with(".csv"))) {
        let Ok((mut log, _)) = import(&file, &[]) else { continue };
        let needed = ["rpm", "thrust_n", "current_a", "voltage_v"];
        if needed.iter().any(|name| log.column(name).is_none()) {
            continue;
        }
        log.columns.retain(|c| c.name != "torque_nm");
        log.meta.retain(|key, _| key != "propeller" && key != "diameter_m");
        runs += 1;
        for (count, times) in told.iter_mut().zip([1.0, std::f64::consts::TAU / 60.0, 7.0]) {
            let mut other = log.clone();
            let speed = other.columns.iter_mut().find(|c| c.name == "rpm").expect("a speed");
            speed.values.iter_mut().for_each(|v| *v *= times);
            let doubts = other.in_doubt();
            let said = doubts.iter().any(|d| d.contains("times what propellers usually take"));
            assert!(!said || times != 1.0, "{}: {doubts:?}", file.display());
            *count += usize::from(said);
        }
    }
    println!("of {runs} runs {told:?} are in doubt in rev/min, rad/s and electrical turns");
    assert!(runs > 100 && 10 * told[1] > 9 * runs && 10 * told[2] > 9 * runs, "{told:?} of {runs}");
}
