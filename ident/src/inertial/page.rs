//! The page of an inertial log's closed loop.
//!
//! What it is: verdict, table before and after, parameters with intervals, and the residual of every channel before and after.
//! What can go wrong: nothing; sensors that were not predicted have no figure.
//! Units: on the axes.
//! Reference: specification `closing-the-loop.md`, step 8.

use super::Recording;
use super::account::{Closed, Sensor};
use crate::report::{Figure, Layer, Sheet, number};
use crate::verdict::Kind;
use nalgebra::Vector3;

/// The report as one self-contained page.
#[must_use]
pub fn page(recording: &Recording, closed: &Closed) -> String {
    let v = &closed.verdict;
    let mut sheet = Sheet::new(&format!("Closing the loop on {}", v.run));
    let ids: Vec<&str> = v.effects.iter().map(|e| e.id.as_str()).collect();
    sheet.say(&match v.verdict {
        Kind::Attributed => format!("Attributed: the declared model lacks {}.", ids.join(" and ")),
        Kind::Ambiguous => format!("Ambiguous: {} explains the residual, and so do others.", ids.join(" and ")),
        Kind::Unattributed => "Unattributed: no known cause explains what is left over.".to_owned(),
        Kind::None => "Nothing significant is left over.".to_owned(),
    });
    sheet.say("Declared: a field that is constant in earth axes, gravity and a constant offset, a constant offset of the gyro at rest. The attitude comes from gyro and accelerometer alone. Held-out: stretches of the run predicted by a fit that did not see them.");
    sheet.errors(&v.channels);
    for e in &v.effects {
        sheet.section(&format!("{} (p = {:.2})", e.id, e.probability));
        sheet.say(&e.equation);
        sheet.say(&format!("{}.", e.evidence));
        let rows: Vec<Vec<String>> = e
            .parameters
            .iter()
            .map(|p| {
                vec![p.name.clone(), number(p.value), format!("{} to {}", number(p.ci95[0]), number(p.ci95[1])), p.unit.clone()]
            })
            .collect();
        sheet.table(&["parameter", "value", "95 % interval", "unit"], &rows, |_| false);
    }
    if let Some(next) = &v.next_experiment {
        sheet.section("Next experiment");
        sheet.say(&next.why);
    }
    sheet.section("What was left over, and what is left now");
    for s in &closed.sensors {
        sheet.figures((0..3).map(|k| figure(recording, s, k)).collect());
    }
    sheet.section("The run");
    sheet.figures(closed.sensors.iter().map(|s| overview(recording, s)).collect());
    sheet.html()
}

fn figure(recording: &Recording, sensor: &Sensor, axis: usize) -> Figure {
    let measured = sensor.measured(recording);
    let left =
        |predicted: &[Vector3<f64>]| -> Vec<f64> { measured.iter().zip(predicted).map(|(m, p)| m[axis] - p[axis]).collect() };
    let line = |name: &str, class, y| Layer::Line { name: name.to_owned(), class, x: recording.t.clone(), y };
    Figure {
        id: format!("residual-{}", sensor.channels[axis]),
        title: format!("{}: measured - predicted", sensor.channels[axis]),
        x_label: "time, s".to_owned(),
        y_label: format!("residual, {}", sensor.unit),
        layers: vec![line("before", "b", left(&sensor.declared)), line("after", "a", left(&sensor.corrected))],
        height: 260.0,
        categories: Vec::new(),
    }
}

fn overview(recording: &Recording, sensor: &Sensor) -> Figure {
    let measured = sensor.measured(recording);
    let line = |k: usize| Layer::Line {
        name: sensor.channels[k].to_owned(),
        class: ["a", "b", "c"][k],
        x: recording.t.clone(),
        y: measured.iter().map(|m| m[k]).collect(),
    };
    Figure {
        id: format!("run-{}", sensor.channels[0]),
        title: format!("{} as measured", sensor.channels.join(", ")),
        x_label: "time, s".to_owned(),
        y_label: sensor.unit.to_owned(),
        layers: (0..3).map(line).collect(),
        height: 260.0,
        categories: Vec::new(),
    }
}
