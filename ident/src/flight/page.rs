//! The page of a flight's closed loop.
//!
//! What it is: the traces of the flight's channels handed to the page that every closed loop has, what this flight can show, and the residual of
//! every channel before and after.
//! What can go wrong: nothing; channels that the flight lacks have no figure.
//! Units: on the axes.
//! Reference: specification `closing-the-loop.md`, step 8.

use super::close::Closed;
use super::nameless::Variable;
use super::scene::Scene;
use super::windows::LENGTH_S;
use crate::effects::airframe;
use crate::report::closed::{self as parts, Page, Trace};
use crate::report::{Figure, Layer, Origin, Vocabulary};
use crate::words::parameter;

/// The words of the flight's library.
pub const VOCABULARY: Vocabulary = Vocabulary {
    noun: "vehicle",
    about: airframe::about,
    clause: |found| airframe::said(found).unwrap_or_else(|| parts::bare(found)),
    of_every_rig: |found| found.id == "spinup_lag",
    parameter: |_, name| parameter(name),
};

/// The report as one self-contained page.
#[must_use]
pub fn page(closed: &Closed, origin: Origin) -> String {
    let v = &closed.verdict;
    let rows = closed.flight.windows.rows();
    let ms = 1000.0
        * LENGTH_S.max(
            closed.flight.windows.bounds.first().map_or(0.0, |(a, b)| closed.flight.record.t[b - 1] - closed.flight.record.t[*a]),
        );
    let traces: Vec<Trace> = (0..closed.predicted.len()).map(|k| trace(closed, k)).collect();
    let page = Page {
        verdict: v,
        words: VOCABULARY,
        news: origin.model.is_some(),
        origin,
        declared: format!(
            "Declared: thrust with the square of each rotor's speed along -z, reaction torque, a rigid body, speeds that follow their pulses, a constant voltage; no drag. Specific force, rate and field are means over windows of {rows} rows (about {ms:.0} ms), angular acceleration is the slope of the gyro in them; speeds and voltage are told as logged."
        ),
        hero: parts::most(v, &traces),
        cards: cards(closed, &traces),
        left: parts::rest(v, &traces),
        parameters: Vec::new(),
        speeds: Vec::new(),
    };
    let mut sheet = parts::begin(&page);
    sheet.fold("Every channel in figures", |sheet| sheet.figures(figures(closed).into_iter().map(parts::thinned).collect()));
    sheet.fold("What this flight can show", |sheet| {
        sheet.say("For each cause: the share of its signal that nothing in the declared model can stand for, and the signal over noise that it would have at its usual size. Where these are not enough it is not named, whatever the residual.");
        let shown: Vec<Vec<String>> = closed
            .asked
            .iter()
            .map(|a| {
                let enough = if a.enough { "yes" } else { "no" };
                vec![a.name.clone(), format!("{:.3}", a.angle), format!("{:.1}", a.signal), enough.to_owned()]
            })
            .collect();
        sheet.data("causes", &["cause", "share of its own", "signal over noise", "can be named"], &shown, None);
    });
    parts::aside(&mut sheet, v);
    sheet.html()
}

/// Of each effect what its first channel leaves over without it and with it, against the variable that it depends on; over time where that is no
/// column of windows, before and after all effects where it only shapes what others add.
fn cards(closed: &Closed, traces: &[Trace]) -> Vec<Vec<Figure>> {
    let v = &closed.verdict;
    let scene = Scene::declared(&closed.flight.record);
    let mut out = parts::each(v, traces);
    for (k, (card, (e, adds))) in out.iter_mut().zip(v.effects.iter().zip(&closed.adds)).enumerate() {
        let at = traces.iter().position(|t| e.channels.first() == Some(&t.channel));
        let Some((trace, added)) = at.and_then(|at| Some((&traces[at], adds.get(at)?))) else { continue };
        if added.iter().all(|a| *a == 0.0) {
            continue;
        }
        let without = trace.with_before(trace.after.iter().zip(added).map(|(r, a)| r + a).collect());
        let variable = e.depends_on.iter().find_map(|name| {
            let variable = Variable::meant(name, &trace.channel)?;
            Some((variable, variable.values(&closed.flight, &scene)?))
        });
        let id = format!("effect-{}", k + 1);
        *card = vec![match variable {
            Some((variable, x)) => parts::against(&without, &id, (variable.name(), variable.unit()), &x, parts::ALONE),
            None => parts::over_time(&without, &id, parts::ALONE),
        }];
    }
    out
}

fn trace(closed: &Closed, k: usize) -> Trace {
    let c = &closed.flight.channels.channels[k];
    let [before, after] = &closed.predicted[k];
    let left = |p: &[f64]| -> Vec<f64> { c.y.iter().zip(p).map(|(y, p)| y - p).collect() };
    Trace {
        channel: c.name.clone(),
        unit: c.unit.to_string(),
        floor: closed.verdict.channels.get(&c.name).map_or(0.0, |c| c.noise_floor_rms),
        time_label: "time, s".to_owned(),
        t: closed.flight.windows.t.clone(),
        before: left(before),
        after: left(after),
    }
}

/// Residual of each channel before and after.
#[must_use]
pub fn figures(closed: &Closed) -> Vec<Figure> {
    (0..closed.predicted.len()).map(|k| residual(closed, k)).collect()
}

fn residual(closed: &Closed, channel: usize) -> Figure {
    let (c, t) = (&closed.flight.channels.channels[channel], &closed.flight.windows.t);
    let [before, after] = &closed.predicted[channel];
    // gaps lift the pen
    let gap = 5.0 * crate::attribution::noise::usual_step(t);
    let line = |name: &str, class, predicted: &[f64]| {
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for i in 0..t.len() {
            if i > 0 && t[i] - t[i - 1] > gap {
                x.push(t[i - 1] + 0.5 * gap);
                y.push(f64::NAN);
            }
            x.push(t[i]);
            y.push(c.y[i] - predicted[i]);
        }
        Layer::Line { name: name.to_owned(), class, x, y }
    };
    Figure {
        id: format!("residual-{}", c.name),
        title: format!("{}: measured - predicted", c.name),
        x_label: "time, s".to_owned(),
        y_label: format!("residual, {}", c.unit),
        layers: vec![line("before", "b", before), line("after", "a", after)],
        height: 260.0,
        categories: Vec::new(),
        captioned: false,
    }
}
