//! A control chart as a figure: one measure, run by run.
//!
//! What it is: each run with its interval, centre and limits of the runs before the first change, the level after each change, the gaps.
//! What can go wrong: nothing; a run that does not tell the measure has no point.
//! Units: on the axis; runs are numbered from 1.
//! Reference: Shewhart 1931; Montgomery, individuals chart.

use super::bracketed;
use crate::history::{Chart, History, Kind};
use crate::report::closed::slug;
use crate::report::figure::{Figure, Layer, Mark};
use crate::verdict::words::upper;

/// Height of a chart in the drawing's units.
const HIGH: f64 = 250.0;

/// The chart of a measure; nothing where no run before the change tells it.
pub(super) fn chart(history: &History, measure: usize) -> Option<Figure> {
    let of = &history.measures[measure];
    let chart = Chart::of(history, measure)?;
    let (factor, unit) = prefixed(chart.centre, &of.unit);
    let n = history.runs.len() as f64;
    let ends = vec![0.5, n + 0.5];
    let band = chart.low.zip(chart.high).map(|(low, high)| Layer::Band {
        name: String::new(),
        class: "d",
        x: ends.clone(),
        lower: vec![factor * low; 2],
        upper: vec![factor * high; 2],
    });
    let line = |class, x, y: f64| Layer::Line { name: String::new(), class, x, y: vec![factor * y; 2] };
    let mut layers: Vec<Layer> = band.into_iter().chain([line("d", ends, chart.centre)]).collect();
    layers.extend(levels(history, measure).into_iter().map(|(x, y)| line("b", x.to_vec(), y)));
    let (inside, outside): (Vec<Mark>, Vec<Mark>) = marks(history, measure).into_iter().partition(|m| !chart.is_outside(m.y));
    for (class, mut marks) in [("a", inside), ("b", outside)] {
        marks.iter_mut().for_each(|m| (m.y, m.error) = (factor * m.y, factor * m.error));
        layers.push(Layer::Marks { name: String::new(), class, marks });
    }
    let steps = history.changes.iter().filter(|c| c.kind == Kind::Step);
    layers.extend(steps.map(|c| Layer::Rule { x: c.first as f64 + 0.5, text: String::new() }));
    Some(Figure {
        id: format!("chart-{}", slug(&of.name)),
        title: format!("{}{}", upper(&of.words), moved(history, measure)),
        x_label: "run".into(),
        y_label: unit,
        layers,
        height: HIGH,
        ..Figure::default()
    })
}

/// The factor and the unit in which a small value has digits that tell its ticks apart.
fn prefixed(value: f64, unit: &str) -> (f64, String) {
    if value == 0.0 || value.abs() >= 1e-3 {
        return (1.0, unit.to_owned());
    }
    let power = -3.0 * (value.abs().log10() / 3.0).floor();
    (10f64.powf(power), format!("1e-{power} {unit}"))
}

/// By how much it moved, behind the measure's name.
fn moved(history: &History, measure: usize) -> String {
    let moves = history.changes.iter().flat_map(|c| c.moved.iter().filter(move |m| m.measure == measure));
    moves.map(|m| format!("; {}", crate::history::by(history, m))).collect()
}

fn marks(history: &History, measure: usize) -> Vec<Mark> {
    let unit = &history.measures[measure].unit;
    let of = |(k, run): (usize, &crate::history::Entry)| {
        let v = run.values[measure]?;
        let text = format!("{}: {} {unit}", history.label(k), bracketed(v));
        Some(Mark { x: k as f64 + 1.0, y: v.value, error: v.half(), text })
    };
    history.runs.iter().enumerate().filter_map(of).collect()
}

/// Where a measure that moved lies between the changes that moved it: the mean of those runs.
fn levels(history: &History, measure: usize) -> Vec<([f64; 2], f64)> {
    let steps = history.changes.iter().filter(|c| c.kind == Kind::Step && c.moved.iter().any(|m| m.measure == measure));
    let mut from: Vec<usize> = steps.map(|c| c.first).collect();
    from.push(history.runs.len());
    let mean = |ends: &[usize]| {
        let own: Vec<f64> = history.runs[ends[0]..ends[1]].iter().filter_map(|r| Some(r.values[measure]?.value)).collect();
        let ends = [ends[0] as f64 + 0.5, ends[1] as f64 + 0.5];
        (!own.is_empty()).then(|| (ends, own.iter().sum::<f64>() / own.len() as f64))
    };
    from.windows(2).filter_map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::tests::stepped;

    #[test]
    fn a_small_unit_is_told_in_powers_of_a_thousand() {
        let (factor, unit) = prefixed(1.56e-5, "N.s2");
        assert!((factor - 1e6).abs() < 1e-3 && unit == "1e-6 N.s2", "{factor} {unit}");
        assert_eq!(prefixed(0.02, "ohm"), (1.0, "ohm".to_owned()));
    }

    /// No band is drawn out of which no run can lie.
    #[test]
    fn a_few_runs_have_no_band() {
        let has_band = |runs: usize| {
            let figure = chart(&stepped(runs, runs), 0).expect("a chart");
            figure.layers.iter().any(|l| matches!(l, Layer::Band { .. }))
        };
        assert!(!has_band(10) && has_band(11));
    }

    #[test]
    fn runs_after_the_change_stand_outside_the_limits_of_those_before() {
        let history = stepped(12, 7);
        let figure = chart(&history, 0).expect("a chart");
        let marks = |class: &str| {
            let of = |l: &Layer| match l {
                Layer::Marks { class: own, marks, .. } if *own == class => Some(marks.iter().map(|m| m.x).collect::<Vec<_>>()),
                _ => None,
            };
            figure.layers.iter().find_map(of).expect("marks")
        };
        assert_eq!(marks("a"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert_eq!(marks("b"), [8.0, 9.0, 10.0, 11.0, 12.0]);
        assert!(figure.layers.iter().any(|l| matches!(l, Layer::Rule { x, .. } if *x == 7.5)));
        assert!(figure.title.starts_with("Measure 0; from "), "{}", figure.title);
        let quiet = chart(&history, 1).expect("a chart");
        assert_eq!(quiet.title, "Measure 1");
    }
}
