//! What designers ask for, from the log of a run: power, efficiency, coefficients, thrust over throttle and voltage, laws that do not hold.
//!
//! What it is: the built program on simulated runs of one rig; what it computes for another voltage is flown at that voltage.
//! What can go wrong: a figure that is guessed where the log does not tell it; a band that another voltage leaves; a constant whose interval
//! excludes the data that it comes from.
//! Units: as the columns state.
//! Reference: specification `identification.md`, item 3; docs/identification.md.

use quadrig_tests::{call, data, root};
use std::collections::BTreeMap;
use std::path::Path;

fn scenario(voltage: f64, effect: &str) -> String {
    format!(
        "seed = 11\nsupply = {{ kind = \"bench\", voltage_v = {voltage} }}\n{effect}\n[schedule]\nkind = \"staircase\"\nstep_us = 50\nhold_s = 6\ntop_us = 2000\n"
    )
}

/// Flies, identifies; the words of the terminal.
fn identified(at: &Path, name: &str, scenario: &str, more: &[&str]) -> String {
    std::fs::write(at.join(format!("{name}.toml")), scenario).expect("a scenario");
    let log = format!("{name}.csv");
    call(at, &["--quiet", "sim", &format!("{name}.toml"), "-o", &log]).succeeded();
    let (model, table) = (format!("{name}-model.toml"), format!("{name}-table.csv"));
    call(at, &[&["identify", &log, "-o", &model, "--table", &table], more].concat()).succeeded().out
}

/// Rows of a CSV by the names of its columns; an empty field is not there.
fn rows(at: &Path, name: &str) -> Vec<BTreeMap<String, f64>> {
    let text = std::fs::read_to_string(at.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let row = |line: &str| {
        let cells = names.iter().zip(line.split(','));
        cells.filter_map(|(name, cell)| Some(((*name).to_owned(), cell.parse().ok()?))).collect()
    };
    lines.map(row).collect()
}

/// What the run at 11.5 V says of 10.35 V is what a run at 10.35 V gives.
#[test]
fn thrust_at_another_voltage_is_what_the_surface_says() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let said = identified(at, "run", &scenario(11.5, ""), &["--surface", "surface.csv", "--report", "page.html", "--air", "1.2"]);
    assert!(said.contains("the law holds") && said.contains("measured 11.5"), "{said}");
    identified(at, "low", &scenario(10.35, ""), &[]);
    let surface: Vec<_> = rows(at, "surface.csv").into_iter().filter(|r| (r["voltage_v"] - 10.35).abs() < 0.02).collect();
    assert_eq!(surface.len(), 21);
    let mut inside = 0;
    let flown = rows(at, "low-table.csv");
    let flown: Vec<_> = flown.iter().filter(|r| r["rpm"] > 500.0).collect();
    for level in &flown {
        let (pulse, thrust) = (level["pulse_us"], level["thrust_n"]);
        let k = surface.windows(2).position(|w| w[0]["pulse_us"] <= pulse + 0.5 && pulse - 0.5 <= w[1]["pulse_us"]);
        let Some(k) = k else { continue };
        let share = ((pulse - surface[k]["pulse_us"]) / (surface[k + 1]["pulse_us"] - surface[k]["pulse_us"])).clamp(0.0, 1.0);
        let of = |name: &str| surface[k][name] + share * (surface[k + 1][name] - surface[k][name]);
        println!(
            "{pulse:.0} us: {thrust:.4} N flown, {:.4} ({:.4} to {:.4}) computed",
            of("thrust_n"),
            of("thrust_n_low"),
            of("thrust_n_high")
        );
        assert!((thrust - of("thrust_n")).abs() < 0.03 + 0.02 * thrust, "{pulse} us");
        // half the levels' own error at either side
        let error = 2.0 * level["thrust_n_se"] + 0.005;
        inside += usize::from((of("thrust_n_low") - error..=of("thrust_n_high") + error).contains(&thrust));
    }
    assert!(flown.len() >= 15 && 10 * inside >= 9 * flown.len(), "{inside} of {} within the band", flown.len());
    let page = std::fs::read_to_string(at.join("page.html")).expect("a page");
    for text in [
        "Thrust over throttle and voltage, with 95 % bands",
        "download=\"plateau-figures.csv\"",
        "download=\"thrust-surface.csv\"",
        "figure of merit",
        "chi2/dof ",
    ] {
        assert!(page.contains(text), "the page lacks {text}");
    }
}

/// Power by hand from the same row; coefficients only where propeller and air are known.
#[test]
fn every_plateau_has_its_power_and_what_is_not_known_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let said = identified(at, "run", &scenario(11.5, ""), &[]);
    assert!(!said.contains(": not known"), "the simulated air is in the head: {said}");
    let told = rows(at, "run-table.csv");
    let full = told.iter().max_by(|a, b| a["pulse_us"].total_cmp(&b["pulse_us"])).expect("levels");
    let per_second = full["rpm"] / 60.0;
    let by_hand = full["thrust_n"] / (1.225 * per_second * per_second * (11.0 * 0.0254_f64).powi(4));
    assert!((full["c_t"] / by_hand - 1.0).abs() < 1e-3, "{} {by_hand}", full["c_t"]);
    // of a log that does not tell it
    let log = std::fs::read_to_string(at.join("run.csv")).expect("a log");
    let untold: String = log.lines().filter(|l| !l.contains("air_density_kg_m3")).map(|l| format!("{l}\n")).collect();
    std::fs::write(at.join("run.csv"), untold).expect("a log");
    let said = call(at, &["identify", "run.csv", "-o", "bare.toml", "--table", "run-table.csv"]).succeeded().out;
    assert!(said.contains("density of the air: not known") && !said.contains("diameter of the propeller"), "{said}");
    let table = rows(at, "run-table.csv");
    let top = table.iter().max_by(|a, b| a["pulse_us"].total_cmp(&b["pulse_us"])).expect("levels");
    let near =
        |name: &str, wanted: f64| assert!((top[name] / wanted - 1.0).abs() < 1e-4, "{name}: {}, by hand {wanted}", top[name]);
    near("electrical_w", top["voltage_v"] * top["current_a"]);
    near("shaft_w", top["torque_nm"] * top["rpm"] * std::f64::consts::TAU / 60.0);
    near("motor_efficiency", top["shaft_w"] / top["electrical_w"]);
    near("g_per_w", top["thrust_n"] / 9.80665 * 1000.0 / top["electrical_w"]);
    assert!(!top.contains_key("c_t") && !top.contains_key("figure_of_merit"), "{top:?}");
    let words = ["identify", "run.csv", "-o", "known.toml", "--table", "known.csv", "--air", "1.2"];
    let said = call(at, &words).succeeded().out;
    assert!(!said.contains(": not known"), "{said}");
    let known = rows(at, "known.csv");
    let top = known.iter().max_by(|a, b| a["pulse_us"].total_cmp(&b["pulse_us"])).expect("levels");
    let n = top["rpm"] / 60.0;
    assert!((top["c_t"] / (top["thrust_n"] / (1.2 * n * n * (11.0 * 0.0254_f64).powi(4))) - 1.0).abs() < 1e-4);
    assert!(
        (0.05..0.2).contains(&top["c_t"]) && (0.02..0.12).contains(&top["c_p"]) && (0.3..0.9).contains(&top["figure_of_merit"]),
        "{top:?}"
    );
    assert!(table.iter().filter(|r| r.contains_key("g_per_w_se")).count() >= 15);
    call(at, &["identify", "run.csv", "-o", "x.toml", "--air", "0"]).refused(&["--air 0", "expected a density"]);
    // without torque nothing says what another voltage would do
    let text = std::fs::read_to_string(at.join("run.csv")).expect("a log").replace("torque_nm", "other_nm");
    std::fs::write(at.join("no-torque.csv"), text).expect("a log");
    let said = call(at, &["identify", "no-torque.csv", "-o", "x.toml"]).succeeded().out;
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("the motor's constants are not: the log has no torque_nm"), "{said}");
    call(at, &["--quiet", "identify", "no-torque.csv", "-o", "y.toml", "--surface", "s.csv"]).refused(&[
        "--surface: not known, for the motor's constants are not: the log has no torque_nm",
        "expected",
        "everything else is written",
    ]);
    assert!(at.join("y.toml").exists() && !at.join("s.csv").exists());
    // a run that stops short of full throttle lacks that, and nothing else
    let short: String = std::fs::read_to_string(at.join("run.csv"))
        .expect("a log")
        .lines()
        .filter(|line| line.split(',').nth(1).and_then(|us| us.parse::<f64>().ok()).is_none_or(|us| us < 1900.0))
        .map(|line| format!("{line}\n"))
        .filter(|line| !line.starts_with("# sample_hz"))
        .collect();
    std::fs::write(at.join("short.csv"), short).expect("a log");
    call(at, &["--quiet", "identify", "short.csv", "-o", "z.toml", "--surface", "s.csv"])
        .refused(&["no level at full throttle (1990 us and more): the highest is at 18"]);
}

/// Where thrust is no square of the speed, k_T's interval holds what the levels themselves say.
#[test]
fn a_constant_whose_law_does_not_hold_is_widened() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let said = identified(at, "run", &scenario(11.5, "[[effect]]\nid = \"reynolds_thrust\"\nexponent = 0.3\n"), &[]);
    let line = &constant(&said, "k_T ");
    println!("{line}");
    assert!(line.contains("the law does not hold, the interval is widened"), "{line}");
    let (low, high) = interval(line);
    for level in rows(at, "run-table.csv").iter().filter(|r| r["rpm"] > 1500.0) {
        let omega = level["rpm"] * std::f64::consts::TAU / 60.0;
        let (quotient, error) = (level["thrust_n"] / omega.powi(2), 2.5 * level["thrust_n_se"] / omega.powi(2));
        assert!((low - error..=high + error).contains(&quotient), "{quotient:e} of {:.0} rev/min is not in {line}", level["rpm"]);
    }
    let plain = identified(at, "plain", &scenario(11.5, ""), &[]);
    let plain = constant(&plain, "k_T ");
    assert!(plain.contains("the law holds"), "{plain}");
    // a part of a blade breaks off on the way up: a third of the levels is on the other side of it, and none of them is a stray one
    let breaks = std::fs::read_to_string(root().join("examples/broken-blade.toml")).expect("an example");
    let broken = constant(&identified(at, "broken", &breaks, &[]), "k_T ");
    assert!(broken.contains("the law does not hold") && !broken.contains("left out"), "{broken}");
    let (low, high) = interval(&broken);
    let fast = rows(at, "broken-table.csv").into_iter().filter(|r| r["rpm"] > 3500.0).collect::<Vec<_>>();
    assert!(fast.len() >= 8);
    for level in fast {
        let quotient = level["thrust_n"] / (level["rpm"] * std::f64::consts::TAU / 60.0).powi(2);
        assert!((0.99 * low..=1.01 * high).contains(&quotient), "{quotient:e} is not in {broken}");
    }
}

/// The same on recorded runs, whose levels at the end have a surer zero than those in the middle: each level's own error counts.
#[test]
fn a_constant_of_a_recorded_run_reaches_its_levels() {
    let Some(data) = data("recorded stand logs") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    for name in ["Log_2019-11-05_171350", "Log_2019-11-07_174807", "Log_2019-11-09_181347"] {
        let log = data.join(format!("rig/spitz-esc-test/original/{name}.csv"));
        let log = log.to_str().expect("a plain name");
        let said = call(at, &["identify", log, "-o", "m.toml", "--table", "t.csv"]).succeeded().out;
        let line = constant(&said, "k_T ");
        let (low, high) = interval(&line);
        let square = |rpm: f64| (rpm * std::f64::consts::TAU / 60.0).powi(2);
        let mut levels = rows(at, "t.csv");
        levels.retain(|r| ["rpm", "thrust_n", "thrust_n_se"].iter().all(|name| r.contains_key(*name)));
        assert!(levels.len() > 15, "{} levels", levels.len());
        let top = levels.iter().map(|r| square(r["rpm"])).fold(0.0, f64::max);
        let counts = levels.iter().filter(|r| square(r["rpm"]) > top / 50.0);
        for level in counts {
            let (quotient, error) = (level["thrust_n"] / square(level["rpm"]), 2.0 * level["thrust_n_se"] / square(level["rpm"]));
            assert!((low - error..=high + error).contains(&quotient), "{name}: {quotient:e} +- {error:e} is not in {line}");
        }
    }
}

/// The line of a constant, and what stands of its law beneath it.
fn constant(said: &str, name: &str) -> String {
    let mut lines = said.lines().skip_while(|l| !l.starts_with(name));
    let first = lines.next().expect("the constant");
    lines.take_while(|l| l.starts_with(' ')).fold(first.to_owned(), |line, more| format!("{line} {}", more.trim()))
}

fn interval(line: &str) -> (f64, f64) {
    let bounds = line.split("(95 %: ").nth(1).and_then(|t| t.split(')').next()).expect("an interval");
    let (low, high) = bounds.split_once(" to ").expect("two bounds");
    (low.parse().expect("a number"), high.parse().expect("a number"))
}

/// The page says what the program can be asked.
#[test]
fn the_page_names_its_options() {
    let page = std::fs::read_to_string(root().join("docs/identification.md")).expect("a page");
    for text in ["--table FILE", "--surface FILE", "--air KG_M3", "figure of merit", "does not hold"] {
        assert!(page.contains(text), "docs/identification.md lacks {text}");
    }
}
