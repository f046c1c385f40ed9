//! The page of an inertial log's closed loop.
//!
//! What it is: the traces of the three sensors handed to the page that every closed loop has, and the run itself.
//! What can go wrong: nothing; sensors that were not predicted have no figure.
//! Units: on the axes.
//! Reference: specification `closing-the-loop.md`, step 8.

use crate::flight::effects;
use crate::inertial::Recording;
use crate::inertial::{Closed, Sensor};
use crate::report::closed::{self as parts, Page, Trace};
use crate::report::{Figure, Layer, Origin, Vocabulary};
use crate::verdict::EffectEntry;
use crate::verdict::words::{Clause, channel, channels, heading, lower, parameter};
use nalgebra::Vector3;

/// The words of an inertial unit's causes.
pub const VOCABULARY: Vocabulary = Vocabulary {
    noun: "board",
    declared: "a constant field, gravity alone, constant offsets",
    held_out: "every fifth stretch of time, in five turns",
    figures: parts::ALL_ROWS,
    about: effects::about,
    clause,
    parameter: named,
    by_floors: true,
};

/// A parameter in words: what it is, and of which axis.
fn named(id: &str, name: &str) -> String {
    let axis = |at: usize| name.get(at..=at).unwrap_or_default();
    match (id, name) {
        ("soft_iron", _) if name.starts_with("s_") => format!("share of the field ({}) read as ({})", axis(3), axis(2)),
        ("g_sensitivity", _) if name.starts_with("g_") => {
            format!("turn rate ({}) for each specific force ({})", axis(2), axis(3))
        }
        ("unknown", _) => match name.split_once('_') {
            Some((of, "t")) => format!("{}, drift", channel(of)),
            Some((of, with)) => format!("{} for each {}", channel(of), channel(with)),
            None => parameter(name),
        },
        ("linear_acceleration", "width") => "width of the smoothing bell".to_owned(),
        ("linear_acceleration", "rms_down") => "acceleration up and down, rms".to_owned(),
        ("linear_acceleration", _) if name.starts_with("rms_") => {
            format!("acceleration along {}, rms", name.trim_start_matches("rms_"))
        }
        ("vibration", "rms") => "strength, rms".to_owned(),
        ("vibration", "level_ratio") => "strength over the quietest tenth".to_owned(),
        ("stationary_magnet", "rms") => "change of the field, rms".to_owned(),
        ("stationary_magnet", "peak") => "change of the field, largest".to_owned(),
        ("stationary_magnet", "peak_time") => "time of the largest".to_owned(),
        ("stationary_magnet", "knots") => "time between knots of the curve".to_owned(),
        ("hard_iron", _) if name.starts_with("offset_") => format!("added to the field ({})", axis(7)),
        ("lever_arm", _) if name.starts_with("arm_") => format!("place of the sensor ({})", axis(4)),
        _ => parameter(name),
    }
}

/// Causes that have no page in the flight's library.
fn clause(found: &EffectEntry) -> Clause {
    let on = channels(&found.channels);
    match found.id.as_str() {
        "stationary_magnet" => Clause::new("a magnet beside the board", "disturbs the field"),
        "vibration" => Clause::new("vibration", format!("is in {on}")),
        "linear_acceleration" => Clause::new("the unit itself", "is accelerated"),
        _ => effects::said(found).unwrap_or_else(|| parts::bare(found)),
    }
}

/// The report as one self-contained page.
#[must_use]
pub fn page(recording: &Recording, closed: &Closed, origin: Origin) -> String {
    let v = &closed.verdict;
    let traces: Vec<Trace> = closed.sensors.iter().flat_map(|s| (0..3).map(move |k| trace(recording, s, k))).collect();
    let page = Page {
        verdict: v,
        words: VOCABULARY,
        news: false,
        origin,
        declared: "Declared: a field that is constant in earth axes, gravity and a constant offset, a constant offset of the gyro at rest. The attitude comes from gyro and accelerometer alone.".to_owned(),
        hero: parts::most(v, VOCABULARY, &traces),
        cards: cards(recording, closed),
        left: parts::rest(v, &traces),
        readings: Vec::new(),
        parameters: Vec::new(),
        speeds: ("", Vec::new()),
    };
    let mut sheet = parts::begin(&page);
    let every = traces.iter().map(|t| parts::over_time(t, "every", parts::pair(v))).collect();
    sheet.fold("Every channel in figures", |sheet| sheet.figures(every));
    sheet.fold("The run", |sheet| sheet.figures(closed.sensors.iter().map(|s| parts::thinned(overview(recording, s))).collect()));
    parts::aside(&mut sheet, v);
    sheet.html()
}

fn trace(recording: &Recording, sensor: &Sensor, axis: usize) -> Trace {
    let measured = sensor.measured(recording);
    let left =
        |predicted: &[Vector3<f64>]| -> Vec<f64> { measured.iter().zip(predicted).map(|(m, p)| m[axis] - p[axis]).collect() };
    Trace {
        channel: sensor.channels[axis].to_owned(),
        unit: sensor.unit.to_owned(),
        floor: sensor.floor[axis],
        time_label: "time, s".to_owned(),
        t: recording.t.clone(),
        before: left(&sensor.declared),
        after: left(&sensor.corrected),
    }
}

/// Figures of each effect: what the axis of which its text tells the error leaves over without it and with it, over the variable that it goes with.
fn cards(recording: &Recording, closed: &Closed) -> Vec<Vec<Figure>> {
    closed.verdict.effects.iter().enumerate().map(|(k, e)| card(recording, closed, k, e).into_iter().collect()).collect()
}

fn card(recording: &Recording, closed: &Closed, k: usize, e: &EffectEntry) -> Option<Figure> {
    let first = e.channels.first()?;
    let sensor = closed.sensors.iter().find(|s| s.channels.contains(&first.as_str()))?;
    let shown = sensor.shown.iter().find(|s| s.id == e.id)?;
    let whole = trace(recording, sensor, shown.axis);
    let before = whole.after.iter().zip(&shown.added).map(|(after, added)| after + added).collect();
    let trace = whole.with_before(before);
    let id = format!("effect-{}", k + 1);
    Some(match &shown.over {
        Some(over) => parts::against(&trace, &id, (&over.name, over.unit), &over.values, parts::ALONE),
        None => shown
            .seconds
            .and_then(|wide| parts::part(&trace, &id, parts::ALONE, wide))
            .unwrap_or_else(|| parts::over_time(&trace, &id, parts::ALONE)),
    })
}

fn overview(recording: &Recording, sensor: &Sensor) -> Figure {
    let measured = sensor.measured(recording);
    let line = |k: usize| Layer::Line {
        name: channel(sensor.channels[k]),
        class: ["a", "b", "c"][k],
        x: recording.t.clone(),
        y: measured.iter().map(|m| m[k]).collect(),
    };
    let quantity = heading(sensor.channels[0]);
    let quantity = quantity.trim_end_matches(" (x)");
    Figure {
        id: format!("run-{}", sensor.channels[0]),
        title: format!("{quantity} as measured"),
        x_label: "time, s".to_owned(),
        y_label: format!("{}, {}", lower(quantity), sensor.unit),
        layers: (0..3).map(line).collect(),
        height: 260.0,
        ..Figure::default()
    }
}
