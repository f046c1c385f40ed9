//! The binary shift algorithm as pictures: each filter, and the threshold study.
//!
//! What it is: the channel with what was found, Filters 1 to 6 below each other, and score and error over threshold and offset.
//! What can go wrong: nothing; missing samples lift the pen.
//! Units: the channel's; samples.
//! Reference: Beharie 2013, Figures 5.65 to 5.71 (filters) and 5.82 to 5.84 (thresholds).

use super::figure::{Figure, Layer};
use super::run::time_label;
use crate::channel::unit_of;
use crate::log::Log;
use crate::plateau::shift::Filters;
use crate::plateau::study::{OFFSETS, Tried};
use crate::verdict::words;

/// Filters 2 to 6 one above the other over time, and Filter 1 with its threshold.
#[must_use]
pub fn filter_figures(log: &Log, f: &Filters, channel: &str) -> Vec<Figure> {
    let t = log.t.as_slice();
    let per = format!("{} per sample", unit_of(channel));
    let one = Figure {
        id: "filter-1".into(),
        title: format!("Filter 1 of {}", words::channel(channel)),
        x_label: time_label(log),
        y_label: per,
        layers: vec![
            Layer::Line { name: "|x[n+1] - x[n]|".into(), class: "a", x: t[..f.one.len()].to_vec(), y: f.one.clone() },
            Layer::Level { y: f.threshold, text: format!("threshold {:.3}", f.threshold) },
        ],
        ..Figure::default()
    };
    let on = |v: &[bool]| v.iter().map(|b| f64::from(*b)).collect::<Vec<f64>>();
    let six = f.six.iter().map(|v| 0.5 + 0.5 * f64::from(*v)).collect();
    let traces = [on(&f.two), on(&f.three), on(&f.four), on(&f.five), six];
    let layers = traces
        .into_iter()
        .zip([("2", "a"), ("3, later", "b"), ("4, earlier", "c"), ("5", "e"), ("6", "f")])
        .enumerate()
        .map(|(k, (trace, (name, class)))| {
            // stacked downwards with a gap between
            let floor = 1.4 * (4 - k) as f64;
            let (x, y) = stairs(t, &trace, floor);
            Layer::Line { name: name.to_owned(), class, x, y }
        })
        .collect();
    let logic = Figure {
        id: "filters-2-to-6".into(),
        title: format!("Filters 2 to 6 of {}, offset {} samples", words::channel(channel), f.offset),
        x_label: time_label(log),
        y_label: "off - on, stacked".into(),
        layers,
        ..Figure::default()
    };
    vec![one, logic]
}

/// A logical trace as upright edges: only its changes.
fn stairs(t: &[f64], trace: &[f64], floor: f64) -> (Vec<f64>, Vec<f64>) {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for (i, (t, v)) in t.iter().zip(trace).enumerate() {
        let edge = i == 0 || trace[i - 1] != *v || i + 1 == trace.len();
        if edge {
            if i > 0 {
                x.push(*t);
                y.push(floor + trace[i - 1]);
            }
            x.push(*t);
            y.push(floor + v);
        }
    }
    (x, y)
}

/// Share of the levels found with a right mean, wrong stretches, and error of the means over the threshold, a line an offset.
#[must_use]
pub fn study_figures(study: &[Tried], channel: &str, id: &str) -> Vec<Figure> {
    let value = |name: &str, of: &dyn Fn(&Tried) -> f64| -> Vec<Layer> {
        OFFSETS
            .iter()
            .zip(["a", "b", "c", "e", "f"])
            .map(|(offset, class)| {
                let tried: Vec<&Tried> = study.iter().filter(|t| t.offset == *offset).collect();
                Layer::Line {
                    name: format!("{name}{offset}"),
                    class,
                    // thresholds span decades
                    x: tried.iter().map(|t| t.threshold.max(1e-3).log10()).collect(),
                    y: tried.iter().map(|t| of(t)).collect(),
                }
            })
            .chain([0.2_f64, 0.7, 1.2].map(|v| Layer::Rule { x: v.log10(), text: format!("{v}") }))
            .collect()
    };
    let x_label = format!("log10 of the threshold, {} per sample", unit_of(channel));
    let error = |t: &Tried| if t.score.found > 0 && t.score.rms() > 0.0 { t.score.rms() } else { f64::NAN };
    let figure = |what: &str, title: String, y_label: String, layers: Vec<Layer>| Figure {
        id: format!("{id}-{what}"),
        title,
        x_label: x_label.clone(),
        y_label,
        layers,
        ..Figure::default()
    };
    vec![
        figure(
            "found",
            format!("Levels of {channel} found with a right mean"),
            "share".into(),
            value("offset ", &|t| t.score.share()),
        ),
        figure(
            "wrong",
            "Stretches that are no level".into(),
            "for each level".into(),
            value("offset ", &|t| t.score.wrong as f64 / t.score.truths.max(1) as f64),
        ),
        figure(
            "error",
            "Error of the means of what was found".into(),
            format!("rms, {}", unit_of(channel)),
            value("offset ", &error),
        ),
    ]
}
