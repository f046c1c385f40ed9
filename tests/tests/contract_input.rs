//! Refused input, whole outputs, repeatable bytes: what the command line promises whatever it is fed.
//!
//! What it is: the built program on broken files; each fault is made by one edit of a good log, so that its place is known.
//! What can go wrong: a fault that is accepted, a message without its place, a second line, a half-written file, memory that
//! grows with a line.
//! Units: as the channels state.
//! Reference: specification `formats.md`, "Command line" and "Rig log".

use quadrig_tests::bench::{Bench, HEAD, PULSES, ROWS, good_log};
use quadrig_tests::{Said, quadrig};
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// One file with a fault, and where it lies.
struct Fault {
    name: &'static str,
    text: String,
    /// What the one line must hold: place and column.
    said: Vec<String>,
    /// Whether `import` refuses it too; the importer repairs some faults of real loggers by a stated rule.
    import: bool,
}

/// The good log with one cell replaced; `row` counts data rows from 1.
fn with_cell(row: usize, column: usize, value: &str) -> String {
    edited(row, |line| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[column] = value;
        cells.join(",")
    })
}

fn edited(row: usize, edit: impl Fn(&str) -> String) -> String {
    let mut lines: Vec<String> = good_log().lines().map(str::to_owned).collect();
    lines[HEAD + row - 1] = edit(&lines[HEAD + row - 1]);
    lines.join("\n") + "\n"
}

fn faults() -> Vec<Fault> {
    let at = |row: usize| format!("broken.csv:{}: ", HEAD + row);
    let cut_at_row = |row: usize, tail: &str| {
        let text = good_log();
        let whole: Vec<&str> = text.lines().take(HEAD + row - 1).collect();
        whole.join("\n") + "\n" + tail
    };
    let header = |from: &str, to: &str| good_log().replacen(from, to, 1);
    let fault =
        |name, text, said: &[&str], import| Fault { name, text, said: said.iter().map(|s| (*s).to_owned()).collect(), import };
    vec![
        fault("truncated in a row", cut_at_row(200, "19.9,1500.0,40"), &[&at(200), "expected"], false),
        fault("truncated after the header", cut_at_row(1, ""), &["broken.csv:", "expected"], true),
        fault("thrust in grams", header("thrust_n", "thrust_g"), &["broken.csv:3: ", "column thrust_g", "thrust_n"], false),
        fault("pulse in milliseconds", header("pulse_us", "pulse_ms"), &["broken.csv:3: ", "column pulse_ms", "pulse_us"], false),
        fault("pulse as duty in percent", with_cell(90, 1, "7.5"), &[&at(90), "column pulse_us", "7.5"], false),
        fault("not a number", with_cell(33, 3, "NaN"), &[&at(33), "column thrust_n", "NaN"], false),
        fault("infinite", with_cell(34, 4, "-inf"), &[&at(34), "column current_a", "inf"], false),
        fault("a word", with_cell(35, 5, "twelve"), &[&at(35), "column voltage_v", "twelve"], true),
        fault("a repeated time stamp", with_cell(50, 0, "4.8"), &[&at(50), "column t_s", "repeats"], false),
        fault("a time stamp that steps back", with_cell(60, 0, "1.0"), &[&at(60), "column t_s", "back"], false),
        fault("a missing time stamp", with_cell(61, 0, ""), &[&at(61), "column t_s"], false),
        fault(
            "a missing field",
            edited(70, |line| line.rsplit_once(',').expect("a row has commas").0.to_owned()),
            &[&at(70), "expected"],
            true,
        ),
        fault("a surplus field", edited(71, |line| format!("{line},1")), &[&at(71), "expected"], true),
        fault("no time column", header("t_s,pulse_us", "seconds,pulse_us"), &["broken.csv:3: ", "column seconds", "t_s"], false),
        fault("time alone", "# quadrig-log 1\nt_s\n0\n1\n".to_owned(), &["broken.csv:2: ", "expected"], false),
        fault("a column twice", header("current_a", "thrust_n"), &["broken.csv:3: ", "column thrust_n"], true),
        fault("no known channel", "# quadrig-log 1\nt_s,a,b\n0,1,2\n1,2,3\n".to_owned(), &["broken.csv"], true),
        fault("empty", String::new(), &["broken.csv:1: ", "empty"], true),
    ]
}

/// The commands that read a log.
fn readers(log: &str) -> [Vec<&str>; 5] {
    [
        vec!["identify", log, "-o", "out.toml"],
        vec!["close-loop", log, "-o", "out", "--json"],
        vec!["close-loop", "good.csv", "--validate", log, "-o", "out", "--json"],
        vec!["predict", "model.toml", log, "-o", "out.csv"],
        vec!["predict", "model.toml", log, "-o", "out.csv", "--from", "command"],
    ]
}

#[test]
fn the_good_log_is_good() {
    let bench = Bench::new();
    // one that is a run to judge by as well: no run judges itself
    fs::write(bench.path("again.csv"), good_log()).unwrap();
    for words in readers("again.csv") {
        bench.call(&words).succeeded();
    }
    bench.call(&["import", "good.csv", "-o", "imported.csv"]).succeeded();
    assert!(fs::read_to_string(bench.path("imported.csv")).unwrap().starts_with("# quadrig-log 1\n"));
}

/// A sensor that answered three times in a run says nothing: the verdict is that of the log without its column, and names it.
#[test]
fn a_nearly_empty_column_costs_no_other_channel_its_verdict() {
    let bench = Bench::new();
    let with_hall = |keep: &dyn Fn(usize) -> bool| -> String {
        let more = |(n, line): (usize, &str)| match n.checked_sub(HEAD) {
            None if n + 1 == HEAD => format!("{line},rpm_hall\n"),
            None => format!("{line}\n"),
            Some(row) => format!("{line},{}\n", if keep(row) { line.split(',').nth(2).unwrap_or_default() } else { "" }),
        };
        good_log().lines().enumerate().map(more).collect()
    };
    let sparse_voltage: String = good_log()
        .lines()
        .enumerate()
        .map(|(n, line)| match line.rsplit_once(',') {
            Some((rest, _)) if n >= HEAD && n % 150 != 0 => format!("{rest},\n"),
            _ => format!("{line}\n"),
        })
        .collect();
    let without_voltage: String = good_log()
        .lines()
        .map(|line| if line.starts_with('#') { line } else { line.rsplit_once(',').unwrap().0 }.to_owned() + "\n")
        .collect();
    for (name, sparse, without, samples) in
        [("voltage_v", sparse_voltage, without_voltage, 2), ("rpm_hall", with_hall(&|row| row % 100 == 7), good_log(), 5)]
    {
        let verdict = |text: &str| -> (serde_json::Value, Said) {
            fs::write(bench.path("run.csv"), text).unwrap();
            let said = bench.call(&["close-loop", "run.csv", "-o", "out", "--json"]).succeeded();
            (serde_json::from_str(&said.out).expect("a verdict"), said)
        };
        let (expected, quiet) = verdict(&without);
        let (mut found, said) = verdict(&sparse);
        let left_out = found.as_object_mut().expect("an object").remove("left_out").expect("names what it left out");
        assert_eq!(left_out, serde_json::json!([{"channel": name, "samples": samples}]));
        assert_eq!(found, expected, "{name}");
        let line = format!("run.csv: column {name}: {samples} samples; expected more than 8; the channel is left out\n");
        assert_eq!((said.err, quiet.err), (line, String::new()));
        assert!(fs::read_to_string(bench.path("out/report.html")).unwrap().contains(&format!("Left out: column {name}")));
    }
}

#[test]
fn faults_of_a_log_are_refused_with_their_place() {
    let bench = Bench::new();
    for fault in faults() {
        fs::write(bench.path("broken.csv"), &fault.text).unwrap();
        let before = bench.names();
        let said: Vec<&str> = fault.said.iter().map(String::as_str).collect();
        for words in readers("broken.csv") {
            if fault.name == "no known channel" && words.contains(&"--validate") {
                continue; // a run to validate on may lack channels: it is then reported without them
            }
            println!("{}: quadrig {}", fault.name, words.join(" "));
            bench.call(&words).refused(&said);
            assert_eq!(bench.names(), before, "{}: something was left behind", fault.name);
        }
    }
}

#[test]
fn the_importer_refuses_what_no_rule_repairs() {
    let bench = Bench::new();
    for fault in faults().into_iter().filter(|fault| fault.import) {
        fs::write(bench.path("broken.csv"), &fault.text).unwrap();
        let before = bench.names();
        println!("{}", fault.name);
        bench.call(&["import", "broken.csv", "-o", "out.csv"]).refused(&["broken.csv", "expected"]);
        assert_eq!(bench.names(), before, "{}: something was left behind", fault.name);
    }
}

/// Rows that are missing in blocks of seconds are told with the likely reason, on the terminal and on the page; where the head promises a rate they
/// are refused.
#[test]
fn blocks_of_missing_rows_are_told_or_refused() {
    let bench = Bench::new();
    let good = good_log();
    let (head, rows): (Vec<&str>, Vec<&str>) = (good.lines().take(HEAD).collect(), good.lines().skip(HEAD).collect());
    // five seconds of every twenty
    let kept: Vec<&str> = rows.iter().enumerate().filter(|(i, _)| i % 200 < 150).map(|(_, row)| *row).collect();
    let text = [head.clone(), kept].concat().join("\n") + "\n";
    fs::write(bench.path("holes.csv"), text.replace("# sample_hz", "# rate_was")).unwrap();
    for words in [
        vec!["import", "holes.csv", "-o", "out.csv"],
        vec!["identify", "holes.csv", "-o", "out.toml", "--report", "out.html"],
        vec!["close-loop", "holes.csv", "-o", "closed"],
    ] {
        let said = bench.call(&words).succeeded();
        let all = said.out + &said.err;
        assert!(all.contains("of the time has no row") && all.contains("the motor turned"), "{words:?}: {all}");
    }
    for page in ["out.html", "closed/report.html"] {
        assert!(fs::read_to_string(bench.path(page)).unwrap().contains("of the time has no row"), "{page}");
    }
    fs::write(bench.path("promised.csv"), text).unwrap();
    for words in [vec!["identify", "promised.csv", "-o", "p.toml"], vec!["close-loop", "promised.csv", "-o", "p"]] {
        bench.call(&words).refused(&["promised.csv", "rows are missing that sample_hz = 10 promises", "rows were dropped"]);
    }
    // what is shown and not kept is said to be
    let said = bench.call(&["close-loop", "holes.csv"]).succeeded();
    assert!(said.err.contains("nothing was written; with -o FOLDER"), "{}", said.err);
    assert!(bench.call(&["close-loop", "--help"]).succeeded().out.contains("Without it nothing is written"));
}

#[test]
fn the_importer_refuses_a_unit_that_it_does_not_know() {
    let bench = Bench::new();
    fs::write(bench.path("export.csv"), "Time (s),Motor Electrical Speed (RPM),Thrust (stone)\n0,1000,1\n1,2000,4\n").unwrap();
    let before = bench.names();
    bench.call(&["import", "export.csv", "-o", "out.csv"]).refused(&["export.csv:1: ", "column Thrust (stone)", "expected"]);
    bench
        .call(&["import", "export.csv", "-o", "out.csv", "--map", "thrust_n=Load*9.81"])
        .refused(&["export.csv:1: ", "column Load"]);
    assert_eq!(bench.names(), before);
    bench.call(&["import", "export.csv", "-o", "out.csv", "--map", "thrust_n=Thrust (stone)*62.275"]).succeeded();
}

#[test]
fn the_importer_repairs_by_stated_rules_and_counts() {
    let bench = Bench::new();
    for (name, text, rule) in [
        ("repeated", with_cell(50, 0, "4.8"), "repeat the row before"),
        ("backward", with_cell(60, 0, "1.0"), "step back"),
        ("cut", good_log() + "42.0,1000.0,0", "cut short"),
        ("a word for no value", with_cell(33, 3, "NaN"), "words or signs for no value"),
    ] {
        fs::write(bench.path("export.csv"), text).unwrap();
        let said = bench.call(&["import", "export.csv", "-o", "out.csv"]).succeeded();
        assert!(said.out.contains(rule), "{name}: {}", said.out);
        // what it writes is a log that every other command takes
        bench.call(&["--quiet", "identify", "out.csv", "-o", "out.toml"]).succeeded();
    }
}

/// A line of a gigabyte is refused in bounded memory: the whole address space of the process is limited to less than that.
#[cfg(unix)]
#[test]
fn a_line_of_a_gigabyte_costs_no_memory() {
    let bench = Bench::new();
    let mut file = File::create(bench.path("broken.csv")).unwrap();
    file.write_all(good_log().as_bytes()).unwrap();
    file.set_len(1 << 30).unwrap(); // a hole: it takes no room on the disk, and reads as one line of zero bytes
    drop(file);
    let limited = |words: &[&str]| {
        let output = Command::new("sh")
            .args(["-c", "ulimit -v 600000 && exec \"$0\" \"$@\""])
            .arg(quadrig())
            .args(words)
            .current_dir(bench.folder())
            .stdin(Stdio::null())
            .output()
            .unwrap();
        Said::new(words, output)
    };
    limited(&["--quiet", "identify", "good.csv", "-o", "model.toml"]).succeeded(); // the limit itself is no hindrance
    let line = format!("broken.csv:{}: a line longer than", HEAD + PULSES.len() * ROWS + 1);
    for words in readers("broken.csv").iter().map(Vec::as_slice).chain([["import", "broken.csv", "-o", "out.csv"].as_slice()]) {
        println!("quadrig {}", words.join(" "));
        limited(words).refused(&[&line]);
    }
    limited(&["predict", "broken.csv", "good.csv", "-o", "out.csv"]).refused(&["broken.csv"]); // as a model
}

#[test]
fn absent_inputs_are_refused_by_name() {
    let bench = Bench::new();
    let before = bench.names();
    for words in readers("nowhere.csv").iter().map(Vec::as_slice).chain([["import", "nowhere.csv", "-o", "out.csv"].as_slice()]) {
        bench.call(words).refused(&["nowhere.csv"]);
    }
    bench.call(&["predict", "nowhere.toml", "good.csv", "-o", "out.csv"]).refused(&["nowhere.toml"]);
    bench.call(&["close-loop", ".", "--json"]).refused(&[]);
    assert_eq!(bench.names(), before);
}

/// An output that cannot be written is refused by name. (A file in the place of a folder: permissions do not stop root.)
#[test]
fn unwritable_outputs_are_refused_by_name() {
    let bench = Bench::new();
    fs::write(bench.path("taken"), "a file\n").unwrap();
    fs::create_dir(bench.path("folder")).unwrap();
    let before = bench.names();
    for words in [
        ["--quiet", "identify", "good.csv", "-o", "taken/model.toml"].as_slice(),
        &["--quiet", "identify", "good.csv", "-o", "absent/deep/model.toml"],
        &["--quiet", "identify", "good.csv", "-o", "folder"],
        &["--quiet", "import", "good.csv", "-o", "absent/deep/log.csv"],
        &["--quiet", "import", "good.csv", "-o", "folder"],
        &["predict", "model.toml", "good.csv", "-o", "absent/deep/pred.csv"],
        &["--quiet", "close-loop", "good.csv", "-o", "taken"],
        &["--quiet", "close-loop", "good.csv", "-o", "taken/out"],
    ] {
        println!("quadrig {}", words.join(" "));
        let output = words.last().expect("the output is the last word");
        bench.call(words).refused(&[output]);
        assert_eq!(bench.names(), before);
        assert_eq!(fs::read_dir(bench.path("folder")).unwrap().count(), 0);
        assert_eq!(fs::read_to_string(bench.path("taken")).unwrap(), "a file\n");
    }
}

#[test]
fn wrong_usage_is_status_two() {
    let bench = Bench::new();
    let before = bench.names();
    for words in [
        ["no-such-command"].as_slice(),
        &[],
        &["import"],
        &["import", "good.csv"],
        &["identify", "good.csv"],
        &["identify", "good.csv", "-o"],
        &["identify", "good.csv", "-o", "out.toml", "--no-such-flag"],
        &["close-loop"],
        &["close-loop", "good.csv", "--model"],
        &["predict", "model.toml", "-o", "out.csv"],
        &["predict", "model.toml", "good.csv", "-o", "out.csv", "--from", "nowhere"],
        &["import", "good.csv", "-o", "out.csv", "--map", "thrust"],
        &["import", "good.csv", "-o", "out.csv", "--map", "thrust_n=Load*heavy"],
        &["import", "good.csv", "-o", "out.csv", "--map", "thrust_n=Load*nan"],
        &["import", "good.csv", "-o", "out.csv", "--map", "thrust_n=Load*1e999"],
        &["import", "good.csv", "-o", "out.csv", "--map", "thrust_n=Load*0"],
        &["import", "good.csv", "-o", "out.csv", "--map", "thrust_n=Load*2+inf"],
        &["import", "good.csv", "-o", "out.csv", "--meta", "mass_kg=nan"],
        &["demo", "--effect", "gremlin"],
        &["export", "model.toml", "--to", "nowhere"],
        &["completions", "nosuchshell"],
    ] {
        let said = bench.call(words);
        assert_eq!(said.status, Some(2), "`quadrig {}`: {}", said.words, said.err);
        assert_eq!(said.out, "", "`quadrig {}`", said.words);
        assert!(said.err.contains("Usage") || said.err.contains("--help"), "`quadrig {}`: {}", said.words, said.err);
        assert_eq!(bench.names(), before);
    }
    for words in [["--help"].as_slice(), &["--version"], &["close-loop", "--help"]] {
        assert!(!bench.call(words).succeeded().out.is_empty());
    }
}

/// The names of every file under a folder, with their bytes.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(contents(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            found.push((name, fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}

#[test]
fn the_same_input_twice_gives_the_same_bytes() {
    let once = || {
        let bench = Bench::new();
        let said: Vec<String> = [
            ["import", "good.csv", "-o", "imported.csv"].as_slice(),
            &["identify", "good.csv", "-o", "model.toml"],
            &["close-loop", "good.csv", "--validate", "imported.csv", "-o", "out", "--json"],
            &["predict", "out/model.toml", "good.csv", "-o", "pred.csv"],
            &["predict", "out/model.toml", "good.csv", "-o", "command.csv", "--from", "command"],
        ]
        .into_iter()
        .map(|words| bench.call(words).succeeded().out)
        .collect();
        (said, contents(bench.folder()))
    };
    let ((said, files), (said_again, files_again)) = (once(), once());
    assert_eq!(said, said_again);
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        [
            "command.csv",
            "good.csv",
            "imported.csv",
            "model.toml",
            "out/.quadrig.sha256",
            "out/model.discrepancy.toml",
            "out/model.toml",
            "out/report.html",
            "out/verdict.json",
            "pred.csv"
        ]
    );
    for (one, other) in files.iter().zip(&files_again) {
        assert!(one == other, "{} differs from run to run", one.0);
    }
}

#[test]
fn predictions_stand_row_for_row() {
    let bench = Bench::new();
    bench.call(&["predict", "model.toml", "good.csv", "-o", "pred.csv"]).succeeded();
    let pred = fs::read_to_string(bench.path("pred.csv")).unwrap();
    let lines: Vec<&str> = pred.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(lines.len(), 1 + PULSES.len() * ROWS);
    assert_eq!(lines[0], "t_s,rpm,thrust_n,current_a,voltage_v");
    assert!(pred.ends_with('\n'));
}

#[test]
fn json_on_standard_output_is_the_verdict_and_nothing_else() {
    let bench = Bench::new();
    let said = bench.call(&["close-loop", "good.csv", "-o", "out", "--json"]).succeeded();
    let verdict: serde_json::Value = serde_json::from_str(&said.out).expect("one JSON document");
    assert_eq!(verdict["format"], "quadrig-verdict 2");
    assert_eq!(verdict["run"], "good.csv");
    assert!(verdict["unexplained"].is_array());
    let scopes = verdict["effects"].as_array().expect("effects").iter().map(|e| e["scope"].as_str().expect("a scope"));
    assert!(scopes.into_iter().all(|s| ["rig", "run", "event"].contains(&s)), "{verdict}");
    assert_eq!(said.out, fs::read_to_string(bench.path("out/verdict.json")).unwrap());
}

/// An export goes straight into the commands, by the same importer: each conversion is said, and what comes out is what the imported log gives.
#[test]
fn exports_are_taken_directly() {
    let bench = Bench::new();
    let bare: String = good_log().lines().skip(2).map(|l| format!("{l}\n")).collect();
    let grams = |line: &str| -> String {
        let cells: Vec<&str> = line.split(',').collect();
        let thrust = cells[3].parse::<f64>().map_or_else(|_| "Thrust (gf)".to_owned(), |n| format!("{:.4}", n / 9.806_65e-3));
        [cells[0], cells[1], cells[2], &thrust, cells[4], cells[5]].join(";") + "\n"
    };
    let export: String = bare.lines().map(grams).collect::<String>().replace('.', ",");
    fs::write(bench.path("export.csv"), export).unwrap();
    let named = ["--motor", "M 1", "--propeller", "P 2"];
    bench.call(&[&["--quiet", "import", "export.csv", "-o", "imported.csv"], &named[..]].concat()).succeeded();
    let head = fs::read_to_string(bench.path("imported.csv")).unwrap();
    assert!(head.contains("# motor = \"M 1\"\n") && head.contains("# propeller = \"P 2\"\n"), "{head}");
    // what fed the rig, and when, travel with the log too
    let fed = ["import", "export.csv", "-o", "fed.csv", "--supply", "3S 2200 mAh", "--date", "2026-03-12"];
    bench.call(&[&["--quiet"], &fed[..]].concat()).succeeded();
    let head = fs::read_to_string(bench.path("fed.csv")).unwrap();
    assert!(head.contains("# supply = \"3S 2200 mAh\"\n") && head.contains("# date = \"2026-03-12\"\n"), "{head}");
    let refused = bench.call(&["import", "export.csv", "-o", "never.csv", "--date", "12.3.26"]);
    assert!(refused.err.contains("expected a day such as 2026-03-12"), "{}", refused.err);
    assert!(!bench.path("never.csv").exists());
    let twice = |words: &[&str]| -> [Said; 2] {
        ["export.csv", "imported.csv"].map(|log| {
            let words: Vec<&str> = words.iter().map(|w| if *w == "LOG" { log } else { w }).collect();
            bench.call(&words).succeeded()
        })
    };
    for words in
        [["identify", "LOG", "-o", "out.toml"].as_slice(), &["select", "LOG"], &["predict", "model.toml", "LOG", "-o", "out.csv"]]
    {
        let words = if words[0] == "select" {
            [words, &["--motor", "M 1", "--propeller", "P 2"]].concat()
        } else {
            [words, &named].concat()
        };
        let [direct, imported] = twice(&words);
        assert_eq!(direct.out, imported.out, "{words:?}");
        assert!(direct.err.contains("thrust_n: column 'Thrust (gf)' converted, times 0.00980665"), "{}", direct.err);
        assert!(direct.err.contains("decimal comma") && imported.err.is_empty(), "{}", imported.err);
    }
    let [direct, imported] = twice(&[&["close-loop", "LOG", "--json"], &named[..]].concat());
    assert_eq!(direct.out.replace("export.csv", "imported.csv"), imported.out);
    // nobody's name is made up, and two runs stay apart
    let said = bench.call(&["select", "export.csv", "--thrust", "4"]).succeeded();
    assert!(said.out.contains("choice: export.csv: ") && !said.out.contains("? with"), "{}", said.out);
    bench
        .call(&["identify", "imported.csv", "-o", "out.toml", "--map", "rpm=n"])
        .refused(&["--map rpm=...: imported.csv is a rig log"]);
    bench.call(&["import", "imported.csv", "-o", "out.csv", "--rotor", "1"]).refused(&["--rotor 1: imported.csv is no PX4 ULog"]);
}
