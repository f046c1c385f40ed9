//! The recorded part of the page: a verdict a trial, and the residual of one before and after.
//!
//! What it is: every shared BROAD trial through the command line; the figure comes from the two prediction files of its loop.
//! What can go wrong: absent data; nothing is then written but that.
//! Units: uT, m/s^2.
//! Reference: README of the recorded trials.

use ident::log::write_whole;
use ident::report::{Figure, Layer};
use quadrig_tests::inertial::{Answer, ask};
use std::io::Read;
use std::path::Path;

const FIELD: [&str; 3] = ["mx", "my", "mz"];
const FORCE: [&str; 3] = ["ax", "ay", "az"];
/// The trial of the figure, and its channel.
const DRAWN: (&str, &str) = ("35_disturbed_attached_magnet_4cm", "mz");

/// Name and text of each trial; none without the data.
pub(super) fn trials() -> Vec<(String, String)> {
    let Some(data) = quadrig_tests::data("BROAD trials") else { return Vec::new() };
    let read = |file: std::path::PathBuf| {
        let mut text = String::new();
        let done = std::fs::File::open(&file).and_then(|f| flate2::read::GzDecoder::new(f).read_to_string(&mut text));
        assert!(done.is_ok(), "{}: cannot be read", file.display());
        (file.file_name().unwrap_or_default().to_string_lossy().replace(".csv.gz", ""), text)
    };
    quadrig_tests::files(&data.join("ahrs/broad"), |name| name.ends_with(".csv.gz")).into_iter().map(read).collect()
}

/// The table and the figure.
pub(super) fn recorded(folder: &Path) {
    let trials = trials();
    if trials.is_empty() {
        println!("\nThe recorded trials were not there.");
        return;
    }
    print!("{}", include_str!("recorded.md"));
    println!("| half | trial | verdict | named | field before -> after, uT | force before -> after, m/s^2 |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (n, (name, text)) in trials.iter().enumerate() {
        let drawn = name == DRAWN.0;
        let answer = ask(folder, name, text, drawn.then_some("drawn"));
        let pair = |channels: [&str; 3]| match (answer.heldout(channels, "before"), answer.heldout(channels, "after")) {
            (Some(b), Some(a)) => format!("{b:.2} -> {a:.2}"),
            _ => "-".to_owned(),
        };
        let half = if n % 2 == 0 { "A" } else { "B" };
        println!("| {half} | {name} | {} | {} | {} | {} |", answer.verdict, named(&answer), pair(FIELD), pair(FORCE));
        if drawn {
            draw(text, &folder.join("drawn"));
        }
    }
}

/// A column of a table; a field that is empty is not a number.
fn column(text: &str, name: &str) -> Vec<f64> {
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let place = lines.next().and_then(|head| head.split(',').position(|n| n.trim() == name)).expect("the column");
    lines.map(|l| l.split(',').nth(place).and_then(|w| w.trim().parse().ok()).unwrap_or(f64::NAN)).collect()
}

/// The residual of one channel before and after, means over a tenth of a second.
fn draw(log: &str, folder: &Path) {
    let (t, measured) = (column(log, "t_s"), column(log, DRAWN.1));
    let line = |name: &str, class: &'static str, file: &str| {
        let text = std::fs::read_to_string(folder.join(file)).expect("the loop wrote it");
        let left: Vec<f64> = measured.iter().zip(column(&text, DRAWN.1)).map(|(m, p)| m - p).collect();
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for (t, left) in t.chunks(28).zip(left.chunks(28)) {
            let heard: Vec<f64> = left.iter().copied().filter(|r| r.is_finite()).collect();
            if !heard.is_empty() {
                x.push((t[0] * 100.0).round() / 100.0);
                y.push((heard.iter().sum::<f64>() / heard.len() as f64 * 1000.0).round() / 1000.0);
            }
        }
        Layer::Line { name: name.to_owned(), class, x, y }
    };
    let figure = Figure {
        id: "ahrs-causes".to_owned(),
        title: format!("{}, {}: measured - predicted", DRAWN.0, DRAWN.1),
        x_label: "time, s".to_owned(),
        y_label: "residual, uT".to_owned(),
        layers: vec![line("declared model", "b", "declared.csv"), line("with the named causes", "a", "pred.csv")],
        height: 260.0,
        categories: Vec::new(),
        captioned: false,
    };
    let file = quadrig_tests::root().join("docs/ahrs-causes.svg");
    write_whole(&file, |out| out.write_all(figure.file().as_bytes())).expect("docs/ can be written");
}
/// The effects with the number that tells most of each.
fn named(answer: &Answer) -> String {
    let number = |id: &str, name: &str, unit: &str, scale: f64| {
        answer.parameter(id, name).map_or(String::new(), |(v, _)| format!(" {:.1} {unit}", v * scale))
    };
    let norm = |id: &str, names: [&str; 3], unit: &str, scale: f64| {
        let parts = names.map(|n| answer.parameter(id, n).map_or(0.0, |p| p.0 * scale));
        format!(" {:.1} {unit}", parts.iter().map(|p| p * p).sum::<f64>().sqrt())
    };
    let one = |id: &String| {
        let size = match id.as_str() {
            "channel_delay" => number(id, "delay", "ms", 1e3),
            "stationary_magnet" => number(id, "rms", "uT rms", 1.0),
            "hard_iron" => norm(id, ["offset_x", "offset_y", "offset_z"], "uT", 1.0),
            "lever_arm" => norm(id, ["arm_x", "arm_y", "arm_z"], "cm", 100.0),
            "linear_acceleration" => norm(id, ["rms_north", "rms_east", "rms_down"], "m/s^2", 1.0),
            "vibration" => number(id, "frequency", "Hz", 1.0) + &number(id, "rms", "m/s^2", 1.0),
            _ => String::new(),
        };
        format!("`{id}`{size}")
    };
    answer.ids.iter().map(one).collect::<Vec<_>>().join(", ")
}
