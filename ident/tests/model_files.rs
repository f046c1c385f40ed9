//! A model's two files: constants for a reader, and what it was off by for the program.
//!
//! What it is: they read back as one model; the first stands alone; a second one that is another model's is refused.
//! What can go wrong: a file that is lost without a word, or that is taken for another model's.
//! Units: as stated.
//! Reference: specification `formats.md`, "Powerplant model".

use ident::channel::Context;
use ident::log::{Column, Log};
use ident::model::{FittedTo, Model, beside};
use sha2::{Digest, Sha256};
use std::fs;
use tempfile::TempDir;

/// A model that knows what it was off by, with such an error at standstill.
fn model(error: f64) -> Model {
    let scatter = "[0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]";
    let text = format!(
        "format = \"quadrig-model 1\"\nsource = \"run.csv\"\nstart_pulse_us = 1075.0\n[channel.voltage_v]\nc0_v = 11.5\nc0_v_se = 0.01\nleft_scatter_v = [{scatter}, {scatter}, {scatter}]\nleft_at_krpm = [0.0, 1.0]\nleft_v = [{error}, 0.1]\n[course]\nchanged_s = [0.0, 1.0]\npulse_us = [1000.0, 1200.0]\nt_s = [1.0, 1.1]\nvoltage_v = [0.5, nan]\n"
    );
    Model::parse("m.toml", &text).expect("a model")
}

fn written(folder: &TempDir, model: &Model) -> std::path::PathBuf {
    let (text, second) = model.files();
    let path = folder.path().join("model.toml");
    fs::write(&path, text).expect("a file");
    fs::write(beside(&path), second.expect("a second file")).expect("a file");
    path
}

#[test]
fn two_files_are_one_model() {
    let folder = TempDir::new().expect("a folder");
    let whole = model(0.2);
    let path = written(&folder, &whole);
    assert!(folder.path().join("model.discrepancy.toml").is_file());
    let (text, second) = whole.files();
    let second = second.expect("a second file");
    for key in ["left_v", "left_at_krpm", "[course]"] {
        assert!(!text.contains(key) && second.contains(key), "{key}: for the program alone\n{text}");
    }
    assert!(text.contains("c0_v = 11.5") && text.contains("discrepancy_sha256 = "), "{text}");
    let read = Model::read(&path).expect("both");
    assert!(!read.goes_without());
    assert_eq!(read.to_toml(), whole.to_toml());
    assert_eq!(read.files(), whole.files());
    // a constant that was edited by hand is obeyed, and what it was off by is still its own
    fs::write(&path, text.replace("c0_v = 11.5", "c0_v = 11.0")).expect("a file");
    let edited = Model::read(&path).expect("an edited model");
    assert_eq!((edited.polynomials[0].coefficients[0], edited.leftovers.len()), (11.0, 1));
    // one that knows nothing of the kind is one file
    let bare = Model { leftovers: Vec::new(), course: None, ..whole };
    assert!(bare.files().1.is_none() && !bare.files().0.contains("discrepancy"), "{}", bare.files().0);
}

/// Numbers have the digits of their errors; read and written again they are the same bytes, and a prediction moves by next to nothing.
#[test]
fn numbers_have_the_digits_that_they_support() {
    let third = 1.0 / 3.0;
    let text = format!(
        "format = \"quadrig-model 1\"\nsource = \"run.csv\"\nstart_pulse_us = {}\n[consensus]\nchannels = [\"rpm\"]\n[channel.voltage_v]\nc0_v = {}\nc0_v_se = {}\n[[effect]]\nid = \"supply_sag\"\nchannels = [\"voltage_v\"]\nscope = \"rig\"\nshape = []\n[effect.amplitude.voltage_v]\nresistance_ohm = {}\n[effect.parameter]\nresistance_ohm = {}\nresistance_ohm_se = {}\n",
        1000.0 + third,
        11.0 + third,
        0.01 * third,
        0.1 * third,
        0.1 * third,
        0.001 * third
    );
    let model = Model::parse("m.toml", &text).expect("a model");
    let once = model.to_toml();
    for line in [
        "start_pulse_us = 1000.33333\n",
        "c0_v = 11.33333333\n",
        "c0_v_se = 0.00333\n",
        "resistance_ohm = 0.033333333\n",
        "resistance_ohm_se = 0.000333\n",
    ] {
        assert!(once.contains(line), "{line}{once}");
    }
    let again = Model::parse("m.toml", &once).expect("what was written");
    assert_eq!(again.to_toml(), once, "the same bytes");
    let rows = |of: &dyn Fn(f64) -> f64| (0..50).map(|i| of(f64::from(i))).collect::<Vec<f64>>();
    let columns = [("rpm", rows(&|i| 100.0 * i)), ("current_a", rows(&|i| 0.4 * i)), ("voltage_v", rows(&|i| 11.3 - 0.01 * i))];
    let columns = columns.map(|(name, values)| Column { name: name.into(), values }).to_vec();
    let log = Log { t: rows(&|i| 0.1 * i), columns, ..Log::default() };
    let predict = |model: &Model| model.predict(&Context::new(&log, Some(1000.0)), "voltage_v").expect("a prediction");
    let moved = predict(&model).iter().zip(predict(&again)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 0.01 * 0.01 * third, "{moved} V");
}

#[test]
fn the_first_stands_alone_and_takes_no_strange_second() {
    let folder = TempDir::new().expect("a folder");
    let path = written(&folder, &model(0.2));
    let second = beside(&path);
    let own = fs::read_to_string(&second).expect("its own");
    let log = Log {
        name: "a".into(),
        t: vec![0.0, 1.0],
        columns: vec![Column { name: "voltage_v".into(), values: vec![11.5, 11.5] }],
        ..Log::default()
    };
    let predicted = |model: &Model| model.predict(&Context::new(&log, Some(1075.0)), "voltage_v").expect("a voltage");
    let with = predicted(&Model::read(&path).expect("a model"));

    fs::remove_file(&second).expect("a file");
    let alone = Model::read(&path).expect("a model alone");
    assert!(alone.goes_without() && alone.leftovers.is_empty() && alone.course.is_none());
    assert_eq!(predicted(&alone), with);

    fs::write(&second, model(0.3).files().1.expect("another's")).expect("a file");
    let said = Model::read(&path).expect_err("another's").to_string();
    let text = fs::read_to_string(&path).expect("a model");
    let key = 1 + text.lines().position(|l| l.starts_with("discrepancy_sha256")).expect("a key");
    assert!(
        said.contains(&format!("model.toml:{key}:1: "))
            && said.contains("does not belong to this model")
            && said.contains("expected"),
        "{said}"
    );

    // its own with a list that is too short, and a digest that says so, is refused at its own line
    let short = own.replace("left_v = [0.2, 0.1]", "left_v = [0.2]");
    let digest = |text: &str| Sha256::digest(text).iter().map(|b| format!("{b:02x}")).collect::<String>();
    let text = fs::read_to_string(&path).expect("a model").replace(&digest(&own), &digest(&short));
    fs::write(&second, &short).expect("a file");
    fs::write(&path, text).expect("a file");
    let line = 1 + short.lines().position(|l| l.starts_with("left_v")).expect("a key");
    let said = Model::read(&path).expect_err("a short list").to_string();
    assert!(said.contains(&format!("model.discrepancy.toml:{line}:1: key channel.voltage_v.left_v")), "{said}");

    // the same thing twice in two forms
    let twice = model(0.2).to_toml().replacen("source", &format!("discrepancy_sha256 = \"{}\"\nsource", digest(&own)), 1);
    let said = Model::parse("m.toml", &twice).expect_err("twice").to_string();
    assert!(said.contains("discrepancy_sha256") && said.contains("the same stands in this file"), "{said}");
}

/// Wherever a copy of a model ends early it is refused, at its last line; by hand a number may be changed, and an effect taken out.
#[test]
fn a_model_that_ends_early_is_refused() {
    let folder = TempDir::new().expect("a folder");
    let path = written(&folder, &model(0.2));
    let whole = fs::read_to_string(&path).expect("its own");
    for at in 1..whole.len() - 1 {
        fs::write(&path, &whole[..at]).expect("a file");
        let said = Model::read(&path).expect_err(&whole[..at]).to_string();
        let head = whole.find('\n').expect("a line");
        assert!(at < head || said.contains("the file ends early, after '"), "{at}: {said}");
        assert!(at < head || said.contains(&format!("model.toml:{}:", whole[..at].lines().count())), "{at}: {said}");
    }
    // what a hand wrote, or an older version: no promise, no end
    let bare: String = whole.lines().filter(|line| !line.starts_with('#')).map(|line| format!("{line}\n")).collect();
    for text in [bare, whole.replace("c0_v = 11.5", "c0_v = 11.0"), whole.replace('\n', "\r\n")] {
        fs::write(&path, text).expect("a file");
        Model::read(&path).expect("a model");
    }
    // the file beside it
    fs::write(&path, &whole).expect("a file");
    let second = fs::read_to_string(beside(&path)).expect("its own");
    fs::write(beside(&path), &second[..second.len() / 2]).expect("a file");
    let said = Model::read(&path).expect_err("half of it").to_string();
    assert!(said.contains("does not belong to this model") && said.contains("the whole file that was written with it"), "{said}");
}

/// A model of several runs names each of them, and one of a single run its log.
#[test]
fn a_model_says_whose_it_is() {
    let one = model(0.2);
    assert_eq!(one.runs_in_words(), "run.csv");
    let run = |name: &str| FittedTo { name: name.into(), sha256: String::new(), rows: 9, date: None };
    let all = Model { runs: ["a.csv", "b.csv", "c.csv"].map(run).to_vec(), ..one };
    assert_eq!(all.runs_in_words(), "a.csv, b.csv and c.csv");
}
