//! Each step of the loop alone, on one simulated run.
//!
//! What it is: `quadrig step NAME` for all nine names, as a table and as JSON; what each says of a run whose supply sags.
//! What can go wrong: a step that needs another one to have been run, or a table that says nothing.
//! Units: as in the heads of the columns.
//! Reference: specification `closing-the-loop.md`, "The steps".

use quadrig_tests::call;
use serde_json::Value;
use tempfile::TempDir;

const RIG: &str = "seed = 3201\nschedule = { kind = \"up_down\", step_us = 100, hold_s = 4, top_us = 2000 }\n[[effect]]\nid = \"supply_sag\"\nresistance_ohm = 0.1\n";

#[test]
fn nine_steps_say_each_its_own() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("rig.toml"), RIG).unwrap();
    call(folder.path(), &["--quiet", "sim", "rig.toml", "-o", "run.csv"]).succeeded();
    let table = |name: &str| -> Value {
        let said = call(folder.path(), &["step", name, "run.csv", "--json"]).succeeded().out;
        let table: Value = serde_json::from_str(&said).expect("JSON");
        assert_eq!(table["step"], name);
        let width = table["columns"].as_array().expect("columns").len();
        let rows = table["rows"].as_array().expect("rows");
        assert!(!rows.is_empty() && rows.iter().all(|r| r.as_array().is_some_and(|r| r.len() == width)), "{name}: {table:#}");
        table
    };
    // the row that begins with these words
    let row = |table: &Value, words: &[&str]| -> Vec<String> {
        let cells = |r: &Value| -> Vec<String> {
            r.as_array().into_iter().flatten().filter_map(|c| c.as_str().map(str::to_owned)).collect()
        };
        let rows: Vec<Vec<String>> = table["rows"].as_array().into_iter().flatten().map(cells).collect();
        rows.into_iter()
            .find(|r| r.iter().zip(words).all(|(c, w)| c == w))
            .unwrap_or_else(|| panic!("no row {words:?} in {table:#}"))
    };
    let number = |cell: &str| -> f64 { cell.parse().unwrap_or_else(|_| panic!("{cell} is no number")) };

    assert!((number(&row(&table("declare"), &["voltage_v", "0"])[2]) - 11.4).abs() < 0.5);
    let residual = table("residual");
    assert!(number(&row(&residual, &["voltage_v"])[4]) > 10.0 && number(&row(&residual, &["thrust_n"])[4]) < 3.0);
    let anything = table("anything");
    assert_eq!(row(&anything, &["voltage_v"]).last().expect("a verdict"), "something");
    let depends = table("depends");
    let share = row(&depends, &["voltage_v", "current_a"]);
    assert!(number(&share[2]) > 0.95 && number(&share[3]) <= 0.01, "{share:?}");
    assert_eq!(table("candidates")["rows"][0][0], "supply_sag [same_power]");
    assert!(table("choose")["rows"][0][1].as_str().is_some_and(|ids| ids.contains("supply_sag")));
    assert!(number(&row(&table("nameless"), &["voltage_v"])[2]) > 0.9);
    let report = table("report");
    assert!((number(&row(&report, &["supply_sag.resistance"])[1]) - 0.1).abs() < 0.01);
    let close = row(&table("close"), &["voltage_v"]);
    assert!(number(&close[3]) < 0.2 * number(&close[2]), "{close:?}");

    let said = call(folder.path(), &["step", "residual", "run.csv"]).succeeded().out;
    assert!(said.starts_with("residual: ") && said.contains("voltage_v"), "{said}");
    assert_eq!(call(folder.path(), &["step", "seance", "run.csv"]).status, Some(2));
}
