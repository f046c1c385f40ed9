//! `quadrig select` and `quadrig beam` as a designer types them.
//!
//! What it is: Table 9's rows and choice, a measured run as a pair, the beam of Table 7 with its warnings, pages without network.
//! What can go wrong: a figure of the errata that no longer comes out; a page that asks the network for something.
//! Units: as printed.
//! Reference: specification `identification.md`, item 4; errata, Table 9 and "beam (Table 7)".

use quadrig_tests::{call, root};
use serde_json::Value;
use tempfile::TempDir;

/// A page or figure that loads nothing, and runs nothing but what copies a table.
fn stands_alone(text: &str) {
    let linked = text.replace("http://www.w3.org/2000/svg", "").replace("<script>if(navigator.clipboard)", "");
    for word in ["http:", "https:", "<script", "@import", "url(", "<link", "<img"] {
        assert!(!linked.contains(word), "the page holds {word}");
    }
}

#[test]
fn the_thesis_choice_with_its_page() {
    let folder = TempDir::new().unwrap();
    let said = call(folder.path(), &["select", "--motor", "570KV", "--json", "-o", "page.html", "--svg", "figures"]).succeeded();
    let json: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(json["chosen"][0], "570KV 11x4.7");
    assert_eq!(json["chosen"].as_array().unwrap().len(), 3);
    let row = json["rows"].as_array().unwrap().iter().find(|r| r["pair"]["propeller"] == "11x4.7").unwrap();
    let resultant = row["with_batteries"][0]["resultant_n"].as_f64().unwrap();
    assert_eq!(format!("{resultant:.1}"), "11.6");
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    stands_alone(&page);
    assert!(
        page.contains("<h1>570KV with 11x4.7 is the most efficient of the pairs that give enough"),
        "the choice heads the page"
    );
    assert!(!page.contains("N/A") && page.contains("N per A"), "a unit that reads as not available");
    assert!(!page.contains("hover 1, min") && page.contains("No pair tells how long it hovers with 1, 2 and 3 batteries"));
    assert!(page.contains("download=\"pairs.csv\"") && page.contains("the figures that the thesis states"));
    for name in ["fig-6-2-thrust", "fig-6-3-current", "fig-6-4-efficiency", "model-mass", "endurance-570kv-3"] {
        stands_alone(&std::fs::read_to_string(folder.path().join(format!("figures/{name}.svg"))).unwrap());
    }
}

#[test]
fn a_measured_run_is_a_pair_and_knows_its_hover() {
    let folder = TempDir::new().unwrap();
    let scenario = root().join("examples/sagging-lead.toml");
    call(folder.path(), &["--quiet", "sim", scenario.to_str().unwrap(), "-o", "run.csv"]).succeeded();
    let said = call(folder.path(), &["select", "run.csv", "--json"]).succeeded();
    let json: Value = serde_json::from_str(&said.out).unwrap();
    let row = &json["rows"][0];
    assert_eq!(row["pair"]["motor"], "570KV");
    let hover = row["with_batteries"][0]["hover_min"].as_f64().expect("the levels give the current in hover");
    let full = row["with_batteries"][0]["full_throttle_min"].as_f64().unwrap();
    assert!((15.0..35.0).contains(&hover) && hover > 1.5 * full, "{hover} {full}");
    // the table of the same run's levels tells the same, and nothing of whose they are
    call(folder.path(), &["--quiet", "identify", "run.csv", "-o", "model.toml", "--table", "levels.csv"]).succeeded();
    let said = call(folder.path(), &["select", "levels.csv", "--motor", "570KV", "--json"]).succeeded();
    let json: Value = serde_json::from_str(&said.out).unwrap();
    let of_table = json["rows"][0]["with_batteries"][0]["hover_min"].as_f64().expect("the same levels");
    assert!((of_table / hover - 1.0).abs() < 1e-4, "{of_table} {hover}");
    let said = call(folder.path(), &["beam", "--run", "run.csv"]).succeeded();
    assert_eq!(said.err.lines().count(), 2, "{}", said.err);
    assert!(said.err.contains("resonance at 2511 rev/min (unbalance") && said.err.contains("1255 rev/min (blade pass)"));
}

/// A table that a stand writes has one row for each level.
#[test]
fn a_table_of_levels_is_a_pair() {
    let folder = TempDir::new().unwrap();
    let rows = (0..9).map(|k| {
        let (rpm, t) = (1500.0 + 600.0 * f64::from(k), 2.0 * f64::from(k));
        format!("{t:.1},{},{rpm:.0},{:.3},{:.3}\n", 1100 + 100 * k, 1.5e-7 * rpm * rpm, 1.2e-7 * rpm * rpm)
    });
    let table: String = std::iter::once("t_s,pulse_us,rpm,thrust_n,current_a\n".to_owned()).chain(rows).collect();
    std::fs::write(folder.path().join("table.csv"), table).unwrap();
    let said = call(folder.path(), &["select", "table.csv", "--json"]).succeeded();
    let json: Value = serde_json::from_str(&said.out).unwrap();
    let most = json["rows"][0]["pair"]["maximum"]["thrust_n"].as_f64().expect("the row with most thrust");
    assert!((most - 1.5e-7 * 6300.0_f64.powi(2)).abs() < 0.001, "{most}: {}", said.out);
}

#[test]
fn the_beam_of_table_7_and_a_wrong_one() {
    let folder = TempDir::new().unwrap();
    let said = call(folder.path(), &["beam", "--speeds", "600,1100", "--near", "5", "-o", "beam.html"]).succeeded();
    assert_eq!(said.err, "", "no resonance below 1255 rev/min");
    for figure in ["30.08 MPa", "150.4 microstrain", "3.633 mV", "0.442 mm", "478 mm", "41.8 Hz"] {
        assert!(said.out.contains(figure), "{figure} in {}", said.out);
    }
    stands_alone(&std::fs::read_to_string(folder.path().join("beam.html")).unwrap());
    let long = call(folder.path(), &["--quiet", "beam", "--length", "450", "--load", "1250"]).succeeded();
    assert!(
        long.err.contains("warning: the safety factor is 1.36; expected at least 2 (shorten to 306 mm or load at most 849 g)")
    );
    call(folder.path(), &["beam", "--height", "0"]).refused(&["--height 0: expected a positive number"]);
}

#[test]
fn bad_pairs_are_refused_with_their_place() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("pairs.csv"), "motor,propeller,thrust_n,current_a\nA,10x5,3,\n").unwrap();
    call(folder.path(), &["select", "pairs.csv", "-o", "page.html"]).refused(&["pairs.csv:2: column current_a: ''"]);
    assert!(!folder.path().join("page.html").exists());
    call(folder.path(), &["select", "--motor", "1KV"]).refused(&["--motor 1KV: no pair has this motor"]);
}

/// One bad file costs its own row alone; every row has a name; the choice has its reason.
#[test]
fn a_bad_file_costs_its_own_row_alone() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let head = "motor,propeller,thrust_n,current_a\n";
    write("good.csv", &format!("{head}A,10x5,6,8\nB,11x5,7,9\nC,9x5,4,3\n"));
    write("bad.csv", &format!("{head}D,10x5,x,8\n"));
    let run = quadrig_tests::bench::good_log();
    write("no-names.csv", &run);
    let words = ["select", "good.csv", "bad.csv", "nowhere.csv", "no-names.csv", "-o", "page.html"];
    let said = call(folder.path(), &words).succeeded();
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.contains(&ident::log::digest(run.as_bytes())) && !page.contains("bad.csv"), "the files that gave a pair");
    assert!(said.out.lines().all(|l| l.chars().count() <= 100), "{}", said.out);
    let told = said.out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        told.contains("choice: B with 11x5: 0.78 N per A, most thrust for each ampere of the 2 that meet every need"),
        "{}",
        said.out
    );
    assert!(
        told.contains("next A with 10x5, 0.75 N per A") && told.contains("C with 9x5 gives 1.33 N per A but 16.00 N of 19.62 N"),
        "{}",
        said.out
    );
    let row = told.split_once("no-names.csv not named").expect("the run by its file's name").1;
    assert!(row.contains("18.02 N of 19.62 N in total"), "{row}");
    // runs of one pair are told apart by their files
    let named = run.replacen('\n', "\n# motor = \"570KV\"\n# propeller = \"11x4.7\"\n", 1);
    write("monday.csv", &named);
    write("friday.csv", &named);
    let twice = call(folder.path(), &["select", "monday.csv", "friday.csv"]).succeeded().out;
    assert!(twice.contains("of monday.csv") && twice.contains("of friday.csv"), "{twice}");
    let left_out: Vec<&str> = said.err.lines().collect();
    assert_eq!(left_out.len(), 2, "{}", said.err);
    assert!(left_out[0].starts_with("left out: bad.csv:2: column thrust_n: 'x'"), "{}", said.err);
    assert!(left_out[1].starts_with("left out: nowhere.csv: cannot be read"), "{}", said.err);
    let json: Value = serde_json::from_str(&call(folder.path(), &[&words[..], &["--json"]].concat()).succeeded().out).unwrap();
    assert_eq!((json["left_out"].as_array().unwrap().len(), json["rows"].as_array().unwrap().len()), (2, 4));
    assert!(json["why"].as_str().unwrap().starts_with("choice: B with 11x5"));
    call(folder.path(), &["select", "bad.csv", "nowhere.csv"]).refused(&["none of the 2 files holds a pair", "bad.csv:2"]);
}
