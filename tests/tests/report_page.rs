//! The page of a run: what it begins with, what it holds, how large it is, and that it is the same every time.
//!
//! What it is: pages that the command line writes, read as a reader would: the sentence, the probability of each effect, what is left, tables
//! as CSV, anchors; a log of 600 000 rows.
//! What can go wrong: a page that claims something else than the verdict beside it, or that no browser opens.
//! Units: as the channels state.
//! Reference: specification `report.md`.

use quadrig_tests::{call, data};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use tempfile::TempDir;

/// Largest page, bytes.
const LARGEST: usize = 3 << 20;
/// Widest line of the terminal.
const WIDEST: usize = 100;

fn closed(folder: &Path, log: &str, out: &str) -> (String, String, Value) {
    let said = call(folder, &["close-loop", log, "-o", out]).succeeded().out;
    let page = std::fs::read_to_string(folder.join(out).join("report.html")).expect("a page");
    let verdict = std::fs::read_to_string(folder.join(out).join("verdict.json")).expect("a verdict");
    (said, page, serde_json::from_str(&verdict).expect("JSON"))
}

fn sagging(folder: &Path) -> String {
    let scenario = quadrig_tests::root().join("examples/sagging-lead.toml");
    call(folder, &["--quiet", "sim", scenario.to_str().expect("a plain name"), "-o", "run.csv"]).succeeded();
    "run.csv".to_owned()
}

/// The text of the page without its markup, in one line.
fn text(page: &str) -> String {
    let mut out = String::new();
    let mut inside = false;
    for c in page.chars() {
        match c {
            '<' => inside = true,
            '>' => {
                inside = false;
                out.push(' ');
            }
            c if !inside => out.push(c),
            _ => {}
        }
    }
    out.replace("&gt;", ">").replace("&lt;", "<").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_page_begins_with_the_sentence_that_heads_the_terminal() {
    let folder = TempDir::new().unwrap();
    let log = sagging(folder.path());
    let (said, page, verdict) = closed(folder.path(), &log, "one");
    let body = page.split("<body").nth(1).expect("a body");
    assert!(body.contains("<h1>The supply lead drops"), "{}", &body[..200]);
    let sentence = said.split("\nrun.csv\n").next().expect("a head").split_whitespace().collect::<Vec<_>>().join(" ");
    let read = text(&format!("<{body}"));
    assert!(read.starts_with(&sentence), "{} / {sentence}", &read[..300]);
    assert!(said.lines().all(|l| l.chars().count() <= WIDEST), "{said}");
    for e in verdict["effects"].as_array().expect("effects") {
        let (id, p) = (e["id"].as_str().expect("an id"), e["probability"].as_f64().expect("a probability"));
        let p = if p >= 0.995 { "> 0.99".to_owned() } else { format!("{p:.2}") };
        let sure = read.split("How sure each name is").nth(1).expect("a table of probabilities");
        let rows: Vec<&str> = sure.split(&format!(" {id} ")).skip(1).collect();
        assert!(rows.iter().any(|row| row.chars().take(60).collect::<String>().contains(&p)), "{id}: its own probability {p}");
    }
    for u in verdict["unexplained"].as_array().expect("a list") {
        let over = format!("{:.1}", u["over_floor"].as_f64().expect("a figure"));
        assert!(read.split("What is left").last().is_some_and(|left| left.contains(&over)), "{u}");
    }
    // each card has its probability, and what the library lacks is said once
    let sag = verdict["effects"].as_array().and_then(|e| e.iter().find(|e| e["id"] == "supply_sag")).expect("the lead");
    let p = sag["probability"].as_f64().filter(|p| *p < 0.995).map_or("> 0.99".to_owned(), |p| format!("= {p:.2}"));
    assert!(read.contains(&format!("sure: p {p}, no rival supply_sag")), "{read}");
    assert!(read.matches("causes that the library lacks").count() <= 2, "above the cards, and over the table: {read}");
    // a simulated run says what fed it, and that it has no day
    assert!(read.contains("Supply bench supply, ") && read.contains("Date simulated"), "{read}");
    // the equation is the one in force, as it stands
    let in_force =
        "voltage_v = V0 - resistance * current_a; at the same power also current_a *= (voltage_v / reference)^-exponent Shows as";
    assert!(read.contains(in_force) && !read.contains('`'), "{read}");
    // other causes are told by what they are, and a factor is told once
    assert!(read.contains("Easily taken for: battery discharges during the run."), "{read}");
    assert!(!read.contains("the held-out error of voltage_v is"), "{read}");
    for part in [
        "id=\"what-this-rig-has\"",
        "id=\"effect-supply-sag\"",
        "download=\"channels.csv\"",
        "SHA-256",
        "quadrig close-loop run.csv",
        "@media print",
        "prefers-color-scheme:dark",
    ] {
        assert!(page.contains(part), "the page lacks {part}");
    }
    let (again, same, _) = closed(folder.path(), &log, "two");
    assert!(again == said && same == page, "the same log gave another page");
}

/// On a table with one row for each level the floors are guesses, and the page says so; a run of many rows is no table.
#[test]
fn a_table_of_levels_is_told_as_one() {
    let folder = TempDir::new().unwrap();
    let rows = (0..9).map(|k| {
        let (rpm, t) = (1500.0 + 600.0 * f64::from(k), 2.0 * f64::from(k));
        format!("{t:.1},{},{rpm:.0},{:.3},{:.3}\n", 1100 + 100 * k, 1.5e-7 * rpm * rpm, 1.2e-7 * rpm * rpm)
    });
    let table: String = std::iter::once("t_s,pulse_us,rpm,thrust_n,current_a\n".to_owned()).chain(rows).collect();
    std::fs::write(folder.path().join("table.csv"), table).expect("a table");
    let (_, page, _) = closed(folder.path(), "table.csv", "table");
    assert!(text(&page).contains("Only 9 rows, one for each level"), "{}", text(&page));
    let log = sagging(folder.path());
    let (_, page, _) = closed(folder.path(), &log, "run");
    assert!(!text(&page).contains("one for each level"));
}

/// On this recorded run the figure that convinces is the one of what is left of thrust.
#[test]
fn what_is_left_has_its_figure_or_says_where_it_is() {
    let Some(log) = data("the page of a recorded run").map(|d| d.join("rig/lever-rig-10x45/tidy/robbe11.8.csv")) else { return };
    let folder = TempDir::new().unwrap();
    let (_, page, verdict) = closed(folder.path(), log.to_str().expect("a plain name"), "out");
    let left = page.split("id=\"what-is-left\"").nth(1).and_then(|p| p.split("<h2").next()).expect("what is left");
    let all = verdict["unexplained"].as_array().expect("a list");
    let (mut drawn, mut above) = (0, 0);
    for channel in all.iter().filter_map(|u| u["channel"].as_str()) {
        let anchor = channel.replace('_', "-");
        drawn += usize::from(left.contains(&format!("<figure id=\"left-{anchor}\"")));
        above += usize::from(page.contains(&format!("<figure id=\"most-{anchor}\"")));
    }
    let said = left.matches("Drawn at the head of this page: ").count();
    assert!(all.len() > 2 && above > 0 && drawn + said == all.len(), "{drawn} drawn, {said} said of {}", all.len());
}

/// A load cell that reads the speed squared, on stairs, at 200 Hz for 50 minutes.
#[test]
fn six_hundred_thousand_rows_are_a_page() {
    let folder = TempDir::new().unwrap();
    let mut log = String::from("# quadrig-log 1\nt_s,pulse_us,rpm,thrust_n,current_a,voltage_v\n");
    let mut noise = 1_u64;
    let mut draw = || {
        noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (noise >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
    };
    for i in 0..600_000_u32 {
        let step = i / 20_000 % 10;
        let rpm = 600.0 * f64::from(step + 1) + 4.0 * draw();
        let current = 1.2e-7 * rpm * rpm + 0.02 * draw();
        let thrust = 1.5e-7 * rpm * rpm + 0.02 * draw();
        let _ = writeln!(
            log,
            "{:.3},{},{rpm:.2},{thrust:.4},{current:.4},{:.4}",
            0.005 * f64::from(i),
            1100 + 80 * step,
            12.0 - 0.05 * current + 0.004 * draw()
        );
    }
    std::fs::write(folder.path().join("long.csv"), log).expect("a log");
    let (said, page, verdict) = closed(folder.path(), "long.csv", "out");
    assert!(page.len() <= LARGEST, "{} bytes", page.len());
    assert!(verdict["effects"].as_array().is_some_and(|e| e.iter().any(|e| e["id"] == "supply_sag")), "{said}");
}
