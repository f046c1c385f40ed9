//! The tables of docs/rig.md are what the code says.
//!
//! `QUADRIG_BLESS=1 cargo test -p quadrig-tests --test suite rig_docs` writes them anew.

use firmware_rig::Config;
use frame::rig::{CaptureCode, CaptureVerdict};
use hal_sim::fault::{Answer, Mishap, Plan, REACTION_MS, Rule};
use std::fmt::Write;

fn faults() -> String {
    let mut table = String::from("| at the pins | detectable after | by | latched as |\n| --- | --- | --- | --- |\n");
    // one pair of sensors stands for all
    let pair = |mishap: Mishap| mishap.lines().count_ones() < 2 || mishap.lines() == 0b0101;
    for mishap in Mishap::all().into_iter().filter(|mishap| pair(*mishap)) {
        let plan = Plan::factory(mishap);
        let rule = Rule::of(&plan, 4000.0, 4000.0);
        let latched = match rule.answer {
            Answer::Stops(named) => named.iter().map(frame::Fault::words).collect::<Vec<_>>().join(" or "),
            Answer::Resets => "reset, disarmed".to_owned(),
            _ => continue,
        };
        let _ = writeln!(table, "| {} | {:.0} ms | {} | {latched} |", mishap.words(), rule.within_ms, rule.why);
    }
    assert_eq!(REACTION_MS, 40.0, "as the text says");
    table
}

fn resolution() -> String {
    let calibration = Config::thesis_570kv().calibration();
    let mut table = String::from(
        "| rev/min | period, N = 1 | N = 2 | N = 25 | N = 100 | reading spans | reading |\n| --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for rpm in [100.0f64, 200.0, 500.0, 1000.0, 2000.0, 4100.0, 5000.0, 7000.0, 10_000.0] {
        let ticks = 60.0 * 84e6 / rpm;
        let one = |n: f64| rpm * rpm * n / (60.0 * 84e6);
        let turns = (0.05 * 84e6 / ticks).ceil().max(1.0);
        // the reading itself, from the one conversion that everybody uses, one tick apart
        let code =
            |span: f64| CaptureCode { edges: turns as u16, span: span as u32, verdict: CaptureVerdict::Nominal, uneven: 0 };
        let read = |span: f64| calibration.speed(1, &code(span)).expect("a speed");
        let step = read((ticks * turns).floor()) - read((ticks * turns).floor() + 1.0);
        assert!((step / (rpm / (ticks * turns)) - 1.0).abs() < 1e-3);
        let _ = writeln!(
            table,
            "| {rpm:.0} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {turns:.0} rev | {step:.1e} |",
            one(1.0),
            one(2.0),
            one(25.0),
            one(100.0)
        );
    }
    table
}

#[test]
fn the_tables_are_current() {
    let file = quadrig_tests::root().join("docs/rig.md");
    let text = std::fs::read_to_string(&file).expect("docs/rig.md");
    let mut wanted = text.clone();
    for (name, table) in [("faults", faults()), ("resolution", resolution())] {
        let head = format!("<!-- table: {name} -->\n");
        let from = wanted.find(&head).unwrap_or_else(|| panic!("no place for {name}")) + head.len();
        let to = from + wanted[from..].find("<!-- end -->").expect("its end");
        wanted.replace_range(from..to, &table);
    }
    if std::env::var_os("QUADRIG_BLESS").is_some() {
        std::fs::write(&file, &wanted).expect("docs/rig.md can be written");
    } else {
        assert!(text == wanted, "docs/rig.md: QUADRIG_BLESS=1 cargo test -p quadrig-tests --test suite rig_docs");
    }
}

/// Errata, "Speed resolution of one period": at 84 MHz 2e-4 N at 1000 rev/min and 0.02 N at 10 000.
#[test]
fn the_table_agrees_with_the_figures_of_the_errata() {
    let table = resolution();
    assert!(table.contains("| 1000 | 2.0e-4 |") && table.contains("| 10000 | 2.0e-2 |"), "{table}");
}
