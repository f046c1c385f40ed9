//! The page of an identified run: every figure that the thesis draws from one.
//!
//! What it is: channels over time with plateaus marked, channel differences, the first filter of the binary shift algorithm, the
//! relations with fits and bands, two runs side by side, and the tables behind them.
//! What can go wrong: a channel that the log lacks leaves its figures out.
//! Units: on the axes.
//! Reference: Beharie 2013, Figures 5.22 to 5.25, 5.56 to 5.79.

use super::designer::{designer, paired};
use super::figure::{Figure, Layer, Mark};
use super::sheet::Sheet;
use super::shift::filter_figures;
use crate::channel::unit_of;
use crate::identify::curves::power::Level;
use crate::identify::curves::{Fitted, Law, ratio};
use crate::identify::{Constant, Identified};
use crate::log::board;
use crate::log::{Gaps, Log, SPEED};
use crate::numeric::digits::significant;
use crate::numeric::order::median;
use crate::plateau::shift::{Settings, filters};
use crate::plateau::{Plateau, so_many};
use crate::verdict::words::{self, axis, channel, heading, upper};

/// Colours of the speed channels.
pub(super) const CLASSES: [&str; 5] = ["a", "b", "c", "e", "f"];

/// The page of a run; `other` is a second run to be laid beside it (with and without the encoder, Figures 5.22 to 5.25).
#[must_use]
pub fn run(log: &Log, found: &Identified, other: Option<(&Log, &Identified)>) -> Sheet {
    let mut sheet = Sheet::told(&format!("Identification of {}", log.name), &headline(found));
    sheet.soft(&lead(log, found));
    if let Some(gaps) = Gaps::of(log) {
        sheet.warn(&format!("{gaps}."));
    }
    constants(&mut sheet, found);
    sheet.section(if found.plateaus.is_empty() { "The run" } else { "The run, with its plateaus" });
    let time: Vec<Figure> =
        ["thrust_n", "torque_nm", "current_a", "voltage_v"].iter().filter_map(|c| over_time(log, found, c)).collect();
    sheet.figures([speeds_over_time(log, found), time].concat());
    sheet.figures(over_current(log, found).into_iter().collect());
    sheet.section("How the plateaus come about");
    sheet.figures(binary_shift(log, found));
    if !found.plateaus.is_empty() {
        relations(&mut sheet, found);
    }
    if let Some((log_b, found_b)) = other {
        sheet.section(&format!("Beside {}", log_b.name));
        sheet.figures(side_by_side((log, found), (log_b, found_b)));
    }
    if !found.plateaus.is_empty() {
        sheet.section("Plateaus");
        sheet.say("Half widths of 95 % intervals beside the means.");
        plateaus(&mut sheet, log, found);
        sheet.section("Coefficients");
        coefficients(&mut sheet, found);
    }
    let told = board::told(log);
    if !told.is_empty() {
        sheet.section("What the board told");
        let rows: Vec<Vec<String>> = told.into_iter().map(|line| vec![line]).collect();
        sheet.table(&["flags, and events with their times"], &rows, |_| false);
    }
    origin(&mut sheet, std::iter::once(log).chain(other.map(|(log, _)| log)));
    sheet
}

/// What the plateaus tell together.
fn relations(sheet: &mut Sheet, found: &Identified) {
    sheet.section("Relations, with 95 % bands");
    if !found.curves.is_empty() {
        sheet.say("Dark band: where the curve lies. Light band: where a further plateau would lie. Rings: plateau means with their 95 % intervals; point at one to read it.");
    }
    sheet.figures(found.curves.iter().map(relation).collect());
    sheet.section("Power, efficiency, coefficients");
    designer(sheet, found, |figure| figure);
}

/// The program, and the logs with their digests.
fn origin<'l>(sheet: &mut Sheet, logs: impl Iterator<Item = &'l Log>) {
    sheet.section("Where this comes from");
    let mut rows = vec![["Program".to_owned(), format!("quadrig {}", env!("CARGO_PKG_VERSION"))].to_vec()];
    for log in logs {
        rows.push(["Log".to_owned(), log.name.clone()].to_vec());
        rows.push(["SHA-256".to_owned(), log.digest()].to_vec());
        rows.push(["Rows".to_owned(), log.len().to_string()].to_vec());
    }
    sheet.data("provenance", &["what", "value"], &rows, None);
}

fn lead(log: &Log, found: &Identified) -> String {
    let text = |key: &str| log.meta.get(key).and_then(toml::Value::as_str);
    let rig: Vec<String> = ["motor", "propeller", "supply"].iter().filter_map(|k| text(k).map(str::to_owned)).collect();
    let rig = if rig.is_empty() { String::new() } else { format!("{}. ", rig.join(", ")) };
    format!(
        "{}: {rig}{} rows over {:.1} {}, reduced to {}.",
        log.name,
        log.len(),
        log.t.last().unwrap_or(&0.0) - log.t.first().unwrap_or(&0.0),
        if log.time_is_row() { "rows" } else { "s" },
        so_many(found.plateaus.len())
    )
}

/// Said in the place of all that comes from plateaus.
const NO_PLATEAU: &str = "No plateau was found: the load never held still long enough for a mean, so that there are no levels, curves or coefficients. Hold each level for some seconds.";

/// What the powerplant does at its highest level, and which law does not hold, in plain words.
#[must_use]
pub fn headline(found: &Identified) -> String {
    let mut out = highest(&found.levels).unwrap_or_else(|| match found.plateaus.len() {
        0 => NO_PLATEAU.to_owned(),
        1 => "1 plateau was found, without a thrust.".to_owned(),
        n => format!("{n} plateaus were found, none of them with a thrust."),
    });
    let broken: Vec<String> = found
        .constants
        .iter()
        .filter(|c| c.law.is_some_and(|l| !l.holds))
        .map(|c| format!("{} ({})", c.words(), c.name))
        .collect();
    if let [first, rest @ ..] = broken.as_slice() {
        let are = if rest.is_empty() { "is no constant" } else { "are no constants" };
        let which = if rest.is_empty() { first.clone() } else { words::list(&broken) };
        out += &format!(" {} {are} over these levels: intervals are widened to what the levels show.", upper(&which));
    }
    out
}

/// "At 2000 us the rotor lifts 6.1 N at 7410 rev/min, for 84 W: 7.4 g/W."
fn highest(levels: &[Level]) -> Option<String> {
    let thrust = |l: &&Level| l.of("thrust_n").map_or(f64::NEG_INFINITY, |v| v.0);
    let level = levels.iter().max_by(|a, b| thrust(a).total_cmp(&thrust(b)))?;
    let said = |name: &str, unit: &str| level.of(name).map(|(v, se)| format!("{} {unit}", words::digits(v, 1.96 * se)));
    let mut out = match level.of("pulse_us") {
        Some((pulse, _)) => format!("At {pulse:.0} us the rotor lifts {}", said("thrust_n", "N")?),
        None => format!("On its highest level the rotor lifts {}", said("thrust_n", "N")?),
    };
    out += &said("rpm", "rev/min").map(|v| format!(" at {v}")).unwrap_or_default();
    out += &said("electrical_w", "W").map(|v| format!(", for {v}")).unwrap_or_default();
    out += &said("g_per_w", "g/W").map(|v| format!(": {v}")).unwrap_or_default();
    Some(out + ".")
}

pub(super) fn constants(sheet: &mut Sheet, found: &Identified) {
    if found.constants.is_empty() {
        return;
    }
    let rows: Vec<Vec<String>> = found
        .constants
        .iter()
        .map(|c| {
            let [value, low, high] = words::with_interval(c.value, [c.value - c.half, c.value + c.half]);
            let interval = format!("{low} to {high}");
            let law = c.law.map_or_else(|| "-".to_owned(), |law| law.words()) + hardly(c);
            vec![format!("{}, {}", c.words(), c.name), value, interval, c.unit.to_owned(), law]
        })
        .collect();
    let all = |v: f64| format!("{v}");
    let raw: Vec<Vec<String>> = found
        .constants
        .iter()
        .map(|c| {
            let name = [c.name, c.words()].map(str::to_owned);
            let figures = [c.value, c.se, c.value - c.half, c.value + c.half].map(all);
            name.into_iter().chain(figures).chain([c.unit.to_owned()]).collect()
        })
        .collect();
    let raw_head = ["constant", "what", "value", "standard_error", "low_95", "high_95", "unit"];
    sheet.data("constants", &["constant", "value", "95 % interval", "unit", "its law"], &rows, Some((&raw_head, &raw)));
}

/// Share of a constant's value from which on half of its interval leaves it hardly known.
const HARDLY: f64 = 0.5;

/// That an interval leaves a constant open, behind its law.
fn hardly(c: &Constant) -> &'static str {
    match c.half / c.value.abs() {
        share if !share.is_finite() || share >= 1.0 => "; not known: the interval spans zero",
        share if share >= HARDLY => "; hardly known: the interval is wider than the value",
        _ => "",
    }
}

pub(super) fn time_label(log: &Log) -> String {
    if log.time_is_row() { "row" } else { "time, s" }.to_owned()
}

/// Samples that are there; a long gap breaks the line.
fn present(t: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut x, mut out): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut steps: Vec<f64> = Vec::new();
    for (t, y) in t.iter().zip(y).filter(|p| p.1.is_finite()) {
        if let Some(last) = x.last() {
            steps.push(t - last);
        }
        x.push(*t);
        out.push(*y);
    }
    let usual = if steps.is_empty() { 0.0 } else { median(&mut steps.clone()) };
    let mut broken = (Vec::with_capacity(x.len()), Vec::with_capacity(x.len()));
    for i in 0..x.len() {
        if i > 0 && steps[i - 1] > 20.0 * usual {
            broken.0.push(x[i]);
            broken.1.push(f64::NAN);
        }
        broken.0.push(x[i]);
        broken.1.push(out[i]);
    }
    broken
}

fn spans(plateaus: &[Plateau]) -> Layer {
    Layer::Spans { name: "plateaus".into(), ranges: plateaus.iter().map(|p| (p.from_s, p.to_s)).collect() }
}

/// The speed over time: of several channels one drawing, and how they differ.
fn speeds_over_time(log: &Log, found: &Identified) -> Vec<Figure> {
    let Some(together) = overlaid(log) else { return SPEED.iter().filter_map(|c| over_time(log, found, c)).collect() };
    let channels = SPEED.into_iter().filter(|c| log.column(c).is_some()).zip(CLASSES);
    let marks = channels.map(|(c, class)| Layer::Marks { name: String::new(), class, marks: means(log, found, c) });
    let layers = std::iter::once(spans(&found.plateaus)).chain(together.layers).chain(marks).collect();
    std::iter::once(Figure { layers, ..together }).chain(differences(log, &found.plateaus)).collect()
}

/// The plateau means of a channel, each to be asked.
fn means(log: &Log, found: &Identified, channel: &str) -> Vec<Mark> {
    let unit = unit_of(channel);
    let mark = |(k, p): (usize, &Plateau)| {
        let (mean, se) = p.of(log, channel)?;
        let text = format!("{}: {} {unit}, {} rows", k + 1, with_half(mean, 1.96 * se), p.rows);
        Some(Mark { x: 0.5 * (p.from_s + p.to_s), y: mean, error: 0.0, text })
    };
    found.plateaus.iter().enumerate().filter_map(mark).collect()
}

/// A value and half of its interval, both to the second digit of the half: in no unit is either told as nothing.
fn with_half(v: f64, half: f64) -> String {
    let second = if half > 0.0 { 1.0 - half.log10().floor() } else { 4.0 };
    let places = second.clamp(0.0, 12.0) as usize;
    format!("{v:.places$} \u{b1} {half:.places$}")
}

fn over_time(log: &Log, found: &Identified, channel: &str) -> Option<Figure> {
    let (x, y) = present(&log.t, log.column(channel)?);
    let marks = means(log, found, channel);
    Some(Figure {
        id: format!("time-{}", channel.replace('_', "-")),
        title: format!("{} over time", heading(channel)),
        x_label: time_label(log),
        y_label: axis(channel),
        layers: vec![
            spans(&found.plateaus),
            Layer::Line { name: words::channel(channel), class: "a", x, y },
            Layer::Marks { name: "means".into(), class: "b", marks },
        ],
        ..Figure::default()
    })
}

/// Every speed channel in one drawing (Figure 5.62); `None` with fewer than two.
pub(super) fn overlaid(log: &Log) -> Option<Figure> {
    let channels: Vec<(&str, &[f64])> = SPEED.into_iter().filter_map(|c| Some((c, log.column(c)?))).collect();
    let layers = channels.iter().zip(CLASSES).map(|((name, values), class)| {
        let (x, y) = present(&log.t, values);
        Layer::Line { name: channel(name), class, x, y }
    });
    (channels.len() > 1).then(|| Figure {
        id: "time-speeds".into(),
        title: "Speed channels over time".into(),
        x_label: time_label(log),
        y_label: "speed, rev/min".into(),
        layers: layers.collect(),
        ..Figure::default()
    })
}

/// The plateau means of every speed channel over the current (Figure 5.61).
fn over_current(log: &Log, found: &Identified) -> Option<Figure> {
    log.column("current_a")?;
    let layers: Vec<Layer> = SPEED
        .into_iter()
        .filter(|c| log.column(c).is_some())
        .zip(CLASSES)
        .map(|(channel, class)| {
            let mark = |p: &Plateau| {
                let ((current, _), (rpm, se)) = (p.of(log, "current_a")?, p.of(log, channel)?);
                let text = format!("{}: {rpm:.1} \u{b1} {:.1} rev/min at {current:.3} A", words::channel(channel), 1.96 * se);
                Some(Mark { x: current, y: rpm, error: 1.96 * se, text })
            };
            Layer::Marks { name: words::channel(channel), class, marks: found.plateaus.iter().filter_map(mark).collect() }
        })
        .collect();
    (!layers.is_empty()).then(|| Figure {
        id: "speed-current".into(),
        title: "Speed over current, plateau means".into(),
        x_label: "current, A".into(),
        y_label: "speed, rev/min".into(),
        layers,
        ..Figure::default()
    })
}

/// Every speed channel less the encoder on the plateaus (on a step the channels' averages lie apart in time), or less the first that there is (Figures
/// 5.59 and 5.63), in per cent.
fn differences(log: &Log, plateaus: &[Plateau]) -> Option<Figure> {
    let present_channels: Vec<&str> = SPEED.into_iter().filter(|c| log.column(c).is_some()).collect();
    let base = present_channels.iter().find(|c| **c == "rpm_encoder").or(present_channels.first())?;
    let reference = log.column(base)?;
    let top = reference.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    let mut settled = vec![false; log.len()];
    plateaus.iter().for_each(|p| settled[p.first..p.first + p.rows].fill(true));
    let layers: Vec<Layer> = present_channels
        .iter()
        .filter(|c| *c != base)
        .zip(["a", "b", "c", "e"])
        .filter_map(|(channel, class)| {
            let difference: Vec<f64> = log
                .column(channel)?
                .iter()
                .zip(reference)
                .zip(&settled)
                .map(|((v, r), on)| if *on && *r > 0.05 * top { 100.0 * (v - r) / r } else { f64::NAN })
                .collect();
            let (x, y) = present(&log.t, &difference);
            Some(Layer::Dots { name: words::channel(channel), class, x, y })
        })
        .collect();
    Some(Figure {
        id: "channel-differences".into(),
        title: format!("Speed channels less {}", words::channel(base)),
        x_label: time_label(log),
        y_label: "difference, %".into(),
        layers,
        ..Figure::default()
    })
}

/// The filters of the binary shift algorithm, Filter 1 over the plateaus that were found (Figures 5.65 to 5.71).
fn binary_shift(log: &Log, found: &Identified) -> Vec<Figure> {
    let Some((channel, values)) = SPEED.iter().find_map(|c| Some((*c, log.column(c)?))) else { return Vec::new() };
    let f = filters(values, &Settings::default());
    let mut figures = filter_figures(log, &f, channel);
    for figure in &mut figures {
        figure.id = format!("binary-shift-{}", figure.id);
        figure.x_label = time_label(log);
        if let Some(Layer::Line { x, y, .. }) = figure.layers.first_mut().filter(|_| figure.id.ends_with("filter-1")) {
            (*x, *y) = present(&log.t[..y.len()], y);
            figure.title = format!("Binary shift, Filter 1: {} stretches, offset {}", f.stretches().len(), f.offset);
            figure.layers.insert(0, spans(&found.plateaus));
        }
    }
    figures
}

fn unscaled(x: &str, value: f64) -> f64 {
    if x == "pulse_us" { 1000.0 + 1000.0 * value } else { 1000.0 * value }
}

/// A relation in words: "thrust over speed".
pub(super) fn over(f: &Fitted) -> String {
    format!("{} over {}", channel(&f.y), channel(f.x))
}

/// Places along a fitted relation, in the fit's own scale.
fn grid(f: &Fitted) -> Vec<f64> {
    let (low, high) = f.curve.range();
    (0..=120).map(|k| low + (high - low) * f64::from(k) / 120.0).collect()
}

/// A fitted relation as a line.
pub(super) fn line(f: &Fitted) -> (Vec<f64>, Vec<f64>) {
    grid(f).into_iter().map(|g| (unscaled(f.x, g), f.curve.at(g))).unzip()
}

/// Labels of its axes.
pub(super) fn axes(f: &Fitted) -> [String; 2] {
    [axis(f.x), axis(&f.y)]
}

/// Its name as an anchor.
pub(super) fn anchor_of(f: &Fitted) -> String {
    f.name.replace(['(', ')'], "-").trim_end_matches('-').to_owned()
}

pub(super) fn relation(f: &Fitted) -> Figure {
    let grid = grid(f);
    let (x, y) = line(f);
    let band = |half: &dyn Fn(f64) -> f64| -> (Vec<f64>, Vec<f64>) {
        grid.iter().zip(&y).map(|(g, y)| (y - half(*g), y + half(*g))).unzip()
    };
    let (curve_low, curve_high) = band(&|g| f.curve.band(g));
    let (next_low, next_high) = band(&|g| f.curve.prediction(g));
    let unit = unit_of(&f.y);
    let marks = |outliers: bool| -> Vec<Mark> {
        f.curve
            .points
            .iter()
            .enumerate()
            .filter(|(i, _)| f.curve.outliers.contains(i) == outliers)
            .map(|(_, p)| {
                let at = unscaled(f.x, p.x);
                Mark {
                    x: at,
                    y: p.y,
                    error: 1.96 * p.y_error,
                    text: format!("{at:.1} {}: {} {unit}", unit_of(f.x), with_half(p.y, 1.96 * p.y_error)),
                }
            })
            .collect()
    };
    let [x_label, y_label] = axes(f);
    let mut layers = vec![
        Layer::Band { name: "further plateau".into(), class: "d", x: x.clone(), lower: next_low, upper: next_high },
        Layer::Band { name: "curve".into(), class: "a", x: x.clone(), lower: curve_low, upper: curve_high },
        Layer::Line { name: format!("order {}", f.degree), class: "a", x, y },
        Layer::Marks { name: "plateaus".into(), class: "b", marks: marks(false) },
    ];
    if !f.curve.outliers.is_empty() {
        layers.push(Layer::Marks { name: "left out".into(), class: "e", marks: marks(true) });
    }
    Figure {
        id: anchor_of(f),
        title: format!("{}, order {} (R2 {:.5})", upper(&over(f)), f.degree, f.curve.r2),
        x_label,
        y_label,
        layers,
        ..Figure::default()
    }
}

/// Both runs in one drawing: speed over time, and every relation that both have.
fn side_by_side(a: (&Log, &Identified), b: (&Log, &Identified)) -> Vec<Figure> {
    let mut out = Vec::new();
    let first_speed = |log: &Log| SPEED.into_iter().find(|c| log.column(c).is_some());
    for (id, title, channels) in [
        ("beside-speed", "Speed of both runs", [first_speed(a.0), first_speed(b.0)]),
        ("beside-current", "Current of both runs", [Some("current_a"); 2]),
    ] {
        let drawn = |log: &Log, channel: Option<&str>| Some(present(&log.t, log.column(channel?)?));
        let (Some((xa, ya)), Some((xb, yb))) = (drawn(a.0, channels[0]), drawn(b.0, channels[1])) else { continue };
        out.push(Figure {
            id: id.into(),
            title: title.into(),
            x_label: time_label(a.0),
            y_label: channels[0].map(axis).unwrap_or_default(),
            layers: vec![
                Layer::Line { name: a.0.name.clone(), class: "a", x: xa, y: ya },
                Layer::Line { name: b.0.name.clone(), class: "b", x: xb, y: yb },
            ],
            ..Figure::default()
        });
    }
    for fa in &a.1.curves {
        let Some(fb) = b.1.curves.iter().find(|f| f.name == fa.name) else { continue };
        let mut layers = Vec::new();
        for (f, class, name) in [(fa, "a", &a.0.name), (fb, "b", &b.0.name)] {
            let (low, high) = f.curve.range();
            let grid: Vec<f64> = (0..=120).map(|k| low + (high - low) * f64::from(k) / 120.0).collect();
            layers.push(Layer::Band {
                name: String::new(),
                class,
                x: grid.iter().map(|g| unscaled(f.x, *g)).collect(),
                lower: grid.iter().map(|g| f.curve.at(*g) - f.curve.band(*g)).collect(),
                upper: grid.iter().map(|g| f.curve.at(*g) + f.curve.band(*g)).collect(),
            });
            layers.push(Layer::Line {
                name: name.clone(),
                class,
                x: grid.iter().map(|g| unscaled(f.x, *g)).collect(),
                y: grid.iter().map(|g| f.curve.at(*g)).collect(),
            });
        }
        // the difference where both were measured, as a read-out at the middle
        let low = fa.curve.range().0.max(fb.curve.range().0);
        let high = fa.curve.range().1.min(fb.curve.range().1);
        let middle = 0.5 * (low + high);
        let difference = fb.curve.at(middle) - fa.curve.at(middle);
        let half = fa.curve.band(middle).hypot(fb.curve.band(middle));
        layers.push(Layer::Marks {
            name: String::new(),
            class: "b",
            marks: vec![Mark {
                x: unscaled(fa.x, middle),
                y: fb.curve.at(middle),
                error: 0.0,
                text: format!("second less first: {difference:.4} \u{b1} {half:.4} {}", unit_of(&fa.y)),
            }],
        });
        out.push(Figure {
            id: format!("beside-{}", fa.name.replace(['(', ')'], "-").trim_end_matches('-')),
            title: format!("{} of both runs", upper(&over(fa))),
            x_label: axis(fa.x),
            y_label: axis(&fa.y),
            layers,
            ..Figure::default()
        });
    }
    out
}

/// Titles of the columns that tell where a plateau begins and ends and how long it settles, and their decimals.
#[must_use]
pub fn when(log: &Log) -> ([&'static str; 3], usize) {
    if log.time_is_row() { (["from row", "to row", "settling, rows"], 0) } else { (["from, s", "to, s", "settling, s"], 2) }
}

pub(super) fn plateaus(sheet: &mut Sheet, log: &Log, found: &Identified) {
    let (names, places) = when(log);
    let mut header: Vec<String> = std::iter::once("plateau").chain(names).chain(["rows"]).map(str::to_owned).collect();
    // what no plateau has a mean of stands in the file alone
    let has = |k: &usize| found.plateaus.iter().any(|p| p.means.get(*k).is_some_and(Option::is_some));
    let shown: Vec<usize> = (0..log.columns.len()).filter(has).collect();
    header.extend(shown.iter().map(|k| axis(&log.columns[*k].name)));
    let rows: Vec<Vec<String>> = found
        .plateaus
        .iter()
        .enumerate()
        .map(|(k, p)| {
            let mut row = vec![
                (k + 1).to_string(),
                format!("{:.places$}", p.from_s),
                format!("{:.places$}", p.to_s),
                format!("{:.places$}", p.settling_s),
                p.rows.to_string(),
            ];
            let mean = |k: &usize| p.means[*k].map_or_else(|| "-".to_owned(), |(v, se)| paired(v, se));
            row.extend(shown.iter().map(mean));
            row
        })
        .collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let (raw_head, raw) = raw_plateaus(log, found);
    let raw_head: Vec<&str> = raw_head.iter().map(String::as_str).collect();
    sheet.listed("plateaus", &header, &rows, Some((&raw_head, &raw)));
}

/// The plateaus with all digits: of each column its mean and the standard error.
fn raw_plateaus(log: &Log, found: &Identified) -> (Vec<String>, Vec<Vec<String>>) {
    let mut head = ["plateau", "from_s", "to_s", "settling_s", "rows"].map(str::to_owned).to_vec();
    head.extend(log.columns.iter().flat_map(|c| [c.name.clone(), format!("{}_se", c.name)]));
    let row = |(k, p): (usize, &Plateau)| {
        let mut row = vec![(k + 1).to_string()];
        row.extend([p.from_s, p.to_s, p.settling_s].map(|v| v.to_string()));
        row.push(p.rows.to_string());
        row.extend(p.means.iter().flat_map(|m| m.map_or_else(Default::default, |(v, se)| [v.to_string(), se.to_string()])));
        row
    };
    (head, found.plateaus.iter().enumerate().map(row).collect())
}

/// Chi-squared of a curve for each degree of freedom, and whether it holds.
fn said(f: &Fitted) -> String {
    let law = Law::of(f.curve.chi2, f.curve.freedom);
    format!("{}, dof {}{}", ratio(law.chi2), law.freedom, if law.holds { "" } else { ", does not hold" })
}

/// Significant digits of a coefficient: a polynomial is known far better than each of its coefficients.
const OF_COEFFICIENT: usize = 7;

/// A coefficient with all digits that its curve asks for, and half of its interval to two.
fn as_known(value: f64, half: f64) -> [String; 2] {
    let to = |v: f64, digits: usize| {
        let near = significant(v, digits);
        if near != 0.0 && !(1e-3..1e7).contains(&near.abs()) { format!("{near:e}") } else { format!("{near}") }
    };
    [to(value, OF_COEFFICIENT), to(half, 2)]
}

/// The unit of a coefficient: the ordinate's for each power of the regressor.
fn unit_of_coefficient(f: &Fitted, k: usize) -> String {
    let regressor = if f.x == "pulse_us" { "kus" } else { "krpm" };
    match k {
        0 => unit_of(&f.y).to_owned(),
        1 => format!("{} per {regressor}", unit_of(&f.y)),
        k => format!("{} per {regressor}^{k}", unit_of(&f.y)),
    }
}

pub(super) fn coefficients(sheet: &mut Sheet, found: &Identified) {
    sheet.say("Regressors: krpm = rpm/1000 and kus = (pulse - 1000)/1000. All digits belong to the curve: its coefficients are known far better together than each alone. Half widths of 95 % intervals. Chi2/dof is the scatter of the plateaus about the curve over what their own errors promise, squared, for each degree of freedom: 1 where both agree; where chance does not explain it (p below 0.01) the curve does not hold, and the interval is as much wider.");
    let rows: Vec<Vec<String>> = found
        .curves
        .iter()
        .flat_map(|f| {
            let chosen = f.orders.iter().find(|o| o.chosen).map_or_else(|| "-".to_owned(), |o| o.degree.to_string());
            (0..=f.degree).map(move |k| {
                let c = f.curve.coefficient(k);
                let (chi2, chosen) = if k == 0 { (said(f), chosen.clone()) } else { Default::default() };
                let [value, half] = as_known(c.value, c.half);
                vec![over(f), format!("c{k}"), value, half, unit_of_coefficient(f, k), chi2, chosen]
            })
        })
        .collect();
    sheet.listed(
        "coefficients",
        &["relation", "coefficient", "value", "\u{b1}", "unit", "chi2/dof", "order by AICc"],
        &rows,
        None,
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::identify;
    use crate::log::Column;

    fn constant(value: f64, half: f64) -> Constant {
        Constant { name: "k_T", value, se: half / 1.96, half, unit: "N.s2", law: None }
    }

    #[test]
    fn an_interval_that_leaves_all_open_is_told() {
        assert_eq!(hardly(&constant(1.5e-5, 1e-6)), "");
        assert!(hardly(&constant(1.5e-5, 0.9e-5)).starts_with("; hardly known"));
        assert!(hardly(&constant(1.5e-5, 2e-5)).contains("spans zero"));
        assert!(hardly(&constant(0.0, 0.0)).contains("not known"));
    }

    /// A polynomial can be used with what the page prints of it.
    #[test]
    fn coefficients_have_the_digits_of_their_curve() {
        assert_eq!(as_known(-21.345_678_9, 201.3), ["-21.34568", "200"]);
        assert_eq!(as_known(1.234_567_89e-5, 1.26e-6), ["1.234568e-5", "1.3e-6"]);
        assert_eq!(as_known(8_437.123_456, 0.0), ["8437.123", "0"]);
    }

    /// A staircase with these speed channels, all alike.
    fn staircase(speeds: &[&str]) -> Log {
        let t: Vec<f64> = (0..600).map(|i| 0.1 * f64::from(i)).collect();
        let pulse: Vec<f64> = t.iter().map(|t| 1100.0 + 80.0 * (t / 10.0).floor()).collect();
        let wave = |i: usize| (0.7 * (i * i) as f64).sin();
        let rpm: Vec<f64> = pulse.iter().enumerate().map(|(i, p)| 7.0 * (p - 1000.0) + 4.0 * wave(i)).collect();
        let thrust = rpm.iter().enumerate().map(|(i, r)| 1e-7 * r * r + 0.01 * wave(i + 3)).collect();
        let speeds = speeds.iter().map(|name| (*name, rpm.clone()));
        let columns = std::iter::once(("pulse_us", pulse)).chain(speeds).chain([("thrust_n", thrust)]);
        let columns = columns.map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        Log { name: "run.csv".to_owned(), t, columns, ..Log::default() }
    }

    /// Rows without a time are told as rows, in tables and on axes.
    #[test]
    fn without_a_time_a_page_says_rows() {
        let timed = staircase(&["rpm_beam", "rpm_encoder"]);
        let t = (0..timed.len()).map(|i| i as f64).collect();
        let rows = Log { meta: [("time".to_owned(), "row".into())].into(), t, ..timed.clone() };
        let page = |log: &Log| run(log, &identify(log).expect("a log"), None).html();
        let (timed, rows) = (page(&timed), page(&rows));
        let seconds = "<th>from, s</th><th>to, s</th><th>settling, s</th>";
        let told = "<th>from row</th><th>to row</th>";
        assert!(timed.contains(seconds) && !timed.contains(told));
        assert!(rows.contains(told) && !rows.contains(", s<"), "{}", &rows[rows.find(", s<").unwrap_or(0)..][..200]);
    }

    #[test]
    fn a_value_in_a_large_unit_keeps_its_digits() {
        assert_eq!(with_half(2.34e-5, 1.26e-6), "0.0000234 \u{b1} 0.0000013");
        assert_eq!(with_half(5563.24, 0.42), "5563.24 \u{b1} 0.42");
        assert_eq!(with_half(-1.0, 0.0), "-1.0000 \u{b1} 0.0000");
    }

    /// Two speed sensors share a drawing, with how they differ beneath; one has a drawing of its own.
    #[test]
    fn speed_channels_share_a_drawing() {
        let titles = |names: &[&str]| -> Vec<String> {
            let log = staircase(names);
            let found = identify(&log).expect("a log");
            speeds_over_time(&log, &found).into_iter().map(|f| f.title).collect()
        };
        let two = titles(&["rpm_beam", "rpm_encoder"]);
        assert_eq!(two[0], "Speed channels over time");
        assert!(two.len() == 2 && two[1].starts_with("Speed channels less"), "{two:?}");
        assert_eq!(titles(&["rpm_beam"]).len(), 1);
    }

    /// Without a plateau the page says so once, and has no table without rows.
    #[test]
    fn a_run_without_a_plateau_has_no_empty_tables() {
        let log = staircase(&["rpm"]);
        let found = identify(&log).expect("a log");
        let with = run(&log, &found, None).html();
        assert!(!found.plateaus.is_empty() && with.contains("Coefficients") && !with.contains("No plateau was found"));
        let none = Identified { plateaus: Vec::new(), levels: Vec::new(), curves: Vec::new(), ..found };
        let html = run(&log, &none, None).html();
        assert!(html.contains("No plateau was found") && !html.contains("Coefficients") && !html.contains("Relations, with"));
    }
}
