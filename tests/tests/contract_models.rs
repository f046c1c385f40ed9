//! Refused models: what `predict` and `close-loop --model` promise whatever file they are given.
//!
//! What it is: the built program on models with one fault each, made by one edit of a model that it wrote itself.
//! What can go wrong: a fault that is accepted and predicts a zero, a message without file and key, a half-written file.
//! Units: in the key of each number.
//! Reference: specification `formats.md`, "Powerplant model".

use quadrig_tests::bench::{Bench, good_log};
use std::fs;

/// Both commands that read a model refuse this text in one line that holds each of `said`, and leave nothing behind.
#[track_caller]
fn refused(bench: &Bench, name: &str, text: &str, said: &[&str]) {
    fs::write(bench.path("bad.toml"), text).unwrap();
    let before = bench.names();
    for words in
        [["predict", "bad.toml", "good.csv", "-o", "out.csv"], ["close-loop", "good.csv", "--json", "--model", "bad.toml"]]
    {
        println!("{name}: quadrig {}", words.join(" "));
        bench.call(&words).refused(&[&["bad.toml", "expected"], said].concat());
        assert_eq!(bench.names(), before, "{name}");
    }
}

#[test]
fn bad_models_are_refused() {
    let bench = Bench::new();
    let model = fs::read_to_string(bench.path("model.toml")).unwrap();
    let format = model.lines().find(|l| l.starts_with("format")).expect("a model names its format").to_owned();
    for (name, text) in [
        ("empty", String::new()),
        ("not TOML", "[channel\n".to_owned()),
        ("another format", model.replacen(&format, "format = \"something else\"", 1)),
        ("no format", model.replacen(&format, "", 1)),
        ("cut in half", model[..model.len() / 2].rsplit_once('=').expect("keys have values").0.to_owned()),
        ("a log", good_log()),
    ] {
        refused(&bench, name, &text, &[]);
    }
}

/// Two effects as the program writes them, to be added to a model.
const EFFECTS: &str = r#"
[[effect]]
id = "zero_drift"
channels = ["thrust_n"]
shape = []
[effect.amplitude.thrust_n]
rate_n_per_s = 0.001
[[effect]]
id = "channel_delay"
channels = ["current_a"]
shape = [0.4]
"#;

/// Each of these was once accepted: the number was dropped, and the prediction was without it.
#[test]
fn numbers_that_a_prediction_needs_are_refused_by_key() {
    let bench = Bench::new();
    let model = fs::read_to_string(bench.path("model.toml")).unwrap() + EFFECTS;
    fs::write(bench.path("good.toml"), &model).unwrap();
    bench.call(&["predict", "good.toml", "good.csv", "-o", "pred.csv"]).succeeded();
    let with = |key: &str, text: &str| -> String {
        let found = model.lines().filter(|l| l.split(" = ").next() == Some(key)).count();
        assert_eq!(found, 1, "{key} stands once in\n{model}");
        let edit = |line: &str| if line.split(" = ").next() == Some(key) { text.to_owned() } else { line.to_owned() } + "\n";
        model.lines().map(edit).collect()
    };
    let swap = |from: &str, to: &str| {
        assert!(model.contains(from), "{from} stands in\n{model}");
        model.replacen(from, to, 1)
    };
    let (drift, delay) = ("effect[0]", "effect[1].shape");
    for (name, text, said) in [
        ("a start that is no number", with("start_pulse_us", "start_pulse_us = nan"), vec!["start_pulse_us", "nan"]),
        ("an infinite coefficient", with("c0_v", "c0_v = inf"), vec!["channel.voltage_v.c0_v", "inf"]),
        ("a gap", with("c1_n_per_krpm", ""), vec!["channel.thrust_n.c1_n_per_krpm", "missing"]),
        ("a last coefficient that is missing", with("c3_a_per_krpm3", ""), vec!["channel.current_a.c3_a_per_krpm3", "missing"]),
        (
            "a coefficient too many",
            with("c2_n_per_krpm2", "c2_n_per_krpm2 = 0.1\nc3_n_per_krpm3 = 1"),
            vec!["channel.thrust_n.c3_n_per_krpm3"],
        ),
        ("a channel that is none", swap("[channel.thrust_n]", "[channel.trust_n]"), vec!["channel.trust_n", "thrust_n"]),
        (
            "an effect on no channel",
            swap("channels = [\"current_a\"]", "channels = [\"curent_a\"]"),
            vec!["effect[1].channels", "curent_a"],
        ),
        (
            "a misspelt amplitude",
            swap("rate_n_per_s", "rat_n_per_s"),
            vec![drift, "amplitude.thrust_n.rat_n_per_s", "rate_n_per_s"],
        ),
        (
            "an amplitude of another channel",
            swap("amplitude.thrust_n", "amplitude.torque_nm"),
            vec![drift, "amplitude.torque_nm", "thrust_n"],
        ),
        (
            "an amplitude that is no number",
            swap("rate_n_per_s = 0.001", "rate_n_per_s = nan"),
            vec![drift, "rate_n_per_s", "nan"],
        ),
        ("a shape that is too short", swap("shape = [0.4]", "shape = []"), vec![delay, "delay"]),
        ("a shape that is too long", swap("shape = [0.4]", "shape = [0.4, 1.0]"), vec![delay, "1 finite number"]),
        ("a shape in words", swap("shape = [0.4]", "shape = [\"0.4\"]"), vec![delay, "0.4"]),
        ("an infinite shape", swap("shape = [0.4]", "shape = [inf]"), vec![delay, "inf"]),
        ("no shape", swap("shape = [0.4]", ""), vec![delay, "missing"]),
    ] {
        refused(&bench, name, &text, &said);
    }
}

/// What nothing reads must not look as if it counted: a parameter that says another thing than what predictions use, and a key that is none.
#[test]
fn numbers_that_no_prediction_reads_are_refused_where_they_stand() {
    let bench = Bench::new();
    let told = "[effect.parameter]\nrate_n_per_s = 0.001\nrate_n_per_s_se = 0.0002\n";
    let effects = EFFECTS.replacen("rate_n_per_s = 0.001\n", &format!("rate_n_per_s = 0.001\n{told}"), 1);
    let effects = format!("{effects}[effect.parameter]\ndelay_s = 0.4\n");
    let model = fs::read_to_string(bench.path("model.toml")).unwrap() + &effects;
    fs::write(bench.path("good.toml"), &model).unwrap();
    bench.call(&["predict", "good.toml", "good.csv", "-o", "pred.csv"]).succeeded();
    // the last line that holds `from` reads `to`; the place of what is wrong is where `to` begins
    let edited = |name: &str, from: &str, to: &str, said: &[&str]| {
        let at = model.rfind(from).unwrap_or_else(|| panic!("{from} stands in\n{model}"));
        let line = model[..at].matches('\n').count() + 1;
        let column = at - model[..at].rfind('\n').map_or(0, |n| n + 1) + 1;
        let text = format!("{}{to}{}", &model[..at], &model[at + from.len()..]);
        let place = format!("bad.toml:{line}:{column}: key ");
        refused(&bench, name, &text, &[&[place.as_str()], said].concat());
    };
    let key = "effect[0].parameter.";
    edited(
        "a rate",
        "rate_n_per_s = 0.001\nrate",
        "rate_n_per_s = 0.002\nrate",
        &[key, "0.002", "0.001", "amplitude.thrust_n.rate_n_per_s"],
    );
    edited("a delay", "delay_s = 0.4", "delay_s = 0.5", &["effect[1].parameter.delay_s", "0.5", "0.4", "shape[0]"]);
    edited("an error", "rate_n_per_s_se = 0.0002", "rate_n_per_s_se = \"small\"", &[key, "small", "a number"]);
    edited("a parameter that is none", "delay_s = 0.4", "window_s = 0.4", &["effect[1].parameter.window_s", "delay"]);
    edited("a key of an effect", "shape = [0.4]", "shapes = 1\nshape = [0.4]", &["effect[1].shapes", "shape"]);
    edited("a key of the file", "start_pulse_us = ", "start_us = 1\nstart_pulse_us = ", &["key start_us", "start_pulse_us"]);
}

/// Until a tachometer has seen its second mark it reads nothing. Those zeros are no readings to judge by, and a prediction says them all the same.
#[test]
fn before_its_second_mark_a_tachometer_is_predicted_to_read_nothing() {
    for sensors in ["", "sensors = { fitted = [\"beam\"] }\n"] {
        let bench = Bench::new();
        let rig = format!("seed = 4\n{sensors}schedule = {{ kind = \"up_down\", step_us = 100, hold_s = 4, top_us = 1800 }}\n");
        fs::write(bench.path("rig.toml"), rig).unwrap();
        bench.call(&["--quiet", "sim", "rig.toml", "-o", "run.csv"]).succeeded();
        bench.call(&["--quiet", "close-loop", "run.csv", "-o", "closed"]).succeeded();
        bench.call(&["--quiet", "predict", "closed/model.toml", "run.csv", "-o", "pred.csv"]).succeeded();
        let verdict: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(bench.path("closed/verdict.json")).unwrap()).unwrap();
        let aside = verdict["set_aside"].as_array().unwrap();
        let silent = aside.iter().find(|a| a["channel"] == "rpm_beam" && a["value"] == 0.0).expect("zeros of the start");
        let [row, rows] = ["row", "rows"].map(|key| silent[key].as_u64().unwrap() as usize);
        // the zeros and no reading after them, on a rig whose only witness is the load as well
        let read = beam(&bench, "run.csv", row, rows + 1);
        assert!(read[..rows].iter().all(|v| *v == Some(0.0)) && read[rows].is_some_and(|v| v > 0.0), "row {row}: {read:?}");
        // and from the first reading on it is the rotor's speed that is predicted
        let said = beam(&bench, "pred.csv", row, rows + 1);
        assert!(said[..rows].iter().all(|v| *v == Some(0.0)) && said[rows].is_some_and(|v| v > 500.0), "row {row}: {said:?}");
    }
}

/// What a table says of the beam's speed, so many rows from one on.
fn beam(bench: &Bench, file: &str, row: usize, rows: usize) -> Vec<Option<f64>> {
    let table = fs::read_to_string(bench.path(file)).unwrap();
    let mut lines = table.lines().filter(|l| !l.starts_with('#'));
    let column = lines.next().unwrap().split(',').position(|c| c == "rpm_beam").unwrap();
    lines.skip(row).map(|l| l.split(',').nth(column)?.parse().ok()).take(rows).collect()
}
